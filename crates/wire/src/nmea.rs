//! NMEA 0183.
/// A sentence.
#[derive(Clone, Debug, PartialEq)]
pub struct Sentence;
