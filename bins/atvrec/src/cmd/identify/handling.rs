//! `atvrec identify handling`: identify tyres, yaw inertia, gains and offsets from a drive without a
//! sideslip reference.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use anyhow::Context;
use engine::config::{self, Config};
use engine::{Handling, identify_handling};
use estimator::Calibration;
use estimator::identification::handling::{Identified, NAMES, values};
use serde_json::json;
use store::{Attachment, Reader};
use toml::Value;

use crate::cli::IdentifyHandlingArgs;
use crate::exit::Outcome;
use engine::output::{Kind, Target};

/// File name of the calibration.
const CALIBRATION_NAME: &str = "calibration.toml";

/// Runs the command.
pub fn run(args: &IdentifyHandlingArgs) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let config = match &args.config {
        Some(path) => Config::load(path)?,
        None => Config::from_attachments(&reader.attachments()?)?,
    };
    if let Some(directory) = args.output.as_ref().filter(|directory| directory.exists()) {
        targets(directory, &config, args)?;
    }
    let Handling {
        identified: found,
        calibration,
    } = identify_handling(&reader, &config, args.until_s)?;
    if let Some(directory) = &args.output {
        write(directory, &config, &calibration, args)?;
    }
    if args.json {
        println!("{:#}", as_json(&found));
    } else {
        print(&found);
        if let Some(directory) = &args.output {
            println!("wrote {}", directory.join(config::ATTACHED_NAME).display());
        }
    }
    Ok(Outcome::Good)
}

/// Writes the calibration, the configuration of the log and all files that it names to one directory, so
/// that `replay --config` needs no other file.
fn write(
    directory: &Path,
    config: &Config,
    calibration: &Calibration,
    args: &IdentifyHandlingArgs,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(directory)
        .with_context(|| format!("cannot create the directory {}", directory.display()))?;
    let targets = targets(directory, config, args)?;
    let names = flat_names(&config.attachments);
    for attachment in &config.attachments {
        if attachment.name != config::ATTACHED_NAME && names[&attachment.name] != CALIBRATION_NAME {
            targets[&names[&attachment.name]]
                .write_by(|mut file| Ok(file.write_all(&attachment.data)?))?;
        }
    }
    let text = config
        .attachments
        .iter()
        .find(|attachment| attachment.name == config::ATTACHED_NAME)
        .map(|attachment| String::from_utf8_lossy(&attachment.data).into_owned())
        .unwrap_or_default();
    let mut document: toml::Table = text.parse()?;
    for value in document.iter_mut().map(|(_, value)| value) {
        rename(value, &names);
    }
    let vehicle = document
        .entry("vehicle")
        .or_insert_with(|| Value::Table(toml::Table::new()));
    if let Value::Table(vehicle) = vehicle {
        vehicle.insert("calibration".to_owned(), CALIBRATION_NAME.into());
    }
    targets[CALIBRATION_NAME].write(&calibration.to_toml()?)?;
    // The configuration is written last, after all files that it names.
    targets[config::ATTACHED_NAME].write(&toml::to_string_pretty(&document)?)?;
    Ok(())
}

/// All files of the directory, by name.
fn targets(
    directory: &Path,
    config: &Config,
    args: &IdentifyHandlingArgs,
) -> anyhow::Result<BTreeMap<String, Target>> {
    let own = [CALIBRATION_NAME, config::ATTACHED_NAME].map(str::to_owned);
    let attached = flat_names(&config.attachments).into_values();
    own.into_iter()
        .chain(attached)
        .map(|name| {
            let path = directory.join(&name);
            let inputs = args.logs.iter().chain(&args.config).map(|path| &**path);
            let target = Target::new(&path, Kind::Any, args.replace.force, inputs)?;
            Ok((name, target))
        })
        .collect()
}

