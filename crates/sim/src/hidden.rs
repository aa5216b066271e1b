//! Errors of sensors and mounting that no file tells: what a calibration has to find.

use model::sensors::Sensors;
use sample::{PerWheel, StrainChannel};
use serde::{Deserialize, Serialize};

use crate::random::Noise;

/// Greatest size of each hidden error; all zero by default. Each is drawn by the run's seed,
/// uniformly within plus and minus its size.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HiddenErrors {
    /// Offset of each strain bridge before any zero, counts. The sensors file's
    /// `zero_error_counts` comes on top.
    pub bridge_offset_counts: f64,
    /// Force of one count of each strain bridge, part of the nominal one.
    pub bridge_gain_fraction: f64,
    /// Offset of each spring potentiometer, counts.
    pub potentiometer_offset_counts: f64,
    /// What the steering-wheel encoder reads straight ahead, rad.
    pub steer_offset_rad: f64,
    /// Turn of the inertial unit about each axis, rad.
    pub imu_misalignment_rad: f64,
    /// Place of the velocity receiver's antenna, each axis, m.
    pub velocity_antenna_m: f64,
    /// Latency of the velocity that its message does not tell, s.
    pub velocity_latency_s: f64,
    /// Latency of the attitude beyond the sensors file's, s.
    pub attitude_latency_s: f64,
    /// Yaw, pitch and roll that the attitude antennas' mounting adds, rad.
    pub attitude_offset_rad: f64,
}

/// The hidden errors of one run, as drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// True force of one count over the nominal one.
    pub bridge_gain_factor: PerWheel<[f64; StrainChannel::COUNT]>,
    /// Offset of each spring potentiometer, counts.
    pub potentiometer_offset_counts: PerWheel<f64>,
    /// What the steering-wheel encoder reads straight ahead, rad.
    pub steer_offset_rad: f64,
    /// Turn of the inertial unit, beside the sensors file's, rad.
    pub imu_misalignment_rad: [f64; 3],
    /// Displacement of the velocity receiver's antenna from the sensors file's place, m.
    pub velocity_antenna_m: [f64; 3],
    /// Latency of the velocity that its message does not tell, s.
    pub velocity_latency_s: f64,
    /// Latency of the attitude beyond the sensors file's, s.
    pub attitude_latency_s: f64,
    /// Yaw, pitch and roll that the attitude antennas' mounting adds, rad.
    pub attitude_offset_rad: [f64; 3],
}

impl Hidden {
    pub(crate) fn draw(sizes: &HiddenErrors, seed: u64) -> Self {
        let mut channels = Noise::new(seed, "hidden channels");
        let mut mounting = Noise::new(seed, "hidden mounting");
        let bridge_gain_factor = PerWheel::from_fn(|_| {
            std::array::from_fn(|_| 1.0 + channels.within(sizes.bridge_gain_fraction))
        });
        let potentiometer_offset_counts =
            PerWheel::from_fn(|_| channels.within(sizes.potentiometer_offset_counts));
        let mut three = |size| std::array::from_fn(|_| mounting.within(size));
        let imu_misalignment_rad = three(sizes.imu_misalignment_rad);
        let velocity_antenna_m = three(sizes.velocity_antenna_m);
        let attitude_offset_rad = three(sizes.attitude_offset_rad);
        Self {
            bridge_gain_factor,
            potentiometer_offset_counts,
            imu_misalignment_rad,
            velocity_antenna_m,
            attitude_offset_rad,
            steer_offset_rad: mounting.within(sizes.steer_offset_rad),
            velocity_latency_s: mounting.within(sizes.velocity_latency_s),
            attitude_latency_s: mounting.within(sizes.attitude_latency_s),
        }
    }

    /// The sensors as they really are, as far as their file has a field for it.
    pub(crate) fn applied(&self, sensors: &Sensors) -> Sensors {
        let add = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| a[i] + b[i]);
        let mut real = sensors.clone();
        real.imu.misalignment_rad = add(real.imu.misalignment_rad, self.imu_misalignment_rad);
        real.gnss_velocity.antenna_m = add(real.gnss_velocity.antenna_m, self.velocity_antenna_m);
        real.gnss_attitude.latency_s += self.attitude_latency_s;
        real
    }
}
