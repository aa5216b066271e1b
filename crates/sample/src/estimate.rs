use serde::{Deserialize, Serialize};

use crate::{
    Axle, InnovationKind, Innovations, LogTime, LossPlace, PerWheel, Side, SourceId, Wheel,
};

/// What the estimator publishes at one instant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Log clock of the instant that the estimate is for.
    pub time: LogTime,
    /// The vehicle's motion.
    pub motion: Motion,
    /// Tyre forces of the estimator's measurement path (strain, deflection, fusion), wheel-carrier
    /// frame.
    pub carrier: PerWheel<TyreForce>,
    /// The same in the contact frame.
    pub measured: PerWheel<TyreForce>,
    /// Tyre forces that the vehicle model expects from steer and motion alone, contact frame.
    pub expected: PerWheel<TyreForce>,
    /// How near the measured loads are to a wheel's lift and to tipping over.
    pub rollover: Rollover,
}

/// Motion of the body at its centre of gravity. A standard deviation of `NaN` means that the
/// method in use gives none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Forward velocity, body axes, m/s.
    pub velocity_x_m_s: f64,
    /// Leftward velocity, body axes, m/s.
    pub velocity_y_m_s: f64,
    /// Sideslip angle (ISO 8855): from the heading to the velocity, both in the horizontal plane,
    /// rad. Where the body rolls it differs slightly from atan2(v_y, v_x) of the body axes.
    pub sideslip_rad: f64,
    /// Standard deviation of the sideslip angle, rad.
    pub sideslip_sigma_rad: f64,
    /// Roll angle, right side down positive, rad.
    pub roll_rad: f64,
    /// Pitch angle, nose down positive, rad.
    pub pitch_rad: f64,
    /// Angular rate in body axes (roll, pitch, yaw), rad/s.
    pub rate_rad_s: [f64; 3],
    /// Acceleration of the centre of gravity in body axes without gravity, m/s^2.
    pub acceleration_m_s2: [f64; 3],
    /// Road-wheel steer angle, rad.
    pub steer_rad: PerWheel<f64>,
    /// Slip angle of each wheel: from its heading to its centre's velocity along the ground, rad.
    pub slip_angle_rad: PerWheel<f64>,
    /// Longitudinal slip of each wheel: rolling speed less speed of its centre along its heading, over the
    /// amount of the latter; `NaN` where unknown.
    pub longitudinal_slip: PerWheel<f64>,
    /// Its standard deviation.
    pub longitudinal_slip_sigma: PerWheel<f64>,
    /// Road bank without roughness, right side down positive, rad.
    pub bank_rad: f64,
    /// Road grade without roughness, nose down positive, rad.
    pub grade_rad: f64,
}

impl Motion {
    /// A motion of which nothing is known.
    pub const UNKNOWN: Self = Self {
        velocity_x_m_s: f64::NAN,
        velocity_y_m_s: f64::NAN,
        sideslip_rad: f64::NAN,
        sideslip_sigma_rad: f64::NAN,
        roll_rad: f64::NAN,
        pitch_rad: f64::NAN,
        rate_rad_s: [f64::NAN; 3],
        acceleration_m_s2: [f64::NAN; 3],
        steer_rad: PerWheel([f64::NAN; 4]),
        slip_angle_rad: PerWheel([f64::NAN; 4]),
        longitudinal_slip: PerWheel([f64::NAN; 4]),
        longitudinal_slip_sigma: PerWheel([f64::NAN; 4]),
        bank_rad: f64::NAN,
        grade_rad: f64::NAN,
    };
}

/// Axes in which tyre forces are given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceFrame {
    /// Contact frame: z is the normal of the ground at the contact, x the wheel heading and y left of
    /// it, both in the tangent plane of the ground.
    #[default]
    Contact,
    /// Wheel-carrier frame: y is the spindle axis, x = unit(y × z of the chassis), z = x × y.
    WheelCarrier,
}

