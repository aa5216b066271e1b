//! What a report needs of a log, read in one pass.

use std::collections::BTreeMap;

use sample::{
    Event, ForceFrame, Health, LogTime, Measurement, Motion, Parameters, PerWheel, Rollover,
    Sample, TyreForce,
};
use store::{Attachment, ClockFit, LogMessage, Reader, Record, Selection, Stage, UtcOffset};

/// Topics that the report reads; raw bytes and DBC messages stay untouched.
const TOPICS: [&str; 10] = [
    "/estimate/*",
    "/model/*",
    "/truth/*",
    "/steer*",
    "/gnss/*",
    "/health",
    "/clock_fit/*",
    "/mark",
    "/log",
    "/wheel_speed*",
];

/// One drive.
pub struct Drive {
    /// Files and their sizes in bytes.
    pub files: Vec<(String, u64)>,
    /// What is missing from the log, in plain words.
    pub missing: Vec<String>,
    /// What was not estimated, and why.
    pub limits: Vec<String>,
    /// Run, version and other facts, by name.
    pub facts: Vec<(String, String)>,
    /// Files carried inside the log.
    pub attachments: Vec<Attachment>,
    /// Log clock of the first message.
    pub start: LogTime,
    /// UTC against the log clock, where a receiver sent the date.
    pub utc_offset: Option<UtcOffset>,
    /// Seconds from the first to the last message.
    pub duration_s: f64,
    /// Estimated motion.
    pub estimate: Series<Motion>,
    /// Measured forces.
    pub measured: Series<PerWheel<TyreForce>>,
    /// The model's expected forces.
    pub expected: Series<PerWheel<TyreForce>>,
    /// True motion, of a simulation.
    pub truth: Series<Motion>,
    /// True forces, of a simulation.
    pub truth_forces: Series<PerWheel<TyreForce>>,
    /// Load-transfer ratios and times to lift.
    pub rollover: Series<Rollover>,
    /// What the estimator has learnt, with the tyres' grip.
    pub learnt: Series<Parameters>,
    /// Steering-wheel angle, rad.
    pub steering_wheel_rad: Series<f64>,
    /// Horizontal speed of the GNSS antenna, m/s, by source.
    pub gnss_speed_m_s: BTreeMap<String, Series<f64>>,
    /// East and north of the first position, m, by source.
    pub track_m: BTreeMap<String, Vec<[f64; 2]>>,
    /// Declared events.
    pub events: Vec<Event>,
    /// Marks set by people.
    pub marks: Vec<(LogTime, String)>,
    /// Messages for people.
    pub messages: Vec<LogMessage>,
    /// The last state of the recorder.
    pub health: Option<Health>,
    /// The last clock fit of each device.
    pub clocks: BTreeMap<String, ClockFit>,
}

/// Values in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Series<T> {
    /// Seconds since the drive's start.
    pub time_s: Vec<f64>,
    /// The value at each time.
    pub values: Vec<T>,
}

impl<T> Default for Series<T> {
    fn default() -> Self {
        Self {
            time_s: Vec::new(),
            values: Vec::new(),
        }
    }
}

impl<T> Series<T> {
    /// Number of values.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// One number of each value.
    pub fn map(&self, mut number: impl FnMut(&T) -> f64) -> Vec<f64> {
        self.values.iter().map(&mut number).collect()
    }

    fn push(&mut self, time_s: f64, value: T) {
        self.time_s.push(time_s);
        self.values.push(value);
    }
}

