//! Bringing CAN interfaces up: bit rate, restart after bus-off, through netlink. Needs
//! `CAP_NET_ADMIN`.

use socketcan::nl::{CanBitTiming, CanCtrlModes, InterfaceCanParams};
use socketcan::{CanCtrlMode, CanInterface};

use crate::LinkSpec;

/// Why an interface cannot be brought up.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {interface}: {cause}")]
pub struct LinkError {
    /// The interface.
    pub interface: String,
    /// What failed.
    pub action: &'static str,
    /// Why, with the remedy where there is a usual one.
    pub cause: String,
}

/// Sets an interface's parameters and brings it up. One that is up already is left as it is.
///
/// Blocks for as long as the driver takes; call it from a thread that may.
///
/// # Errors
/// No such interface, no permission, or parameters that the controller does not have.
pub fn bring_up(interface: &str, spec: &LinkSpec) -> Result<(), LinkError> {
    let wrap = |action| {
        move |error: socketcan::Error| LinkError {
            interface: interface.to_owned(),
            action,
            cause: explain(&error),
        }
    };
    let link = CanInterface::open(interface).map_err(wrap("find"))?;
    if link.details().map_err(wrap("query"))?.is_up {
        return Ok(());
    }
    if let Some(bit_rate) = spec.bit_rate {
        let mut modes = CanCtrlModes::from_mode(CanCtrlMode::ListenOnly, spec.listen_only);
        // A controller without FD refuses to hear of that mode.
        if spec.data_bit_rate.is_some() {
            modes.add(CanCtrlMode::Fd, true);
        }
        let params = InterfaceCanParams {
            bit_timing: Some(timing(bit_rate)),
            data_bit_timing: spec.data_bit_rate.map(timing),
            restart_ms: Some(spec.restart_ms),
            ctrl_mode: Some(modes),
            ..InterfaceCanParams::default()
        };
        link.set_can_params(&params)
            .map_err(wrap("set the bit rate of"))?;
    }
    link.bring_up().map_err(wrap("bring up"))
}

fn timing(bit_rate: u32) -> CanBitTiming {
    CanBitTiming {
        bitrate: bit_rate,
        ..CanBitTiming::default()
    }
}

fn explain(error: &socketcan::Error) -> String {
    let text = error.to_string();
    match error {
        socketcan::Error::Io(io) if io.raw_os_error() == Some(libc::ENODEV) => {
            "the interface does not exist; connect the adapter or load its driver".to_owned()
        }
        _ if text.contains("not permitted") || text.contains("os error 1)") => {
            format!("{text}; run as root or grant CAP_NET_ADMIN")
        }
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_interface_is_named() {
        let error = bring_up("nocan77", &LinkSpec::new(500_000)).expect_err("no such interface");
        assert_eq!(error.interface, "nocan77");
        assert!(error.to_string().contains("connect the adapter"), "{error}");
    }
}
