//! The kind of ground.

use super::tuning;

tuning! {
    /// Classes of ground (`terrain.rs`), in the order asphalt, gravel, loam, sand, unknown. Means and spreads of the classes
    /// are those of drives of the virtual vehicle on random ground (`tests/suite/terrain.rs`, seeds from 11).
    TerrainTuning {
        /// Mean time on ground of one class.
        stays_s: f64 = 20.0, "s";
        /// Time for which errors of the features last.
        correlation_s: f64 = 0.5, "s";
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
        /// Memory of the rate of that ln.
        road_rate_s: f64 = 0.5, "s";
        /// Rate at which the density of the road falls and is an upper bound: the force filter lowers it by 0.7 1/s at most.
        /// Without it, the balanced accuracy after a change of the surface is 0.74 instead of 0.98 (seeds from 11).
        road_falls_1_s: f64 = 0.4, "1/s";
        /// Longitudinal force over load of the driven axle above which nobody brakes.
        driven_min: f64 = 0.0, "1";
        /// Speed and axle load below which the rolling resistance is not measured.
        speed_min_m_s: f64 = 2.0, "m/s";
        /// See above.
        load_min_n: f64 = 100.0, "N";
        /// Least lower bound of the friction over that of the vehicle file: no ground has less.
        bound_min: f64 = 0.05, "1";
        /// Ln of the friction over that of the vehicle file.
        friction_ln: [f64; 5] = [0.0, -0.45, -0.27, -0.39, -1.0], "1";
        /// Its spread in the class.
        friction_ln_spread: [f64; 5] = [0.1, 0.13, 0.12, 0.13, 0.5], "1";
        /// Ln of the factor on the cornering stiffness. The virtual ground has the stiffness of the tyre alone; friction that is
        /// not known yet lowers the estimate.
        stiffness_ln: [f64; 5] = [-0.03, -0.1, -0.08, -0.16, -0.2], "1";
        /// Its spread in the class.
        stiffness_ln_spread: [f64; 5] = [0.1, 0.1, 0.1, 0.1, 0.15], "1";
        /// Rolling resistance over load, less that of the vehicle file.
        resistance: [f64; 5] = [0.0, 0.005, 0.1, 0.158, 0.04], "1";
        /// Its spread in the class.
        resistance_spread: [f64; 5] = [0.01, 0.012, 0.015, 0.02, 0.06], "1";
        /// Ln of the density of the road, N²/s.
        road_ln: [f64; 5] = [12.8, 16.0, 12.9, 11.6, 12.5], "1";
        /// Its spread in the class.
        road_ln_spread: [f64; 5] = [1.3, 1.5, 1.8, 1.8, 2.5], "1";
    }
}
