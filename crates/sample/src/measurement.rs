use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::{LogTime, PerWheel, SourceId, Wheel};

/// One measurement with its stamps.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The device it came from.
    pub source: SourceId,
    /// Log clock when the last byte of the message arrived.
    pub log_time: LogTime,
    /// Log clock when the measured thing was true: device time mapped to the log clock where the
    /// mapping is known, with the message's latency removed; else `log_time`.
    pub valid_time: LogTime,
    /// The device's own time, as sent.
    pub device_time: Option<DeviceTime>,
    /// What was measured.
    pub measurement: Measurement,
}

/// A device's own time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum DeviceTime {
    /// GPS week (unrolled) and time of week in seconds.
    Gps {
        /// Weeks since 1980-01-06; `None` when the message carries the time of week alone.
        week: Option<u16>,
        /// Seconds since Sunday midnight, GPS time.
        time_of_week_s: f64,
    },
    /// UTC time of day in seconds (NMEA).
    UtcTimeOfDay(f64),
    /// A free-running message counter and its modulus.
    Counter {
        /// Value in the message.
        value: u32,
        /// The counter runs from 0 to `modulus - 1`.
        modulus: u32,
    },
    /// Nanoseconds of an adapter's own clock.
    AdapterNanos(i64),
}

/// What a [`Sample`] measured. SI units, the frames of the crate's documentation; sensor frames
/// where the member says so.
#[derive(Clone, Debug, PartialEq)]
pub enum Measurement {
    /// Inertial unit, sensor frame.
    Imu(ImuSample),
    /// GNSS position of the antenna.
    GnssPosition(GnssPosition),
    /// GNSS velocity of the antenna.
    GnssVelocity(GnssVelocity),
    /// Multi-antenna attitude.
    GnssAttitude(GnssAttitude),
    /// Strain and deflection counts of one corner; a message may carry some of them only.
    Corner(CornerSample),
    /// Steering wheel.
    Steer(SteerSample),
    /// Wheel speeds.
    WheelSpeed(WheelSpeedSample),
    /// Velocity over ground.
    GroundSpeed(GroundSpeedSample),
    /// Throttle, brake and other controllers.
    Control(ControlSample),
    /// A CAN message decoded through a DBC.
    Signals(SignalFrame),
    /// The vehicle's attitude from a device that integrates its own (not measured by GNSS).
    Attitude(Attitude),
    /// Accelerometer on the upright of one wheel; a message may carry some of its axes only.
    HubAcceleration(HubAccelerationSample),
}

/// Specific force and angular rate in the sensor's own axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImuSample {
    /// Specific force, m/s^2.
    pub specific_force_m_s2: [f64; 3],
    /// Angular rate, rad/s.
    pub angular_rate_rad_s: [f64; 3],
    /// Board temperature, degrees Celsius, where sent.
    pub temperature_c: Option<f64>,
    /// Interval that the values are averaged over, s (delta-velocity messages); 0 for samples.
    pub interval_s: f64,
    /// The device's status word, as sent.
    pub status: u16,
    /// Whether the device calls the sample good.
    pub valid: bool,
}

/// How good a GNSS solution is, in the receivers' common terms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FixQuality {
    /// No solution: values must not be used.
    #[default]
    None,
    /// Code solution of one receiver.
    Single,
    /// Code-differential or SBAS solution.
    Differential,
    /// Carrier solution with float ambiguities.
    Float,
    /// Carrier solution with fixed ambiguities.
    Fixed,
    /// Propagated by inertial sensors.
    DeadReckoning,
}

impl FixQuality {
    /// Whether there is a solution at all.
    #[must_use]
    pub const fn is_solved(self) -> bool {
        !matches!(self, Self::None)
    }

    /// Whether satellites measured it: what a receiver's own inertial sensors propagate is no news
    /// beside an inertial unit.
    #[must_use]
    pub const fn is_measured(self) -> bool {
        self.is_solved() && !matches!(self, Self::DeadReckoning)
    }
}

