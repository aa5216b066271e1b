//! Finds the signals of roles in the DBC files.

use std::ops::Range;

use model::file::{ErrorCollector, Field, closest};
use wire::dbc::{Database, SignalDef};
use wire::unit::Dimension;

use super::{Role, RoleOf};

/// What a role needs: the dimensions that its signal may have, and the role of a signal.
pub(super) struct Wanted<'r> {
    /// Dimensions of the units that the signal may have.
    pub dimensions: &'r [Dimension],
    /// The role of a signal whose unit has a dimension, with the factor that takes it to SI.
    pub role: &'r dyn Fn(Dimension, f64) -> Role,
}

/// A role with its signal, and the field that asks for it; no field for a role of the built-in file.
pub(super) struct Found {
    role: RoleOf,
    field: Option<(Range<usize>, String)>,
}

pub(super) struct Finder<'d> {
    pub databases: &'d [Database],
    pub found: Vec<Found>,
}

impl Finder<'_> {
    /// Adds the role that a field asks for. Without a field it is that of the signal with the default
    /// name, if the DBC files have one.
    pub fn add(
        &mut self,
        field: Option<Field<String>>,
        key: &str,
        default: Option<&str>,
        collector: &mut ErrorCollector<'_>,
        wanted: &Wanted<'_>,
    ) {
        let Some(name) = field.as_ref().map(|f| f.value.as_str()).or(default) else {
            return;
        };
        let is_asked = field.is_some();
        match (self.resolve(name, key, wanted), field) {
            (Ok(mut role), field) => {
                role.at = field.as_ref().map(|field| field.span.start);
                let field = field.map(|field| (field.span, field.name));
                self.found.push(Found { role, field });
            }
            (Err((problem, help)), Some(field)) if is_asked => {
                collector.add(&field.span, &field.name, problem, help);
            }
            _ => {}
        }
    }

    fn resolve(
        &self,
        name: &str,
        key: &str,
        wanted: &Wanted<'_>,
    ) -> Result<RoleOf, (String, String)> {
        // A minus turns the sign of the signal.
        let (sign, plain) = match name.strip_prefix('-') {
            Some(plain) => (-1.0, plain),
            None => (1.0, name),
        };
        let Some((database, message, signal)) = self.find(plain) else {
            return Err(self.not_found(plain));
        };
        let definition = &self.databases[database].messages()[message].signals[signal];
        let (dimension, factor) = unit_of(definition, wanted.dimensions).ok_or_else(|| {
            let problem = format!(
                "signal {plain} has the unit \"{}\", the role {key} needs {}",
                definition.unit,
                listed(wanted.dimensions)
            );
            let help = "name another signal, or correct the unit of the signal in the DBC file";
            (problem, help.to_owned())
        })?;
        if sign < 0.0 && dimension == Dimension::Counts {
            let problem =
                format!("signal {plain} is in counts, whose sign is that of the calibration");
            let help = "remove the minus; set a negative gain_per_count in the calibration file";
            return Err((problem, help.to_owned()));
        }
        Ok(RoleOf {
            database,
            message,
            signal,
            role: (wanted.role)(dimension, sign * factor),
            at: None,
        })
    }

    /// The roles. A signal has one role; a role that a field asks for goes before one of the built-in file.
    pub fn finish(self, collector: &mut ErrorCollector<'_>) -> Vec<RoleOf> {
        let place = |found: &Found| (found.role.database, found.role.message, found.role.signal);
        let asked: Vec<&Found> = self.found.iter().filter(|f| f.field.is_some()).collect();
        for (number, second) in asked.iter().enumerate() {
            let first = asked[..number].iter().find(|f| place(f) == place(second));
            if let (Some(first), Some((span, name))) = (first, &second.field) {
                let other = first.field.as_ref().map_or("", |field| &field.1);
                let problem = format!("the signal has the role {other} already");
                collector.add(span, name, problem, "give each signal one role");
            }
        }
        let is_asked = |found: &Found| asked.iter().any(|a| place(a) == place(found));
        let kept = self.found.iter();
        let kept = kept.filter(|found| found.field.is_some() || !is_asked(found));
        kept.map(|found| found.role).collect()
    }

    /// The fields of roles that are quantities of a measurement.
    pub fn fields(&self) -> impl Iterator<Item = (&RoleOf, &(Range<usize>, String))> {
        let found = self.found.iter();
        found.filter_map(|found| Some((&found.role, found.field.as_ref()?)))
    }

    fn find(&self, name: &str) -> Option<(usize, usize, usize)> {
        let (message_name, signal_name) = name.split_once('.')?;
        self.databases
            .iter()
            .enumerate()
            .find_map(|(number, database)| {
                let found = database.by_name(message_name)?;
                let messages = database.messages();
                let message = messages.iter().position(|m| std::ptr::eq(m, found))?;
                Some((number, message, found.position(signal_name)?))
            })
    }

    fn not_found(&self, name: &str) -> (String, String) {
        let Some((message_name, signal_name)) = name.split_once('.') else {
            return (
                format!("\"{name}\" is not the name of a signal"),
                "use \"Message.Signal\" with both names of the DBC file".to_owned(),
            );
        };
        let left_out = self.databases.iter().flat_map(Database::left_out);
        let mut left_out = left_out.filter(|part| part.message.as_deref() == Some(message_name));
        if let Some(part) = left_out.next() {
            return (
                format!(
                    "the message {message_name} has an error in the DBC file: {}",
                    part.issue
                ),
                "correct the message in the DBC file, or remove the role".to_owned(),
            );
        }
        let message = self.databases.iter().find_map(|d| d.by_name(message_name));
        let (missing, known): (String, Vec<&str>) = match message {
            Some(message) => (
                format!("the message {message_name} has no signal \"{signal_name}\""),
                message.signals.iter().map(|s| s.name.as_str()).collect(),
            ),
            None => (
                format!("no DBC file has a message \"{message_name}\""),
                self.databases
                    .iter()
                    .flat_map(Database::messages)
                    .map(|m| m.name.as_str())
                    .collect(),
            ),
        };
        let wanted = if message.is_some() {
            signal_name
        } else {
            message_name
        };
        let help = match closest(wanted, &known) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => format!("use one of: {}", known.join(", ")),
        };
        (missing, help)
    }
}

/// Dimension and factor to SI of a signal's unit, if it is one of these dimensions.
fn unit_of(signal: &SignalDef, dimensions: &[Dimension]) -> Option<(Dimension, f64)> {
    dimensions.iter().find_map(|dimension| {
        let (_, factor) = dimension.unit_of_text(&signal.unit)?;
        Some((*dimension, factor))
    })
}

/// The units of some dimensions: "counts, V or m".
fn listed(dimensions: &[Dimension]) -> String {
    let names: Vec<&str> = dimensions.iter().flat_map(|d| d.unit_names()).collect();
    match names.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, first)) => format!("{} or {last}", first.join(", ")),
        None => String::new(),
    }
}
