//! Fields of a vehicle file that identified values replace.

use serde::ser::Error as _;
use toml::{Table, Value};

use crate::calibration::all_finite;
use crate::finding::Findings;

/// Overrides: dotted names of fields of the vehicle file, with new values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides(Table);

impl Overrides {
    /// Overrides a number.
    pub(super) fn set(&mut self, field: &str, value: f64) {
        self.0.insert(field.to_owned(), Value::Float(value));
    }

    /// Overrides a list of numbers.
    pub(super) fn set_list(&mut self, field: &str, values: &[f64]) {
        let list = values.iter().map(|value| Value::Float(*value)).collect();
        self.0.insert(field.to_owned(), Value::Array(list));
    }

    /// Multiplies a number, if the field is overridden.
    pub(super) fn scale(&mut self, field: &str, factor: f64) {
        if let Some(Value::Float(value)) = self.0.get_mut(field) {
            *value *= factor;
        }
    }

    /// Adds the fields of others; theirs go before.
    pub(super) fn extend(&mut self, others: Self) {
        self.0.extend(others.0);
    }

    /// The fields and their values.
    #[must_use]
    pub const fn table(&self) -> &Table {
        &self.0
    }

    /// Text of a file for the vehicle's `overrides`: for which vehicle, from which logs, the fields,
    /// and all findings.
    ///
    /// # Errors
    /// If a value is not finite, so that no reader takes it, or a finding cannot be written as TOML.
    pub fn file(
        &self,
        command: &str,
        vehicle: &str,
        logs: &[String],
        results: &[Findings],
    ) -> Result<String, toml::ser::Error> {
        all_finite("overrides", &Value::Table(self.0.clone())).map_err(toml::ser::Error::custom)?;
        let mut table = Table::new();
        table.insert("vehicle".to_owned(), vehicle.into());
        table.insert("made_by".to_owned(), format!("identify {command}").into());
        table.insert("logs".to_owned(), logs.to_vec().into());
        table.insert("overrides".to_owned(), Value::Table(self.0.clone()));
        table.insert("result".to_owned(), Value::try_from(results)?);
        let text = toml::to_string_pretty(&table)?;
        Ok(format!(
            "# Result of `atvrec identify {command}`. Add this file to `overrides` under [vehicle] \
             in\n# atvrec.toml; then its [overrides] replace fields of the vehicle file.\n{text}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_no_reader_takes_is_not_written() {
        let mut overrides = Overrides::default();
        overrides.set("front.tyre.friction", f64::NAN);
        let error = overrides
            .file("tyre", "car", &[], &[])
            .expect_err("not finite");
        assert!(error.to_string().contains("front.tyre.friction"), "{error}");
    }
}
