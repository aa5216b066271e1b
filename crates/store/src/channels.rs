//! Channels of a log: topics and schemas that are made once, and the messages of records in them.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use sample::{LogTime, Sample, Signal, SourceId};

use crate::convert::{self, Address, Body, Encoded};
use crate::dynamic::{self, DynamicMessage};
use crate::schema;
use crate::{Record, Stage};

/// Schemas of the last states, which the next file of a run repeats.
pub(crate) const LATCHED: [&str; 3] = ["atvrec.ClockFit", "atvrec.Health", "atvrec.UtcOffset"];

/// Bytes of most messages.
const MESSAGE_BYTES: usize = 256;

/// A channel.
pub(crate) struct Channel {
    pub topic: Arc<str>,
    pub schema: Arc<str>,
    pub source: Option<SourceId>,
    /// Number in the file, once it has one.
    pub id: Option<u16>,
    /// Messages so far.
    pub messages: u32,
    /// Whether the next file of a run repeats its last message.
    pub is_latched: bool,
    /// Whether its messages are estimates or truth.
    pub is_estimate: bool,
    /// Whether another channel continues its topic, with another schema.
    is_ended: bool,
}

impl Channel {
    /// The schema and the metadata, for the file.
    pub(crate) fn description(&self, dynamic: &Schemas) -> (Vec<u8>, BTreeMap<String, String>) {
        let dynamic = dynamic.get(&*self.topic);
        let descriptors = dynamic.map_or_else(
            || schema::descriptor_set(&self.schema),
            DynamicMessage::descriptor_set,
        );
        let mut metadata = channel_metadata(self.source);
        metadata.extend(dynamic.map(DynamicMessage::metadata).unwrap_or_default());
        (descriptors, metadata)
    }
}

/// Metadata of a channel.
pub(crate) fn channel_metadata(source: Option<SourceId>) -> BTreeMap<String, String> {
    source
        .map(|source| ("source".to_owned(), source.0.to_string()))
        .into_iter()
        .collect()
}

/// Schemas that are made at run time, by topic.
pub(crate) type Schemas = BTreeMap<String, DynamicMessage>;

/// A message of a channel, which is not encoded yet.
pub(crate) struct Outgoing<'a> {
    /// Position of the channel.
    pub channel: usize,
    pub log_time: LogTime,
    pub publish_time: LogTime,
    pub body: &'a dyn Body,
}

/// All channels of a writer.
#[derive(Default)]
pub(crate) struct Channels {
    all: Vec<Channel>,
    /// Positions of channels with compiled schemas.
    by_address: HashMap<Address, usize>,
    /// Positions of channels with run-time schemas, by source and name of the message.
    by_name: HashMap<SourceId, HashMap<Arc<str>, usize>>,
    /// Plans of CAN messages, by source and address of the shared name. A channel has at most one.
    plans: HashMap<(SourceId, usize), Plan>,
}

/// Channel and signals of a CAN message. Frames of a decoder share the texts, so that their addresses
/// show that a frame has the signals of the schema in its order.
struct Plan {
    channel: usize,
    /// Keeps the address of the name.
    _name: Arc<str>,
    signals: Vec<Arc<str>>,
}

impl Plan {
    fn fits(&self, signals: &[Signal]) -> bool {
        signals.len() <= self.signals.len()
            && (signals.iter().zip(&self.signals))
                .all(|(signal, known)| Arc::ptr_eq(&signal.name, known))
    }
}

impl Channels {
    /// A channel by its position.
    pub(crate) fn get_mut(&mut self, position: usize) -> &mut Channel {
        &mut self.all[position]
    }

    /// Channel by its number in the file.
    pub(crate) fn by_id(&self, id: u16) -> Option<&Channel> {
        self.all.iter().find(|channel| channel.id == Some(id))
    }

    /// Position of the channel of an encoded message.
    pub(crate) fn of(&mut self, message: &Encoded) -> usize {
        self.named(&message.topic, &message.schema, message.source)
    }

