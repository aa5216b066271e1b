//! Drift of the strain channels with the temperature of their bridges.

use sample::{StrainChannel, Wheel};

use super::marked::rig_marks;
use super::{Calibrated, Calibration};
use crate::EstimatorError;
use crate::calibration::load_rig::{RigLoad, members};
use crate::calibration::recording::Column;
use crate::calibration::rest::Signal;
use crate::calibration::temperature::{Window, drift, figure};
use crate::calibration::{Recording, RecordingError, Resolved};
use crate::finding::Findings;

/// Length of a window, s.
const WINDOW_S: f64 = 0.5;
/// Time after a mark in which its load is on, s.
const LOADED_S: f64 = 2.0;
/// Wheel speed of a vehicle that moves, rad/s.
const ROLLS_RAD_S: f64 = 0.2;
/// Change of a spring deflection of a vehicle on which a load changes that no mark states, m.
const TRAVEL_MAX_M: f64 = 0.003;
/// Angular rate (rms) of a vehicle that moves, rad/s.
const TURNS_RAD_S: f64 = 0.1;

pub(super) fn temperature(
    recordings: &[Recording],
    known: &Calibration,
) -> Result<Calibrated, EstimatorError> {
    let first = &recordings[0];
    let measured = recordings
        .iter()
        .any(|recording| recording.temperature_c.0.iter().any(Column::is_known));
    first.require(
        "bridge temperature (role bridge_temperature.FL, ... of a CAN source)",
        measured,
    )?;
    let resolved = Resolved::new(&first.sensors, known)?;
    for recording in recordings {
        refuse_motion(recording, &resolved)?;
    }
    let mut calibration = known.clone();
    let mut findings = Findings {
        what: "drift of the strain channels with temperature".to_owned(),
        ..Findings::default()
    };
    for wheel in Wheel::ALL {
        let mut shown = Vec::new();
        for channel in StrainChannel::ALL {
            if resolved.corners[wheel].strain[channel.index()].dead {
                continue;
            }
            let mut all = Vec::new();
            for recording in recordings {
                all.extend(windows(recording, &resolved, wheel, channel)?);
            }
            let Some(begin_c) = all.first().map(|window| window.temperature_c) else {
                continue;
            };
            let slot = calibration
                .corner
                .entry(wheel)
                .or_default()
                .strain
                .entry(channel)
                .or_default();
            let reference_c = slot.temperature.map_or(begin_c, |known| known.reference_c);
            if let Some(found) = drift(wheel, channel, &all, reference_c, &mut findings)? {
                slot.temperature = Some(found);
                shown.push((channel, all));
            }
        }
        if shown.is_empty() {
            let corner = wheel.abbreviation();
            findings.notes.push(format!(
                "{corner}: no drift found; a temperature or the strain channels are absent"
            ));
        } else {
            findings.figures.push(figure(wheel, &shown));
        }
    }
    Ok(Calibrated {
        calibration,
        findings: vec![findings],
    })
}

fn refuse_motion(recording: &Recording, resolved: &Resolved) -> Result<(), RecordingError> {
    let refuse = |what: &'static str, value: f64, unit: &'static str| RecordingError::Moves {
        log: recording.name.clone(),
        what,
        value,
        unit,
    };
    for wheel in &recording.wheel_speed.0 {
        let speed = wheel
            .signal()
            .value
            .iter()
            .fold(0.0_f64, |most, speed| most.max(speed.abs()));
        if speed > ROLLS_RAD_S {
            return Err(refuse("wheel speed", speed, "rad/s"));
        }
    }
    for wheel in Wheel::ALL {
        let known = &resolved.corners[wheel].deflection;
        let range_m = range(recording.deflection[wheel].signal()) * known.gain.abs();
        if !known.dead && range_m > TRAVEL_MAX_M {
            return Err(refuse("change of a spring deflection", range_m, "m"));
        }
    }
    let imu = recording.imu.signal();
    let squares: f64 = imu
        .rate_rad_s
        .iter()
        .flatten()
        .map(|rate| rate * rate)
        .sum();
    let rms = (squares / imu.rate_rad_s.len().max(1) as f64).sqrt();
    if rms > TURNS_RAD_S {
        return Err(refuse("angular rate (rms)", rms, "rad/s"));
    }
    Ok(())
}

