//! Reading TOML files: all mistakes of a file are reported at once, each with its line, the field, the
//! value and what to do. A file is read field by field ([`Section`]) or under rules.

#[cfg(test)]
mod reference;
pub(crate) mod rules;
mod section;
#[cfg(test)]
mod tests;

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use sample::boundary::guarded;
use sample::text::printable;
use toml::Spanned;
use toml::de::DeTable;

pub use section::{Field, FromValue, NumberOrList, Section};

/// A problem of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Name of the file.
    pub file: String,
    /// Line, from 1; 0 for a problem of the whole file.
    pub line: usize,
    /// Column, from 1; 0 if only the line is known.
    pub column: usize,
    /// Dotted name of the field, such as `source.imu.baud`; empty for a problem of the whole file.
    pub field: String,
    /// The value found, as written; empty where the message has it.
    pub value: String,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl Problem {
    /// Description with the value.
    #[must_use]
    pub fn statement(&self) -> String {
        if self.value.is_empty() {
            self.message.clone()
        } else {
            format!("{} {}", self.value, self.message)
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&printable(&self.file))?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
        }
        if self.column > 0 {
            write!(f, ":{}", self.column)?;
        }
        f.write_str(": ")?;
        if !self.field.is_empty() {
            write!(f, "{}: ", printable(&self.field))?;
        }
        f.write_str(&printable(&self.statement()))?;
        if !self.help.is_empty() {
            write!(f, "\n    help: {}", printable(&self.help))?;
        }
        Ok(())
    }
}

/// All mistakes of one file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileErrors {
    /// The file.
    pub path: PathBuf,
    /// Its mistakes, in the order of the lines.
    pub problems: Vec<Problem>,
}

impl FileErrors {
    fn of(path: &Path, collector: ErrorCollector<'_>) -> Self {
        Self {
            path: path.to_owned(),
            problems: collector.into_problems(),
        }
    }

    /// No error where there is no problem.
    pub(crate) fn check(file: &str, problems: Vec<Problem>) -> Result<(), Self> {
        if problems.is_empty() {
            Ok(())
        } else {
            Err(Self::sorted(PathBuf::from(file), problems))
        }
    }

    pub(crate) fn sorted(path: PathBuf, mut problems: Vec<Problem>) -> Self {
        problems.sort_by(|a, b| (a.line, &a.field).cmp(&(b.line, &b.field)));
        Self { path, problems }
    }
}

impl fmt::Display for FileErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.problems.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            // A road file names further files, whose problems stand beside its own.
            write!(f, "{}", problem.file)?;
            if problem.line > 0 {
                write!(f, ":{}", problem.line)?;
            }
            write!(f, ": {}", problem.field)?;
            if !problem.value.is_empty() {
                write!(f, " = {}", problem.value)?;
            }
            let colon = if problem.field.is_empty() { "" } else { ": " };
            write!(f, "{colon}{}; {}", problem.message, problem.help)?;
        }
        Ok(())
    }
}

impl std::error::Error for FileErrors {}

/// Largest TOML text that is read, bytes.
pub const TOML_MAX: usize = 1 << 20;
/// Most problems of a file that are reported.
const PROBLEMS_MAX: usize = 100;

/// Collects the problems of a file.
pub struct ErrorCollector<'t> {
    file: &'t str,
    text: &'t str,
    problems: Vec<Problem>,
    /// Problems beyond [`PROBLEMS_MAX`].
    more: usize,
    warnings: Vec<Problem>,
}

impl<'t> ErrorCollector<'t> {
    /// Collector for the file with the name `file` and the content `text`.
    pub fn new(file: &'t str, text: &'t str) -> Self {
        Self {
            file,
            text,
            problems: Vec::new(),
            more: 0,
            warnings: Vec::new(),
        }
    }

    /// Adds a problem at `span` of the text.
    pub fn add(
        &mut self,
        span: &Range<usize>,
        field: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        if self.count_if_full() {
            return;
        }
        let (line, column) = line_and_column(self.text, span.start);
        self.problems.push(Problem {
            file: self.file.to_owned(),
            line,
            column,
            field: field.to_owned(),
            value: String::new(),
            message: message.into(),
            help: help.into(),
        });
    }

    /// Adds a warning at `span` of the text: the file is read, but something in it should be changed.
    pub fn warn(
        &mut self,
        span: &Range<usize>,
        field: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        let (line, column) = line_and_column(self.text, span.start);
        if self.warnings.len() < PROBLEMS_MAX {
            self.warnings.push(Problem {
                file: self.file.to_owned(),
                line,
                column,
                field: field.to_owned(),
                value: String::new(),
                message: message.into(),
                help: help.into(),
            });
        }
    }

    /// Adds warnings of another file.
    pub fn warn_foreign(&mut self, warnings: Vec<Problem>) {
        self.warnings.extend(warnings);
    }

    /// The warnings, which are removed.
    pub fn take_warnings(&mut self) -> Vec<Problem> {
        std::mem::take(&mut self.warnings)
    }

