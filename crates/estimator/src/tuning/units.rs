//! Units of rates, angles and speeds.

use super::tuning;

tuning! {
    /// Wrong units of rates, angles and speeds (`units.rs`).
    UnitTuning {
        /// Window over which the readings are averaged.
        window_s: f64 = 0.5, "s";
        /// Larger of the speeds of receiver and wheels below which nothing is compared.
        speed_min_m_s: f64 = 2.0, "m/s";
        /// Speed of the receiver below which it has no course: km/h that are taken for m/s are 3.6 times too small.
        course_speed_min_m_s: f64 = 0.5, "m/s";
        /// Longest time for which no good sensor is blamed while a factor is that of a unit.
        hold_s: f64 = 20.0, "s";
        /// Yaw rate below which the vehicle does not turn enough.
        turning_min_rad_s: f64 = 0.06, "rad/s";
        /// Windows that a relation needs.
        windows: u32 = 4, "1";
        /// The same of the speeds: wheels that spin read too much for a while.
        speed_windows: u32 = 12, "1";
        /// The same of gyros without the attitude of a receiver, and of the attitude without gyros: a faulty velocity has
        /// a wrong course.
        alone_windows: u32 = 20, "1";
        /// Correlation that it needs. Biases and noise of gyros leave 0.6 where the readings are 57 times too small.
        correlation_min: f64 = 0.5, "1";
        /// Difference of the logarithm of a factor from that of 1, by sideslip, roll and slopes.
        roughly: f64 = 0.5, "1";
        /// The same from that of a unit: of rates, by sideslip, and of speeds, by slip of the tyres.
        near: [f64; 2] = [0.3, 0.2], "1, 1";
        /// Part of the windows that agree with 1 from which the unit is right.
        agreeing_max: f64 = 0.25, "1";
        /// Largest difference of two headings within a window.
        turn_max: f64 = 100.0, "rad";
    }
}