impl ForceFrame {
    /// Its name: `contact` or `wheel_carrier`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Contact => "contact",
            Self::WheelCarrier => "wheel_carrier",
        }
    }
}

impl Estimate {
    /// Tyre forces of the measurement path in a frame.
    #[must_use]
    pub const fn forces(&self, frame: ForceFrame) -> &PerWheel<TyreForce> {
        match frame {
            ForceFrame::Contact => &self.measured,
            ForceFrame::WheelCarrier => &self.carrier,
        }
    }
}

/// What the ground exerts on one tyre, in the axes of a [`ForceFrame`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TyreForce {
    /// F_x, F_y, F_z in N; `NaN` where unknown.
    pub force_n: [f64; 3],
    /// Standard deviations in N; `NaN` where the method gives none.
    pub sigma_n: [f64; 3],
    /// Moment about the wheel centre, N m; `NaN` where unknown.
    pub moment_n_m: [f64; 3],
    /// Its standard deviations, N m.
    pub moment_sigma_n_m: [f64; 3],
    /// What the value rests on.
    pub source: ForceSource,
}

impl Default for TyreForce {
    fn default() -> Self {
        Self {
            force_n: [f64::NAN; 3],
            sigma_n: [f64::NAN; 3],
            moment_n_m: [f64::NAN; 3],
            moment_sigma_n_m: [f64::NAN; 3],
            source: ForceSource::None,
        }
    }
}

/// What a tyre force rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceSource {
    /// Nothing yet.
    #[default]
    None,
    /// Spring deflection alone.
    Deflection,
    /// Strain and deflection through the linkage's statics.
    Statics,
    /// All sensors in one filter.
    Fusion,
    /// The vehicle model alone.
    Model,
    /// Balances of the whole vehicle with its inertial unit, without sensors on the suspension.
    Inertial,
    /// The vehicle model with the friction that the drive has shown.
    ModelFound,
}

/// How near the vehicle is to lifting a wheel and to tipping over; `NaN` where loads are unknown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rollover {
    /// Load-transfer ratio of the vehicle: right less left over the sum of the loads, 1 where both
    /// left wheels are off the ground, -1 where both right ones are.
    pub load_transfer_ratio: f64,
    /// Its standard deviation.
    pub load_transfer_ratio_sigma: f64,
    /// Load-transfer ratio of the front and of the rear axle.
    pub axle_load_transfer_ratio: [f64; 2],
    /// Time until each wheel's load is gone at the rate at which it falls, s: zero where it is
    /// gone, infinite where it does not fall.
    pub time_to_lift_s: PerWheel<f64>,
    /// The same of both wheels of a side together, in the order of [`Side::ALL`], s.
    pub time_to_two_wheel_lift_s: [f64; 2],
}

impl Rollover {
    /// Time from which a lift is not announced, s. The time to a lift supposes that the load keeps
    /// falling at its present rate, which says nothing of a time so far ahead.
    pub const NEAR_S: f64 = 10.0;

    /// The wheel on the ground that lifts next, if it does so within [`Self::NEAR_S`].
    #[must_use]
    pub fn next_lift(&self) -> Option<NextLift> {
        let wheels = Wheel::ALL.into_iter();
        let times = wheels.map(|wheel| (wheel, self.time_to_lift_s[wheel]));
        let near = times.filter(|(_, time_s)| *time_s > 0.0 && *time_s <= Self::NEAR_S);
        let next = near.min_by(|a, b| a.1.total_cmp(&b.1));
        next.map(|(wheel, time_s)| NextLift { wheel, time_s })
    }
}

/// A wheel that is about to lift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NextLift {
    /// The wheel.
    pub wheel: Wheel,
    /// Time until its load is gone, s.
    pub time_s: f64,
}

