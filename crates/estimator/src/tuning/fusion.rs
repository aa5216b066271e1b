//! Force filter.

use super::tuning;

tuning! {
    /// Force filter: states and process noise (`fusion.rs`, `fusion/process.rs`).
    FusionTuning {
        /// Gate of rows without a channel monitor: accelerometers, gyros, angular rate over ground.
        gate_sigma: f64 = 5.0, "σ";
        /// Steps after a start in which only the corners are used, without gates: the balance of all
        /// forces would mislead the filter of a vehicle that stands on jacks.
        settling_steps: u32 = 50, "1";
        /// Initial standard deviation of forces.
        force_start_sigma_n: f64 = 2000.0, "N";
        /// Initial standard deviation of force rates.
        rate_start_sigma_n_s: f64 = 1e4, "N/s";
        /// Initial standard deviation of the load's rate that the wheel's travel does not explain.
        load_rate_start_sigma_n_s: f64 = 1.0e3, "N/s";
        /// Initial standard deviations of strut length and rate.
        strut_start_sigma: [f64; 2] = [10.0, 100.0], "mm, mm/s";
        /// Time constant of tyre moments beyond tread and trail.
        moment_time_s: f64 = 0.3, "s";
        /// Initial standard deviation of half-shaft torques, mean and half the difference of left
        /// and right. Both axles have the states, whatever the vehicle file's split is: where
        /// four-wheel drive can be switched on, undriven front wheels would cost 12 % of F_x.
        torque_start_sigma_n_m: [f64; 2] = [50.0, 1.0], "N m";
        /// Time constants of mean and difference.
        torque_time_s: [f64; 2] = [50.0, 1.0], "s";
        /// Time constant of the rate of the load that the wheel's travel does not explain.
        load_rate_time_s: f64 = 1.0, "s";
        /// Part of the static load up to which a tyre counts as lifting off: its wheel's travel presses it in
        /// proportion.
        light_part: f64 = 0.03, "1";
        /// Error of the strut's model.
        strut_sigma_n: f64 = 2.0, "N";
        /// Its time constant.
        strut_time_s: f64 = 0.1, "s";
        /// The same error near a stop, whose force begins inside a step, for 1 m/s of strut rate.
        stop_sigma_n_s_m: f64 = 1000.0, "N s/m";
        /// Density of the noise of a strut's rate.
        strut_rate_density: f64 = 0.004, "m/s²/√Hz";
        /// Initial density of the noise of mean and difference.
        torque_density: [f64; 2] = [1.0e4, 2.0], "(N m)²/s";
        /// Bounds of the density of the mean.
        torque_mean_bounds: [f64; 2] = [10.0, 1.0e6], "(N m)²/s";
        /// Bounds of the density of the difference. Torques that always may differ would cost each
        /// axle a channel; 16-bit bridges that are assumed alike where they differ by 1 N m cost
        /// 0.5 % of F_y.
        torque_difference_bounds: [f64; 2] = [2.0, 1.0e4], "(N m)²/s";
        /// Initial variance of the body's angular rate, and the variance that is added when the
        /// vehicle is found to be held.
        body_rate_variance: f64 = 0.1, "(rad/s)²";
        /// Angular rate beyond which the filter is started again.
        body_rate_max_rad_s: f64 = 10.0, "rad/s";
        /// Moment that the rigid-body balance does not contain.
        moment_noise_n_m: [f64; 3] = [10.0, 10.0, 15.0], "N m/√Hz";
        /// Part of the change of the body's angular acceleration in the last step that the next step repeats. The
        /// balance of moments is a step late without it.
        turn_ahead: f64 = 0.25, "1";
        /// Time constant of the remaining accelerometer bias.
        accel_time_s: f64 = 30.0, "s";
        /// Smallest and largest standard deviation of the remaining accelerometer bias. Where mass
        /// and centre of gravity are known only to a workshop's per cent, it grows with the
        /// acceleration to several times the value of exact ones; the density is adapted.
        accel_sigma_m_s2: [f64; 2] = [0.004, 0.03], "m/s²";
        /// Time constant with which a strain channel's offset returns to the calibrated zero. An
        /// offset that only walked would take up errors of moments, torques and geometry.
        offset_time_s: f64 = 100.0, "s";
        /// Random walk of a strain channel's offset.
        offset_walk_n: f64 = 0.05, "N/√s";
        /// Density of the noise of force rates while a corner's strain is missing.
        blind_density: f64 = 6.0e3 * 6.0e3, "(N/s)²/s";
        /// Speed from which the tyres alone carry the vehicle.
        rolling_speed_m_s: f64 = 1.0, "m/s";
        group members: MemberTuning;
        group channels: ChannelTuning;
        group force_noise: ForceNoiseTuning;
        group balance: BalanceTuning;
        group moments: MomentTuning;
        group potentiometers: PotentiometerTuning;
    }
}

