//! Roles of DBC signals as measurements: `[source.<name>.roles]`.

use sample::{HubAccelerationSample, STANDARD_GRAVITY_M_S2, Side, StrainChannel, Wheel};
use wire::dbc::{Database, SignalDef};

use model::file::{ErrorCollector, Field, Section, closest};

/// Role of a signal for the estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// Steering-wheel angle; the factor converts the signal's unit to rad.
    Steer(f64),
    /// Travel of a potentiometer along a front tie rod, left positive; the factor converts the
    /// signal's unit to m, absent for counts.
    SteerRod(Side, Option<f64>),
    /// Angular speed of a wheel; the factor converts the signal's unit to rad/s.
    WheelSpeed(Wheel, f64),
    /// Counts of a spring potentiometer.
    Deflection(Wheel),
    /// Counts of a strain channel.
    Strain(Wheel, StrainChannel),
    /// Axis of a hub accelerometer, 0 to 2; the factor converts the signal's unit to m/s^2, absent
    /// for counts.
    HubAcceleration(Wheel, usize, Option<f64>),
    /// Axis of the force of a load on the hitch, 0 to 2; the factor converts the signal's unit to N.
    HitchForce(usize, f64),
}

/// A signal and its role.
#[derive(Clone, Debug, PartialEq)]
pub struct RoleOf {
    /// Index of the DBC file.
    pub database: usize,
    /// Index of the message in the file.
    pub message: usize,
    /// Index of the signal in the message.
    pub signal: usize,
    /// Role of the signal.
    pub role: Role,
}

/// Reads the table. A role without an entry has the signal of the built-in DBC file, if the DBC files
/// contain it.
pub fn read(
    mut section: Section<'_>,
    databases: &[Database],
    collector: &mut ErrorCollector<'_>,
) -> Vec<RoleOf> {
    let mut finder = Finder {
        databases,
        roles: Vec::new(),
    };
    let field = section.optional::<String>("steer", collector);
    finder.add(field, "Steering.hand_wheel_angle", collector, |signal| {
        angle_factor(signal).map(Role::Steer)
    });
    for side in Side::ALL {
        let (key, default) = match side {
            Side::Left => ("steer_left", "SteerRods.left"),
            Side::Right => ("steer_right", "SteerRods.right"),
        };
        let field = section.optional::<String>(key, collector);
        finder.add(field, default, collector, |signal| {
            length_factor(signal).map(|factor| Role::SteerRod(side, factor))
        });
    }
    let mut hitch = section.section("hitch_force", collector);
    for (axis, name) in HubAccelerationSample::AXES.into_iter().enumerate() {
        let field = hitch.optional::<String>(name, collector);
        let default = format!("Hitch.force_{name}");
        finder.add(field, &default, collector, |signal| {
            force_factor(signal).map(|factor| Role::HitchForce(axis, factor))
        });
    }
    let mut speeds = section.section("wheel_speed", collector);
    let mut deflections = section.section("deflection", collector);
    let mut strains = section.section("strain", collector);
    let mut hubs = section.section("hub_acceleration", collector);
    for wheel in Wheel::ALL {
        let (key, corner) = (key(wheel), wheel.abbreviation());
        let field = speeds.optional::<String>(key, collector);
        let default = format!("WheelSpeed.{corner}");
        finder.add(field, &default, collector, |signal| {
            rate_factor(signal).map(|factor| Role::WheelSpeed(wheel, factor))
        });
        let field = deflections.optional::<String>(key, collector);
        let default = format!("Corner_{corner}.deflection");
        finder.add(field, &default, collector, |_| Ok(Role::Deflection(wheel)));
        let mut channels = strains.section(key, collector);
        for channel in StrainChannel::ALL {
            let field = channels.optional::<String>(channel.name(), collector);
            let default = default_strain(corner, channel);
            finder.add(field, &default, collector, |_| {
                Ok(Role::Strain(wheel, channel))
            });
        }
        channels.finish(collector);
        let mut axes = hubs.section(key, collector);
        for (axis, name) in HubAccelerationSample::AXES.into_iter().enumerate() {
            let field = axes.optional::<String>(name, collector);
            let default = format!("Hub_{corner}.{name}");
            finder.add(field, &default, collector, |signal| {
                let factor = acceleration_factor(signal)?;
                Ok(Role::HubAcceleration(wheel, axis, factor))
            });
        }
        axes.finish(collector);
    }
    for section in [hitch, speeds, deflections, strains, hubs, section] {
        section.finish(collector);
    }
    finder.roles
}

const fn key(wheel: Wheel) -> &'static str {
    wheel.abbreviation()
}

fn default_strain(corner: &str, channel: StrainChannel) -> String {
    let message = match channel {
        StrainChannel::UpperFront
        | StrainChannel::UpperRear
        | StrainChannel::LowerFront
        | StrainChannel::LowerRear => "Strain",
        StrainChannel::TieRod
        | StrainChannel::LowerFrontBending
        | StrainChannel::LowerRearBending => "Corner",
    };
    format!("{message}_{corner}.{}", channel.name())
}

struct Finder<'d> {
    databases: &'d [Database],
    roles: Vec<RoleOf>,
}

