//! From the steering wheel to the input of the linkage: play, and measured maps of the road-wheel
//! angles.

use model::steering::{Lash, MonotoneMap, SteeringGear};
use model::vehicle::Vehicle;

use crate::EstimatorError;

/// Number of samples of a map on each side of the middle, and the largest angle, rad.
const SAMPLES: i32 = 64;
const REACH_RAD: f64 = 8.0;

/// The steering gear before the linkage, or before the steering ratio of a vehicle without hard-
/// points.
#[derive(Clone, Debug)]
pub struct SteeringColumn {
    lash: Lash,
    lash_rad: f64,
    /// Map from the steering-wheel angle to the angle that would give the same road-wheel angle
    /// with the vehicle file's rack and hard-points, or with its ratio. `None` without measured
    /// maps.
    straightened: Option<MonotoneMap>,
}

impl SteeringColumn {
    /// The gear of a vehicle with the maps and the play of its calibration.
    ///
    /// # Errors
    /// Maps that are not monotone, hard-points that do not assemble.
    pub fn new(vehicle: &Vehicle) -> Result<Self, EstimatorError> {
        let steering = &vehicle.steering;
        let is_measured = !steering.left_map_rad.is_empty() && !steering.right_map_rad.is_empty();
        Ok(Self {
            lash: Lash::default(),
            lash_rad: steering.lash_rad,
            straightened: is_measured.then(|| straightened(vehicle)).transpose()?,
        })
    }

    /// Position of the gear in its play.
    pub(crate) const fn lash(&self) -> Lash {
        self.lash
    }

    /// Puts the gear back to an earlier position in its play.
    pub(crate) const fn restore(&mut self, lash: Lash) {
        self.lash = lash;
    }

    /// Steering-wheel angle, rad, left positive, without play and with the measured maps applied.
    pub fn follow(&mut self, angle_rad: f64) -> f64 {
        let held_rad = self.lash.follow(angle_rad, self.lash_rad);
        match &self.straightened {
            Some(map) => map.at(held_rad),
            None => held_rad,
        }
    }
}

/// Builds the map. With rack and hard-points the linkage turns the wheels, else the ratio.
fn straightened(vehicle: &Vehicle) -> Result<MonotoneMap, EstimatorError> {
    let measured = SteeringGear::from_vehicle(vehicle)?;
    let mut design = vehicle.clone();
    design.steering.left_map_rad.clear();
    design.steering.right_map_rad.clear();
    let linked = design.steering.rack_m_rad.is_some() && design.front.has_hard_points();
    let by_design = SteeringGear::from_vehicle(&design)?;
    let points: Vec<[f64; 2]> = (-SAMPLES..=SAMPLES)
        .map(|sample| {
            let angle_rad = f64::from(sample) / f64::from(SAMPLES) * REACH_RAD;
            let [left, right, ..] = measured.road_wheels(angle_rad, 0.0);
            let mean_rad = 0.5 * (left + right);
            let same_rad = if linked {
                by_design.steering_wheel_rad(mean_rad)
            } else {
                mean_rad * design.steering.ratio
            };
            [angle_rad, same_rad]
        })
        .collect();
    Ok(MonotoneMap::new(&points)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent(hand_rad: f64) -> f64 {
        0.04 * hand_rad + 0.01 * math::sin(1.5 * hand_rad)
    }

    fn mapped(mut vehicle: Vehicle) -> Vehicle {
        let points: Vec<[f64; 2]> = (-40..=40)
            .map(|step| f64::from(step) / 10.0)
            .map(|hand| [hand, bent(hand)])
            .collect();
        vehicle.steering.left_map_rad.clone_from(&points);
        vehicle.steering.right_map_rad = points;
        vehicle
    }

    #[test]
    fn without_maps_and_play_the_steering_wheel_is_left_alone() {
        let mut gear = SteeringColumn::new(&Vehicle::builtin("prowler").unwrap()).unwrap();
        for angle in [0.0, 0.3, -1.7] {
            assert_eq!(gear.follow(angle), angle);
        }
    }

    #[test]
    fn measured_maps_turn_the_road_wheels_as_measured() {
        let linked = Vehicle::builtin("prowler").unwrap();
        let mut plain = linked.clone();
        plain.front.wishbone = None;
        for (vehicle, is_linked) in [(linked, true), (plain, false)] {
            let ratio = vehicle.steering.ratio;
            let by_design = SteeringGear::from_vehicle(&vehicle).unwrap();
            let mut gear = SteeringColumn::new(&mapped(vehicle)).unwrap();
            for angle in [-2.3, -0.4, 0.0, 0.15, 1.1, 2.9] {
                let straight = gear.follow(angle);
                let [left, right, ..] = by_design.road_wheels(straight, 0.0);
                let mean = if is_linked {
                    0.5 * (left + right)
                } else {
                    straight / ratio
                };
                assert!((mean - bent(angle)).abs() < 2e-4, "{angle} {mean}");
            }
        }
    }

    #[test]
    fn play_is_taken_off() {
        let mut vehicle = Vehicle::builtin("prowler").unwrap();
        vehicle.steering.lash_rad = 0.1;
        let mut gear = SteeringColumn::new(&vehicle).unwrap();
        let angles = [0.2, 0.12, 0.05, -0.2].map(|angle| gear.follow(angle));
        for (angle, expected) in angles.into_iter().zip([0.15, 0.15, 0.1, -0.15]) {
            assert!((angle - expected).abs() < 1e-12, "{angles:?}");
        }
    }
}
