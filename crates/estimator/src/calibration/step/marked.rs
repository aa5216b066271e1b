//! Steps with loads and readings in marks: `weight`, `load-rig`, `steer`. After a mark the vehicle must
//! be at rest for two seconds.

use sample::{PerWheel, StrainChannel, Wheel};

use super::{Calibrated, Calibration};
use crate::EstimatorError;
use crate::calibration::load_rig::{self, RigLoad};
use crate::calibration::rest::{Rest, Signal};
use crate::calibration::steer::{self, PlateReading};
use crate::calibration::weight::{self, ScaleReading};
use crate::calibration::{ReadingProblem, Recording, RecordingError, Resolved};

/// Time at rest after a mark, s.
const REST_S: f64 = 2.0;
/// Standard gravity, for loads in kg, m/s^2.
const NEWTONS_PER_KG: f64 = sample::STANDARD_GRAVITY_M_S2;

pub(super) fn weight(
    recordings: &[Recording],
    known: &Calibration,
    scales: &[String],
) -> Result<Calibrated, EstimatorError> {
    let resolved = Resolved::new(&recordings[0].sensors, known)?;
    let mut readings = Vec::new();
    if scales.is_empty() {
        for recording in recordings {
            for (time_s, load_n) in marked(recording, "scales")? {
                readings.push(scale(recording, &resolved, PerWheel(load_n), time_s)?);
            }
        }
    } else {
        for (recording, text) in recordings.iter().zip(scales) {
            let load_n = PerWheel(numbers(text).map_err(RecordingError::from)?);
            let stretches = recording.rest();
            let longest = stretches
                .iter()
                .max_by(|a, b| (a.to_s - a.from_s).total_cmp(&(b.to_s - b.from_s)))
                .ok_or_else(|| RecordingError::NeverAtRest {
                    log: recording.name.clone(),
                })?;
            let middle_s = 0.5 * (longest.from_s + longest.to_s - REST_S);
            readings.push(scale(recording, &resolved, load_n, middle_s)?);
        }
        if scales.len() != recordings.len() {
            let (logs, scales) = (recordings.len(), scales.len());
            return Err(RecordingError::ScalesOfEach { logs, scales }.into());
        }
    }
    let found = weight::weight(&recordings[0].vehicle, known, &readings)?;
    Ok(Calibrated {
        calibration: found.calibration,
        findings: vec![found.findings],
    })
}

fn scale(
    recording: &Recording,
    resolved: &Resolved,
    load_n: PerWheel<f64>,
    time_s: f64,
) -> Result<ScaleReading, RecordingError> {
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
) -> Result<f64, RecordingError> {
    let channel = &resolved.corners[wheel].deflection;
    let mean = recording.deflection[wheel]
        .signal()
        .mean(time_s, time_s + REST_S);
    mean.filter(|_| !channel.dead)
        .map(|counts| channel.gain * (counts - channel.offset_counts))
        .ok_or_else(|| RecordingError::NoDeflection {
            log: recording.name.clone(),
            wheel,
            time_s,
        })
}

pub(super) fn load_rig(
    recordings: &[Recording],
    known: &Calibration,
) -> Result<Calibrated, EstimatorError> {
    let resolved = Resolved::new(&recordings[0].sensors, &without_matrices(known))?;
    let mut loads = Vec::new();
    for recording in recordings {
        let range = [
            0.0,
            math::exp2(f64::from(recording.sensors.strain.adc_bits)) - 1.0,
        ];
        for (time_s, wheel, [force_n, at_m]) in rig_marks(recording)? {
            let of = |signal: Signal<'_>| {
                let rest = Rest::of(&signal, time_s, time_s + REST_S, range)?;
                (rest.saturated == 0.0).then_some([rest.mean, rest.mean_sigma])
            };
            let strain = &recording.strain[wheel];
            let steering_wheel = recording.steer.signal().mean(time_s, time_s + REST_S);
            loads.push(RigLoad {
                wheel,
                force_n,
                at_m,
                compression_m: rig_compression(recording, &resolved, wheel, time_s)?,
                steering_wheel_rad: steering_wheel.map_or(0.0, |a| a - resolved.steer_offset_rad),
                counts: StrainChannel::ALL.map(|channel| of(strain[channel.index()].signal())),
            });
        }
    }
    let first = &recordings[0];
    let found = load_rig::load_rig(&first.vehicle, &first.sensors, known, &loads)?;
    let mut findings = found.findings;
    let corners = &found.calibration.corner;
    let has_matrix = |wheel: &Wheel| corners.get(wheel).is_some_and(|c| c.matrix.is_some());
    for (wheel, channel, sensitivity) in found.sensitivity {
        // Those of a matrix are findings with their standard deviations.
        if has_matrix(&wheel) {
            continue;
        }
        let channel = first.vehicle.channel_name(wheel, channel);
        for (axis, value) in ["F_x", "F_y", "F_z"].into_iter().zip(sensitivity) {
            let name = format!("{wheel} {channel} to {axis}");
            findings
                .beside
                .push((name, 1e3 * value, "counts/kN".to_owned()));
        }
    }
    Ok(Calibrated {
        calibration: found.calibration,
        findings: vec![findings],
    })
}

