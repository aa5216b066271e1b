use sample::{
    Estimate, Event, ForceFrame, Health, Limits, LogTime, Motion, Parameters, PerWheel, Road,
    Rollover, Sample, Severity, SourceId, Terrain, TyreForce,
};

use crate::Scene;

/// One decoded datum of a log. It is read as it was written, with these exceptions:
/// [`Record::Estimate`] and [`Record::Truth`] are read as their parts, and the sample of a corner as
/// its strain and its deflection. Minus zero is read as zero, except from an optional field; NaN keeps
/// its bits. Large variants are behind pointers, because records are moved often.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// A measurement.
    Sample(Sample),
    /// All that the estimator publishes at one instant.
    Estimate(Box<Estimate>),
    /// The truth of a simulation at one instant.
    Truth(Box<Truth>),
    /// Motion of the body: a part of an estimate or of the truth.
    Motion {
        /// The instant.
        time: LogTime,
        /// Origin of the motion.
        stage: Stage,
        /// The motion.
        motion: Box<Motion>,
    },
    /// Forces of the ground on the tyres: a part of an estimate or of the truth.
    TyreForces {
        /// The instant.
        time: LogTime,
        /// Origin of the forces.
        stage: Stage,
        /// Axes of the forces.
        frame: ForceFrame,
        /// The forces.
        forces: Box<PerWheel<TyreForce>>,
    },
    /// Rollover indicators: a part of an estimate.
    Rollover {
        /// The instant.
        time: LogTime,
        /// Load-transfer ratios and times to lift.
        rollover: Rollover,
    },
    /// The road under the wheels.
    Road {
        /// Origin: [`Stage::Estimate`] or [`Stage::Lagged`].
        stage: Stage,
        /// The road.
        road: Box<Road>,
    },
    /// What the vehicle can still do.
    Limits(Box<Limits>),
    /// The kind of ground.
    Terrain(Terrain),
    /// Friction coefficient of the ground under each wheel: a part of the truth.
    Friction {
        /// The instant.
        time: LogTime,
        /// The coefficients.
        coefficient: PerWheel<f64>,
    },
    /// The wheels on their ground: a part of the truth.
    Ground {
        /// The instant.
        time: LogTime,
        /// The ground.
        ground: Box<Ground>,
    },
    /// Pose of the vehicle in the local earth frame of the truth.
    Pose {
        /// The instant.
        time: LogTime,
        /// The pose.
        pose: Pose,
    },
    /// Parameters that the estimator finds.
    Parameters(Box<Parameters>),
    /// An event that the estimator or a source declares.
    Event(Event),
    /// State of the recorder.
    Health(Health),
    /// Mapping of a device clock to the log clock.
    ClockFit(ClockFit),
    /// UTC against the log clock.
    UtcOffset(UtcOffset),
    /// A mark set by a person or a program.
    Mark {
        /// When.
        time: LogTime,
        /// Its text.
        text: String,
    },
    /// A message for people.
    Log(LogMessage),
    /// Poses of frames in their parent frames, all at one instant.
    Transforms {
        /// The instant.
        time: LogTime,
        /// The poses.
        transforms: Vec<Transform>,
    },
    /// Change of a three-dimensional scene for viewers; [`crate::Reader`] does not read it back.
    Scene(Scene),
}

/// The truth of a simulation at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// The instant.
    pub time: LogTime,
    /// Motion of the body.
    pub motion: Motion,
    /// Forces of the ground on the tyres, wheel-carrier frame, if they are known.
    pub carrier: Option<PerWheel<TyreForce>>,
    /// Forces of the ground on the tyres, contact frame, if they are known.
    pub contact: Option<PerWheel<TyreForce>>,
    /// The wheels on their ground, if the simulation gives it.
    pub ground: Option<Ground>,
    /// Pose of the vehicle, if the simulation gives it.
    pub pose: Option<Pose>,
    /// Friction coefficient of the ground under each wheel, if the simulation gives it.
    pub friction: Option<PerWheel<f64>>,
}

/// Origin of a motion or a force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// The estimator, from measurements: `/estimate/…`.
    Estimate,
    /// The estimator in a replay with smoothing, from later measurements, too: `/smoothed/…`.
    Smoothed,
    /// The estimator with a fixed lag, from measurements of a short time after: `/lagged/…`.
    Lagged,
    /// The vehicle model, from steer angle and motion alone: `/model/…`.
    Model,
    /// The simulation: `/truth/…`.
    Truth,
}

