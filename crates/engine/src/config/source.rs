//! `[source.<name>]`: a device or a bus.

mod can;
mod sync;

use std::collections::HashSet;
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Duration;

use acq::{Parity, PortSpec, SerialSpec, Setup, SourceKind, SourceSpec};
use sample::SourceId;
use wire::crossbow440::{PacketRate, SetupOptions};
use wire::dbc::{Database, MessageDef};
use wire::line;

use super::Estimator;
use super::columns::{self, CsvMap};
use super::files::{FileKind, Files};
use super::roles::RoleOf;
use crate::engine::{Scales, conversion};
use model::file::{ErrorCollector, Field, Problem, Section, closest};

/// Standard deviations that a latency can have, s: a reading that is older than 0.1 s is not used.
pub(crate) const LATENCY_SIGMA_S: RangeInclusive<f64> = 0.0..=0.02;

/// Names of the kinds of source in the file.
const KINDS: [&str; 8] = [
    "can",
    "slcan",
    "crossbow440",
    "gnss",
    "vectornav",
    "line",
    "csv",
    "alog",
];

pub use sync::SyncFrame;

/// A source: how it is opened and how its bytes are decoded.
#[derive(Clone, Debug)]
pub struct Source {
    /// How the source is opened.
    pub spec: SourceSpec,
    /// How its bytes are decoded.
    pub meaning: Meaning,
    /// Time without data after which the source is reported as silent.
    pub silent_after: Option<Duration>,
    /// Delay of the fastest message from its time of validity to its arrival, s.
    pub transport_delay_s: f64,
    /// Its standard deviation, s; zero if it is known.
    pub latency_sigma_s: f64,
}

/// How the bytes of a source are decoded.
#[derive(Clone, Debug)]
pub enum Meaning {
    /// Frames, decoded through DBC files.
    Can(CanMeaning),
    /// Crossbow 440 packets at this rate.
    Crossbow440(PacketRate),
    /// Messages of a GNSS receiver.
    Gnss(GnssMeaning),
    /// Lines of text.
    Line(line::Format),
    /// Delimited text.
    Csv(CsvMap),
    /// A MOOS log.
    Alog(wire::alog::Format),
}

impl Meaning {
    /// Value of `kind` in the configuration, and whether data that is not understood is a mistake: a bus
    /// without DBC files is only recorded.
    #[must_use]
    pub fn kind(&self) -> (&'static str, bool) {
        match self {
            Self::Can(can) => (
                "can",
                can.databases.iter().any(|d| !d.messages().is_empty()),
            ),
            Self::Crossbow440(_) => ("crossbow440", true),
            Self::Gnss(gnss) if gnss.is_vectornav => ("vectornav", true),
            Self::Gnss(_) => ("gnss", true),
            Self::Line(_) => ("line", true),
            Self::Csv(_) => ("csv", true),
            Self::Alog(_) => ("alog", true),
        }
    }
}

/// How frames are decoded.
#[derive(Clone, Debug)]
pub struct CanMeaning {
    /// DBC files; the first file that contains a frame's message decodes the frame.
    pub databases: Vec<Database>,
    /// Name of each message of each file in the log, unique on the bus.
    pub names: Vec<Vec<String>>,
    /// Signals that are measurements.
    pub roles: Vec<RoleOf>,
    /// Time from the sampling of each message of each file to its arrival, s, where it is not that of the
    /// source.
    pub latencies_s: Vec<Vec<Option<f64>>>,
    /// Standard deviation of each of these times, s, where it is not that of the source.
    pub latency_sigmas_s: Vec<Vec<Option<f64>>>,
    /// Frame that marks the sampling of messages.
    pub sync: Option<SyncFrame>,
    /// Messages and other parts of the DBC files that are left out, and what is odd in the files.
    pub warnings: Vec<Problem>,
}