/// Antenna position, WGS 84.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GnssPosition {
    /// Quality of the solution.
    pub quality: FixQuality,
    /// Geodetic latitude, rad; NaN where not sent.
    pub latitude_rad: f64,
    /// Longitude, rad; NaN where not sent.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m; NaN where not sent.
    pub height_m: f64,
    /// Standard deviations east, north, up in m, where sent.
    pub sigma_enu_m: Option<[f64; 3]>,
    /// Satellites in the solution, where sent.
    pub satellites: Option<u8>,
}

/// Antenna velocity, earth axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GnssVelocity {
    /// Quality of the solution.
    pub quality: FixQuality,
    /// Velocity east, north, up, m/s; NaN where not sent.
    pub velocity_enu_m_s: [f64; 3],
    /// Standard deviations east, north, up in m/s, where sent.
    pub sigma_enu_m_s: Option<[f64; 3]>,
    /// Latency from the record's own field, s; `None` where the record has none.
    pub latency_s: Option<f64>,
}

impl GnssVelocity {
    /// The velocity of a vehicle on level ground, if the upward velocity was not sent: it is zero then.
    #[must_use]
    pub fn on_the_level_m_s(&self) -> [f64; 3] {
        let [east, north, up] = self.velocity_enu_m_s;
        [east, north, if up.is_nan() { 0.0 } else { up }]
    }
}

/// Attitude from several antennas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GnssAttitude {
    /// Quality of the solution.
    pub quality: FixQuality,
    /// Yaw angle from east, left positive, rad (that is pi/2 minus the receiver's heading).
    pub yaw_rad: Option<f64>,
    /// Pitch, nose down positive, rad.
    pub pitch_rad: Option<f64>,
    /// Roll, right side down positive, rad.
    pub roll_rad: Option<f64>,
    /// Standard deviations of yaw, pitch, roll in rad, where sent.
    pub sigma_rad: Option<[f64; 3]>,
}

/// Roll, pitch and yaw of the vehicle, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Attitude {
    /// Roll, right side down positive, rad.
    pub roll_rad: f64,
    /// Pitch, nose down positive, rad.
    pub pitch_rad: f64,
    /// Yaw from east, left positive, rad.
    pub yaw_rad: f64,
}

/// What carries a wheel, where strain channels do not measure the members of a double wishbone or five links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mounting {
    /// MacPherson strut.
    Strut,
    /// Trailing or semi-trailing arm on two bushings.
    TrailingArm,
    /// Solid axle.
    SolidAxle,
    /// Wheel-force transducer.
    Transducer,
}

/// Names of channels that measure something else than on a double wishbone.
const OTHER_NAMES: [(Mounting, StrainChannel, &str); 15] = {
    use Mounting::{SolidAxle, Strut, TrailingArm, Transducer};
    use StrainChannel::{
        LowerFront, LowerFrontBending, LowerRear, LowerRearBending, TieRod, UpperFront, UpperRear,
    };
    [
        (Strut, UpperFront, "strut_side_x"),
        (Strut, UpperRear, "strut_side_y"),
        (TrailingArm, UpperFront, "outer_bushing_x"),
        (TrailingArm, UpperRear, "outer_bushing_z"),
        (TrailingArm, LowerFront, "inner_bushing_x"),
        (TrailingArm, LowerRear, "inner_bushing_z"),
        (TrailingArm, TieRod, "bushing_axial"),
        (SolidAxle, UpperFront, "upper_link"),
        (SolidAxle, LowerFront, "lower_link"),
        (SolidAxle, TieRod, "panhard_rod"),
        (SolidAxle, LowerFrontBending, "tube_bending_x"),
        (SolidAxle, LowerRearBending, "tube_bending_z"),
        (Transducer, UpperFront, "force_x"),
        (Transducer, UpperRear, "force_y"),
        (Transducer, LowerFront, "force_z"),
    ]
};

