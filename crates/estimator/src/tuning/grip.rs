//! Tyre grip.

use super::tuning;

tuning! {
    /// Cornering stiffness, friction and changes of the surface (`grip.rs`).
    GripTuning {
        /// Steps whose mean is one value.
        block_steps: u32 = 5, "1";
        /// Number of consecutive values with the same error.
        correlated_values: f64 = 6.0, "1";
        /// Factor on the standard deviation of sideslip: its error lasts longer.
        sideslip_factor: f64 = 2.0, "1";
        /// Random walk of ln stiffness, ln friction, slip-angle error (rad) and curve shape. The
        /// shape is constant: it belongs to the tyre.
        walk: [f64; 4] = [0.01, 0.03, 1e-4, 0.0], "1/√s, 1/√s, rad/√s, 1/√s";
        /// Initial values of the four.
        start: [f64; 4] = [0.0, 0.0, 0.0, 2.7], "1, 1, rad, 1";
        /// Initial standard deviations of the four.
        start_sigma: [f64; 4] = [0.4, 0.3, 0.015, 0.5], "1, 1, rad, 1";
        /// Bounds of ln stiffness and ln friction.
        factor_ln_bounds: [f64; 2] = [-2.0, 1.5], "1";
        /// Bounds of the slip-angle error.
        slip_error_bounds_rad: [f64; 2] = [-0.05, 0.05], "rad";
        /// Bounds of the curve shape.
        shape_bounds: [f64; 2] = [2.0, 3.2], "1";
        /// Standard deviations of ln stiffness and ln friction after a change of surface: surfaces
        /// differ mainly in friction.
        changed_sigma: [f64; 2] = [0.3, 0.7], "1";
        /// Standard deviation of ln friction above which no friction is reported.
        friction_sigma_max: f64 = 0.2, "1";
        /// Part of the friction that must have been used before it is reported.
        utilisation_min: f64 = 0.4, "1";
        /// Standard deviations that are subtracted from a lateral force for the friction in use.
        used_sigma: f64 = 2.0, "σ";
        /// Standard deviations that are subtracted for the lower bound of the friction.
        bound_sigma: f64 = 3.0, "σ";
        /// Least posterior probability of a change of surface that is declared.
        posterior_min: f64 = 0.99, "1";
        /// Model error as a part of the axle's load.
        model_part: f64 = 0.018, "1";
        /// Lowest speed at which slip angles are used.
        speed_min_m_s: f64 = 2.5, "m/s";
        /// Largest standard deviation of sideslip at which slip angles are used.
        sideslip_sigma_max_rad: f64 = 0.01, "rad";
        /// Standard deviation of a wheel's lateral force above which the force is the tyre model's
        /// own.
        lateral_sigma_max_n: f64 = 100.0, "N";
        /// Axle load below which its tyres are not used.
        load_min_n: f64 = 100.0, "N";
        /// Lateral axle force over load below which changes of the surface are not judged.
        excited: f64 = 0.15, "1";
        /// Longitudinal force over load above which a value is not used: combined slip is not
        /// modelled.
        longitudinal_max: f64 = 0.2, "1";
        /// Reference value of the cumulative sums. White differences would need 0.5 at 100 Hz; these
        /// are slower and not white.
        cusum_reference: f64 = 0.75, "σ";
        /// Threshold of the cumulative sums. With white differences and a reference of 0.5 the false
        /// alarm rate is one an hour.
        cusum_threshold: f64 = 10.94, "σ";
        /// Logarithm of the odds that no change has come: one an hour at twenty values a second.
        log_odds: f64 = 11.2, "1";
        /// Smallest relative change of the lateral force that is reported.
        change_min: f64 = 0.1, "1";
        /// Time within which the rear axle follows a change of the front axle's surface.
        follows_s: f64 = 3.0, "s";
        /// Part of the threshold that applies to the rear axle in that time.
        follows_part: f64 = 0.35, "1";
        /// Values with excitation before changes are reported.
        learning_values: u32 = 100, "1";
        /// Part of the friction in use up to which a slip angle is derived from a lateral force.
        slip_utilisation_max: f64 = 0.7, "1";
        /// Relative standard deviation of that slip angle beside the stiffness', constant part.
        slip_sigma_part: f64 = 0.1, "1";
        /// The same, times the part of the friction in use.
        slip_sigma_utilisation: f64 = 0.5, "1";
        /// Standard deviation of that slip angle, constant part.
        slip_sigma_rad: f64 = 0.006, "rad";
    }
}