impl CanMeaning {
    /// Meaning of the frames of a bus. A name that an earlier message has is continued by the
    /// identifier.
    #[must_use]
    pub fn new(databases: Vec<Database>, roles: Vec<RoleOf>) -> Self {
        let mut known = HashSet::new();
        let mut unique = |message: &MessageDef| {
            let mut name = message.name.clone();
            while !known.insert(name.clone()) {
                name = format!("{name}_{:X}", message.id);
            }
            name
        };
        let names = databases.iter();
        let names = names.map(|d| d.messages().iter().map(&mut unique).collect());
        let none = |d: &Database| vec![None; d.messages().len()];
        Self {
            names: names.collect(),
            latencies_s: databases.iter().map(none).collect(),
            latency_sigmas_s: databases.iter().map(none).collect(),
            sync: None,
            databases,
            roles,
            warnings: Vec::new(),
        }
    }
}

/// Refuses signals in units that the sensors file does not convert.
pub fn check_units(
    sources: &[Source],
    estimator: Option<&Estimator>,
    collector: &mut ErrorCollector<'_>,
) {
    let scales = Scales::of(estimator);
    for source in sources {
        let Meaning::Can(can) = &source.meaning else {
            continue;
        };
        for role in &can.roles {
            let message = &can.databases[role.database].messages()[role.message];
            let signal = &message.signals[role.signal];
            if let (Err(error), Some(at)) = (conversion(role.role, signal, &scales), role.at) {
                collector.add(
                    &(at..at),
                    &format!("source.{}.roles", source.spec.name),
                    format!(
                        "signal {}.{} has the unit \"{}\", but {error}",
                        message.name, signal.name, signal.unit
                    ),
                    "name a signal in another unit, or add the field to the sensors file",
                );
            }
        }
    }
}

/// How the bytes of a GNSS receiver are decoded.
#[derive(Clone, Debug)]
pub struct GnssMeaning {
    /// Whether the port is that of a VectorNav unit.
    pub is_vectornav: bool,
    /// Latency of velocities without a latency field in their record, s; `None` means half the interval
    /// between two records.
    pub velocity_latency_s: Option<f64>,
    /// Latency of attitudes, s; `None` means the latency in the sensors file.
    pub attitude_latency_s: Option<f64>,
}

impl Source {
    /// Resolves the path of the port relative to `directory`.
    pub fn look_from(&mut self, directory: &Path) {
        match &mut self.spec.kind {
            SourceKind::Slcan(slcan) => slcan.port.path = directory.join(&slcan.port.path),
            SourceKind::Serial(serial) => serial.port.path = directory.join(&serial.port.path),
            SourceKind::Can(_) => {}
        }
    }
}

/// Reads all `[source.*]` tables. The sources are numbered in the order of their names.
pub fn read_all(
    section: Section<'_>,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
) -> Vec<Source> {
    let mut named = section.into_sections(collector);
    named.sort_by(|(a, _), (b, _)| a.value.cmp(&b.value));
    let mut sources = Vec::new();
    for (number, (name, section)) in named.into_iter().enumerate() {
        if !is_name(&name.value) {
            collector.add(
                &name.span,
                &name.name,
                format!("\"{}\" cannot be part of a topic", name.value),
                "use only letters, digits, _ and -",
            );
        }
        let id = SourceId(u16::try_from(number).unwrap_or(u16::MAX - 1));
        if let Some(source) = read(id, &name.value, section, files, collector) {
            report_shared_device(&source, &sources, &name, collector);
            sources.push(source);
        }
    }
    sources
}

