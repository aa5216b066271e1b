//! Roles of DBC signals as measurements: `[source.<name>.roles]`.

mod finder;

use model::file::{ErrorCollector, Field, Section};
use model::strain::StrainSignal;
use sample::{ControlSample, HubAccelerationSample, Side, StrainChannel, Wheel};
use wire::column::Quantity;
use wire::dbc::Database;
use wire::unit::Dimension;

use finder::{Finder, Wanted};

/// Role of a signal. Factors take the unit of the signal to SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// Steering-wheel angle, rad.
    Steer(f64),
    /// Travel of a potentiometer along a front tie rod, left positive.
    SteerRod(Side, Travel),
    /// Travel of the steering rack, left positive, m.
    Rack(f64),
    /// Speed of a wheel.
    WheelSpeed(Wheel, WheelRate),
    /// Compression of a strut.
    Deflection(Wheel, Travel),
    /// A strain channel.
    Strain(Wheel, StrainChannel, StrainUnit),
    /// Axis of a hub accelerometer, 0 to 2, m/s^2; absent for counts.
    HubAcceleration(Wheel, usize, Option<f64>),
    /// A part of a measurement of the inertial unit, of a receiver or of the speed over ground.
    Quantity(Quantity, f64),
    /// Whether the receiver has a solution: not 0.
    Fix,
    /// A value that is recorded under its name.
    Control(ControlValue, f64),
}

/// Unit of a travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Travel {
    /// Converter counts.
    Counts,
    /// Voltage of a potentiometer, V.
    Voltage(f64),
    /// m.
    Length(f64),
}

/// Unit of a strain channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StrainUnit {
    /// Converter counts.
    Counts,
    /// Another unit.
    Of(StrainSignal, f64),
}

/// Unit of a wheel speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WheelRate {
    /// rad/s.
    Angular(f64),
    /// m/s of the freely rolling tyre.
    Rolling(f64),
}

/// A value of `/control/<source>`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlValue {
    /// Steer angle of a front wheel against the chassis, left positive.
    WheelAngle(Side),
    /// Axis of the force of a load on the hitch, 0 to 2.
    HitchForce(usize),
    /// Drive torque of a wheel.
    DriveTorque(Wheel),
    /// Brake torque of a wheel.
    BrakeTorque(Wheel),
    /// Pressure of a wheel's brake.
    BrakePressure(Wheel),
    /// Temperature of the bridges of a corner.
    BridgeTemperature(Wheel),
    /// Inflation pressure of a wheel's tyre above that of the air.
    TyrePressure(Wheel),
    /// Position of the throttle or of its pedal.
    Throttle,
    /// Torque of the engine.
    EngineTorque,
}

impl ControlValue {
    /// Name in the log.
    #[must_use]
    pub fn name(self) -> String {
        let of = |kind: &str, wheel: Wheel| format!("{kind}_{}", wheel.abbreviation());
        match self {
            Self::WheelAngle(side) => ControlSample::WHEEL_ANGLE[side as usize].to_owned(),
            Self::HitchForce(axis) => ControlSample::HITCH_FORCE[axis].to_owned(),
            Self::DriveTorque(wheel) => of("drive_torque", wheel),
            Self::BrakeTorque(wheel) => of("brake_torque", wheel),
            Self::BrakePressure(wheel) => of("brake_pressure", wheel),
            Self::BridgeTemperature(wheel) => of("bridge_temperature", wheel),
            Self::TyrePressure(wheel) => of("tyre_pressure", wheel),
            Self::Throttle => "throttle".to_owned(),
            Self::EngineTorque => "engine_torque".to_owned(),
        }
    }

    /// Unit in the log.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::WheelAngle(_) => "rad",
            Self::HitchForce(_) => "N",
            Self::DriveTorque(_) | Self::BrakeTorque(_) | Self::EngineTorque => "N m",
            Self::BrakePressure(_) | Self::TyrePressure(_) => "Pa",
            Self::BridgeTemperature(_) => "degC",
            Self::Throttle => "1",
        }
    }

    const fn dimension(self) -> Dimension {
        match self {
            Self::WheelAngle(_) => Dimension::Angle,
            Self::HitchForce(_) => Dimension::Force,
            Self::DriveTorque(_) | Self::BrakeTorque(_) | Self::EngineTorque => Dimension::Moment,
            Self::BrakePressure(_) | Self::TyrePressure(_) => Dimension::Pressure,
            Self::BridgeTemperature(_) => Dimension::Temperature,
            Self::Throttle => Dimension::Ratio,
        }
    }
}

