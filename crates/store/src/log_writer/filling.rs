//! Messages on their way into a chunk.

use std::collections::BTreeMap;
use std::io::Write;

use mcap::McapResult;
use mcap::records::MessageHeader;

use crate::channels::{Channel, Channels, Outgoing};
use crate::convert::{Body, Encoded};
use crate::dynamic::DynamicMessage;
use crate::mcap_file::{Chunk, McapFile};
use crate::proto::atvrec as pb;

/// A chunk of a file, which is being filled.
pub(super) struct Filling<'a, W> {
    pub(super) mcap: &'a mut McapFile<W>,
    /// Channels for the journal, if there is one.
    pub(super) new: Option<&'a mut Vec<pb::JournalChannel>>,
    pub(super) chunk: &'a mut Chunk,
}

impl<W: Write> Filling<'_, W> {
    /// Adds a message; its channel gets a number if it has none.
    pub(super) fn push(
        &mut self,
        channels: &mut Channels,
        message: &Outgoing<'_>,
        dynamic: &BTreeMap<String, DynamicMessage>,
    ) -> McapResult<()> {
        let channel = channels.get_mut(message.channel);
        let id = match channel.id {
            Some(id) => id,
            None => self.begin_channel(channel, dynamic)?,
        };
        channel.messages = channel.messages.wrapping_add(1);
        let header = MessageHeader {
            channel_id: id,
            sequence: channel.messages,
            log_time: message.log_time.0,
            publish_time: message.publish_time.0,
        };
        self.chunk.push(header, |out| message.body.encode(out));
        Ok(())
    }

    pub(super) fn push_encoded(
        &mut self,
        channels: &mut Channels,
        message: &Encoded,
        dynamic: &BTreeMap<String, DynamicMessage>,
    ) -> McapResult<()> {
        let outgoing = Outgoing {
            channel: channels.of(message),
            log_time: message.log_time,
            publish_time: message.publish_time,
            body: &Bytes(&message.data),
        };
        self.push(channels, &outgoing, dynamic)
    }

    fn begin_channel(
        &mut self,
        channel: &mut Channel,
        dynamic: &BTreeMap<String, DynamicMessage>,
    ) -> McapResult<u16> {
        let (descriptors, metadata) = channel.description(dynamic);
        let schema = self.mcap.add_schema(&channel.schema, &descriptors)?;
        let id = self.mcap.add_channel(schema, &channel.topic, &metadata)?;
        channel.id = Some(id);
        if let Some(new) = &mut self.new {
            new.push(pb::JournalChannel {
                id: id.into(),
                topic: channel.topic.to_string(),
                metadata: metadata.into_iter().collect(),
                schema_id: schema.into(),
                schema: channel.schema.to_string(),
                schema_data: descriptors,
            });
        }
        Ok(id)
    }
}

/// Contents that are encoded already.
struct Bytes<'a>(&'a [u8]);

impl Body for Bytes<'_> {
    fn encode(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.0);
    }
}