fn is_name(name: &str) -> bool {
    !name.is_empty()
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

fn read(
    id: SourceId,
    name: &str,
    mut section: Section<'_>,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
) -> Option<Source> {
    let kind = section.required::<String>(
        "kind",
        &format!("use one of: {}", KINDS.join(", ")),
        collector,
    )?;
    let (acq_kind, meaning, silent_default_s) = match kind.value.as_str() {
        "can" => can::read_can(&mut section, files, collector),
        "slcan" => can::read_slcan(&mut section, files, collector),
        "crossbow440" => read_crossbow(&mut section, collector),
        "gnss" => read_gnss(&mut section, false, collector),
        "vectornav" => read_gnss(&mut section, true, collector),
        "line" => read_line(&mut section, collector),
        "csv" => {
            let held = read_held(&mut section, collector);
            read_table(&mut section, files, collector, |name, text| {
                let mut map = columns::csv_map(name, text)?;
                hold(&mut map, &held);
                let contradictions = map.contradictions(name);
                let warnings = std::mem::take(&mut map.warnings);
                Ok((Meaning::Csv(map), warnings, contradictions))
            })
        }
        "alog" => read_table(&mut section, files, collector, |name, text| {
            let map = columns::alog_map(name, text)?;
            let contradictions = map.contradictions(name);
            Ok((Meaning::Alog(map.format), map.warnings, contradictions))
        }),
        other => {
            let help = match closest(other, &KINDS) {
                Some(near) => format!("did you mean \"{near}\"?"),
                None => format!("use one of: {}", KINDS.join(", ")),
            };
            collector.add(
                &kind.span,
                &kind.name,
                format!("\"{other}\" is not a kind of source"),
                help,
            );
            return None;
        }
    };
    let silent_s = section.number_in("silent_after_s", 0.0..=3600.0, silent_default_s, collector);
    let latency = ["latency_s", "transport_delay_s"];
    let transport_delay_s = section.renamed_number_in(latency, 0.0..=10.0, 0.0, collector);
    let latency_sigma_s = section.number_in("latency_sigma_s", LATENCY_SIGMA_S, 0.0, collector);
    section.finish(collector);
    Some(Source {
        spec: SourceSpec {
            id,
            name: name.to_owned(),
            kind: acq_kind?,
        },
        meaning: meaning?,
        silent_after: (silent_s > 0.0).then(|| Duration::from_secs_f64(silent_s)),
        transport_delay_s,
        latency_sigma_s,
    })
}

type Read = (Option<SourceKind>, Option<Meaning>, f64);

fn read_crossbow(section: &mut Section<'_>, collector: &mut ErrorCollector<'_>) -> Read {
    let port = read_port(section, 57_600, collector);
    let rate_field = section.optional::<u32>("rate_hz", collector);
    let rate_hz = rate_field.as_ref().map_or(100, |field| field.value);
    let rate = match rate_hz {
        50 => PacketRate::Hz50,
        25 => PacketRate::Hz25,
        20 => PacketRate::Hz20,
        10 => PacketRate::Hz10,
        _ => PacketRate::Hz100,
    };
    if let Some(field) = rate_field
        && ![100, 50, 25, 20, 10].contains(&field.value)
    {
        collector.add(
            &field.span,
            &field.name,
            format!("the device cannot send {} packets per second", field.value),
            "use 100, 50, 25, 20 or 10",
        );
    }
    let packet = section.optional::<String>("packet", collector);
    if let Some(field) = &packet
        && !["S0", "S1", "S2"].contains(&field.value.as_str())
    {
        collector.add(
            &field.span,
            &field.name,
            format!("\"{}\" is not a supported packet type", field.value),
            "use \"S1\" (scaled samples), \"S2\" (increments) or \"S0\"",
        );
    }
    let configure = section.or("configure", true, collector);
    let packet = packet.map_or_else(|| "S1".to_owned(), |field| field.value);
    let setup = match (configure, packet.as_bytes()) {
        (true, &[letter, digit]) => Setup::Crossbow440(SetupOptions {
            packet: [letter, digit],
            rate,
            baud: None,
        }),
        _ => Setup::None,
    };
    let kind = port.map(|port| SourceKind::Serial(SerialSpec { port, setup }));
    (kind, Some(Meaning::Crossbow440(rate)), 0.5)
}

fn read_gnss(
    section: &mut Section<'_>,
    is_vectornav: bool,
    collector: &mut ErrorCollector<'_>,
) -> Read {
    let port = read_port(section, 115_200, collector);
    let meaning = Meaning::Gnss(GnssMeaning {
        is_vectornav,
        velocity_latency_s: read_latency(section, "velocity_latency_s", collector),
        attitude_latency_s: read_latency(section, "attitude_latency_s", collector),
    });
    let setup = read_commands(section, collector);
    let kind = port.map(|port| SourceKind::Serial(SerialSpec { port, setup }));
    (kind, Some(meaning), 1.0)
}

fn read_latency(
    section: &mut Section<'_>,
    key: &'static str,
    collector: &mut ErrorCollector<'_>,
) -> Option<f64> {
    let field = section.optional::<f64>(key, collector)?;
    if !(0.0..=5.0).contains(&field.value) {
        collector.add(
            &field.span,
            &field.name,
            format!("{} s is out of range", field.value),
            "use a number from 0 to 5, or remove the field for the default",
        );
    }
    Some(field.value)
}

fn read_line(section: &mut Section<'_>, collector: &mut ErrorCollector<'_>) -> Read {
    let port = read_port(section, 9_600, collector);
    let delimiter = section.optional::<String>("delimiter", collector);
    if let Some(field) = &delimiter
        && field.value.len() != 1
    {
        collector.add(
            &field.span,
            &field.name,
            format!("\"{}\" is not one ASCII character", field.value),
            "use one character, such as \",\", or remove the field for blanks",
        );
    }
    let steer = section.optional::<String>("steer", collector);
    let fields = section.section("fields", collector);
    let (span, name) = (fields.span(), fields.field_name("fields"));
    let format = line::Format {
        delimiter: delimiter.and_then(|field| field.value.bytes().next()),
        prefix: section.or("prefix", String::new(), collector),
        fields: fields
            .into_sections(collector)
            .into_iter()
            .map(|(name, field)| read_line_field(name.value, field, collector))
            .collect(),
        role: steer.map_or(line::Role::Control, |field| line::Role::Steer(field.value)),
        query: section.or("query", String::new(), collector).into_bytes(),
    };
    if let Err(error) = format.check() {
        let help = "write a table [source.<name>.fields.<quantity>] with index, scale and unit for \
                    each number";
        collector.add(&span, &name, error.to_string(), help);
    }
    let setup = read_commands(section, collector);
    let kind = port.map(|port| SourceKind::Serial(SerialSpec { port, setup }));
    (kind, Some(Meaning::Line(format)), 0.0)
}

/// What a column map says: the meaning, warnings, and contradictions, which are errors of a new
/// configuration.
type ReadMap = (Meaning, Vec<Problem>, Vec<Problem>);

/// Rows for which a table holds the values of a column, by the names of the columns.
fn read_held(section: &mut Section<'_>, collector: &mut ErrorCollector<'_>) -> Vec<(String, u32)> {
    let held = section.section("held_rows", collector);
    let fields = held.into_numbers(collector);
    fields
        .into_iter()
        .map(|(name, rows)| (name, rows.value.clamp(1.0, 1e6) as u32))
        .collect()
}

/// Sets the rows for which columns hold their values; those of the column map have priority.
fn hold(map: &mut CsvMap, held: &[(String, u32)]) {
    for (_, column) in &mut map.format.columns {
        let found = held.iter().find(|(name, _)| *name == column.name);
        if let Some((_, rows)) = found.filter(|_| column.held_rows == 1) {
            column.held_rows = *rows;
        }
    }
}

/// A table that a device sends, or an imported file, which a column map describes.
fn read_table(
    section: &mut Section<'_>,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
    map: impl FnOnce(&str, &str) -> Result<ReadMap, Vec<Problem>>,
) -> Read {
    let port = read_port(section, 115_200, collector);
    let columns = section.required::<String>(
        "columns",
        "set the column map, such as columns = \"columns.toml\"",
        collector,
    );
    let setup = read_commands(section, collector);
    let kind = port.map(|port| SourceKind::Serial(SerialSpec { port, setup }));
    let meaning = columns.and_then(|field| {
        match files.read_text(&field.value, FileKind::Columns) {
            Ok(text) => match map(&field.value, &text) {
                Ok((meaning, warnings, contradictions)) => {
                    collector.warn_foreign(warnings);
                    // A log is replayed as it was recorded.
                    if !files.are_attached() {
                        collector.add_foreign(contradictions);
                    }
                    return Some(meaning);
                }
                Err(problems) => collector.add_foreign(problems),
            },
            Err(error) => collector.add(&field.span, &field.name, error.message, error.help),
        }
        None
    });
    (kind, meaning, 0.0)
}

fn read_line_field(
    name: String,
    mut section: Section<'_>,
    collector: &mut ErrorCollector<'_>,
) -> line::Field {
    let index = section.or::<u32>("index", 0, collector);
    let bits = section.optional::<u32>("signed_bits", collector);
    let field = line::Field {
        index: index as usize,
        name,
        scale: section.or("scale", 1.0, collector),
        offset: section.or("offset", 0.0, collector),
        unit: section.or("unit", String::new(), collector),
        signed_bits: bits.map(|field| u8::try_from(field.value).unwrap_or(u8::MAX)),
    };
    section.finish(collector);
    field
}

fn read_commands(section: &mut Section<'_>, collector: &mut ErrorCollector<'_>) -> Setup {
    let commands = section.or("commands", Vec::<String>::new(), collector);
    let pause_s = section.number_in("command_pause_s", 0.0..=10.0, 0.1, collector);
    if commands.is_empty() {
        return Setup::None;
    }
    Setup::Commands {
        commands: commands
            .into_iter()
            .map(|command| format!("{command}\r\n").into_bytes())
            .collect(),
        pause: Duration::from_secs_f64(pause_s),
    }
}

fn read_port(
    section: &mut Section<'_>,
    baud_default: u32,
    collector: &mut ErrorCollector<'_>,
) -> Option<PortSpec> {
    let device = section.required::<String>(
        "device",
        "set the port; a link by device identity is safest: device = \"/dev/serial/by-id/...\"",
        collector,
    );
    let baud = section.optional::<u32>("baud", collector);
    if let Some(field) = &baud
        && !(50..=4_000_000).contains(&field.value)
    {
        collector.add(
            &field.span,
            &field.name,
            format!("{} bit/s is out of range", field.value),
            "use the baud rate of the device, from 50 to 4000000",
        );
    }
    let parity = section.optional::<String>("parity", collector);
    let parity = parity.map_or(Parity::None, |field| read_parity(&field, collector));
    let two_stop_bits = section.or("two_stop_bits", false, collector);
    let low_latency = section.or("low_latency", true, collector);
    let device = device?;
    Some(PortSpec {
        parity,
        two_stop_bits,
        low_latency,
        ..PortSpec::new(device.value, baud.map_or(baud_default, |field| field.value))
    })
}

fn read_parity(field: &Field<String>, collector: &mut ErrorCollector<'_>) -> Parity {
    match field.value.as_str() {
        "none" => Parity::None,
        "odd" => Parity::Odd,
        "even" => Parity::Even,
        other => {
            collector.add(
                &field.span,
                &field.name,
                format!("\"{other}\" is not a parity"),
                "use \"none\", \"odd\" or \"even\"",
            );
            Parity::None
        }
    }
}

/// Name of the device of a source, for messages.
pub fn device_name(kind: &SourceKind) -> String {
    match kind {
        SourceKind::Can(can) => can.interface.clone(),
        SourceKind::Slcan(slcan) => slcan.port.path.display().to_string(),
        SourceKind::Serial(serial) => serial.port.path.display().to_string(),
    }
}

fn report_shared_device(
    source: &Source,
    others: &[Source],
    name: &Field<String>,
    collector: &mut ErrorCollector<'_>,
) {
    let device = device_name(&source.spec.kind);
    let first = others
        .iter()
        .find(|other| device_name(&other.spec.kind) == device);
    if let Some(first) = first {
        collector.add(
            &name.span,
            &name.name,
            format!("source.{} reads {device} already", first.spec.name),
            "use a different device for each source",
        );
    }
}