/// Unique names of the attached files without directories.
fn flat_names(attachments: &[Attachment]) -> BTreeMap<String, String> {
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    for attachment in attachments {
        let base = Path::new(&attachment.name).file_name().map_or_else(
            || "file".to_owned(),
            |name| name.to_string_lossy().into_owned(),
        );
        let mut name = base.clone();
        let mut number = 2;
        while names.values().any(|known| *known == name) {
            name = format!("{number}-{base}");
            number += 1;
        }
        names.insert(attachment.name.clone(), name);
    }
    names
}

fn rename(value: &mut Value, names: &BTreeMap<String, String>) {
    match value {
        Value::String(text) => {
            // A file without the extension .toml is attached with a longer name.
            let longer = ["vehicle", "sensors", "calibration", "columns"]
                .map(|kind| format!("{text}.{kind}.toml"));
            let attached = std::iter::once(&*text).chain(&longer);
            if let Some(name) = attached.filter_map(|name| names.get(name)).next() {
                text.clone_from(name);
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| rename(item, names)),
        Value::Table(table) => table.iter_mut().for_each(|(_, item)| rename(item, names)),
        _ => {}
    }
}

fn print(found: &Identified) {
    println!(
        "used {:.0} s above 3 m/s, with lateral accelerations up to {:.1} m/s^2",
        found.used_s, found.peak_m_s2
    );
    if found.spun_s > 0.0 {
        println!("ignored {:.1} s in which the vehicle spun", found.spun_s);
    }
    println!(
        "{:<24}{:>14}{:>12}{:>8}",
        "parameter", "value", "sigma", "info"
    );
    for (i, value) in values(&found.handling).into_iter().enumerate() {
        println!(
            "{:<24}{value:>14.4}{:>12.4}{:>7.0}%",
            NAMES[i],
            found.sigma[i],
            100.0 * found.told[i]
        );
    }
    println!(
        "offsets: steer {:.3} deg at the road wheels, yaw rate {:.3} deg/s, lateral acceleration \
         {:.3} m/s^2",
        found.steer_offset_rad.to_degrees(),
        found.yaw_rate_offset_rad_s.to_degrees(),
        found.lateral_offset_m_s2
    );
    for (i, name) in ["steer angle", "lateral acceleration"]
        .into_iter()
        .enumerate()
    {
        let (delay_ms, sigma_ms) = (1e3 * found.delay_s[i], 1e3 * found.delay_sigma_s[i]);
        let effect = if !found.corrected[i] {
            "small, not corrected".to_owned()
        } else if delay_ms > 0.0 {
            format!("corrected; set latency_s = {:.3} for it", found.delay_s[i])
        } else {
            format!(
                "corrected; set latency_s = {:.3} for the yaw rate",
                -found.delay_s[i]
            )
        };
        println!(
            "delay of the {name} against the yaw rate: {delay_ms:.1} ms, sigma {sigma_ms:.1} ms ({effect})"
        );
    }
    println!(
        "one-step prediction: yaw rate {:.3} deg/s, lateral acceleration {:.3} m/s^2 (rms)",
        found.innovation_rms[0].to_degrees(),
        found.innovation_rms[1]
    );
    for note in &found.notes {
        println!("note: {note}");
    }
}

fn as_json(found: &Identified) -> serde_json::Value {
    let parameters: Vec<serde_json::Value> = values(&found.handling)
        .into_iter()
        .enumerate()
        .map(|(i, value)| {
            json!({
                "name": NAMES[i],
                "value": value,
                "sigma": found.sigma[i],
                "told": found.told[i],
            })
        })
        .collect();
    json!({
        "parameters": parameters,
        "steer_offset_rad": found.steer_offset_rad,
        "yaw_rate_offset_rad_s": found.yaw_rate_offset_rad_s,
        "lateral_offset_m_s2": found.lateral_offset_m_s2,
        "yaw_rate_innovation_rad_s": found.innovation_rms[0],
        "lateral_innovation_m_s2": found.innovation_rms[1],
        "peak_m_s2": found.peak_m_s2,
        "delay_s": found.delay_s,
        "delay_sigma_s": found.delay_sigma_s,
        "delay_corrected": found.corrected,
        "seconds": found.used_s,
        "spun_s": found.spun_s,
        "notes": found.notes,
    })
}
