//! A topic as columns: every field of its messages as one list, by the channel's own schema.

mod keyed;
mod plan;
mod values;
mod walk;

use std::sync::Arc;

use sample::LogTime;

use crate::reader::{ChannelInfo, Missing, Reader, Selection};
use crate::{Error, Result};
use plan::Plan;
pub use values::Values;

/// All messages of a topic within a stretch of time, one row a message.
///
/// Fields of messages inside of messages are flattened, their names joined by dots
/// (`acceleration_m_s2.x`). Entries of wheels, axles and suspension members have columns of their own,
/// without the name of the list: `fl.z_n`, `fl.tie_rod.raw_counts`, `front.friction`; of further axles
/// `axle3_left.z_n` and `axle3.friction`. Fields below any other repeated message become lists. A
/// message that contains itself is left as bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Log clock when each row was recorded or computed, ns since 1970.
    pub log_time_ns: Vec<i64>,
    /// Log clock when each row was true, ns since 1970.
    pub publish_time_ns: Vec<i64>,
    /// The fields, in the order of the schema.
    pub columns: Vec<Column>,
    /// Damaged or malformed messages, which have no rows.
    pub missing: Vec<Missing>,
}

/// One field of all messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name, dotted below other messages.
    pub name: String,
    /// Its unit, if the channel's metadata has one; the project's own schemas have the unit in the
    /// name.
    pub unit: String,
    /// Names of its values, if it is an enumeration.
    pub names: Vec<(i32, String)>,
    /// One entry a row. A number with a fraction is NaN if it, or the message around it, is absent;
    /// anything else has the default of its type then.
    pub values: Values,
    /// The rows that have the field, if it is no number with a fraction and the schema distinguishes
    /// absence from zero (`optional`, `oneof`).
    pub present: Option<Vec<bool>>,
}

impl Column {
    fn begin_row(&mut self) {
        self.values.push_absent();
        if let Some(present) = &mut self.present {
            present.push(false);
        }
    }

    fn truncate(&mut self, rows: usize) {
        self.values.truncate(rows);
        if let Some(present) = &mut self.present {
            present.truncate(rows);
        }
    }
}

impl Table {
    /// Adds the message as a row, or leaves the table as it was.
    fn push(
        &mut self,
        plan: &mut Plan,
        data: &[u8],
    ) -> std::result::Result<(), prost::DecodeError> {
        let rows = self.log_time_ns.len();
        for column in &mut self.columns {
            column.begin_row();
        }
        let walked = walk::message(plan, &mut self.columns, rows, data);
        for column in &mut self.columns {
            if walked.is_err() {
                column.truncate(rows);
            } else {
                column.values.end_row();
            }
        }
        walked
    }
}

/// Decodes messages of one channel one by one into the columns of a [`Table`].
pub struct RowDecoder {
    plan: Plan,
    table: Table,
}

impl RowDecoder {
    /// Decoder of a channel.
    ///
    /// # Errors
    /// If the schema of the channel is no protobuf schema.
    pub fn new(channel: &ChannelInfo) -> Result<Self> {
        let mut table = Table::default();
        let plan = Plan::new(channel, 0, &mut table.columns).map_err(|what| Error::Schema {
            topic: channel.topic.clone(),
            schema: channel.schema.clone(),
            what,
        })?;
        Ok(Self { plan, table })
    }

    /// Columns that can be numbers.
    pub fn numeric(&self) -> impl Iterator<Item = &str> {
        let columns = self.table.columns.iter();
        let is_number = |column: &&Column| column.values.is_numeric();
        columns.filter(is_number).map(|column| column.name.as_str())
    }

    /// Numbers of a message: name of the column and value. Damaged messages have none.
    pub fn numbers(&mut self, data: &[u8]) -> impl Iterator<Item = (&str, f64)> {
        for column in &mut self.table.columns {
            column.truncate(0);
        }
        let _ = self.table.push(&mut self.plan, data);
        let columns = self.table.columns.iter();
        columns.filter_map(|column| Some((column.name.as_str(), column.values.first_number()?)))
    }
}

impl Reader {
    /// A topic as columns, from `start` to `end`, both included.
    ///
    /// # Errors
    /// If the log has no such topic, its messages are not encoded as protobuf, its schema is no protobuf schema, two schemas of the topic
    /// contradict each other, or a file can no longer be read. A malformed message is no error: see
    /// [`Table::missing`].
    pub fn table(&self, topic: &str, start: LogTime, end: LogTime) -> Result<Table> {
        let mut table = Table::default();
        let mut plans: Vec<(Arc<ChannelInfo>, Plan)> = Vec::new();
        let mut known = false;
        for channel in self.channels().filter(|channel| channel.topic == topic) {
            known = true;
            let encoding = &channel.message_encoding;
            if !matches!(encoding.as_str(), "" | "protobuf") {
                return Err(Error::Encoding {
                    topic: topic.to_owned(),
                    schema: channel.schema.clone(),
                    encoding: encoding.clone(),
                });
            }
            // Messages of a channel without a schema are left out.
            if !channel.has_no_schema() {
                plan_of(&mut plans, &mut table, channel)?;
            }
        }
        if !known {
            let known: Vec<String> = self.info().channels.into_keys().collect();
            return Err(Error::NoTopic {
                topic: topic.to_owned(),
                known: known.join(", "),
            });
        }
        let mut messages = self.messages(Selection::topics([topic]).between(start, end));
        for message in messages.by_ref() {
            let message = message?;
            if message.channel.has_no_schema() {
                continue;
            }
            let plan = plan_of(&mut plans, &mut table, &message.channel)?;
            let plan = &mut plans[plan].1;
            match table.push(plan, &message.data) {
                Ok(()) => {
                    table.log_time_ns.push(message.log_time.0.cast_signed());
                    table
                        .publish_time_ns
                        .push(message.publish_time.0.cast_signed());
                }
                Err(cause) => table.missing.push(Missing::BadMessage {
                    topic: topic.to_owned(),
                    log_time: message.log_time,
                    text: cause.to_string(),
                }),
            }
        }
        table.missing.extend(messages.missing().iter().cloned());
        let unreadable = |missing: &Missing| matches!(missing, Missing::NoSchema { topic: of, .. } if of == topic);
        table
            .missing
            .extend(self.info().missing.into_iter().filter(unreadable));
        Ok(table)
    }
}

/// Position of the channel's plan, made if there is none yet.
fn plan_of(
    plans: &mut Vec<(Arc<ChannelInfo>, Plan)>,
    table: &mut Table,
    channel: &Arc<ChannelInfo>,
) -> Result<usize> {
    let same = |known: &(Arc<ChannelInfo>, Plan)| {
        Arc::ptr_eq(&known.0, channel)
            || (known.0.schema == channel.schema && known.0.schema_data == channel.schema_data)
    };
    if let Some(position) = plans.iter().position(same) {
        return Ok(position);
    }
    let rows = table.log_time_ns.len();
    let plan = Plan::new(channel, rows, &mut table.columns).map_err(|what| Error::Schema {
        topic: channel.topic.clone(),
        schema: channel.schema.clone(),
        what,
    })?;
    plans.push((Arc::clone(channel), plan));
    Ok(plans.len() - 1)
}

#[cfg(test)]
mod tests;