tuning! {
    /// Measurement equations of struts and strain channels (`fusion/corner.rs`).
    MemberTuning {
        /// Error of geometry and model on a member's force, constant part.
        member_sigma_n: f64 = 1.3, "N";
        /// The same as a part of the force.
        member_sigma_part: f64 = 0.002, "1";
        /// Error of each response of a channel of a corner that is described by a matrix, beside the matrix' own
        /// standard deviations, as a part of it: the linkage is not linear.
        matrix_sigma_part: f64 = 0.015, "1";
        /// The same for the square of the compression of the strut from that of the matrix.
        matrix_bend_part_m2: f64 = 10.0, "1/m²";
        /// Standard deviation of a member's force because the force does not change along a line between two
        /// readings, as a part of the second difference of the readings.
        bend_part: f64 = 0.05, "1";
        /// Second difference of F_x, as a part of the static load, beyond which it is a blow that the readings
        /// do not resolve.
        blow_part: f64 = 0.2, "1";
        /// Standard deviation of F_x of such a blow, as a part of what is beyond.
        blow_sigma: f64 = 0.35, "1";
        /// Fading memory per step of a blow: a tenth of a second.
        blow_keep: f64 = 0.9, "1";
        /// The same without a potentiometer, when the design position replaces the measured one,
        /// constant part.
        unposed_sigma_n: f64 = 60.0, "N";
        /// The same as a part of the force.
        unposed_sigma_part: f64 = 0.15, "1";
        /// What roughness adds to it, for the square root of the density of the road's noise.
        unposed_road: f64 = 1.0e-4, "√s/N";
        /// Error of geometry and model on the ball-normal force from a bending bridge.
        bending_sigma_n: f64 = 2.5, "N";
        /// Error of a channel's gain that is not a fault.
        gain_tolerance: f64 = 0.02, "1";
        /// Innovation beyond which a reading weighs less: so that its innovation is this many standard
        /// deviations.
        limit_sigma: f64 = 12.0, "σ";
        /// Standard deviation that an event on the road adds to each force of its wheel.
        surprise_n: [f64; 3] = [30.0, 30.0, 30.0], "N";
        /// It grows with the largest normalised innovation by the gate, up to this factor.
        surprise_max: f64 = 10.0, "1";
        /// Innovations of a potentiometer beyond that, one after another, after which it has jumped.
        jump_readings: u32 = 5, "1";
        /// Innovation of a potentiometer that can be a jump.
        jump_sigma: f64 = 8.0, "σ";
        /// Least standard deviation of a hub accelerometer: the linkage is not exact.
        hub_sigma_m_s2: f64 = 0.5, "m/s²";
        /// The same as a part of its specific force: its axes may be turned by a degree.
        hub_sigma_part: f64 = 0.006, "1";
        /// Error of the vehicle model's F_x, F_y and F_z, as a part of the load, where strain is
        /// missing.
        expected_sigma_part: [f64; 3] = [0.4, 0.1, 0.15], "1";
        /// The same, constant part.
        expected_sigma_n: f64 = 30.0, "N";
        /// Time for which one such expected force counts as one measurement.
        expected_time_s: f64 = 0.1, "s";
        /// Largest extrapolation of a linkage's map into the past, in steps.
        steps_back_max: f64 = 3.0, "1";
    }
}

tuning! {
    /// Monitor of each strain channel (`fusion/channel.rs`).
    ChannelTuning {
        /// Innovation that counts as outside.
        gate_sigma: f64 = 5.0, "σ";
        /// Fraction of recent innovations outside the gate above which a channel is faulty.
        faulty: f64 = 0.5, "1";
        /// From this fraction of recent innovations outside its gate, a channel is not used for the time
        /// being.
        alone: f64 = 0.1, "1";
        /// Channels of one corner outside the gate in one step that are an event on the road, not faults.
        event_channels: u32 = 2, "1";
        /// Fraction below which a faulty channel is used again.
        good: f64 = 0.05, "1";
        /// Weight of one innovation in that fraction: about half a second at 100 Hz until exclusion.
        learning: f64 = 1.0 / 50.0, "1";
        /// Weight of one innovation in the mean of innovations: about one second.
        mean_learning: f64 = 0.01, "1";
        /// Factor on the mean as an error of the model: innovations that keep one sign are not noise.
        mean_factor: f64 = 2.0, "1";
        /// Largest size of that error, in standard deviations of the model before they adapt. Without a limit, a
        /// good channel that corrects a wrong state weighs less and less, and the state stays wrong.
        mean_bound: f64 = 32.0, "σ";
        /// Weight of one innovation in the factor on the model's variance.
        tolerance_learning: f64 = 0.02, "1";
        /// Bounds of that factor.
        tolerance_bounds: [f64; 2] = [0.03, 2.0], "1";
        /// Normalised innovation of one channel alone that is a leap: a fault begins.
        leap_sigma: f64 = 12.0, "σ";
        /// Readings within the gate before it. A mistake of the configuration leaves few of them.
        leap_calm: u32 = 100, "1";
    }
}

