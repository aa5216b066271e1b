//! The cornering stiffness freed of the steering encoder's offset.

use model::steering::SteeringGear;
use model::vehicle::Vehicle;

use super::{Body, Options, identify};
use crate::finding::{Findings, Refusal};
use crate::identification::recorded::mean_road_rad;
use crate::identification::{Drive, roll_centre};

/// Rounds in which the steer angle is freed of the steering wheel's offset.
const OFFSET_ROUNDS: usize = 2;

/// Finds the cornering stiffness of both axles of a vehicle, about the roll axis that its linkage
/// has.
///
/// The steering gear makes more of an offset of the steering wheel at one angle than at another,
/// where the regression knows one offset of the road wheels. So the steer angle is freed of what was
/// found, twice. What other methods find stays that of the steer angle as it was read.
///
/// # Errors
/// As [`identify`].
pub fn of_vehicle(
    drive: &Drive,
    vehicle: &Vehicle,
    options: &Options,
) -> Result<Findings, Refusal> {
    let body = Body::of(&roll_centre::of_linkage(vehicle));
    let result = identify(drive, &body, options)?;
    match SteeringGear::from_vehicle(vehicle) {
        Ok(gear) => free_of_offset(drive.clone(), &gear, result, |drive| {
            identify(drive, &body, options)
        }),
        Err(_) => Ok(result),
    }
}

fn free_of_offset(
    mut drive: Drive,
    gear: &SteeringGear,
    mut result: Findings,
    find: impl Fn(&Drive) -> Result<Findings, Refusal>,
) -> Result<Findings, Refusal> {
    let middle_rad = gear.steering_wheel_rad(0.0);
    let mut beside = std::mem::take(&mut result.beside);
    let mut offset_rad = 0.0;
    for _ in 0..OFFSET_ROUNDS {
        let left_rad = result.value("steer_offset")[0];
        let more_rad = gear.steering_wheel_rad(left_rad) - middle_rad;
        offset_rad += more_rad;
        for steer_rad in &mut drive.steer_rad {
            let wheel_rad = gear.steering_wheel_rad(*steer_rad);
            *steer_rad +=
                mean_road_rad(gear, wheel_rad - more_rad) - mean_road_rad(gear, wheel_rad);
        }
        result = find(&drive)?;
    }
    let taken_rad = mean_road_rad(gear, middle_rad + offset_rad);
    for finding in &mut result.findings {
        if finding.name == "steer_offset" {
            finding.value += taken_rad;
            finding.interval = finding.interval.map(|ends| ends.map(|end| end + taken_rad));
            let wheel_rad = gear.steering_wheel_rad(finding.value) - middle_rad;
            beside.push((
                "steer_offset_at_steering_wheel".to_owned(),
                wheel_rad,
                "rad".to_owned(),
            ));
        }
    }
    Ok(Findings { beside, ..result })
}
