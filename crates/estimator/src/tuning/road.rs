//! The road under the wheels.

use super::tuning;

tuning! {
    /// Heights of the ground, roughness and plane (`road.rs`).
    RoadTuning {
        /// Speed below which nothing of the road is reported: the profile of a metre then takes longer than the
        /// body's height is known.
        speed_min_m_s: f64 = 2.0, "m/s";
        /// Speed below which no roughness index is reported.
        iri_speed_min_m_s: f64 = 8.0, "m/s";
        /// Frequency below which the reference of the heights follows the ground.
        reference_hz: f64 = 0.02, "Hz";
        /// Standard deviation of the body's height above 0.5 Hz.
        body_sigma_m: f64 = 0.0008, "m";
        /// Standard deviation of a wheel's height against the body, by potentiometer and linkage.
        wheel_sigma_m: f64 = 0.0008, "m";
        /// Standard deviation of the tyre's deflection as a part of its difference to the deflection at rest:
        /// stiffness, and ground that is not a plane within the contact.
        tyre_part: f64 = 0.1, "1";
        /// Standard deviation of the height by ground that is not a plane within the contact, as a part of the
        /// speed of the wheel centre along the vertical over that of the vehicle.
        slope_part_m: f64 = 0.02, "m";
        /// Part of the static load below which a wheel counts as off the ground, and above which it counts as on the
        /// ground again.
        contact_part: [f64; 2] = [0.1, 0.2], "1";
        /// Memory of the mean height of the ground.
        level_memory_m: f64 = 8.0, "m";
        /// Distance over which the ground below a wheel in the air goes back to its mean.
        fall_m: f64 = 0.5, "m";
        /// Standard deviation of the height under such a wheel, constant part.
        lifted_sigma_m: f64 = 0.03, "m";
        /// The same as a part of its clearance, and of what the height is from its mean.
        lifted_part: f64 = 0.8, "1";
        /// Distance between two points of the profile. The weights of the mean over 0.25 m of the golden car are for
        /// this distance.
        spacing_m: f64 = 0.1, "m";
        /// Distance over which the golden car forgets its start.
        car_settles_m: f64 = 20.0, "m";
        /// Distance of the fading memory of roughness and index: its equivalent is twice as long.
        memory_m: f64 = 150.0, "m";
        /// Largest frequency at the wheel of the waves that count for the roughness: the wheel hops above it, and
        /// the loads with the lag do not follow the road. With 22 Hz, the roughness of a class C road is 30 % too low.
        wave_hz_max: f64 = 12.0, "Hz";
        /// Distance after which the roughness is reported.
        roughness_distance_m: f64 = 50.0, "m";
        /// Distance above `iri_speed_min_m_s` after which the index is reported.
        iri_distance_m: f64 = 50.0, "m";
        /// Memory of the slope of the ground (`road/slope.rs`).
        slope_memory_m: f64 = 16.0, "m";
        /// Memory of the mean that shows a change of the slope, and that is the slope during the change. On the trail of
        /// an independent simulator, bank and grade are wrong by 0.51 and 0.38 degrees rms with perfect signals; with
        /// a mean over 12 m alone they are wrong by 0.86 and 0.48 degrees.
        slope_change_m: f64 = 4.0, "m";
        /// Memory of the usual spread.
        slope_spread_m: f64 = 80.0, "m";
        /// Mean over the usual spread from which the slope of the ground changes.
        slope_change_sigma: f64 = 1.5, "1";
        /// Least usual spread of the plane's slope.
        slope_spread_min: f64 = 0.004, "1";
        /// Speed that stands for time at rest.
        slope_rest_m_s: f64 = 0.5, "m/s";
    }
}
