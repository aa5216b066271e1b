//! The recent past of the nominal state.

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use sample::LogTime;

/// Longest latency of a value that is used, s, at 100 Hz.
pub const SPAN_S: f64 = 0.64;

const LENGTH: usize = 64;

/// The nominal state of one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// When.
    pub time: LogTime,
    /// Attitude.
    pub earth_from_body: Rotation3<f64>,
    /// Velocity of the inertial unit, earth axes, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Rate without bias, body axes, rad/s.
    pub rate_rad_s: Vector3<f64>,
}

/// A ring of the last poses, in order of time.
#[derive(Clone, Debug, Default)]
pub struct History {
    ring: Vec<Pose>,
    newest: usize,
}

impl History {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.ring.clear();
        self.newest = 0;
    }

    /// Adds the present.
    pub fn push(&mut self, pose: Pose) {
        if self.ring.len() < LENGTH {
            if self.ring.capacity() < LENGTH {
                self.ring.reserve_exact(LENGTH - self.ring.len());
            }
            self.newest = self.ring.len();
            self.ring.push(pose);
        } else {
            self.newest = (self.newest + 1) % LENGTH;
            self.ring[self.newest] = pose;
        }
    }

    fn back(&self, age: usize) -> Pose {
        let length = self.ring.len();
        self.ring[(self.newest + length - age) % length]
    }

    /// The pose at `time`, interpolated between its neighbours, or extrapolated by at most 50 ms.
    /// `None` before the oldest pose or without any.
    #[must_use]
    pub fn at(&self, time: LogTime) -> Option<Pose> {
        if self.ring.is_empty() {
            return None;
        }
        let mut later = self.back(0);
        if time >= later.time {
            let ahead_s = time.seconds_since(later.time);
            return (ahead_s <= 0.05).then(|| Pose {
                time,
                earth_from_body: later.earth_from_body * Rotation3::new(later.rate_rad_s * ahead_s),
                ..later
            });
        }
        for age in 1..self.ring.len() {
            let earlier = self.back(age);
            if time >= earlier.time {
                let span_s = later.time.seconds_since(earlier.time);
                let part = time.seconds_since(earlier.time) / span_s;
                let turn = turn_between(&earlier.earth_from_body, &later.earth_from_body);
                return Some(Pose {
                    time,
                    earth_from_body: earlier.earth_from_body * Rotation3::new(turn * part),
                    velocity_m_s: earlier.velocity_m_s.lerp(&later.velocity_m_s, part),
                    rate_rad_s: earlier.rate_rad_s.lerp(&later.rate_rad_s, part),
                });
            }
            later = earlier;
        }
        None
    }

    /// Rotates the earth axes of all poses.
    pub fn turn(&mut self, turn: Rotation3<f64>) {
        for pose in &mut self.ring {
            pose.earth_from_body = turn * pose.earth_from_body;
            pose.velocity_m_s = turn * pose.velocity_m_s;
        }
    }

    /// Applies a correction of the present to all poses.
    pub fn correct(&mut self, turn: Rotation3<f64>, velocity_m_s: Vector3<f64>) {
        for pose in &mut self.ring {
            pose.earth_from_body = turn * pose.earth_from_body;
            pose.velocity_m_s += velocity_m_s;
        }
    }
}

/// Axis and angle from one attitude to another, rad, by way of a quaternion: the arc cosine of a
/// matrix's trace is not a number where rounding has brought that above three.
fn turn_between(from: &Rotation3<f64>, to: &Rotation3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(&(from.inverse() * to)).scaled_axis()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two nearly equal attitudes gave no pose between them, and GNSS was not used.
    #[test]
    fn a_body_that_hardly_turns_has_an_attitude_between_two_poses() {
        let pose = |milliseconds: u64, earth_from_body| Pose {
            time: LogTime(milliseconds * 1_000_000),
            earth_from_body,
            velocity_m_s: Vector3::zeros(),
            rate_rad_s: Vector3::zeros(),
        };
        let mut first = Rotation3::from_euler_angles(0.3, -0.2, 1.1);
        for k in 0..1000 {
            let second = first * Rotation3::new(Vector3::new(3e-9, -2e-9, 1e-12 * f64::from(k)));
            let mut history = History::default();
            history.push(pose(10, first));
            history.push(pose(20, second));
            let between = history.at(LogTime(15_000_000)).unwrap();
            let turned = turn_between(&first, &between.earth_from_body).norm();
            assert!((turned - 0.5 * 13e-18_f64.sqrt()).abs() < 1e-9, "{turned}");
            first = second;
        }
    }
}
