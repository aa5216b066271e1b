//! Tables as an MF4 file (ASAM MDF 4.10): a channel group for each topic, at the rate of its messages.

mod blocks;

use std::io;

use engine::output::{Target, WriteError};
use store::{Column, Table, UtcOffset, Values};

use super::topic::Topic;
use super::{Input, Written};
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
) -> anyhow::Result<Written> {
    let mut written = Written::default();
    // Which columns a topic has is known at its end.
    let mut columns = vec![Vec::new(); topics.len()];
    input.each(topics, [0.0, 0.5], &mut Vec::new(), |topic, table| {
        columns[topic] = table.columns.iter().map(Column::without_rows).collect();
        Ok(())
    })?;
    report_left_out(topics, &columns);
    target.write_by(|file| {
        let write = || -> anyhow::Result<()> {
            let groups = topics.iter().zip(&columns);
            let mut writer = Writer {
                blocks: Blocks::new(file)?,
                header: Header::new(input, utc),
                groups: groups
                    .map(|(topic, columns)| group(topic, columns))
                    .collect(),
            };
            let missing = &mut written.missing;
            let rows = &mut written.rows;
            input.each(topics, [0.5, 1.0], missing, |topic, mut table| {
                table.pad(&columns[topic]);
                *rows += table.log_time_ns.len();
                Ok(writer.write(topic, &table)?)
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

/// Reports the columns that are not in the file.
fn report_left_out(topics: &[Topic], columns: &[Vec<Column>]) {
    let (mut names, mut count) = (Vec::new(), 0);
    for (topic, columns) in topics.iter().zip(columns) {
        let others = columns
            .iter()
            .filter(|column| kind(column).is_none())
            .count();
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
    /// Writes rows of a topic.
    fn write(&mut self, topic: usize, table: &Table) -> io::Result<()> {
        let group = &mut self.groups[topic];
        let mut records = Vec::with_capacity(table.log_time_ns.len() * group.record_bytes());
        let columns = table.columns.iter().filter(|column| kind(column).is_some());
        let columns: Vec<&Column> = columns.collect();
        for (row, log_ns) in table.log_time_ns.iter().enumerate() {
            for ns in [*log_ns, table.publish_time_ns[row]] {
                let since_s = (ns - self.header.begin_ns) as f64 / 1e9;
                records.extend(since_s.to_le_bytes());
            }
            for column in &columns {
                put(&mut records, column, row);
            }
            put_absent(&mut records, &columns, row);
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

fn group(topic: &Topic, columns: &[Column]) -> Group {
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