    /// Position of the channel with these properties.
    pub(crate) fn named(&mut self, topic: &str, schema: &str, source: Option<SourceId>) -> usize {
        let known = self.all.iter().position(|channel| {
            !channel.is_ended
                && channel.source == source
                && *channel.topic == *topic
                && *channel.schema == *schema
        });
        known.unwrap_or_else(|| self.add(topic.into(), schema.into(), source))
    }

    fn add(&mut self, topic: Arc<str>, schema: Arc<str>, source: Option<SourceId>) -> usize {
        self.all.push(Channel {
            is_latched: LATCHED.contains(&&*schema),
            is_estimate: Stage::from_topic(&topic).is_some(),
            topic,
            schema,
            source,
            id: None,
            messages: 0,
            is_ended: false,
        });
        self.all.len() - 1
    }

    /// Passes the messages of a record to `take`. `dynamic` has the run-time schemas by topic.
    pub(crate) fn messages(
        &mut self,
        record: &Record,
        name: &dyn Fn(SourceId) -> String,
        dynamic: &mut Schemas,
        take: &mut dyn FnMut(&mut Self, Outgoing<'_>, &Schemas),
    ) {
        convert::encode(record, name, &mut |message| {
            let outgoing = Outgoing {
                channel: self.of_address(&message.address, name),
                log_time: message.log_time,
                publish_time: message.publish_time,
                body: message.body,
            };
            take(self, outgoing, dynamic);
        });
        if let Record::Sample(sample) = record
            && let Some(values) = dynamic::Values::of(sample)
        {
            let mut outgoing = Outgoing {
                channel: 0,
                log_time: sample.log_time,
                publish_time: sample.valid_time,
                body: &dynamic::InOrder(values.signals),
            };
            let key = values.plan_key(sample.source);
            let plan = key.and_then(|key| self.plans.get(&key));
            if let Some(plan) = plan.filter(|plan| plan.fits(values.signals)) {
                outgoing.channel = plan.channel;
                return take(self, outgoing, dynamic);
            }
            outgoing.channel = self.of_values(sample, &values, name, dynamic);
            let Some(known) = dynamic.get(&*self.all[outgoing.channel].topic) else {
                return;
            };
            if known.begins_with(values.signals) {
                self.plan(sample.source, &values, outgoing.channel);
                return take(self, outgoing, dynamic);
            }
            let body = dynamic::Frame {
                message: known,
                signals: values.signals,
            };
            outgoing.body = &body;
            take(self, outgoing, dynamic);
        }
    }

    /// Makes the plan of a CAN message, unless there is one with as many signals.
    fn plan(&mut self, source: SourceId, values: &dynamic::Values<'_>, channel: usize) {
        let (Some(key), Some(name)) = (values.plan_key(source), values.name) else {
            return;
        };
        let known = self.plans.get(&key);
        if known.is_some_and(|plan| plan.signals.len() >= values.signals.len()) {
            return;
        }
        self.plans.retain(|_, plan| plan.channel != channel);
        let signals = values.signals.iter();
        let plan = Plan {
            channel,
            _name: Arc::clone(name),
            signals: signals.map(|signal| Arc::clone(&signal.name)).collect(),
        };
        self.plans.insert(key, plan);
    }

    /// The messages of a record.
    pub(crate) fn encode(
        &mut self,
        record: &Record,
        name: &dyn Fn(SourceId) -> String,
        dynamic: &mut Schemas,
    ) -> Vec<Encoded> {
        let mut all = Vec::new();
        self.messages(record, name, dynamic, &mut |channels, message, _| {
            all.push(channels.all[message.channel].encoded(&message));
        });
        all
    }

    fn of_address(&mut self, address: &Address, name: &dyn Fn(SourceId) -> String) -> usize {
        if let Some(position) = self.by_address.get(address) {
            return *position;
        }
        let source = address.source.map(name).unwrap_or_default();
        let topic = address.topic.text(&source);
        let position = self.named(&topic, &address.schema(), address.source);
        self.by_address.insert(*address, position);
        position
    }

    fn of_values(
        &mut self,
        sample: &Sample,
        values: &dynamic::Values<'_>,
        name: &dyn Fn(SourceId) -> String,
        dynamic: &mut Schemas,
    ) -> usize {
        let of_source = self.by_name.entry(sample.source).or_default();
        let known = of_source.get(values.message).copied();
        let topic = match known {
            Some(position) => Arc::clone(&self.all[position].topic),
            None => values.topic(&name(sample.source)).into(),
        };
        if !dynamic.contains_key(&*topic) {
            let message = values.schema(&topic, &name(sample.source));
            dynamic.insert(topic.to_string(), message);
        }
        let message = dynamic.get_mut(&*topic);
        let grew = message.is_some_and(|message| message.extend(values.signals));
        if let (Some(position), false) = (known, grew) {
            return position;
        }
        if grew {
            // The schema has new fields: the topic continues in a new channel.
            let old = self.all.iter_mut().filter(|channel| channel.topic == topic);
            old.for_each(|channel| channel.is_ended = true);
            let all = &self.all;
            self.plans.retain(|_, plan| !all[plan.channel].is_ended);
        }
        let schema = dynamic.get(&*topic).map(DynamicMessage::schema_name);
        let position = self.named(&topic, &schema.unwrap_or_default(), Some(sample.source));
        let of_source = self.by_name.entry(sample.source).or_default();
        of_source.insert(values.message.into(), position);
        position
    }
}

impl Channel {
    /// A message of this channel, encoded.
    pub(crate) fn encoded(&self, message: &Outgoing<'_>) -> Encoded {
        let mut data = Vec::with_capacity(MESSAGE_BYTES);
        message.body.encode(&mut data);
        Encoded {
            topic: Arc::clone(&self.topic),
            schema: Arc::clone(&self.schema),
            source: self.source,
            log_time: message.log_time,
            publish_time: message.publish_time,
            data,
        }
    }
}

#[cfg(test)]
mod tests {
    use sample::{Measurement, SignalFrame};

