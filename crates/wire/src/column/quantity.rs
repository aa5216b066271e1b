//! What the columns of a table hold, and in which units.

use sample::{StrainChannel, Wheel};

use crate::unit::Dimension;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Specific force along an axis of the inertial unit.
    Acceleration(usize),
    /// Angular rate about an axis of the inertial unit.
    Rate(usize),
    /// Steering-wheel angle, left positive.
    Steer,
    /// Angular speed of a wheel, forward positive.
    WheelSpeed(Wheel),
    /// Velocity over ground, forwards.
    ForwardSpeed,
    /// Velocity over ground, leftwards.
    LeftwardSpeed,
    /// Geodetic latitude.
    Latitude,
    /// Longitude.
    Longitude,
    /// Height above the ellipsoid.
    Height,
    /// Velocity east, north or up of the GNSS antenna.
    Velocity(usize),
    /// Earth-centred, earth-fixed coordinate x, y or z of the GNSS antenna.
    EcefPosition(usize),
    /// Velocity of the GNSS antenna along an earth-centred, earth-fixed axis; with the position it
    /// makes a velocity east, north and up.
    EcefVelocity(usize),
    /// Horizontal speed of the GNSS antenna; with the course it makes a velocity.
    GroundTrackSpeed,
    /// Course over ground, clockwise from north.
    Course,
    /// Heading, clockwise from north.
    Heading,
    /// Yaw from east, left positive.
    Yaw,
    /// Pitch, nose down positive.
    Pitch,
    /// Roll, right side down positive.
    Roll,
    /// Counts of a spring potentiometer.
    Deflection(Wheel),
    /// Counts of a strain channel.
    Strain(Wheel, StrainChannel),
    /// What a reference instrument measured: no decoder hands it on.
    Truth(Truth),
    /// Any other value, kept under its name.
    Signal,
}

/// A quantity of a reference instrument.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Truth {
    /// Sideslip angle, ISO 8855.
    Sideslip,
    /// Forward velocity of the centre of gravity.
    ForwardSpeed,
    /// Leftward velocity of the centre of gravity.
    LeftwardSpeed,
    /// Yaw rate.
    YawRate,
    /// Roll angle, right side down positive.
    Roll,
    /// Pitch angle, nose down positive.
    Pitch,
    /// Force of the ground on a tyre along x, y or z of its contact frame.
    Force(Wheel, usize),
}

const AXES: [&str; 3] = ["x", "y", "z"];
const EARTH: [&str; 3] = ["east", "north", "up"];

