//! Steering: road-wheel angles from the steering wheel.
//!
//! The thesis measures the steering wheel with a string potentiometer and takes both road wheels as
//! equal (note to equation 2.7). Here each wheel has its own calibrated map, a rack with
//! hard-points gives exact angles, and play, roll steer and Ackermann's geometry are modelled.

mod map;
mod toe;

pub use map::MonotoneMap;
pub use toe::{TOE_PLAY_FORCE_N, Toe};

use sample::Wheel;

use crate::suspension::Corner;
use crate::vehicle::Vehicle;
use crate::{Error, Scalar};

/// Largest road-wheel angle that a rack is sampled to, rad.
const LOCK_RAD: f64 = 0.75;

/// Samples of a rack's map on each side of the middle.
const RACK_SAMPLES: usize = 16;

/// Steering gear of a vehicle: from the steering wheel to four road wheels, without play.
#[derive(Clone, Debug, PartialEq)]
pub struct SteeringGear {
    /// Steering-wheel angle to the left front wheel's steer angle, rad.
    pub left: MonotoneMap,
    /// Steering-wheel angle to the right front wheel's steer angle, rad.
    pub right: MonotoneMap,
    /// Road-wheel steer per roll angle (front, rear).
    pub roll_steer: [f64; 2],
    /// Free play at the steering wheel, rad, from one contact to the other.
    pub lash_rad: f64,
}

impl SteeringGear {
    /// The gear of a vehicle: its calibrated maps where it has them, otherwise its rack and
    /// hard-points, otherwise its ratio with its part of Ackermann's geometry.
    ///
    /// # Errors
    /// Where the maps are not monotone or the hard-points do not assemble.
    pub fn from_vehicle(vehicle: &Vehicle) -> Result<Self, Error> {
        let steering = &vehicle.steering;
        let (left, right) = if !steering.left_map_rad.is_empty()
            && !steering.right_map_rad.is_empty()
        {
            (
                MonotoneMap::new(&steering.left_map_rad)?,
                MonotoneMap::new(&steering.right_map_rad)?,
            )
        } else if let (Some(rack), true) = (steering.rack_m_rad, vehicle.front.has_hard_points()) {
            (
                rack_map(vehicle, Wheel::FrontLeft, rack)?,
                rack_map(vehicle, Wheel::FrontRight, rack)?,
            )
        } else {
            let pairs = |side: usize| -> Vec<[f64; 2]> {
                (-16..=16)
                    .map(|step| {
                        let mean = f64::from(step) / 16.0 * 0.6;
                        let length = vehicle.wheelbase_m();
                        let exact = ackermann(mean, length, vehicle.front.track_m);
                        let angle = mean + steering.ackermann * (exact[side] - mean);
                        [mean * steering.ratio, angle]
                    })
                    .collect()
            };
            (MonotoneMap::new(&pairs(0))?, MonotoneMap::new(&pairs(1))?)
        };
        Ok(Self {
            left,
            right,
            roll_steer: steering.roll_steer,
            lash_rad: steering.lash_rad,
        })
    }

    /// Steer angles of the four road wheels for a steering-wheel angle (as [`Lash`] leaves it) and a
    /// roll angle, rad, left positive.
    pub fn road_wheels<T: Scalar>(&self, steering_wheel_rad: T, roll_rad: T) -> [T; 4] {
        let [front, rear] = self.roll_steer;
        [
            self.left.at(steering_wheel_rad) + roll_rad * front,
            self.right.at(steering_wheel_rad) + roll_rad * front,
            roll_rad * rear,
            roll_rad * rear,
        ]
    }

