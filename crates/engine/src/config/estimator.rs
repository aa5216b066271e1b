//! `[vehicle]` and `[estimator]`: configuration of the estimator.

use std::ops::{Range, RangeInclusive};

use estimator::tuning::Group;
use estimator::{Calibration, Input, Method, ModelFriction, Settings, Tuning};
use model::FileErrors;
use model::sensors::Sensors;
use model::vehicle::Vehicle;

use super::files::{FileKind, Files};
use super::overrides;
use model::file::{ErrorCollector, Field, NumberOrList, Section, closest};

/// Radius of the curve whose largest speed is wanted, m.
const CURVE_RADIUS_M: RangeInclusive<f64> = 1.0..=10_000.0;
/// Names of the methods in the file.
const METHODS: [(&str, Method); 2] = [("thesis", Method::Thesis), ("fusion", Method::Fusion)];
/// Names of the friction of the vehicle model in the file.
const MODEL_FRICTIONS: [(&str, ModelFriction); 2] = [
    ("vehicle", ModelFriction::Vehicle),
    ("found", ModelFriction::Found),
];
/// Names of the inputs in the file.
const INPUTS: [(&str, Input); 9] = [
    ("strain", Input::Strain),
    ("deflection", Input::Deflection),
    ("imu", Input::Imu),
    ("gnss_velocity", Input::GnssVelocity),
    ("gnss_attitude", Input::GnssAttitude),
    ("wheel_speed", Input::WheelSpeed),
    ("steer", Input::Steer),
    ("ground_speed", Input::GroundSpeed),
    ("hub_acceleration", Input::HubAcceleration),
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
    collector: &mut ErrorCollector<'_>,
) -> Option<Estimator> {
    let enabled = section.optional::<bool>("enabled", collector);
    let method = section.optional::<String>("method", collector);
    let ignore = section.optional::<Vec<String>>("ignore", collector);
    let curve_radius_m = section.optional::<f64>("curve_radius_m", collector);
    let model_friction = section.optional::<String>("model_friction", collector);
    let mut tuning = Tuning::default();
    if let Some(section) = section.optional_section("tuning", collector) {
        read_tuning(section, &mut tuning, collector);
    }
    section.finish(collector);
    let file = vehicle.optional::<String>("file", collector);
    let sensors = vehicle.optional::<String>("sensors", collector);
    let calibration = vehicle.optional::<String>("calibration", collector);
    let overrides = vehicle.optional::<Vec<String>>("overrides", collector);
    let payload = vehicle.optional::<Vec<String>>("payload", collector);
    let vehicle_span = vehicle.span();
    vehicle.finish(collector);

    let mut settings = read_settings(method, ignore, tuning, collector);
    settings.model_friction = friction_of(model_friction.as_ref(), collector);
    settings.curve_radius_m = curve_radius_m.and_then(|field| checked_radius(&field, collector));
    if enabled.as_ref().is_some_and(|field| !field.value) {
        return None;
    }
    let Some(file) = file else {
        if let Some(field) = enabled {
            collector.add(
                &vehicle_span,
                "vehicle.file",
                format!("missing, although {} = true", field.name),
                "set a vehicle file or the name of a built-in vehicle, such as file = \"prowler\"",
            );
        }
        return None;
    };
    let vehicle = text_of(&file, FileKind::Vehicle, files, collector)
        .and_then(|text| overridden(text, overrides.as_ref(), files, collector))
        .and_then(|text| value_of(Vehicle::from_toml(&text, &file.value), collector));
    let sensors = sensors.unwrap_or_else(|| default_sensors(&file));
    let sensors = text_of(&sensors, FileKind::Sensors, files, collector)
        .and_then(|text| value_of(Sensors::from_toml(&text, &sensors.value), collector));
    let vehicle = vehicle?;
    if let Some(field) = payload {
        if let Err(error) = vehicle.loaded(&field.value) {
            let help = "docs/configuration.md describes payloads";
            collector.add(&field.span, &field.name, error.to_string(), help);
        }
        settings.payload = field.value;
    }
    if let Some(sensors) = &sensors {
        check_rods(&vehicle, sensors, &vehicle_span, collector);
    }
    let calibration = match calibration {
        Some(field) => read_calibration(&field, &vehicle, files, collector)?,
        None => Calibration::nominal(&vehicle.name),
    };
    Some(Estimator {
        vehicle,
        sensors: sensors?,
        calibration,
        settings,
    })
}

