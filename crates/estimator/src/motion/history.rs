//! The recent past of the nominal state.

use nalgebra::{Rotation3, Vector3};
use sample::LogTime;

/// How far back late values are taken, s, at 100 Hz.
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

    /// The pose at `time`, interpolated between its neighbours, or carried on by at most 50 ms
    /// past the newest. `None` before the oldest or with nothing remembered.
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
                let turn =
                    (earlier.earth_from_body.inverse() * later.earth_from_body).scaled_axis();
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

    /// Turns and shifts the whole past as the present was corrected.
    pub fn correct(&mut self, turn: Rotation3<f64>, velocity_m_s: Vector3<f64>) {
        for pose in &mut self.ring {
            pose.earth_from_body = turn * pose.earth_from_body;
            pose.velocity_m_s += velocity_m_s;
        }
    }
}
