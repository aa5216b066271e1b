//! What the task of a source knows of its source, and how it waits.

use std::time::Duration;

use sample::{LossPlace, Notice, SourceId};
use tokio::sync::watch;

use crate::Sequencer;

/// The source that a task runs, and where its notices go.
#[derive(Clone, Debug)]
pub(crate) struct SourceContext {
    pub id: SourceId,
    pub name: String,
    pub sequencer: Sequencer,
}

impl SourceContext {
    pub fn notice(&self, notice: Notice) {
        self.sequencer.notice(self.id, notice);
    }

    pub fn lost(&self, place: LossPlace, count: u64) {
        if count > 0 {
            self.notice(Notice::Lost { place, count });
        }
    }
}

/// Waits for the shutdown, or for the end of the supervisor.
pub(crate) async fn stopped(shutdown: &mut watch::Receiver<bool>) {
    shutdown.wait_for(|stop| *stop).await.ok();
}

/// Waits; returns early, and `true`, at the shutdown.
pub(crate) async fn pause(duration: Duration, shutdown: &mut watch::Receiver<bool>) -> bool {
    tokio::select! {
        () = stopped(shutdown) => true,
        () = tokio::time::sleep(duration) => false,
    }
}
