//! NovAtel OEM4, OEMV and OEM6.
/// A log.
#[derive(Clone, Debug, PartialEq)]
pub struct Log;
