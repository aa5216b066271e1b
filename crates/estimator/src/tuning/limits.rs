//! Limits of the vehicle.

use super::tuning;

tuning! {
    /// Limits of lateral acceleration, speed and slope (`limits.rs`).
    LimitsTuning {
        /// Memory of the means whose ratios are taken.
        mean_s: f64 = 0.3, "s";
        /// Memory of the present lateral force. With 0.3 s, the bound does not hold in a slalom of 0.2 Hz.
        present_s: f64 = 0.05, "s";
        /// Lateral specific force over the normal one, for the lateral force of the front and of the rear axle over
        /// its load, where both are small.
        axle_ratio: [f64; 2] = [0.98, 1.1], "1";
        /// Their standard deviations at the start.
        axle_ratio_sigma: [f64; 2] = [0.1, 0.15], "1";
        /// Their random walk.
        axle_walk: f64 = 0.01, "1/√s";
        /// Standard deviation of such a value beside its ratio, and that of the load-transfer ratio. The errors last about
        /// half a second, so that it is about seven times that of one step.
        ratio_sigma: f64 = 0.15, "1";
        /// Decrease of the ratio of the front axle with the lateral force over the load, over the slip angle for a
        /// lateral force as large as the load. Ramp steers of the virtual vehicle on three grounds have it.
        bend: f64 = 1.35, "1/rad";
        /// Its standard deviation as a part of it.
        bend_part: f64 = 0.4, "1";
        /// Factor on the standard deviation of the friction: on slippery ground, the estimate approaches the friction from
        /// above.
        friction_sigma: f64 = 1.3, "1";
        /// Standard deviation of the friction at the limit as a part of it: load transfer and combined slip.
        friction_part: f64 = 0.04, "1";
        /// Standard deviation of the load transfer of the vehicle file as a part of it: measured height of the centre of
        /// gravity, and guessed height.
        height_part: [f64; 2] = [0.08, 0.2], "1";
        /// Random walk of the load transfer.
        roll_walk: f64 = 0.005, "1/√s";
        /// Standard deviations below the limit of the bound that holds with a probability of 0.95.
        bound_sigma: f64 = 1.645, "σ";
        /// Axle load below which its tyres are not used.
        load_min_n: f64 = 100.0, "N";
        /// Speed below which a turn is not judged.
        speed_min_m_s: f64 = 2.0, "m/s";
        /// Curvature below which the way counts as straight: a radius of 500 m.
        curvature_min_1_m: f64 = 0.002, "1/m";
    }
}
