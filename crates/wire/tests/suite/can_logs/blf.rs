use std::ops::ControlFlow;

use atvrec_wire::can_log::{Entry, Error, Stamps, Summary, blf};
use miniz_oxide::deflate::compress_to_vec_zlib;
use proptest::prelude::*;

use super::reference::{assert_rows, cursor, entries, folders, rows};

fn read(bytes: &[u8]) -> Result<(Vec<Entry>, Summary), Error> {
    entries(|sink| blf::read(&mut cursor(bytes), sink))
}

#[test]
fn files_give_the_frames_of_the_reference() {
    for folder in folders("blf") {
        let name = folder.display().to_string();
        let bytes = std::fs::read(folder.join("trace.blf")).expect("a file");
        let (entries, summary) = read(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        println!("{name}: {summary:?}");
        assert_eq!(summary.stamps, Stamps::SinceStart);
        let rows = rows(&folder);
        if name.ends_with("size-zero") {
            // The reader finds the next object behind the defect: six frames.
            assert_rows(&name, (&entries[..3], &summary), &rows);
            assert_eq!(entries.len(), 6);
        } else {
            assert_rows(&name, (&entries, &summary), &rows);
        }
        let damaged = name.contains("cut-") || name.ends_with("size-zero");
        assert_eq!(summary.defects.is_empty(), !damaged, "{name}: {summary:?}");
    }
}

#[test]
fn a_damaged_container_costs_only_itself() {
    let Some(mut bytes) = super::reference::file("blf/many-containers-compressed/trace.blf") else {
        return;
    };
    let (whole, _) = read(&bytes).expect("a file");
    // A byte in the middle of the second container's data.
    bytes[0x900] ^= 0xFF;
    let (rest, summary) = read(&bytes).expect("a file");
    assert!(!summary.defects.is_empty());
    assert!(
        rest.len() > 600 && rest.len() < whole.len(),
        "{}",
        rest.len()
    );
    assert_eq!(rest.last(), whole.last());
}

#[test]
fn the_sink_ends_the_reading() {
    let Some(bytes) = super::reference::file("blf/many-containers-plain/trace.blf") else {
        return;
    };
    let mut count = 0;
    let mut sink = |_| {
        count += 1;
        if count == 5 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let summary = blf::read(&mut cursor(&bytes), &mut sink).expect("a file");
    assert_eq!((summary.frames, count), (5, 5));
}

#[test]
fn another_format_is_named_by_its_first_bytes() {
    let error = read(b"MDF     4.10    ").expect_err("no BLF file");
    assert!(error.to_string().contains("MDF     4.10"), "{error}");
    assert!(read(b"").is_err());
}

/// An object of a classic frame.
fn message(id: u32, size: u32) -> Vec<u8> {
    let mut object = b"LOBJ".to_vec();
    object.extend([32_u16, 1].iter().flat_map(|number| number.to_le_bytes()));
    object.extend(
        [size, 1, 2, 0]
            .iter()
            .flat_map(|number| number.to_le_bytes()),
    );
    object.extend(u64::from(id).to_le_bytes());
    object.extend([1, 0, 0, 2]);
    object.extend(id.to_le_bytes());
    object.extend([id as u8, 0xAA, 0, 0, 0, 0, 0, 0]);
    object
}

/// A container, which claims a size.
fn container(content: &[u8], method: u16, claimed: Option<u32>) -> Vec<u8> {
    let size = 32 + content.len() as u32;
    let mut object = b"LOBJ".to_vec();
    object.extend([16_u16, 1].iter().flat_map(|number| number.to_le_bytes()));
    object.extend(
        [claimed.unwrap_or(size), 10]
            .iter()
            .flat_map(|number| number.to_le_bytes()),
    );
    object.extend(method.to_le_bytes());
    object.resize(32, 0);
    object.extend_from_slice(content);
    object
}

fn ids(parts: &[Vec<u8>]) -> (Vec<u32>, Summary) {
    let mut file = b"LOGG".to_vec();
    file.extend(144_u32.to_le_bytes());
    file.resize(144, 0);
    file.extend(parts.concat());
    let (entries, summary) = read(&file).expect("a file");
    (
        entries.iter().map(|entry| entry.frame.id).collect(),
        summary,
    )
}

#[test]
fn objects_without_container_are_read() {
    let (ids, summary) = ids(&[message(1, 48), vec![0; 3], message(2, 48)]);
    assert_eq!(ids, [1, 2]);
    assert!(summary.defects.is_empty(), "{summary:?}");
}

#[test]
fn a_container_with_an_impossible_size_costs_nothing_behind_it() {
    let compressed = |id| compress_to_vec_zlib(&message(id, 48), 6);
    let first = container(&compressed(1), 2, Some(u32::MAX));
    let second = container(&compressed(2), 2, None);
    let (found, summary) = ids(&[first, second]);
    assert_eq!(found, [1, 2]);
    assert_eq!(summary.defects.len(), 1, "{summary:?}");
    // A size that is too small for the container's own header.
    let small = container(&[], 2, Some(20));
    let (found, summary) = ids(&[small, container(&compressed(2), 2, None)]);
    assert_eq!(found, [2]);
    assert!(!summary.defects.is_empty());
}

#[test]
fn objects_with_an_impossible_size_cost_only_themselves() {
    for size in [0, 15, u32::MAX] {
        let objects = [message(1, 48), message(2, size), message(3, 48)].concat();
        let (found, summary) = ids(&[container(&objects, 0, None)]);
        assert_eq!(found, [1, 3], "{size}");
        assert_eq!(summary.defects.len(), 1, "{summary:?}");
    }
}

#[test]
fn unknown_compression_is_left_out_and_counted() {
    let (found, summary) = ids(&[container(&[7; 100], 9, None), message(2, 48)]);
    assert_eq!(found, [2]);
    let left_out: Vec<_> = summary.left_out.into_iter().collect();
    let kind = "containers with the unknown compression method 9".to_owned();
    assert_eq!(left_out, [(kind, 1)]);
}

proptest! {
    #[test]
    fn no_input_panics(
        file in 0_usize..15,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
        cut in any::<prop::sample::Index>(),
        cuts in any::<bool>(),
    ) {
        let folders = folders("blf");
        let Some(folder) = folders.get(file) else { return Ok(()) };
        let mut bytes = std::fs::read(folder.join("trace.blf")).expect("a file");
        // Behind the signature, so that the file is still read as BLF; mostly in the headers.
        for (place, value) in changes {
            let place = 4 + place.index((bytes.len() - 4).min(400));
            bytes[place] = value;
        }
        if cuts {
            bytes.truncate(4 + cut.index(bytes.len() - 4));
        }
        let (_, summary) = read(&bytes).expect("defects are counted");
        prop_assert!(summary.defects.len() < 20);
    }
}
