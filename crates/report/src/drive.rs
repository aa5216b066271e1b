//! What a report needs of a log, read in one pass.

mod learnt;
mod sources;

use std::collections::BTreeMap;
use std::sync::Arc;

use sample::{Event, Health, Limits, LogTime, Terrain, TerrainClass};
use store::{Attachment, ClockFit, Info, LogMessage, Reader, Record, Selection, Tables, UtcOffset};

use crate::figures::WHEELS;
use crate::frame::{CommonInstants, Frame, Thinning};
use crate::options::Options;
use crate::{Error, Progress};
pub use learnt::{Grip, Learnt};
pub use sources::{SourceRates, TYRE_PRESSURE, local_m, place_of};

/// Topics whose messages are read one by one; they are few.
const RECORDS: [&str; 9] = [
    "/estimate/events",
    "/estimate/parameters",
    "/estimate/limits",
    "/estimate/terrain",
    "/health",
    "/mark",
    "/log",
    "/clock_fit/*",
    "/utc_offset",
];
/// Topics of sensors, whose values or times are drawn.
const SENSORS: [&str; 9] = [
    "/imu/",
    "/gnss/",
    "/strain",
    "/deflection",
    "/steer",
    "/wheel_speed",
    "/ground_speed",
    "/hub_acceleration",
    "/attitude",
];
/// Rows of a table that are in memory before they become columns.
const BATCH_ROWS: usize = 512;
/// Stretches of an envelope in which the samples of a source are counted: a second in a short drive.
const RATE_STRETCHES: f64 = 10.0;
/// One drive.
#[derive(Default)]
pub struct Drive {
    /// Files and their sizes in bytes.
    pub files: Vec<(String, u64)>,
    /// What was not estimated, and why.
    pub limits: Vec<String>,
    /// What is missing from the log, in plain words.
    pub missing: Vec<String>,
    /// Run, version and other facts, by name.
    pub facts: Vec<(String, String)>,
    /// Files carried inside the log.
    pub attachments: Vec<Attachment>,
    /// Log clock of the first message of the log.
    pub start: LogTime,
    /// Begin and end of what is shown, s from the start.
    pub span_s: [f64; 2],
    /// Which samples of the span are kept.
    pub thinning: Thinning,
    /// UTC against the log clock, where a receiver sent the date.
    pub utc_offset: Option<UtcOffset>,
    /// Topics of the estimates that are shown: `estimate` or `smoothed`.
    pub stage: &'static str,
    /// Estimated motion.
    pub motion: Frame,
    /// Estimated forces, and their frame.
    pub forces: Frame,
    /// `contact` or `wheel_carrier`.
    pub force_frame: &'static str,
    /// Forces that the vehicle model expects.
    pub model: Frame,
    /// True motion and forces, or those of a reference instrument.
    pub truth_motion: Frame,
    /// True forces in the frame of the estimated ones.
    pub truth_forces: Frame,
    /// Ground under the wheels, of a simulation.
    pub ground: Frame,
    /// Load-transfer ratios.
    pub rollover: Frame,
    /// Values of sensors by topic.
    pub sensors: BTreeMap<String, Frame>,
    /// Travel of the suspension by the column of each wheel.
    pub travel: BTreeMap<String, Frame>,
    /// Number of messages of the suspension's travel for each wheel, if all wheels have a potentiometer.
    travel_rows: usize,
    /// Longitude and latitude of the first position of each receiver, rad.
    origins: BTreeMap<String, Option<[f64; 2]>>,
    /// Rates and latencies of the sensors by topic.
    pub rates: BTreeMap<String, SourceRates>,
    /// What the estimator has found of sensors and tyres.
    pub learnt: Learnt,
    /// What the vehicle could still do: the limits that are drawn, with their seconds since the start.
    pub reachable: Vec<(f64, Limits)>,
    /// The kind of ground: what is drawn, with its seconds since the start.
    pub terrain: Vec<(f64, Terrain)>,
    /// Number of messages in which each class of ground is named.
    pub terrain_named: [usize; TerrainClass::COUNT],
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

/// Where the messages of a topic go.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sink {
    Motion,
    Forces,
    Model,
    TruthMotion,
    TruthForces,
    Ground,
    Rollover,
    Sensor,
    /// Values of controllers, of which the angles of the front wheels and the pressures of the tyres are drawn.
    Control,
}

