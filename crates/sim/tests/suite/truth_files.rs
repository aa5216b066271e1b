//! Truth files: both kinds give the same values, and errors name all that is wrong.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use model::sensors::Sensors;

use atvrec_sim::{Motion, Options, SimError, VirtualVehicle, WheelTruth};
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use sample::Wheel;

use crate::support;

const ROWS: usize = 41;

/// A column's made-up values: time rises by 5 ms, everything else moves smoothly.
fn column(index: usize, name: &str) -> Vec<f64> {
    (0..ROWS)
        .map(|row| match name {
            "t[s]" => 3.0 + row as f64 * 0.005,
            _ if name.ends_with("spring_len[m]") => 0.35 + math::sin(0.1 * row as f64) / 100.0,
            _ => math::sin(0.1 * row as f64 + index as f64) / 8.0,
        })
        .collect()
}

fn names(optional: bool) -> Vec<String> {
    let extra = atvrec_sim::optional_columns().filter(|_| optional);
    atvrec_sim::required_columns().chain(extra).collect()
}

fn write_csv(path: &Path, names: &[String]) {
    let columns: Vec<_> = names
        .iter()
        .enumerate()
        .map(|(i, n)| column(i, n))
        .collect();
    let mut text = names.join(",") + "\n";
    for row in 0..ROWS {
        // Rust writes the shortest text that reads back to the same bits.
        let cells: Vec<_> = columns.iter().map(|c| c[row].to_string()).collect();
        text += &(cells.join(",") + "\n");
    }
    std::fs::write(path, text).expect("a temporary file");
}

fn write_parquet(path: &Path, names: &[String]) {
    // Column names with brackets are made through the type builder, not the parser.
    let fields = names
        .iter()
        .map(|name| {
            let field = parquet::schema::types::Type::primitive_type_builder(
                name,
                parquet::basic::Type::DOUBLE,
            )
            .with_repetition(parquet::basic::Repetition::REQUIRED)
            .build()
            .expect("a column");
            Arc::new(field)
        })
        .collect();
    let schema = parquet::schema::types::Type::group_type_builder("truth")
        .with_fields(fields)
        .build()
        .expect("a schema");
    let file = std::fs::File::create(path).expect("a temporary file");
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer =
        SerializedFileWriter::new(file, Arc::new(schema), properties).expect("a writer");
    let mut group = writer.next_row_group().expect("a row group");
    let mut index = 0;
    while let Some(mut writer) = group.next_column().expect("a column") {
        writer
            .typed::<DoubleType>()
            .write_batch(&column(index, &names[index]), None, None)
            .expect("values");
        writer.close().expect("a column's end");
        index += 1;
    }
    group.close().expect("a group's end");
    writer.close().expect("a file's end");
}

fn file(directory: &tempfile::TempDir, name: &str) -> PathBuf {
    directory.path().join(name)
}

#[test]
fn csv_and_parquet_give_the_same_bytes() {
    let directory = tempfile::tempdir().expect("a directory");
    for optional in [true, false] {
        let names = names(optional);
        let (csv, parquet) = (file(&directory, "run.csv"), file(&directory, "run.parquet"));
        write_csv(&csv, &names);
        write_parquet(&parquet, &names);
        let [a, b] = [csv, parquet].map(|path| Motion::open(&path).expect("a truth file"));
        assert_eq!(a.name(), "run");
        assert!((a.duration_s() - 0.2).abs() < 1e-12);
        let [a, b] = [a, b].map(|motion| {
            let (vehicle, sensors) = (support::vehicle(), support::sensors());
            VirtualVehicle::new(motion, &vehicle, &sensors, &Options::default(), 1)
                .expect("a virtual vehicle")
                .collect::<Vec<_>>()
        });
        assert!(!a.is_empty());
        assert_eq!(a, b);
    }
}

#[test]
fn all_missing_columns_are_named() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = file(&directory, "run.csv");
    let kept: Vec<_> = names(false)
        .into_iter()
        .filter(|name| name != "p[rad/s]" && name != "RR_Fz[N]")
        .collect();
    write_csv(&path, &kept);
    let error = Motion::open(&path).expect_err("two columns are missing");
    assert!(error.to_string().contains("p[rad/s], RR_Fz[N]"), "{error}");
}

#[test]
fn another_unit_is_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = file(&directory, "run.csv");
    let mut names = names(false);
    names
        .iter_mut()
        .filter(|n| *n == "roll[rad]")
        .for_each(|n| *n = "roll[deg]".to_owned());
    write_csv(&path, &names);
    let error = Motion::open(&path).expect_err("degrees");
    assert!(matches!(&error, SimError::WrongUnit { found, expected, .. }
        if found == "roll[deg]" && expected == "roll[rad]"));
}

#[test]
fn bad_cells_files_and_names_are_told() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = file(&directory, "run.csv");
    write_csv(&path, &names(false));
    let text = std::fs::read_to_string(&path).expect("just written");
    let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
    lines[7] = lines[7].replacen(',', ",x", 1);
    std::fs::write(&path, lines.join("\n")).expect("a temporary file");
    let error = Motion::open(&path).expect_err("a word in a cell");
    assert!(matches!(&error, SimError::BadValue { row: 7, column, .. } if column == "roll[rad]"));

    let torn = file(&directory, "torn.parquet");
    std::fs::write(&torn, b"PAR1 and no more").expect("a temporary file");
    assert!(matches!(
        Motion::open(&torn),
        Err(SimError::Unreadable { .. })
    ));
    assert!(matches!(
        Motion::open(&file(&directory, "none.csv")),
        Err(SimError::Read { .. })
    ));
    assert!(matches!(
        Motion::open(&file(&directory, "run.xlsx")),
        Err(SimError::UnknownKind { .. })
    ));
}