tuning! {
    /// Process noise of the forces (`fusion/force_noise.rs`).
    ForceNoiseTuning {
        /// Initial density.
        start_density: f64 = 3.0e3 * 3.0e3, "(N/s)²/s";
        /// Bounds of the density.
        density_bounds: [f64; 2] = [300.0 * 300.0, 4.0e4 * 4.0e4], "(N/s)²/s";
        /// Each axis keeps at least this part of the largest axis' density: a tyre that is steered or
        /// braked pushes along all axes.
        shared: f64 = 0.02, "1";
        /// Bounds of the density of the rate of the load that the wheel's travel does not explain.
        load_density_bounds: [f64; 2] = [50.0 * 50.0, 1.8e4 * 1.8e4], "(N/s)²/s";
        /// Initial density of the white noise of the load, from the road.
        road_start: f64 = 2.0e4, "N²/s";
        /// Speed for which that density holds: the road passes in proportion.
        road_speed_m_s: f64 = 10.0, "m/s";
        /// Least speed with which it passes.
        road_speed_min_m_s: f64 = 0.5, "m/s";
        /// Way on which the rate at which the road presses a tyre stays alike: a part of the tyre's contact.
        road_length_m: f64 = 0.06, "m";
        /// Bounds of its time constant.
        road_time_s: [f64; 2] = [0.005, 0.1], "s";
        /// Part of the road's noise that is white.
        road_white: f64 = 0.1, "1";
        /// Bounds of that density.
        road_bounds: [f64; 2] = [300.0, 1.0e8], "N²/s";
        /// Weight of one innovation in the mean square that adapts the density: a fifth of a second.
        road_memory: f64 = 0.05, "1";
        /// Mean square of the potentiometer's normalised innovations at which the density stays.
        road_square: f64 = 0.93, "σ²";
        /// Weight of one correction of a load in the mean square that shows a density that is too large or far
        /// too small.
        load_memory: f64 = 0.02, "1";
        /// Mean square of the corrections of a load below which the density is too large, and above which it is
        /// far too small.
        load_square: [f64; 2] = [1.0, 1.5], "σ²";
        /// Weights of a mean square beyond these beside that of the potentiometer's innovations.
        load_gain: [f64; 2] = [3.0, 5.0], "1";
        /// The same mean squares for a wheel without a potentiometer: the error of its linkage at the design
        /// position repeats from step to step, which makes the corrections smaller than they should be.
        unposed_square: [f64; 2] = [0.5, 0.7], "σ²";
        /// Relative change of the density in one step for a surplus of one.
        road_gain: f64 = 0.04, "1";
        /// Largest surplus down and up.
        road_step: [f64; 2] = [0.2, 2.5], "σ²";
        /// Factor on the density after an event on the road.
        surprise: f64 = 3.0, "1";
        /// The density up to which that factor acts.
        surprise_max: f64 = 3.0e6, "N²/s";
        /// Limit of one innovation.
        innovation_max: f64 = 5.0, "σ";
        /// Density of the load's white noise of a wheel in the air, which can touch the ground at any time.
        air_density: f64 = 1.0e4, "N²/s";
        /// Its standard deviation over a step as a part of the load that the wheel would gain in it on flat
        /// ground: a wheel that falls quickly lands hard.
        air_part: f64 = 0.3, "1";
        /// White noise of F_x and F_y as a part of that of the load: a rock also pushes along and across.
        road_along: f64 = 0.2, "1";
        /// Part of the density times the step that is the variance of the load between two steps: 1/12 for a
        /// random walk.
        road_between: f64 = 0.004, "1";
        /// Standard deviation of a member's force from roughness, for a density of one.
        road_member: f64 = 0.001, "√s";
        /// The same of a strut's force.
        road_strut: f64 = 0.008, "√s";
        /// The same of a strut's acceleration.
        road_strut_rate: f64 = 1.0e-5, "m/s²/N";
        /// The same of the tyre's moments.
        road_moment_m: f64 = 0.008, "m √s";
        /// The same of the sum of all forces.
        road_sum: f64 = 0.04, "√s";
        /// The same of the balance of moments, for the square root of the density.
        road_balance_m: f64 = 0.03, "m";
    }
}

