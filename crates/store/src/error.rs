use std::path::{Path, PathBuf};

/// What this crate returns.
pub type Result<T> = std::result::Result<T, Error>;

/// What can go wrong between samples and the disk.
///
/// A message names its cause, because it also goes into status texts and log lines that know no
/// chain of errors. So causes are fields and not [`std::error::Error::source`]s: whoever prints the
/// chain prints each cause once.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The bytes of a connection are not those of a tap.
    #[error(
        "the tap of the recorder sent data that is not valid: {0}; both sides must be of the same version of atvrec"
    )]
    Tap(String),
    /// The operating system refused an operation on a file.
    #[error("cannot {action} {}: {cause}", path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// The error of the operating system.
        cause: std::io::Error,
    },
    /// What a log is written to, or salvaged from, failed.
    #[error("the log cannot be written or read: {0}")]
    Sink(std::io::Error),
    /// The MCAP layer failed.
    #[error("the log cannot be written as MCAP: {0}")]
    Mcap(mcap::McapError),
    /// The file has no byte.
    #[error("{} is empty: it is no log; a recording writes its first bytes at its start", path.display())]
    EmptyFile {
        /// The file.
        path: PathBuf,
    },
    /// The file is no MCAP file.
    #[error("{} is not an MCAP file: it begins with {found:02x?}", path.display())]
    NotMcap {
        /// Which file.
        path: PathBuf,
        /// Its first bytes.
        found: Vec<u8>,
    },
    /// Files of different runs were given as one.
    #[error(
        "{} belongs to run {found}, the files before it to run {expected}; \
         read the runs one at a time",
        path.display()
    )]
    MixedRuns {
        /// The file that differs.
        path: PathBuf,
        /// Run of the first file.
        expected: String,
        /// Run of this file.
        found: String,
    },
    /// A file was given twice.
    #[error("{} and {} are the same file; give it once", first.display(), second.display())]
    SameFile {
        /// As it was named first.
        first: PathBuf,
        /// As it was named again.
        second: PathBuf,
    },
    /// No file was given.
    #[error("no log was given")]
    NoFiles,
    /// A message does not follow its schema.
    #[error("a message on {topic} at {log_time} ns does not follow its schema: {cause}")]
    BadMessage {
        /// Topic of the message.
        topic: String,
        /// Its log time, ns.
        log_time: u64,
        /// What is wrong with it.
        cause: MessageError,
    },
    /// The log has no channel of this topic.
    #[error("the log has no topic {topic}; it has {known}")]
    NoTopic {
        /// Topic asked for.
        topic: String,
        /// Topics there are.
        known: String,
    },
    /// The schema of a channel cannot be used.
    #[error("the schema {schema} of {topic} cannot be read: {what}")]
    Schema {
        /// Topic of the channel.
        topic: String,
        /// Name of the schema.
        schema: String,
        /// What is wrong with it.
        what: &'static str,
    },
    /// The messages of a topic have another encoding than the project's.
    #[error("the messages of {topic} are {}{}, which is not decoded; {}",
        shown(.encoding), schema_in_brackets(.schema), help_for(.encoding, .topic))]
    Encoding {
        /// Topic.
        topic: String,
        /// Name of the schema; may be empty.
        schema: String,
        /// Encoding of the messages.
        encoding: String,
    },
    /// Another process is writing the file.
    #[error("{} is being written by another process; stop it first", .0.display())]
    InUse(PathBuf),
    /// A recovery was stopped; the file is unchanged.
    #[error("the recovery of {} was stopped; the file is unchanged", .0.display())]
    Stopped(PathBuf),
    /// The disk has no room for the recovered copy of a log.
    #[error(
        "{} is damaged or unfinished, and the disk has no room for a recovered copy: {needed} bytes \
         are needed, {free} are free; the file is unchanged and can be read as it is; free space, \
         then run `atvrec recover`",
        path.display()
    )]
    NoRoom {
        /// The log.
        path: PathBuf,
        /// Bytes that the copy needs.
        needed: u64,
        /// Bytes that are free.
        free: u64,
    },
    /// A part of a file is larger than allowed, so that the file is not recovered.
    #[error(
        "{} has a record of {bytes} bytes, more than the {bound} that are allowed; the file is \
         unchanged; run `atvrec recover --max-chunk` with a larger bound",
        path.display()
    )]
    TooLarge {
        /// Which file.
        path: PathBuf,
        /// Size of the record, as it claims or inflates.
        bytes: u64,
        /// The bound.
        bound: u64,
    },
    /// A log whose name another file has.
    #[error(
        "{} cannot be recovered: {} exists and has other contents; rename one of them",
        path.display(), existing.display()
    )]
    NameTaken {
        /// The unfinished log.
        path: PathBuf,
        /// The file that has its name.
        existing: PathBuf,
    },
    /// What bears the name of an unfinished log is no file.
    #[error("{} is not a regular file", .0.display())]
    NoFile(PathBuf),
    /// Recovery cannot handle a file; the file has another name from now on.
    #[error("{cause}; it was set aside as {}", to.display())]
    SetAside {
        /// Its new name.
        to: PathBuf,
        /// Why recovery failed.
        cause: Box<Error>,
    },
    /// The recovered copy of a log does not read as it was written.
    #[error(
        "the recovered copy of {} differs from the data that was written: {what}; the file is \
         unchanged; check the disk",
        path.display()
    )]
    NotVerified {
        /// The log.
        path: PathBuf,
        /// What is wrong with the copy.
        what: String,
    },
    /// A message has a topic that is kept for other uses.
    #[error(
        "the topic {0} is reserved for states of the estimator; give the message another topic"
    )]
    ReservedTopic(&'static str),
    /// The writer's thread ended early.
    #[error("the writer thread ended early; the log was closed as far as it was written")]
    WriterGone,
    /// The recorder finished, but data did not reach the disk.
    #[error("{arrivals} arrivals and {records} records did not reach the disk: {reason}")]
    DiskLoss {
        /// Raw arrivals lost.
        arrivals: u64,
        /// Decoded records lost.
        records: u64,
        /// The last error of the disk.
        reason: String,
    },
}