impl Default for Rollover {
    fn default() -> Self {
        Self {
            load_transfer_ratio: f64::NAN,
            load_transfer_ratio_sigma: f64::NAN,
            axle_load_transfer_ratio: [f64::NAN; 2],
            time_to_lift_s: PerWheel([f64::NAN; 4]),
            time_to_two_wheel_lift_s: [f64::NAN; 2],
        }
    }
}

/// What the estimator finds of sensors, steering and tyres beside motion and forces, with standard
/// deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// Log clock of the instant that they are for.
    pub time: LogTime,
    /// Bias of the accelerometers beyond the calibration's, body axes, m/s^2.
    pub accel_bias_m_s2: [f64; 3],
    /// Its standard deviation, m/s^2.
    pub accel_bias_sigma_m_s2: [f64; 3],
    /// Bias of the gyros beyond the calibration's, body axes, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Its standard deviation, rad/s.
    pub gyro_bias_sigma_rad_s: [f64; 3],
    /// How much further left the front road wheels stand than the steering wheel's zero has it, rad.
    pub steer_offset_rad: f64,
    /// Its standard deviation, rad.
    pub steer_offset_sigma_rad: f64,
    /// Tyres of the front axle.
    pub front: AxleGrip,
    /// Tyres of the rear axle.
    pub rear: AxleGrip,
    /// Innovations since the last report, by [`InnovationKind::index`].
    pub innovations: [Innovations; InnovationKind::COUNT],
}

/// What the tyres of an axle have to do with the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxleGrip {
    /// Factor on the vehicle file's cornering stiffness.
    pub stiffness_factor: f64,
    /// Its standard deviation.
    pub stiffness_factor_sigma: f64,
    /// Friction coefficient; `None` where too little of it has been used of late to see it.
    pub friction: Option<f64>,
    /// Its standard deviation; `None` as the coefficient.
    pub friction_sigma: Option<f64>,
    /// What the coefficient is at least, with a probability of 0.98: the largest part of the load that
    /// was force along the ground of late, less three standard deviations.
    pub friction_min: f64,
    /// The largest part of the load that was lateral force of late, less two standard deviations,
    /// divided by the estimated friction coefficient. Without an estimate, it is divided by the
    /// coefficient of the vehicle file.
    pub utilisation: f64,
    /// Its standard deviation, by what is known of the friction.
    pub utilisation_sigma: f64,
}

/// Something that the estimator or a source declares.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Log clock of the declaration.
    pub time: LogTime,
    /// Log clock when it is judged to have happened, or to be going to happen.
    pub onset: LogTime,
    /// What it is.
    pub kind: EventKind,
    /// Probability in [0, 1], where the detector gives one.
    pub probability: Option<f64>,
    /// Load-transfer ratio of the vehicle at the declaration ([`Rollover::load_transfer_ratio`]),
    /// of lifts and their warnings.
    pub load_transfer_ratio: Option<f64>,
    /// Plain words for a person.
    pub text: String,
}

/// What an [`Event`] is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// A wheel's load is predicted to vanish within the lead time (s); infinite: it is light and does not fall.
    LiftWarning(Wheel, f64),
    /// A wheel left the ground.
    Lift(Wheel),
    /// A wheel touched the ground again.
    Touchdown(Wheel),
    /// The load of both wheels of a side is predicted to vanish within the lead time (s); infinite: it is
    /// light and does not fall.
    TwoWheelLiftWarning(Side, f64),
    /// Both wheels of a side left the ground.
    TwoWheelLift(Side),
    /// The surface under an axle changed: lateral force as a part of what the tyres as they were
    /// would give at the same slip angles and loads.
    SurfaceChange(Axle, f64),
    /// A sensor, by name, was found faulty and is left out.
    SensorFault(String),
    /// A sensor is used again.
    SensorRecovered(String),
    /// A mistake of the configuration, by what it concerns.
    Mistake(String),
    /// The readings contradict exact parameters, as errors of about this factor times the tolerances do.
    InexactParameters(f64),
    /// A filter diverged and was started anew.
    FilterReset,
    /// A filter that was started anew has settled.
    FilterRecovered,
}

