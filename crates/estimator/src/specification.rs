//! The filter specification as a Markdown page: `docs/filter-spec.md`.

use std::fmt::Write;

use crate::Tuning;
use crate::tuning::{Group, Numbers, walk};

/// Text of the page with the names of tuned numbers in braces.
const TEMPLATE: &str = include_str!("specification.md");

/// Effect of one number of a tuning on the errors of the estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivity {
    /// Dotted name of the parameter.
    pub name: String,
    /// Position in the parameter's list.
    pub index: usize,
    /// Change of the error with the number 20 % lower and 20 % higher, per cent.
    pub change_percent: [f64; 2],
}

impl Sensitivity {
    /// The larger change, per cent.
    #[must_use]
    pub fn largest_percent(&self) -> f64 {
        let [less, more] = self.change_percent.map(f64::abs);
        less.max(more)
    }

    /// Rows of a table `name,index,less_percent,more_percent` with a header, sorted by effect.
    ///
    /// # Errors
    /// A row that cannot be read; the text names it.
    pub fn from_csv(text: &str) -> Result<Vec<Self>, String> {
        let mut rows: Vec<Self> = Vec::new();
        for line in text.lines().skip(1) {
            let error = || format!("not a row of the sensitivity table: {line}");
            let fields: Vec<&str> = line.split(',').collect();
            let [name, index, less, more] = fields[..] else {
                return Err(error());
            };
            let number = |text: &str| text.parse::<f64>().map_err(|_| error());
            rows.push(Self {
                name: name.to_owned(),
                index: index.parse().map_err(|_| error())?,
                change_percent: [number(less)?, number(more)?],
            });
        }
        rows.sort_by(|a, b| b.largest_percent().total_cmp(&a.largest_percent()));
        Ok(rows)
    }
}

/// The page.
///
/// # Errors
/// A name in the template that no parameter has; the text names it.
pub fn markdown(sensitivities: &[Sensitivity]) -> Result<String, String> {
    let mut page = with_values(TEMPLATE)?;
    page.push_str(
        "## Tuning\n\nEvery tuned number. `[estimator.tuning]` in a configuration file sets values \
         for experiments, for example\n\n```toml\n[estimator.tuning.motion]\ngate_sigma = 6.0\n```\n\n\
         An unknown name is an error. The log carries the configuration, and a replay uses it.\n",
    );
    group_tables(&mut Tuning::default(), "", &mut page);
    page.push_str(
        "\n## Sensitivity\n\nChange of the error of the estimate when one number is 20 % lower and \
         20 % higher, largest first (a fading memory `keep` above 1 is unstable: \
         `corners.steering_wheel.rate_keep` 20 % higher is 1.02); the whole table is `filter-sensitivity.csv`. The error is the \
         mean of the RMS errors of forces, in units of 10 N, and of sideslip, in units of 0.002 rad, over \
         four excerpts of truth runs (`crates/estimator/tests/suite/sensitivity.rs`; `make campaigns` measures the table again).\n\n\
         | number | 20 % lower, % | 20 % higher, % |\n|---|---|---|\n",
    );
    for row in sensitivities.iter().take(20) {
        let [less, more] = row.change_percent;
        let Sensitivity { name, index, .. } = row;
        let _ = writeln!(page, "| `{name}` [{index}] | {less:.2} | {more:.2} |");
    }
    Ok(page)
}

/// The template with each `{name}` or `{name[index]}` replaced by value, unit and name.
fn with_values(template: &str) -> Result<String, String> {
    let mut page = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once('{') {
        let (name, after) = (after.split_once('}')).ok_or("a brace is not closed")?;
        page.push_str(before);
        page.push_str(&value_of(name)?);
        rest = after;
    }
    page.push_str(rest);
    Ok(page)
}

fn value_of(name: &str) -> Result<String, String> {
    let (parameter, index) = match name.split_once('[') {
        Some((parameter, index)) => (parameter, index.trim_end_matches(']').parse().ok()),
        None => (name, None),
    };
    let mut found = None;
    walk(&mut Tuning::default(), "", &mut |path, candidate| {
        if path == parameter {
            let numbers = candidate.value.numbers();
            let unit = index.and_then(|i: usize| candidate.unit.split(", ").nth(i));
            found = Some((
                match index {
                    Some(i) => numbers.get(i).map(number_text).unwrap_or_default(),
                    None => text_of(candidate.value),
                },
                unit.unwrap_or(candidate.unit),
            ));
        }
    });
    let (value, unit) = found.ok_or_else(|| format!("no tuning parameter is called {name}"))?;
    let unit = if unit == "1" { "" } else { unit };
    Ok(format!("{value} {unit}").trim_end().to_owned())
}

fn text_of(value: &dyn Numbers) -> String {
    let numbers: Vec<String> = value.numbers().iter().map(number_text).collect();
    numbers.join(", ")
}

/// Nine significant digits: 0.2² is 0.04 and not 0.04000000000000001.
fn number_text(number: &f64) -> String {
    let rounded = format!("{number:.8e}").parse::<f64>();
    rounded.unwrap_or(*number).to_string()
}

fn group_tables(group: &mut dyn Group, path: &str, page: &mut String) {
    let about = group.about().trim().to_owned();
    let parameters = group.parameters();
    let title = if path.is_empty() { "(top)" } else { path };
    let _ = write!(page, "\n### `{title}`\n\n{about}\n");
    if !parameters.is_empty() {
        page.push_str("\n| number | default | unit | meaning and source |\n|---|---|---|---|\n");
    }
    for parameter in parameters {
        let (name, unit) = (parameter.name, parameter.unit);
        let meaning = parameter.meaning.trim().replace('|', "\\|");
        let value = text_of(parameter.value);
        let _ = writeln!(page, "| `{name}` | {value} | {unit} | {meaning} |");
    }
    for (name, group) in group.groups() {
        let path = if path.is_empty() {
            name.to_owned()
        } else {
            format!("{path}.{name}")
        };
        group_tables(group, &path, page);
    }
}
