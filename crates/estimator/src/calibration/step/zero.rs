//! Zero offsets of strain bridges and potentiometers.

use sample::{PerWheel, STANDARD_GRAVITY_M_S2, StrainChannel};

use super::{Calibrated, Calibration};
use crate::EstimatorError;
use crate::calibration::recording::Column;
use crate::calibration::rest::{Rest, Stretch};
use crate::calibration::zero::{self, CornerRest, ZeroInput};
use crate::calibration::{Recording, RecordingError, Resolved};

/// Rotation of a wheel after which its tyre has no lateral scrub force, rad.
const ROLLED_RAD: f64 = 3.0;

pub(super) fn zero(
    recording: &Recording,
    known: &Calibration,
    weight_sigma: f64,
) -> Result<Calibrated, EstimatorError> {
    let travelling = recording.deflection.0.iter().any(Column::is_known);
    recording.require("spring deflection", travelling)?;
    let stretches = recording.rest();
    let hanging = hanging(recording, &stretches).ok_or_else(|| RecordingError::NeverHanging {
        log: recording.name.clone(),
    })?;
    let standing = standing(recording, &stretches, hanging);
    let steering_wheel = |stretch: Option<Stretch>| {
        let offset = known.steer.offset_rad;
        let mean = stretch.and_then(|s| recording.steer.signal().mean(s.from_s, s.to_s));
        mean.map_or(0.0, |angle| angle - offset)
    };
    let hanging_rest = rest_values(recording, hanging);
    let standing_rest = standing.map(|stretch| rest_values(recording, stretch));
    let resolved = Resolved::new(&recording.sensors, known)?;
    let level = [0.0, 0.0, STANDARD_GRAVITY_M_S2];
    let measured = recording.specific_force(&resolved, hanging);
    let mut found = zero::zero(&ZeroInput {
        specific_force_m_s2: measured.unwrap_or(level),
        vehicle: &recording.vehicle,
        sensors: &recording.sensors,
        known,
        hanging: &hanging_rest,
        standing: standing_rest.as_ref(),
        steering_wheel_rad: [steering_wheel(Some(hanging)), steering_wheel(standing)],
        weight_sigma,
    })?;
    if measured.is_none() {
        let note = "the log has no inertial unit, so the stands are assumed to be level";
        found.findings.notes.push(note.to_owned());
    }
    Ok(Calibrated {
        calibration: found.calibration,
        findings: vec![found.findings],
    })
}

/// Longest time at rest with the struts at full length, which is the first one unless the log begins
/// with the vehicle on the ground.
fn hanging(recording: &Recording, stretches: &[Stretch]) -> Option<Stretch> {
    let level = |stretch: &Stretch| {
        let mut levels: Vec<f64> = recording
            .deflection
            .0
            .iter()
            .filter_map(|pot| pot.signal().mean(stretch.from_s, stretch.to_s))
            .collect();
        levels.sort_by(f64::total_cmp);
        levels.get(levels.len() / 2).copied()
    };
    let lowest = stretches
        .iter()
        .filter_map(level)
        .fold(f64::INFINITY, f64::min);
    // Counts increase with compression. A tenth of the range is above the noise and below the travel.
    let span = 0.1 * math::exp2(f64::from(recording.sensors.deflection.adc_bits));
    stretches
        .iter()
        .filter(|stretch| level(stretch).is_some_and(|l| l < lowest + 0.5 * span))
        .max_by(|a, b| (a.to_s - a.from_s).total_cmp(&(b.to_s - b.from_s)))
        .copied()
}

/// Last time at rest after the wheels have rolled, if there is one.
fn standing(recording: &Recording, stretches: &[Stretch], hanging: Stretch) -> Option<Stretch> {
    stretches
        .iter()
        .rev()
        .find(|stretch| {
            stretch.from_s > hanging.to_s
                && recording.wheel_speed.0.iter().all(|wheel| {
                    let (time_s, speed) = wheel.signal().within(hanging.to_s, stretch.from_s);
                    let turned = time_s.windows(2).zip(&speed);
                    let turned: f64 = turned.map(|(t, w)| (t[1] - t[0]) * w.abs()).sum();
                    turned > ROLLED_RAD
                })
        })
        .copied()
}

/// Means of all channels over a stretch.
fn rest_values(recording: &Recording, stretch: Stretch) -> PerWheel<CornerRest> {
    let Stretch { from_s, to_s } = stretch;
    let range = |bits: u8| [0.0, math::exp2(f64::from(bits)) - 1.0];
    let strain_range = range(recording.sensors.strain.adc_bits);
    let pot_range = range(recording.sensors.deflection.adc_bits);
    PerWheel::from_fn(|wheel| {
        let strain = &recording.strain[wheel];
        CornerRest {
            strain: StrainChannel::ALL.map(|channel| {
                let signal = strain[channel.index()].signal();
                Rest::of(&signal, from_s, to_s, strain_range)
            }),
            deflection: Rest::of(
                &recording.deflection[wheel].signal(),
                from_s,
                to_s,
                pot_range,
            ),
        }
    })
}