/// A signal and its role.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoleOf {
    /// Index of the DBC file.
    pub database: usize,
    /// Index of the message in the file.
    pub message: usize,
    /// Index of the signal in the message.
    pub signal: usize,
    /// Role of the signal.
    pub role: Role,
    /// Where the configuration asks for it; `None` for a role of the built-in file.
    pub at: Option<usize>,
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
        found: Vec::new(),
    };
    read_steering(&mut section, &mut finder, collector);
    read_wheels(&mut section, &mut finder, collector);
    read_controls(&mut section, &mut finder, collector);
    read_quantities(&mut section, &mut finder, collector);
    section.finish(collector);
    finder.finish(collector)
}

const TRAVEL: [Dimension; 3] = [Dimension::Counts, Dimension::Voltage, Dimension::Length];

/// Units of `steer_left` and `steer_right`: a travel along a tie rod, or the angle of a wheel.
const STEER_SIDE: [Dimension; 4] = [
    Dimension::Angle,
    Dimension::Counts,
    Dimension::Voltage,
    Dimension::Length,
];

fn travel(dimension: Dimension, factor: f64) -> Travel {
    match dimension {
        Dimension::Voltage => Travel::Voltage(factor),
        Dimension::Length => Travel::Length(factor),
        _ => Travel::Counts,
    }
}

fn read_steering(
    section: &mut Section<'_>,
    finder: &mut Finder<'_>,
    collector: &mut ErrorCollector<'_>,
) {
    let field = section.optional::<String>("steer", collector);
    let default = Some("Steering.hand_wheel_angle");
    let wanted = Wanted {
        dimensions: &[Dimension::Angle],
        role: &|_, factor| Role::Steer(factor),
    };
    finder.add(field, "steer", default, collector, &wanted);
    for side in Side::ALL {
        let (key, rod) = match side {
            Side::Left => ("steer_left", "SteerRods.left"),
            Side::Right => ("steer_right", "SteerRods.right"),
        };
        let field = section.optional::<String>(key, collector);
        let wanted = Wanted {
            dimensions: &STEER_SIDE,
            role: &|dimension, factor| match dimension {
                Dimension::Angle => Role::Control(ControlValue::WheelAngle(side), factor),
                _ => Role::SteerRod(side, travel(dimension, factor)),
            },
        };
        finder.add(field, key, Some(rod), collector, &wanted);
    }
    let mut angles = section.section("wheel_angle", collector);
    for (side, corner) in Side::ALL.into_iter().zip(["FL", "FR"]) {
        let field = angles.optional::<String>(corner, collector);
        let wanted = Wanted {
            dimensions: &[Dimension::Angle],
            role: &|_, factor| Role::Control(ControlValue::WheelAngle(side), factor),
        };
        let (key, default) = (
            format!("wheel_angle.{corner}"),
            format!("WheelAngles.{corner}"),
        );
        finder.add(field, &key, Some(&default), collector, &wanted);
    }
    angles.finish(collector);
    let field = section.optional::<String>("rack", collector);
    let wanted = Wanted {
        dimensions: &[Dimension::Length],
        role: &|_, factor| Role::Rack(factor),
    };
    finder.add(field, "rack", None, collector, &wanted);
}

