//! Units and frames of reference of columns, for tables that leave the log.

use crate::Column;

/// Ends of the names of fields in the project's own schemas, with their units; a longer end precedes a
/// shorter one.
const UNITS: [(&str, &str); 14] = [
    ("_m_s2", "m/s^2"),
    ("_rad_s", "rad/s"),
    ("_m_km", "m/km"),
    ("_n_m", "N m"),
    ("_m_s", "m/s"),
    ("_m3", "m^3"),
    ("_rad", "rad"),
    ("_ppm", "ppm"),
    ("_ns", "ns"),
    ("_hz", "Hz"),
    ("_m", "m"),
    ("_n", "N"),
    ("_s", "s"),
    ("_c", "degC"),
];
/// Fields of `foxglove.LocationFix`, with their units.
const LOCATION_FIX: [(&str, &str); 4] = [
    ("latitude", "deg"),
    ("longitude", "deg"),
    ("altitude", "m"),
    ("position_covariance", "m^2"),
];

/// Unit of a column of a topic with this schema: that of the channel, or that of the field's name in the
/// project's own schemas. `None` for numbers without a unit, and if the unit is unknown.
#[must_use]
pub fn unit<'c>(schema: &str, column: &'c Column) -> Option<&'c str> {
    if !column.unit.is_empty() {
        return Some(&column.unit);
    }
    if schema == "foxglove.LocationFix" {
        let known = LOCATION_FIX.iter().find(|(name, _)| *name == column.name);
        return known.map(|(_, unit)| *unit);
    }
    let is_own = schema.starts_with("atvrec.") && !schema.starts_with("atvrec.signals.");
    // The components of a vector follow the field with the unit: `sigma_rad.yaw`.
    let mut fields = column.name.rsplit('.').filter(|_| is_own);
    fields.find_map(|field| {
        let known = UNITS.iter().find(|(end, _)| field.ends_with(end));
        known.map(|(_, unit)| *unit)
    })
}

/// Frame of reference of the measured and estimated values of a topic; `None` if they have none. The
/// frames are those of ISO 8855.
#[must_use]
pub fn frame(topic: &str, schema: &str) -> Option<&'static str> {
    const VEHICLE: &str = "vehicle: x forward, y left, z up";
    const EARTH: &str = "earth: east, north, up";
    Some(match schema {
        "atvrec.Imu" => "axes of the sensor",
        "atvrec.HubAcceleration" => {
            "axes of the sensor; nominally y along the spindle to the left, x forward, z up"
        }
        "atvrec.Motion" | "atvrec.GroundSpeed" | "atvrec.Ground" => VEHICLE,
        "atvrec.GnssVelocity" | "atvrec.Pose" => EARTH,
        "atvrec.GnssPosition" | "foxglove.LocationFix" => "WGS 84; height above the ellipsoid",
        "atvrec.GnssAttitude" | "atvrec.Attitude" => {
            "vehicle in earth: yaw from east, left positive; pitch nose down positive; roll right side \
             down positive"
        }
        "atvrec.TyreForces" if topic.ends_with("/tyre_forces") && !topic.starts_with("/model/") => {
            "wheel carrier: y along the spindle to the left, x = unit(y cross z of the vehicle), \
             z = x cross y"
        }
        "atvrec.TyreForces" => {
            "contact: z normal of the ground, x along the wheel heading, y left of it"
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Values;

    fn unit_of(schema: &str, name: &str, unit_of_channel: &str) -> Option<String> {
        let column = Column {
            name: name.to_owned(),
            unit: unit_of_channel.to_owned(),
            names: Vec::new(),
            values: Values::F64(Vec::new()),
            present: None,
        };
        unit(schema, &column).map(str::to_owned)
    }

    #[test]
    fn units_are_those_of_the_names_or_of_the_channel() {
        for (schema, name, channel, expected) in [
            ("atvrec.Motion", "acceleration_m_s2.x", "", Some("m/s^2")),
            ("atvrec.Motion", "yaw_rate_rad_s", "", Some("rad/s")),
            ("atvrec.Motion", "fl.longitudinal_slip", "", None),
            ("atvrec.TyreForces", "fl.moment_x_n_m", "", Some("N m")),
            ("atvrec.TyreForces", "rr.z_sigma_n", "", Some("N")),
            ("atvrec.GnssAttitude", "sigma_rad.yaw", "", Some("rad")),
            ("atvrec.Road", "iri_left_m_km", "", Some("m/km")),
            ("atvrec.Road", "roughness.gd_n0_low_m3", "", Some("m^3")),
            ("atvrec.Imu", "temperature_c", "", Some("degC")),
            ("atvrec.Strain", "fl.tie_rod.raw_counts", "", None),
            ("atvrec.signals.Steering", "angle", "deg", Some("deg")),
            ("atvrec.signals.Steering", "alive_s", "", None),
            ("foxglove.LocationFix", "longitude", "", Some("deg")),
            ("foxglove.LocationFix", "frame_id", "", None),
        ] {
            assert_eq!(
                unit_of(schema, name, channel).as_deref(),
                expected,
                "{name}"
            );
        }
    }

    #[test]
    fn forces_of_the_two_frames_differ() {
        let frame = |topic| frame(topic, "atvrec.TyreForces").unwrap_or_default();
        assert!(frame("/estimate/tyre_forces").starts_with("wheel carrier"));
        assert!(frame("/model/tyre_forces").starts_with("contact"));
        assert!(frame("/lagged/contact_forces").starts_with("contact"));
    }
}
