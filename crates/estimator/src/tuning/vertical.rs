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
        /// Part of the static load below which a warning is possible.
        light: f64 = 0.3, "1";
        /// The same of a side.
        light_side: f64 = 0.18, "1";
        /// The load must rise this part of the static load above the warning limit before a further
        /// warning.
        light_hysteresis: f64 = 0.1, "1";
        /// Steps above that limit before a further warning.
        calm_steps: u32 = 50, "1";
        /// Lead time of a warning.
        lead_s: f64 = 2.5, "s";
        /// A load that falls more slowly, as a part of the static load, does not count as falling.
        fall_min: f64 = 0.01, "1/s";
        /// Consecutive steps below the limit that declare a lift: a tenth of a second.
        steps: u32 = 10, "1";
        /// Density of the load's white noise at 10 m/s above which the ground counts as rough.
        rough_density: f64 = 3.0e5, "N²/s";
        /// Consecutive steps that give a warning.
        warning_steps: u32 = 20, "1";
        /// Fading memory per step of the filtered load: half a second.
        keep: f64 = 0.97, "1";
        /// Part of one step's standard deviation that remains in the filtered load.
        filtered_sigma: f64 = 0.3, "1";
        /// Part of one step's standard deviation in the load that is extrapolated by one second.
        ahead_sigma: f64 = 0.4, "1/s";
        /// Time after the start in which nothing is declared.
        settling_s: f64 = 1.0, "s";
    }
}