fn read_wheels(
    section: &mut Section<'_>,
    finder: &mut Finder<'_>,
    collector: &mut ErrorCollector<'_>,
) {
    let mut speeds = section.section("wheel_speed", collector);
    let mut deflections = section.section("deflection", collector);
    let mut strains = section.section("strain", collector);
    let mut hubs = section.section("hub_acceleration", collector);
    for wheel in Wheel::ALL {
        let corner = wheel.abbreviation();
        let field = speeds.optional::<String>(corner, collector);
        let wanted = Wanted {
            dimensions: &[Dimension::AngularRate, Dimension::Speed],
            role: &|dimension, factor| {
                Role::WheelSpeed(
                    wheel,
                    match dimension {
                        Dimension::Speed => WheelRate::Rolling(factor),
                        _ => WheelRate::Angular(factor),
                    },
                )
            },
        };
        let (key, default) = (
            format!("wheel_speed.{corner}"),
            format!("WheelSpeed.{corner}"),
        );
        finder.add(field, &key, Some(&default), collector, &wanted);
        let field = deflections.optional::<String>(corner, collector);
        let wanted = Wanted {
            dimensions: &TRAVEL,
            role: &|dimension, factor| Role::Deflection(wheel, travel(dimension, factor)),
        };
        let key = format!("deflection.{corner}");
        let default = format!("Corner_{corner}.deflection");
        finder.add(field, &key, Some(&default), collector, &wanted);
        let channels = strains.section(corner, collector);
        read_strain(channels, wheel, finder, collector);
        let mut axes = hubs.section(corner, collector);
        for (axis, name) in HubAccelerationSample::AXES.into_iter().enumerate() {
            let field = axes.optional::<String>(name, collector);
            let wanted = Wanted {
                dimensions: &[Dimension::Counts, Dimension::Acceleration],
                role: &|dimension, factor| {
                    let factor = (dimension != Dimension::Counts).then_some(factor);
                    Role::HubAcceleration(wheel, axis, factor)
                },
            };
            let key = format!("hub_acceleration.{corner}.{name}");
            let default = format!("Hub_{corner}.{name}");
            finder.add(field, &key, Some(&default), collector, &wanted);
        }
        axes.finish(collector);
    }
    for section in [speeds, deflections, strains, hubs] {
        section.finish(collector);
    }
}

fn read_strain(
    mut channels: Section<'_>,
    wheel: Wheel,
    finder: &mut Finder<'_>,
    collector: &mut ErrorCollector<'_>,
) {
    let corner = wheel.abbreviation();
    for channel in StrainChannel::ALL {
        let field = channels.optional::<String>(channel.name(), collector);
        let field = channel.other_names().fold(field, |field, name| {
            or_named(&mut channels, name, field, collector)
        });
        let load = match is_bending(channel) {
            true => Dimension::Moment,
            false => Dimension::Force,
        };
        let wanted = Wanted {
            dimensions: &[
                Dimension::Counts,
                Dimension::Voltage,
                Dimension::BridgeRatio,
                Dimension::Strain,
                load,
            ],
            role: &|dimension, factor| {
                let signal = match dimension {
                    Dimension::Voltage => StrainSignal::Voltage,
                    Dimension::BridgeRatio => StrainSignal::BridgeRatio,
                    Dimension::Strain => StrainSignal::Strain,
                    Dimension::Force | Dimension::Moment => StrainSignal::Load,
                    _ => return Role::Strain(wheel, channel, StrainUnit::Counts),
                };
                Role::Strain(wheel, channel, StrainUnit::Of(signal, factor))
            },
        };
        let written = field
            .as_ref()
            .and_then(|field| field.name.rsplit('.').next());
        let name = written.unwrap_or(channel.name());
        let key = format!("strain.{corner}.{name}");
        let default = default_strain(corner, channel);
        finder.add(field, &key, Some(&default), collector, &wanted);
    }
    channels.finish(collector);
}

/// The field of a channel, or that of another name of it.
fn or_named(
    channels: &mut Section<'_>,
    name: &'static str,
    field: Option<Field<String>>,
    collector: &mut ErrorCollector<'_>,
) -> Option<Field<String>> {
    let other = channels.optional::<String>(name, collector);
    let (Some(field), Some(other)) = (&field, &other) else {
        return field.or(other);
    };
    collector.add(
        &other.span,
        &other.name,
        format!("{} is the same channel", field.name),
        "remove one of the two",
    );
    None
}

