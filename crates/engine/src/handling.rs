//! Handling of a vehicle from a log without a reference of sideslip.

use estimator::Calibration;
use estimator::calibration::Resolved;
use estimator::identification::handling::{Identified, identify};
use estimator::planar::{PlanarInput, PlanarRecorder};
use store::{Reader, Record};

use crate::{Config, Engine, Error, Result};

/// What [`identify_handling`] found.
#[derive(Clone, Debug)]
pub struct Handling {
    /// Tyres, yaw inertia, gains and offsets.
    pub identified: Identified,
    /// The configuration's calibration with them.
    pub calibration: Calibration,
}

/// Identifies the handling from the raw bytes of a log up to `until_s` after its begin, under
/// `config`.
///
/// # Errors
/// If the configuration names no vehicle, the log cannot be read, or its drive does not tell the
/// handling.
pub fn identify_handling(
    reader: &Reader,
    config: &Config,
    until_s: Option<f64>,
) -> Result<Handling> {
    let given = config.estimator.as_ref().ok_or(Error::NoVehicleNamed)?;
    let resolved = Resolved::new(&given.sensors, &given.calibration)?;
    let imu_ahead_m = resolved.plain_imu_ahead_m;
    let vehicle = given.calibration.applied(&given.vehicle);
    let recorder = PlanarRecorder::new(&vehicle, resolved, given.settings.clone())?;
    let inputs = inputs(reader, config, recorder, until_s)?;
    let identified = identify(&inputs, &vehicle, imu_ahead_m)?;
    let mut calibration = given.calibration.clone();
    identified.put(vehicle.steering.ratio, &mut calibration);
    calibration.description = format!(
        "handling identified from {:.0} s of driving in run {}",
        identified.used_s,
        reader.session().run_id
    );
    Ok(Handling {
        identified,
        calibration,
    })
}

/// Inputs of the planar filter, from the raw data.
fn inputs(
    reader: &Reader,
    config: &Config,
    mut recorder: PlanarRecorder,
    until_s: Option<f64>,
) -> Result<Vec<PlanarInput>> {
    // Decoding needs no estimator.
    let decoding = Config {
        estimator: None,
        ..config.clone()
    };
    let mut engine = Engine::new(&decoding)?;
    let mut records = Vec::new();
    let mut start = None;
    for arrival in reader.arrivals() {
        let arrival = arrival?;
        let start = *start.get_or_insert(arrival.log_time);
        let since_s = arrival.log_time.seconds_since(start);
        if until_s.is_some_and(|until_s| since_s > until_s) {
            break;
        }
        recorder.advance(arrival.log_time);
        records.clear();
        engine.push(&arrival, &mut records);
        for record in &records {
            if let Record::Sample(sample) = record {
                recorder.push(sample);
            }
        }
    }
    Ok(recorder.into_inputs())
}
