//! Motion filter: attitude, velocity and sensor biases.

use super::tuning;

tuning! {
    /// Motion filter: inertial navigation with GNSS aiding (`motion.rs`, `motion/update.rs`).
    MotionTuning {
        /// Gate of GNSS velocity, GNSS attitude, wheel speeds and tyre-slip constraints.
        gate_sigma: f64 = 5.0, "σ";
        /// Silence of the inertial unit after which the state is propagated without it.
        silence_s: f64 = 0.04, "s";
        /// Interval between two readings of the inertial unit that is a gap, for its interval. Over a gap, the
        /// motion is as unknown as while the unit is silent.
        gap_intervals: f64 = 2.5, "1";
        /// Density of unknown acceleration while the inertial unit is silent.
        coast_accel_density: f64 = 2.0, "m/s²/√Hz";
        /// Density of unknown angular rate while the inertial unit is silent.
        coast_rate_density: f64 = 0.3, "rad/s/√Hz";
        /// Factor on the angular rate at each step without the inertial unit.
        coast_rate_keep: f64 = 0.8, "1";
        /// Random walk of the accelerometer bias.
        accel_bias_walk: f64 = 1e-3, "m/s²/√s";
        /// Random walk of the gyro bias.
        gyro_bias_walk: f64 = 3e-5, "rad/s/√s";
        /// Readings with a larger specific force are ignored: no road vehicle reaches it.
        force_max_m_s2: f64 = 200.0, "m/s²";
        /// Readings with a larger angular rate are ignored: no road vehicle reaches it.
        rate_max_rad_s: f64 = 20.0, "rad/s";
        /// GNSS velocities with a larger component are ignored.
        velocity_max_m_s: f64 = 200.0, "m/s";
        /// Initial standard deviation of roll and pitch.
        tilt_start_sigma_rad: f64 = 0.2, "rad";
        /// Initial standard deviation of velocity.
        velocity_start_sigma_m_s: f64 = 20.0, "m/s";
        /// Smallest initial standard deviation of the accelerometer bias.
        accel_bias_start_min_m_s2: f64 = 1e-3, "m/s²";
        /// Smallest initial standard deviation of the gyro bias.
        gyro_bias_start_min_rad_s: f64 = 1e-5, "rad/s";
        /// Initial standard deviation of the heading. Without any heading source the heading is
        /// defined as 0, so its uncertainty is small.
        heading_start_sigma_rad: f64 = 1e-3, "rad";
        /// Standard deviation of the heading when only a velocity is known.
        heading_unknown_sigma_rad: f64 = 3.0, "rad";
        /// Relative tolerance of |f| against g for levelling at rest. A remaining acceleration then
        /// tilts the attitude by less than the initial standard deviation.
        rest_tolerance: f64 = 0.02, "1";
        /// Time constant of the derivatives of angular rate and specific force.
        slope_time_s: f64 = 0.02, "s";
        /// Longest interval between two inertial readings over which their mean is integrated.
        mean_interval_max_s: f64 = 0.1, "s";
        /// Interval after which the derivatives of angular rate and specific force start again.
        slope_interval_max_s: f64 = 1.0, "s";
        /// Part of the effect of a bias jump on attitude and velocity that is added as uncertainty:
        /// the instant of the jump is known only approximately.
        jump_time_part: f64 = 0.3, "1";
        /// Standard deviation of a velocity that is adopted from GNSS.
        adopted_velocity_sigma_m_s: f64 = 1.0, "m/s";
        /// Smallest standard deviation that a receiver can state, as a part of the sensors file's.
        stated_sigma_min: f64 = 0.3, "1";
        /// Speed from which the course gives the heading while no heading source exists.
        course_speed_min_m_s: f64 = 2.0, "m/s";
        /// Standard deviation of a heading from the course.
        course_sigma_rad: f64 = 0.08, "rad";
        /// Consecutive headings that must agree with each other before one is adopted.
        steady_headings: u32 = 3, "1";
        group receivers: ReceiverTuning;
        group jumps: JumpTuning;
        group aiding: AidingTuning;
    }
}