impl EventKind {
    /// Names of all kinds.
    pub const NAMES: [&'static str; 12] = [
        "lift_warning",
        "lift",
        "touchdown",
        "two_wheel_lift_warning",
        "two_wheel_lift",
        "surface_change",
        "sensor_fault",
        "sensor_recovered",
        "filter_reset",
        "filter_recovered",
        "mistake",
        "inexact_parameters",
    ];

    /// The kind's name, one of [`EventKind::NAMES`].
    #[must_use]
    pub const fn name(&self) -> &'static str {
        Self::NAMES[match self {
            Self::LiftWarning(..) => 0,
            Self::Lift(_) => 1,
            Self::Touchdown(_) => 2,
            Self::TwoWheelLiftWarning(..) => 3,
            Self::TwoWheelLift(_) => 4,
            Self::SurfaceChange(..) => 5,
            Self::SensorFault(_) => 6,
            Self::SensorRecovered(_) => 7,
            Self::FilterReset => 8,
            Self::FilterRecovered => 9,
            Self::Mistake(_) => 10,
            Self::InexactParameters(_) => 11,
        }]
    }
}

/// How grave a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// A rare event of life.
    Info,
    /// Recovered, or to be looked at.
    Warning,
    /// Data lost or a person needed.
    Error,
}

/// The recorder's own state, at a regular interval.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Health {
    /// Log clock of the report.
    pub time: LogTime,
    /// Counters of each source.
    pub sources: Vec<SourceHealth>,
    /// Names of the sensors that the estimator has found faulty and leaves out.
    pub faulty_sensors: Vec<String>,
}

/// Counters of one source since the start; each only rises.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SourceHealth {
    /// Which source.
    pub source: SourceId,
    /// Its name in the configuration.
    pub name: String,
    /// Whether its device is open.
    pub open: bool,
    /// Whether it has been silent for longer than its configured limit.
    pub silent: bool,
    /// Bytes received.
    pub bytes: u64,
    /// Messages or frames decoded.
    pub messages: u64,
    /// Messages whose checksum was wrong.
    pub checksum_errors: u64,
    /// Bytes that belonged to no message.
    pub skipped_bytes: u64,
    /// Messages missing by the device's own counter.
    pub gaps: u64,
    /// Messages with a good checksum that could not be decoded.
    pub malformed: u64,
    /// Times the device was opened again after a failure.
    pub reopened: u64,
    /// Items lost, by place, in the order of [`LossPlace::ALL`].
    pub lost: [u64; LossPlace::ALL.len()],
    /// Messages that the decoder knows by name and does not decode.
    pub undecoded: Vec<MessageCount>,
    /// Messages or frames that came more than 5 ms late, and were used at their own time.
    pub late: u64,
    /// Messages or frames that came more than 100 ms late; the estimator does not use them.
    pub too_late: u64,
}

/// Number of messages of one name.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MessageCount {
    /// Name in the maker's manual.
    pub name: String,
    /// How many came.
    pub count: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_lift_is_the_nearest_of_the_wheels_on_the_ground() {
        let next = |times| {
            let rollover = Rollover {
                time_to_lift_s: PerWheel(times),
                ..Rollover::default()
            };
            rollover.next_lift().map(|next| (next.wheel, next.time_s))
        };
        let far = Rollover::NEAR_S + 0.1;
        assert_eq!(next([0.0, far, 4.0, 2.5]), Some((Wheel::RearRight, 2.5)));
        assert_eq!(
            next([10.0, f64::NAN, far, f64::INFINITY]),
            Some((Wheel::FrontLeft, 10.0))
        );
        assert_eq!(next([0.0, f64::NAN, far, f64::INFINITY]), None);
    }
}
