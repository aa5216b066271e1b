//! Text devices described by the configuration.
/// A reading.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading;
