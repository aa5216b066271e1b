//! Interruption of long work by SIGINT or SIGTERM, without leaving half a file.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;

/// Exit code after a second signal.
const SECOND_SIGNAL: i32 = 130;

/// Whether a signal asked the command to end.
#[derive(Clone)]
pub struct Interrupt(Arc<AtomicBool>);

/// The user interrupted the command.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; the output was not written")]
pub struct Interrupted;

impl Interrupt {
    /// Listens to SIGINT and SIGTERM. A second signal ends the program at once.
    pub fn listen() -> anyhow::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(Arc::clone(&stop))?;
        Ok(Self(stop))
    }

    /// An error after a signal.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.0.load(Ordering::Relaxed) {
            return Err(Interrupted);
        }
        Ok(())
    }
}

/// Sets `stop` when SIGINT or SIGTERM is received.
pub fn stop_on_signals(stop: Arc<AtomicBool>) -> anyhow::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the signal handling")?;
    // The handlers are installed before the work starts.
    let guard = runtime.enter();
    let mut interrupt = signal(SignalKind::interrupt()).context("cannot listen for SIGINT")?;
    let mut terminate = signal(SignalKind::terminate()).context("cannot listen for SIGTERM")?;
    drop(guard);
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            runtime.block_on(async {
                loop {
                    tokio::select! {
                        _ = interrupt.recv() => {}
                        _ = terminate.recv() => {}
                    }
                    if stop.swap(true, Ordering::Relaxed) {
                        std::process::exit(SECOND_SIGNAL);
                    }
                }
            });
        })
        .context("cannot start the thread \"signals\"")?;
    Ok(())
}
