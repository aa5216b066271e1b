//! The kind of ground.

use super::tuning;

tuning! {
    /// Classes of ground (`terrain.rs`), in the order asphalt, gravel, loam, sand, unknown. Means and spreads of the classes
    /// are those of drives of the virtual vehicle on random ground (`tests/suite/terrain.rs`, seeds from 11).
    TerrainTuning {
        /// Mean time on ground of one class.
        stays_s: f64 = 30.0, "s";
        /// Time for which errors of the features last.
        correlation_s: f64 = 1.0, "s";
        /// Probability from which a class is named.
        named_min: f64 = 0.5, "1";
        /// Memory of the rolling resistance.
        resistance_s: f64 = 1.0, "s";
        /// Time after which a rolling resistance that is not measured any more is forgotten.
        resistance_kept_s: f64 = 5.0, "s";
        /// Measured time from which the rolling resistance counts.
        resistance_min_s: f64 = 0.5, "s";
        /// Standard deviation of the rolling resistance beside that of the forces: spin of the wheels.
        resistance_sigma: f64 = 0.01, "1";
        /// Standard deviation of the ln of the density of the road.
        road_sigma: f64 = 0.5, "1";
        /// Longitudinal force over load of the driven axle above which nobody brakes.
        driven_min: f64 = 0.0, "1";
        /// Speed and axle load below which the rolling resistance is not measured.
        speed_min_m_s: f64 = 2.0, "m/s";
        /// See above.
        load_min_n: f64 = 100.0, "N";
        /// Least lower bound of the friction over that of the vehicle file: no ground has less.
        bound_min: f64 = 0.05, "1";
        /// Ln of the friction over that of the vehicle file.
        friction_ln: [f64; 5] = [0.0, -0.45, -0.3, -0.38, -0.5], "1";
        /// Its spread in the class.
        friction_ln_spread: [f64; 5] = [0.12, 0.15, 0.12, 0.12, 1.0], "1";
        /// Ln of the factor on the cornering stiffness.
        stiffness_ln: [f64; 5] = [0.0, 0.0, 0.0, 0.0, 0.0], "1";
        /// Its spread in the class.
        stiffness_ln_spread: [f64; 5] = [0.3, 0.3, 0.3, 0.3, 1.0], "1";
        /// Rolling resistance over load, less that of the vehicle file.
        resistance: [f64; 5] = [0.0, 0.0, 0.12, 0.2, 0.1], "1";
        /// Its spread in the class.
        resistance_spread: [f64; 5] = [0.01, 0.015, 0.02, 0.025, 0.2], "1";
        /// Ln of the density of the road, N²/s.
        road_ln: [f64; 5] = [10.0, 12.5, 12.0, 12.0, 12.0], "1";
        /// Its spread in the class.
        road_ln_spread: [f64; 5] = [1.0, 1.2, 1.2, 1.2, 4.0], "1";
    }
}
