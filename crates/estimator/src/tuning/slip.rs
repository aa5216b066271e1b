//! Longitudinal slip of the wheels.

use super::tuning;

tuning! {
    /// Longitudinal slip (`estimator/road.rs`).
    SlipTuning {
        /// Speed of the wheel centre below which no slip is reported.
        speed_min_m_s: f64 = 1.0, "m/s";
        /// Standard deviation of the rolling radius as a part of it: that of the vehicle file, and a calibrated one.
        radius_part: [f64; 2] = [0.003, 0.002], "1";
        /// Angular acceleration of a wheel since its reading.
        gain_rad_s2: f64 = 10.0, "rad/s²";
        /// Standard deviation of the slip by the unevenness of the ground.
        model: f64 = 0.001, "1";
    }
}
