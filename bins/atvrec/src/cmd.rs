//! Commands, one per file.

pub mod calibrate;
pub mod check;
pub mod completions;
pub mod control;
pub mod demo;
pub mod export;
pub mod findings;
pub mod identify;
pub mod import;
pub mod info;
pub mod link;
#[cfg(feature = "live")]
pub mod live;
pub mod man;
pub mod record;
pub mod recover;
pub mod replay;
pub mod report;
pub mod score;
pub mod simulate;
#[cfg(feature = "live")]
pub mod top;
pub mod virtual_;