impl Drive {
    /// Reads a drive.
    pub fn read(reader: &Reader) -> store::Result<Self> {
        let mut info = reader.info();
        info.missing.extend(reader.changed()?);
        let (start, end) = info.span.unwrap_or_default();
        let session = reader.session();
        let utc_offset = reader.utc_offset()?;
        let mut drive = Self {
            files: info
                .files
                .iter()
                .map(|(path, bytes)| (path.display().to_string(), *bytes))
                .collect(),
            limits: Vec::new(),
            missing: info.missing.iter().map(ToString::to_string).collect(),
            facts: vec![
                ("Run".into(), session.run_id.clone()),
                (
                    "Recorded by".into(),
                    format!("atvrec {} {}", session.version, session.git_hash),
                ),
                (
                    "Clock".into(),
                    session.clock_statement(utc_offset).unwrap_or_default(),
                ),
                ("Host".into(), session.host.clone()),
                ("Boot".into(), session.boot_id.clone()),
            ],
            attachments: reader.attachments()?,
            start,
            utc_offset,
            duration_s: end.seconds_since(start),
            estimate: Series::default(),
            measured: Series::default(),
            expected: Series::default(),
            truth: Series::default(),
            truth_forces: Series::default(),
            rollover: Series::default(),
            learnt: Series::default(),
            steering_wheel_rad: Series::default(),
            gnss_speed_m_s: BTreeMap::new(),
            track_m: BTreeMap::new(),
            events: Vec::new(),
            marks: Vec::new(),
            messages: Vec::new(),
            health: None,
            clocks: BTreeMap::new(),
        };
        drive.facts.retain(|(_, value)| !value.trim().is_empty());
        let mut origins = BTreeMap::new();
        // The report has the contact frame. A reference instrument has the other frame alone.
        let is_shown = |stage: Stage, frame: ForceFrame| {
            let contact = format!("/{}/contact_forces", stage.name());
            frame == ForceFrame::Contact || !info.channels.contains_key(&contact)
        };
        for message in reader.messages(Selection::topics(TOPICS)) {
            if let Some(record) = message?.record()? {
                if let Record::TyreForces { stage, frame, .. } = &record
                    && !is_shown(*stage, *frame)
                {
                    continue;
                }
                drive.take(record, session, &mut origins);
            }
        }
        Ok(drive)
    }

    fn take(
        &mut self,
        record: Record,
        session: &store::Session,
        origins: &mut BTreeMap<String, [f64; 2]>,
    ) {
        let start = self.start;
        let seconds = |time: LogTime| time.seconds_since(start);
        match record {
            Record::Motion {
                time,
                stage: Stage::Estimate,
                motion,
            } => {
                self.estimate.push(seconds(time), motion);
            }
            Record::Motion {
                time,
                stage: Stage::Truth,
                motion,
            } => {
                self.truth.push(seconds(time), motion);
            }
            Record::TyreForces {
                time,
                stage,
                forces,
                ..
            } => {
                let series = match stage {
                    Stage::Estimate => &mut self.measured,
                    Stage::Model => &mut self.expected,
                    Stage::Truth => &mut self.truth_forces,
                    Stage::Smoothed | Stage::Lagged => return,
                };
                series.push(seconds(time), forces);
            }
            Record::Sample(sample) => {
                let name = session.source_name(sample.source);
                self.take_sample(&sample, name, origins);
            }
            Record::Event(event) => self.events.push(event),
            Record::Rollover { time, rollover } => self.rollover.push(seconds(time), rollover),
            Record::Parameters(parameters) => {
                self.learnt.push(seconds(parameters.time), parameters);
            }
            Record::Health(health) => self.health = Some(health),
            Record::ClockFit(fit) => {
                self.clocks.insert(session.source_name(fit.source), fit);
            }
            Record::Mark { time, text } => self.marks.push((time, text)),
            Record::Log(message) => self.messages.push(message),
            _ => {}
        }
    }

    fn take_sample(
        &mut self,
        sample: &Sample,
        name: String,
        origins: &mut BTreeMap<String, [f64; 2]>,
    ) {
        let time_s = sample.valid_time.seconds_since(self.start);
        match &sample.measurement {
            Measurement::Steer(steer) => self
                .steering_wheel_rad
                .push(time_s, steer.steering_wheel_rad),
            Measurement::GnssVelocity(velocity) if velocity.quality.is_solved() => {
                let [east, north, _] = velocity.velocity_enu_m_s;
                let series = self.gnss_speed_m_s.entry(name).or_default();
                series.push(time_s, math::hypot(east, north));
            }
            Measurement::GnssPosition(position) if position.quality.is_solved() => {
                let here = [position.longitude_rad, position.latitude_rad];
                let origin = *origins.entry(name.clone()).or_insert(here);
                self.track_m
                    .entry(name)
                    .or_default()
                    .push(local_m(origin, here));
            }
            _ => {}
        }
    }
}

/// East and north of `here` from `origin` (longitude, latitude in rad), m. The sphere of the WGS 84
/// mean radius is good to 0.5 % of the distance, which is enough for a picture.
fn local_m(origin: [f64; 2], here: [f64; 2]) -> [f64; 2] {
    const MEAN_RADIUS_M: f64 = 6_371_008.8;
    [
        (here[0] - origin[0]) * math::cos(origin[1]) * MEAN_RADIUS_M,
        (here[1] - origin[1]) * MEAN_RADIUS_M,
    ]
}
