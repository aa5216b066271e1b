//! Linkages and struts.

use super::tuning;

tuning! {
    /// Position of the linkages, the ground's normal and the contact frames (`corners.rs`).
    CornerTuning {
        /// Load under which a wheel's contact point does not define the ground, and from which it defines it
        /// fully.
        contact_n: [f64; 2] = [60.0, 400.0], "N";
        /// Time constant with which the ground's normal follows the plane through the contact points; the
        /// gyros turn it meanwhile.
        normal_time_s: f64 = 0.2, "s";
        /// Error of the strut model beside the error of its length: for the filtered length.
        strut_sigma_n: f64 = 8.0, "N";
        /// Largest standard deviation of the front wheels' heading that a workshop's zero of the
        /// steering wheel leaves.
        steer_sigma_max_rad: f64 = 0.003, "rad";
        /// Standard deviations of heading and inclination of a wheel against the body if the vehicle file has no
        /// hard-points of its axle.
        unknown_rad: [f64; 2] = [0.02, 0.07], "rad";
        /// Standard deviation of the inclination of a wheel whose turn with the strut a load rig has told: its
        /// inclination in the design position is not known.
        unknown_design_rad: f64 = 0.01, "rad";
        /// Standard deviation of the part of F_z that the strut of a corner carries whose motion ratio is one number
        /// of the vehicle file, beside a matrix of its channels.
        unknown_strut_part: f64 = 0.1, "1";
        /// Largest load that enters the geometry, in multiples of the static load.
        load_max: f64 = 20.0, "1";
        group tilt: TiltTuning;
        group strut_length: StrutLengthTuning;
        group steering_wheel: SteeringWheelTuning;
    }
}

tuning! {
    /// Unknown normal of the ground (`corners/tilt.rs`).
    TiltTuning {
        /// Standard deviation of the normal per slope of a wheel's path. Measured on seven rough runs
        /// of an independent simulator: 1.0 to 1.6.
        factor: f64 = 1.3, "1";
        /// Speed of the wheels along the normal on flat ground, by tyres and sensors.
        flat_m_s: f64 = 0.06, "m/s";
        /// Memory of the mean square.
        memory_s: f64 = 1.0, "s";
        /// Least speed of the vehicle by which the wheels' speeds are divided.
        speed_min_m_s: f64 = 1.0, "m/s";
    }
}

tuning! {
    /// Strut length and rate from a potentiometer (`corners/length.rs`).
    StrutLengthTuning {
        /// Initial density of the strut's jerk.
        jerk_density: f64 = 5.0 * 5.0, "(m/s³)²/Hz";
        /// Bounds of that density.
        jerk_density_bounds: [f64; 2] = [0.2 * 0.2, 300.0 * 300.0], "(m/s³)²/Hz";
        /// Gate of a reading.
        gate_sigma: f64 = 8.0, "σ";
        /// Consecutive rejected readings after which the filter, not the potentiometer, is
        /// considered wrong.
        rejections_max: u32 = 5, "1";
        /// Silence after which the length is unknown.
        silence_s: f64 = 0.1, "s";
        /// Initial variances of length, rate and acceleration.
        start_variance: [f64; 3] = [0.01, 1.0, 100.0], "m², (m/s)², (m/s²)²";
        /// Variance of a length that is adopted from the potentiometer.
        adopted_variance_m2: f64 = 1e-6, "m²";
    }
}

tuning! {
    /// Steering-wheel angle, rate and acceleration from encoder readings
    /// (`corners/steering_wheel.rs`).
    SteeringWheelTuning {
        /// Fading memory per step of the angle. The fastest steering of a driver must pass.
        angle_keep: f64 = 0.7, "1";
        /// Fading memory per step of rate and acceleration.
        rate_keep: f64 = 0.85, "1";
        /// Largest rack speed that is used: an encoder can jump.
        rack_max_m_s: f64 = 0.2, "m/s";
        /// Largest rack acceleration that is used.
        rack_max_m_s2: f64 = 2.0, "m/s²";
        /// Fading memory per reading of the difference between the measured angle of a front wheel and that
        /// of rack and linkage.
        toe_keep: f64 = 0.7, "1";
        /// Largest such difference: a sensor that differs more is not used.
        toe_max_rad: f64 = 0.1, "rad";
    }
}
