//! `[vehicle]` and `[estimator]`: configuration of the estimator.

use estimator::tuning::Group;
use estimator::{Calibration, Input, Method, Settings, Tuning};
use model::FileErrors;
use model::sensors::Sensors;
use model::vehicle::Vehicle;

use super::files::{FileKind, Files};
use super::overrides;
use model::file::{Field, Gatherer, NumberOrList, Section, closest};

/// Names of the methods in the file.
const METHODS: [(&str, Method); 2] = [("thesis", Method::Thesis), ("fusion", Method::Fusion)];
/// Names of the inputs in the file.
const INPUTS: [(&str, Input); 8] = [
    ("strain", Input::Strain),
    ("deflection", Input::Deflection),
    ("imu", Input::Imu),
    ("gnss_velocity", Input::GnssVelocity),
    ("gnss_attitude", Input::GnssAttitude),
    ("wheel_speed", Input::WheelSpeed),
    ("steer", Input::Steer),
    ("ground_speed", Input::GroundSpeed),
];

/// Configuration of the estimator.
#[derive(Clone, Debug)]
pub struct Estimator {
    /// Vehicle.
    pub vehicle: Vehicle,
    /// Sensors of the vehicle.
    pub sensors: Sensors,
    /// Calibration of the sensors.
    pub calibration: Calibration,
    /// Method and inputs.
    pub settings: Settings,
}

/// Reads both tables; `None` if the estimator is switched off, if there is no vehicle, or if there is
/// an error.
pub fn read(
    mut section: Section<'_>,
    mut vehicle: Section<'_>,
    files: &mut Files,
    gather: &mut Gatherer<'_>,
) -> Option<Estimator> {
    let enabled = section.optional::<bool>("enabled", gather);
    let method = section.optional::<String>("method", gather);
    let ignore = section.optional::<Vec<String>>("ignore", gather);
    let mut tuning = Tuning::default();
    if let Some(section) = section.optional_section("tuning", gather) {
        read_tuning(section, &mut tuning, gather);
    }
    section.finish(gather);
    let file = vehicle.optional::<String>("file", gather);
    let sensors = vehicle.optional::<String>("sensors", gather);
    let calibration = vehicle.optional::<String>("calibration", gather);
    let overrides = vehicle.optional::<Vec<String>>("overrides", gather);
    let vehicle_span = vehicle.span();
    vehicle.finish(gather);

    let settings = Settings {
        method: method.map_or(Method::default(), |field| {
            by_name(&field, &field.value, &METHODS, gather).unwrap_or_default()
        }),
        ignore: ignore.map_or_else(Vec::new, |field| {
            field
                .value
                .iter()
                .filter_map(|name| by_name(&field, name, &INPUTS, gather))
                .collect()
        }),
        tuning,
    };
    if enabled.as_ref().is_some_and(|field| !field.value) {
        return None;
    }
    let Some(file) = file else {
        if let Some(field) = enabled {
            gather.add(
                &vehicle_span,
                "vehicle.file",
                format!("missing, although {} = true", field.name),
                "set a vehicle file or the name of a built-in vehicle, such as file = \"prowler\"",
            );
        }
        return None;
    };
    let vehicle = text_of(&file, FileKind::Vehicle, files, gather)
        .and_then(|text| overridden(text, overrides.as_ref(), files, gather))
        .and_then(|text| value_of(Vehicle::from_toml(&text, &file.value), gather));
    let sensors = sensors.unwrap_or_else(|| default_sensors(&file));
    let sensors = text_of(&sensors, FileKind::Sensors, files, gather)
        .and_then(|text| value_of(Sensors::from_toml(&text, &sensors.value), gather));
    let vehicle = vehicle?;
    let calibration = match calibration {
        Some(field) => read_calibration(&field, &vehicle, files, gather)?,
        None => Calibration::nominal(&vehicle.name),
    };
    Some(Estimator {
        vehicle,
        sensors: sensors?,
        calibration,
        settings,
    })
}

/// The first built-in sensor set, for a vehicle without sensors in the configuration.
fn default_sensors(vehicle: &Field<String>) -> Field<String> {
    let first = Sensors::builtin_names().next();
    Field {
        value: first.unwrap_or_default().to_owned(),
        span: vehicle.span.clone(),
        name: "vehicle.sensors".to_owned(),
    }
}

/// Reads the numbers of a tuning group and of its sub-groups; absent numbers keep their defaults.
fn read_tuning(mut section: Section<'_>, group: &mut dyn Group, gather: &mut Gatherer<'_>) {
    for parameter in group.parameters() {
        let Some(field) = section.optional::<NumberOrList>(parameter.name, gather) else {
            continue;
        };
        let NumberOrList(numbers) = field.value;
        if let Err(expected) = parameter.value.replace(&numbers) {
            let unit = parameter.unit;
            let default = parameter.value.numbers();
            let message = format!("found {numbers:?}, but {expected} is expected");
            let help = format!("the default is {default:?} (unit: {unit})");
            gather.add(&field.span, &field.name, message, help);
        }
    }
    for (name, group) in group.groups() {
        if let Some(section) = section.optional_section(name, gather) {
            read_tuning(section, group, gather);
        }
    }
    section.finish(gather);
}

