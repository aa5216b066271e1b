//! Statics of single corners, expected forces, and lift.

use super::tuning;

tuning! {
    /// Statics of each corner by itself (`statics.rs`).
    StaticsTuning {
        /// Standard deviations of M_x and M_z about zero (free rolling). M_y is unknown: each half-shaft
        /// can carry a torque.
        moment_sigma_n_m: [f64; 2] = [40.0, 15.0], "N m";
        /// Smallest standard deviation of a member's force.
        member_sigma_min_n: f64 = 1.0, "N";
        /// Standard deviation of lateral and longitudinal force where only the deflection is known,
        /// as a part of the load.
        blind_part: f64 = 0.3, "1";
        /// The same, constant part.
        blind_n: f64 = 50.0, "N";
    }
}

tuning! {
    /// Forces that the four-wheel model expects (`expected.rs`).
    ExpectedTuning {
        /// Speed below which the model is held at rest: slip is not defined there.
        rest_speed_m_s: f64 = 1.0, "m/s";
        /// Largest longitudinal acceleration that is attributed to drive and brakes.
        acceleration_max_m_s2: f64 = 15.0, "m/s²";
        /// Largest longitudinal slip.
        slip_max: f64 = 0.2, "1";
        /// Largest steer angle, bank and grade.
        angle_max_rad: f64 = 1.0, "rad";
        /// Difference of the model's sideslip from the estimated one from which the model spins.
        spun_rad: f64 = 0.15, "rad";
        /// Speed from which that is judged.
        spun_speed_m_s: f64 = 3.0, "m/s";
    }
}

tuning! {
    /// Lift of wheels and sides: warning, detection, touchdown (`lift.rs`).
    LiftTuning {
        /// Part of the static load below which a wheel is up.
        up: f64 = 0.02, "1";
        /// Standard deviations of the load that are added to that limit.
        margin_sigma: f64 = 1.0, "σ";
        /// Largest limit, as a part of the static load.
        up_max: f64 = 0.1, "1";
        /// The wheel is down again above this factor on the limit.
        down_by: f64 = 1.5, "1";
        /// Part of the static load above which it is down again.
        down: f64 = 0.06, "1";
        /// Part of the static load below which the slow filter gives a warning.
        light: f64 = 0.2, "1";
        /// The same of the quick filter.
        quick_light: f64 = 0.21, "1";
        /// Standard deviations by which the load must be below these limits.
        light_sigma: f64 = 1.0, "σ";
        /// Part of the static load by which the slow filter may be below the quick one.
        overshoot: f64 = 0.05, "1";
        /// Lead time of the slow filter.
        lead_s: f64 = 1.4, "s";
        /// Lead time of the quick filter.
        quick_lead_s: f64 = 0.9, "s";
        /// Least fall of the load by the quick filter, as a part of the static load.
        quick_fall: f64 = 0.25, "1/s";
        /// Part of the static load below which a steady load gives a warning.
        steady_light: f64 = 0.205, "1";
        /// A load that rises more quickly, as a part of the static load, is not steady.
        steady_rise: f64 = 0.02, "1/s";
        /// Part of the static load above which the load must be before a further warning.
        calm: f64 = 0.4, "1";
        /// Steps above that limit before a further warning.
        calm_steps: u32 = 50, "1";
        /// A load that falls more slowly, as a part of the static load, does not count as falling.
        fall_min: f64 = 0.01, "1/s";
        /// Consecutive steps below the limit that declare a lift: a tenth of a second.
        steps: u32 = 10, "1";
        /// Density of the load's white noise at 10 m/s above which the ground counts as rough.
        rough_density: f64 = 3.0e5, "N²/s";
        /// Consecutive steps of the slow filter that give a warning.
        slow_steps: u32 = 10, "1";
        /// The same of the quick filter.
        quick_steps: u32 = 2, "1";
        /// The same of a steady load.
        steady_steps: u32 = 30, "1";
        /// Fading memory per step of the slow filter: a third of a second.
        slow_keep: f64 = 0.95, "1";
        /// The same of the quick filter: a tenth of a second.
        quick_keep: f64 = 0.85, "1";
        /// Fading memory per step of the load by which the time to lift is reported: half a second.
        keep: f64 = 0.97, "1";
        /// Part of one step's standard deviation that remains in the filtered load.
        filtered_sigma: f64 = 0.3, "1";
        /// Part of one step's standard deviation in the load that is extrapolated by one second.
        ahead_sigma: f64 = 0.4, "1/s";
        /// Standard deviation of a load by the balances of the whole vehicle, as a part of the static load, from which no
        /// lift is judged.
        balance_sigma_max: f64 = 0.12, "1";
        /// Time after the start in which nothing is declared.
        settling_s: f64 = 1.0, "s";
    }
}
