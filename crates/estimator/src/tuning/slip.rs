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
        /// Standard deviation of the slip by the model of the tyre.
        model: f64 = 0.002, "1";
        /// The same by ground that is curved below the wheel, times its slope against the plane through all wheels.
        slope_part: f64 = 0.1, "1";
        /// The same by a slip that changes since the reading, times the change in the last step beyond so many
        /// standard deviations of the reading.
        changed_part: f64 = 2.0, "1";
        /// See above.
        changed_sigma: f64 = 4.0, "σ";
    }
}
