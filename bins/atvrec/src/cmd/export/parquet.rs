//! Tables as Parquet files.

use std::collections::HashMap;
use std::fs::File;
use std::sync::Arc;

use arrow_array::builder::{BinaryBuilder, StringDictionaryBuilder};
use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, Float64Array, Int32Array, Int64Array, ListArray, RecordBatch,
    StringArray, TimestampNanosecondArray, UInt32Array, UInt64Array,
};
use arrow_buffer::{NullBuffer, OffsetBuffer};
use arrow_schema::{DataType, Field, Schema, SchemaRef, TimeUnit};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;
use store::{Column, Table, Values};

use super::topic::Topic;
use super::{heading, value_name};

/// Values of a row group, which is in memory until it is complete.
const GROUP_VALUES: usize = 1 << 20;
/// Least and greatest number of rows of a row group.
const GROUP_ROWS: [usize; 2] = [1 << 13, 1 << 17];
/// Columns of times of a dataset; a column of the log with such a name gets another one.
const OWN_NAMES: [&str; 3] = ["log_time", "publish_time", "utc"];
/// Time zone of the times.
const UTC: &str = "UTC";

/// Names and types of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// As other tables of one topic: times in ns as integers, units in the names, NaN where a number is absent.
    Table,
    /// For databases: times as time stamps, units in the metadata of the fields, null where a number is
    /// absent.
    Dataset,
}

/// Writes tables as compressed columns. The Arrow schema in the file states for each field its unit, frame
/// of reference and source as metadata. Names of values and texts are encoded by dictionaries.
pub struct Writer {
    file: ArrowWriter<File>,
    schema: SchemaRef,
    layout: Layout,
}

impl Writer {
    /// Writes the head of the file of a topic. `metadata` is that of the whole file.
    pub fn new(
        file: File,
        columns: &[Column],
        topic: &Topic,
        layout: Layout,
        metadata: HashMap<String, String>,
    ) -> anyhow::Result<Self> {
        let mut fields = match layout {
            Layout::Table => ["log_time_ns", "publish_time_ns"]
                .map(|name| Field::new(name, DataType::Int64, false))
                .to_vec(),
            Layout::Dataset => ["log_time", "publish_time"].map(time_field).to_vec(),
        };
        fields.extend(columns.iter().map(|column| field(column, topic, layout)));
        Self::with_fields(file, fields, layout, metadata)
    }

    /// Writes the head of a file with any fields.
    pub fn with_fields(
        file: File,
        fields: Vec<Field>,
        layout: Layout,
        metadata: HashMap<String, String>,
    ) -> anyhow::Result<Self> {
        let [least, most] = GROUP_ROWS;
        let rows = (GROUP_VALUES / fields.len().max(1)).clamp(least, most);
        // A dictionary of numbers takes up to 1 MB of memory for each column, and saves little.
        let mut properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_max_row_group_row_count(Some(rows))
            .set_dictionary_enabled(false);
        for field in &fields {
            let path = ColumnPath::from(vec![field.name().clone()]);
            properties = match field.data_type() {
                DataType::Int64 | DataType::Timestamp(..) => {
                    properties.set_column_encoding(path, Encoding::DELTA_BINARY_PACKED)
                }
                DataType::Dictionary(..) => properties.set_column_dictionary_enabled(path, true),
                _ => properties,
            };
        }
        let schema = Arc::new(Schema::new_with_metadata(fields, metadata));
        Ok(Self {
            file: ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties.build()))?,
            schema,
            layout,
        })
    }

    /// Writes rows of a topic.
    pub fn write(&mut self, table: &Table) -> anyhow::Result<()> {
        let times = [&table.log_time_ns, &table.publish_time_ns];
        let mut arrays: Vec<ArrayRef> = match self.layout {
            Layout::Table => times
                .map(|ns| Arc::new(Int64Array::from(ns.clone())) as ArrayRef)
                .to_vec(),
            Layout::Dataset => times.map(|ns| time_array(ns)).to_vec(),
        };
        let columns = table.columns.iter();
        arrays.extend(columns.map(|column| array(column, self.layout)));
        self.write_arrays(arrays)
    }

    /// Writes rows: an array for each field.
    pub fn write_arrays(&mut self, arrays: Vec<ArrayRef>) -> anyhow::Result<()> {
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays)?;
        Ok(self.file.write(&batch)?)
    }

    /// Writes the end of the file.
    pub fn finish(self) -> anyhow::Result<()> {
        self.file.close()?;
        Ok(())
    }
}

/// Field of times.
pub fn time_field(name: &str) -> Field {
    Field::new(name, time_type(), false)
}

/// Times in ns since 1970.
pub fn time_array(ns: &[i64]) -> ArrayRef {
    Arc::new(TimestampNanosecondArray::from(ns.to_vec()).with_timezone(UTC))
}

fn time_type() -> DataType {
    DataType::Timestamp(TimeUnit::Nanosecond, Some(UTC.into()))
}

/// Whether the column contains times that are time stamps in this layout.
fn is_time(column: &Column, layout: Layout) -> bool {
    layout == Layout::Dataset && column.name == super::UTC_COLUMN
}

