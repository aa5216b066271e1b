//! Monitors of the motion sensors.

use super::tuning;

tuning! {
    /// Monitors of the motion sensors (`watch.rs`).
    WatchTuning {
        group imu_consistency: ImuConsistencyTuning;
        group inertial: InertialWatchTuning;
        group bias: BiasWatchTuning;
        group receiver: ReceiverWatchTuning;
        group steering: SteeringWatchTuning;
        group wheels: WheelWatchTuning;
        group hub: HubWatchTuning;
        group repeats: RepeatsTuning;
    }
}

tuning! {
    /// Repeats of a reading of a sensor whose own noise changes each reading (`watch/stuck.rs`).
    RepeatsTuning {
        /// Part of the differences of successive readings that are noise, above which the sensor is noisy. White
        /// noise of several counts has two thirds.
        noisy_part: f64 = 0.3, "1";
        /// A difference that is noise has another sign than the one before, and both exceed this many counts.
        resolutions: f64 = 2.0, "1";
        /// Fading memory of that part per reading.
        keep: f64 = 0.98, "1";
        /// Identical readings (100 a second) from which a noisy steering wheel is frozen.
        steering_readings: u32 = 100, "1";
        /// Identical values (10 a second) from which a noisy angle of the GNSS attitude is frozen.
        attitude_values: u32 = 15, "1";
    }
}

tuning! {
    /// Agreement of the inertial unit with the balances of forces and moments
    /// (`estimator/monitors.rs`).
    ImuConsistencyTuning {
        /// Part of the recent time in which the inertial unit may contradict the balances and still
        /// counts as consistent.
        inconsistent_max: f64 = 0.1, "1";
        /// Time constant of that mean.
        time_s: f64 = 1.0, "s";
        /// Gate of the rear axle's slip angle from motion against the one from its lateral force,
        /// beyond which the motion is considered wrong.
        rear_slip_gate_sigma: f64 = 3.0, "σ";
    }
}

tuning! {
    /// Gyros and accelerometers against the balances of moments and forces (`watch/inertial.rs`).
    InertialWatchTuning {
        /// Gate of a reading against the balance.
        gate_sigma: f64 = 5.0, "σ";
        /// Consecutive rejected readings (100 a second) that are reported as a fault.
        faulty_readings: u32 = 20, "1";
        /// Readings after a fault during which a reading needs no jump to be rejected.
        suspect_readings: u32 = 500, "1";
        /// Consecutive identical readings that are taken as stuck.
        stuck_readings: u32 = 10, "1";
        /// Change between two gyro readings (10 ms) that no vehicle makes.
        gyro_jump_rad_s: f64 = 0.25, "rad/s";
        /// Consecutive rejected gyro readings after which the forces may be wrong instead.
        gyro_rejections_max: u32 = 500, "1";
        /// Density of the error of the angular rate that replaces a rejected one: the error of the
        /// balance of moments.
        gyro_replaced_density: f64 = 0.1, "rad/s/√Hz";
        /// Change between two accelerometer readings (10 ms) that no vehicle makes.
        accel_jump_m_s2: f64 = 1.5, "m/s²";
        /// Error of the balance of forces beyond its own variance, forward, leftward and upward: a
        /// blow can pass through the frame, and the weight of the load is not known exactly.
        accel_balance_sigma_m_s2: [f64; 3] = [0.3, 0.3, 0.6], "m/s²";
        /// Consecutive consistent readings of a faulty accelerometer before it is used again: one
        /// that is connected to the wrong axis agrees by chance for a moment.
        accel_good_readings: u32 = 50, "1";
        /// Density of the error of the specific force that replaces a rejected one. With this value
        /// GNSS determines the speed.
        accel_replaced_density: f64 = 2.0, "m/s²/√Hz";
    }
}

tuning! {
    /// Report of biases that have jumped (`watch/bias.rs`).
    BiasWatchTuning {
        /// Time after the start in which no sign of a jump counts.
        settling_s: f64 = 2.0, "s";
        /// Time after the first sign of a jump before an axis is reported: at first a jump of the
        /// roll rate and one of the leftward acceleration look alike.
        learning_s: f64 = 0.5, "s";
        /// Time after the last sign of a jump when the bias counts as known again.
        known_s: f64 = 2.0, "s";
        /// Change that is reported, in standard deviations of the bias at switch-on.
        reported_sigma: f64 = 5.0, "σ";
    }
}

tuning! {
    /// Report of GNSS receivers whose values are rejected (`watch/receiver.rs`).
    ReceiverWatchTuning {
        /// Time for which all values must be rejected before a fault is reported.
        faulty_s: f64 = 0.5, "s";
    }
}

tuning! {
    /// Steering-wheel angle against the angle that the lateral forces imply (`watch/steering.rs`).
    SteeringWatchTuning {
        /// Gate of the angle.
        gate_sigma: f64 = 5.0, "σ";
        /// Gate of the angle of a sensor that has jumped, is stuck, or was inconsistent just before.
        suspect_gate_sigma: f64 = 2.0, "σ";
        /// Angular speed that no driver reaches.
        jump_rad_s: f64 = 50.0, "rad/s";
        /// Time of inconsistency after which a fault is reported.
        faulty_s: f64 = 0.3, "s";
        /// Time of agreement after which the sensor is used again.
        good_s: f64 = 0.5, "s";
        /// Time of identical readings after which the sensor counts as possibly stuck. A coarse
        /// sensor can repeat its value in normal driving.
        stuck_s: f64 = 0.3, "s";
        /// Standard deviation of an angle that is held in place of the sensor's.
        held_sigma_rad: f64 = 0.1, "rad";
        /// Longest time for which a held angle is preferred to a sensor that moves, while nothing
        /// else is known.
        held_max_s: f64 = 2.0, "s";
        /// Speed above which the slip of the front wheels gives an expected steering-wheel angle.
        expected_speed_min_m_s: f64 = 3.0, "m/s";
        /// Standard deviation of the road-wheel angle that slip gives, beside that of the slip
        /// angles.
        expected_sigma_rad: f64 = 0.02, "rad";
    }
}

tuning! {
    /// Wheel speeds against the speed over ground (`watch/wheels.rs`).
    WheelWatchTuning {
        /// Difference from the speed over ground that slip does not explain, as a part of the speed.
        difference_part: f64 = 0.3, "1";
        /// Difference from the speed over ground that slip does not explain, constant part.
        difference_m_s: f64 = 0.5, "m/s";
        /// Consecutive identical readings (100 a second) that are taken as stuck.
        stuck_readings: u32 = 50, "1";
        /// Least speed at which identical readings are judged.
        stuck_speed_m_s: f64 = 1.0, "m/s";
        /// Change of the speed over ground during identical readings beyond which they are stuck.
        stuck_change_m_s: f64 = 0.3, "m/s";
        /// Longitudinal force over load up to which a wheel counts as rolling freely.
        rolling_force: f64 = 0.2, "1";
        /// Time of contradiction after which a fault is reported.
        faulty_s: f64 = 0.5, "s";
        /// Time of agreement after which the sensor is used again.
        good_s: f64 = 0.5, "s";
    }
}

tuning! {
    /// Axes of the hub accelerometers against gravity (`watch/hub.rs`).
    HubWatchTuning {
        /// Time over which the specific force is averaged: a jump of 0.5 s changes the mean by a
        /// sixth.
        block_s: f64 = 3.0, "s";
        /// Fewest readings of an axis in that time.
        readings_min: f64 = 20.0, "1";
    }
}
