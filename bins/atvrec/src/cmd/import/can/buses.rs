//! The buses of logs of CAN frames, as sources of a configuration.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use acq::SourceKind;
use engine::Config;
use engine::config::{Meaning, Source};
use wire::dbc::Database;

use super::super::{configuration_of, quoted, source_names as file_names};
use super::survey::{Channel, Survey};
use crate::cli::ImportCanArgs;
use crate::exit::UsageError;

/// Most identifiers in a message.
const SHOWN_MAX: usize = 6;
/// Longest name of an interface, of the configuration.
const INTERFACE_MAX: usize = 15;

/// A bus: a channel, or the channels of the same name in several files.
pub struct Bus {
    /// Name as a source.
    pub name: String,
    /// Name in the first of its files; empty if the file has no channels.
    pub channel: String,
    /// Positions of its files, with the channels in them.
    members: Vec<(usize, Option<u16>)>,
    contents: Channel,
}

impl Bus {
    /// Whether the channel of a file is of this bus.
    pub fn has(&self, file: usize, channel: Option<u16>) -> bool {
        self.members.contains(&(file, channel))
    }
}

/// The buses of all files, in the order of their first frames.
pub fn of(surveys: &[Survey]) -> Vec<Bus> {
    let paths: Vec<PathBuf> = surveys.iter().map(|survey| survey.path.clone()).collect();
    let stems = file_names(&paths);
    let mut buses: Vec<Bus> = Vec::new();
    for (file, survey) in surveys.iter().enumerate() {
        let unnamed = survey.channels.len() - 1;
        for (at, contents) in survey.channels.iter().enumerate() {
            let channel = (at < unnamed).then(|| u16::try_from(at).unwrap_or(u16::MAX));
            if contents.frames == 0 && channel.is_none() {
                continue;
            }
            let name = match channel {
                Some(_) => name_of(&survey.summary.channels[at]),
                None if surveys.len() == 1 => "can".to_owned(),
                None => stems[file].clone(),
            };
            let known = buses.iter_mut().find(|bus| bus.name == name);
            match known {
                Some(bus) => {
                    bus.members.push((file, channel));
                    bus.contents.add(contents);
                }
                None => buses.push(Bus {
                    name,
                    channel: match channel {
                        Some(_) => survey.summary.channels[at].clone(),
                        None => String::new(),
                    },
                    members: vec![(file, channel)],
                    contents: contents.clone(),
                }),
            }
        }
    }
    buses
}

/// Name of a channel as a source: that of its interface, or `can` with its number.
fn name_of(channel: &str) -> String {
    if !channel.is_empty() && channel.bytes().all(|byte| byte.is_ascii_digit()) {
        return format!("can{channel}");
    }
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let name: String = channel
        .chars()
        .map(|c| if is_part(c) { c } else { '_' })
        .collect();
    if name.is_empty() {
        "can".to_owned()
    } else {
        name
    }
}

/// Prints the buses.
pub fn print(buses: &[Bus]) {
    for bus in buses {
        println!("{}: {}", bus.name, bus.contents.words());
    }
}

/// The bus and the file of `--dbc`.
fn of_option(option: &str) -> (Option<&str>, &str) {
    match option.split_once('=') {
        Some((bus, file)) if !Path::new(option).exists() => (Some(bus), file),
        _ => (None, option),
    }
}

/// The DBC files of the options.
pub fn dbc_files(options: &[String]) -> Vec<PathBuf> {
    let files = options.iter().map(|option| of_option(option).1);
    files.map(PathBuf::from).collect()
}

/// Configuration of the log: the user's file, or one with these buses, their DBC files and the vehicle.
pub fn configuration(buses: &[Bus], args: &ImportCanArgs) -> anyhow::Result<Config> {
    if let Some(path) = &args.into.config {
        return Ok(Config::load(path)?);
    }
    let mut files = vec![Vec::new(); buses.len()];
    for option in &args.dbc {
        let (name, file) = of_option(option);
        if let Some(name) = name {
            let Some(bus) = buses.iter().position(|bus| bus.name == name) else {
                let names = names_of(buses);
                let text = format!("--dbc {option}: there is no bus {name}; the buses are {names}");
                return Err(UsageError(text).into());
            };
            files[bus].push(file);
            continue;
        }
        // A file that cannot be read or parsed is reported by the configuration.
        let database = std::fs::read(file).ok();
        let database = database.and_then(|bytes| Database::parse_usable(&bytes).ok());
        let fits = |bus: &Bus| match &database {
            Some(database) => bus.contents.has_of(database),
            None => true,
        };
        let mut fitting = (0..buses.len()).filter(|bus| fits(&buses[*bus])).peekable();
        if let (None, Some(database)) = (fitting.peek(), &database) {
            let all = buses.iter().flat_map(|bus| &bus.contents.identifiers);
            return Err(no_common(file, std::slice::from_ref(database), "the log", all).into());
        }
        fitting.for_each(|bus| files[bus].push(file));
    }
    let mut text = String::new();
    for (bus, files) in buses.iter().zip(files) {
        let files: Vec<String> = files.into_iter().map(quoted).collect();
        text.push_str(&format!(
            "[source.{}]\nkind = \"can\"\ninterface = {}\ndbc = [{}]\nsilent_after_s = 0\n\n",
            bus.name,
            quoted(&interface_of(bus, buses)),
            files.join(", "),
        ));
    }
    configuration_of(text, &args.into)
}

