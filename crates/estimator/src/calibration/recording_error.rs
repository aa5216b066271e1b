//! Why recordings do not serve a step of the calibration.

use sample::Wheel;

/// Why recordings do not serve a step of the calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// A step was given no recording.
    #[error("no log is given")]
    None,
    /// A step takes one recording.
    #[error("the step {step} needs one log, but {} were given: {logs:?}", .logs.len())]
    NotOne {
        /// The step.
        step: &'static str,
        /// The logs that it was given.
        logs: Vec<String>,
    },
    /// Recordings of different vehicles or sensors.
    #[error(
        "{log} is a log of vehicle \"{}\" with sensors \"{}\", but {first} is a log of vehicle \
         \"{}\" with sensors \"{}\"; give logs of one vehicle",
        .found[0], .found[1], .expected[0], .expected[1]
    )]
    OtherVehicle {
        /// The recording that differs.
        log: String,
        /// Names of its vehicle and sensors.
        found: Box<[String; 2]>,
        /// The first recording.
        first: String,
        /// Names of its vehicle and sensors.
        expected: Box<[String; 2]>,
    },
    /// A channel that the step needs was not recorded.
    #[error("{log}: the log has no {channel}; record it in the same log")]
    Missing {
        /// The recording.
        log: String,
        /// The channel.
        channel: &'static str,
    },
    /// No receiver measures attitude.
    #[error(
        "{log}: the log has no GNSS attitude, so that the heading is unknown; record the attitude \
         receiver in the same drive"
    )]
    NoAttitude {
        /// The recording.
        log: String,
    },
    /// No receiver measures velocity.
    #[error("{log}: the log has no GNSS velocity; record a receiver with velocity")]
    NoVelocity {
        /// The recording.
        log: String,
    },
    /// The vehicle is never at rest.
    #[error(
        "{log}: the vehicle is never at rest for 2 s; do not touch it while it is on the scales"
    )]
    NeverAtRest {
        /// The recording.
        log: String,
    },
    /// The vehicle is never at rest on its stands.
    #[error(
        "{log}: there is no time of 2 s in which all potentiometers and wheels are at rest; put \
         the vehicle on stands and do not touch it for 10 s"
    )]
    NeverHanging {
        /// The recording.
        log: String,
    },
    /// No deflection after a mark.
    #[error("{log}: no deflection of {wheel} at {time_s:.1} s; check the potentiometer")]
    NoDeflection {
        /// The recording.
        log: String,
        /// The corner.
        wheel: Wheel,
        /// Time of the mark, s since the begin of the log.
        time_s: f64,
    },
    /// No angle of the steering wheel after a mark.
    #[error("{log}: no steering-wheel angle at {time_s:.1} s; check its sensor")]
    NoSteer {
        /// The recording.
        log: String,
        /// Time of the mark, s since the begin of the log.
        time_s: f64,
    },
    /// The vehicle moves in a recording that needs rest.
    #[error(
        "{log}: the vehicle moves: {what} {value:.3} {unit}; leave it at rest for the whole log, on stands or with a constant load"
    )]
    Moves {
        /// The recording.
        log: String,
        /// What moves.
        what: &'static str,
        /// Largest value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// A mark cannot be read.
    #[error("{log}: the mark \"{text}\" at {time_s:.1} s: {problem}")]
    Mark {
        /// The recording.
        log: String,
        /// The mark's text.
        text: String,
        /// Its time, s since the begin of the log.
        time_s: f64,
        /// What is wrong with it.
        problem: ReadingProblem,
    },
    /// A reading of the scales cannot be read.
    #[error(transparent)]
    Scales(#[from] ReadingProblem),
    /// The readings of the scales are not one for each recording.
    #[error(
        "there are {logs} logs, but --scales is given {scales} times; give it once for each log, in \
         the order of the logs"
    )]
    ScalesOfEach {
        /// Recordings.
        logs: usize,
        /// Readings.
        scales: usize,
    },
}

impl RecordingError {
    /// Whether what a person wrote is wrong: a mark or a reading.
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Mark { .. } | Self::Scales(_) | Self::ScalesOfEach { .. }
        )
    }
}

/// What is wrong with a reading that a person wrote.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadingProblem {
    /// Part of it is no number.
    #[error("\"{0}\" is not a number")]
    NotANumber(String),
    /// It has too many or too few numbers.
    #[error("there are {found} numbers, but {needed} are needed")]
    Count {
        /// Numbers that it has.
        found: usize,
        /// Numbers that it needs.
        needed: usize,
    },
    /// It does not begin with a wheel.
    #[error("\"{0}\" is not a wheel; use FL, FR, RL or RR")]
    NotAWheel(String),
}
