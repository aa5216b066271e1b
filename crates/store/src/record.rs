use sample::{
    Estimate, Event, ForceFrame, Health, LogTime, Motion, Parameters, PerWheel, Rollover, Sample,
    Severity, SourceId, TyreForce,
};

/// One decoded datum of a log. What is read back is what was written, with these exceptions:
/// [`Record::Estimate`] and [`Record::Truth`] come back as their parts, and a corner's sample as its
/// strain and its deflection. Minus zero comes back as zero, except from a field that may be absent;
/// NaN keeps its bits.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "a hundred estimates come each second; a box for each would be as many allocations"
)]
pub enum Record {
    /// A measurement.
    Sample(Sample),
    /// All that the estimator publishes at one instant.
    Estimate(Estimate),
    /// What the simulation knows to be true at one instant.
    Truth {
        /// The instant.
        time: LogTime,
        /// Motion of the body.
        motion: Motion,
        /// Axes of the forces.
        frame: ForceFrame,
        /// Forces of the ground on the tyres.
        forces: PerWheel<TyreForce>,
        /// Where the vehicle is, if the simulation says.
        pose: Option<Pose>,
        /// Friction coefficient of the ground under each wheel, if the simulation says.
        friction: Option<PerWheel<f64>>,
    },
    /// Motion of the body: a part of an estimate or of the truth.
    Motion {
        /// The instant.
        time: LogTime,
        /// Whose word it is.
        stage: Stage,
        /// The motion.
        motion: Motion,
    },
    /// Forces of the ground on the tyres: a part of an estimate or of the truth.
    TyreForces {
        /// The instant.
        time: LogTime,
        /// Where they come from.
        stage: Stage,
        /// Axes of the forces.
        frame: ForceFrame,
        /// The forces.
        forces: PerWheel<TyreForce>,
    },
    /// How near the vehicle is to tipping over: a part of an estimate.
    Rollover {
        /// The instant.
        time: LogTime,
        /// Load-transfer ratios and times to lift.
        rollover: Rollover,
    },
    /// Friction coefficient of the ground under each wheel: a part of the truth.
    Friction {
        /// The instant.
        time: LogTime,
        /// The coefficients.
        coefficient: PerWheel<f64>,
    },
    /// Where the vehicle is in the truth's local earth frame.
    Pose {
        /// The instant.
        time: LogTime,
        /// The pose.
        pose: Pose,
    },
    /// What the estimator finds beside motion and forces.
    Parameters(Parameters),
    /// Something that the estimator or a source declares.
    Event(Event),
    /// The recorder's own state.
    Health(Health),
    /// How a device's clock maps to the log clock.
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
    /// Where a child frame stands in its parent frame.
    Transform(Transform),
}

/// Whose word a motion or a force is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// The estimator's, from measurements: `/estimate/…`.
    Estimate,
    /// The estimator's in a replay that smooths, from what came after the instant too:
    /// `/smoothed/…`.
    Smoothed,
    /// The vehicle model's, from steer and motion alone: `/model/…`.
    Model,
    /// The simulation's: `/truth/…`.
    Truth,
}

impl Stage {
    /// First element of the topic.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Estimate => "estimate",
            Self::Smoothed => "smoothed",
            Self::Model => "model",
            Self::Truth => "truth",
        }
    }

    /// The stage of a topic `/<stage>/…`.
    #[must_use]
    pub fn from_topic(topic: &str) -> Option<Self> {
        let first = topic.strip_prefix('/')?.split('/').next()?;
        [Self::Estimate, Self::Smoothed, Self::Model, Self::Truth]
            .into_iter()
            .find(|stage| stage.name() == first)
    }
}

/// How a device's clock maps to the log clock.
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
    /// How grave.
    pub severity: Severity,
    /// Who says so: a source, `store`, `estimator`.
    pub name: String,
    /// The text.
    pub text: String,
}

/// Where a child frame stands in its parent frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    /// When.
    pub time: LogTime,
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
