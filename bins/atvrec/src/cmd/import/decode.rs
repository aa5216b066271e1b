//! What the decoders of the log will read of the imported lines.

use engine::Config;
use engine::config::Meaning;
use sample::{LogTime, Measurement};
use wire::Item;

use super::log::{Piece, Source};
use super::plausible::Drive;
use crate::exit::UsageError;

/// Measurements of a run.
#[derive(Default)]
pub struct Decoded {
    /// Number of measurements of each source.
    pub counts: Vec<usize>,
    /// The measurements by quantity.
    pub drive: Drive,
}

enum Decoder {
    Csv(Box<wire::csv::Decoder>),
    Alog(Box<wire::alog::Decoder>),
}

impl Decoder {
    fn new(meaning: &Meaning) -> anyhow::Result<Self> {
        Ok(match meaning {
            Meaning::Csv(map) => Self::Csv(Box::new(wire::csv::Decoder::new(map.format.clone())?)),
            Meaning::Alog(format) => {
                Self::Alog(Box::new(wire::alog::Decoder::new(format.clone())?))
            }
            _ => anyhow::bail!("the source of an imported file must be of kind csv or alog"),
        })
    }

    fn push(&mut self, bytes: &[u8], sink: impl FnMut(Item<'_>)) {
        match self {
            Self::Csv(decoder) => decoder.push(bytes, sink),
            Self::Alog(decoder) => decoder.push(bytes, sink),
        }
    }

    fn finish(&mut self, sink: impl FnMut(Item<'_>)) {
        if let Self::Alog(decoder) = self {
            decoder.finish(sink);
        }
    }
}

/// Decodes the pieces of a run and compares the measurements of each piece with those that the
/// importer found.
///
/// # Errors
/// A piece gives another number of measurements.
pub fn decode(
    config: &Config,
    sources: &[Source<'_>],
    pieces: &[Piece],
) -> anyhow::Result<Decoded> {
    let mut decoders = Vec::new();
    for source in sources {
        let found = config.sources.iter().find(|s| s.spec.name == source.name);
        let meaning = found.map(|source| &source.meaning);
        let meaning = meaning.ok_or_else(|| anyhow::anyhow!("no source {}", source.name))?;
        let mut decoder = Decoder::new(meaning)?;
        decoder.push(&source.preamble, |_| {});
        decoders.push(decoder);
    }
    let mut decoded = Decoded {
        counts: vec![0; sources.len()],
        ..Decoded::default()
    };
    for piece in pieces {
        let mut found = 0;
        decoders[piece.source].push(&piece.bytes, |item| {
            found += 1;
            decoded.take(piece.source, piece.time, item);
        });
        if let Some(expected) = piece.measurements.filter(|expected| *expected != found) {
            return Err(UsageError(format!(
                "{}:{}: the row has {expected} measurements, but {found} would be decoded from the log; \
                 nothing was written. Check the lines before the first row, comment and delimiter",
                sources[piece.source].path.display(),
                piece.line
            ))
            .into());
        }
    }
    let end = pieces.last().map_or(LogTime(0), |piece| piece.time);
    for (source, decoder) in decoders.iter_mut().enumerate() {
        decoder.finish(|item| decoded.take(source, end, item));
    }
    Ok(decoded)
}

impl Decoded {
    fn take(&mut self, source: usize, arrived: LogTime, item: Item<'_>) {
        let time = arrived.offset_seconds(-item.latency_s.unwrap_or(0.0));
        for measurement in item.measurements {
            self.counts[source] += 1;
            self.push(time, &measurement);
        }
    }

    fn push(&mut self, time: LogTime, measurement: &Measurement) {
        self.drive.push(time, measurement);
    }
}
