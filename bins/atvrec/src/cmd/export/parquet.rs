//! Tables as Parquet files.

use std::fs::File;
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type,
};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};
use store::{Column, Table, Values};

use super::{heading, value_name};

/// Internal error: the schema has a field for each column.
const FEWER: &str = "internal error: the Parquet schema has fewer columns than the table";

/// Writes a table as compressed columns. Columns with absent values are optional fields, lists are
/// repeated fields.
pub struct Writer(SerializedFileWriter<File>);

impl Writer {
    /// Writes the head of the file.
    pub fn new(file: File, columns: &[Column]) -> anyhow::Result<Self> {
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .build();
        let schema = schema(columns)?;
        Ok(Self(SerializedFileWriter::new(
            file,
            schema,
            Arc::new(properties),
        )?))
    }

    /// Writes rows as a row group.
    pub fn write(&mut self, table: &Table) -> anyhow::Result<()> {
        let rows = table.log_time_ns.len();
        if rows == 0 {
            return Ok(());
        }
        let mut group = self.0.next_row_group()?;
        for times in [&table.log_time_ns, &table.publish_time_ns] {
            let mut column = group.next_column()?.context(FEWER)?;
            put::<Int64Type>(&mut column, times, &Levels::default())?;
            column.close()?;
        }
        for column in &table.columns {
            let mut sink = group.next_column()?.context(FEWER)?;
            write_column(&mut sink, column, rows)?;
            sink.close()?;
        }
        group.close()?;
        Ok(())
    }

    /// Writes the end of the file.
    pub fn finish(self) -> anyhow::Result<()> {
        self.0.close()?;
        Ok(())
    }
}

fn schema(columns: &[Column]) -> anyhow::Result<TypePtr> {
    let time = |name| {
        let builder = Type::primitive_type_builder(name, Physical::INT64);
        builder.with_repetition(Repetition::REQUIRED).build()
    };
    let mut fields = vec![
        Arc::new(time("log_time_ns")?),
        Arc::new(time("publish_time_ns")?),
    ];
    for column in columns {
        let (values, repetition) = match &column.values {
            Values::List { values, .. } => (&**values, Repetition::REPEATED),
            values if column.present.is_some() => (values, Repetition::OPTIONAL),
            values => (values, Repetition::REQUIRED),
        };
        let (physical, logical) = types(column, values);
        let name = heading(column);
        let builder = Type::primitive_type_builder(&name, physical);
        let builder = builder.with_repetition(repetition);
        fields.push(Arc::new(builder.with_logical_type(logical).build()?));
    }
    let builder = Type::group_type_builder("topic").with_fields(fields);
    Ok(Arc::new(builder.build()?))
}

fn types(column: &Column, values: &Values) -> (Physical, Option<LogicalType>) {
    match values {
        Values::F64(_) => (Physical::DOUBLE, None),
        Values::I32(_) if column.names.is_empty() => (Physical::INT32, None),
        Values::I32(_) | Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Values::I64(_) | Values::U32(_) => (Physical::INT64, None),
        Values::U64(_) => (Physical::INT64, Some(LogicalType::integer(64, false))),
        Values::Bool(_) => (Physical::BOOLEAN, None),
        Values::Bytes(_) | Values::List { .. } => (Physical::BYTE_ARRAY, None),
    }
}

/// Definition and repetition levels of Parquet: which rows have a value, and where lists begin.
#[derive(Default)]
struct Levels {
    definition: Option<Vec<i16>>,
    repetition: Option<Vec<i16>>,
}

fn write_column(
    sink: &mut SerializedColumnWriter<'_>,
    column: &Column,
    rows: usize,
) -> anyhow::Result<()> {
    match (&column.values, &column.present) {
        (Values::List { ends, values }, _) => {
            let (mut definition, mut repetition) = (Vec::new(), Vec::new());
            let mut start = 0;
            for end in ends {
                let count = end - start;
                start = *end;
                definition.extend(std::iter::repeat_n(i16::from(count > 0), count.max(1)));
                repetition.push(0);
                repetition.extend(std::iter::repeat_n(1, count.max(1) - 1));
            }
            let chosen: Vec<usize> = (0..start).collect();
            let levels = Levels {
                definition: Some(definition),
                repetition: Some(repetition),
            };
            write_values(sink, column, values, &chosen, &levels)
        }
        (values, Some(present)) => {
            let chosen: Vec<usize> = (0..rows).filter(|row| present[*row]).collect();
            let definition = present.iter().map(|is| i16::from(*is));
            let levels = Levels {
                definition: Some(definition.collect()),
                repetition: None,
            };
            write_values(sink, column, values, &chosen, &levels)
        }
        (values, None) => {
            let chosen: Vec<usize> = (0..rows).collect();
            write_values(sink, column, values, &chosen, &Levels::default())
        }
    }
}

/// Writes the values at the indices `chosen`.
fn write_values(
    sink: &mut SerializedColumnWriter<'_>,
    column: &Column,
    values: &Values,
    chosen: &[usize],
    levels: &Levels,
) -> anyhow::Result<()> {
    let bytes = |one: &dyn Fn(usize) -> Vec<u8>| -> Vec<ByteArray> {
        chosen.iter().map(|at| one(*at).into()).collect()
    };
    match values {
        Values::F64(list) => put::<DoubleType>(sink, &pick(list, chosen), levels),
        Values::I32(list) if column.names.is_empty() => {
            put::<Int32Type>(sink, &pick(list, chosen), levels)
        }
        Values::I32(list) => {
            let names = bytes(&|at| value_name(column, list[at]).into_bytes());
            put::<ByteArrayType>(sink, &names, levels)
        }
        Values::I64(list) => put::<Int64Type>(sink, &pick(list, chosen), levels),
        Values::U32(list) => {
            let wide: Vec<i64> = chosen.iter().map(|at| i64::from(list[*at])).collect();
            put::<Int64Type>(sink, &wide, levels)
        }
        Values::U64(list) => {
            let same: Vec<i64> = chosen.iter().map(|at| list[*at].cast_signed()).collect();
            put::<Int64Type>(sink, &same, levels)
        }
        Values::Bool(list) => put::<BoolType>(sink, &pick(list, chosen), levels),
        Values::Text(list) => {
            let texts = bytes(&|at| list[at].clone().into_bytes());
            put::<ByteArrayType>(sink, &texts, levels)
        }
        Values::Bytes(list) => put::<ByteArrayType>(sink, &bytes(&|at| list[at].clone()), levels),
        Values::List { .. } => anyhow::bail!(
            "the column {} contains lists of lists, which cannot be exported",
            column.name
        ),
    }
}

fn pick<T: Copy>(list: &[T], chosen: &[usize]) -> Vec<T> {
    chosen.iter().map(|at| list[*at]).collect()
}

fn put<T: DataType>(
    sink: &mut SerializedColumnWriter<'_>,
    values: &[T::T],
    levels: &Levels,
) -> anyhow::Result<()> {
    let (definition, repetition) = (levels.definition.as_deref(), levels.repetition.as_deref());
    sink.typed::<T>()
        .write_batch(values, definition, repetition)?;
    Ok(())
}
