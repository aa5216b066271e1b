//! Steps with loads and readings in marks: `weight`, `load-rig`, `steer`. After a mark the vehicle must
//! be at rest for two seconds.

use anyhow::Context;
use estimator::calibration::Resolved;
use estimator::calibration::load_rig::{RigLoad, load_rig};
use estimator::calibration::rest::{Rest, Signal};
use estimator::calibration::steer::{PlateReading, steer};
use estimator::calibration::weight::{ScaleReading, weight};
use estimator::finding::Findings;
use sample::{PerWheel, StrainChannel, Wheel};

use super::recording::Recording;
use super::{Bench, one_log};
use crate::cli::{SteerArgs, WeightArgs};
use crate::exit::UsageError;

/// Time at rest after a mark, s.
const REST_S: f64 = 2.0;
/// Standard gravity, for loads in kg, m/s^2.
const NEWTONS_PER_KG: f64 = sample::STANDARD_GRAVITY_M_S2;

/// `atvrec calibrate weight`.
pub fn weigh(args: &WeightArgs, bench: &mut Bench) -> anyhow::Result<Vec<Findings>> {
    let resolved = Resolved::new(&bench.recordings[0].sensors, &bench.calibration)?;
    let mut readings = Vec::new();
    if args.scales.is_empty() {
        for recording in &bench.recordings {
            for (time_s, values) in marked(recording, "scales", 4)? {
                let load_n = PerWheel([values[0], values[1], values[2], values[3]]);
                readings.push(scale(recording, &resolved, load_n, time_s)?);
            }
        }
    } else {
        for (recording, text) in bench.recordings.iter().zip(&args.scales) {
            let values = numbers(text, 4).map_err(UsageError)?;
            let load_n = PerWheel([values[0], values[1], values[2], values[3]]);
            let stretches = recording.rest();
            let longest = stretches
                .iter()
                .max_by(|a, b| (a.to_s - a.from_s).total_cmp(&(b.to_s - b.from_s)))
                .with_context(|| {
                    format!(
                        "{}: the vehicle is never at rest for 2 s; do not touch it while it is on \
                         the scales",
                        recording.path.display()
                    )
                })?;
            let middle_s = 0.5 * (longest.from_s + longest.to_s - REST_S);
            readings.push(scale(recording, &resolved, load_n, middle_s)?);
        }
        if args.scales.len() != bench.recordings.len() {
            return Err(UsageError(format!(
                "there are {} logs, but --scales is given {} times; give it once for each log, in \
                 the order of the logs",
                bench.recordings.len(),
                args.scales.len()
            ))
            .into());
        }
    }
    let found = weight(&bench.recordings[0].vehicle, &bench.calibration, &readings)?;
    bench.calibration = found.calibration;
    Ok(vec![found.findings])
}

fn scale(
    recording: &Recording,
    resolved: &Resolved,
    load_n: PerWheel<f64>,
    time_s: f64,
) -> anyhow::Result<ScaleReading> {
    let mut compression_m = PerWheel::default();
    for wheel in Wheel::ALL {
        compression_m[wheel] = compression(recording, resolved, wheel, time_s)?;
    }
    Ok(ScaleReading {
        load_n,
        compression_m,
    })
}

/// Compression of a strut after a mark, m.
fn compression(
    recording: &Recording,
    resolved: &Resolved,
    wheel: Wheel,
    time_s: f64,
) -> anyhow::Result<f64> {
    let channel = &resolved.corners[wheel].deflection;
    let mean = recording.deflection[wheel]
        .signal()
        .mean(time_s, time_s + REST_S);
    mean.filter(|_| !channel.dead)
        .map(|counts| channel.gain * (counts - channel.offset_counts))
        .with_context(|| {
            format!(
                "{}: no deflection of {wheel} at {time_s:.1} s; check the potentiometer",
                recording.path.display()
            )
        })
}

