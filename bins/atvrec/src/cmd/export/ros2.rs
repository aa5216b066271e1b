//! `atvrec export --ros2`: measurements and estimates as a ROS 2 bag with MCAP storage.

mod cdr;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use engine::Error;
use engine::output::{Folder, Kind, Target, TargetError, WriteError};
use mcap::records::MessageHeader;
use store::Table;

use super::cells::{Numbers, integer};
use super::topic::Topic;
use super::{Input, Written};
use crate::cli::ExportArgs;
use crate::exit::UsageError;
use cdr::{Message, schema_text};

/// Schemas that have messages in ROS 2.
const SCHEMAS: [&str; 5] = [
    "atvrec.GnssPosition",
    "atvrec.GnssVelocity",
    "atvrec.Imu",
    "atvrec.Motion",
    "atvrec.TyreForces",
];
/// Version of the description of a bag, `metadata.yaml`.
const BAG_VERSION: u32 = 5;

/// Where the bag is written.
pub enum Output {
    /// One MCAP file.
    File(Target),
    /// A folder with the file and its description.
    Folder {
        /// The folder of the bag.
        path: PathBuf,
        /// The folder that contains it.
        parent: Folder,
        is_replaced: bool,
    },
}

impl Output {
    /// Checks the output: a name with `.mcap` is a file, any other name a folder.
    pub fn new(path: &Path, args: &ExportArgs) -> anyhow::Result<Self> {
        let force = args.replace.force;
        if path
            .extension()
            .is_some_and(|found| found.eq_ignore_ascii_case("mcap"))
        {
            let inputs = args.logs.iter().map(|log| &**log);
            return Ok(Self::File(Target::new(path, Kind::Log, force, inputs)?));
        }
        let exists = path.symlink_metadata().is_ok();
        let path = path.to_owned();
        if exists && !force {
            return Err(Error::from(TargetError::Exists { path }).into());
        }
        if exists && !path.join("metadata.yaml").is_file() {
            let text = format!(
                "{} is not a folder of a ROS 2 bag (it has no metadata.yaml) and is not replaced; use \
                 another name",
                path.display()
            );
            return Err(UsageError(text).into());
        }
        let parent = path.parent().filter(|parent| *parent != Path::new(""));
        let parent = parent.unwrap_or(Path::new("."));
        if !parent.is_dir() {
            let directory = parent.to_owned();
            return Err(Error::from(TargetError::NoDirectory { path, directory }).into());
        }
        Ok(Self::Folder {
            parent: Folder::open(parent, |_| true)?,
            path,
            is_replaced: exists,
        })
    }
}

/// A log that becomes a bag.
pub struct Export<'a> {
    input: Input<'a>,
    topics: Vec<Topic>,
}

impl<'a> Export<'a> {
    /// The topics of a log that have messages in ROS 2.
    pub fn new(input: Input<'a>) -> anyhow::Result<Self> {
        let all = Topic::all(input.reader, input.left_out).into_iter();
        let topics: Vec<Topic> = all
            .filter(|topic| SCHEMAS.contains(&&*topic.schema))
            .collect();
        if topics.is_empty() {
            anyhow::bail!(
                "the log has no topic for a ROS 2 bag: none with inertial data, positions, velocities, \
                 motion or tyre forces"
            );
        }
        Ok(Self { input, topics })
    }

    /// Writes the bag, and prints what was written.
    pub fn write(&self, output: &Output) -> anyhow::Result<Written> {
        let mut written = Written::default();
        let path = match output {
            Output::File(target) => {
                target.write_by(|file| {
                    let counts = self.write_file(file, &mut written);
                    counts.map(|_| ()).map_err(WriteError::from)
                })?;
                target.path()
            }
            Output::Folder {
                path,
                parent,
                is_replaced,
            } => {
                let name = path.file_name().unwrap_or_default();
                let bag = parent.partial().join(name);
                std::fs::create_dir(&bag)?;
                let file_name = format!("{}_0.mcap", name.to_string_lossy());
                let file = File::create_new(bag.join(&file_name))?;
                let counts = self.write_file(file, &mut written)?;
                std::fs::write(bag.join("metadata.yaml"), counts.description(&file_name))?;
                let name = Path::new(name);
                parent.publish(name, name, is_replaced.then_some(name))?;
                path
            }
        };
        println!("{}: {} messages", path.display(), written.rows);
        Ok(written)
    }

    fn write_file(&self, file: File, written: &mut Written) -> anyhow::Result<Counts> {
        let options = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("atvrec ", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd));
        let mut bag = Bag {
            writer: options.create(BufWriter::new(file))?,
            channels: BTreeMap::new(),
            counts: Counts::default(),
        };
        let missing = &mut written.missing;
        (self.input).each(&self.topics, [0.0, 1.0], missing, |topic, table| {
            bag.write(&self.topics[topic], &table)
        })?;
        bag.writer.finish()?;
        written.rows = bag.counts.messages;
        Ok(bag.counts)
    }
}

