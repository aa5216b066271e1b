//! Column maps: quantities and units of the columns of a table.

use toml::de::DeValue;
use wire::column::{Column, Dimension, Quantity};
use wire::{alog, csv};

use model::file::{ErrorCollector, Field, FromValue, Problem, Section, closest};

/// Units of a time column and their lengths, ns.
const TIME_UNITS: [(&str, u64); 5] = [
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1_000),
    ("ns", 1),
    ("min", 60_000_000_000),
];
/// Default of the largest time between the lines of one instant in an alog, s.
const TOGETHER_S: f64 = 0.001;

/// Built-in map of the variable names of Auburn's GAVLab.
pub const GAVLAB_MAP: &str = include_str!("../../assets/gavlab.toml");

/// Source of the time of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum RowTime {
    /// A column, and the length of its unit in ns.
    Column(csv::Place, u64),
    /// Rows at a constant rate, Hz, the first at time zero.
    Rate(f64),
}

/// Conversion of the time of a table to the log clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Times {
    /// Source of the time of a row.
    pub row: RowTime,
    /// UNIX time of time zero, ns; `None` leaves it to the importer.
    pub start_unix_ns: Option<u64>,
    /// Whether the rows are sorted by time.
    pub sort: bool,
}

/// A map for delimited text.
#[derive(Clone, Debug, PartialEq)]
pub struct CsvMap {
    /// Format of the rows.
    pub format: csv::Format,
    /// Times of the rows.
    pub times: Times,
}

/// Reads a map for delimited text. `file` is the name for messages.
pub fn csv_map(file: &str, text: &str) -> Result<CsvMap, Vec<Problem>> {
    read(file, text, |top, collector| {
        let times = read_times(top.section("time", collector), collector);
        let mut table = top.section("table", collector);
        let delimiter = table.optional::<String>("delimiter", collector);
        let delimiter = delimiter.map_or(Some(','), |field| read_delimiter(&field, collector));
        let mut format = csv::Format {
            delimiter,
            decimal_comma: table.or("decimal_comma", false, collector),
            comment: table.or("comment", "#".to_owned(), collector),
            skip_lines: table.or::<u32>("skip_lines", 0, collector) as usize,
            header: table.or("header", true, collector),
            missing: table.or("missing", Vec::new(), collector),
            columns: Vec::new(),
        };
        if format.decimal_comma && format.delimiter == Some(',') {
            collector.add(
                &table.span(),
                "table.decimal_comma",
                "the comma cannot be both the delimiter and the decimal separator",
                "set another delimiter, such as delimiter = \";\"",
            );
        }
        table.finish(collector);
        for (name, mut section) in top.section("column", collector).into_sections(collector) {
            let place = section.optional::<PlaceValue>("from", collector);
            let place = place.map_or(csv::Place::Name(name.value.clone()), |field| field.value.0);
            if let Some(column) = read_column(name, &mut section, collector) {
                format.columns.push((place, column));
            }
            section.finish(collector);
        }
        let map = CsvMap { format, times };
        check(map.format.check(), collector);
        map
    })
}

/// Reads a map for MOOS logs. `file` is the name for messages.
pub fn alog_map(file: &str, text: &str) -> Result<alog::Format, Vec<Problem>> {
    read(file, text, |top, collector| {
        let together_s = top.number_in("together_s", 0.0..=1.0, TOGETHER_S, collector);
        let mut groups: Vec<String> = Vec::new();
        let mut variables = Vec::new();
        for (name, mut section) in top.section("column", collector).into_sections(collector) {
            let from = section.or("from", name.value.clone(), collector);
            let source = section.or("source", String::new(), collector);
            let element = section.optional::<u32>("element", collector);
            let key = section.optional::<String>("key", collector);
            let group = section.optional::<String>("group", collector);
            let part = match (element, key) {
                (Some(element), _) => alog::Part::Element(element.value as usize),
                (None, Some(key)) => alog::Part::Key(key.value),
                (None, None) => alog::Part::Whole,
            };
            if let Some(column) = read_column(name, &mut section, collector) {
                let group = group.map_or_else(
                    || format!("{} {source}", family(&column)),
                    |field| field.value,
                );
                let known = groups.iter().position(|known| *known == group);
                let group = known.unwrap_or_else(|| {
                    groups.push(group);
                    groups.len() - 1
                });
                variables.push(alog::Variable {
                    name: from,
                    source,
                    part,
                    group,
                    column,
                });
            }
            section.finish(collector);
        }
        let format = alog::Format {
            variables,
            together_s,
        };
        check(format.check(), collector);
        format
    })
}