/// `atvrec calibrate load-rig`.
pub fn rig(bench: &mut Bench) -> anyhow::Result<Vec<Findings>> {
    let resolved = Resolved::new(&bench.recordings[0].sensors, &bench.calibration)?;
    let mut loads = Vec::new();
    for recording in &bench.recordings {
        let range = [
            0.0,
            math::exp2(f64::from(recording.sensors.strain.adc_bits)) - 1.0,
        ];
        for (time_s, wheel, values) in rig_marks(recording)? {
            let of = |signal: Signal<'_>| {
                let rest = Rest::of(&signal, time_s, time_s + REST_S, range)?;
                (rest.saturated == 0.0).then_some([rest.mean, rest.mean_sigma])
            };
            let strain = &recording.strain[wheel];
            let hand_wheel = recording.steer.signal().mean(time_s, time_s + REST_S);
            loads.push(RigLoad {
                wheel,
                force_n: values,
                compression_m: compression(recording, &resolved, wheel, time_s)?,
                hand_wheel_rad: hand_wheel.map_or(0.0, |a| a - resolved.steer_offset_rad),
                counts: StrainChannel::ALL.map(|channel| of(strain[channel.index()].signal())),
            });
        }
    }
    let first = &bench.recordings[0];
    let found = load_rig(&first.vehicle, &first.sensors, &bench.calibration, &loads)?;
    bench.calibration = found.calibration;
    let mut findings = found.findings;
    for (wheel, channel, sensitivity) in found.sensitivity {
        for (axis, value) in ["F_x", "F_y", "F_z"].into_iter().zip(sensitivity) {
            let name = format!("{wheel} {} to {axis}", channel.name());
            findings
                .beside
                .push((name, 1e3 * value, "counts/kN".to_owned()));
        }
    }
    Ok(vec![findings])
}

/// `atvrec calibrate steer`.
pub fn plates(args: &SteerArgs, bench: &mut Bench) -> anyhow::Result<Vec<Findings>> {
    let recording = one_log(&bench.recordings, "steer")?;
    let mut readings = Vec::new();
    for (time_s, values) in marked(recording, "plates", 2)? {
        let hand_wheel = recording.steer.signal().mean(time_s, time_s + REST_S);
        readings.push(PlateReading {
            hand_wheel_rad: hand_wheel.with_context(|| {
                format!(
                    "{}: no steering-wheel angle at {time_s:.1} s; check its sensor",
                    recording.path.display()
                )
            })?,
            wheels_rad: [values[0].to_radians(), values[1].to_radians()],
        });
    }
    let found = steer(&readings, args.plate_sigma_deg.to_radians())?;
    bench.calibration.steer = found.calibration;
    Ok(vec![found.findings])
}

/// Marks `<word> <number>...` with their times.
fn marked(recording: &Recording, word: &str, count: usize) -> anyhow::Result<Vec<(f64, Vec<f64>)>> {
    let mut found = Vec::new();
    for (time_s, text) in &recording.marks {
        if let Some(rest) = text.strip_prefix(word) {
            let values = numbers(rest, count).map_err(|problem| {
                UsageError(format!(
                    "{}: the mark \"{text}\" at {time_s:.1} s: {problem}",
                    recording.path.display()
                ))
            })?;
            found.push((*time_s, values));
        }
    }
    Ok(found)
}

/// Marks `rig <wheel> <F_x> <F_y> <F_z>` with their times.
fn rig_marks(recording: &Recording) -> anyhow::Result<Vec<(f64, Wheel, [f64; 3])>> {
    let mut found = Vec::new();
    for (time_s, text) in &recording.marks {
        let Some(rest) = text.strip_prefix("rig ") else {
            continue;
        };
        let problem = |what: String| {
            UsageError(format!(
                "{}: the mark \"{text}\" at {time_s:.1} s: {what}",
                recording.path.display()
            ))
        };
        let (name, rest) = rest.trim().split_once(' ').unwrap_or((rest, ""));
        let wheel = Wheel::from_abbreviation(name)
            .ok_or_else(|| problem(format!("\"{name}\" is not a wheel; use FL, FR, RL or RR")))?;
        let values = numbers(rest, 3).map_err(problem)?;
        found.push((*time_s, wheel, [values[0], values[1], values[2]]));
    }
    Ok(found)
}

/// Numbers that are separated by blanks or commas; with `kg` at the end, masses are converted to loads.
fn numbers(text: &str, count: usize) -> Result<Vec<f64>, String> {
    let (text, factor) = match text.trim().strip_suffix("kg") {
        Some(masses) => (masses, NEWTONS_PER_KG),
        None => (text.trim(), 1.0),
    };
    let parts = text.split([' ', ',']).filter(|part| !part.is_empty());
    let values: Vec<f64> = parts
        .map(|part| {
            let value = part.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| format!("\"{part}\" is not a number"))
        })
        .collect::<Result<_, _>>()?;
    if values.len() == count {
        Ok(values.into_iter().map(|value| value * factor).collect())
    } else {
        Err(format!(
            "there are {} numbers, but {count} are needed",
            values.len()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_are_read_in_newtons_and_kilograms() {
        assert_eq!(numbers("1,2, 3 4", 4).unwrap(), [1.0, 2.0, 3.0, 4.0]);
        assert!((numbers(" 10 20 kg", 2).unwrap()[1] - 196.133).abs() < 1e-9);
        assert!(numbers("1 2", 4).unwrap_err().contains("4 are needed"));
        assert!(numbers("1 x", 2).unwrap_err().contains("\"x\""));
    }
}