/// A bag that is being written.
struct Bag {
    writer: mcap::Writer<BufWriter<File>>,
    /// Numbers of the channels by topic.
    channels: BTreeMap<String, u16>,
    counts: Counts,
}

impl Bag {
    /// Writes the rows of a topic.
    fn write(&mut self, topic: &Topic, table: &Table) -> anyhow::Result<()> {
        let name = ros_name(&topic.name);
        match &*topic.schema {
            "atvrec.Imu" => self.put(&name, cdr::IMU, table, imu(table, &topic.source)),
            "atvrec.GnssPosition" => {
                self.put(&name, cdr::NAV_SAT_FIX, table, fix(table, &topic.source))
            }
            "atvrec.GnssVelocity" => {
                let velocity = ["east", "north", "up"].map(|axis| format!("velocity_m_s.{axis}"));
                let twist = twist(table, velocity, None, "earth");
                self.put(&name, cdr::TWIST_STAMPED, table, twist)
            }
            "atvrec.Motion" => {
                let velocity = ["velocity_x_m_s", "velocity_y_m_s", ""].map(str::to_owned);
                let rates = ["roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"];
                let twist = twist(table, velocity, Some(rates), "vehicle");
                self.put(&name, cdr::TWIST_STAMPED, table, twist)
            }
            _ => {
                let columns = table.columns.iter();
                let wheels = columns.filter_map(|column| column.name.strip_suffix(".z_n"));
                let is_contact = topic
                    .frame()
                    .is_some_and(|frame| frame.starts_with("contact"));
                for wheel in wheels {
                    let frame = if is_contact { "contact" } else { "wheel" };
                    let wrench = wrench(table, wheel, &format!("{frame}_{wheel}"));
                    let name = format!("{name}/{wheel}");
                    self.put(&name, cdr::WRENCH_STAMPED, table, wrench)?;
                }
                Ok(())
            }
        }
    }

    /// Writes the messages of a ROS topic: one for each row that has a message.
    fn put(
        &mut self,
        topic: &str,
        (schema, parts): (&'static str, &[&str]),
        table: &Table,
        message: impl Fn(usize, i64) -> Option<Message>,
    ) -> anyhow::Result<()> {
        let channel_id = match self.channels.get(topic) {
            Some(channel) => *channel,
            None => {
                let text = schema_text(parts);
                let schema_id = self.writer.add_schema(schema, "ros2msg", text.as_bytes())?;
                let metadata = [("offered_qos_profiles".to_owned(), String::new())].into();
                let channel = self
                    .writer
                    .add_channel(schema_id, topic, "cdr", &metadata)?;
                self.channels.insert(topic.to_owned(), channel);
                self.counts.topics.insert(topic.to_owned(), (schema, 0));
                channel
            }
        };
        let times = table.log_time_ns.iter().zip(&table.publish_time_ns);
        for (row, (log_ns, publish_ns)) in times.enumerate() {
            let Some(message) = message(row, *publish_ns) else {
                continue;
            };
            let header = MessageHeader {
                channel_id,
                sequence: 0,
                log_time: log_ns.cast_unsigned(),
                publish_time: publish_ns.cast_unsigned(),
            };
            self.writer
                .write_to_known_channel(&header, &message.bytes())?;
            self.counts.add(topic, *log_ns);
        }
        Ok(())
    }
}

/// Specific force and angular rate along the axes of the sensor; the orientation is marked as unknown.
fn imu<'t>(table: &'t Table, source: &'t str) -> impl Fn(usize, i64) -> Option<Message> + 't {
    let vector =
        |name: &str| ["x", "y", "z"].map(|axis| Numbers::new(table, &format!("{name}.{axis}")));
    let rate_rad_s = vector("angular_rate_rad_s");
    let force_m_s2 = vector("specific_force_m_s2");
    move |row, ns| {
        let [rate, force] =
            [&rate_rad_s, &force_m_s2].map(|of| [0, 1, 2].map(|axis| of[axis].at(row)));
        let mut no_orientation = [0.0; 9];
        no_orientation[0] = -1.0;
        let message = Message::new(ns, source)
            .f64s(&[0.0, 0.0, 0.0, 1.0])
            .f64s(&no_orientation)
            .f64s(&rate)
            .f64s(&[0.0; 9])
            .f64s(&force)
            .f64s(&[0.0; 9]);
        Some(message)
    }
}

/// Position of an antenna, height above the ellipsoid.
fn fix<'t>(table: &'t Table, source: &'t str) -> impl Fn(usize, i64) -> Option<Message> + 't {
    let number = |name| Numbers::new(table, name);
    let angles_rad = ["latitude_rad", "longitude_rad"].map(number);
    let height_m = number("height_m");
    let sigma_m = ["sigma_m.east", "sigma_m.north", "sigma_m.up"].map(number);
    move |row, ns| {
        let quality = integer(table, "quality", row).unwrap_or_default();
        let status = match quality {
            // No solution.
            0 => -1,
            2 => 1,
            3 | 4 => 2,
            _ => 0,
        };
        let [latitude, longitude] = [0, 1].map(|at| angles_rad[at].at(row).to_degrees());
        let mut covariance = [0.0; 9];
        for (axis, sigma) in sigma_m.iter().enumerate() {
            covariance[4 * axis] = sigma.at(row) * sigma.at(row);
        }
        let is_known = covariance.iter().all(|value| value.is_finite());
        let (covariance, kind) = if is_known {
            (covariance, 2)
        } else {
            ([0.0; 9], 0)
        };
        let message = Message::new(ns, source)
            .i8(status)
            .u16(1)
            .f64s(&[latitude, longitude, height_m.at(row)])
            .f64s(&covariance)
            .i8(kind);
        Some(message)
    }
}

/// Velocity, and angular rate if it is known. A row without any number has no message.
fn twist<'t>(
    table: &'t Table,
    velocity_m_s: [String; 3],
    rate_rad_s: Option<[&str; 3]>,
    frame: &'t str,
) -> impl Fn(usize, i64) -> Option<Message> + 't {
    let linear = velocity_m_s.map(|name| Numbers::new(table, &name));
    let angular = rate_rad_s
        .unwrap_or_default()
        .map(|name| Numbers::new(table, name));
    move |row, ns| six(&linear, &angular, row, ns, frame)
}

