//! Single-track filter.

use super::tuning;

tuning! {
    /// Single-track filter of a vehicle without linkages (`planar.rs`).
    PlanarTuning {
        /// Speed below which the vehicle counts as standing.
        standstill_m_s: f64 = 0.2, "m/s";
        /// Correlation time of the lateral acceleration of a banked road.
        bank_time_s: f64 = 3.0, "s";
        /// Initial variances of lateral velocity, yaw rate, and built-up slip angles front and rear.
        motion_variance: [f64; 4] = [0.1, 0.003, 1e-3, 1e-3], "(m/s)², (rad/s)², rad², rad²";
        /// Random walk of the offsets of steer angle, yaw rate and lateral acceleration.
        offset_walk: [f64; 3] = [1e-6, 1e-6, 1e-3], "rad/√s, rad/s/√s, m/s²/√s";
        /// Initial standard deviations of the offsets without a calibration.
        offset_sigma: [f64; 3] = [0.01, 0.01, 0.2], "rad, rad/s, m/s²";
        /// Initial standard deviations of the offsets after a calibration.
        offset_sigma_calibrated: [f64; 3] = [0.001, 0.0005, 0.05], "rad, rad/s, m/s²";
        /// An offset further out is not kept when the filter starts again.
        offset_kept_sigma: f64 = 4.0, "σ";
        /// Smallest standard deviations of yaw rate and lateral acceleration; the latter contains
        /// vibration and model errors.
        measured_sigma_min: [f64; 2] = [0.002, 0.1], "rad/s, m/s²";
        /// Innovation from which a measurement gets a larger variance (Huber).
        huber_sigma: f64 = 3.0, "σ";
        /// Mean square of the normalised innovations of lateral acceleration from which the vehicle file
        /// contradicts the drive, and below which it does not any more.
        contradiction: [f64; 2] = [9.0, 4.0], "1";
        /// Largest square that counts: single wild readings and a spin are no other vehicle.
        contradiction_square_max: f64 = 25.0, "1";
        /// Time over which it is averaged.
        contradiction_time_s: f64 = 10.0, "s";
        /// A longer step is a gap after which the motion is unknown.
        gap_s: f64 = 0.5, "s";
        /// Standard deviation of lateral velocity at walking pace.
        slow_sigma_m_s: f64 = 0.1, "m/s";
        /// Model errors with an identified tyre curve: densities of lateral velocity and yaw rate,
        /// standard deviation of the bank's acceleration (0.9°), relative error of lateral
        /// acceleration.
        identified_error: [f64; 4] = [0.015, 0.02, 0.15, 0.02], "m/s/√s, rad/s/√s, m/s², 1";
        /// The same with the vehicle file's tyre curve.
        file_error: [f64; 4] = [0.08, 0.08, 0.4, 0.06], "m/s/√s, rad/s/√s, m/s², 1";
        /// Sideslip error that a single-track model leaves, constant part. Measured on cars with four
        /// tyres, roll and load-dependent friction.
        sideslip_sigma_rad: f64 = 0.002, "rad";
        /// The same as a part of the rear axle's slip angle.
        sideslip_sigma_part: f64 = 0.1, "1";
        /// Largest square of the part of an axle's friction that drive or brake forces use.
        longitudinal_square_max: f64 = 0.8, "1";
        /// Smallest axle load under load transfer, as a part of the static load.
        load_min_part: f64 = 0.1, "1";
        /// Standard deviation of the forward specific force where only the speed's rate of change gives it.
        speed_slope_sigma_m_s2: f64 = 0.4, "m/s²";
        group input: PlanarInputTuning;
    }
}

tuning! {
    /// Inputs of the single-track filter (`planar/input.rs`).
    PlanarInputTuning {
        /// A reading older than this is not held.
        held_max_s: f64 = 0.25, "s";
        /// Longest time for which the filter waits for late values. Each step repeats the steps of this
        /// time, 100 at most.
        late_max_s: f64 = 1.0, "s";
        /// Speeds above this are ignored.
        speed_max_m_s: f64 = 150.0, "m/s";
        /// Steering-wheel angles above this are ignored.
        steering_wheel_max_rad: f64 = 50.0, "rad";
        /// Lateral specific forces above this are ignored.
        force_max_m_s2: f64 = 100.0, "m/s²";
        /// Yaw rates above this are ignored.
        rate_max_rad_s: f64 = 20.0, "rad/s";
        /// Time constant of the difference quotient of the speed.
        acceleration_time_s: f64 = 0.15, "s";
        /// Time constant of the difference quotient of the road-wheel angle, with which a late angle
        /// continues.
        steer_trend_s: f64 = 0.05, "s";
        /// Largest longitudinal acceleration that is used.
        acceleration_max_m_s2: f64 = 15.0, "m/s²";
        /// Change of speed that is accepted at once, and for each second since the last value: an
        /// emergency stop has 12 m/s², and a locked wheel shows no speed.
        speed_reach: [f64; 2] = [2.0, 30.0], "m/s, m/s²";
        /// The same of the road-wheel angle: a racing driver reaches 2 rad/s.
        steer_reach: [f64; 2] = [0.05, 3.0], "rad, rad/s";
        /// Values that stay out of reach for this time are accepted.
        out_of_reach_max_s: f64 = 0.2, "s";
    }
}
