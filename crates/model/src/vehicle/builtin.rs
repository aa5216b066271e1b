//! The vehicles that ship with the project.

use super::Vehicle;
use crate::Error;

/// Name and text of each vehicle file.
const FILES: &[(&str, &str)] = &[
    ("prowler", include_str!("../../vehicles/prowler.toml")),
    (
        "prowler-off-road",
        include_str!("../../vehicles/prowler-off-road.toml"),
    ),
    (
        "prowler-table-2.3",
        include_str!("../../vehicles/prowler-table-2.3.toml"),
    ),
    (
        "prowler-table-2.3-off-road",
        include_str!("../../vehicles/prowler-table-2.3-off-road.toml"),
    ),
    (
        "prowler-appendix-a",
        include_str!("../../vehicles/prowler-appendix-a.toml"),
    ),
    (
        "prowler-chang",
        include_str!("../../vehicles/prowler-chang.toml"),
    ),
    (
        "second-vehicle",
        include_str!("../../vehicles/second-vehicle.toml"),
    ),
];

impl Vehicle {
    /// Names of the vehicles that ship with the project; the first is the default.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        FILES.iter().map(|(name, _)| *name)
    }

    /// Text of a vehicle file that ships with the project.
    #[must_use]
    pub fn builtin_text(name: &str) -> Option<&'static str> {
        FILES
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, text)| *text)
    }

    /// A vehicle that ships with the project.
    ///
    /// # Errors
    /// Where no vehicle has this name; the message lists those there are.
    pub fn builtin(name: &str) -> Result<Self, Error> {
        let text = Self::builtin_text(name).ok_or_else(|| Error::UnknownName {
            kind: "vehicle",
            name: name.to_owned(),
            known: Self::builtin_names().collect::<Vec<_>>().join(", "),
        })?;
        Ok(Self::from_toml(text, format!("{name}.toml"))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(prefix: &str, value: &toml::Value, found: &mut Vec<String>) {
        match value {
            toml::Value::Table(table) => {
                for (key, value) in table {
                    let name = if prefix.is_empty() {
                        key.clone()
                    } else {
                        format!("{prefix}.{key}")
                    };
                    leaves(&name, value, found);
                }
            }
            _ => found.push(prefix.to_owned()),
        }
    }

    #[test]
    fn every_value_of_every_builtin_vehicle_names_its_source() {
        for name in Vehicle::builtin_names() {
            let vehicle = Vehicle::builtin(name).unwrap();
            let text = Vehicle::builtin_text(name).unwrap();
            let mut document: toml::Table = text.parse().unwrap();
            for key in ["name", "description", "sources"] {
                document.remove(key);
            }
            let mut fields = Vec::new();
            leaves("", &toml::Value::Table(document), &mut fields);
            for field in fields {
                let mut stem = field.as_str();
                let named = loop {
                    if vehicle.sources.contains_key(stem) {
                        break true;
                    }
                    match stem.rsplit_once('.') {
                        Some((table, _)) => stem = table,
                        None => break false,
                    }
                };
                assert!(named, "{name}: no source for {field}");
            }
        }
    }

    #[test]
    fn implausible_inertia_of_table_2_3_is_warned_of_and_warners_is_not() {
        let warned = |name: &str| {
            Vehicle::builtin(name)
                .unwrap()
                .warnings()
                .iter()
                .any(|warning| warning.field == "body.inertia_kg_m2")
        };
        assert!(warned("prowler-table-2.3"));
        assert!(!warned("prowler"));
    }

    /// Equation 2.29, I_z = m a b, prints 452 for a = 0.89 and b = 0.79; table 2.3's a and b give
    /// 328.6.
    #[test]
    fn yaw_inertia_of_two_point_masses_is_as_the_notes_say() {
        let body = Vehicle::builtin("prowler-table-2.3").unwrap().body;
        let inertia = body.mass_kg * body.front_axle_to_cg_m * body.cg_to_rear_axle_m;
        assert!((inertia - 328.6).abs() < 0.05, "{inertia}");
        assert_eq!((body.mass_kg * 0.89 * 0.79).floor(), 452.0);
    }

    #[test]
    fn unknown_names_list_the_known() {
        let message = Vehicle::builtin("jeep").unwrap_err().to_string();
        assert!(
            message.contains("jeep") && message.contains("prowler-chang"),
            "{message}"
        );
    }

    #[test]
    fn a_vehicle_survives_being_written_and_read() {
        for name in Vehicle::builtin_names() {
            let vehicle = Vehicle::builtin(name).unwrap();
            let text = vehicle.to_toml().unwrap();
            assert_eq!(Vehicle::from_toml(&text, "again.toml").unwrap(), vehicle);
        }
    }

    #[test]
    fn the_derived_sprung_body_is_close_to_the_independent_simulators() {
        let sprung = Vehicle::builtin("prowler").unwrap().sprung();
        assert!((sprung.mass_kg - 540.0).abs() < 1e-9);
        assert!((sprung.cg_m[2] - 0.632).abs() < 0.01, "{sprung:?}");
        for (own, theirs) in sprung.inertia_kg_m2.iter().zip([174.0, 375.2, 366.8]) {
            assert!((own / theirs - 1.0).abs() < 0.08, "{sprung:?}");
        }
    }
}