/// Force and moment of the ground on one tyre. A row without any number has no message.
fn wrench<'t>(
    table: &'t Table,
    wheel: &str,
    frame: &str,
) -> impl Fn(usize, i64) -> Option<Message> + 't {
    let axes = ["x", "y", "z"];
    let force = axes.map(|axis| Numbers::new(table, &format!("{wheel}.{axis}_n")));
    let moment = axes.map(|axis| Numbers::new(table, &format!("{wheel}.moment_{axis}_n_m")));
    let frame = frame.to_owned();
    move |row, ns| six(&force, &moment, row, ns, &frame)
}

/// A message of two vectors.
fn six(
    first: &[Numbers<'_>; 3],
    second: &[Numbers<'_>; 3],
    row: usize,
    ns: i64,
    frame: &str,
) -> Option<Message> {
    let all = [0, 1, 2, 3, 4, 5].map(|at| match first.get(at) {
        Some(numbers) => numbers.at(row),
        None => second[at - 3].at(row),
    });
    let has_number = all.iter().any(|value| !value.is_nan());
    has_number.then(|| Message::new(ns, frame).f64s(&all))
}

/// A topic's name with the characters that ROS 2 allows.
fn ros_name(topic: &str) -> String {
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '/';
    let mut name = String::new();
    for c in topic.chars() {
        if c.is_ascii_digit() && name.ends_with('/') {
            name.push('_');
        }
        name.push(if is_allowed(c) { c } else { '_' });
    }
    name
}

/// What a bag contains.
#[derive(Default)]
struct Counts {
    /// Schema and number of messages of each topic.
    topics: BTreeMap<String, (&'static str, usize)>,
    messages: usize,
    /// First and last time, ns.
    span: Option<(i64, i64)>,
}

impl Counts {
    fn add(&mut self, topic: &str, ns: i64) {
        self.messages += 1;
        if let Some((_, count)) = self.topics.get_mut(topic) {
            *count += 1;
        }
        let (first, last) = self.span.unwrap_or((ns, ns));
        self.span = Some((first.min(ns), last.max(ns)));
    }

    /// The file `metadata.yaml` of the bag.
    fn description(&self, file: &str) -> String {
        let (first, last) = self.span.unwrap_or_default();
        let (duration, messages) = (last - first, self.messages);
        // A JSON string is a YAML string.
        let file = serde_json::Value::from(file);
        let mut topics = String::new();
        for (name, (schema, count)) in &self.topics {
            // Writing to a string cannot fail.
            let _ = write!(
                topics,
                "    - topic_metadata:\n        name: {name}\n        type: {schema}\n        \
                 serialization_format: cdr\n        offered_qos_profiles: \"\"\n      \
                 message_count: {count}\n"
            );
        }
        format!(
            "rosbag2_bagfile_information:\n  version: {BAG_VERSION}\n  storage_identifier: mcap\n  \
             duration:\n    nanoseconds: {duration}\n  starting_time:\n    \
             nanoseconds_since_epoch: {first}\n  message_count: {messages}\n  \
             topics_with_message_count:\n{topics}  compression_format: \"\"\n  \
             compression_mode: \"\"\n  relative_file_paths:\n    - {file}\n  files:\n    - path: {file}\n      \
             starting_time:\n        nanoseconds_since_epoch: {first}\n      duration:\n        \
             nanoseconds: {duration}\n      message_count: {messages}\n"
        )
    }
}
