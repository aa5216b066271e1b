//! Sources of the configuration for the devices that were found.

mod bus;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use engine::config::{FileKind, Files, Proposed};
use engine::{Config, Engine, Reception};
use sample::Arrival;
use sample::text::printable;
use wire::dbc::Database;
use wire::recognise::Format;

use super::devices::{Interface, Port, PortState, bytes_of};
use crate::cli::InitArgs;
use crate::cmd::comment;
use crate::exit::UsageError;
use bus::{Bus, assign};

/// Most signals without a clear role that are listed.
const DOUBTS_MAX: usize = 40;
/// Most numbers of a line that become fields.
const LINE_FIELDS_MAX: usize = 16;
/// Time after the opening of a port in which bytes arrive that the line had stored, s.
const STORED_S: f64 = 0.05;

/// A DBC file.
pub struct DbcFile {
    /// Its name in the configuration.
    pub name: String,
    database: Database,
}

/// A source, or a comment in the place of one.
pub struct Planned {
    /// Device, and what it sends, for people.
    pub told: Vec<String>,
    /// Comments above the table, without `#`.
    comments: Vec<String>,
    /// The table; empty if the device cannot be a source.
    table: String,
    /// Name of the source.
    name: String,
    roles: Vec<Proposed>,
    /// Roles without a doubt whose message did not arrive, although others did.
    silent: Vec<Proposed>,
}

/// Reads DBC files. Names in the configuration are relative to `directory`.
pub fn read_dbc(paths: &[PathBuf], directory: &Path) -> anyhow::Result<Vec<DbcFile>> {
    let mut files = Files::on_disk(PathBuf::new());
    let mut read = Vec::new();
    for path in paths {
        let given = path.display().to_string();
        let text = files.read_text(&given, FileKind::Dbc);
        let text = text.map_err(|problem| UsageError(problem.to_string()))?;
        let database = Database::parse_usable(text.as_bytes());
        let database = database.map_err(|error| UsageError(format!("{given}: {error}")))?;
        let name = match path.exists() {
            true => named_from(directory, path)?,
            false => given,
        };
        read.push(DbcFile { name, database });
    }
    Ok(read)
}

/// Name of a file in a configuration in `directory`.
pub fn named_from(directory: &Path, path: &Path) -> anyhow::Result<String> {
    let (directory, path) = (std::path::absolute(directory)?, std::path::absolute(path)?);
    let name = path.strip_prefix(&directory).unwrap_or(&path);
    Ok(name.display().to_string())
}

/// Plans the sources of all devices.
pub fn plan(
    interfaces: Vec<Interface>,
    ports: Vec<Port>,
    dbc: &[DbcFile],
    args: &InitArgs,
) -> anyhow::Result<Vec<Planned>> {
    let mut names = Names::default();
    let mut buses: Vec<Bus> = Vec::new();
    let mut planned = Vec::new();
    for interface in interfaces {
        buses.push(Bus::of_interface(interface, args.bitrate, &mut names));
    }
    for port in ports {
        match &port.state {
            PortState::Adapter { .. } => buses.extend(Bus::of_adapter(port, &mut names)),
            _ => planned.push(of_port(&port, &mut names, args.listen_s)?),
        }
    }
    if buses.is_empty() && !dbc.is_empty() {
        buses.push(Bus::missing(&mut names));
    }
    assign(&mut buses, dbc);
    let buses = buses.into_iter().map(|bus| bus.planned(dbc, args));
    let mut all = buses.collect::<anyhow::Result<Vec<_>>>()?;
    all.extend(planned);
    Ok(all)
}

/// Names of sources, each once.
#[derive(Default)]
struct Names(BTreeMap<String, u32>);

