use std::path::PathBuf;

/// Ends of names that truth files may have.
#[cfg(feature = "parquet")]
const KINDS: &str = ".parquet or .csv";
/// Ends of names that truth files may have.
#[cfg(not(feature = "parquet"))]
const KINDS: &str = ".csv (this build reads no .parquet)";

/// What can go wrong in making a virtual vehicle.
///
/// A message names its cause, so causes are fields and not sources: whoever prints the chain of
/// errors prints each once.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The truth file cannot be read.
    #[error("cannot read truth file {path}: {cause}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        cause: std::io::Error,
    },
    /// The file's name ends in something unknown, or in .parquet in a build without that feature.
    #[error("truth file {path}: unknown kind of file; the name must end in {KINDS}")]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// The Parquet file is damaged or of a kind that is not understood.
    #[cfg(feature = "parquet")]
    #[error("truth file {path}: {cause}; write it as Parquet 2 with double columns")]
    Parquet {
        /// The file.
        path: PathBuf,
        /// What the Parquet reader said.
        cause: parquet::errors::ParquetError,
    },
    /// The file is damaged, or declares what it does not hold.
    #[error("cannot read truth file {path}: {what}; write the file again")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The file holds more than is read.
    #[error("truth file {path} has more than {most} {what}; split the file")]
    TooMuch {
        /// The file.
        path: PathBuf,
        /// What there is too much of.
        what: &'static str,
        /// How much is read.
        most: u64,
    },
    /// The CSV file is malformed.
    #[error("truth file {path}: {cause}; the first line must contain the names of the columns")]
    Csv {
        /// The file.
        path: PathBuf,
        /// What the CSV reader said.
        cause: csv::Error,
    },
    /// Columns that the virtual vehicle cannot do without.
    #[error(
        "truth file {path} does not have the column(s) {}; docs/truth-files.md lists all columns \
         and what replaces them",
        columns.join(", ")
    )]
    MissingColumns {
        /// The file.
        path: PathBuf,
        /// All that are missing, as `name[unit]`.
        columns: Vec<String>,
    },
    /// A known column in another unit.
    #[error("truth file {path}: column {found} must be in {expected}; convert and rename it")]
    WrongUnit {
        /// The file.
        path: PathBuf,
        /// The column as found.
        found: String,
        /// The column as it must be named.
        expected: String,
    },
    /// A column whose type is not a number.
    #[error(
        "truth file {path}: column {column} contains {found} instead of numbers; write it as double"
    )]
    NotNumbers {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// The type found.
        found: String,
    },
    /// A cell that is not a finite number.
    #[error("truth file {path}: row {row} of column {column} is {value:?}, not a finite number")]
    BadValue {
        /// The file.
        path: PathBuf,
        /// Row, from 1 after the header.
        row: usize,
        /// The column.
        column: String,
        /// The cell's text.
        value: String,
    },
    /// Fewer than two rows.
    #[error("a motion needs at least two rows, but there are {found}")]
    TooShort {
        /// Instants given.
        found: usize,
    },
    /// Time does not rise.
    #[error("the time must increase, but row {row} is at {time_s} s after {previous_s} s")]
    TimeOrder {
        /// Row, from 1.
        row: usize,
        /// Its time.
        time_s: f64,
        /// The time of the row before it.
        previous_s: f64,
    },
    /// A gap that no motion can be interpolated over.
    #[error(
        "the gap between rows {previous} and {row} is {gap_s} s, but the limit is {most_s} s; \
         correct the times, or split the file"
    )]
    Gap {
        /// Row before the gap, from 1.
        previous: usize,
        /// Row behind it.
        row: usize,
        /// Time between them, s.
        gap_s: f64,
        /// Longest gap, s.
        most_s: f64,
    },
    /// The model refuses vehicle or sensors.
    #[error(transparent)]
    Model(#[from] model::Error),
    /// A number that makes no sense, such as a rate of zero.
    #[error("{name} is {value}; it must be {expected}")]
    BadParameter {
        /// The dotted name.
        name: String,
        /// Its value.
        value: f64,
        /// What is acceptable.
        expected: &'static str,
    },
    /// A bus or a serial line cannot carry what its devices send.
    #[error(
        "{arithmetic}, but at most {most_percent} % can be used; lower {rate_fields}, or raise \
         {bit_rate_field} to at least {needed}"
    )]
    Overloaded {
        /// Port, parts, sum and share.
        arithmetic: String,
        /// Greatest share, %.
        most_percent: f64,
        /// Fields that have the rates.
        rate_fields: String,
        /// Field that has the bit rate.
        bit_rate_field: &'static str,
        /// Bit rate that suffices, bit/s.
        needed: f64,
    },
    /// The linkage cannot stand as the motion says.
    #[error(
        "{wheel} at {time_s} s: {cause}; check strut lengths and steering-wheel angle of the motion"
    )]
    Linkage {
        /// The corner.
        wheel: sample::Wheel,
        /// When.
        time_s: f64,
        /// What the linkage says.
        cause: model::suspension::SuspensionError,
    },
    /// The vehicle cannot go on over the ground.
    #[error(
        "at {time_s} s the vehicle cannot go on over this ground: {cause}; drive more slowly, or \
         over lower obstacles"
    )]
    Rough {
        /// When.
        time_s: f64,
        /// What the model says.
        cause: model::Error,
    },
    /// A road for a manoeuvre that has a ground of its own.
    #[error(
        "{manoeuvre} is not driven on the road {road}: it has a ground of its own; leave out --road \
         or use a manoeuvre such as rough-road"
    )]
    OwnGround {
        /// The manoeuvre.
        manoeuvre: &'static str,
        /// Name of the road.
        road: String,
    },
    /// An unknown manoeuvre.
    #[error("{name:?} is not a manoeuvre; use one of: {known}")]
    UnknownManoeuvre {
        /// The name asked for.
        name: String,
        /// All names.
        known: String,
    },
}
