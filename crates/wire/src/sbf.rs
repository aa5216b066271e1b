//! Septentrio Binary Format.
/// A block.
#[derive(Clone, Debug, PartialEq)]
pub struct Block;
