#![doc = include_str!("../README.md")]
//!
//! # Parts
//!
//! - [`LogWriter`] writes one log to any [`std::io::Write`]. The same input gives the same bytes.
//! - [`Writer`] writes one log file. The name of the file ends in `.active` until the log is complete.
//! - [`Recorder`] writes the files of a run on its own threads. Its methods never block the caller.
//! - [`Reader`] reads complete and incomplete logs. It gives the arrivals in the order in which they
//!   were recorded.
//! - [`recover`] makes a complete log from an unfinished or damaged one.
//! - [`align`](mod@align) gives columns of different rates at common times, and [`describe`] their units
//!   and frames of reference.

pub mod align;
mod channels;
mod column;
mod convert;
mod counters;
pub mod describe;
mod dynamic;
mod earlier;
mod error;
mod file;
mod journal;
mod ledger;
mod log_writer;
mod mcap_file;
mod new_name;
mod raw;
mod reader;
mod record;
mod recorder;
mod recovery;
mod rename;
mod scan;
mod scene;
mod schema;
mod session;
mod summary;
mod table;
mod tap;
mod wheels;

pub use sample;

pub use convert::Encoded;
pub use counters::WriteCounters;
pub use dynamic::{CAN_ID, DynamicMessage, SOURCE_ADDRESS, SignalSchema};
pub use earlier::{same_force_values, same_health_without_late};
pub use error::{Error, Result};
pub use file::{
    ACTIVE_SUFFIX, DAMAGED_SUFFIX, Finished, LOSSES_SUFFIX, UNRECOVERABLE_SUFFIX, Writer,
    is_same_file, losses_path, part_path, sync_folder,
};
pub use ledger::{LossLedger, Losses};
pub use log_writer::LogWriter;
pub use new_name::rename_without_replacing;
pub use reader::{
    ArrivalIter, ChannelInfo, EstimateJoiner, Info, Message, MessageIter, MessageRef, Missing,
    Reader, Selection,
};
pub use record::{
    ClockFit, Ground, LogMessage, Pose, Record, Stage, Transform, Truth, UtcOffset, WheelGround,
};
pub use recorder::{
    Backlog, DiskState, GoneLog, Progress, Recorder, RecorderStatus, RecorderSummary,
};
pub use recovery::{
    Loss, RecoverOptions, Recovered, companions, recover, recover_directory, recover_each,
    recover_with, salvage,
};
pub use rename::{RENAME_SUFFIX, finish_renames, rename_run};
pub use scan::{DEFAULT_MAX_CHUNK, max_chunk, set_max_chunk};
pub use scene::{Form, Scene, SceneEntity, Shape};
pub use session::{
    Attachment, ClockState, InjectedFault, Options, Origin, Session, Source, SourceKind, utc_ns,
};
pub use summary::Summary;
pub use table::{Column, RowDecoder, Table, Tables, Values};
pub use tap::{TapChannel, TapDecoder, TapEncoder, TapFrame, TapMessage};

/// Types generated from the schemas in `proto/` (`make bless` writes them).
pub mod proto {
    /// The project's own messages.
    #[allow(
        missing_docs,
        unused_qualifications,
        clippy::all,
        clippy::pedantic,
        rustdoc::all
    )]
    pub mod atvrec {
        include!("generated/atvrec.rs");

        pub(crate) mod earlier {
            include!("generated/atvrec.earlier.rs");
        }
    }

    /// The well-known messages that viewers display without configuration.
    #[allow(
        missing_docs,
        unused_qualifications,
        clippy::all,
        clippy::pedantic,
        rustdoc::all
    )]
    pub mod foxglove {
        include!("generated/foxglove.rs");
    }
}
