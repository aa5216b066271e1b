//! A topic as columns: every field of its messages as one list, by the channel's own schema.

mod instants;
mod keyed;
mod plan;
mod values;
mod walk;

use std::collections::BTreeMap;
use std::sync::Arc;

use sample::LogTime;

use crate::reader::{ChannelInfo, MessageRef, Missing, Reader, Selection};
use crate::{Encoded, Error, Result};
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
    /// The same column without rows.
    #[must_use]
    pub fn without_rows(&self) -> Self {
        Self {
            name: self.name.clone(),
            unit: self.unit.clone(),
            names: self.names.clone(),
            values: self.values.empty(0),
            present: self.present.as_ref().map(|_| Vec::new()),
        }
    }

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
    /// Takes all rows out and leaves the columns.
    fn split_off_rows(&mut self) -> Self {
        let rows = self.log_time_ns.len();
        let columns = self.columns.iter_mut().map(|column| Column {
            name: column.name.clone(),
            unit: column.unit.clone(),
            names: column.names.clone(),
            values: column.values.take(rows),
            present: column.present.as_mut().map(std::mem::take),
        });
        Self {
            columns: columns.collect(),
            log_time_ns: std::mem::take(&mut self.log_time_ns),
            publish_time_ns: std::mem::take(&mut self.publish_time_ns),
            missing: std::mem::take(&mut self.missing),
        }
    }

    /// Adds the columns of `all` that this table does not have yet, absent in all rows. `all` are those of
    /// [`Reader::columns`], whose first columns are those of each batch.
    pub fn pad(&mut self, all: &[Column]) {
        for column in all.iter().skip(self.columns.len()) {
            let mut column = column.clone();
            for _ in &self.log_time_ns {
                column.begin_row();
                column.values.end_row();
            }
            self.columns.push(column);
        }
    }

    fn push_times(&mut self, log_time: LogTime, publish_time: LogTime) {
        self.log_time_ns.push(log_time.0.cast_signed());
        self.publish_time_ns.push(publish_time.0.cast_signed());
    }

    fn truncate(&mut self, rows: usize) {
        self.log_time_ns.truncate(rows);
        self.publish_time_ns.truncate(rows);
        for column in &mut self.columns {
            column.truncate(rows);
        }
    }

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

    /// Adds a message as a row.
    ///
    /// # Errors
    /// If the message does not follow its schema; there is no row then.
    pub fn push(&mut self, message: &Encoded) -> Result<()> {
        let pushed = self.table.push(&mut self.plan, &message.data);
        pushed.map_err(|cause| Error::BadMessage {
            topic: message.topic.to_string(),
            log_time: message.log_time.0,
            cause: cause.into(),
        })?;
        self.table
            .push_times(message.log_time, message.publish_time);
        Ok(())
    }

    /// Rows that were not taken yet.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.table.log_time_ns.len()
    }

    /// Takes the rows and leaves the columns.
    pub fn take(&mut self) -> Table {
        self.table.split_off_rows()
    }

    /// Columns that can be numbers.
    pub fn numeric(&self) -> impl Iterator<Item = &str> {
        let columns = self.table.columns.iter();
        let is_number = |column: &&Column| column.values.is_numeric();
        columns.filter(is_number).map(|column| column.name.as_str())
    }

    /// Numbers of a message: name of the column and value. Damaged messages have none.
    pub fn numbers(&mut self, data: &[u8]) -> impl Iterator<Item = (&str, f64)> {
        self.table.truncate(0);
        let _ = self.table.push(&mut self.plan, data);
        let columns = self.table.columns.iter();
        columns.filter_map(|column| Some((column.name.as_str(), column.values.first_number()?)))
    }
}

impl Reader {
    /// A topic as columns, from `start` to `end`, both included.
    ///
    /// # Errors
    /// As [`Reader::tables`].
    pub fn table(&self, topic: &str, start: LogTime, end: LogTime) -> Result<Table> {
        let tables = self.tables(&[topic], start, end)?;
        Ok(tables.into_iter().next().unwrap_or_default())
    }

    /// Several topics as columns, from `start` to `end`, both included: one table for each, in the order
    /// of `topics`. Each chunk is read and inflated once for all topics.
    ///
    /// # Errors
    /// If the log has no such topic, its messages are not encoded as protobuf, its schema is no protobuf
    /// schema, two schemas of the topic contradict each other, or a file can no longer be read. A
    /// malformed message is no error: see [`Table::missing`].
    pub fn tables(
        &self,
        topics: &[impl AsRef<str>],
        start: LogTime,
        end: LogTime,
    ) -> Result<Vec<Table>> {
        let mut tables = Vec::new();
        self.each_batch(topics, [start, end], usize::MAX, |topic, table| {
            tables.push((topic, table));
            Ok::<(), Error>(())
        })?;
        tables.sort_by_key(|(topic, _)| *topic);
        Ok(tables.into_iter().map(|(_, table)| table).collect())
    }

