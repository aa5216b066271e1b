use std::ops::ControlFlow;

use atvrec_wire::can_log::{Entry, Error, Stamps, Summary, blf};
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