impl Names {
    fn next(&mut self, wanted: &str) -> String {
        let clean = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let wanted: String = wanted.chars().map(clean).collect();
        let count = self.0.entry(wanted.clone()).or_default();
        *count += 1;
        match *count {
            1 => wanted,
            count => format!("{wanted}_{count}"),
        }
    }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// What a source makes of the arrivals of its device.
fn decode(
    table: &str,
    directory: &Path,
    arrivals: &[Arc<Arrival>],
) -> anyhow::Result<Option<Reception>> {
    let config = Config::from_text(table, directory)?;
    let mut engine = Engine::new(&config)?;
    let mut records = Vec::new();
    for arrival in arrivals {
        engine.push(arrival, &mut records);
        records.clear();
    }
    Ok(engine.reception().next())
}

/// Arrivals of a port without what the line had stored before it was opened, if more came.
fn fresh(arrivals: &[Arc<Arrival>]) -> &[Arc<Arrival>] {
    let Some(first) = arrivals.first() else {
        return arrivals;
    };
    let is_old =
        |arrival: &&Arc<Arrival>| arrival.log_time.seconds_since(first.log_time) < STORED_S;
    match arrivals.iter().take_while(is_old).count() {
        count if count < arrivals.len() => &arrivals[count..],
        _ => arrivals,
    }
}

/// Names of messages with their rates.
fn rates<'m>(
    messages: impl Iterator<Item = (&'m str, u64)>,
    arrivals: &[Arc<Arrival>],
    listened_s: f64,
) -> Option<String> {
    let (first, last) = (arrivals.first()?, arrivals.last()?);
    let span_s = last.log_time.seconds_since(first.log_time);
    let each = messages.map(|(name, count)| {
        // Between the first and the last of them is one less. A burst says nothing of the rate.
        let rate_hz = match span_s > 0.5 * listened_s {
            true if count > 1 => (count - 1) as f64 / span_s,
            _ => count as f64 / listened_s,
        };
        format!("{name} {rate_hz:.0} Hz")
    });
    let text = each.collect::<Vec<_>>().join(", ");
    (!text.is_empty()).then(|| printable(&text).into_owned())
}

/// Lines about the messages of a source.
fn told_of(reception: &Reception, arrivals: &[Arc<Arrival>], listened_s: f64) -> Vec<String> {
    let decoded = rates(reception.messages.decoded(), arrivals, listened_s);
    let others = rates(reception.messages.not_decoded(), arrivals, listened_s);
    let mut lines = Vec::new();
    lines.extend(decoded.map(|text| format!("messages: {text}")));
    lines.extend(others.map(|text| format!("not decoded: {text}")));
    lines.extend(reception.problem());
    lines
}

fn of_port(port: &Port, names: &mut Names, listened_s: f64) -> anyhow::Result<Planned> {
    let path = port.path.display().to_string();
    let device = match port.driver.as_str() {
        "" => path.clone(),
        driver => format!("{path} ({driver})"),
    };
    let none = |told: String| Planned {
        comments: vec![format!("{path}: {told}")],
        told: vec![format!("{device}: {told}")],
        table: String::new(),
        name: String::new(),
        roles: Vec::new(),
        silent: Vec::new(),
    };
    Ok(match &port.state {
        PortState::NotOpen(why) => none(why.strip_prefix(&format!("{path}: ")).unwrap_or(why).to_owned()),
        PortState::Silent | PortState::Adapter { .. } => none(
            "no byte arrived; check power and cable of the device, and whether it sends without a request"
                .to_owned(),
        ),
        PortState::Unknown { format, bytes } => none(match format {
            Some(format) => format!("{bytes} bytes of {format}: {}", format.advice()),
            None => format!(
                "{bytes} bytes of no known protocol at any usual baud rate; look up protocol and baud \
                 rate of the device"
            ),
        }),
        PortState::Known {
            format,
            baud,
            arrivals,
        } => {
            let Some(table) = table_of(*format, &path, *baud, arrivals, names) else {
                return Ok(none(format!("{format}, not decoded: {}", format.advice())));
            };
            let (name, table) = table;
            let arrivals = fresh(arrivals);
            let reception = decode(&table, Path::new(""), arrivals)?;
            let mut told = vec![format!("{device}: {format} at {baud} baud: source {name}")];
            let lines = reception.map(|reception| told_of(&reception, arrivals, listened_s));
            told.extend(lines.unwrap_or_default());
            Planned {
                comments: vec![told[1..].join("; ")],
                told,
                table,
                name,
                roles: Vec::new(),
                silent: Vec::new(),
            }
        }
    })
}

/// Name and table of the source of a device; none if no source decodes it.
fn table_of(
    format: Format,
    path: &str,
    baud: u32,
    arrivals: &[Arc<Arrival>],
    names: &mut Names,
) -> Option<(String, String)> {
    let kind = format.kind()?;
    let more = match format {
        Format::Text => line_fields(&bytes_of(arrivals))?,
        _ => (String::new(), String::new()),
    };
    let name = names.next(match kind {
        "crossbow440" => "imu",
        kind => kind,
    });
    let mut table = format!(
        "[source.{name}]\nkind = {}\ndevice = {}\nbaud = {baud}\n{}",
        quoted(kind),
        quoted(path),
        more.0,
    );
    table += &more
        .1
        .replace("[fields.", &format!("[source.{name}.fields."));
    Some((name, table))
}

/// Settings and fields of a device that writes lines of numbers, from its first complete line.
fn line_fields(bytes: &[u8]) -> Option<(String, String)> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text
        .split(['\r', '\n'])
        .filter(|line| !line.trim().is_empty());
    let line = lines.nth(1)?.to_owned();
    let delimiter = [',', ';'].into_iter().find(|c| line.contains(*c));
    let words: Vec<&str> = match delimiter {
        Some(delimiter) => line.split(delimiter).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    };
    let numbers = words.iter().enumerate();
    let numbers = numbers.filter(|(_, word)| word.parse::<f64>().is_ok_and(f64::is_finite));
    let fields: Vec<usize> = numbers
        .map(|(index, _)| index)
        .take(LINE_FIELDS_MAX)
        .collect();
    if fields.is_empty() {
        return None;
    }
    let mut settings = format!(
        "# A line was: {}\n# Name the fields, and set scale, offset and unit. A steering-wheel encoder also \
         needs, in rad and left positive:\n# steer = \"value0\"\n",
        printable(&line)
    );
    if let Some(delimiter) = delimiter {
        let _ = writeln!(settings, "delimiter = {}", quoted(&delimiter.to_string()));
    }
    let tables = fields.iter().map(|index| {
        format!("\n[fields.value{index}]\nindex = {index}\nscale = 1.0\nunit = \"\"\n")
    });
    Some((settings, tables.collect()))
}

