//! What an identification writes: its findings, and the vehicle file's fields that they replace.

use anyhow::Context;
use estimator::finding::Findings;
use toml::{Table, Value};

/// Fields of the vehicle file by their dotted names, with the values that replace the file's.
#[derive(Debug, Default)]
pub struct Overrides(Table);

impl Overrides {
    /// Replaces a number.
    pub fn set(&mut self, field: &str, value: f64) {
        self.0.insert(field.to_owned(), Value::Float(value));
    }

    /// Replaces a list of numbers.
    pub fn set_list(&mut self, field: &str, values: &[f64]) {
        let list = values.iter().map(|value| Value::Float(*value)).collect();
        self.0.insert(field.to_owned(), Value::Array(list));
    }

    /// The file's text: for which vehicle, from which logs, the overrides, the findings.
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
        let results = Value::try_from(results).context("findings as TOML")?;
        table.insert("result".to_owned(), results);
        let text = toml::to_string_pretty(&table).context("findings as TOML")?;
        Ok(format!(
            "# Found by `atvrec identify {command}`. Name this file under [vehicle] as one of \
             `overrides`\n# in atvrec.toml, and its [overrides] replace fields of the vehicle \
             file.\n{text}"
        ))
    }
}
