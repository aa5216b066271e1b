//! Roles without a message, and messages without a role.

use std::collections::{BTreeMap, BTreeSet};

use sample::{Measurement, Sample, SourceId};

use super::{Judgement, Misfit};
use crate::Config;
use crate::config::{CanMeaning, Meaning};

/// Messages of DBC files that arrived.
#[derive(Debug, Default)]
pub struct Messages {
    arrived: BTreeMap<(SourceId, String), u64>,
}

impl Messages {
    /// Takes a sample.
    pub fn push(&mut self, sample: &Sample) {
        if let Measurement::Signals(frame) = &sample.measurement {
            let name = (sample.source, frame.message.to_string());
            *self.arrived.entry(name).or_default() += 1;
        }
    }

    /// Compares the messages with the roles of the configuration.
    pub fn judge(&self, config: &Config, judgement: &mut Judgement) {
        for source in &config.sources {
            let Meaning::Can(can) = &source.meaning else {
                continue;
            };
            let (id, bus) = (source.spec.id, &source.spec.name);
            let mut with_role = BTreeSet::new();
            let mut absent: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
            for role in &can.roles {
                let Some((message, signal)) = names(can, role.database, role.message, role.signal)
                else {
                    continue;
                };
                with_role.insert(message);
                // Roles of the built-in file are not asked for.
                if role.at.is_some() && !self.arrived.contains_key(&(id, message.to_owned())) {
                    absent.entry(message).or_default().push(signal);
                }
            }
            for (message, signals) in absent {
                judgement.misfits.push(Misfit {
                    subject: format!("source {bus}, message {message}"),
                    found: format!(
                        "it does not arrive, but its signals {} have roles",
                        signals.join(", ")
                    ),
                    cause:
                        "the device is off or not connected, or the DBC file has another identifier"
                            .to_owned(),
                    remedy: "check the device and the identifier, or give the roles other signals"
                        .to_owned(),
                });
            }
            let own = self.arrived.iter().filter(|((source, _), _)| *source == id);
            let without = own.filter(|((_, message), _)| !with_role.contains(message.as_str()));
            judgement.without_role.extend(
                without.map(|((_, message), count)| format!("{bus}: {message} ({count} messages)")),
            );
        }
    }
}

/// Names of a message and of its signal.
fn names(can: &CanMeaning, database: usize, message: usize, signal: usize) -> Option<(&str, &str)> {
    let known = can.databases.get(database)?.messages().get(message)?;
    let name = can.names.get(database)?.get(message)?;
    Some((name, &known.signals.get(signal)?.name))
}
