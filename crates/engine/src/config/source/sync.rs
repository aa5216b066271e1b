//! `[source.<name>.sync]`: a frame that marks the instant at which other messages were sampled.

use std::time::Duration;

use model::file::{ErrorCollector, Section, closest};

use super::CanMeaning;

/// Largest identifier of a standard and of an extended frame.
const ID_MAX: [u32; 2] = [0x7ff, 0x1fff_ffff];

/// A frame that marks the sampling of other messages.
#[derive(Clone, Debug, PartialEq)]
pub struct SyncFrame {
    /// Identifier, and whether it is an extended one.
    pub id: (u32, bool),
    /// Time from the arrival of the frame to the sampling, s; negative if the sampling comes first.
    pub offset_s: f64,
    /// Time after the frame in which the messages belong to it.
    pub within: Duration,
    /// Messages of each database that it marks.
    pub marks: Vec<Vec<bool>>,
}

/// Reads the table; `None` without it.
pub(super) fn read(
    section: &mut Section<'_>,
    meaning: &CanMeaning,
    collector: &mut ErrorCollector<'_>,
) -> Option<SyncFrame> {
    let mut sync = section.optional_section("sync", collector)?;
    let frame = sync.required::<u32>(
        "frame",
        "set the identifier of the sync frame, such as frame = 0x80",
        collector,
    );
    let extended = sync.or("extended", false, collector);
    let offset_s = sync.number_in("offset_s", -1.0..=1.0, 0.0, collector);
    let within_s = sync.number_in("within_s", 1e-4..=10.0, 0.05, collector);
    let names = sync.optional::<Vec<String>>("messages", collector);
    let known = meaning.names.iter().flatten();
    let known: Vec<&str> = known.map(String::as_str).collect();
    if let Some(field) = &names {
        for name in field
            .value
            .iter()
            .filter(|name| !known.contains(&name.as_str()))
        {
            let help = match closest(name, &known) {
                Some(near) => format!("did you mean \"{near}\"?"),
                None => "use the name of a message of the DBC files".to_owned(),
            };
            let problem = format!("no DBC file of this source has the message \"{name}\"");
            collector.add(&field.span, &field.name, problem, help);
        }
    }
    sync.finish(collector);
    let frame = frame?;
    let most = ID_MAX[usize::from(extended)];
    if frame.value > most {
        collector.add(
            &frame.span,
            &frame.name,
            format!("{:#x} is no identifier of such a frame", frame.value),
            format!("use an identifier up to {most:#x}, or set extended = true"),
        );
    }
    let is_marked = |name: &String| {
        let named = names.as_ref();
        named.is_none_or(|field| field.value.contains(name))
    };
    let of_file = |names: &Vec<String>| names.iter().map(is_marked).collect();
    Some(SyncFrame {
        id: (frame.value, extended),
        offset_s,
        within: Duration::from_secs_f64(within_s),
        marks: meaning.names.iter().map(of_file).collect(),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::config::{Config, Meaning};

    fn read(table: &str) -> Result<Config, String> {
        let text =
            format!("[source.x]\nkind = \"can\"\ninterface = \"can0\"\n[source.x.sync]\n{table}");
        Config::from_text(&text, Path::new(".")).map_err(|error| error.to_string())
    }

    #[test]
    fn a_sync_frame_marks_the_messages_that_are_named() {
        let config = read("frame = 0x80\nmessages = [\"Strain_FL\"]\n").expect("a configuration");
        let Meaning::Can(meaning) = &config.sources[0].meaning else {
            panic!("a CAN source")
        };
        let sync = meaning.sync.as_ref().expect("a sync frame");
        assert_eq!((sync.id, sync.offset_s), ((0x80, false), 0.0));
        let marked = sync.marks[0].iter().filter(|marked| **marked).count();
        assert_eq!(marked, 1);
        let all = read("frame = 0x80\noffset_s = -0.001\n").expect("a configuration");
        let Meaning::Can(meaning) = &all.sources[0].meaning else {
            panic!("a CAN source")
        };
        let sync = meaning.sync.as_ref().expect("a sync frame");
        assert!(sync.marks[0].iter().all(|marked| *marked));
        assert_eq!(sync.offset_s, -0.001);
    }

    #[test]
    fn a_bad_sync_frame_is_refused() {
        let error = read("frame = 0x800\n").expect_err("too large");
        assert!(error.contains("0x800 is no identifier"), "{error}");
        assert!(error.contains("extended = true"), "{error}");
        read("frame = 0x800\nextended = true\n").expect("an extended identifier");
        let error = read("frame = 1\nmessages = [\"Strain_F\"]\n").expect_err("unknown");
        assert!(error.contains("did you mean \"Strain_F"), "{error}");
        let error = read("offset_s = 0.1\n").expect_err("no frame");
        assert!(
            error.contains("set the identifier of the sync frame"),
            "{error}"
        );
    }
}
