use atvrec_wire::can_log::{Entry, Error, Stamps, Summary, mf4};
use proptest::prelude::*;

use super::reference::{assert_rows, cursor, entries, file, folders, rows};

/// Files of the bus logs.
const FILES: usize = 8;

fn read(bytes: &[u8]) -> Result<(Vec<Entry>, Summary), Error> {
    entries(|sink| mf4::read(&mut cursor(bytes), sink))
}

#[test]
fn files_give_the_frames_of_the_reference() {
    for folder in folders("mf4-bus") {
        let name = folder.display().to_string();
        let bytes = std::fs::read(folder.join("log.mf4")).expect("a file");
        let (entries, summary) = read(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        println!("{name}: {summary:?}");
        assert_eq!(summary.stamps, Stamps::SinceStart);
        assert!(summary.start_ns.is_some(), "{name}");
        assert_rows(&name, (&entries, &summary), &rows(&folder));
        assert_eq!(
            summary.defects.is_empty(),
            !name.contains("cut"),
            "{name}: {summary:?}"
        );
    }
}

#[test]
fn the_start_is_utc() {
    let Some(bytes) = file("mf4-bus/canedge-unfinalised-vlsd/log.mf4") else {
        return;
    };
    let (_, summary) = read(&bytes).expect("a file");
    // 2021-06-01T13:43:49+02:00.
    assert_eq!(summary.start_ns, Some(1_622_547_829_000_000_000));
    assert_eq!(
        summary.left_out.get("records of LIN_Frame"),
        Some(&16),
        "{summary:?}"
    );
}

#[test]
fn files_without_can_frames_name_what_they_are() {
    for folder in folders("mf4-signal") {
        let bytes = std::fs::read(folder.join("measurement.mf4")).expect("a file");
        let error = read(&bytes).expect_err("no CAN frames");
        assert!(
            matches!(error, Error::OnlySignals { .. }),
            "{}: {error}",
            folder.display()
        );
    }
    for folder in folders("mdf3") {
        let bytes = std::fs::read(folder.join("measurement.mdf")).expect("a file");
        let error = read(&bytes).expect_err("MDF 3").to_string();
        assert!(error.contains("MDF file of version 3."), "{error}");
    }
    let error = read(b"LOGG----").expect_err("no MDF file").to_string();
    assert!(error.contains("LOGG"), "{error}");
    assert!(read(b"").is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn no_input_panics(
        number in 0..FILES,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
        cut in any::<prop::sample::Index>(),
        cuts in any::<bool>(),
    ) {
        let folders = folders("mf4-bus");
        let Some(folder) = folders.get(number) else { return Ok(()) };
        let mut bytes = std::fs::read(folder.join("log.mf4")).expect("a file");
        for (place, value) in changes {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        if cuts {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok((_, summary)) = read(&bytes) {
            prop_assert!(summary.defects.len() < 30);
        }
    }
}
