//! Cuts the excerpts in `testdata/truth` out of the truth runs in `../shared/data`: `make excerpts`.
//!
//! An excerpt has the rows of one window of time, the columns that the tests read, and the times of
//! its run. Values are rounded to the resolution of their unit, which is far below the noise of every
//! sensor, so that a second of driving takes 15 to 40 kB.

use std::error::Error;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use atvrec_testkit::truth::{WINDOWS, Window, excerpt_path, resolution};
use parquet::basic::{Compression, Encoding, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{DoubleType, FloatType};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use sim::Columns;

/// Columns of the whole vehicle.
const BODY: &[&str] = &[
    "t",
    "roll",
    "pitch",
    "yaw",
    "p",
    "q",
    "r",
    "pdot",
    "qdot",
    "rdot",
    "vx_body",
    "vy_body",
    "vz_body",
    "beta",
    "fx_body",
    "fy_body",
    "fz_body",
    "handwheel",
];
/// Columns of each wheel.
const WHEEL: &[&str] = &["omega", "Fx", "Fy", "Fz", "spring_len", "alpha", "mu"];
/// What wheels on double wishbones have besides.
const WISHBONES: &[&str] = &[
    "UCA_tubeF_T",
    "UCA_tubeB_T",
    "LCA_tubeF_T",
    "LCA_tubeB_T",
    "tierod_T",
    "LCA_ball_Fx",
    "LCA_ball_Fy",
    "LCA_ball_Fz",
    "lbj_x",
    "lbj_y",
    "lbj_z",
];
/// What rough ground needs besides.
const ROUGH: &[&str] = &[
    "steer",
    "camber",
    "ground_z",
    "in_contact",
    "n_chassis_x",
    "n_chassis_y",
    "n_chassis_z",
    "Fchassis_x",
    "Fchassis_y",
    "Fchassis_z",
    "wc_acc_x",
    "wc_acc_y",
    "wc_acc_z",
    "ma_hub_x",
    "ma_hub_y",
    "ma_hub_z",
];
/// What the balance of the second vehicle needs besides: of the body and of each wheel.
const BALANCE: &[&str] = &["acom_body_x", "acom_body_y", "acom_body_z"];
const CHASSIS_FORCES: &[&str] = &["steer", "Fchassis_x", "Fchassis_y", "Fchassis_z"];

/// Smallest files at the highest level: they are made once.
const ZSTD_LEVEL: i32 = 22;

fn main() -> Result<(), Box<dyn Error>> {
    let mut total = 0;
    for window in &WINDOWS {
        let columns = cut(window)?;
        let path = excerpt_path(window.name);
        write(&path, &columns)?;
        let bytes = std::fs::metadata(&path)?.len();
        total += bytes;
        println!(
            "{}: {} columns, {bytes} bytes",
            path.display(),
            columns.len()
        );
    }
    let parameters = atvrec_testkit::shared("data/truth/params.json").ok_or("no parameters")?;
    std::fs::copy(
        parameters,
        atvrec_testkit::project().join("testdata/truth/params.json"),
    )?;
    println!("{total} bytes in all");
    Ok(())
}

/// Whether a column belongs in an excerpt.
fn is_wanted(folder: &str, name: &str) -> bool {
    let (body, wheel): (&[&[&str]], &[&[&str]]) = match folder {
        "truth-rough" => (&[BODY], &[WHEEL, WISHBONES, ROUGH]),
        "truth-second" => (&[BODY, BALANCE], &[WHEEL, CHASSIS_FORCES]),
        _ => (&[BODY], &[WHEEL, WISHBONES]),
    };
    let is_in = |lists: &[&[&str]], name: &str| lists.iter().any(|list| list.contains(&name));
    let of_wheel = ["FL_", "FR_", "RL_", "RR_"]
        .iter()
        .find_map(|wheel| name.strip_prefix(wheel));
    of_wheel.map_or_else(|| is_in(body, name), |name| is_in(wheel, name))
}

/// The wanted columns of a window, by `name[unit]`.
fn cut(window: &Window) -> Result<Columns, Box<dyn Error>> {
    let path = window.source().ok_or("the truth runs are needed")?;
    let columns = sim::read_columns(&path, |full| {
        let name = full.split('[').next().unwrap_or(full);
        Ok(is_wanted(window.folder, name).then(|| full.to_owned()))
    })?;
    let rows = window.rows(&columns["t[s]"]);
    Ok(columns
        .into_iter()
        .map(|(name, values)| {
            let step = resolution(&name);
            let rounded = values[rows.clone()]
                .iter()
                .map(|value| (value / step).round() * step);
            let rounded = rounded.collect();
            (name, rounded)
        })
        .collect())
}

fn write(path: &Path, columns: &Columns) -> Result<(), Box<dyn Error>> {
    let field = |name: &str| {
        let physical = if name == "t[s]" {
            Physical::DOUBLE
        } else {
            Physical::FLOAT
        };
        let field = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::REQUIRED)
            .build();
        field.map(Arc::new)
    };
    let fields: Result<_, _> = columns.keys().map(|name| field(name)).collect();
    let schema = Type::group_type_builder("truth")
        .with_fields(fields?)
        .build()?;
    // The bytes of equal significance of all values stand together, which compresses well.
    let properties = WriterProperties::builder()
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::BYTE_STREAM_SPLIT)
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(ZSTD_LEVEL)?))
        .build();
    let mut writer =
        SerializedFileWriter::new(File::create(path)?, Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for (name, values) in columns {
        let mut column = group.next_column()?.ok_or("a column for each field")?;
        if name == "t[s]" {
            column
                .typed::<DoubleType>()
                .write_batch(values, None, None)?;
        } else {
            let values: Vec<f32> = values.iter().map(|value| *value as f32).collect();
            column
                .typed::<FloatType>()
                .write_batch(&values, None, None)?;
        }
        column.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}
