//! Tyre property files that a vehicle file names.

use std::path::Path;

use toml::de::DeValue;

use super::{Axle, Tyre, Vehicle, VehicleErrors};
use crate::file::rules::Checked;
use crate::file::{FileErrors, Problem, span_table};
use crate::tyre::{PropertyTyre, Tir};

/// Tables of a vehicle file that may name a property file.
const AXLES: [&str; 2] = ["front", "rear"];

impl Vehicle {
    /// The text of a vehicle file in which the name of each tyre property file is replaced by the
    /// coefficients of that file, so that the text needs no other file. `read` gives the text of a file
    /// whose name is relative to the vehicle file. A text without property files, or with an error of
    /// syntax, is returned as it is.
    ///
    /// # Errors
    /// All mistakes of the property files at once, each with its line, name, value and remedy.
    pub fn with_tyre_files(
        text: &str,
        path: impl AsRef<Path>,
        read: impl Fn(&str) -> Result<String, String>,
    ) -> Result<String, VehicleErrors> {
        let path = path.as_ref();
        let mut resolved = text.to_owned();
        let mut problems = Vec::new();
        for (field, span, name) in named(text).into_iter().rev() {
            let problem = |message: String| Problem {
                file: path.display().to_string(),
                line: text
                    .get(..span.start)
                    .unwrap_or_default()
                    .matches('\n')
                    .count()
                    + 1,
                column: 0,
                field,
                value: format!("{name:?}"),
                message,
                help: "give the name of a .tir file relative to the vehicle file".to_owned(),
            };
            match read(&name) {
                Err(error) => problems.push(problem(format!("cannot be read: {error}"))),
                Ok(tir) => match Tir::parse(&tir, &name) {
                    Ok(tir) => resolved.replace_range(span, &tir.to_inline()),
                    Err(found) => problems.extend(found),
                },
            }
        }
        FileErrors::check(&path.display().to_string(), problems)?;
        Ok(resolved)
    }
}

/// Field, place of the value and name of each property file.
fn named(text: &str) -> Vec<(String, std::ops::Range<usize>, String)> {
    let Some(table) = span_table(text) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for axle in AXLES {
        let tyre = (table.get_ref().get(axle))
            .and_then(|axle| axle.get_ref().get("tyre"))
            .and_then(|tyre| tyre.get_ref().get("tir"));
        if let Some(value) = tyre
            && let DeValue::String(name) = value.get_ref()
        {
            found.push((format!("{axle}.tyre.tir"), value.span(), name.to_string()));
        }
    }
    found.sort_by_key(|(_, span, _)| span.start);
    found
}

/// Fills the fields of both tyres that the file leaves out.
pub(super) fn fill(checked: &mut Checked<Vehicle>) {
    for name in AXLES {
        let axle: &mut Axle = match name {
            "front" => &mut checked.value.front,
            _ => &mut checked.value.rear,
        };
        let fault = fill_tyre(&mut axle.tyre);
        if let Some((field, value, message, help)) = fault {
            let field = format!("{name}.tyre.{field}");
            checked.note(&field, value, message.to_owned(), help.to_owned());
        }
    }
}

