/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read.
    #[error("the file cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The file has another format.
    #[error("the file is not {expected}: it begins with {found}; check the format of the file")]
    OtherFormat {
        /// The format that the reader reads.
        expected: &'static str,
        /// First bytes of the file.
        found: String,
    },
    /// The file has a version of its format that the reader does not read.
    #[error("the file is {found}; this reader reads {expected}: {advice}")]
    OtherVersion {
        /// What the reader reads.
        expected: &'static str,
        /// Format and version of the file.
        found: String,
        /// What the user can do.
        advice: &'static str,
    },
    /// The file has a format that is not read.
    #[error("the file is {found}; {help}")]
    NotRead {
        /// Format of the file.
        found: &'static str,
        /// What the user can do.
        help: &'static str,
    },
    /// The frames have no stamps.
    #[error("the lines of the file have no time; record with `candump -L`, or with `candump -ta`")]
    NoStamps,
    /// The file has no frames of a CAN bus, and no place for them.
    #[error("the file has no CAN frames, only measured signals: {signals}")]
    OnlySignals {
        /// Number of signals and the names of the first ones.
        signals: String,
    },
    /// The file is damaged at a place without which nothing can be read.
    #[error("{what} at byte {place} is damaged; get the file again from its source")]
    Damaged {
        /// Which part of the file.
        what: &'static str,
        /// Its place, bytes from the start of the file.
        place: u64,
    },
}

impl Error {
    /// The file begins with bytes of another format.
    pub(super) fn other_format(expected: &'static str, start: &[u8]) -> Self {
        let start = &start[..start.len().min(16)];
        Self::OtherFormat {
            expected,
            found: format!("`{}`", start.escape_ascii()),
        }
    }
}
