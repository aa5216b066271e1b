//! Columns of a table, whatever its format: which quantity each holds, in which unit, and the
//! measurements that a row of them makes.

use std::collections::BTreeMap;

use sample::{
    ControlSample, CornerSample, FixQuality, GnssAttitude, GnssPosition, GnssVelocity,
    GroundSpeedSample, ImuSample, Measurement, PerWheel, STANDARD_GRAVITY_M_S2, Signal,
    SteerSample, StrainChannel, Wheel, WheelSpeedSample,
};

use crate::WireError;

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

/// What kind of unit a quantity has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// m/s^2.
    Acceleration,
    /// rad/s.
    AngularRate,
    /// rad.
    Angle,
    /// m/s.
    Speed,
    /// m.
    Length,
    /// N.
    Force,
    /// Converter counts.
    Counts,
    /// Whatever the file says.
    Free,
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
            | Self::GroundTrackSpeed
            | Self::Truth(Truth::ForwardSpeed | Truth::LeftwardSpeed) => Dimension::Speed,
            Self::Height => Dimension::Length,
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

impl Dimension {
    /// Units by name, with the factor that takes them to SI.
    #[must_use]
    pub fn units(self) -> &'static [(&'static str, f64)] {
        const DEGREE: f64 = std::f64::consts::PI / 180.0;
        const TURN: f64 = std::f64::consts::TAU;
        match self {
            Self::Acceleration => &[("m/s^2", 1.0), ("m/s2", 1.0), ("g", STANDARD_GRAVITY_M_S2)],
            Self::AngularRate => &[
                ("rad/s", 1.0),
                ("deg/s", DEGREE),
                ("rpm", TURN / 60.0),
                ("rev/s", TURN),
            ],
            Self::Angle => &[("rad", 1.0), ("deg", DEGREE)],
            Self::Speed => &[
                ("m/s", 1.0),
                ("km/h", 1.0 / 3.6),
                ("mph", 0.447_04),
                ("kn", 1852.0 / 3600.0),
            ],
            Self::Length => &[("m", 1.0), ("mm", 1e-3), ("ft", 0.3048)],
            Self::Force => &[("N", 1.0), ("kN", 1000.0), ("lbf", 4.448_221_615_260_5)],
            Self::Counts => &[("counts", 1.0)],
            Self::Free => &[],
        }
    }

    /// Factor that takes `unit` to SI.
    #[must_use]
    pub fn factor(self, unit: &str) -> Option<f64> {
        if self == Self::Free {
            return Some(1.0);
        }
        let found = self.units().iter().find(|(name, _)| *name == unit);
        found.map(|(_, factor)| *factor)
    }
}

/// One column: value = (number * scale + offset) * factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name in the map; the name of a [`Quantity::Signal`].
    pub name: String,
    /// What it holds.
    pub quantity: Quantity,
    /// Unit of the file.
    pub unit: String,
    /// Takes the file's unit to SI.
    pub factor: f64,
    /// Applied to the number, in the file's unit.
    pub scale: f64,
    /// Added to it, in the file's unit.
    pub offset: f64,
    /// How long before the row's time the value was true, s.
    pub delay_s: f64,
}

impl Column {
    /// Whether the column gives finite values.
    ///
    /// # Errors
    /// [`WireError::Setting`] with the numbers that cannot work.
    pub fn check(&self) -> Result<(), WireError> {
        let numbers = [self.scale, self.offset, self.factor, self.delay_s];
        if numbers.iter().all(|value| value.is_finite()) && self.scale != 0.0 {
            return Ok(());
        }
        Err(WireError::Setting {
            what: "scale, offset or delay",
            got: format!("{numbers:?} in {}", self.name),
            expected: "finite numbers, scale not 0",
        })
    }

    /// The value of a number of the file, SI.
    #[must_use]
    pub fn value(&self, number: f64) -> f64 {
        (number * self.scale + self.offset) * self.factor
    }
}