/// Refuses potentiometers along the tie rods of a vehicle whose rack is not known.
fn check_rods(
    vehicle: &Vehicle,
    sensors: &Sensors,
    span: &Range<usize>,
    collector: &mut ErrorCollector<'_>,
) {
    if sensors.steer_potentiometers.is_some() && vehicle.steering.rack_m_rad.is_none() {
        collector.add(
            span,
            "vehicle.sensors",
            "the sensors file has steer_potentiometers, but the vehicle file has no steering.rack_m_rad"
                .to_owned(),
            "add steering.rack_m_rad, the travel of the rack for one radian of the steering wheel, to the \
             vehicle file",
        );
    }
}

/// Settings without payload from their fields.
fn read_settings(
    method: Option<Field<String>>,
    ignore: Option<Field<Vec<String>>>,
    tuning: Tuning,
    collector: &mut ErrorCollector<'_>,
) -> Settings {
    Settings {
        method: method.map_or(Method::default(), |field| {
            by_name(&field, &field.value, &METHODS, collector).unwrap_or_default()
        }),
        ignore: ignore.map_or_else(Vec::new, |field| {
            let names = field.value.iter();
            names
                .filter_map(|name| by_name(&field, name, &INPUTS, collector))
                .collect()
        }),
        tuning,
        ..Settings::default()
    }
}

/// The friction of the vehicle model.
fn friction_of(field: Option<&Field<String>>, collector: &mut ErrorCollector<'_>) -> ModelFriction {
    field
        .and_then(|field| by_name(field, &field.value, &MODEL_FRICTIONS, collector))
        .unwrap_or_default()
}

/// The radius of a curve that a vehicle can drive.
fn checked_radius(field: &Field<f64>, collector: &mut ErrorCollector<'_>) -> Option<f64> {
    let known = CURVE_RADIUS_M.contains(&field.value);
    if !known {
        let (least, most) = (CURVE_RADIUS_M.start(), CURVE_RADIUS_M.end());
        let message = format!("{} m is not a radius from {least} to {most} m", field.value);
        let help = "write the radius of the curve whose largest speed is wanted, such as 20";
        collector.add(&field.span, &field.name, message, help);
    }
    known.then_some(field.value)
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
fn read_tuning(
    mut section: Section<'_>,
    group: &mut dyn Group,
    collector: &mut ErrorCollector<'_>,
) {
    for parameter in group.parameters() {
        let Some(field) = section.optional::<NumberOrList>(parameter.name, collector) else {
            continue;
        };
        let NumberOrList(numbers) = field.value;
        if let Err(expected) = parameter.value.replace(&numbers) {
            let unit = parameter.unit;
            let default = parameter.value.numbers();
            let message = format!("found {numbers:?}, but {expected} is expected");
            let help = format!("the default is {default:?} (unit: {unit})");
            collector.add(&field.span, &field.name, message, help);
        }
    }
    for (name, group) in group.groups() {
        if let Some(section) = section.optional_section(name, collector) {
            read_tuning(section, group, collector);
        }
    }
    section.finish(collector);
}

pub(super) fn by_name<T: Copy>(
    field: &Field<impl Sized>,
    name: &str,
    known: &[(&str, T)],
    collector: &mut ErrorCollector<'_>,
) -> Option<T> {
    match find(name, known) {
        Ok(value) => Some(value),
        Err((message, help)) => {
            collector.add(&field.span, &field.name, message, help);
            None
        }
    }
}

/// The method with this name.
///
/// # Errors
/// Text that names the value and the methods.
pub fn method(name: &str) -> Result<Method, String> {
    find(name, &METHODS).map_err(|(message, help)| format!("method: {message}; {help}"))
}

/// The input with this name.
///
/// # Errors
/// Text that names the value and the inputs.
pub fn input(name: &str) -> Result<Input, String> {
    find(name, &INPUTS).map_err(|(message, help)| format!("input: {message}; {help}"))
}

/// The value with this name, or what is wrong and what to do.
fn find<T: Copy>(name: &str, known: &[(&str, T)]) -> Result<T, (String, String)> {
    if let Some((_, value)) = known.iter().find(|(known, _)| *known == name) {
        return Ok(*value);
    }
    let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
    let help = match closest(name, &names) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("use one of: {}", names.join(", ")),
    };
    Err((format!("\"{name}\" is not known"), help))
}

