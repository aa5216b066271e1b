//! File with the findings of an identification and the overrides for the vehicle file.

use anyhow::Context;
use estimator::finding::Findings;
use toml::{Table, Value};

/// Overrides: dotted names of fields of the vehicle file, with new values.
#[derive(Debug, Default)]
pub struct Overrides(Table);

impl Overrides {
    /// Overrides a number.
    pub fn set(&mut self, field: &str, value: f64) {
        self.0.insert(field.to_owned(), Value::Float(value));
    }

    /// Overrides a list of numbers.
    pub fn set_list(&mut self, field: &str, values: &[f64]) {
        let list = values.iter().map(|value| Value::Float(*value)).collect();
        self.0.insert(field.to_owned(), Value::Array(list));
    }

    /// Text of the file: vehicle, logs, overrides and findings.
    pub fn file(
        &self,
        command: &str,
        vehicle: &str,
        logs: &[String],
        results: &[Findings],
    ) -> anyhow::Result<String> {
        let mut table = Table::new();
        table.insert("vehicle".to_owned(), vehicle.into());
        table.insert("made_by".to_owned(), format!("identify {command}").into());
        table.insert("logs".to_owned(), logs.to_vec().into());
        table.insert("overrides".to_owned(), Value::Table(self.0.clone()));
        let results = Value::try_from(results).context("cannot write the findings as TOML")?;
        table.insert("result".to_owned(), results);
        let text = toml::to_string_pretty(&table).context("cannot write the findings as TOML")?;
        Ok(format!(
            "# Result of `atvrec identify {command}`. Add this file to `overrides` under [vehicle] \
             in\n# atvrec.toml; then its [overrides] replace fields of the vehicle file.\n{text}"
        ))
    }
}
