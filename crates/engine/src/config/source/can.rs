//! `kind = "can"` and `kind = "slcan"`.

use std::ops::RangeInclusive;
use std::time::Duration;

use acq::{CanSpec, LinkSpec, SlcanSpec, SourceKind};
use wire::dbc::{Database, Issue};
use wire::slcan;

use super::{CanMeaning, LATENCY_SIGMA_S, Meaning, Read, read_port, sync};
use crate::config::files::{FileKind, Files, PROJECT_DBC};
use crate::config::roles;
use model::file::{ErrorCollector, Field, Problem, Section, closest};

/// Latencies that a message can have, s.
const LATENCY_S: RangeInclusive<f64> = 0.0..=10.0;

/// Longest time that a frame waits to be read if no DBC file decodes the bus: only the disk needs it.
const RECORDED_WITHIN: Duration = Duration::from_millis(6);

pub fn read_can(
    section: &mut Section<'_>,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
) -> Read {
    let interface = section.required::<String>(
        "interface",
        "set the network interface, such as interface = \"can0\"",
        collector,
    );
    if let Some(field) = &interface
        && (field.value.is_empty() || field.value.len() > 15)
    {
        collector.add(
            &field.span,
            &field.name,
            format!("\"{}\" is not a name of a network interface", field.value),
            "use a name of 1 to 15 characters; `ip link` lists the interfaces",
        );
    }
    let fd = section.or("fd", true, collector);
    let errors = section.or("error_frames", true, collector);
    let hardware_stamps = section.or("hardware_stamps", true, collector);
    let buffer = section.number_in("receive_buffer_mb", 0.1..=256.0, 8.0, collector);
    let link = read_link(section, fd, collector);
    let meaning = can_meaning(section, files, collector);
    let kind = interface.map(|interface| {
        let usual = CanSpec::new(interface.value);
        let read_within = match &meaning {
            Meaning::Can(can) if can.databases.is_empty() => RECORDED_WITHIN,
            _ => usual.read_within,
        };
        SourceKind::Can(CanSpec {
            fd,
            link,
            errors,
            hardware_stamps,
            receive_buffer_bytes: (buffer * f64::from(1 << 20)) as usize,
            read_within,
            ..usual
        })
    });
    (kind, Some(meaning), 1.0)
}

/// `[source.<name>.link]`: settings with which the recorder brings the interface up. Without the table
/// the system brings it up.
fn read_link(
    section: &mut Section<'_>,
    fd: bool,
    collector: &mut ErrorCollector<'_>,
) -> Option<LinkSpec> {
    let mut link = section.optional_section("link", collector)?;
    let mut rate = |key, range: RangeInclusive<u32>| {
        let field = link.optional::<u32>(key, collector)?;
        if !range.contains(&field.value) {
            collector.add(
                &field.span,
                &field.name,
                format!("{} bit/s is out of range", field.value),
                format!("use a bit rate from {} to {}", range.start(), range.end()),
            );
        }
        Some(field)
    };
    let bit_rate = rate("bitrate", 5_000..=1_000_000);
    let data_bit_rate = rate("data_bitrate", 5_000..=16_000_000);
    let restart = link.optional::<u32>("restart_ms", collector);
    let listen_only = link.optional::<bool>("listen_only", collector);
    if let Some(data) = &data_bit_rate {
        let slower = bit_rate.as_ref().filter(|bits| bits.value > data.value);
        if !fd {
            collector.add(
                &data.span,
                &data.name,
                "a data bit rate without CAN FD",
                "remove it, or remove `fd = false`",
            );
        } else if let Some(bits) = slower {
            collector.add(
                &data.span,
                &data.name,
                format!("{} bit/s is below bitrate = {}", data.value, bits.value),
                "set a data bit rate that is at least the bit rate",
            );
        }
    }
    if bit_rate.is_none() {
        let place = |field: &Field<u32>| (field.span.clone(), field.name.clone());
        let flag = listen_only
            .as_ref()
            .map(|f| (f.span.clone(), f.name.clone()));
        let idle = [
            data_bit_rate.as_ref().map(place),
            restart.as_ref().map(place),
            flag,
        ];
        for (span, name) in idle.into_iter().flatten() {
            let help = "set bitrate too, or remove the field (vcan interfaces have no bit rate)";
            collector.add(&span, &name, "has no effect without bitrate", help);
        }
    }
    link.finish(collector);
    let defaults = LinkSpec::new(0);
    Some(LinkSpec {
        bit_rate: bit_rate.map(|field| field.value),
        data_bit_rate: data_bit_rate.map(|field| field.value),
        restart_ms: restart.map_or(defaults.restart_ms, |field| field.value),
        listen_only: listen_only.map_or(defaults.listen_only, |field| field.value),
    })
}