impl Stage {
    /// All stages.
    const ALL: [Self; 5] = [
        Self::Estimate,
        Self::Smoothed,
        Self::Lagged,
        Self::Model,
        Self::Truth,
    ];

    /// First element of the topic.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Estimate => "estimate",
            Self::Smoothed => "smoothed",
            Self::Lagged => "lagged",
            Self::Model => "model",
            Self::Truth => "truth",
        }
    }

    /// The stage of a topic `/<stage>/…`.
    #[must_use]
    pub fn from_topic(topic: &str) -> Option<Self> {
        let first = topic.strip_prefix('/')?.split('/').next()?;
        Self::ALL.into_iter().find(|stage| stage.name() == first)
    }
}

/// Mapping of a device clock to the log clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockFit {
    /// The device.
    pub source: SourceId,
    /// Log clock of the fit.
    pub time: LogTime,
    /// Device time minus log clock at `time`, s, after the device's epoch is removed.
    pub offset_s: f64,
    /// Rate of the device's clock against the log clock, parts per million.
    pub drift_ppm: f64,
    /// Standard deviation of the residuals, s.
    pub residual_sigma_s: f64,
    /// Pairs in the fit.
    pub count: u64,
    /// Steps of the device's clock seen so far.
    pub steps: u64,
}

/// UTC against the log clock, from a receiver that sends date and time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UtcOffset {
    /// Log clock of the statement.
    pub time: LogTime,
    /// UTC minus log clock, ns.
    pub offset_ns: i64,
    /// Standard deviation of the offset, s.
    pub sigma_s: f64,
    /// The receiver.
    pub source: SourceId,
    /// GPS time minus UTC, s, where the receiver sent it.
    pub leap_seconds: Option<i32>,
}

impl UtcOffset {
    /// UTC of a log time, ns since 1970.
    #[must_use]
    pub fn utc_ns(&self, time: LogTime) -> i64 {
        let log_ns = i64::try_from(time.0).unwrap_or(i64::MAX);
        log_ns.saturating_add(self.offset_ns)
    }
}

/// A message for people, as on the recorder's standard error.
#[derive(Clone, Debug, PartialEq)]
pub struct LogMessage {
    /// When.
    pub time: LogTime,
    /// Severity.
    pub severity: Severity,
    /// Origin: a source, `store`, `estimator`.
    pub name: String,
    /// The text.
    pub text: String,
}

/// Pose of a child frame in its parent frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    /// Parent frame, such as `earth`.
    pub parent: String,
    /// Child frame, such as `vehicle`.
    pub child: String,
    /// Origin of the child in parent axes, m.
    pub translation_m: [f64; 3],
    /// Quaternion x, y, z, w that takes child axes to parent axes.
    pub rotation_xyzw: [f64; 4],
}

/// Position and attitude in a local east-north-up frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// East, north, up, m.
    pub position_enu_m: [f64; 3],
    /// From east, left positive, rad.
    pub yaw_rad: f64,
    /// Nose down positive, rad.
    pub pitch_rad: f64,
    /// Right side down positive, rad.
    pub roll_rad: f64,
}

/// The wheels of a simulation on their ground.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ground {
    /// Each wheel.
    pub wheels: PerWheel<WheelGround>,
    /// Class of the road by ISO 8608, `A` to `H`, where the simulation gives one.
    pub road_class: Option<String>,
}

/// One wheel on its ground. Vectors are in vehicle axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelGround {
    /// Normal of the ground at the contact, a unit vector; `NaN` where unknown.
    pub normal_body: [f64; 3],
    /// Spindle axis, a unit vector to the left; `NaN` where unknown.
    pub spindle_body: [f64; 3],
    /// Acceleration of the wheel centre against the earth, without gravity, m/s^2.
    pub centre_acceleration_m_s2: Option<[f64; 3]>,
    /// Mass times acceleration of the parts outboard of the arms and the tie rod, N.
    pub unsprung_inertia_n: Option<[f64; 3]>,
    /// Height of the ground below the wheel centre, m.
    pub ground_height_m: Option<f64>,
    /// Length of the strut between its mounts, m.
    pub strut_length_m: Option<f64>,
}

impl Default for WheelGround {
    fn default() -> Self {
        Self {
            normal_body: [f64::NAN; 3],
            spindle_body: [f64::NAN; 3],
            centre_acceleration_m_s2: None,
            unsprung_inertia_n: None,
            ground_height_m: None,
            strut_length_m: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Records are moved several times between the engine and the log.
    #[test]
    fn a_record_is_small() {
        assert!(size_of::<Record>() <= 176);
    }
}