impl Finder<'_> {
    fn add(
        &mut self,
        field: Option<Field<String>>,
        default: &str,
        collector: &mut ErrorCollector<'_>,
        role: impl Fn(&SignalDef) -> Result<Role, String>,
    ) {
        let name = field.as_ref().map_or(default, |field| &field.value);
        let found = self.find(name);
        let problem = match (found, field.is_some()) {
            (Some((database, message, signal)), _) => {
                let definition = &self.databases[database].messages()[message].signals[signal];
                match role(definition) {
                    Ok(role) => {
                        self.roles.push(RoleOf {
                            database,
                            message,
                            signal,
                            role,
                        });
                        return;
                    }
                    Err(message) => (
                        message,
                        "correct the unit of the signal in the DBC file".to_owned(),
                    ),
                }
            }
            (None, true) => self.not_found(name),
            (None, false) => return,
        };
        if let Some(field) = field {
            collector.add(&field.span, &field.name, problem.0, problem.1);
        }
    }

    fn find(&self, name: &str) -> Option<(usize, usize, usize)> {
        let (message_name, signal_name) = name.split_once('.')?;
        self.databases
            .iter()
            .enumerate()
            .find_map(|(number, database)| {
                let found = database.by_name(message_name)?;
                let messages = database.messages();
                let message = messages.iter().position(|m| std::ptr::eq(m, found))?;
                Some((number, message, found.position(signal_name)?))
            })
    }

    fn not_found(&self, name: &str) -> (String, String) {
        let Some((message_name, signal_name)) = name.split_once('.') else {
            return (
                format!("\"{name}\" is not the name of a signal"),
                "use \"Message.Signal\" with both names of the DBC file".to_owned(),
            );
        };
        let left_out = self.databases.iter().flat_map(Database::left_out);
        let mut left_out = left_out.filter(|part| part.message.as_deref() == Some(message_name));
        if let Some(part) = left_out.next() {
            return (
                format!(
                    "the message {message_name} has an error in the DBC file: {}",
                    part.issue
                ),
                "correct the message in the DBC file, or remove the role".to_owned(),
            );
        }
        let message = self.databases.iter().find_map(|d| d.by_name(message_name));
        let (missing, known): (String, Vec<&str>) = match message {
            Some(message) => (
                format!("the message {message_name} has no signal \"{signal_name}\""),
                message.signals.iter().map(|s| s.name.as_str()).collect(),
            ),
            None => (
                format!("no DBC file has a message \"{message_name}\""),
                self.databases
                    .iter()
                    .flat_map(Database::messages)
                    .map(|m| m.name.as_str())
                    .collect(),
            ),
        };
        let wanted = if message.is_some() {
            signal_name
        } else {
            message_name
        };
        let help = match closest(wanted, &known) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => format!("use one of: {}", known.join(", ")),
        };
        (missing, help)
    }
}

/// Factor that converts the unit of a signal to rad.
fn angle_factor(signal: &SignalDef) -> Result<f64, String> {
    match signal.unit.trim() {
        "rad" => Ok(1.0),
        "deg" | "degree" | "degrees" | "°" => Ok(1.0_f64.to_radians()),
        unit => Err(format!(
            "{} has the unit \"{unit}\", which is not a unit of an angle",
            signal.name
        )),
    }
}

/// Factor that converts the unit of a signal to N.
fn force_factor(signal: &SignalDef) -> Result<f64, String> {
    match signal.unit.trim() {
        "N" => Ok(1.0),
        "daN" => Ok(10.0),
        "kN" => Ok(1000.0),
        unit => Err(format!(
            "{} has the unit \"{unit}\", which is not a unit of a force",
            signal.name
        )),
    }
}

/// Factor that converts the unit of a signal to m; none for counts.
fn length_factor(signal: &SignalDef) -> Result<Option<f64>, String> {
    match signal.unit.trim() {
        "m" => Ok(Some(1.0)),
        "cm" => Ok(Some(1e-2)),
        "mm" => Ok(Some(1e-3)),
        "count" | "counts" | "" => Ok(None),
        unit => Err(format!(
            "{} has the unit \"{unit}\", which is not a unit of a length",
            signal.name
        )),
    }
}

/// Factor that converts the unit of a signal to m/s^2; none for counts.
fn acceleration_factor(signal: &SignalDef) -> Result<Option<f64>, String> {
    match signal.unit.trim() {
        "m/s^2" | "m/s2" | "m/s²" => Ok(Some(1.0)),
        "g" => Ok(Some(STANDARD_GRAVITY_M_S2)),
        "count" | "counts" | "" => Ok(None),
        unit => Err(format!(
            "{} has the unit \"{unit}\", which is not a unit of an acceleration",
            signal.name
        )),
    }
}

/// Factor that converts the unit of a signal to rad/s.
fn rate_factor(signal: &SignalDef) -> Result<f64, String> {
    match signal.unit.trim() {
        "rad/s" => Ok(1.0),
        "deg/s" | "°/s" => Ok(1.0_f64.to_radians()),
        "rpm" | "1/min" => Ok(std::f64::consts::TAU / 60.0),
        "Hz" | "1/s" | "rev/s" => Ok(std::f64::consts::TAU),
        unit => Err(format!(
            "{} has the unit \"{unit}\", which is not a unit of an angular speed",
            signal.name
        )),
    }
}
