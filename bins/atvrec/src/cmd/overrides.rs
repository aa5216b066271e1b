//! Files with overrides of fields of a vehicle file, from workshop tables.

use std::path::Path;

use toml::{Table, Value};

/// Text of a file for the vehicle's `overrides`: for which vehicle, from which table, and the fields by their
/// dotted names.
pub fn text(
    command: &str,
    vehicle: &str,
    source: &Path,
    fields: &Table,
) -> Result<String, toml::ser::Error> {
    let table = Table::from_iter([
        ("vehicle".to_owned(), Value::from(vehicle)),
        ("made_by".to_owned(), Value::from(command)),
        (
            "logs".to_owned(),
            Value::Array(vec![source.display().to_string().into()]),
        ),
        ("overrides".to_owned(), Value::Table(fields.clone())),
    ]);
    let text = toml::to_string_pretty(&table)?;
    Ok(format!(
        "# Result of `atvrec {command}`. Add this file to `overrides` under [vehicle] in\n# atvrec.toml; then \
         its [overrides] replace fields of the vehicle file.\n{text}"
    ))
}