/// Default group of a column: columns of one group belong to one measurement.
fn family(column: &Column) -> String {
    match column.quantity {
        Quantity::Acceleration(_) | Quantity::Rate(_) => "imu".to_owned(),
        Quantity::ForwardSpeed | Quantity::LeftwardSpeed => "speed".to_owned(),
        Quantity::WheelSpeed(_) => "wheels".to_owned(),
        Quantity::Latitude | Quantity::Longitude | Quantity::Height => "position".to_owned(),
        Quantity::Velocity(_) | Quantity::GroundTrackSpeed | Quantity::Course => {
            "velocity".to_owned()
        }
        Quantity::Heading | Quantity::Yaw | Quantity::Pitch | Quantity::Roll => {
            "attitude".to_owned()
        }
        Quantity::Deflection(wheel) | Quantity::Strain(wheel, _) => {
            format!("corner {}", wheel.abbreviation())
        }
        Quantity::Steer | Quantity::Truth(_) | Quantity::Signal => column.name.clone(),
    }
}

fn read<T>(
    file: &str,
    text: &str,
    body: impl FnOnce(&mut Section<'_>, &mut ErrorCollector<'_>) -> T,
) -> Result<T, Vec<Problem>> {
    let mut collector = ErrorCollector::new(file, text);
    let Some(table) = collector.parse() else {
        return Err(collector.into_problems());
    };
    let mut top = Section::new("", table);
    let value = body(&mut top, &mut collector);
    top.finish(&mut collector);
    if collector.is_empty() {
        Ok(value)
    } else {
        Err(collector.into_problems())
    }
}

fn check(result: Result<(), wire::WireError>, collector: &mut ErrorCollector<'_>) {
    if let Err(error) = result
        && collector.is_empty()
    {
        let help = "write a table [column.<name>] with from, quantity and unit for each column";
        collector.add(&(0..0), "column", error.to_string(), help);
    }
}

fn read_times(mut section: Section<'_>, collector: &mut ErrorCollector<'_>) -> Times {
    let column = section.optional::<PlaceValue>("column", collector);
    let rate = section.optional::<f64>("rate_hz", collector);
    let unit = section.optional::<String>("unit", collector);
    let start = section.optional::<f64>("start_unix_s", collector);
    let sort = section.or("sort", false, collector);
    let unit_ns = unit.map_or(TIME_UNITS[0].1, |field| {
        let found = TIME_UNITS.iter().find(|(name, _)| *name == field.value);
        found.map_or_else(
            || {
                let names = TIME_UNITS.map(|(name, _)| name).join(", ");
                collector.add(
                    &field.span,
                    &field.name,
                    format!("\"{}\" is not a unit of time", field.value),
                    format!("use one of: {names}"),
                );
                1
            },
            |(_, ns)| *ns,
        )
    });
    let row = match (column, rate) {
        (Some(column), None) => RowTime::Column(column.value.0, unit_ns),
        (None, Some(rate)) if rate.value > 0.0 && rate.value <= 1e6 => RowTime::Rate(rate.value),
        (None, Some(rate)) => {
            collector.add(
                &rate.span,
                &rate.name,
                format!("{} Hz is out of range", rate.value),
                "use a rate above 0 and up to 1000000",
            );
            RowTime::Rate(1.0)
        }
        (given, _) => {
            let message = match given {
                Some(_) => "both a column and a rate are set",
                None => "missing",
            };
            let help = "set either column = \"<name>\" or rate_hz = <number>";
            collector.add(&section.span(), "time", message, help);
            RowTime::Rate(1.0)
        }
    };
    section.finish(collector);
    Times {
        row,
        start_unix_ns: start.map(|field| (field.value.max(0.0) * 1e9).round() as u64),
        sort,
    }
}