pub fn read_slcan(
    section: &mut Section<'_>,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
) -> Read {
    let port = read_port(section, 115_200, collector);
    let bit_rate = section.optional::<u32>("bitrate", collector);
    if let Some(field) = &bit_rate
        && !slcan::BIT_RATES.contains(&field.value)
    {
        let known = slcan::BIT_RATES.map(|rate| rate.to_string()).join(", ");
        collector.add(
            &field.span,
            &field.name,
            format!("SLCAN adapters do not support {} bit/s", field.value),
            format!("use one of: {known}"),
        );
    }
    let listen_only = section.or("listen_only", false, collector);
    let timestamps = section.or("timestamps", true, collector);
    let meaning = can_meaning(section, files, collector);
    let kind = port.map(|port| {
        SourceKind::Slcan(SlcanSpec {
            port,
            bit_rate: bit_rate.map(|field| field.value),
            listen_only,
            timestamps,
        })
    });
    (kind, Some(meaning), 1.0)
}

fn can_meaning(
    section: &mut Section<'_>,
    files: &mut Files,
    collector: &mut ErrorCollector<'_>,
) -> Meaning {
    let names = section.optional::<Vec<String>>("dbc", collector);
    let (names, span, field) = match names {
        Some(field) => (field.value, field.span, field.name),
        None => (
            vec![PROJECT_DBC.to_owned()],
            section.span(),
            section.field_name("dbc"),
        ),
    };
    let skips = read_dbc_errors(section, collector);
    let (mut databases, mut warnings) = (Vec::new(), Vec::new());
    for name in names {
        let text = match files.read_text(&name, FileKind::Dbc) {
            Ok(text) => text,
            Err(error) => {
                collector.add(&span, &field, error.message, error.help);
                continue;
            }
        };
        let parsed = match skips {
            true => Database::parse_usable(text.as_bytes()),
            false => Database::parse(text.as_bytes()),
        };
        match parsed {
            Ok(database) => {
                warnings.extend(problems_of(&name, &database));
                databases.push(database);
            }
            Err(error) => {
                let issues = error.issues.into_iter();
                collector.add_foreign(issues.map(|issue| problem(&name, issue)));
            }
        }
    }
    let roles = section.section("roles", collector);
    let roles = roles::read(roles, &databases, collector);
    let mut meaning = CanMeaning::new(databases, roles);
    meaning.warnings = warnings;
    let latencies = section.section("message_latency_s", collector);
    let CanMeaning {
        names, latencies_s, ..
    } = &mut meaning;
    read_latencies(latencies, LATENCY_S, names, latencies_s, collector);
    let sigmas = section.section("message_latency_sigma_s", collector);
    let CanMeaning {
        names,
        latency_sigmas_s,
        ..
    } = &mut meaning;
    read_latencies(sigmas, LATENCY_SIGMA_S, names, latency_sigmas_s, collector);
    meaning.sync = sync::read(section, &meaning, collector);
    Meaning::Can(meaning)
}

/// `[source.<name>.message_latency_s]` and its standard deviations: of single messages, by the names of the DBC
/// files.
fn read_latencies(
    section: Section<'_>,
    range: RangeInclusive<f64>,
    all_names: &[Vec<String>],
    values: &mut [Vec<Option<f64>>],
    collector: &mut ErrorCollector<'_>,
) {
    for (message, field) in section.into_numbers(collector) {
        if !range.contains(&field.value) {
            collector.add(
                &field.span,
                &field.name,
                format!("{} s is out of range", field.value),
                format!("use a number from {} to {}", range.start(), range.end()),
            );
        }
        let mut by_file = all_names.iter().zip(&mut *values);
        let found = by_file.find_map(|(names, values)| {
            let at = names.iter().position(|name| *name == message)?;
            values.get_mut(at)
        });
        match found {
            Some(value) => *value = Some(field.value),
            None => {
                let names: Vec<&str> = all_names.iter().flatten().map(String::as_str).collect();
                let help = match closest(&message, &names) {
                    Some(near) => format!("did you mean \"{near}\"?"),
                    None => "use the name of a message of the DBC files".to_owned(),
                };
                let problem = format!("no DBC file of this source has the message \"{message}\"");
                collector.add(&field.span, &field.name, problem, help);
            }
        }
    }
}

/// `dbc_errors`: whether messages with errors are left out, or the configuration is refused.
fn read_dbc_errors(section: &mut Section<'_>, collector: &mut ErrorCollector<'_>) -> bool {
    let field = section.optional::<String>("dbc_errors", collector);
    match field.as_ref().map_or("skip", |field| field.value.as_str()) {
        "skip" => true,
        "refuse" => false,
        other => {
            if let Some(field) = &field {
                collector.add(
                    &field.span,
                    &field.name,
                    format!("\"{other}\" is not a way to treat errors of DBC files"),
                    "use \"skip\" to leave out messages with errors, or \"refuse\"",
                );
            }
            true
        }
    }
}

