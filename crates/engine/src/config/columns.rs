//! Column maps: quantities and units of the columns of a table.

mod times;

use sample::NANOS_PER_SECOND;
use toml::de::DeValue;
use wire::column::{Column, Quantity};
use wire::unit::Dimension;
use wire::{alog, csv};

use model::file::{ErrorCollector, Field, FromValue, Problem, Section, closest};

pub use times::{Clock, RowTime, Times};

/// Default of the largest time between the lines of one instant in an alog, s.
const TOGETHER_S: f64 = 0.001;

/// Built-in map of the variable names of Auburn's GAVLab.
pub const GAVLAB_MAP: &str = include_str!("../../assets/gavlab.toml");

/// A map for delimited text.
#[derive(Clone, Debug, PartialEq)]
pub struct CsvMap {
    /// Format of the rows.
    pub format: csv::Format,
    /// Times of the rows.
    pub times: Times,
    /// What should be changed in the file.
    pub warnings: Vec<Problem>,
}

/// A map for MOOS logs.
#[derive(Clone, Debug, PartialEq)]
pub struct AlogMap {
    /// Variables of the file.
    pub format: alog::Format,
    /// What should be changed in the file.
    pub warnings: Vec<Problem>,
}

impl CsvMap {
    /// Columns that make no measurement because others are absent, and quantities that occur twice.
    /// `file` is the name for messages.
    #[must_use]
    pub fn contradictions(&self, file: &str) -> Vec<Problem> {
        let columns = self.format.columns.iter();
        contradictions(file, &columns.map(|(_, column)| column).collect::<Vec<_>>())
    }
}

impl AlogMap {
    /// The same as [`CsvMap::contradictions`], for the variables of each measurement.
    #[must_use]
    pub fn contradictions(&self, file: &str) -> Vec<Problem> {
        let variables = &self.format.variables;
        let groups = variables.iter().map(|v| v.group + 1).max().unwrap_or(0);
        let of_group = |group| {
            let variables = variables.iter().filter(move |v| v.group == group);
            let columns: Vec<&Column> = variables.map(|v| &v.column).collect();
            contradictions(file, &columns)
        };
        (0..groups).flat_map(of_group).collect()
    }
}

fn contradictions(file: &str, columns: &[&Column]) -> Vec<Problem> {
    let problem = |index: usize, message: String, help: String| Problem {
        file: file.to_owned(),
        line: 0,
        column: 0,
        field: format!("column.{}", columns[index].name),
        value: String::new(),
        message,
        help,
    };
    let mut found: Vec<Problem> = wire::column::incomplete(columns)
        .into_iter()
        .map(|(index, absent)| {
            let names: Vec<String> = absent.iter().map(|quantity| quantity.name()).collect();
            let names = names.join(" and ");
            let quantity = columns[index].quantity.name();
            problem(
                index,
                format!("{quantity} needs {names}, which no column of the map has"),
                format!("add a column with {names}, or set quantity = \"signal\""),
            )
        })
        .collect();
    if let Some([first, second]) = wire::column::twice(columns) {
        let quantity = columns[second].quantity.name();
        found.push(problem(
            second,
            format!(
                "column.{} has the quantity {quantity} already",
                columns[first].name
            ),
            "keep one of the two columns, or set quantity = \"signal\" for the other".to_owned(),
        ));
    }
    found
}

/// Reads a map for delimited text. `file` is the name for messages.
pub fn csv_map(file: &str, text: &str) -> Result<CsvMap, Vec<Problem>> {
    read(file, text, |top, collector| {
        let times = times::read(top.section("time", collector), collector);
        let mut table = top.section("table", collector);
        let delimiter = table.optional::<String>("delimiter", collector);
        let delimiter = delimiter.map_or(Some(','), |field| read_delimiter(&field, collector));
        let mut format = csv::Format {
            delimiter,
            decimal_comma: table.or("decimal_comma", false, collector),
            comment: table.or("comment", "#".to_owned(), collector),
            skip_lines: table.or::<u32>("skip_lines", 0, collector) as usize,
            header: table.or("header", true, collector),
            units_row: table.or("units_row", false, collector),
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
            let held_rows = section.number_in("held_rows", 1.0..=1e6, 1.0, collector);
            if let Some(mut column) = read_column(name, &mut section, collector) {
                column.held_rows = held_rows as u32;
                format.columns.push((place, column));
            }
            section.finish(collector);
        }
        check(format.check(), collector);
        CsvMap {
            format,
            times,
            warnings: collector.take_warnings(),
        }
    })
}

