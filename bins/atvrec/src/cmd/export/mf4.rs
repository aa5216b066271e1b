//! Tables as an MF4 file (ASAM MDF 4.10): a channel group for each topic, at the rate of its messages.

mod blocks;

use std::io;

use engine::output::{Target, WriteError};
use store::{Column, Table, UtcOffset, Values};

use super::topic::Topic;
use super::{Input, Written, has_value};
use blocks::{Blocks, Channel, Group, Header, Kind};

/// Writes topics as channel groups. The times of the rows are the master channel of the group, `log_time`,
/// in seconds since the start of the file.
struct Writer {
    blocks: Blocks,
    header: Header,
    groups: Vec<Group>,
}

/// Writes topics to the target, and prints what was written. Texts, bytes and lists are left out.
pub fn write(
    input: &Input<'_>,
    topics: &[Topic],
    utc: Option<UtcOffset>,
    target: &Target,
    is_compressed: bool,
) -> anyhow::Result<Written> {
    let mut written = Written::default();
    let mut channels: Vec<Channels> = topics.iter().map(|_| Channels::default()).collect();
    input.each(topics, [0.0, 0.5], &mut Vec::new(), |topic, table| {
        channels[topic].add(&table);
        Ok(())
    })?;
    report_left_out(topics, &channels);
    target.write_by(|file| {
        let write = || -> anyhow::Result<()> {
            let groups = topics.iter().zip(&channels);
            let groups = groups.map(|(topic, channels)| group(topic, &channels.of(&channels.all)));
            let mut writer = Writer {
                blocks: Blocks::new(file, is_compressed)?,
                header: Header::new(input, utc),
                groups: groups.collect(),
            };
            let missing = &mut written.missing;
            let rows = &mut written.rows;
            input.each(topics, [0.5, 1.0], missing, |topic, mut table| {
                table.pad(&channels[topic].all);
                *rows += table.log_time_ns.len();
                Ok(writer.write(topic, &table, &channels[topic].of(&table.columns))?)
            })?;
            Ok(writer.finish()?)
        };
        write().map_err(WriteError::from)
    })?;
    let path = target.path().display();
    println!(
        "{path}: {} rows, {} channel groups",
        written.rows,
        topics.len()
    );
    Ok(written)
}

/// The columns of a topic, which are known at its end.
#[derive(Default)]
struct Channels {
    /// Without rows.
    all: Vec<Column>,
    /// Which of them have a value.
    has_value: Vec<bool>,
}

impl Channels {
    fn add(&mut self, table: &Table) {
        self.has_value.resize(table.columns.len(), false);
        for (has, column) in self.has_value.iter_mut().zip(&table.columns) {
            *has |= has_value(column);
        }
        if table.columns.len() > self.all.len() {
            self.all = table.columns.iter().map(Column::without_rows).collect();
        }
    }

    /// Those of `columns` that are channels of the file.
    fn of<'c>(&self, columns: &'c [Column]) -> Vec<&'c Column> {
        let columns = columns.iter().zip(&self.has_value);
        let chosen = columns.filter(|(column, has)| **has && kind(column).is_some());
        chosen.map(|(column, _)| column).collect()
    }
}

/// Reports the columns that are not in the file although they have values.
fn report_left_out(topics: &[Topic], channels: &[Channels]) {
    let (mut names, mut count) = (Vec::new(), 0);
    for (topic, channels) in topics.iter().zip(channels) {
        let columns = channels.all.iter().zip(&channels.has_value);
        let others = columns.filter(|(column, has)| **has && kind(column).is_none());
        let others = others.count();
        if others > 0 {
            names.push(&*topic.name);
            count += others;
        }
    }
    if count > 0 {
        tracing::warn!(
            "{count} columns with texts, bytes or lists are not in the MF4 file, of {}; a dataset \
             (--all) contains them",
            names.join(", ")
        );
    }
}