    /// The steering-wheel angle that gives a mean front steer angle, by bisection.
    #[must_use]
    pub fn steering_wheel_rad(&self, mean_steer_rad: f64) -> f64 {
        let mean = |hand: f64| 0.5 * (self.left.at(hand) + self.right.at(hand));
        let mut reach = 1.0;
        while mean(reach) < mean_steer_rad && reach < 1e3 {
            reach *= 2.0;
        }
        let mut low = -1.0;
        while mean(low) > mean_steer_rad && low > -1e3 {
            low *= 2.0;
        }
        let mut high = reach;
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if mean(middle) < mean_steer_rad {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }
}

/// Samples one wheel's angle over the rack's travel, to the lock or to the linkage's reach.
fn rack_map(vehicle: &Vehicle, wheel: Wheel, rack_m_rad: f64) -> Result<MonotoneMap, Error> {
    let degenerate = |_| Error::MissingPart {
        vehicle: vehicle.name.clone(),
        part: "a front linkage that assembles",
        model: "the rack's steering map",
    };
    let corner = Corner::of(vehicle, wheel).map_err(degenerate)?;
    let length = corner.design_strut_length_m();
    let angle = |rack: f64| corner.pose(length, rack).map(|pose| pose.steer_rad());
    let straight = angle(0.0).map_err(degenerate)?;
    let mut pairs = vec![[0.0, straight]];
    for side in [-1.0, 1.0] {
        let mut last = straight;
        for step in 1..=RACK_SAMPLES {
            let rack = side * 0.005 * step as f64;
            let Ok(steer) = angle(rack) else { break };
            if (steer - last) * side <= 0.0 || steer.abs() > LOCK_RAD {
                break;
            }
            pairs.push([rack / rack_m_rad, steer]);
            last = steer;
        }
    }
    pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
    MonotoneMap::new(&pairs)
}

/// Angles of the left and right wheel whose normals meet on the rear axle's line, for a mean
/// angle delta whose tangent is L/R: tan(delta_i) = tan(delta)/(1 -+ t tan(delta)/(2 L)).
#[must_use]
pub fn ackermann(mean_rad: f64, wheelbase_m: f64, track_m: f64) -> [f64; 2] {
    let slope = math::tan(mean_rad);
    let part = 0.5 * track_m * slope / wheelbase_m;
    [
        math::atan(slope / (1.0 - part)),
        math::atan(slope / (1.0 + part)),
    ]
}

/// Free play: the gear stands still until the steering wheel has crossed it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lash {
    /// Steering-wheel angle that the gear follows, rad.
    pub held_rad: f64,
}

impl Lash {
    /// Moves the steering wheel and gives the angle that the gear follows. `lash_rad` is the play from
    /// one contact to the other.
    pub fn follow(&mut self, steering_wheel_rad: f64, lash_rad: f64) -> f64 {
        let half = 0.5 * lash_rad.max(0.0);
        if steering_wheel_rad.is_finite() {
            self.held_rad = self
                .held_rad
                .clamp(steering_wheel_rad - half, steering_wheel_rad + half);
        }
        self.held_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ackermann_normals_meet_on_the_rear_axle() {
        let [left, right] = ackermann(0.3, 1.4471, 1.143);
        let cotangents = 1.0 / math::tan(right) - 1.0 / math::tan(left);
        assert!((cotangents - 1.143 / 1.4471).abs() < 1e-12);
        assert!(left > right, "the inner wheel turns more");
    }

    #[test]
    fn the_prowlers_rack_turns_both_wheels_as_the_independent_simulator_says() {
        // params.json: 9.89 and 10.75 rad per metre of rack for a right turn, ratio about 9.16.
        let gear = SteeringGear::from_vehicle(&Vehicle::builtin("prowler").unwrap()).unwrap();
        let [left, right, ..] = gear.road_wheels(-2.0, 0.0);
        let rack = -2.0 * 0.0106;
        let mut rates = [left / rack, right / rack];
        rates.sort_by(f64::total_cmp);
        assert!(
            (rates[0] - 9.89).abs() < 0.4 && (rates[1] - 10.75).abs() < 0.6,
            "{rates:?}"
        );
        let ratio = -2.0 / (0.5 * (left + right));
        assert!((ratio - 9.16).abs() < 0.4, "{ratio}");
        assert!(gear.road_wheels(0.0_f64, 0.0)[0].abs() < 1e-9);
        assert!((gear.steering_wheel_rad(0.5 * (left + right)) + 2.0).abs() < 1e-9);
    }

    #[test]
    fn a_ratio_alone_gives_parallel_wheels() {
        let vehicle = Vehicle::builtin("prowler-table-2.3").unwrap();
        let gear = SteeringGear::from_vehicle(&vehicle).unwrap();
        let [left, right, rear, _] = gear.road_wheels(0.916_f64, 0.1);
        assert!((left - 0.1).abs() < 1e-12 && (right - 0.1).abs() < 1e-12 && rear == 0.0);
    }

    #[test]
    fn play_is_crossed_before_the_gear_moves() {
        let mut lash = Lash::default();
        assert_eq!(lash.follow(0.04, 0.1), 0.0);
        assert!((lash.follow(0.15, 0.1) - 0.10).abs() < 1e-15);
        assert!((lash.follow(0.08, 0.1) - 0.10).abs() < 1e-15);
        assert!((lash.follow(0.0, 0.1) - 0.05).abs() < 1e-15);
        assert!((lash.follow(f64::NAN, 0.1) - 0.05).abs() < 1e-15);
    }
}
