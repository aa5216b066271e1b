//! Schemas and channels of a file, from all places of the file and its journal.

use std::collections::BTreeMap;
use std::sync::Arc;

use mcap::records::{Channel, Record};
use sample::SourceId;

use super::ChannelInfo;
use crate::{earlier, journal};

/// Schemas and channels by their numbers; of several definitions the first one is used.
#[derive(Clone, Debug, Default)]
pub(crate) struct Definitions {
    pub schemas: BTreeMap<u16, Schema>,
    pub channels: BTreeMap<u16, Channel>,
    /// Bytes of all of them and of the metadata in the file.
    bytes: u64,
}

/// A schema of a file.
#[derive(Clone, Debug)]
pub(crate) struct Schema {
    pub name: String,
    pub encoding: String,
    pub data: Arc<[u8]>,
}

impl Definitions {
    /// Whether `bytes` more can be kept, within a bound for all.
    pub(crate) fn allow(&mut self, bytes: u64, bound: u64) -> bool {
        let sum = self.bytes.saturating_add(bytes);
        let allowed = sum <= bound;
        if allowed {
            self.bytes = sum;
        }
        allowed
    }

    /// Takes a schema or a channel.
    pub(crate) fn add(&mut self, record: &Record<'_>, bound: u64) {
        match record {
            Record::Schema { header, data }
                if header.id != 0
                    && !self.schemas.contains_key(&header.id)
                    && self.allow(data.len() as u64, bound) =>
            {
                let schema = Schema {
                    name: header.name.clone(),
                    encoding: header.encoding.clone(),
                    data: Arc::from(data.as_ref()),
                };
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) if !self.channels.contains_key(&channel.id) => {
                let metadata = channel.metadata.iter();
                let bytes: usize = metadata.map(|(key, value)| key.len() + value.len()).sum();
                if self.allow((bytes + channel.topic.len()) as u64, bound) {
                    self.channels.insert(channel.id, channel.clone());
                }
            }
            _ => {}
        }
    }

    /// Takes the channels of a journal.
    pub(crate) fn add_journal(&mut self, channels: &[journal::Channel]) {
        for (channel, schema_name, schema_data) in channels {
            if self.channels.contains_key(&channel.id) {
                continue;
            }
            self.schemas
                .entry(channel.schema_id)
                .or_insert_with(|| Schema {
                    name: schema_name.clone(),
                    encoding: "protobuf".to_owned(),
                    data: Arc::clone(schema_data),
                });
            self.channels.insert(channel.id, channel.clone());
        }
    }

    /// The channels for readers, with the `used` ones whose definition is lost.
    pub(crate) fn infos<'a>(
        &self,
        used: impl Iterator<Item = &'a u16>,
    ) -> BTreeMap<u16, Arc<ChannelInfo>> {
        let mut infos: BTreeMap<u16, Arc<ChannelInfo>> = self
            .channels
            .iter()
            .map(|(id, channel)| (*id, Arc::new(self.info(channel))))
            .collect();
        for id in used {
            infos
                .entry(*id)
                .or_insert_with(|| Arc::new(self.info(&placeholder(*id))));
        }
        infos
    }

    fn info(&self, channel: &Channel) -> ChannelInfo {
        let schema = self.schemas.get(&channel.schema_id);
        let source = channel.metadata.get("source");
        let mut info = ChannelInfo {
            topic: channel.topic.clone(),
            schema: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
            schema_data: schema.map_or_else(|| Arc::from([]), |schema| Arc::clone(&schema.data)),
            message_encoding: channel.message_encoding.clone(),
            source: source.and_then(|id| id.parse().ok()).map(SourceId),
            metadata: channel.metadata.clone(),
            is_earlier: false,
        };
        earlier::present(&mut info);
        info
    }
}

/// The channel of messages whose own channel was defined in a part of the file that is lost.
pub(crate) fn placeholder(id: u16) -> Channel {
    Channel {
        id,
        schema_id: 0,
        topic: format!("/undefined/channel_{id:05}"),
        message_encoding: String::new(),
        metadata: BTreeMap::new(),
    }
}