    use super::*;

    fn record(message: &Arc<str>, names: &[Arc<str>]) -> Record {
        let signals = names.iter().zip(1..).map(|(name, value)| Signal {
            name: Arc::clone(name),
            value: f64::from(value),
            unit: "".into(),
        });
        Record::Sample(Sample {
            source: SourceId(1),
            log_time: LogTime(1),
            valid_time: LogTime(1),
            device_time: None,
            measurement: Measurement::Signals(SignalFrame {
                message: Arc::clone(message),
                id: 5,
                signals: signals.collect(),
            }),
        })
    }

    /// Frames with shared names have a plan. Frames with other signals, in another order or with names
    /// of their own give the bytes that they give without one.
    #[test]
    fn plans_change_no_message() {
        let name = |_| "bus".to_owned();
        let message: Arc<str> = "M".into();
        let names: Vec<Arc<str>> = ["a", "b", "c", "d"].map(Into::into).into();
        let turned = [3, 1].map(|place: usize| Arc::clone(&names[place]));
        let own: Vec<Arc<str>> = names.iter().map(|name| (**name).into()).collect();
        let shared = [&names[..2], &names[..3], &turned, &names[..2], &own, &names].concat();
        let lengths = [2, 3, 2, 2, 4, 4, 0];
        let mut rest = &shared[..];
        let (mut planned, mut schemas) = (Channels::default(), Schemas::new());
        let (mut plain, mut plain_schemas) = (Channels::default(), Schemas::new());
        for length in lengths {
            let (signals, after) = rest.split_at(length);
            rest = after;
            let record = record(&message, signals);
            let found = planned.encode(&record, &name, &mut schemas);
            plain.plans.clear();
            let expected = plain.encode(&record, &name, &mut plain_schemas);
            assert_eq!(found, expected);
            assert_eq!(planned.all.len(), plain.all.len());
            assert!(planned.plans.len() <= 1);
        }
        assert_eq!(planned.plans.len(), 1);
    }
}