impl Header {
    fn new(input: &Input<'_>, utc: Option<UtcOffset>) -> Self {
        let begin_ns = input.span.begin.0.cast_signed();
        let start_ns = utc.map_or(begin_ns, |utc| begin_ns.saturating_add(utc.offset_ns));
        Self {
            begin_ns,
            start_ns: start_ns.max(0).cast_unsigned(),
            run: input.reader.session().run_id.clone(),
        }
    }
}

impl Writer {
    /// Writes rows of a topic. `columns` are those of its channels.
    fn write(&mut self, topic: usize, table: &Table, columns: &[&Column]) -> io::Result<()> {
        let group = &mut self.groups[topic];
        let mut records = Vec::with_capacity(table.log_time_ns.len() * group.record_bytes());
        for (row, log_ns) in table.log_time_ns.iter().enumerate() {
            for ns in [*log_ns, table.publish_time_ns[row]] {
                let since_s = (ns - self.header.begin_ns) as f64 / 1e9;
                records.extend(since_s.to_le_bytes());
            }
            for column in columns {
                put(&mut records, column, row);
            }
            put_absent(&mut records, columns, row);
        }
        self.blocks.data(group, &records)
    }

    /// Writes what describes the data.
    fn finish(mut self) -> io::Result<()> {
        self.blocks.finish(&self.header, &self.groups)
    }
}

/// How the values of a column are stored; `None` for texts, bytes and lists.
fn kind(column: &Column) -> Option<(Kind, u32)> {
    Some(match &column.values {
        Values::F64(_) => (Kind::Float, 8),
        Values::I32(_) => (Kind::Signed, 4),
        Values::I64(_) => (Kind::Signed, 8),
        Values::U32(_) => (Kind::Unsigned, 4),
        Values::U64(_) => (Kind::Unsigned, 8),
        Values::Bool(_) => (Kind::Unsigned, 1),
        Values::Text(_) | Values::Bytes(_) | Values::List { .. } => return None,
    })
}

fn group(topic: &Topic, columns: &[&Column]) -> Group {
    let mut channels = vec![
        Channel::time("log_time", true, 0),
        Channel::time("publish_time", false, 8),
    ];
    let (mut offset, mut absent) = (16, 0);
    for column in columns {
        let Some((kind, bytes)) = kind(column) else {
            continue;
        };
        let frame = topic.frame_of(column);
        let comment = frame.map_or_else(String::new, |frame| format!("frame: {frame}"));
        channels.push(Channel {
            name: column.name.clone(),
            unit: topic.unit(column).unwrap_or_default().to_owned(),
            comment,
            names: column.names.clone(),
            kind,
            is_master: false,
            offset,
            bytes,
            absent_bit: column.present.is_some().then_some(absent),
        });
        offset += bytes;
        absent += u32::from(column.present.is_some());
    }
    Group {
        topic: topic.name.clone(),
        source: topic.source.clone(),
        channels,
        data_bytes: offset,
        absent_bytes: absent.div_ceil(8),
        rows: 0,
        data: Vec::new(),
    }
}

/// Appends the value in a row.
fn put(record: &mut Vec<u8>, column: &Column, row: usize) {
    match &column.values {
        Values::F64(list) => record.extend(list[row].to_le_bytes()),
        Values::I32(list) => record.extend(list[row].to_le_bytes()),
        Values::I64(list) => record.extend(list[row].to_le_bytes()),
        Values::U32(list) => record.extend(list[row].to_le_bytes()),
        Values::U64(list) => record.extend(list[row].to_le_bytes()),
        Values::Bool(list) => record.push(list[row].into()),
        Values::Text(_) | Values::Bytes(_) | Values::List { .. } => {}
    }
}

/// Appends the invalidation bits of a row.
fn put_absent(record: &mut Vec<u8>, columns: &[&Column], row: usize) {
    let present = columns.iter().filter_map(|column| column.present.as_ref());
    let absent: Vec<bool> = present.map(|present| !present[row]).collect();
    for bits in absent.chunks(8) {
        record.push(
            bits.iter()
                .rev()
                .fold(0, |byte, bit| byte << 1 | u8::from(*bit)),
        );
    }
}
