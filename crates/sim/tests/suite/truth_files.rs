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
    let columns = names.iter().enumerate();
    let columns: Vec<_> = columns.map(|(i, name)| column(i, name)).collect();
    write_columns(path, names, &columns);
}

fn write_columns(path: &Path, names: &[String], columns: &[Vec<f64>]) {
    let mut text = names.join(",") + "\n";
    for row in 0..columns[0].len() {
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

/// The needed columns without velocity and contact forces, and those that replace them.
fn names_without_contact(force: &str, spindle: &str) -> Vec<String> {
    let replaced = |name: &str| {
        name.ends_with("_body[m/s]") || name.split_once("_F").is_some_and(|(_, end)| end.len() == 4)
    };
    let kept = names(false).into_iter().filter(|name| !replaced(name));
    let place = ["X[m]", "Y[m]", "Z[m]"].map(str::to_owned);
    let of_wheel = Wheel::ALL.into_iter().flat_map(|wheel| {
        let name = move |end: &str| format!("{}_{end}", wheel.abbreviation());
        let force = ["x", "y", "z"].map(|axis| name(&format!("{force}_{axis}[N]")));
        force.into_iter().chain([name("steer[rad]"), name(spindle)])
    });
    kept.chain(place).chain(of_wheel).collect()
}

/// Greatest difference between a derived and an exact velocity, m/s: the central difference of a circle
/// of 20 m at 8 m/s and 1 kHz, and the difference to one side at both ends.
const DERIVED_MAX_M_S: f64 = 2e-3;

#[test]
fn velocity_and_contact_forces_follow_from_other_columns() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = file(&directory, "run.csv");
    let (pitch, steer, lean) = (0.05, 0.2, 0.1);
    let force_n = [300.0, -500.0, 1600.0];
    for stem in ["Fchassis", "Fcar"] {
        let names = names_without_contact(stem, "incl_body[rad]");
        let column = |name: &String| -> Vec<f64> {
            let at = |row: usize| {
                let angle = 0.4 * row as f64 * 1e-3;
                match name.as_str() {
                    "t[s]" => row as f64 * 1e-3,
                    "yaw[rad]" => angle,
                    "pitch[rad]" => pitch,
                    "X[m]" => 20.0 * math::sin(angle),
                    "Y[m]" => 20.0 * (1.0 - math::cos(angle)),
                    "Z[m]" => 0.7,
                    _ if name.ends_with("steer[rad]") => steer,
                    _ if name.ends_with("incl_body[rad]") => lean,
                    _ if name.ends_with("_x[N]") => force_n[0],
                    _ if name.ends_with("_y[N]") => force_n[1],
                    _ if name.ends_with("_z[N]") => force_n[2],
                    _ => 0.0,
                }
            };
            (0..200).map(at).collect()
        };
        write_columns(&path, &names, &names.iter().map(column).collect::<Vec<_>>());
        let motion = Motion::open(&path).expect("a truth file");
        let (sin, cos) = math::sin_cos(pitch);
        for state in motion.states() {
            let [x, y, z] = state.velocity_body_m_s;
            let errors = [x - 8.0 * cos, y, z - 8.0 * sin];
            assert!(
                errors.iter().all(|e| e.abs() < DERIVED_MAX_M_S),
                "{errors:?}"
            );
        }
        // Both frames have x along the wheel; the rest is written out in the axes of the body.
        let (sd, cd) = math::sin_cos(steer);
        let (sg, cg) = math::sin_cos(lean);
        let spindle = [-sd * cg, cd * cg, sg];
        let [a, b, c] = force_n;
        let body = if stem == "Fcar" {
            [
                cd * a + spindle[0] * b + sd * sg * c,
                sd * a + spindle[1] * b - cd * sg * c,
                spindle[2] * b + cg * c,
            ]
        } else {
            force_n
        };
        // The vertical of a body whose nose is down.
        let up = [-sin, 0.0, cos];
        let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let level = dot(spindle, up);
        let wheel = &motion.states()[0].wheels[Wheel::RearLeft];
        let across = (dot(body, spindle) - level * dot(body, up)) / (1.0 - level * level).sqrt();
        assert!((wheel.force_n[2] - dot(body, up)).abs() < 1e-9, "{wheel:?}");
        assert!((wheel.force_n[1] - across).abs() < 1e-9, "{wheel:?}");
        let squares = dot(body, body) - dot(wheel.force_n, wheel.force_n);
        assert!(squares.abs() < 1e-6, "{wheel:?}");
    }
}

#[test]
fn what_is_missing_of_a_substitute_is_named() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = file(&directory, "run.csv");
    let mut names = names_without_contact("Fcar", "camber[rad]");
    names.retain(|name| {
        !["Y[m]", "FL_steer[rad]", "RL_camber[rad]", "RR_Fcar_z[N]"].contains(&name.as_str())
    });
    write_csv(&path, &names);
    let error = Motion::open(&path)
        .expect_err("parts are missing")
        .to_string();
    let told = "Y[m], FL_steer[rad], RL_incl_body[rad], RR_Fcar_z[N];";
    assert!(error.contains(told), "{error}");
}

/// Greatest difference between what follows from the columns at 1 kHz and the simulator's own columns
/// at 100 Hz: velocity in m/s (the columns of Z and attitude have 32 bits), force in N.
const OWN_VELOCITY_MAX_M_S: f64 = 5e-4;
const OWN_FORCE_MAX_N: f64 = 1e-3;

#[test]
fn the_truth_at_1_khz_is_that_at_100_hz() {
    for name in ["r1_iso_c", "r2_iso_e", "r3_bumps"] {
        let path = |rate| testkit::shared(&format!("data/truth-second/{name}{rate}_a.parquet"));
        let (Some(fast), Some(slow)) = (path("_1khz"), path("")) else {
            return;
        };
        let [fast, slow] = [fast, slow].map(|path| Motion::open(&path).expect("a truth file"));
        assert_eq!(fast.states().len(), 12_001);
        let (mut velocity_m_s, mut force_n): (f64, f64) = (0.0, 0.0);
        let slow = &slow.states()[400..];
        // The ends have differences to one side.
        for (found, told) in fast
            .states()
            .iter()
            .step_by(10)
            .zip(slow)
            .skip(1)
            .take(1199)
        {
            assert!((found.time_s + 4.0 - told.time_s).abs() < 1e-6);
            for (a, b) in found.velocity_body_m_s.iter().zip(told.velocity_body_m_s) {
                velocity_m_s = velocity_m_s.max((a - b).abs());
            }
            for (a, b) in found.wheels.0.iter().zip(&told.wheels.0) {
                for (a, b) in a.force_n.iter().zip(b.force_n) {
                    force_n = force_n.max((a - b).abs());
                }
            }
        }
        eprintln!("{name}: {velocity_m_s} m/s, {force_n} N");
        assert!(
            velocity_m_s < OWN_VELOCITY_MAX_M_S,
            "{name}: {velocity_m_s} m/s"
        );
        assert!(force_n < OWN_FORCE_MAX_N, "{name}: {force_n} N");
    }
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
