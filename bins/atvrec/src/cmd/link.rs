//! `atvrec link` brings CAN interfaces up with the configuration's bit rates, for systems in which
//! the recorder itself may not configure the network.

use acq::{CanSpec, SourceKind, link};
use engine::Config;

use crate::cli::LinkArgs;
use crate::exit::Outcome;

/// Brings up what is down.
pub fn run(args: &LinkArgs) -> anyhow::Result<Outcome> {
    let config = Config::load(&args.config)?;
    let wanted = |can: &&CanSpec| {
        args.interfaces.is_empty()
            || args
                .interfaces
                .iter()
                .any(|name| names(name, &can.interface))
    };
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

/// Whether `argument` names the interface, as it is or with the `\xNN` escapes of a systemd unit's
/// name.
fn names(argument: &str, interface: &str) -> bool {
    argument == interface || unescaped(argument).as_deref() == Some(interface.as_bytes())
}

/// Bytes of a name with `\xNN` escapes; `None` if it has an invalid escape.
fn unescaped(name: &str) -> Option<Vec<u8>> {
    let mut parts = name.split("\\x");
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        bytes.push(u8::from_str_radix(part.get(..2)?, 16).ok()?);
        bytes.extend_from_slice(&part.as_bytes()[2..]);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interfaces_are_named_as_they_are_or_escaped() {
        for argument in ["can-left", "can\\x2dleft", "\\x63an-left"] {
            assert!(names(argument, "can-left"), "{argument}");
        }
        for argument in [
            "can-right",
            "can/left",
            "can\\x2",
            "can\\xzzleft",
            "can\\x2ä",
        ] {
            assert!(!names(argument, "can-left"), "{argument}");
        }
        assert!(names("can\\x2d", "can\\x2d"));
    }
}