impl Drive {
    /// Reads a drive.
    pub fn read(
        reader: &Reader,
        options: &Options,
        progress: &mut Progress<'_>,
    ) -> Result<Self, Error> {
        let info = reader.info();
        let mut drive = Self::of_info(reader, &info)?;
        drive.span_s = options.stretch().seconds(reader)?;
        drive.stage = drive.choose_stage(&info, options)?;
        let sinks = drive.sinks(&info);
        drive.expect_rows(&sinks, &info);
        let topics: Vec<&str> = sinks.iter().map(|(topic, _)| topic.as_str()).collect();
        let mut tables = Tables::new(reader, &topics)?;
        let all = topics.iter().copied().chain(RECORDS);
        let [from, to] = drive.span_s.map(|at_s| drive.start.offset_seconds(at_s));
        let mut messages = reader.messages(Selection::topics(all).between(from, to));
        let bytes: u64 = info.files.iter().map(|(_, bytes)| bytes).sum();
        let mut count = 0_u32;
        loop {
            count += 1;
            if count.is_multiple_of(1024) {
                progress(messages.bytes_done() as f64 / bytes.max(1) as f64)?;
            }
            let Some(message) = messages.next_ref() else {
                break;
            };
            let message = message?;
            if let Some(position) = tables.push(&message) {
                if tables.rows(position) >= BATCH_ROWS {
                    drive.take_table(&sinks[position], tables.take(position));
                }
                continue;
            }
            match message.record() {
                Ok(Some(record)) => drive.take_record(record, reader.session()),
                Ok(None) => {}
                // A malformed message costs itself alone.
                Err(error @ store::Error::BadMessage { .. }) => {
                    drive.missing.push(error.to_string());
                }
                Err(error) => return Err(error.into()),
            }
        }
        let damage = messages.missing().iter().map(ToString::to_string);
        let damage: Vec<String> = damage
            .filter(|text| !drive.missing.contains(text))
            .collect();
        drive.missing.extend(damage);
        for (position, sink) in sinks.iter().enumerate() {
            let table = tables.take(position);
            drive.take_table(sink, table);
        }
        drive.finish();
        Ok(drive)
    }

    fn of_info(reader: &Reader, info: &Info) -> Result<Self, Error> {
        let session = reader.session();
        let utc_offset = reader.utc_offset()?;
        let mut missing: Vec<String> = info.missing.iter().map(ToString::to_string).collect();
        missing.extend(reader.changed()?.iter().map(ToString::to_string));
        let mut facts = vec![
            ("Run", session.run_id.clone()),
            (
                "Recorded by",
                format!("atvrec {} {}", session.version, session.git_hash),
            ),
            (
                "Clock",
                session.clock_statement(utc_offset).unwrap_or_default(),
            ),
            ("Host", session.host.clone()),
            ("Boot", session.boot_id.clone()),
        ];
        if session.version.is_empty() {
            facts[1].1 = "another program".to_owned();
        }
        facts.retain(|(_, value)| !value.trim().is_empty());
        let files = info.files.iter();
        Ok(Self {
            files: files
                .map(|(path, bytes)| (path.display().to_string(), *bytes))
                .collect(),
            missing,
            facts: facts.into_iter().map(|(n, v)| (n.to_owned(), v)).collect(),
            attachments: reader.attachments()?,
            start: info.span.unwrap_or_default().0,
            utc_offset,
            ..Self::default()
        })
    }