tuning! {
    /// Inertial unit in the balances of forces and moments (`fusion/inertial.rs`).
    BalanceTuning {
        /// Error of the model on the sum of all forces.
        sum_sigma_n: f64 = 10.0, "N";
        /// Standard deviations that an innovation of an accelerometer beyond the gate adds to the force of each tyre
        /// along its axis, and to its load, as parts of the innovation.
        push_parts: [f64; 2] = [0.1, 0.02], "1";
        /// Innovation from which it is no force but a jump of the sensor.
        push_max_m_s2: f64 = 1.5, "m/s²";
        /// Standard deviation of roll and pitch rate from struts: the ground also turns.
        over_ground_sigma_rad_s: f64 = 0.2, "rad/s";
        /// Part of the weight that the tyres must carry before a vehicle that was held counts as
        /// free.
        held_part: f64 = 0.05, "1";
        /// Consecutive readings of a good gyro beyond the gate after which the balance of moments is
        /// considered wrong.
        gyro_rejections_max: u32 = 20, "1";
    }
}

tuning! {
    /// Tyre moments about the contact point (`fusion/moments.rs`).
    MomentTuning {
        /// Standard deviation of M_x and M_z beyond tread and trail: upright wheels without side
        /// force.
        sigma_n_m: f64 = 1.0, "N m";
        /// Bounds of the further density of the noise of M_x, which adapts.
        tipping_bounds: [f64; 2] = [1.0, 6.0e3], "(N m)²/s";
        /// Standard deviation of M_x where the tread width is unknown.
        untreaded_sigma_n_m: f64 = 28.0, "N m";
        /// Error of the tread's moment from its width and stiffness, as a part of it.
        tread_error: f64 = 0.04, "1";
        /// The same, times the part of the width that is off the ground: the rim's edge carries what
        /// a row of equal springs would not.
        tread_lifted_error: f64 = 0.5, "1";
        /// Error of the trail's moment, as a part of it.
        trail_error: f64 = 0.2, "1";
        /// Relative error of the friction that shortens the trail as the tyre begins to slide.
        friction_error: f64 = 0.4, "1";
        /// Trail of a standing tyre, which has a side force from before or from steering: standard deviation,
        /// as a part of the trail of a rolling one.
        standing_trail: f64 = 0.6, "1";
    }
}

tuning! {
    /// Monitor of the potentiometers' levels (`fusion/lengths.rs`).
    PotentiometerTuning {
        /// Error of a strut's length beside the potentiometer's zero.
        sigma_mm: f64 = 0.02, "mm";
        /// Time constant with which the error returns to zero. A stop is five times as stiff as the
        /// spring, so a length that was learnt on the spring would be a large error on the stop.
        time_s: f64 = 0.5, "s";
        /// Random walk of the error while the potentiometer is suspect.
        suspect_walk_mm: f64 = 1.0, "mm/√s";
        /// Innovation that no strut makes in one step: its potentiometer has jumped, and the reading is not used.
        leap_mm: f64 = 30.0, "mm";
        /// Standard deviation of a length whose potentiometer has jumped.
        jump_sigma_mm: f64 = 15.0, "mm";
        /// Error from which a potentiometer is faulty.
        faulty_mm: f64 = 3.0, "mm";
        /// Error below which it is good.
        good_mm: f64 = 1.5, "mm";
        /// Standard deviations by which the error must exceed the faulty limit.
        faulty_sigma: f64 = 3.0, "σ";
        /// Steps for which the error must exceed that limit.
        faulty_steps: u32 = 50, "1";
        /// Steps for which it must be good.
        good_steps: u32 = 100, "1";
        /// Weight of one innovation in the means below.
        learning: f64 = 0.01, "1";
        /// Mean innovation that makes a potentiometer suspect; white innovations have a mean of 0.07.
        suspect_mean_sigma: f64 = 0.5, "σ";
        /// Mean innovation as a length that makes it suspect. Both limits must be exceeded.
        suspect_mean_mm: f64 = 0.7, "mm";
        /// Limit of one innovation in the mean.
        innovation_max_sigma: f64 = 5.0, "σ";
        /// Limit of one innovation as a length in the mean.
        innovation_max_mm: f64 = 20.0, "mm";
    }
}