/// A name of an interface for a bus: its own, if it is short enough.
fn interface_of(bus: &Bus, buses: &[Bus]) -> String {
    if bus.name.len() <= INTERFACE_MAX {
        return bus.name.clone();
    }
    let number = buses
        .iter()
        .take_while(|other| other.name != bus.name)
        .count();
    format!("imported{number}")
}

fn names_of(buses: &[Bus]) -> String {
    let names: Vec<&str> = buses.iter().map(|bus| bus.name.as_str()).collect();
    names.join(", ")
}

/// Name of the source of each bus in the configuration.
///
/// # Errors
/// The user's configuration has no source of a bus.
pub fn source_names<'c>(
    config: &'c Config,
    buses: &[Bus],
    args: &ImportCanArgs,
) -> anyhow::Result<Vec<&'c str>> {
    let names = buses.iter().map(|bus| {
        let is_source = |source: &&Source| {
            let is_can = matches!(source.meaning, Meaning::Can(_));
            let interface = match &source.spec.kind {
                SourceKind::Can(can) => can.interface.as_str(),
                _ => "",
            };
            is_can && (source.spec.name == bus.name || interface == bus.name)
        };
        if let Some(source) = config.sources.iter().find(is_source) {
            return Ok(source.spec.name.as_str());
        }
        let config = args.into.config.as_deref().unwrap_or(Path::new(""));
        Err(UsageError(format!(
            "{} has no CAN source {name}, but the log has the bus {name} with {} frames; add a table \
             [source.{name}] with kind = \"can\" and interface = \"{name}\", and roles for its signals",
            config.display(),
            bus.contents.frames,
            name = bus.name
        ))
        .into())
    });
    names.collect()
}

/// Refuses DBC files that know no identifier of their bus.
pub fn check_databases(config: &Config, names: &[&str], buses: &[Bus]) -> anyhow::Result<()> {
    for (name, bus) in names.iter().zip(buses) {
        let source = config
            .sources
            .iter()
            .find(|source| source.spec.name == **name);
        let Some(Meaning::Can(can)) = source.map(|source| &source.meaning) else {
            continue;
        };
        let is_known = can.databases.iter().any(|known| bus.contents.has_of(known));
        if !can.databases.is_empty() && !bus.contents.identifiers.is_empty() && !is_known {
            let files = format!("the DBC files of source.{name}");
            let place = format!("the bus {}", bus.name);
            let identifiers = bus.contents.identifiers.iter();
            return Err(no_common(&files, &can.databases, &place, identifiers).into());
        }
    }
    Ok(())
}

impl Channel {
    /// Whether the database has a message of this bus.
    fn has_of(&self, database: &Database) -> bool {
        let mut all = self.identifiers.iter();
        all.any(|(id, extended)| database.by_id(*id, *extended).is_some())
    }
}

fn no_common<'i>(
    files: &str,
    databases: &[Database],
    place: &str,
    identifiers: impl Iterator<Item = &'i (u32, bool)>,
) -> UsageError {
    let messages = databases.iter().flat_map(Database::messages);
    let of_files = messages.map(|message| (message.id, message.extended));
    UsageError(format!(
        "{files} and {place} have no identifier in common: the DBC has {}, and the log has {}; give the DBC \
         file of this bus, or none",
        shown(of_files.collect()),
        shown(identifiers.copied().collect()),
    ))
}

/// The first identifiers in hexadecimal digits: three, or eight for 29 bits.
fn shown(identifiers: HashSet<(u32, bool)>) -> String {
    let mut all: Vec<(u32, bool)> = identifiers.into_iter().collect();
    all.sort_unstable_by_key(|(id, extended)| (*extended, *id));
    let mut texts: Vec<String> = all
        .iter()
        .take(SHOWN_MAX)
        .map(|(id, extended)| match extended {
            true => format!("{id:08X}"),
            false => format!("{id:03X}"),
        })
        .collect();
    if all.len() > SHOWN_MAX {
        texts.push(format!("and {} more", all.len() - SHOWN_MAX));
    }
    if texts.is_empty() {
        "none".to_owned()
    } else {
        texts.join(", ")
    }
}