fn text_of(
    field: &Field<String>,
    kind: FileKind,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
) -> Option<String> {
    match files.read_text(&field.value, kind) {
        Ok(text) => Some(text),
        Err(problem) => {
            collector.add(&field.span, &field.name, problem.message, problem.help);
            None
        }
    }
}

/// Text of the vehicle file after the overrides are applied.
fn overridden(
    text: String,
    overrides: Option<&Field<Vec<String>>>,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
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
            collector.add(&field.span, &field.name, message, help);
            return None;
        }
    }
    toml::to_string(&vehicle).ok()
}

/// The value of a file; its problems are added to the others.
fn value_of<T>(read: Result<T, FileErrors>, collector: &mut ErrorCollector<'_>) -> Option<T> {
    match read {
        Ok(value) => Some(value),
        Err(errors) => {
            collector.add_foreign(errors.problems);
            None
        }
    }
}

fn read_calibration(
    field: &Field<String>,
    vehicle: &Vehicle,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
) -> Option<Calibration> {
    let text = text_of(field, FileKind::Calibration, files, collector)?;
    let calibration = match Calibration::from_toml(&text) {
        Ok(calibration) => calibration,
        Err(error) => {
            let help = "calibrate again, or correct the file";
            collector.add(&field.span, &field.name, error.to_string(), help);
            return None;
        }
    };
    if calibration.vehicle != vehicle.name {
        collector.add(
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

    #[test]
    fn the_friction_of_the_model_is_read_and_a_wrong_one_is_reported() {
        let read = |value: &str| {
            let text = format!(
                "[vehicle]\nfile = \"prowler\"\n[estimator]\nmodel_friction = \"{value}\"\n"
            );
            Config::from_text(&text, Path::new("."))
        };
        for (value, expected) in super::MODEL_FRICTIONS {
            let settings = read(value).unwrap().estimator.map(|e| e.settings);
            assert_eq!(settings.map(|s| s.model_friction), Some(expected));
        }
        let error = read("fund").unwrap_err().to_string();
        assert!(
            error.contains("estimator.model_friction: \"fund\" is not known")
                && error.contains("did you mean \"found\"?"),
            "{error}"
        );
    }

    #[test]
    fn the_radius_of_the_curve_is_read_and_a_wrong_one_is_reported() {
        let read = |value: &str| {
            let text =
                format!("[vehicle]\nfile = \"prowler\"\n[estimator]\ncurve_radius_m = {value}\n");
            Config::from_text(&text, Path::new("."))
        };
        let config = read("20").expect("a radius");
        let settings = config.estimator.map(|estimator| estimator.settings);
        assert_eq!(settings.and_then(|s| s.curve_radius_m), Some(20.0));
        let error = read("-5").expect_err("no radius").to_string();
        assert!(
            error.contains("estimator.curve_radius_m: -5 m is not a radius from 1 to 10000 m"),
            "{error}"
        );
    }
}