/// The measurements of one row: pairs of delay in seconds and measurement, those of a longer delay
/// first. Columns without a value in this row are absent from `values`.
#[must_use]
pub fn measurements(values: &[(&Column, f64)]) -> Vec<(f64, Measurement)> {
    let mut groups: BTreeMap<u64, Row> = BTreeMap::new();
    for (column, value) in values {
        // Delays are not negative, so their bits sort as they do.
        groups
            .entry(column.delay_s.max(0.0).to_bits())
            .or_default()
            .take(column, *value);
    }
    let mut all = Vec::new();
    for (delay, row) in groups.into_iter().rev() {
        let delay_s = f64::from_bits(delay);
        all.extend(row.finish().into_iter().map(|m| (delay_s, m)));
    }
    all
}

/// What a row holds, by quantity.
#[derive(Default)]
struct Row {
    values: BTreeMap<Quantity, f64>,
    signals: Vec<Signal>,
}

impl Row {
    fn take(&mut self, column: &Column, value: f64) {
        match column.quantity {
            Quantity::Truth(_) => {}
            Quantity::Signal => self.signals.push(Signal {
                name: column.name.clone(),
                value,
                unit: column.unit.clone(),
            }),
            quantity => {
                self.values.insert(quantity, value);
            }
        }
    }

    fn get(&self, quantity: Quantity) -> Option<f64> {
        self.values.get(&quantity).copied()
    }

    fn axes(&self, quantity: fn(usize) -> Quantity) -> [Option<f64>; 3] {
        [0, 1, 2].map(|axis| self.get(quantity(axis)))
    }

