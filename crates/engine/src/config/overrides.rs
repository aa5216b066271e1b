//! Overrides: fields of a vehicle file that another file replaces.

use toml::{Table, Value};

/// Applies the `[overrides]` of a text, which `atvrec identify` has written, to the table of a vehicle
/// file. The name of a field is dotted, such as `front.tyre.friction`.
pub fn apply(vehicle: &mut Table, text: &str) -> Result<(), String> {
    let found: Table = text.parse().map_err(|error| format!("{error}"))?;
    let name = |table: &Table, key: &str| {
        let name = table.get(key).and_then(Value::as_str);
        name.unwrap_or_default().to_owned()
    };
    let (own, theirs) = (name(vehicle, "name"), name(&found, "vehicle"));
    if own != theirs {
        return Err(format!(
            "the overrides are for vehicle \"{theirs}\", but the vehicle is \"{own}\""
        ));
    }
    let overrides = found
        .get("overrides")
        .and_then(Value::as_table)
        .ok_or("the file has no table [overrides]")?;
    for (field, value) in overrides {
        let mut path: Vec<&str> = field.split('.').collect();
        let Some(last) = path.pop() else { continue };
        let mut table = &mut *vehicle;
        for part in path {
            let inner = table
                .entry(part)
                .or_insert_with(|| Value::Table(Table::new()));
            table = inner
                .as_table_mut()
                .ok_or_else(|| format!("{field}: {part} is not a table of the vehicle file"))?;
        }
        table.insert(last.to_owned(), value.clone());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const VEHICLE: &str = "name = \"buggy\"\n[front.tyre]\nfriction = 0.9\n[body]\nmass_kg = 600.0";

    #[test]
    fn fields_are_replaced_and_others_are_kept() {
        let mut vehicle: Table = VEHICLE.parse().unwrap();
        let text = "vehicle = \"buggy\"\n[overrides]\n\"front.tyre.friction\" = 0.6\n\
                    \"body.pitch.stiffness_n_m_rad\" = 2e4";
        apply(&mut vehicle, text).unwrap();
        assert_eq!(vehicle["front"]["tyre"]["friction"].as_float(), Some(0.6));
        assert_eq!(vehicle["body"]["mass_kg"].as_float(), Some(600.0));
        assert_eq!(
            vehicle["body"]["pitch"]["stiffness_n_m_rad"].as_float(),
            Some(2e4)
        );
    }

    #[test]
    fn overrides_of_another_vehicle_are_rejected() {
        let mut vehicle: Table = VEHICLE.parse().unwrap();
        let error = apply(&mut vehicle, "vehicle = \"truck\"\n[overrides]").unwrap_err();
        assert!(
            error.contains("truck") && error.contains("buggy"),
            "{error}"
        );
        assert!(apply(&mut vehicle, "vehicle = \"buggy\"").is_err());
        let through = "vehicle = \"buggy\"\n[overrides]\n\"name.x\" = 1.0";
        assert!(apply(&mut vehicle, through).is_err());
    }
}