/// Difference (root mean square) between link forces of an independent simulator and computed
/// here from its tyre forces and moments, N: its unsprung parts' accelerations are not quite those
/// of a wheel on flat ground.
const LINK_FORCE_RMS_N: f64 = 10.0;

#[test]
fn link_forces_follow_from_tyre_forces() {
    let path = testkit::truth::excerpt_path("c_sine03");
    let told = Motion::open(&path).expect("a truth run");
    let mut states = told.states()[2000..2400].to_vec();
    for wheel in states.iter_mut().flat_map(|state| &mut state.wheels.0) {
        wheel.link_force_n = [f64::NAN; 5];
        wheel.lower_ball_force_n = [f64::NAN; 3];
    }
    let mut told = Motion::new("told", told.states()[2000..2400].to_vec()).expect("a motion");
    told.complete(&support::vehicle()).expect("a linkage");
    let mut found = Motion::new("stripped", states).expect("a motion");
    found.complete(&support::vehicle()).expect("a linkage");
    for link in 0..6 {
        // The five links, then what bends the lower arm.
        let force =
            |wheel: &WheelTruth| *wheel.link_force_n.get(link).unwrap_or(&wheel.ball_normal_n);
        let mut squares = 0.0;
        for (a, b) in told.states().iter().zip(found.states()) {
            for (a, b) in a.wheels.0.iter().zip(&b.wheels.0) {
                squares += (force(b) - force(a)).powi(2);
            }
        }
        let rms_n = (squares / 1600.0).sqrt();
        eprintln!("{rms_n}");
        assert!(rms_n < LINK_FORCE_RMS_N, "link {link}: {rms_n} N");
    }
}

/// Without noise, a 16-bit converter and the truth files' own tube forces, a channel's error is the
/// filter's alone, N (root mean square).
const PERFECT_CHAIN_RMS_N: f64 = 1.0;

#[test]
fn strain_of_a_truth_run_is_its_tube_force_through_the_lag() {
    let path = testkit::truth::excerpt_path("d_sine_mu");
    let motion = Motion::open(&path).expect("a truth run");
    let mut sensors = Sensors::builtin("full-bridge-16bit-bending").expect("built-in sensors");
    sensors.strain.noise_counts = 0.0;
    sensors.strain.zero_error_counts = 0.0;
    let scale = sensors.strain.axial_scale().expect("a sound chain");
    let bending = sensors
        .strain
        .bending_scale()
        .expect("a sound chain")
        .expect("bridges");
    let tau_s = 1.0 / (std::f64::consts::TAU * sensors.strain.lag_hz);
    let all: Vec<_> = VirtualVehicle::new(
        motion,
        &support::vehicle(),
        &sensors,
        &Options::default(),
        1,
    )
    .expect("a virtual vehicle")
    .collect();
    let completed = {
        let mut motion = Motion::open(&path).expect("a truth run");
        motion.complete(&support::vehicle()).expect("a linkage");
        motion
    };
    let frames = support::frames_of(&all, 0x150);
    let second = support::frames_of(&all, 0x151);
    let mut lagged: Option<f64> = None;
    let (mut squares, mut bending_error) = (0.0, 0.0_f64);
    for (k, (frame, other)) in frames.iter().zip(&second).enumerate() {
        // The lag once more, by small steps of Euler's rule.
        for step in 0..20 {
            let truth = completed.at((k as f64 - 1.0) * 0.01 + f64::from(step + 1) * 5e-4);
            let force_n = truth.wheels[Wheel::RearRight].link_force_n[2];
            let before_n = *lagged.get_or_insert(force_n);
            lagged = Some(before_n + (force_n - before_n) * 5e-4 / tau_s);
        }
        let read_n = scale.load(f64::from(frame[2]));
        squares += (read_n - lagged.expect("a first value")).powi(2);
        let truth = completed.at(k as f64 * 0.01 - tau_s);
        let moment = truth.wheels[Wheel::RearRight].ball_normal_n * 0.10 / 2.0;
        bending_error = bending_error.max((bending.load(f64::from(other[3])) - moment).abs());
    }
    let rms_n = (squares / frames.len() as f64).sqrt();
    assert!(rms_n < PERFECT_CHAIN_RMS_N, "{rms_n} N");
    // 1 N m is 20 N at the ball joint, of some 1500 N; the lag is taken as a delay here.
    assert!(bending_error < 1.0, "{bending_error} N m");
}

#[test]
fn the_shared_truth_runs_open() {
    let Some(path) = testkit::shared("data/truth/h_jack.parquet") else {
        return;
    };
    let motion = Motion::open(&path).expect("a truth run");
    assert!((motion.duration_s() - 34.0).abs() < 1e-9);
    assert!(motion.has_link_forces());
    let rest = motion.at(33.9);
    let load_n: f64 = rest.tyre_forces().0.iter().map(|f| f.force_n[2]).sum();
    assert!((load_n - 644.0 * 9.81).abs() < 20.0, "{load_n}");
}
