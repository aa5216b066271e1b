//! `[storage.trigger]`: triggers of a recording, and the recorded times before and after a trigger.

use std::time::Duration;

use acq::RingLimits;
use sample::{Arrival, CanFrame, Event, EventKind, Notice, Payload, SourceId};

use super::source::{Meaning, Source};
use model::file::{ErrorCollector, Field, Section, closest};

/// Triggers of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Trigger {
    /// Limits of the memory; its duration is the recorded time before a trigger.
    pub memory: RingLimits,
    /// Recorded time after the last trigger.
    pub post: Duration,
    /// Whether a mark is a trigger.
    pub marks: bool,
    /// Frames that are triggers.
    pub can: Vec<CanRule>,
    /// Names of the kinds of estimator events that are triggers.
    pub events: Vec<&'static str>,
}

/// Rule for frames that are a trigger.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanRule {
    /// Name of the rule, for messages.
    pub name: String,
    /// The bus.
    pub source: SourceId,
    /// Identifier, without flag bits.
    pub id: u32,
    /// 29-bit identifier.
    pub extended: bool,
    /// Mask and value of the first bytes.
    pub data: Vec<(u8, u8)>,
}

impl CanRule {
    /// Whether the frame matches the rule.
    pub fn matches(&self, frame: &CanFrame) -> bool {
        let bytes = frame.bytes();
        frame.id == self.id
            && frame.flags.extended == self.extended
            && !frame.flags.error
            && bytes.len() >= self.data.len()
            && bytes
                .iter()
                .zip(&self.data)
                .all(|(byte, (mask, value))| byte & mask == value & mask)
    }
}

impl Trigger {
    /// Reason of the trigger, if the arrival is a trigger.
    pub fn fires(&self, arrival: &Arrival) -> Option<String> {
        match &arrival.payload {
            Payload::Notice(Notice::Mark(text)) if self.marks => Some(format!("mark \"{text}\"")),
            Payload::Can(frames) => {
                let mut rules = self.can.iter();
                let met = rules.find(|rule| {
                    rule.source == arrival.source && frames.iter().any(|frame| rule.matches(frame))
                });
                met.map(|rule| format!("frame of trigger.can.{}", rule.name))
            }
            _ => None,
        }
    }

    /// Whether an event of the estimator is a trigger.
    pub fn fires_on(&self, event: &Event) -> bool {
        self.events.contains(&event.kind.name())
    }

    /// Reads the table.
    pub fn read(
        mut section: Section<'_>,
        sources: &[Source],
        collector: &mut ErrorCollector<'_>,
    ) -> Self {
        let pre_s = section.number_in("pre_s", 0.0..=3_600.0, 10.0, collector);
        let post_s = section.number_in("post_s", 0.1..=86_400.0, 20.0, collector);
        let memory_mb = section.number_in("memory_mb", 1.0..=65_536.0, 64.0, collector);
        let marks = section.or("mark", true, collector);
        let events = section.optional::<Vec<String>>("events", collector);
        let events = events.map_or_else(Vec::new, |field| read_events(&field, collector));
        let can = section.section("can", collector);
        let can = can.into_sections(collector).into_iter();
        let can = can
            .filter_map(|(name, rule)| read_rule(name.value, rule, sources, collector))
            .collect();
        section.finish(collector);
        Self {
            memory: RingLimits {
                duration: Duration::from_secs_f64(pre_s),
                bytes: (memory_mb * 1_048_576.0) as usize,
            },
            post: Duration::from_secs_f64(post_s),
            marks,
            can,
            events,
        }
    }
}

fn read_events(
    field: &Field<Vec<String>>,
    collector: &mut ErrorCollector<'_>,
) -> Vec<&'static str> {
    let mut events = Vec::new();
    for name in &field.value {
        match EventKind::NAMES.into_iter().find(|known| known == name) {
            Some(event) => events.push(event),
            None => {
                let help = match closest(name, &EventKind::NAMES) {
                    Some(near) => format!("did you mean \"{near}\"?"),
                    None => format!("use some of: {}", EventKind::NAMES.join(", ")),
                };
                let message = format!("\"{name}\" is not an event of the estimator");
                collector.add(&field.span, &field.name, message, help);
            }
        }
    }
    events
}