/// What is wrong with a message.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// Not protobuf, or of another schema.
    #[error(transparent)]
    Protobuf(#[from] prost::DecodeError),
    /// A list has another length than the lists beside it.
    #[error("{column} has {found} entries, expected {expected}")]
    Column {
        /// Name of the list.
        column: &'static str,
        /// Entries of the other lists.
        expected: usize,
        /// Entries found.
        found: usize,
    },
    /// A value outside its range.
    #[error("{field} is {value}, out of its range")]
    Range {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: i128,
    },
    /// The frames' data cannot be unpacked.
    #[error("the data cannot be unpacked: {0}")]
    Data(std::io::Error),
    /// A field that must be there is not.
    #[error("{0} is missing")]
    Absent(&'static str),
}

impl From<mcap::McapError> for Error {
    fn from(error: mcap::McapError) -> Self {
        match error {
            mcap::McapError::Io(cause) => Self::Sink(cause),
            other => Self::Mcap(other),
        }
    }
}

impl Error {
    /// Names the file whose bytes were refused.
    pub(crate) fn at(self, path: &Path) -> Self {
        match self {
            Self::Sink(cause) => Self::file("write", path)(cause),
            other => other,
        }
    }

    /// There was no room: what the disk took before is safe.
    pub(crate) fn is_full_disk(&self) -> bool {
        use std::io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        let (Self::File { cause, .. } | Self::Sink(cause)) = self else {
            return false;
        };
        matches!(cause.kind(), StorageFull | QuotaExceeded | FileTooLarge)
    }

    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |cause| Self::File {
            action,
            path,
            cause,
        }
    }
}

/// Name of an encoding for people.
fn shown(encoding: &str) -> String {
    match encoding {
        "json" | "cbor" | "cdr" => encoding.to_uppercase(),
        other => other.to_owned(),
    }
}

fn schema_in_brackets(schema: &str) -> String {
    if schema.is_empty() {
        String::new()
    } else {
        format!(" (schema {schema})")
    }
}

/// What reads messages of an encoding.
fn help_for(encoding: &str, topic: &str) -> String {
    let package = match encoding {
        "json" => {
            return format!(
                "`mcap cat --json --topics {topic} FILE` of the MCAP tools prints them, and the Python \
                 package mcap reads them"
            );
        }
        "ros1" => "mcap-ros1-support",
        "cdr" => "mcap-ros2-support",
        _ => "mcap",
    };
    format!("the Python package {package} reads them")
}

#[cfg(test)]
mod tests {
    use std::error::Error as _;

    use super::*;

    /// `atvrec replay missing.mcap` printed "No such file or directory" twice: the message contained the
    /// cause, and the chain of causes did, too.
    #[test]
    fn a_cause_is_printed_once() {
        let missing = || std::io::Error::from(std::io::ErrorKind::NotFound);
        let undecodable = || prost_error().into();
        let errors = [
            Error::file("open", Path::new("missing.mcap"))(missing()),
            Error::Sink(missing()),
            Error::from(mcap::McapError::Io(missing())),
            Error::from(mcap::McapError::BadMagic),
            bad_message(MessageError::Data(missing())),
            bad_message(undecodable()),
        ];
        for error in errors {
            let mut cause = error.source();
            while let Some(shown) = cause {
                assert!(!error.to_string().contains(&shown.to_string()), "{error}");
                cause = shown.source();
            }
        }
        let error = Error::file("open", Path::new("missing.mcap"))(missing());
        assert_eq!(
            error.to_string(),
            format!("cannot open missing.mcap: {}", missing())
        );
    }

    fn prost_error() -> prost::DecodeError {
        <crate::proto::atvrec::Mark as prost::Message>::decode([0xff_u8].as_slice())
            .expect_err("a cut key")
    }

    fn bad_message(cause: MessageError) -> Error {
        Error::BadMessage {
            topic: "/mark".to_owned(),
            log_time: 0,
            cause,
        }
    }
}