/// Whether a strain channel measures bending.
pub const fn is_bending(channel: StrainChannel) -> bool {
    matches!(
        channel,
        StrainChannel::LowerFrontBending | StrainChannel::LowerRearBending
    )
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

fn read_controls(
    section: &mut Section<'_>,
    finder: &mut Finder<'_>,
    collector: &mut ErrorCollector<'_>,
) {
    let mut add =
        |field, key: &str, default: Option<&str>, value: ControlValue, collector: &mut _| {
            let wanted = Wanted {
                dimensions: &[value.dimension()],
                role: &|_, factor| Role::Control(value, factor),
            };
            finder.add(field, key, default, collector, &wanted);
        };
    let mut hitch = section.section("hitch_force", collector);
    for (axis, name) in HubAccelerationSample::AXES.into_iter().enumerate() {
        let field = hitch.optional::<String>(name, collector);
        let (key, default) = (format!("hitch_force.{name}"), format!("Hitch.force_{name}"));
        let value = ControlValue::HitchForce(axis);
        add(field, &key, Some(&default), value, collector);
    }
    hitch.finish(collector);
    let of_wheels = |wheel| {
        [
            ("drive_torque", ControlValue::DriveTorque(wheel)),
            ("brake_torque", ControlValue::BrakeTorque(wheel)),
            ("brake_pressure", ControlValue::BrakePressure(wheel)),
            ("bridge_temperature", ControlValue::BridgeTemperature(wheel)),
            ("tyre_pressure", ControlValue::TyrePressure(wheel)),
        ]
    };
    for (number, (name, _)) in of_wheels(Wheel::FrontLeft).into_iter().enumerate() {
        let mut wheels = section.section(name, collector);
        for wheel in Wheel::ALL {
            let corner = wheel.abbreviation();
            let field = wheels.optional::<String>(corner, collector);
            let value = of_wheels(wheel)[number].1;
            let default = format!("TyrePressure.{corner}");
            let default = matches!(value, ControlValue::TyrePressure(_)).then_some(&*default);
            add(
                field,
                &format!("{name}.{corner}"),
                default,
                value,
                collector,
            );
        }
        wheels.finish(collector);
    }
    let others = [
        ("throttle", ControlValue::Throttle),
        ("engine_torque", ControlValue::EngineTorque),
    ];
    for (name, value) in others {
        let field = section.optional::<String>(name, collector);
        add(field, name, None, value, collector);
    }
}

/// Tables of quantities, with the names that they have in maps of columns.
const QUANTITIES: [(&str, &[&str]); 4] = [
    ("acceleration", &["x", "y", "z"]),
    ("rate", &["x", "y", "z"]),
    ("speed", &["forward", "leftward"]),
    (
        "gnss",
        &[
            "latitude",
            "longitude",
            "height",
            "velocity_east",
            "velocity_north",
            "velocity_up",
            "speed",
            "course",
            "heading",
            "yaw",
            "pitch",
            "roll",
        ],
    ),
];

fn read_quantities(
    section: &mut Section<'_>,
    finder: &mut Finder<'_>,
    collector: &mut ErrorCollector<'_>,
) {
    for (table, names) in QUANTITIES {
        let mut table_section = section.section(table, collector);
        for name in names {
            let key = format!("{table}.{name}");
            let quantity = Quantity::from_name(&key).expect("each name is of a quantity");
            let field = table_section.optional::<String>(name, collector);
            let wanted = Wanted {
                dimensions: &[quantity.dimension()],
                role: &|_, factor| Role::Quantity(quantity, factor),
            };
            finder.add(field, &key, None, collector, &wanted);
        }
        if table == "gnss" {
            let field = table_section.optional::<String>("fix", collector);
            let wanted = Wanted {
                dimensions: &[Dimension::Counts],
                role: &|_, _| Role::Fix,
            };
            finder.add(field, "gnss.fix", None, collector, &wanted);
        }
        table_section.finish(collector);
    }
    refuse_halves(finder, collector);
}

/// Refuses quantities that make no measurement alone, such as a course without a speed.
fn refuse_halves(finder: &Finder<'_>, collector: &mut ErrorCollector<'_>) {
    let of = |role: &Role| match role {
        Role::Quantity(quantity, _) => Some(*quantity),
        _ => None,
    };
    let known: Vec<Quantity> = finder
        .fields()
        .filter_map(|(role, _)| of(&role.role))
        .collect();
    for (role, (span, name)) in finder.fields() {
        let sets = of(&role.role).map(Quantity::needs).unwrap_or_default();
        let absent = |set: &Vec<Quantity>| -> Vec<String> {
            let absent = set.iter().filter(|needed| !known.contains(needed));
            absent.map(|needed| needed.name()).collect()
        };
        let nearest = sets.iter().map(absent).min_by_key(Vec::len);
        if let Some(nearest) = nearest.filter(|absent| !absent.is_empty()) {
            let problem = format!("makes no measurement without {}", nearest.join(" and "));
            collector.add(span, name, problem, "give those signals roles, too");
        }
    }
}

#[cfg(test)]
mod tests;
