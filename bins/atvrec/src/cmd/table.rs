//! Tables of the workshop (CSV).

use std::path::Path;

use anyhow::Context;
use serde::de::DeserializeOwned;

use crate::exit::UsageError;

/// Rows of a table with a line of heads; lines that begin with `#` are comments. A row that is not of this
/// type is an error of its own, so that all of them can be reported.
///
/// # Errors
/// If the file cannot be read, lacks one of the columns `needed`, or has a column that is neither needed nor
/// `optional`.
pub fn rows<T: DeserializeOwned>(
    path: &Path,
    needed: &[&str],
    optional: &[&str],
) -> anyhow::Result<Vec<Result<T, csv::Error>>> {
    let shown = path.display();
    let file = std::fs::File::open(path).with_context(|| format!("cannot read {shown}"))?;
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(file);
    let heads = reader
        .headers()
        .with_context(|| format!("{shown} is no CSV file"))?;
    let columns = match optional {
        [] => needed.join(","),
        _ => format!("{}, and may have {}", needed.join(","), optional.join(",")),
    };
    let is_there = |column: &&&str| heads.iter().any(|head| head == **column);
    let missing: Vec<&str> = needed
        .iter()
        .filter(|column| !is_there(column))
        .copied()
        .collect();
    if !missing.is_empty() {
        let missing = missing.join(", ");
        return Err(UsageError(format!(
            "{shown}: the first line lacks {missing}; it must have {columns}"
        ))
        .into());
    }
    let is_known = |head: &&str| needed.contains(head) || optional.contains(head);
    if let Some(unknown) = heads.iter().find(|head| !is_known(head)) {
        return Err(UsageError(format!(
            "{shown}: the column {unknown:?} is unknown; the first line must have {columns}"
        ))
        .into());
    }
    Ok(reader.into_deserialize().collect())
}