fn problem(file: &str, issue: Issue) -> Problem {
    Problem {
        file: file.to_owned(),
        line: issue.line,
        column: 0,
        field: issue.token,
        value: String::new(),
        message: issue.text,
        help: String::new(),
    }
}

/// What is left out of a DBC file, and what is odd in it.
fn problems_of(file: &str, database: &Database) -> Vec<Problem> {
    let left_out = database.left_out().iter().map(|part| {
        let help = match &part.message {
            Some(name) => {
                format!("the message {name} is left out; its frames are recorded, not decoded")
            }
            None => "this part of the file is left out".to_owned(),
        };
        Problem {
            help,
            ..problem(file, part.issue.clone())
        }
    });
    let odd = database.warnings().iter();
    let odd = odd.map(|issue| problem(file, issue.clone()));
    left_out.chain(odd).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config::Config;

    fn read_within(dbc: &str) -> Duration {
        let text = format!("[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n{dbc}");
        let config = Config::from_text(&text, Path::new(".")).expect("a configuration");
        match &config.sources[0].spec.kind {
            SourceKind::Can(can) => can.read_within,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn frames_that_are_decoded_are_read_sooner() {
        let decoded = CanSpec::new(String::new()).read_within;
        assert_eq!(read_within(""), decoded);
        assert_eq!(read_within("dbc = []\n"), RECORDED_WITHIN);
        assert!(decoded < RECORDED_WITHIN);
    }

    /// A message with an error costs itself, unless a role needs it or the configuration says so.
    #[test]
    fn a_bad_message_is_left_out_unless_a_role_needs_it() {
        let directory = tempfile::tempdir().expect("a directory");
        let dbc = "VERSION \"\"\nBU_: A\nBO_ 256 Good: 8 A\n SG_ s : 0|8@1+ (1,0) [0|0] \"rad\" A\n\
                   BO_ 257 Bad: 2 A\n SG_ t : 8|16@1+ (1,0) [0|0] \"rad\" A\n";
        std::fs::write(directory.path().join("in.dbc"), dbc).expect("written");
        let read = |more: &str| {
            let text = format!(
                "[source.x]\nkind = \"can\"\ninterface = \"can0\"\ndbc = [\"in.dbc\"]\n{more}"
            );
            Config::from_text(&text, directory.path()).map_err(|error| error.to_string())
        };
        let config = read("").expect("the good message is enough");
        let warnings: Vec<String> = config.warnings().collect();
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].contains("in.dbc:6: t: needs 3 bytes, but Bad has 2"));
        assert!(
            warnings[0].contains("the message Bad is left out"),
            "{warnings:?}"
        );
        read("[source.x.roles]\nsteer = \"Good.s\"\n").expect("a role of the good message");
        let error = read("[source.x.roles]\nsteer = \"Bad.t\"\n").expect_err("a role needs it");
        assert!(error.contains("the message Bad has an error"), "{error}");
        let error = read("dbc_errors = \"refuse\"\n").expect_err("refused");
        assert!(error.contains("needs 3 bytes"), "{error}");
        assert!(read("dbc_errors = \"ignore\"\n").is_err());
    }

    /// A message that arrives later than the others of its source has a latency of its own.
    #[test]
    fn a_message_can_have_a_latency_of_its_own() {
        let directory = tempfile::tempdir().expect("a directory");
        let dbc = "VERSION \"\"\nBU_: A\nBO_ 256 Early: 8 A\n SG_ s : 0|8@1+ (1,0) [0|0] \"rad\" A\n\
                   BO_ 257 Late: 8 A\n SG_ s : 0|8@1+ (1,0) [0|0] \"rad\" A\n";
        std::fs::write(directory.path().join("in.dbc"), dbc).expect("written");
        let read = |latencies: &str| {
            let text = format!(
                "[source.x]\nkind = \"can\"\ninterface = \"can0\"\ndbc = [\"in.dbc\"]\n\
                 [source.x.message_latency_s]\n{latencies}"
            );
            Config::from_text(&text, directory.path()).map_err(|error| error.to_string())
        };
        let config = read("Late = 0.003\n").expect("a configuration");
        let Meaning::Can(meaning) = &config.sources[0].meaning else {
            panic!("a CAN source")
        };
        assert_eq!(meaning.latencies_s, [[None, Some(0.003)]]);
        let error = read("Lat = 0.003\n").expect_err("no such message");
        assert!(error.contains("has the message \"Lat\""), "{error}");
        assert!(error.contains("did you mean \"Late\"?"), "{error}");
        let error = read("Late = -1\n").expect_err("the future");
        assert!(error.contains("-1 s is out of range"), "{error}");
    }
}