impl Planned {
    /// Whether it is a source, and no comment.
    pub const fn is_source(&self) -> bool {
        !self.table.is_empty()
    }

    /// Number of signals with a role, of those that a person must decide on, and of those whose message did
    /// not arrive.
    pub fn roles(&self) -> [usize; 3] {
        let doubtful = self.roles.iter().filter(|role| role.doubt.is_some());
        let doubtful = doubtful.count();
        [self.roles.len() - doubtful, doubtful, self.silent.len()]
    }

    /// Its part of the configuration.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for line in self.comments.iter().filter(|line| !line.is_empty()) {
            comment(&mut text, line);
        }
        text.push_str(&self.table);
        if !self.roles.is_empty() || !self.silent.is_empty() {
            let _ = writeln!(text, "\n[source.{}.roles]", self.name);
            self.write_roles(&mut text);
        }
        text
    }

    fn write_roles(&self, text: &mut String) {
        let line = |role: &Proposed| format!("{} = {}", role.role, quoted(&role.signal));
        let unit = |role: &Proposed| match role.unit.as_str() {
            "" => "no unit".to_owned(),
            unit => format!("unit {}", printable(unit)),
        };
        for role in self.roles.iter().filter(|role| role.doubt.is_none()) {
            let _ = writeln!(text, "{}  # {}", line(role), unit(role));
        }
        if !self.silent.is_empty() {
            comment(
                text,
                "No frame of these messages arrived. Remove the # where the bus has the message:",
            );
        }
        for role in &self.silent {
            let _ = writeln!(text, "# {}  # {}", line(role), unit(role));
        }
        let mut doubtful: Vec<(&Proposed, &String)> = Vec::new();
        for role in &self.roles {
            doubtful.extend(role.doubt.as_ref().map(|doubt| (role, doubt)));
        }
        if !doubtful.is_empty() {
            comment(text, "Not clear. Remove the # where the role is right:");
        }
        for (role, doubt) in doubtful.iter().take(DOUBTS_MAX) {
            let _ = writeln!(
                text,
                "# {}  # {}: {}",
                line(role),
                unit(role),
                printable(doubt)
            );
        }
        if doubtful.len() > DOUBTS_MAX {
            let more = doubtful.len() - DOUBTS_MAX;
            comment(
                text,
                &format!("{more} more signals are not clear; they are not listed"),
            );
        }
    }
}