fn read_rule(
    name: String,
    mut section: Section<'_>,
    sources: &[Source],
    collector: &mut ErrorCollector<'_>,
) -> Option<CanRule> {
    let source =
        section.required::<String>("source", "set a source of kind can or slcan", collector);
    let source = source.and_then(|field| {
        let is_bus = |source: &&Source| {
            source.spec.name == field.value && matches!(source.meaning, Meaning::Can(_))
        };
        let found = sources.iter().find(is_bus).map(|source| source.spec.id);
        if found.is_none() {
            collector.add(
                &field.span,
                &field.name,
                format!("source.{} does not exist or is not a CAN bus", field.value),
                "use a source of kind can or slcan",
            );
        }
        found
    });
    let id = section.required::<u32>("id", "set the identifier, such as id = 0x123", collector);
    let extended = section.optional::<bool>("extended", collector);
    let extended = match (&extended, &id) {
        (Some(field), _) => field.value,
        (None, Some(id)) => id.value > 0x7FF,
        (None, None) => false,
    };
    if let Some(field) = &id {
        let largest = if extended { 0x1FFF_FFFF } else { 0x7FF };
        if field.value > largest {
            collector.add(
                &field.span,
                &field.name,
                format!(
                    "{:#x} is out of range for this kind of identifier",
                    field.value
                ),
                format!("use at most {largest:#x}"),
            );
        }
    }
    let data = read_bytes(&mut section, "data", collector).unwrap_or_default();
    let mask = read_bytes(&mut section, "data_mask", collector);
    let mask = mask.unwrap_or_else(|| vec![0xFF; data.len()]);
    if mask.len() != data.len() {
        collector.add(
            &section.span(),
            &section.field_name("data_mask"),
            format!(
                "data_mask has {} bytes, but data has {}",
                mask.len(),
                data.len()
            ),
            "use the same number of bytes in data and data_mask",
        );
    }
    section.finish(collector);
    Some(CanRule {
        name,
        source: source?,
        id: id?.value,
        extended,
        data: mask.into_iter().zip(data).collect(),
    })
}

/// Bytes as hexadecimal digits, `"01 FF"`.
fn read_bytes(
    section: &mut Section<'_>,
    key: &'static str,
    collector: &mut ErrorCollector<'_>,
) -> Option<Vec<u8>> {
    let field = section.optional::<String>(key, collector)?;
    let words = field.value.split_whitespace();
    let bytes: Option<Vec<u8>> = words
        .map(|word| u8::from_str_radix(word, 16).ok())
        .collect();
    if bytes.is_none() {
        collector.add(
            &field.span,
            &field.name,
            format!("\"{}\" is not a list of bytes", field.value),
            "use pairs of hexadecimal digits separated by spaces: \"01 FF\"",
        );
    }
    bytes
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use sample::CanFlags;

    use super::*;
    use crate::Error;
    use crate::config::Config;

    const BUS: &str = "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n";

    fn read(text: &str) -> Result<Trigger, usize> {
        let config = Config::from_text(&format!("{BUS}{text}"), Path::new("."));
        match config {
            Ok(config) => Ok(config.storage.trigger.expect("a trigger")),
            Err(Error::Configuration(problems)) => Err(problems.0.len()),
            Err(other) => panic!("{other}"),
        }
    }

    fn frame(id: u32, extended: bool, data: &[u8]) -> CanFrame {
        let flags = CanFlags {
            extended,
            ..CanFlags::default()
        };
        CanFrame::new(id, flags, data).expect("eight bytes at most")
    }

    #[test]
    fn a_frame_matches_by_bus_identifier_and_masked_data() {
        let trigger = read(
            "[storage.trigger]\npre_s = 5\nevents = [\"lift\"]\n[storage.trigger.can.brake]\n\
             source = \"can0\"\nid = 0x123\ndata = \"00 10\"\ndata_mask = \"00 F0\"\n",
        )
        .expect("no problem");
        assert_eq!(trigger.memory.duration, Duration::from_secs(5));
        assert_eq!(trigger.events, ["lift"]);
        let rule = &trigger.can[0];
        assert!(rule.matches(&frame(0x123, false, &[9, 0x1F])));
        assert!(!rule.matches(&frame(0x123, false, &[9, 0x2F])));
        assert!(!rule.matches(&frame(0x123, false, &[9])));
        assert!(!rule.matches(&frame(0x124, false, &[9, 0x1F])));
        assert!(!rule.matches(&frame(0x123, true, &[9, 0x1F])));
    }

    #[test]
    fn all_problems_are_reported_together() {
        let problems = read(
            "[storage.trigger]\nevents = [\"lfit\"]\n[storage.trigger.can.brake]\n\
             source = \"can9\"\nid = 0x20000000\ndata = \"zz\"\n",
        );
        assert_eq!(problems, Err(4));
    }
}
