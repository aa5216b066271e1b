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
pub mod man;
pub mod record;
pub mod recover;
pub mod replay;
pub mod report;
pub mod score;
pub mod simulate;
pub mod virtual_;
