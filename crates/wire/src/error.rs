use thiserror::Error;

/// What can go wrong when a decoder or a dialogue is set up or a message is encoded. Bytes from a
/// device never give an error: they are counted in [`crate::Statistics`].
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum WireError {
    /// A setting of a source cannot work.
    #[error("{what} is {got}, expected {expected}")]
    Setting {
        /// Name of the setting.
        what: &'static str,
        /// Its value.
        got: String,
        /// What would work.
        expected: &'static str,
    },
    /// The device answered at none of the line speeds.
    #[error("no answer from the {device} at any of {bauds:?} baud; check cable, power and port")]
    NoAnswer {
        /// Which device.
        device: &'static str,
        /// Line speeds that were tried.
        bauds: Vec<u32>,
    },
    /// The device refused a command.
    #[error("the {device} rejected the command {command}; check that its firmware supports it")]
    Refused {
        /// Which device.
        device: &'static str,
        /// The command, as it names it.
        command: String,
    },
    /// The device did not confirm a command.
    #[error("the {device} did not confirm the command {command} in {attempts} attempts")]
    Unconfirmed {
        /// Which device.
        device: &'static str,
        /// The command, as it names it.
        command: String,
        /// How often it was sent.
        attempts: u32,
    },
}
