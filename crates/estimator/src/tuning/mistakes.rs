//! Mistakes of the configuration.

use super::tuning;

tuning! {
    /// Mistakes of the configuration as hypotheses (`mistakes.rs`).
    MistakeTuning {
        /// Window over which the relations between readings are averaged.
        window_s: f64 = 0.5, "s";
        /// Age beyond which a reading is not used: the inertial unit would show another instant.
        age_max_s: f64 = 0.03, "s";
        /// Windows between two decisions.
        decide_windows: u32 = 10, "1";
        /// Speed below which a window is not used: stands or a jack can carry the vehicle.
        speed_min_m_s: f64 = 1.5, "m/s";
        /// Part of the static load below which a window is not used: the wheel can be in the air.
        load_min_part: f64 = 0.1, "1";
        /// Logarithm of the ratio of likelihoods from which a mistake is reported.
        report_ratio: f64 = 14.0, "1";
        /// The same by which it must exceed that of every other mistake.
        lead_ratio: f64 = 5.0, "1";
        /// Mean square of the residuals that one mistake may leave.
        left_square: f64 = 2.0, "1";
        /// The same as a part of what the configuration leaves. Beyond both, more than one thing is wrong.
        left_part: f64 = 0.3, "1";
        /// Windows after which this is said.
        several_windows: u32 = 20, "1";
        /// Logarithm of the ratio of likelihoods from which channels are not blamed alone.
        suspect_ratio: f64 = 6.0, "1";
        /// Longest time for which channels are not blamed alone: at the beginning, and while a mistake is likely.
        hold_s: f64 = 40.0, "s";
        /// Windows in agreement with the configuration that end this at the beginning.
        agreeing_windows: u32 = 4, "1";
        /// Mean square of the residuals of a window in agreement.
        agreeing_square: f64 = 0.5, "1";
        /// Least times after which a drive without a mistake shows that the configuration is right: of all driving,
        /// and of bends. Of 240 drives of a slalom with a mistake, 231 named it after 37 s at most.
        decisive_s: [f64; 2] = [40.0, 10.0], "s, s";
        /// Lateral force of all tyres from which the vehicle is in a bend, as a part of the weight.
        turning_part: f64 = 0.1, "1";
        /// Error of a member's force that changes from window to window, as a part of the mean static load of the
        /// wheels.
        member_sigma: f64 = 0.004, "1";
        /// Error of the balance of a strut, as a part of the same load.
        strut_sigma: f64 = 0.005, "1";
        /// Error of the balance of forces, as acceleration.
        accel_sigma_m_s2: f64 = 0.04, "m/s²";
        /// Error of the balance of moments, as angular acceleration.
        turn_sigma_rad_s2: f64 = 0.1, "rad/s²";
        /// What roughness adds to the error of members and struts, for the square root of the density of the
        /// road's noise.
        road_member: f64 = 2.0e-4, "√s";
        /// The same for the balance of forces.
        road_body: f64 = 1.0e-3, "√s";
        /// The same for the balance of moments.
        road_turn: f64 = 1.0e-5, "√s/(N s²)";
        /// Error of the balance of moments by a ground's normal that is not known at each wheel.
        tilt_turn: f64 = 1.0, "1";
        /// Standard deviations of F_x, F_y and F_z of a tyre before the readings, as parts of the same load.
        force_sigma: [f64; 3] = [0.5, 0.5, 2.0], "1";
        /// The same of a tyre's moments beyond tread and trail, as a part of the load times the radius.
        moment_sigma: f64 = 0.03, "1";
        /// Error of a strut's force, as a part of the same load.
        strut_error: f64 = 0.01, "1";
        /// Error of a damper, as a part of its force.
        damping_error: f64 = 0.15, "1";
        /// Standard deviations of the torques of the wheels: mean of an axle, and half the difference,
        /// as parts of the load times the radius.
        torque_sigma: [f64; 2] = [0.8, 0.08], "1";
        /// Part of the windows that counts as independent.
        independent: f64 = 0.5, "1";
        /// Mean square of the residuals beyond which a window weighs less.
        square_max: f64 = 2.0, "1";
        /// Tolerance of a channel's gain.
        gain_tolerance: f64 = 0.01, "1";
        /// Tolerance of the geometry: part of a tyre's force that a member carries beyond the model.
        shape_tolerance: f64 = 0.01, "1";
        /// Tolerance of the force of a strut, as a part of the same load.
        preload_tolerance: f64 = 0.01, "1";
        /// Tolerance of the rate of a spring.
        rate_tolerance: f64 = 0.01, "1";
        /// Tolerance of the mass, as a part of it.
        mass_tolerance: f64 = 0.01, "1";
        /// Tolerance of the position of the centre of gravity along x and y.
        cg_tolerance_m: f64 = 0.01, "m";
        /// Tolerance of its height: where wheels stand on slopes of their own, their loads turn the body as a wrong
        /// height would.
        height_tolerance_m: f64 = 0.1, "m";
        /// Tolerance of the direction of the inertial unit.
        tilt_tolerance_rad: f64 = 0.005, "rad";
        /// Tolerance of the position of the inertial unit.
        lever_tolerance_m: f64 = 0.02, "m";
        /// Least standard deviation of the accelerometers' bias that the motion filter has learnt: the receiver of
        /// attitude is not aligned better.
        learnt_bias_sigma_m_s2: f64 = 0.03, "m/s²";
        /// Tolerance of the scale of the accelerometers.
        scale_tolerance: f64 = 0.003, "1";
        /// Errors of the rows where all parameters are exact, as a part of those above.
        exact_part: f64 = 0.3, "1";
        /// The same by the resolution of the strain channels, for one count as a part of the same load.
        exact_counts: f64 = 25.0, "1";
        /// Factor on all tolerances that stands for exact parameters.
        care_exact: f64 = 1e-3, "1";
        /// Largest and smallest factor otherwise; each between is half of the one before.
        care_limits: [f64; 2] = [1.5, 0.02], "1, 1";
        /// Logarithm of the ratio of likelihoods from which parameters are no longer taken for exact.
        care_ratio: f64 = 1.0, "1";
        /// Factor from which an event says that parameters are not exact.
        care_reported: f64 = 0.5, "1";
        /// Time from the start in which this event is given.
        care_reported_within_s: f64 = 60.0, "s";
        /// Bound of the factor on tolerances that a file states, which is 1 at least.
        care_stated_max: f64 = 3.0, "1";
        /// Standard deviation of the logarithm of that factor before the drive.
        care_spread: f64 = 0.5, "1";
        /// Standard deviation of the offsets of channels that were not zeroed.
        offset_counts: f64 = 12.0, "counts";
        /// Standard deviation of the offset of one channel whose zero is wrong.
        one_offset_counts: f64 = 200.0, "counts";
        /// Standard deviation of the error of a gain that is wrong.
        gain_sigma: f64 = 1.5, "1";
        /// Error of a gain, as a part of it, up to which it is corrected; else the channel is not used.
        gain_known: f64 = 0.04, "1";
        /// Standard deviation of the parts of the wheel's forces in a reading that is not the force of its member.
        bent_sigma: f64 = 8.0, "1";
        /// How far from 1 the estimate of an exchange may be.
        exchange_sigma: f64 = 0.1, "1";
        /// Difference from 1 beyond which it is no exchange of two channels.
        exchange_error: f64 = 0.1, "1";
        /// Part of the ratio of an exchange that one at another wheel may have.
        exchange_rival: f64 = 0.5, "1";
        /// Standard deviation of an unknown payload.
        payload_sigma_kg: f64 = 100.0, "kg";
        /// Standard deviation of its position.
        payload_arm_m: f64 = 0.5, "m";
        /// Standard deviation of the direction of an inertial unit that leans.
        tilt_sigma_rad: f64 = 0.1, "rad";
        /// Standard deviation of the position of an inertial unit that is elsewhere.
        lever_sigma_m: f64 = 0.5, "m";
        /// How far a wrong unit may be from the factor between the units.
        unit_sigma: f64 = 0.05, "1";
        /// Standard deviations of a force on the hitch along x, y and z, as parts of the same load.
        hitch_sigma: [f64; 3] = [1.0, 0.3, 0.5], "1";
        /// Standard deviation of a mass that is towed.
        towed_sigma_kg: f64 = 300.0, "kg";
        /// Standard deviation of the error of a strut's force, as a part of the same load.
        preload_sigma: f64 = 0.3, "1";
        /// Standard deviation of the error of a spring's rate.
        rate_sigma: f64 = 0.3, "1";
    }
}