/// The field of a column.
pub fn field(column: &Column, topic: &Topic, layout: Layout) -> Field {
    let (name, is_nullable) = match layout {
        _ if is_time(column, layout) => ("utc".to_owned(), false),
        Layout::Table => (heading(column), column.present.is_some()),
        Layout::Dataset => {
            let is_float = matches!(column.values, Values::F64(_));
            let mut name = column.name.clone();
            if OWN_NAMES.contains(&&*name) {
                name.push('_');
            }
            (name, is_float || column.present.is_some())
        }
    };
    let data_type = match &column.values {
        _ if is_time(column, layout) => time_type(),
        values => data_type(column, values),
    };
    let unit = topic.unit(column).filter(|_| !is_time(column, layout));
    let described = [
        ("source", Some(&*topic.source)),
        ("unit", unit),
        ("frame", topic.frame_of(column)),
    ];
    let metadata: HashMap<String, String> = described
        .into_iter()
        .filter_map(|(key, text)| Some((key.to_owned(), text?.to_owned())))
        .collect();
    Field::new(name, data_type, is_nullable).with_metadata(metadata)
}

fn data_type(column: &Column, values: &Values) -> DataType {
    let names = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    match values {
        Values::F64(_) => DataType::Float64,
        Values::I32(_) if column.names.is_empty() => DataType::Int32,
        Values::I32(_) | Values::Text(_) => names(),
        Values::I64(_) => DataType::Int64,
        Values::U32(_) => DataType::UInt32,
        Values::U64(_) => DataType::UInt64,
        Values::Bool(_) => DataType::Boolean,
        Values::Bytes(_) => DataType::Binary,
        Values::List { values, .. } => DataType::List(item(column, values)),
    }
}

/// The field of the values of a list.
fn item(column: &Column, values: &Values) -> Arc<Field> {
    // Names in lists are not encoded by dictionaries, which not all readers know.
    let data_type = match data_type(column, values) {
        DataType::Dictionary(_, value) => *value,
        other => other,
    };
    Arc::new(Field::new("item", data_type, false))
}

/// The values of a column.
pub fn array(column: &Column, layout: Layout) -> ArrayRef {
    let nulls = match (&column.values, &column.present) {
        (Values::List { .. }, _) => None,
        (Values::F64(list), _) if layout == Layout::Dataset => {
            Some(list.iter().map(|value| !value.is_nan()).collect())
        }
        (_, Some(present)) => Some(NullBuffer::from(present.as_slice())),
        (_, None) => None,
    };
    match &column.values {
        Values::I64(list) if is_time(column, layout) => time_array(list),
        values => values_array(column, values, nulls),
    }
}

fn values_array(column: &Column, values: &Values, nulls: Option<NullBuffer>) -> ArrayRef {
    match values {
        Values::F64(list) => Arc::new(Float64Array::new(list.clone().into(), nulls)),
        Values::I32(list) if column.names.is_empty() => {
            Arc::new(Int32Array::new(list.clone().into(), nulls))
        }
        Values::I32(list) => {
            let names = list.iter().map(|value| value_name(column, *value));
            dictionary(names, nulls.as_ref())
        }
        Values::I64(list) => Arc::new(Int64Array::new(list.clone().into(), nulls)),
        Values::U32(list) => Arc::new(UInt32Array::new(list.clone().into(), nulls)),
        Values::U64(list) => Arc::new(UInt64Array::new(list.clone().into(), nulls)),
        Values::Bool(list) => Arc::new(BooleanArray::new(list.as_slice().into(), nulls)),
        Values::Text(list) => dictionary(list.iter(), nulls.as_ref()),
        Values::Bytes(list) => {
            let mut builder = BinaryBuilder::new();
            for (row, bytes) in list.iter().enumerate() {
                let is_null = nulls.as_ref().is_some_and(|nulls| nulls.is_null(row));
                builder.append_option((!is_null).then_some(bytes));
            }
            Arc::new(builder.finish())
        }
        Values::List { ends, values } => {
            let lengths = ends
                .iter()
                .scan(0, |start, end| Some(end - std::mem::replace(start, *end)));
            let inner = match (&**values, values_array(column, values, None)) {
                (Values::Text(list), _) => Arc::new(StringArray::from_iter_values(list)),
                (Values::I32(list), _) if !column.names.is_empty() => {
                    let names = list.iter().map(|value| value_name(column, *value));
                    Arc::new(StringArray::from_iter_values(names)) as ArrayRef
                }
                (_, array) => array,
            };
            let offsets = OffsetBuffer::from_lengths(lengths);
            Arc::new(ListArray::new(item(column, values), offsets, inner, None))
        }
    }
}

fn dictionary(
    texts: impl Iterator<Item = impl AsRef<str>>,
    nulls: Option<&NullBuffer>,
) -> ArrayRef {
    let mut builder = StringDictionaryBuilder::<Int32Type>::new();
    for (row, text) in texts.enumerate() {
        if nulls.is_some_and(|nulls| nulls.is_null(row)) {
            builder.append_null();
        } else {
            builder.append_value(text);
        }
    }
    Arc::new(builder.finish())
}