/// The strain channels of one corner, in the order of [`CornerSample::strain_counts`]. The comments have the members of
/// a double wishbone, and then what the channel measures elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StrainChannel {
    /// Axial, front tube of the upper arm. MacPherson strut: force of the body on the top of the strut
    /// forwards, by the bending of its tube. Trailing arm: force of the outer bushing, forwards. Solid axle: upper link.
    /// Wheel-force transducer: F_x.
    #[serde(
        alias = "strut_side_x",
        alias = "outer_bushing_x",
        alias = "upper_link",
        alias = "force_x"
    )]
    UpperFront,
    /// Axial, rear tube of the upper arm. MacPherson strut: force of the body on the top of the strut to
    /// the left, by the bending of its tube. Trailing arm: force of the outer bushing, upwards. Wheel-force transducer:
    /// F_y.
    #[serde(alias = "strut_side_y", alias = "outer_bushing_z", alias = "force_y")]
    UpperRear,
    /// Axial, front tube of the lower arm. Trailing arm: force of the inner bushing, forwards. Solid axle: lower link.
    /// Wheel-force transducer: F_z.
    #[serde(alias = "inner_bushing_x", alias = "lower_link", alias = "force_z")]
    LowerFront,
    /// Axial, rear tube of the lower arm. Trailing arm: force of the inner bushing, upwards.
    #[serde(alias = "inner_bushing_z")]
    LowerRear,
    /// Axial, steering tie rod (rear axle: toe link). Trailing arm: force of both bushings along their line. Solid axle,
    /// left wheel: Panhard rod.
    #[serde(alias = "bushing_axial", alias = "panhard_rod")]
    TieRod,
    /// Bending, front tube of the lower arm. Solid axle: bending of the tube about the x axis.
    #[serde(alias = "tube_bending_x")]
    LowerFrontBending,
    /// Bending, rear tube of the lower arm. Solid axle: bending of the tube about the z axis.
    #[serde(alias = "tube_bending_z")]
    LowerRearBending,
}

impl StrainChannel {
    /// All channels, in order.
    pub const ALL: [Self; 7] = [
        Self::UpperFront,
        Self::UpperRear,
        Self::LowerFront,
        Self::LowerRear,
        Self::TieRod,
        Self::LowerFrontBending,
        Self::LowerRearBending,
    ];

    /// Number of channels.
    pub const COUNT: usize = Self::ALL.len();

    /// Position in [`StrainChannel::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Name in files and topics, snake case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::UpperFront => "upper_front",
            Self::UpperRear => "upper_rear",
            Self::LowerFront => "lower_front",
            Self::LowerRear => "lower_rear",
            Self::TieRod => "tie_rod",
            Self::LowerFrontBending => "lower_front_bending",
            Self::LowerRearBending => "lower_rear_bending",
        }
    }

    /// Names of the channel beside [`StrainChannel::name`].
    pub fn other_names(self) -> impl Iterator<Item = &'static str> {
        let own = OTHER_NAMES.iter().filter(move |(_, of, _)| *of == self);
        own.map(|(_, _, name)| *name)
    }

    /// Name of the channel on what carries a wheel.
    #[must_use]
    pub fn name_on(self, mounting: Option<Mounting>) -> &'static str {
        let mut names = OTHER_NAMES.iter();
        let other = names.find(|(on, of, _)| Some(*on) == mounting && *of == self);
        other.map_or(self.name(), |(_, _, name)| *name)
    }

    /// The channel with one of its names.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        (Self::ALL.into_iter()).find(|of| of.name() == name || of.other_names().any(|n| n == name))
    }
}