impl Quantity {
    /// The quantity with this name in a column map.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|quantity| quantity.name() == name)
    }

    /// Every quantity.
    pub fn all() -> impl Iterator<Item = Self> {
        let axes = |make: fn(usize) -> Self| (0..3).map(make);
        let wheels = |make: fn(Wheel) -> Self| Wheel::ALL.into_iter().map(make);
        let strain = Wheel::ALL
            .into_iter()
            .flat_map(|wheel| StrainChannel::ALL.map(|channel| Self::Strain(wheel, channel)));
        let forces = Wheel::ALL
            .into_iter()
            .flat_map(|wheel| [0, 1, 2].map(|axis| Self::Truth(Truth::Force(wheel, axis))));
        let truths = [
            Truth::Sideslip,
            Truth::ForwardSpeed,
            Truth::LeftwardSpeed,
            Truth::YawRate,
            Truth::Roll,
            Truth::Pitch,
        ];
        [Self::Steer, Self::ForwardSpeed, Self::LeftwardSpeed]
            .into_iter()
            .chain(axes(Self::Acceleration))
            .chain(axes(Self::Rate))
            .chain(wheels(Self::WheelSpeed))
            .chain([Self::Latitude, Self::Longitude, Self::Height])
            .chain(axes(Self::Velocity))
            .chain(axes(Self::EcefPosition))
            .chain(axes(Self::EcefVelocity))
            .chain([Self::GroundTrackSpeed, Self::Course, Self::Heading])
            .chain([Self::Yaw, Self::Pitch, Self::Roll])
            .chain(wheels(Self::Deflection))
            .chain(strain)
            .chain(truths.map(Self::Truth))
            .chain(forces)
            .chain([Self::Signal])
    }

    /// Name in a column map.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Acceleration(axis) => format!("acceleration.{}", AXES[axis]),
            Self::Rate(axis) => format!("rate.{}", AXES[axis]),
            Self::Steer => "steer".to_owned(),
            Self::WheelSpeed(wheel) => format!("wheel_speed.{}", wheel.abbreviation()),
            Self::ForwardSpeed => "speed.forward".to_owned(),
            Self::LeftwardSpeed => "speed.leftward".to_owned(),
            Self::Latitude => "gnss.latitude".to_owned(),
            Self::Longitude => "gnss.longitude".to_owned(),
            Self::Height => "gnss.height".to_owned(),
            Self::Velocity(axis) => format!("gnss.velocity_{}", EARTH[axis]),
            Self::EcefPosition(axis) => format!("gnss.ecef_{}", AXES[axis]),
            Self::EcefVelocity(axis) => format!("gnss.ecef_velocity_{}", AXES[axis]),
            Self::GroundTrackSpeed => "gnss.speed".to_owned(),
            Self::Course => "gnss.course".to_owned(),
            Self::Heading => "gnss.heading".to_owned(),
            Self::Yaw => "gnss.yaw".to_owned(),
            Self::Pitch => "gnss.pitch".to_owned(),
            Self::Roll => "gnss.roll".to_owned(),
            Self::Deflection(wheel) => format!("deflection.{}", wheel.abbreviation()),
            Self::Strain(wheel, channel) => {
                format!("strain.{}.{}", wheel.abbreviation(), channel.name())
            }
            Self::Truth(truth) => format!("truth.{}", truth.name()),
            Self::Signal => "signal".to_owned(),
        }
    }

    /// Quantities of which a measurement needs at least one set beside this one; empty if the quantity
    /// is a measurement alone.
    #[must_use]
    pub fn needs(self) -> Vec<Vec<Self>> {
        let position = vec![Self::Latitude, Self::Longitude];
        let level = vec![Self::Velocity(0), Self::Velocity(1)];
        let track = vec![Self::GroundTrackSpeed, Self::Course];
        let places = || (0..3).map(Self::EcefPosition);
        match self {
            Self::Latitude | Self::Longitude => vec![position],
            Self::Height => vec![position],
            Self::Velocity(0 | 1) => vec![level],
            Self::Velocity(_) => vec![level, track],
            Self::GroundTrackSpeed | Self::Course => vec![track],
            Self::EcefPosition(_) => vec![places().collect()],
            Self::EcefVelocity(_) => {
                vec![(0..3).map(Self::EcefVelocity).chain(places()).collect()]
            }
            Self::LeftwardSpeed => vec![vec![Self::ForwardSpeed]],
            _ => Vec::new(),
        }
    }

    /// What kind of unit it has.
    #[must_use]
    pub const fn dimension(self) -> Dimension {
        match self {
            Self::Acceleration(_) => Dimension::Acceleration,
            Self::Rate(_) | Self::WheelSpeed(_) | Self::Truth(Truth::YawRate) => {
                Dimension::AngularRate
            }
            Self::ForwardSpeed
            | Self::LeftwardSpeed
            | Self::Velocity(_)
            | Self::EcefVelocity(_)
            | Self::GroundTrackSpeed
            | Self::Truth(Truth::ForwardSpeed | Truth::LeftwardSpeed) => Dimension::Speed,
            Self::Height | Self::EcefPosition(_) => Dimension::Length,
            Self::Steer
            | Self::Latitude
            | Self::Longitude
            | Self::Course
            | Self::Heading
            | Self::Yaw
            | Self::Pitch
            | Self::Roll
            | Self::Truth(Truth::Sideslip | Truth::Roll | Truth::Pitch) => Dimension::Angle,
            Self::Truth(Truth::Force(..)) => Dimension::Force,
            Self::Deflection(_) | Self::Strain(..) => Dimension::Counts,
            Self::Signal => Dimension::Free,
        }
    }
}

impl Truth {
    fn name(self) -> String {
        match self {
            Self::Sideslip => "sideslip".to_owned(),
            Self::ForwardSpeed => "speed_forward".to_owned(),
            Self::LeftwardSpeed => "speed_leftward".to_owned(),
            Self::YawRate => "yaw_rate".to_owned(),
            Self::Roll => "roll".to_owned(),
            Self::Pitch => "pitch".to_owned(),
            Self::Force(wheel, axis) => format!("force_{}.{}", AXES[axis], wheel.abbreviation()),
        }
    }
}