fn read_delimiter(field: &Field<String>, collector: &mut ErrorCollector<'_>) -> Option<char> {
    match field.value.as_str() {
        "tab" => Some('\t'),
        "blank" => None,
        text => {
            let mut characters = text.chars();
            let first = characters.next();
            if first.is_none() || characters.next().is_some() {
                collector.add(
                    &field.span,
                    &field.name,
                    format!("\"{text}\" is not one character"),
                    "use one character, \"tab\", or \"blank\" for any number of spaces and tabs",
                );
            }
            first
        }
    }
}

fn read_column(
    name: Field<String>,
    section: &mut Section<'_>,
    collector: &mut ErrorCollector<'_>,
) -> Option<Column> {
    let quantity = section.required::<String>(
        "quantity",
        "set the quantity of the column, such as quantity = \"speed.forward\" or \"signal\"",
        collector,
    );
    let unit = section.optional::<String>("unit", collector);
    let scale = section.or("scale", 1.0, collector);
    let offset = section.or("offset", 0.0, collector);
    let delay_s = section.number_in("delay_s", 0.0..=10.0, 0.0, collector);
    let quantity = quantity?;
    let known = Quantity::from_name(&quantity.value);
    let Some(kind) = known else {
        let names: Vec<String> = Quantity::all().map(Quantity::name).collect();
        let borrowed: Vec<&str> = names.iter().map(String::as_str).collect();
        let help = match closest(&quantity.value, &borrowed) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => "docs/import.md lists all quantities".to_owned(),
        };
        collector.add(
            &quantity.span,
            &quantity.name,
            format!("\"{}\" is not a known quantity", quantity.value),
            help,
        );
        return None;
    };
    let (unit, factor) = read_unit(kind, unit, &quantity, collector)?;
    Some(Column {
        name: name.value,
        quantity: kind,
        unit,
        factor,
        scale,
        offset,
        delay_s,
    })
}

fn read_unit(
    kind: Quantity,
    unit: Option<Field<String>>,
    quantity: &Field<String>,
    collector: &mut ErrorCollector<'_>,
) -> Option<(String, f64)> {
    let dimension = kind.dimension();
    let names: Vec<&str> = dimension.units().iter().map(|(name, _)| *name).collect();
    let known = format!("use one of: {}", names.join(", "));
    match unit {
        Some(field) => match dimension.factor(&field.value) {
            Some(factor) => Some((field.value, factor)),
            None => {
                let message = format!("\"{}\" is not a unit of {}", field.value, quantity.value);
                collector.add(&field.span, &field.name, message, known);
                None
            }
        },
        // No unit is assumed: a mix-up of radians and degrees would not be noticed.
        None if matches!(dimension, Dimension::Free | Dimension::Counts) => {
            Some((String::new(), 1.0))
        }
        None => {
            let message = format!("{} needs a unit", quantity.value);
            collector.add(&quantity.span, &quantity.name, message, known);
            None
        }
    }
}

/// Name or number of a column.
struct PlaceValue(csv::Place);

impl FromValue for PlaceValue {
    const EXPECTED: &'static str = "the name or number of a column";

    fn from_value(value: &DeValue<'_>) -> Option<Self> {
        match value {
            DeValue::String(name) => Some(Self(csv::Place::Name(name.to_string()))),
            _ => {
                let number = u32::from_value(value)?;
                Some(Self(csv::Place::Number(number as usize)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_map_is_valid() {
        let format = alog_map("gavlab.toml", GAVLAB_MAP).expect("a valid map");
        assert!(format.variables.len() > 10);
    }

    #[test]
    fn all_errors_of_a_map_are_reported_together() {
        let text = "[time]\nunit = \"h\"\n[column.vx]\nquantity = \"speed.forwards\"\n\
                    [column.r]\nquantity = \"rate.z\"\n[column.ay]\n\
                    quantity = \"acceleration.y\"\nunit = \"deg\"\nskale = 2\n";
        let problems = csv_map("map.toml", text).expect_err("errors");
        let texts: Vec<String> = problems.iter().map(ToString::to_string).collect();
        for part in [
            "not a unit of time",
            "set either column = \"<name>\" or rate_hz",
            "did you mean \"speed.forward\"",
            "rate.z needs a unit",
            "not a unit of acceleration.y",
            "unknown field",
        ] {
            assert!(texts.iter().any(|t| t.contains(part)), "{part}: {texts:#?}");
        }
    }
}