/// Field, value, message and remedy.
type Fault = (&'static str, String, &'static str, &'static str);

fn fill_tyre(tyre: &mut Tyre) -> Option<Fault> {
    let set = |field: &mut f64, value: f64| {
        if field.is_nan() {
            *field = value;
        }
    };
    if let Some(tir) = &tyre.tir {
        let own = PropertyTyre::measured(tir).derived(tir);
        let number = |name: &str| tir.number(name).unwrap_or(0.0);
        let nominal_load_n = number("FNOMIN");
        set(&mut tyre.unloaded_radius_m, number("UNLOADED_RADIUS"));
        match tir.vertical_stiffness_n_m() {
            Some(stiffness) => set(&mut tyre.vertical_stiffness_n_m, stiffness),
            None if tyre.vertical_stiffness_n_m.is_nan() => {
                tyre.vertical_stiffness_n_m = 1.0;
                let message = "is missing, and the .tir file has no VERTICAL_STIFFNESS";
                let help = "add a number in the unit that the field's name ends with";
                return Some(("vertical_stiffness_n_m", String::new(), message, help));
            }
            None => {}
        }
        set(&mut tyre.vertical_damping_n_s_m, number("VERTICAL_DAMPING"));
        set(&mut tyre.width_m, number("WIDTH"));
        set(
            &mut tyre.cornering_stiffness_n_rad,
            own.cornering_stiffness_n_rad,
        );
        set(&mut tyre.slip_stiffness_n, own.slip_stiffness_n);
        set(&mut tyre.reference_load_n, nominal_load_n);
        set(&mut tyre.load_exponent, own.load_exponent);
        set(&mut tyre.friction, own.friction);
        set(&mut tyre.relaxation_length_m, own.relaxation_length_m);
        set(&mut tyre.rolling_resistance, own.rolling_resistance);
        set(&mut tyre.camber_stiffness_n_rad, own.camber_stiffness_n_rad);
        if (tyre.reference_load_n - nominal_load_n).abs() > 1e-6 * nominal_load_n {
            let value = tyre.reference_load_n.to_string();
            let message = "is not FNOMIN of the .tir file";
            return Some(("reference_load_n", value, message, "remove it"));
        }
    }
    set(&mut tyre.load_exponent, 1.0);
    for field in [
        &mut tyre.vertical_damping_n_s_m,
        &mut tyre.width_m,
        &mut tyre.relaxation_length_m,
        &mut tyre.rolling_resistance,
        &mut tyre.camber_stiffness_n_rad,
    ] {
        set(field, 0.0);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIR: &str = include_str!("../tyre/property/mf61.tir");

    /// The built-in vehicle with a property file at the front.
    fn text(tyre: &str) -> String {
        let own = Vehicle::builtin_text("prowler").unwrap();
        let start = own.find("[front.tyre]").unwrap();
        let end = start + own[start..].find("\n[").unwrap();
        format!("{}[front.tyre]\n{tyre}\n{}", &own[..start], &own[end..])
    }

    fn read(name: &str) -> Result<String, String> {
        match name {
            "tyres/my.tir" => Ok(TIR.to_owned()),
            _ => Err("no such file".to_owned()),
        }
    }

    #[test]
    fn a_property_file_gives_all_that_the_vehicle_file_leaves_out() {
        let named = text("tir = \"tyres/my.tir\" # own tyre");
        let whole = Vehicle::with_tyre_files(&named, "car.toml", read).unwrap();
        assert!(whole.contains("# own tyre"));
        assert_eq!(whole.lines().count(), named.lines().count());
        let vehicle = Vehicle::from_toml(&whole, "car.toml").unwrap();
        let tyre = &vehicle.front.tyre;
        assert_eq!((tyre.unloaded_radius_m, tyre.width_m), (0.32, 0.205));
        assert_eq!(tyre.reference_load_n, 4000.0);
        assert!(tyre.cornering_stiffness_n_rad > 4e4 && tyre.cornering_stiffness_n_rad < 1e5);
        assert!(tyre.friction > 0.7 && tyre.friction < 1.0, "{tyre:?}");
        assert!(vehicle.rear.tyre.tir.is_none());
        // The text of the vehicle contains the tyre.
        let again = Vehicle::from_toml(&vehicle.to_toml().unwrap(), "again.toml").unwrap();
        assert_eq!(again, vehicle);
        let own = crate::tyre::Tyre::from_vehicle(tyre);
        let measured = PropertyTyre::measured(&Tir::parse(TIR, "my.tir").unwrap());
        assert_eq!(own, crate::tyre::Tyre::Property(Box::new(measured)));
    }

    #[test]
    fn friction_of_the_vehicle_file_scales_the_formula() {
        let read_with = |more: &str| {
            let named = text(&format!("tir = \"tyres/my.tir\"\n{more}"));
            let whole = Vehicle::with_tyre_files(&named, "car.toml", read).unwrap();
            Vehicle::from_toml(&whole, "car.toml").unwrap().front.tyre
        };
        let plain = read_with("");
        let slippery = read_with(&format!("friction = {:?}", 0.5 * plain.friction));
        let peak = |tyre: &Tyre| {
            let tyre = crate::tyre::Tyre::from_vehicle(tyre);
            let forces = (0..4000).map(|k| {
                let contact = crate::tyre::Contact::lateral(4000.0, 1e-4 * f64::from(k));
                -tyre.forces_on(true, &contact).lateral_n
            });
            forces.fold(0.0, f64::max)
        };
        let ratio = peak(&slippery) / peak(&plain);
        // The vertical shift falls by the degressive factor instead.
        assert!((ratio - 0.5).abs() < 0.02, "{ratio}");
    }

    /// A tyre of the left side on both sides of an axle: what the left wheel does, the right one mirrors.
    #[test]
    fn a_vehicle_on_one_tyre_of_the_left_side_stands_and_rolls_straight() {
        use crate::chassis::{four_wheel, fourteen_dof};
        let own = Vehicle::builtin_text("prowler").unwrap();
        let tyre = TIR.replace("FNOMIN                   = 4000.0", "FNOMIN = 1600.0");
        let named = ["front", "rear"].iter().fold(own.to_owned(), |text, axle| {
            let head = format!("[{axle}.tyre]");
            let start = text.find(&head).unwrap();
            let end = text[start..]
                .find("\n[")
                .map_or(text.len(), |end| start + end);
            format!(
                "{}{head}\ntir = \"my.tir\"\n{}",
                &text[..start],
                &text[end..]
            )
        });
        let whole = Vehicle::with_tyre_files(&named, "car.toml", |_| Ok(tyre.clone())).unwrap();
        let vehicle = Vehicle::from_toml(&whole, "car.toml").unwrap();
        let parameters = fourteen_dof::Parameters::from_vehicle(&vehicle).unwrap();
        let mut state = fourteen_dof::at_rest(&parameters).unwrap();
        state.velocity_m_s[0] = 10.0;
        for i in 0..4 {
            state.wheel_speed_rad_s[i] = 10.0 / parameters.corners[i].rolling_radius_m;
        }
        let inputs = fourteen_dof::Inputs::coasting();
        let told = fourteen_dof::outputs(&parameters, &state, &inputs);
        for axle in [[0, 1], [2, 3]] {
            let [left, right] = axle.map(|i: usize| told.lateral_n[i]);
            assert!(
                left.abs() > 5.0 && (left + right).abs() < 1e-6 * left.abs(),
                "{told:?}"
            );
        }
        assert!(told.rate.rate_rad_s[2].abs() < 1e-9, "{told:?}");
        // Rolling resistance is that of the property file, not that of the coefficient.
        let mut without = parameters.clone();
        for corner in &mut without.corners {
            corner.rolling_resistance = 0.0;
        }
        let spin = |told: &fourteen_dof::Outputs<f64>| told.rate.wheel_speed_rad_s;
        let same = fourteen_dof::outputs(&without, &state, &inputs);
        assert_eq!(spin(&same), spin(&told));
        let flat = four_wheel::Parameters::from_vehicle(&vehicle);
        let own = crate::tyre::Tyre::from_vehicle(&vehicle.front.tyre);
        assert_eq!(flat.front.tyre, own);
    }

    #[test]
    fn mistakes_of_both_files_are_named() {
        let lost = text("tir = \"gone.tir\"");
        let error = Vehicle::with_tyre_files(&lost, "car.toml", read).unwrap_err();
        let message = error.to_string();
        assert_eq!(error.problems[0].field, "front.tyre.tir");
        assert!(message.contains("\"gone.tir\""), "{message}");
        assert!(message.contains("no such file"), "{message}");
        let unread = Vehicle::from_toml(&lost, "car.toml")
            .unwrap_err()
            .to_string();
        assert!(
            unread.contains("name of a file that was not read"),
            "{unread}"
        );
        let wrong = text("tir = { FITTYP = 61, FNOMIN = 4000.0 }");
        let wrong = Vehicle::from_toml(&wrong, "car.toml")
            .unwrap_err()
            .to_string();
        assert!(wrong.contains("PCX1: is missing"), "{wrong}");
        let soft = TIR.replace("VERTICAL_STIFFNESS       = 200000.0\n", "");
        let named = text("tir = \"a.tir\"");
        let whole = Vehicle::with_tyre_files(&named, "car.toml", |_| Ok(soft.clone())).unwrap();
        let error = Vehicle::from_toml(&whole, "car.toml").unwrap_err();
        assert_eq!(error.problems[0].field, "front.tyre.vertical_stiffness_n_m");
        // Without a property file the fields are required as before.
        let bare = Vehicle::from_toml(&text("friction = 0.9"), "car.toml").unwrap_err();
        assert!(bare.problems.len() > 4, "{bare}");
    }
}