    fn finish(self) -> Vec<Measurement> {
        let mut all: Vec<Measurement> = Vec::new();
        all.extend(self.imu());
        let steer = self.get(Quantity::Steer);
        all.extend(
            steer.map(|steering_wheel_rad| Measurement::Steer(SteerSample { steering_wheel_rad })),
        );
        let speeds = PerWheel::from_fn(|wheel| self.get(Quantity::WheelSpeed(wheel)));
        if speeds.0.iter().any(Option::is_some) {
            all.push(Measurement::WheelSpeed(WheelSpeedSample {
                angular_speed_rad_s: speeds,
            }));
        }
        if let Some(forward_m_s) = self.get(Quantity::ForwardSpeed) {
            all.push(Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s,
                leftward_m_s: self.get(Quantity::LeftwardSpeed),
            }));
        }
        all.extend(self.gnss());
        all.extend(
            Wheel::ALL
                .into_iter()
                .filter_map(|wheel| self.corner(wheel)),
        );
        if !self.signals.is_empty() {
            all.push(Measurement::Control(ControlSample {
                values: self.signals,
            }));
        }
        all
    }

    /// Axes that the file does not have are `NaN`.
    fn imu(&self) -> Option<Measurement> {
        let force = self.axes(Quantity::Acceleration);
        let rate = self.axes(Quantity::Rate);
        let any = force.iter().chain(&rate).any(Option::is_some);
        any.then(|| {
            Measurement::Imu(ImuSample {
                specific_force_m_s2: force.map(|value| value.unwrap_or(f64::NAN)),
                angular_rate_rad_s: rate.map(|value| value.unwrap_or(f64::NAN)),
                valid: true,
                ..ImuSample::default()
            })
        })
    }

    fn gnss(&self) -> Vec<Measurement> {
        let mut all = Vec::new();
        let quality = FixQuality::Single;
        if let (Some(latitude_rad), Some(longitude_rad)) =
            (self.get(Quantity::Latitude), self.get(Quantity::Longitude))
        {
            all.push(Measurement::GnssPosition(GnssPosition {
                quality,
                latitude_rad,
                longitude_rad,
                height_m: self.get(Quantity::Height).unwrap_or(f64::NAN),
                ..GnssPosition::default()
            }));
        }
        let [east, north, up] = self.axes(Quantity::Velocity);
        let (speed, course) = (
            self.get(Quantity::GroundTrackSpeed),
            self.get(Quantity::Course),
        );
        let level = east.zip(north).or_else(|| {
            let (speed, course) = speed.zip(course)?;
            Some((speed * math::sin(course), speed * math::cos(course)))
        });
        if let Some((east, north)) = level {
            all.push(Measurement::GnssVelocity(GnssVelocity {
                quality,
                velocity_enu_m_s: [east, north, up.unwrap_or(0.0)],
                ..GnssVelocity::default()
            }));
        }
        let heading = self.get(Quantity::Heading);
        let attitude = GnssAttitude {
            quality,
            yaw_rad: self
                .get(Quantity::Yaw)
                .or(heading.map(|heading| std::f64::consts::FRAC_PI_2 - heading)),
            pitch_rad: self.get(Quantity::Pitch),
            roll_rad: self.get(Quantity::Roll),
            sigma_rad: None,
        };
        let angles = [attitude.yaw_rad, attitude.pitch_rad, attitude.roll_rad];
        if angles.iter().any(Option::is_some) {
            all.push(Measurement::GnssAttitude(attitude));
        }
        all
    }

    fn corner(&self, wheel: Wheel) -> Option<Measurement> {
        let counts = |quantity| self.get(quantity).map(|value| value.round() as i32);
        let strain_counts = StrainChannel::ALL.map(|c| counts(Quantity::Strain(wheel, c)));
        let deflection_counts = counts(Quantity::Deflection(wheel));
        let any = deflection_counts.is_some() || strain_counts.iter().any(Option::is_some);
        any.then_some(Measurement::Corner(CornerSample {
            wheel,
            strain_counts,
            deflection_counts,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(quantity: &str, unit: &str, delay_s: f64) -> Column {
        let quantity = Quantity::from_name(quantity).expect("a known quantity");
        Column {
            name: quantity.name(),
            quantity,
            unit: unit.to_owned(),
            factor: quantity.dimension().factor(unit).expect("a known unit"),
            scale: 1.0,
            offset: 0.0,
            delay_s,
        }
    }

    #[test]
    fn names_are_one_to_one() {
        let names: Vec<String> = Quantity::all().map(Quantity::name).collect();
        let mut unique = names.clone();
        unique.sort();
        unique.dedup();
        assert_eq!(names.len(), unique.len());
        for quantity in Quantity::all() {
            assert_eq!(Quantity::from_name(&quantity.name()), Some(quantity));
        }
    }

    #[test]
    fn units_and_delays_make_measurements() {
        let yaw = column("rate.z", "deg/s", 0.0);
        let ay = column("acceleration.y", "g", 0.0);
        let speed = column("speed.forward", "km/h", 0.05);
        let row = [
            (&yaw, yaw.value(90.0)),
            (&ay, ay.value(1.0)),
            (&speed, speed.value(36.0)),
        ];
        let all = measurements(&row);
        assert_eq!(all.len(), 2);
        assert_eq!(all[0].0, 0.05);
        assert_eq!(
            all[0].1,
            Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s: 10.0,
                leftward_m_s: None
            })
        );
        let Measurement::Imu(imu) = &all[1].1 else {
            panic!("{all:?}");
        };
        assert!((imu.angular_rate_rad_s[2] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!((imu.specific_force_m_s2[1] - 9.806_65).abs() < 1e-12);
        assert!(imu.specific_force_m_s2[0].is_nan());
    }

    #[test]
    fn speed_and_course_are_a_velocity() {
        let speed = column("gnss.speed", "m/s", 0.0);
        let course = column("gnss.course", "deg", 0.0);
        let all = measurements(&[(&speed, 2.0), (&course, course.value(90.0))]);
        let Measurement::GnssVelocity(velocity) = &all[0].1 else {
            panic!("{all:?}");
        };
        let [east, north, up] = velocity.velocity_enu_m_s;
        assert!((east - 2.0).abs() < 1e-12 && north.abs() < 1e-12 && up == 0.0);
    }
}