/// Largest less smallest mean over a window.
fn range(signal: Signal<'_>) -> f64 {
    let (Some(begin_s), Some(end_s)) = (signal.time_s.first(), signal.time_s.last()) else {
        return 0.0;
    };
    let count = ((end_s - begin_s) / WINDOW_S).floor() as usize;
    let mean = |k: usize| {
        let from_s = begin_s + k as f64 * WINDOW_S;
        signal.mean(from_s, from_s + WINDOW_S)
    };
    let means = (0..count).filter_map(mean);
    let [low, high] = means.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], mean| {
        [low.min(mean), high.max(mean)]
    });
    (high - low).max(0.0)
}

/// Windows of a channel, with the known force of its member. Of a wheel with marked loads, those after the marks
/// are used; without a mark, the load is constant.
fn windows(
    recording: &Recording,
    resolved: &Resolved,
    wheel: Wheel,
    channel: StrainChannel,
) -> Result<Vec<Window>, EstimatorError> {
    let index = channel.index();
    let (strain, temperature) = (
        recording.strain[wheel][index].signal(),
        recording.temperature_c[wheel].signal(),
    );
    let (Some(begin_s), Some(end_s)) = (strain.time_s.first(), strain.time_s.last()) else {
        return Ok(Vec::new());
    };
    let known = &resolved.corners[wheel];
    let marks: Vec<(f64, [[f64; 3]; 2])> = rig_marks(recording)?
        .into_iter()
        .filter(|(_, marked, _)| *marked == wheel)
        .map(|(time_s, _, load)| (time_s, load))
        .collect();
    let count = ((end_s - begin_s) / WINDOW_S).floor() as usize;
    let mut found = Vec::new();
    for k in 0..count {
        let from_s = begin_s + k as f64 * WINDOW_S;
        let to_s = from_s + WINDOW_S;
        let mark = marks
            .iter()
            .find(|(time_s, _)| (*time_s..=time_s + LOADED_S - WINDOW_S).contains(&from_s));
        if mark.is_none() && !marks.is_empty() {
            continue;
        }
        let (Some(counts), Some(temperature_c)) =
            (strain.mean(from_s, to_s), temperature.mean(from_s, to_s))
        else {
            continue;
        };
        let force_counts = match mark {
            None => 0.0,
            Some((_, [force_n, at_m])) => {
                let deflection = recording.deflection[wheel].signal().mean(from_s, to_s);
                let compression_m = deflection.map_or(0.0, |counts| {
                    known.deflection.gain * (counts - known.deflection.offset_counts)
                });
                let load = RigLoad {
                    wheel,
                    force_n: *force_n,
                    at_m: *at_m,
                    compression_m,
                    steering_wheel_rad: 0.0,
                    counts: [None; StrainChannel::COUNT],
                };
                let response = match &known.matrix {
                    Some(matrix) => matrix.response_n(index, &recording.vehicle, &load),
                    None => members(&recording.vehicle, &recording.sensors, &load)?[index],
                };
                response / known.strain[index].gain
            }
        };
        found.push(Window {
            time_s: 0.5 * (from_s + to_s),
            temperature_c,
            counts,
            force_counts,
        });
    }
    Ok(found)
}

/// Notes the temperature at which a step found offsets, and keeps what was known of the drift.
pub(super) fn keep_drift(recordings: &[Recording], known: &Calibration, found: &mut Calibrated) {
    let columns = |wheel: Wheel| {
        recordings
            .iter()
            .map(move |recording| recording.temperature_c[wheel].signal())
    };
    for wheel in Wheel::ALL {
        let values: Vec<f64> = columns(wheel)
            .flat_map(|signal| signal.value.iter().copied())
            .collect();
        let mean_c = (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let before = known.corner.get(&wheel);
        let Some(corner) = found.calibration.corner.get_mut(&wheel) else {
            continue;
        };
        for (channel, slot) in &mut corner.strain {
            let old = before.and_then(|corner| corner.strain.get(channel));
            let is_new = old.is_none_or(|old| old.offset_counts != slot.offset_counts);
            slot.temperature = old.and_then(|old| old.temperature);
            if let Some(mean_c) = mean_c.filter(|_| is_new && slot.offset_counts.is_some()) {
                slot.temperature.get_or_insert_default().reference_c = mean_c;
            } else if is_new && slot.temperature.is_some_and(|drift| !drift.is_none()) {
                let note = format!(
                    "{} {}: the log has no bridge temperature, so that the offset is taken as that at the reference \
                     temperature of the file",
                    wheel.abbreviation(),
                    channel.name()
                );
                found
                    .findings
                    .iter_mut()
                    .take(1)
                    .for_each(|findings| findings.notes.push(note.clone()));
            }
        }
    }
}