/// A reading of a channel in counts of the chain that the sensors file describes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Counts {
    /// A count of the converter, as sent.
    Converter(i32),
    /// A value that was sent in another unit, converted to counts. It has no limits of a converter.
    Equivalent {
        /// Counts, not whole.
        counts: f64,
        /// Counts of one step of the value as sent; 0 for a floating-point number.
        step: f32,
    },
}

impl Counts {
    /// The counts as a number.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::Converter(counts) => f64::from(counts),
            Self::Equivalent { counts, .. } => counts,
        }
    }
}

impl From<i32> for Counts {
    fn from(counts: i32) -> Self {
        Self::Converter(counts)
    }
}

/// Counts of one corner; absent members were not in the message.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CornerSample {
    /// Which corner.
    pub wheel: Wheel,
    /// Strain counts, in the order of [`StrainChannel::ALL`].
    pub strain_counts: [Option<Counts>; StrainChannel::COUNT],
    /// Spring potentiometer counts.
    pub deflection_counts: Option<Counts>,
}

/// Specific force on the upright of one wheel, along the axes of its hub accelerometer.
///
/// The sensor is fixed to the upright (wheel carrier). Its nominal axes are the wheel-carrier axes of
/// the design position: y along the spindle to the left, x = unit(y × z of the chassis) forward,
/// z = x × y up, at both sides of the vehicle. The calibration has the bias of each axis and the
/// small turn from the carrier's to the sensor's axes. As of every accelerometer, the reading is
/// +g along the axis that points up, at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HubAccelerationSample {
    /// Which upright.
    pub wheel: Wheel,
    /// Specific force along the sensor's x, y and z axes with the nominal scale, before calibration,
    /// m/s^2. Absent: the axis was not in the message, or its converter is at an end of its range.
    pub specific_force_m_s2: [Option<f64>; 3],
    /// Converter counts of the axes, where the device sends counts.
    pub counts: [Option<i32>; 3],
}

impl HubAccelerationSample {
    /// Names of the axes in files and topics, in the order of the sample's members.
    pub const AXES: [&str; 3] = ["x", "y", "z"];

    /// A sample without any reading.
    #[must_use]
    pub const fn empty(wheel: Wheel) -> Self {
        Self {
            wheel,
            specific_force_m_s2: [None; 3],
            counts: [None; 3],
        }
    }
}

/// Steering-wheel angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SteerSample {
    /// Steering-wheel angle, left positive, rad.
    pub steering_wheel_rad: f64,
}

/// Wheel speeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WheelSpeedSample {
    /// Angular speed, forward positive, rad/s; absent members were not in the message.
    pub angular_speed_rad_s: PerWheel<Option<f64>>,
}

/// Velocity over ground in body axes at the centre of gravity: from an optical sensor, an inertial
/// navigation system, or the vehicle's own speed signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroundSpeedSample {
    /// Forwards, m/s.
    pub forward_m_s: f64,
    /// Leftwards, m/s; `None` where the device does not tell.
    pub leftward_m_s: Option<f64>,
}

/// What a controller reports, in its own terms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ControlSample {
    /// Named values in SI units.
    pub values: Vec<Signal>,
}

