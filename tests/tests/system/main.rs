//! The project as a whole: its layers, the recorder under kills, and the recorder in a real kernel.

mod kills;
mod layering;
#[cfg(feature = "rig")]
mod rig;
mod third_party;
mod units;