    /// Adds a problem with a value on a line; 0 means the file as a whole.
    fn add_at(&mut self, line: usize, field: &str, value: &str, message: String, help: String) {
        if self.count_if_full() {
            return;
        }
        self.problems.push(Problem {
            file: self.file.to_owned(),
            line,
            column: 0,
            field: field.to_owned(),
            value: value.to_owned(),
            message,
            help,
        });
    }

    /// Line of a position of the text, from 1.
    pub(crate) fn line_of(&self, span: &Range<usize>) -> usize {
        line_and_column(self.text, span.start).0
    }

    /// The table of the text; what hinders that is a problem.
    pub fn parse(&mut self) -> Option<Spanned<DeTable<'t>>> {
        let whole = 0..0;
        match parse(self.text) {
            Ok(table) => return Some(table),
            Err(Unparsed::Syntax(errors)) => {
                for error in errors {
                    let span = error.span().unwrap_or(whole.clone());
                    self.add(&span, "", error.message(), "correct the TOML syntax");
                }
            }
            Err(Unparsed::Whole(message, help)) => self.add(&whole, "", message, help),
        }
        None
    }

    /// Adds problems of another file.
    pub fn add_foreign(&mut self, problems: impl IntoIterator<Item = Problem>) {
        for problem in problems {
            if !self.count_if_full() {
                self.problems.push(problem);
            }
        }
    }

    fn is_full(&self) -> bool {
        self.problems.len() >= PROBLEMS_MAX
    }

    /// Whether there is no room for a further problem, which is counted then.
    fn count_if_full(&mut self) -> bool {
        let full = self.is_full();
        self.more += usize::from(full);
        full
    }

    /// Whether there is no problem so far.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Problems in the order of the text.
    pub fn into_problems(mut self) -> Vec<Problem> {
        let own = self.file;
        self.problems.sort_by_key(|p| {
            let [file, field] = [&p.file, &p.field].map(String::clone);
            (p.file != own, file, p.line, p.column, field)
        });
        if self.more > 0 {
            self.problems.push(Problem {
                file: own.to_owned(),
                line: 0,
                column: 0,
                field: String::new(),
                value: String::new(),
                message: format!("{} more errors are not shown", self.more),
                help: "correct the errors above and check again".to_owned(),
            });
        }
        self.problems
    }
}

/// Why a text is no table.
#[derive(Debug)]
enum Unparsed {
    /// Its syntax is wrong.
    Syntax(Vec<toml::de::Error>),
    /// What is wrong with all of it, and what to do.
    Whole(String, &'static str),
}

impl Unparsed {
    /// The parser ended with a panic, which said this.
    fn panic(panic: &str) -> Self {
        Self::Whole(
            format!("the TOML parser failed: {panic}"),
            "correct the TOML syntax",
        )
    }
}

/// Formats that are taken for TOML by mistake, by their first character.
const OTHER_FORMATS: [(char, &str); 2] = [('{', "JSON"), ('<', "XML or HTML")];

/// The table of a TOML text.
fn parse(text: &str) -> Result<Spanned<DeTable<'_>>, Unparsed> {
    if text.len() > TOML_MAX {
        let bytes = text.len();
        let message = format!("the file has {bytes} bytes, but the limit is {TOML_MAX}");
        return Err(Unparsed::Whole(message, "check the name of the file"));
    }
    // No TOML text begins with these characters, and each line would be an error.
    let first = text.trim_start().chars().next();
    if let Some((_, format)) = (OTHER_FORMATS.iter()).find(|(c, _)| Some(*c) == first) {
        return Err(Unparsed::Whole(
            format!("the file is {format}, not TOML"),
            "give a TOML file (atvrec vehicle new and sensors new write examples; atvrec import vehicle converts \
             the params.json of a simulator)",
        ));
    }
    match guarded(|| DeTable::parse_recoverable(text)) {
        Ok((table, errors)) if errors.is_empty() => Ok(table),
        Ok((_, errors)) => Err(Unparsed::Syntax(errors)),
        Err(panic) => Err(Unparsed::panic(&panic)),
    }
}

/// The table of a TOML text with the places of its values, if its syntax is right.
pub(crate) fn span_table(text: &str) -> Option<Spanned<DeTable<'_>>> {
    parse(text).ok()
}

/// Line and column, both from 1, of a byte position.
fn line_and_column(text: &str, position: usize) -> (usize, usize) {
    let before = text.get(..position.min(text.len())).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}

/// The known name that is meant by `name`, if one is near: a quarter of its letters and one more may
/// differ. The nearest name wins, among equally near ones the first in the alphabet.
#[must_use]
pub fn closest<'k>(name: &str, known: &[&'k str]) -> Option<&'k str> {
    known
        .iter()
        .map(|other| (strsim::levenshtein(name, other), *other))
        .filter(|(distance, other)| *distance <= 1 + other.len() / 4)
        .min()
        .map(|(_, other)| other)
}
