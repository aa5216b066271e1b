use std::ops::ControlFlow;

use atvrec_wire::can_log::mf4::{Physical, Table, Tables, Value as Cell};
use atvrec_wire::can_log::{Entry, Error, Stamps, Summary, mf4};
use proptest::prelude::*;
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

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

    #[test]
    fn no_input_panics_the_reader_of_tables(
        number in 0_usize..16,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
        cut in any::<prop::sample::Index>(),
        cuts in any::<bool>(),
    ) {
        let folders = folders("mf4-signal");
        let Some(folder) = folders.get(number) else { return Ok(()) };
        let mut bytes = std::fs::read(folder.join("measurement.mf4")).expect("a file");
        for (place, value) in changes {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        if cuts {
            bytes.truncate(cut.index(bytes.len()));
        }
        let mut cursor = cursor(&bytes);
        if let Ok(mut tables) = Tables::open(&mut cursor) {
            for table in 0..tables.tables().len() {
                let mut rows = 0;
                let mut sink = |_: &[Cell]| {
                    rows += 1;
                    if rows < 2000 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
                };
                tables.rows(table, &mut sink).expect("defects are counted");
            }
        }
    }
}

/// All tables of a file.
fn tables(bytes: &[u8]) -> Vec<(Table, Vec<Vec<Cell>>)> {
    let mut cursor = cursor(bytes);
    let mut tables = Tables::open(&mut cursor).expect("a file");
    let described = tables.tables().to_vec();
    let read = described.into_iter().enumerate().map(|(number, table)| {
        let mut rows = Vec::new();
        let mut sink = |row: &[Cell]| {
            rows.push(row.to_vec());
            ControlFlow::Continue(())
        };
        tables.rows(number, &mut sink).expect("rows");
        (table, rows)
    });
    let read = read.collect();
    assert_eq!(tables.into_defects(), Vec::<String>::new());
    read
}

fn sha256(bytes: &[u8]) -> Value {
    let digest = Sha256::digest(bytes);
    json!(
        digest
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect::<String>()
    )
}

/// Compares a column with its reference.
fn assert_column(place: &str, cells: &[&Cell], row: &Map<String, Value>) {
    assert_eq!(json!(cells.len()), row["count"], "{place}: count");
    let invalid = cells.iter().filter(|cell| !cell.is_valid).count();
    let expected = row.get("invalid").and_then(Value::as_u64).unwrap_or(0);
    assert_eq!(invalid as u64, expected, "{place}: invalid");
    if row["kind"] == "text" {
        let texts = cells.iter().map(|cell| match &cell.physical {
            Physical::Text(text) => text.clone(),
            other => panic!("{place}: {other:?} is no text"),
        });
        let lines = texts.collect::<Vec<_>>().join("\n");
        assert_eq!(
            sha256(lines.as_bytes()),
            row["sha256_utf8_lines"],
            "{place}: {lines}"
        );
        return;
    }
    let bytes = |cell: &&Cell| match cell.physical {
        Physical::Number(number) => number.to_le_bytes(),
        ref other => panic!("{place}: {other:?} is no number"),
    };
    let all: Vec<u8> = cells.iter().flat_map(bytes).collect();
    assert_eq!(sha256(&all), row["sha256_f64le"], "{place}");
    if let Some(expected) = row.get("sha256_f64le_valid_only") {
        let valid = cells.iter().filter(|cell| cell.is_valid);
        let valid: Vec<u8> = valid.flat_map(bytes).collect();
        assert_eq!(sha256(&valid), *expected, "{place}: valid values");
    }
}

#[test]
fn signals_have_the_values_of_the_reference() {
    let mut compared = 0;
    for folder in folders("mf4-signal") {
        let bytes = std::fs::read(folder.join("measurement.mf4")).expect("a file");
        let tables = tables(&bytes);
        for row in rows(&folder) {
            let place = format!("{}: {}", folder.display(), row["name"]);
            // The elements of an array are columns; the array itself is none.
            if row["kind"] == "structure/array" {
                continue;
            }
            let group = row["group"].as_u64().expect("a number") as usize;
            let (table, rows) = &tables[group];
            let mut columns = table.columns.iter().enumerate();
            let named = columns.find(|(_, column)| json!(column.name) == row["name"]);
            let (number, column) = named.unwrap_or_else(|| panic!("{place}: no column"));
            let cells: Vec<_> = rows.iter().map(|row| &row[number]).collect();
            assert_column(&place, &cells, &row);
            assert_eq!(json!(column.is_master), row["master"], "{place}");
            // The reference has no units of conversion rules, and units with their spaces.
            if let Some(unit) = row["unit"].as_str() {
                assert_eq!(column.unit.as_deref(), Some(unit.trim()), "{place}: unit");
            }
            compared += 1;
        }
    }
    testkit::report(&format!("{compared} columns compared"));
}

#[test]
fn values_in_groups_of_their_own_are_columns_too() {
    let Some(bytes) = file("mf4-bus/canedge-unfinalised-vlsd/log.mf4") else {
        return;
    };
    let (frames, _) = read(&bytes).expect("a file");
    let tables = tables(&bytes);
    let (table, rows) = &tables[0];
    let mut columns = table.columns.iter();
    let data = columns.position(|column| column.name == "CAN_DataFrame.DataBytes");
    let data = data.expect("a column");
    assert_eq!(rows.len(), frames.len());
    for (row, entry) in rows.iter().zip(&frames) {
        let bytes = entry.frame.bytes().iter();
        let text = bytes.map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(row[data].physical, Physical::Text(text));
    }
}