/// Reads a map for MOOS logs. `file` is the name for messages.
pub fn alog_map(file: &str, text: &str) -> Result<AlogMap, Vec<Problem>> {
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
            together_ns: (together_s * NANOS_PER_SECOND as f64).round() as u64,
        };
        check(format.check(), collector);
        AlogMap {
            format,
            warnings: collector.take_warnings(),
        }
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
        Quantity::EcefPosition(_) | Quantity::EcefVelocity(_) => "ecef".to_owned(),
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
    let latency_s = section.renamed_number_in(["latency_s", "delay_s"], 0.0..=10.0, 0.0, collector);
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
        latency_s,
        held_rows: 1,
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
pub(super) struct PlaceValue(pub(super) csv::Place);

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
        assert!(format.format.variables.len() > 10);
        assert_eq!(format.contradictions("gavlab.toml"), []);
    }

    #[test]
    fn all_errors_of_a_map_are_reported_together() {
        let text = "[time]\nunit = \"h\"\n[column.vx]\nquantity = \"speed.forwards\"\n\
                    [column.r]\nquantity = \"rate.z\"\n[column.ay]\n\
                    quantity = \"acceleration.y\"\nunit = \"deg\"\nskale = 2\n";
        let problems = csv_map("map.toml", text).expect_err("errors");
        let texts: Vec<String> = problems.iter().map(ToString::to_string).collect();
        for part in [
            "is no clock",
            "set either column = \"<name>\" or rate_hz",
            "did you mean \"speed.forward\"",
            "rate.z needs a unit",
            "not a unit of acceleration.y",
            "unknown field",
        ] {
            assert!(texts.iter().any(|t| t.contains(part)), "{part}: {texts:#?}");
        }
    }

    #[test]
    fn earlier_names_are_read_with_a_warning() {
        let text = |key: &str| {
            format!("[time]\nrate_hz = 100\n[column.a]\nquantity = \"signal\"\n{key} = 0.25\n")
        };
        for (key, warnings) in [("latency_s", 0), ("delay_s", 1)] {
            let map = csv_map("map.toml", &text(key)).expect("a valid map");
            assert_eq!(map.format.columns[0].1.latency_s, 0.25);
            assert_eq!(map.warnings.len(), warnings, "{:?}", map.warnings);
        }
        let both = text("latency_s") + "delay_s = 0.25\n";
        let problems = csv_map("map.toml", &both).expect_err("both names");
        assert!(problems[0].message.contains("both"), "{problems:?}");
    }

    #[test]
    fn half_pairs_and_quantities_that_occur_twice_contradict() {
        let text = "[time]\nrate_hz = 100\n[column.v]\nquantity = \"gnss.speed\"\nunit = \"m/s\"\n\
                    [column.a]\nquantity = \"steer\"\nunit = \"rad\"\n\
                    [column.b]\nquantity = \"steer\"\nunit = \"rad\"\n";
        let map = csv_map("map.toml", text).expect("a valid map");
        let found: Vec<String> = map
            .contradictions("map.toml")
            .iter()
            .map(|problem| format!("{}: {}", problem.field, problem.message))
            .collect();
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(
            found[0].contains("column.v: gnss.speed needs gnss.course"),
            "{found:?}"
        );
        assert!(
            found[1].contains("column.a has the quantity steer already"),
            "{found:?}"
        );
    }
}
