//! What a table states about the topic that it contains.

use std::collections::BTreeSet;

use engine::LeftOut;
use store::{Column, Reader, Tables, Values, describe};

/// Schemas of topics that are no tables: packed raw data, and pictures for viewers.
const NO_TABLES: [&str; 6] = [
    "atvrec.RawBytes",
    "atvrec.RawCan",
    "atvrec.RawNotices",
    "atvrec.RawTicks",
    "foxglove.FrameTransforms",
    "foxglove.SceneUpdate",
];

/// A topic of a log.
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Name of its schema.
    pub schema: String,
    /// Names of the sources that it comes from, or the part of the program that computed it.
    pub source: String,
}

impl Topic {
    /// A topic that is in the log or left out of it.
    pub fn new(reader: &Reader, left_out: &LeftOut, name: &str) -> Self {
        let in_log = reader.channels().filter(|channel| channel.topic == name);
        let mut channels: Vec<_> = in_log.map(|channel| (**channel).clone()).collect();
        channels.extend(left_out.channel(name));
        let sources = &reader.session().sources;
        let named = channels.iter().filter_map(|channel| {
            let source = channel.source?;
            let known = sources.iter().find(|known| known.id == source);
            known.map(|known| &*known.name)
        });
        let names: Vec<&str> = named.collect::<BTreeSet<_>>().into_iter().collect();
        Self {
            name: name.to_owned(),
            schema: channels
                .first()
                .map_or_else(String::new, |one| one.schema.clone()),
            source: match names.is_empty() {
                true => origin(name).to_owned(),
                false => names.join(", "),
            },
        }
    }

    /// All topics of a log that are tables, and those that are left out of it. A topic that cannot be read
    /// is reported and ignored.
    pub fn all(reader: &Reader, left_out: &LeftOut) -> Vec<Self> {
        let info = reader.info();
        let mut names: BTreeSet<&str> = left_out.topics().collect();
        for (name, (schema, _)) in &info.channels {
            if NO_TABLES.contains(&&**schema) {
                continue;
            }
            match Tables::new(reader, &[name]) {
                Ok(_) => {
                    names.insert(name);
                }
                Err(error) => tracing::warn!("the topic {name} is left out: {error}"),
            }
        }
        let names = names.into_iter();
        names
            .map(|name| Self::new(reader, left_out, name))
            .collect()
    }

    /// Unit of a column.
    pub fn unit<'c>(&self, column: &'c Column) -> Option<&'c str> {
        describe::unit(&self.schema, column)
    }

    /// Frame of reference of the measured and estimated values.
    pub fn frame(&self) -> Option<&'static str> {
        describe::frame(&self.name, &self.schema)
    }

    /// Frame of reference of a column: of numbers with a unit that is neither a time nor a temperature.
    pub fn frame_of(&self, column: &Column) -> Option<&'static str> {
        let unit = self.unit(column)?;
        let has_frame = matches!(column.values, Values::F64(_)) && !["s", "degC"].contains(&unit);
        self.frame().filter(|_| has_frame)
    }
}

/// Part of the program that computed a topic without a source.
fn origin(topic: &str) -> &'static str {
    match topic.split('/').nth(1) {
        Some("estimate" | "lagged" | "smoothed" | "model") => "estimator",
        Some("truth") => "truth",
        _ => "recorder",
    }
}