tuning! {
    /// Acceptance counters of GNSS receivers (`motion/acceptance.rs`).
    ReceiverTuning {
        /// If this many consecutive values of GNSS velocity and of GNSS attitude were rejected, the
        /// filter state is considered wrong, not the receivers.
        contradictions: u32 = 5, "1";
        /// Consecutive rejected values after which the state is considered wrong and the receiver's
        /// value is adopted.
        rejections_max: u32 = 20, "1";
        /// The same while the balances of forces and moments confirm the inertial unit: half a
        /// minute of velocities, one minute of attitudes.
        rejections_max_consistent: u32 = 600, "1";
        /// Consecutive accepted values that confirm a state.
        confirmed: u32 = 20, "1";
        /// Consecutive accepted values that confirm a state that was adopted from GNSS: an inertial
        /// unit whose bias has jumped is contradicted again soon.
        confirmed_again: u32 = 100, "1";
        /// Consecutive identical values of one component of velocity that are taken as stuck.
        stuck_values: u32 = 10, "1";
        /// Least speed at which identical values are judged.
        stuck_speed_m_s: f64 = 1.0, "m/s";
        /// Change of the velocity by the state during these values beyond which they are stuck.
        stuck_change_m_s: f64 = 0.15, "m/s";
        /// Time for which a receiver counts as active after its last velocity.
        active_s: f64 = 1.0, "s";
    }
}

tuning! {
    /// Detection of jumps of attitude and biases by a generalised likelihood ratio
    /// (`motion/jumps.rs`).
    JumpTuning {
        /// Largest jump of attitude, accelerometer bias and gyro bias. A larger bias jump is found
        /// by the balances of forces and moments.
        largest: [f64; 3] = [0.3, 2.5, 0.4], "rad, m/s², rad/s";
        /// Spacing of the instants at which a jump is assumed.
        spacing_s: f64 = 0.2, "s";
        /// Smallest age of a jump that can be declared: a single value shows no slope.
        age_min_s: f64 = 0.25, "s";
        /// Twice the logarithm of the likelihood ratio that a jump needs, in multiples of the mean
        /// square of the unexplained innovations.
        ratio: f64 = 30.0, "1";
        /// Mean square of the unexplained innovations up to which they can be noise.
        noise_max: f64 = 2.0, "1";
        /// Part of the sum of squared innovations that the jump must explain where more is left.
        explained: f64 = 0.8, "1";
        /// Standard deviations of a receiver's constant error beyond which the error, and not a
        /// jump, is taken as the explanation. A smaller error is followed.
        receiver_error_sigma: f64 = 4.0, "σ";
        /// Part of the likeliest jump's ratio above which another jump is also taken into account.
        alternative: f64 = 0.25, "1";
    }
}

tuning! {
    /// Wheel speeds and tyre slip as velocity measurements while GNSS is silent
    /// (`estimator/aiding.rs`).
    AidingTuning {
        /// Standard deviation of the forward speed from wheel speeds, constant part.
        wheel_speed_sigma_m_s: f64 = 0.1, "m/s";
        /// Standard deviation of the forward speed from wheel speeds, as a part of the speed.
        wheel_speed_sigma_part: f64 = 0.03, "1";
        /// Standard deviation of the velocity along the ground's normal.
        vertical_sigma_m_s: f64 = 0.3, "m/s";
        /// Standard deviation of the slip angle of an axle whose force is unknown.
        slip_unknown_sigma_rad: f64 = 0.06, "rad";
        /// Standard deviation of an axle's lateral velocity, constant part.
        lateral_sigma_m_s: f64 = 0.05, "m/s";
        /// Factor on the standard deviation of an axle's lateral velocity: the error of a slip angle
        /// is correlated over many steps, the filter assumes independent ones.
        slip_correlation: f64 = 4.0, "1";
        /// Standard deviation of the reported sideslip angle because of an unknown friction, as a part of the
        /// difference between the slip angles with the least friction and with the learnt one.
        blind_slip_part: f64 = 0.65, "1";
        /// Time constant with which slip angles from forces replace the sideslip of the last receiver.
        blind_time_s: f64 = 2.0, "s";
    }
}