    fn choose_stage(&self, info: &Info, options: &Options) -> Result<&'static str, Error> {
        match options.smoothed {
            true if !info.channels.contains_key("/smoothed/motion") => Err(Error::NotSmoothed),
            true => Ok("smoothed"),
            false => Ok("estimate"),
        }
    }

    /// The topics that become columns. The report has the contact frame; a reference instrument has
    /// the other frame alone.
    fn sinks(&mut self, info: &Info) -> Vec<(String, Sink)> {
        let has = |topic: &str| info.channels.contains_key(topic);
        let of_frame = |stage: &str, frame: &str| match frame {
            "contact" => format!("/{stage}/contact_forces"),
            _ => format!("/{stage}/tyre_forces"),
        };
        let both = ["contact", "wheel_carrier"];
        let found = both.into_iter().find(|frame| {
            has(&of_frame(self.stage, frame))
                && (!has("/truth/motion") || has(&of_frame("truth", frame)))
        });
        let frame = found
            .or_else(|| {
                both.into_iter()
                    .find(|frame| has(&of_frame(self.stage, frame)))
            })
            .or_else(|| {
                both.into_iter()
                    .find(|frame| has(&of_frame("truth", frame)))
            })
            .unwrap_or("contact");
        self.force_frame = frame;
        let mut sinks = vec![
            (format!("/{}/motion", self.stage), Sink::Motion),
            (of_frame(self.stage, frame), Sink::Forces),
            ("/model/tyre_forces".to_owned(), Sink::Model),
            ("/truth/motion".to_owned(), Sink::TruthMotion),
            (of_frame("truth", frame), Sink::TruthForces),
            ("/truth/ground".to_owned(), Sink::Ground),
            ("/estimate/rollover".to_owned(), Sink::Rollover),
        ];
        let is_protobuf = |topic: &&String| {
            let schema = info.channels.get(*topic).map(|(schema, _)| schema.as_str());
            schema.is_some_and(|schema| schema.starts_with("atvrec."))
        };
        let sensors = info.channels.keys().filter(|topic| {
            SENSORS.iter().any(|beginning| topic.starts_with(beginning)) && is_protobuf(topic)
        });
        sinks.extend(sensors.map(|topic| (topic.clone(), Sink::Sensor)));
        let controls = info.channels.keys().filter(|t| t.starts_with("/control/"));
        sinks.extend(controls.map(|topic| (topic.clone(), Sink::Control)));
        sinks.retain(|(topic, _)| has(topic) && is_protobuf(&topic));
        sinks
    }

    /// Messages of a topic in what is shown, if they are evenly spread.
    fn rows(&self, topic: &str, info: &Info) -> usize {
        let (first, last) = info.span.unwrap_or_default();
        let whole_s = last.seconds_since(first).max(f64::MIN_POSITIVE);
        let count = info.channels.get(topic).map_or(0, |(_, count)| *count);
        (count as f64 * (self.duration_s() / whole_s).min(1.0)).ceil() as usize
    }

    /// Chooses which samples are kept, and reserves the frames for the messages of the whole log; memory
    /// that no row needs is not touched.
    fn expect_rows(&mut self, sinks: &[(String, Sink)], info: &Info) {
        let most = sinks.iter().map(|(topic, _)| self.rows(topic, info)).max();
        self.thinning = Thinning::of(self.span_s, most.unwrap_or_default());
        let kept = self.thinning.statement();
        self.facts
            .extend(kept.map(|kept| ("Samples".to_owned(), kept)));
        // The truth has the instant at which the drive begins, too.
        let [estimates, truth] = [(); 2].map(|()| CommonInstants::default());
        for (topic, sink) in sinks {
            let instants = if topic.starts_with("/truth/") {
                &truth
            } else {
                &estimates
            };
            let frame = Frame::expecting(self.rows(topic, info), self.thinning).sharing(instants);
            match sink {
                Sink::Motion => self.motion = frame,
                Sink::Forces => self.forces = frame,
                Sink::Model => self.model = frame,
                Sink::TruthMotion => self.truth_motion = frame,
                Sink::TruthForces => self.truth_forces = frame,
                Sink::Ground => self.ground = frame,
                Sink::Rollover => self.rollover = frame,
                Sink::Sensor if is_travel_topic(topic) => {
                    self.travel_rows += self.rows(topic, info).div_ceil(WHEELS.len());
                }
                Sink::Sensor | Sink::Control => {}
            }
        }
    }

    fn take_table(&mut self, (topic, sink): &(String, Sink), table: store::Table) {
        for missing in &table.missing {
            self.missing.push(missing.to_string());
        }
        let start_ns = self.start.0;
        let is_force = |name: &str| name.ends_with("_n") && !name.contains("moment");
        let is_shown = |name: &str| {
            let hidden = [
                "velocity_y",
                "bank",
                "grade",
                "rl.steer",
                "rr.steer",
                "acceleration_m_s2.z",
            ];
            !hidden.iter().any(|hidden| name.starts_with(hidden))
                && !name.contains("longitudinal_slip")
        };
        match sink {
            Sink::Motion => self.motion.extend(&table, start_ns, is_shown),
            Sink::Forces => self.forces.extend(&table, start_ns, is_force),
            Sink::Model => self.model.extend(&table, start_ns, |name| {
                is_force(name) && !name.contains("sigma")
            }),
            Sink::TruthMotion => self.truth_motion.extend(&table, start_ns, |name| {
                is_shown(name) && !name.contains("steer") && !name.contains("sigma")
            }),
            Sink::TruthForces => self.truth_forces.extend(&table, start_ns, |name| {
                is_force(name) && !name.contains("sigma")
            }),
            Sink::Ground => {
                let is_height = |name: &str| name.ends_with("ground_height_m");
                self.ground.extend(&table, start_ns, is_height);
            }
            Sink::Rollover => {
                let is_ratio = |name: &str| name.contains("ratio");
                self.rollover.extend(&table, start_ns, is_ratio);
            }
            Sink::Control => self.take_sensor(topic, &table),
            Sink::Sensor => {
                let mut table = table;
                let origin = self.origins.entry(topic.clone()).or_default();
                sources::to_local(&mut table, origin);
                let new = || SourceRates::new(RATE_STRETCHES * self.thinning.stretch_s(0.1));
                let rates = self.rates.entry(topic.clone()).or_insert_with(new);
                rates.add(&table, start_ns);
                self.take_sensor(topic, &table);
            }
        }
    }

    /// Keeps the values of a sensor that are drawn. Each wheel of the suspension has a frame of its own:
    /// its samples have instants of their own.
    fn take_sensor(&mut self, topic: &str, table: &store::Table) {
        if is_travel_topic(topic) {
            for column in table.columns.iter().filter(|c| sources::is_travel(&c.name)) {
                let new = || Frame::expecting(self.travel_rows, self.thinning);
                let frame = self.travel.entry(column.name.clone()).or_insert_with(new);
                frame.extend_present(table, self.start.0, &column.name);
            }
        } else if table.columns.iter().any(|c| sources::is_drawn(&c.name)) {
            let new = || Frame::expecting(0, self.thinning);
            let frame = self.sensors.entry(topic.to_owned()).or_insert_with(new);
            frame.extend(table, self.start.0, sources::is_drawn);
        }
    }

    fn take_record(&mut self, record: Record, session: &store::Session) {
        match record {
            Record::Event(event) => self.events.push(event),
            Record::Parameters(parameters) => {
                let time_s = self.seconds(parameters.time);
                let apart_s = self.thinning.stretch_s(0.0);
                self.learnt.take(*parameters, time_s, apart_s);
            }
            Record::Limits(limits) => {
                let time_s = self.seconds(limits.time);
                let next_s = self.thinning.stretch_s(0.0);
                let last = self.reachable.last();
                if last.is_none_or(|(last_s, _)| time_s >= last_s + next_s) {
                    self.reachable.push((time_s, *limits));
                }
            }
            Record::Terrain(terrain) => {
                self.terrain_named[terrain.class.index()] += 1;
                let time_s = self.seconds(terrain.time);
                let next_s = self.thinning.stretch_s(0.0);
                let last = self.terrain.last();
                if last.is_none_or(|(last_s, _)| time_s >= last_s + next_s) {
                    self.terrain.push((time_s, terrain));
                }
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

    fn finish(&mut self) {
        self.frames().into_iter().for_each(Frame::finish);
        self.sensors.values_mut().for_each(Frame::finish);
        self.travel.values_mut().for_each(Frame::finish);
        self.share_times();
        for (truth, own) in [
            (&mut self.truth_motion, &self.motion),
            (&mut self.truth_forces, &self.forces),
        ] {
            if !own.is_empty() {
                *truth = std::mem::take(truth).on(&own.time_s);
            }
        }
    }

    /// Lets frames of the same instants share their times.
    fn share_times(&mut self) {
        let times = Arc::clone(&self.motion.time_s);
        let share = |frame: &mut Frame| frame.share_times(&times);
        self.frames().into_iter().for_each(share);
        self.sensors.values_mut().for_each(share);
    }

    /// Frees the samples that figures and tables alone need, once these are made. The positions stay.
    pub fn free_samples(&mut self) {
        self.frames().into_iter().for_each(Frame::free);
        self.travel.clear();
    }

    fn frames(&mut self) -> [&mut Frame; 7] {
        [
            &mut self.motion,
            &mut self.forces,
            &mut self.model,
            &mut self.truth_motion,
            &mut self.truth_forces,
            &mut self.ground,
            &mut self.rollover,
        ]
    }

    /// Positions of the receiver with the most of them, and longitude and latitude of its first one, rad.
    pub fn positions(&self) -> Option<(&Frame, [f64; 2])> {
        let all = self.sensors.iter().filter_map(|(topic, frame)| {
            let origin = (*self.origins.get(topic)?)?;
            frame.get("east_m").map(|_| (frame, origin))
        });
        all.max_by_key(|(frame, _)| frame.len())
    }

    /// Gives a receiver a first position.
    #[cfg(test)]
    pub fn place(&mut self, topic: &str, origin: [f64; 2]) {
        self.origins.insert(topic.to_owned(), Some(origin));
    }

    /// Seconds that are shown.
    pub fn duration_s(&self) -> f64 {
        self.span_s[1] - self.span_s[0]
    }

    /// Seconds of an instant from the start of the drive.
    pub fn seconds(&self, time: LogTime) -> f64 {
        time.seconds_since(self.start)
    }
}

/// Whether a topic has the travel of the suspension.
fn is_travel_topic(topic: &str) -> bool {
    topic.starts_with("/deflection")
}