pub(super) fn steer(
    recording: &Recording,
    known: &Calibration,
    plate_sigma_rad: f64,
) -> Result<Calibrated, EstimatorError> {
    let mut readings = Vec::new();
    for (time_s, values) in marked::<2>(recording, "plates")? {
        let angle = recording.steer.signal().mean(time_s, time_s + REST_S);
        readings.push(PlateReading {
            steering_wheel_rad: angle.ok_or_else(|| RecordingError::NoSteer {
                log: recording.name.clone(),
                time_s,
            })?,
            wheels_rad: values.map(f64::to_radians),
            sensors_rad: (recording.wheel_angle.each_ref())
                .map(|column| column.signal().mean(time_s, time_s + REST_S)),
        });
    }
    let found = steer::steer(&readings, plate_sigma_rad)?;
    let mut calibration = known.clone();
    let before = std::mem::replace(&mut calibration.steer, found.calibration);
    let steer = &mut calibration.steer;
    steer.toe_compliance_rad_n = before.toe_compliance_rad_n;
    steer.toe_play_rad = before.toe_play_rad;
    steer.wheel_angle_offset_rad = before.wheel_angle_offset_rad;
    steer.wheel_angle_gain = before.wheel_angle_gain;
    for (side, sensor) in found.sensors.into_iter().enumerate() {
        if let Some(sensor) = sensor {
            steer.wheel_angle_offset_rad[side] = sensor.zero_rad;
            steer.wheel_angle_gain.get_or_insert([1.0; 2])[side] = sensor.gain;
        }
    }
    Ok(Calibrated {
        calibration,
        findings: vec![found.findings],
    })
}

/// Marks `<word> <number>...` with their times.
fn marked<const N: usize>(
    recording: &Recording,
    word: &str,
) -> Result<Vec<(f64, [f64; N])>, RecordingError> {
    let marks = recording.marks.iter();
    let marks = marks.filter_map(|mark| Some((mark, mark.1.strip_prefix(word)?)));
    marks
        .map(|(mark, rest)| {
            let values = numbers(rest).map_err(|problem| refused(recording, mark, problem))?;
            Ok((mark.0, values))
        })
        .collect()
}

/// A calibration without what describes corners in the place of their geometry.
fn without_matrices(known: &Calibration) -> Calibration {
    let mut known = known.clone();
    for corner in known.corner.values_mut() {
        corner.matrix = None;
    }
    known
}

/// Compression of a strut after a mark, m: the design length of an axle without hard-points and without a
/// reading.
fn rig_compression(
    recording: &Recording,
    resolved: &Resolved,
    wheel: Wheel,
    time_s: f64,
) -> Result<f64, RecordingError> {
    let found = compression(recording, resolved, wheel, time_s);
    match recording.vehicle.axle(wheel).has_hard_points() {
        true => found,
        false => Ok(found.unwrap_or(0.0)),
    }
}

/// A mark of a load: when, on which wheel, force, N, and point of application from the wheel centre, m.
type RigMark = (f64, Wheel, [[f64; 3]; 2]);

/// Marks `rig <wheel> <F_x> <F_y> <F_z> [at <x> <y> <z>]` with their times. Without a point, the force acts at
/// the hub.
pub(super) fn rig_marks(recording: &Recording) -> Result<Vec<RigMark>, RecordingError> {
    let marks = recording.marks.iter();
    let marks = marks.filter_map(|mark| Some((mark, mark.1.strip_prefix("rig ")?)));
    marks
        .map(|(mark, rest)| {
            let (name, rest) = rest.trim().split_once(' ').unwrap_or((rest, ""));
            let wheel = Wheel::from_abbreviation(name)
                .ok_or_else(|| ReadingProblem::NotAWheel(name.to_owned()));
            let (force, at) = rest.split_once("at").unwrap_or((rest, "0 0 0"));
            let read = wheel.and_then(|wheel| Ok((mark.0, wheel, [numbers(force)?, numbers(at)?])));
            read.map_err(|problem| refused(recording, mark, problem))
        })
        .collect()
}

fn refused(
    recording: &Recording,
    (time_s, text): &(f64, String),
    problem: ReadingProblem,
) -> RecordingError {
    RecordingError::Mark {
        log: recording.name.clone(),
        text: text.clone(),
        time_s: *time_s,
        problem,
    }
}

/// Numbers that are separated by blanks or commas; with `kg` at the end, masses are converted to loads.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], ReadingProblem> {
    let (text, factor) = match text.trim().strip_suffix("kg") {
        Some(masses) => (masses, NEWTONS_PER_KG),
        None => (text.trim(), 1.0),
    };
    let parts = text.split([' ', ',']).filter(|part| !part.is_empty());
    let values: Vec<f64> = parts
        .map(|part| {
            let value = part.parse::<f64>().ok().filter(|value| value.is_finite());
            let value = value.ok_or_else(|| ReadingProblem::NotANumber(part.to_owned()));
            value.map(|value| value * factor)
        })
        .collect::<Result<_, _>>()?;
    let found = values.len();
    <[f64; N]>::try_from(values).map_err(|_| ReadingProblem::Count { found, needed: N })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_are_read_in_newtons_and_kilograms() {
        assert_eq!(numbers("1,2, 3 4"), Ok([1.0, 2.0, 3.0, 4.0]));
        let [_, second] = numbers(" 10 20 kg").unwrap();
        assert!((second - 196.133).abs() < 1e-9);
        let short = numbers::<4>("1 2").unwrap_err().to_string();
        assert!(short.contains("but 4 are needed"), "{short}");
        let word = numbers::<2>("1 x").unwrap_err().to_string();
        assert!(word.contains("\"x\""), "{word}");
    }
}
