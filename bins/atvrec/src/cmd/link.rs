//! `atvrec link`: bring up CAN interfaces with the bit rates of the configuration, for systems on
//! which the recorder has no permission to configure the network.

use acq::{CanSpec, SourceKind, link};
use engine::Config;

use crate::cli::LinkArgs;
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &LinkArgs) -> anyhow::Result<Outcome> {
    let config = Config::load(&args.config)?;
    let is_selected = |can: &&CanSpec| {
        args.interfaces.is_empty()
            || args
                .interfaces
                .iter()
                .any(|name| is_name_of(name, &can.interface))
    };
    let buses = config
        .sources
        .iter()
        .filter_map(|source| match &source.spec.kind {
            SourceKind::Can(can) => Some(can),
            _ => None,
        });
    let buses: Vec<&CanSpec> = buses.collect();
    for name in &args.interfaces {
        if !buses.iter().any(|can| is_name_of(name, &can.interface)) {
            tracing::info!(
                interface = %name,
                "no source of the configuration uses the interface; it is not changed"
            );
        }
    }
    let mut outcome = Outcome::Good;
    for can in buses.into_iter().filter(is_selected) {
        let Some(spec) = &can.link else {
            tracing::info!(
                interface = %can.interface,
                "the configuration has no link settings for the interface; it is not changed"
            );
            continue;
        };
        match link::bring_up(&can.interface, spec) {
            Ok(()) => tracing::info!(
                interface = %can.interface,
                bit_rate = spec.bit_rate,
                "the interface is up"
            ),
            Err(error) => {
                tracing::error!(%error);
                outcome = Outcome::Failed;
            }
        }
    }
    Ok(outcome)
}

/// Whether `argument` is the name of the interface, also with the `\xNN` escapes of the name of a
/// systemd unit.
fn is_name_of(argument: &str, interface: &str) -> bool {
    argument == interface || unescaped(argument).as_deref() == Some(interface.as_bytes())
}

/// Bytes of a name with `\xNN` escapes; `None` if an escape is invalid.
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
    fn names_of_interfaces_may_be_escaped() {
        for argument in ["can-left", "can\\x2dleft", "\\x63an-left"] {
            assert!(is_name_of(argument, "can-left"), "{argument}");
        }
        for argument in [
            "can-right",
            "can/left",
            "can\\x2",
            "can\\xzzleft",
            "can\\x2ä",
        ] {
            assert!(!is_name_of(argument, "can-left"), "{argument}");
        }
        assert!(is_name_of("can\\x2d", "can\\x2d"));
    }
}