impl ControlSample {
    /// Names of the force of a load on the hitch: forward, left and up on the vehicle, N.
    pub const HITCH_FORCE: [&'static str; 3] = ["hitch_force_x", "hitch_force_y", "hitch_force_z"];

    /// Names of the steer angles of the front wheels, left and right.
    pub const WHEEL_ANGLE: [&'static str; 2] = ["wheel_angle_FL", "wheel_angle_FR"];

    /// Force of a load on the hitch, vehicle axes, N; an axis without a value is zero. `None` where no axis has a
    /// finite value in N.
    #[must_use]
    pub fn hitch_force_n(&self) -> Option<[f64; 3]> {
        let axis = |name: &str| {
            let mut all = self.values.iter();
            let found = all.find(|signal| &*signal.name == name && &*signal.unit == "N")?;
            found.value.is_finite().then_some(found.value)
        };
        let axes = Self::HITCH_FORCE.map(axis);
        axes.iter()
            .any(Option::is_some)
            .then(|| axes.map(Option::unwrap_or_default))
    }

    /// Temperature of the bridges of each wheel, degrees Celsius: values with the names `bridge_temperature_FL` and the
    /// unit degC. `NaN` where a wheel has no value; `None` where none has one.
    #[must_use]
    pub fn bridge_temperatures_c(&self) -> Option<[f64; 4]> {
        self.of_wheels("bridge_temperature_", "degC")
    }

    /// Inflation pressure of each wheel's tyre above that of the air, Pa: values with the names `tyre_pressure_FL` and
    /// the unit Pa. `NaN` where a wheel has no value; `None` where none has one.
    #[must_use]
    pub fn tyre_pressures_pa(&self) -> Option<[f64; 4]> {
        self.of_wheels("tyre_pressure_", "Pa")
    }

    /// Values of the wheels with a beginning of their names and a unit; `None` where no wheel has a finite one.
    fn of_wheels(&self, beginning: &str, wanted: &str) -> Option<[f64; 4]> {
        let mut found = [f64::NAN; 4];
        for Signal { name, value, unit } in &self.values {
            let corner = name.strip_prefix(beginning);
            let wheel = corner.and_then(Wheel::from_abbreviation);
            if let Some(wheel) = wheel.filter(|_| &**unit == wanted) {
                found[wheel.index()] = *value;
            }
        }
        found.iter().any(|value| value.is_finite()).then_some(found)
    }

    /// Steer angle of the left and the right front wheel against the chassis, left positive, rad: values with
    /// the names `wheel_angle_FL` and `wheel_angle_FR` and the unit rad. `NaN` where a wheel has no value; `None`
    /// where none has one.
    #[must_use]
    pub fn wheel_angles_rad(&self) -> Option<[f64; 2]> {
        let angles = Self::WHEEL_ANGLE.map(|wanted| {
            let mut all = self.values.iter();
            let found = all.find(|signal| &*signal.name == wanted && &*signal.unit == "rad");
            found.map_or(f64::NAN, |signal| signal.value)
        });
        let any = angles.iter().any(|angle| angle.is_finite());
        any.then_some(angles)
    }

    /// Drive and brake torque of each wheel about its spindle, N m: values with the names `drive_torque_FL` and
    /// `brake_torque_FL` and the unit N m or Nm. `NaN` where a wheel has no value; `None` where none has one.
    #[must_use]
    pub fn wheel_torques_n_m(&self) -> Option<[[f64; 4]; 2]> {
        let mut torques = [[f64::NAN; 4]; 2];
        for Signal { name, value, unit } in &self.values {
            let Some((kind, wheel)) = name.split_once("_torque_") else {
                continue;
            };
            let kind = ["drive", "brake"]
                .into_iter()
                .position(|known| known == kind);
            let wheel = (Wheel::ALL.into_iter())
                .find(|known| known.abbreviation().eq_ignore_ascii_case(wheel));
            if let (Some(kind), Some(wheel), "N m" | "Nm") = (kind, wheel, &**unit) {
                torques[kind][wheel.index()] = *value;
            }
        }
        let any = torques.iter().flatten().any(|torque| torque.is_finite());
        any.then_some(torques)
    }
}

/// One CAN message decoded through a DBC.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalFrame {
    /// Message name in the DBC; all frames of a message share it.
    pub message: Arc<str>,
    /// CAN identifier.
    pub id: u32,
    /// Signals present in this frame (multiplexed ones only where selected).
    pub signals: Vec<Signal>,
}

/// A named physical value.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Name, as in the DBC or the source's configuration; all values of a signal share it.
    pub name: Arc<str>,
    /// Physical value, in `unit`.
    pub value: f64,
    /// Unit, as in the DBC or the source's configuration.
    pub unit: Arc<str>,
}
