//! `atvrec link`: CAN interfaces come up with the configuration's bit rates. For a system that lets
//! a small program do so, and not the recorder.

use acq::{CanSpec, SourceKind, link};

use crate::cli::LinkArgs;
use crate::config::Config;
use crate::exit::Outcome;

/// Brings up what is down.
pub fn run(args: &LinkArgs) -> anyhow::Result<Outcome> {
    let config = Config::load(&args.config)?;
    let wanted =
        |can: &&CanSpec| args.interfaces.is_empty() || args.interfaces.contains(&can.interface);
    let buses = config
        .sources
        .iter()
        .filter_map(|source| match &source.spec.kind {
            SourceKind::Can(can) => Some(can),
            _ => None,
        });
    let mut outcome = Outcome::Good;
    for can in buses.filter(wanted) {
        let Some(spec) = &can.link else {
            tracing::info!(interface = %can.interface, "has no bitrate, left to the system");
            continue;
        };
        match link::bring_up(&can.interface, spec) {
            Ok(()) => tracing::info!(interface = %can.interface, bit_rate = spec.bit_rate, "up"),
            Err(error) => {
                tracing::error!(%error);
                outcome = Outcome::Failed;
            }
        }
    }
    Ok(outcome)
}