    /// Columns of a topic without rows: as they are at the end of the stretch of time. Entries with
    /// names that the schema does not tell are found by reading through the messages.
    ///
    /// # Errors
    /// As [`Reader::tables`].
    pub fn columns(&self, topic: &str, [start, end]: [LogTime; 2]) -> Result<Table> {
        let open = Tables::new(self, &[topic])?;
        if !open.all.iter().any(OpenTable::can_grow) {
            return Ok(open.all.into_iter().next().unwrap_or_default().table);
        }
        let mut last = Table::default();
        self.each_batch(&[topic], [start, end], BATCH_ROWS, |_, mut table| {
            table.truncate(0);
            last = table;
            Ok::<(), Error>(())
        })?;
        Ok(last)
    }

    /// Calls `take` with the position of a topic and at most `rows` rows of it, again and again, and with
    /// the rest of each topic at the end. The memory does not grow with the length of the log, unless
    /// `rows` is unlimited.
    ///
    /// # Errors
    /// As [`Reader::tables`], and any error of `take`.
    pub fn each_batch<E: From<Error>>(
        &self,
        topics: &[impl AsRef<str>],
        [start, end]: [LogTime; 2],
        rows: usize,
        mut take: impl FnMut(usize, Table) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let mut open = Tables::new(self, topics)?;
        let names = topics.iter().map(|topic| topic.as_ref());
        let mut messages = self.messages(Selection::topics(names).between(start, end));
        while let Some(message) = messages.next_ref() {
            if let Some(position) = open.push(&message?)
                && open.rows(position) >= rows
            {
                take(position, open.take(position))?;
            }
        }
        let missing = messages.missing().to_vec();
        for position in 0..topics.len() {
            let mut table = open.take(position);
            table.missing.extend(missing.iter().cloned());
            take(position, table)?;
        }
        Ok(())
    }
}

/// Rows of a batch of [`Reader::each_batch`] if nothing else matters.
const BATCH_ROWS: usize = 1 << 14;

/// A table that is being filled, with the plans of its channels.
#[derive(Default)]
struct OpenTable {
    topic: String,
    table: Table,
    plans: Vec<(Arc<ChannelInfo>, Plan)>,
}

impl OpenTable {
    fn push(&mut self, plan: usize, message: &MessageRef<'_>) {
        let pushed = self.table.push(&mut self.plans[plan].1, message.data);
        let table = &mut self.table;
        match pushed {
            Ok(()) => table.push_times(message.log_time, message.publish_time),
            Err(cause) => table.missing.push(Missing::BadMessage {
                topic: self.topic.clone(),
                log_time: message.log_time,
                text: cause.to_string(),
            }),
        }
    }

    /// Whether messages may add columns.
    fn can_grow(&self) -> bool {
        self.plans.iter().any(|(_, plan)| !plan.keyed.is_empty())
    }
}

/// Tables of several topics that are filled message by message, for readers that need messages of other
/// topics in the same pass.
pub struct Tables {
    all: Vec<OpenTable>,
    /// For each file and number of a channel: position of the table, and of the plan in it.
    places: Vec<Vec<Option<(usize, usize)>>>,
}

impl Tables {
    /// Empty tables, with the columns that the schemas tell.
    ///
    /// # Errors
    /// As [`Reader::tables`].
    pub fn new(reader: &Reader, topics: &[impl AsRef<str>]) -> Result<Self> {
        let names = topics.iter().map(AsRef::as_ref);
        let positions: BTreeMap<&str, usize> = names.zip(0..).collect();
        let mut all: Vec<OpenTable> = Vec::new();
        all.resize_with(topics.len(), OpenTable::default);
        let mut places = Vec::new();
        for file in &reader.files {
            let mut of_file = Vec::new();
            for (id, channel) in &file.index.channels {
                let Some(position) = positions.get(channel.topic.as_str()) else {
                    continue;
                };
                all[*position].topic.clone_from(&channel.topic);
                let encoding = &channel.message_encoding;
                if !matches!(encoding.as_str(), "" | "protobuf") {
                    return Err(Error::Encoding {
                        topic: channel.topic.clone(),
                        schema: channel.schema.clone(),
                        encoding: encoding.clone(),
                    });
                }
                let OpenTable { table, plans, .. } = &mut all[*position];
                // Messages of a channel without a schema are left out.
                if channel.has_no_schema() {
                    table.missing.push(channel.without_schema(&file.path));
                    continue;
                }
                let plan = plan_of(plans, table, channel)?;
                of_file.resize(usize::from(*id) + 1, None);
                of_file[usize::from(*id)] = Some((*position, plan));
            }
            places.push(of_file);
        }
        if let Some(unknown) = all.iter().position(|one| one.topic.is_empty()) {
            let known: Vec<String> = reader.info().channels.into_keys().collect();
            return Err(Error::NoTopic {
                topic: topics[unknown].as_ref().to_owned(),
                known: known.join(", "),
            });
        }
        Ok(Self { all, places })
    }

    /// Adds a message as a row of the table of its topic, and returns the position of the topic; `None`
    /// if the topic has no table.
    pub fn push(&mut self, message: &MessageRef<'_>) -> Option<usize> {
        let (file, id) = message.place;
        let (position, plan) = (*self.places.get(file)?.get(usize::from(id))?)?;
        self.all[position].push(plan, message);
        Some(position)
    }

    /// Rows of a table that were not taken yet.
    #[must_use]
    pub fn rows(&self, position: usize) -> usize {
        self.all[position].table.log_time_ns.len()
    }

    /// Takes the rows of a table.
    pub fn take(&mut self, position: usize) -> Table {
        self.all[position].table.split_off_rows()
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