fn by_name<T: Copy>(
    field: &Field<impl Sized>,
    name: &str,
    known: &[(&str, T)],
    gather: &mut Gatherer<'_>,
) -> Option<T> {
    let found = known.iter().find(|(known, _)| *known == name);
    if found.is_none() {
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        let help = match closest(name, &names) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => format!("use one of: {}", names.join(", ")),
        };
        gather.add(
            &field.span,
            &field.name,
            format!("\"{name}\" is not known"),
            help,
        );
    }
    found.map(|(_, value)| *value)
}

fn text_of(
    field: &Field<String>,
    kind: FileKind,
    files: &mut Files,
    gather: &mut Gatherer<'_>,
) -> Option<String> {
    match files.read_text(&field.value, kind) {
        Ok(text) => Some(text),
        Err(problem) => {
            gather.add(&field.span, &field.name, problem.message, problem.help);
            None
        }
    }
}

/// Text of the vehicle file after the overrides are applied.
fn overridden(
    text: String,
    overrides: Option<&Field<Vec<String>>>,
    files: &mut Files,
    gather: &mut Gatherer<'_>,
) -> Option<String> {
    let Some(field) = overrides else {
        return Some(text);
    };
    // The reader of vehicle files reports a file that is not TOML.
    let Ok(mut vehicle) = text.parse::<toml::Table>() else {
        return Some(text);
    };
    for name in &field.value {
        let replaced = files
            .read_text(name, FileKind::Overrides)
            .map_err(|problem| (problem.message, problem.help))
            .and_then(|found| {
                overrides::apply(&mut vehicle, &found).map_err(|message| {
                    let help = "create the file with `atvrec identify ... -o`".to_owned();
                    (format!("{name}: {message}"), help)
                })
            });
        if let Err((message, help)) = replaced {
            gather.add(&field.span, &field.name, message, help);
            return None;
        }
    }
    toml::to_string(&vehicle).ok()
}

/// The value of a file; its problems are added to the others.
fn value_of<T>(read: Result<T, FileErrors>, gather: &mut Gatherer<'_>) -> Option<T> {
    match read {
        Ok(value) => Some(value),
        Err(errors) => {
            gather.add_foreign(errors.problems);
            None
        }
    }
}

fn read_calibration(
    field: &Field<String>,
    vehicle: &Vehicle,
    files: &mut Files,
    gather: &mut Gatherer<'_>,
) -> Option<Calibration> {
    let text = text_of(field, FileKind::Calibration, files, gather)?;
    let calibration = match Calibration::from_toml(&text) {
        Ok(calibration) => calibration,
        Err(error) => {
            let help = "calibrate again, or correct the file";
            gather.add(&field.span, &field.name, error.to_string(), help);
            return None;
        }
    };
    if calibration.vehicle != vehicle.name {
        gather.add(
            &field.span,
            &field.name,
            format!(
                "{} is the calibration of vehicle \"{}\", but the vehicle is \"{}\"",
                field.value, calibration.vehicle, vehicle.name
            ),
            "use the calibration of this vehicle, or calibrate it",
        );
        return None;
    }
    Some(calibration)
}

#[cfg(test)]
mod tests {
    use super::super::Config;
    use std::path::Path;

    fn problems(tuning: &str) -> String {
        let text = format!("[vehicle]\nfile = \"prowler\"\n[estimator.tuning.motion]\n{tuning}\n");
        match Config::from_text(&text, Path::new(".")) {
            Ok(config) => {
                let settings = config.estimator.map(|estimator| estimator.settings);
                format!("{:?}", settings.map(|s| s.tuning.motion.gate_sigma))
            }
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_tuned_number_is_read_and_a_wrong_one_is_reported() {
        assert_eq!(problems("gate_sigma = 6"), "Some(6.0)");
        let unknown = problems("gate_sgma = 6");
        assert!(
            unknown.contains("estimator.tuning.motion.gate_sgma: unknown field")
                && unknown.contains("did you mean `gate_sigma`?"),
            "{unknown}"
        );
        let negative = problems("gate_sigma = -1");
        assert!(
            negative.contains("found [-1.0], but a number above 0 is expected")
                && negative.contains("the default is [5.0] (unit: σ)"),
            "{negative}"
        );
        let text = problems("gate_sigma = \"wide\"");
        assert!(
            text.contains("a number or a list of numbers is expected"),
            "{text}"
        );
        let short = problems("jumps.largest = [1.0, 2.0]");
        assert!(short.contains("a list of 3 numbers is expected"), "{short}");
    }
}
