//! The devices of this computer, and what they send.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use acq::{
    CanSpec, FoundInterface, PortSpec, SerialSpec, Setup, SlcanSpec, SourceCounters, SourceKind,
    SourceSpec,
};
use sample::{Arrival, Payload, SourceId};
use wire::recognise::{Format, recognise};
use wire::slcan;

use crate::listening::listen;

/// Baud rates, the usual ones first. A device at another baud rate is noticed at the first two: it sends
/// bytes that mean nothing.
const BAUDS: [u32; 9] = [
    115_200, 9_600, 57_600, 38_400, 230_400, 460_800, 921_600, 19_200, 4_800,
];
/// Baud rates after which a port without any byte is silent.
const SILENT_AFTER: usize = 2;
/// Bit rates of a CAN bus, the usual ones first; SLCAN has no others.
const BIT_RATES: [u32; 9] = [
    500_000, 250_000, 1_000_000, 125_000, 800_000, 100_000, 50_000, 20_000, 10_000,
];

/// A serial port.
pub struct Port {
    pub path: PathBuf,
    /// Name of its driver; empty if unknown.
    pub driver: String,
    pub state: PortState,
}

/// What is known of a serial port.
pub enum PortState {
    /// It cannot be opened, and why.
    NotOpen(String),
    /// No byte came.
    Silent,
    /// Bytes of no known protocol.
    Unknown {
        /// What the bytes look like, if that is known.
        format: Option<Format>,
        bytes: usize,
    },
    /// Bytes of a protocol.
    Known {
        format: Format,
        baud: u32,
        arrivals: Vec<Arc<Arrival>>,
    },
    /// An SLCAN adapter; the bit rate is that at which frames came.
    Adapter {
        baud: u32,
        bit_rate: Option<u32>,
        arrivals: Vec<Arc<Arrival>>,
    },
}

/// A CAN interface.
pub struct Interface {
    pub found: FoundInterface,
    /// Why it cannot be read, if it is up.
    pub problem: Option<String>,
    pub arrivals: Vec<Arc<Arrival>>,
}

/// Arrivals and counters of each source of a list.
type HeardEach = Vec<(Vec<Arc<Arrival>>, SourceCounters)>;

/// Listens to sources at the same time.
fn listen_to(kinds: Vec<SourceKind>, listen_s: f64) -> anyhow::Result<HeardEach> {
    let count = kinds.len();
    let specs = kinds
        .into_iter()
        .enumerate()
        .map(|(number, kind)| SourceSpec {
            id: SourceId(number as u16),
            name: format!("device{number}"),
            kind,
        });
    let heard = listen(specs, listen_s, vec![Vec::new(); count], |all, arrival| {
        let is_data = matches!(arrival.payload, Payload::Bytes(_) | Payload::Can(_));
        let place = all
            .get_mut(usize::from(arrival.source.0))
            .filter(|_| is_data);
        if let Some(place) = place {
            // Each device is the only source of the configuration that decodes it.
            place.push(Arc::new(Arrival {
                source: SourceId(0),
                ..Arrival::clone(arrival)
            }));
        }
    })?;
    let counters = |number| heard.counters.get(&SourceId(number as u16)).cloned();
    let each = heard.state.into_iter().enumerate();
    let each = each.map(|(number, arrivals)| (arrivals, counters(number).unwrap_or_default()));
    Ok(each.collect())
}

/// Listens to CAN interfaces that are up.
pub fn interfaces(found: Vec<FoundInterface>, listen_s: f64) -> anyhow::Result<Vec<Interface>> {
    let up = found.iter().filter(|interface| interface.is_up);
    let kinds: Vec<_> = up
        .map(|interface| SourceKind::Can(CanSpec::new(&interface.name)))
        .collect();
    let mut heard = match kinds.is_empty() {
        true => Vec::new(),
        false => listen_to(kinds, listen_s)?,
    }
    .into_iter();
    let mut listened = |found: FoundInterface| {
        let (arrivals, counters) = match found.is_up {
            true => heard.next().unwrap_or_default(),
            false => Default::default(),
        };
        let problem = found.is_up && !counters.open && arrivals.is_empty();
        Interface {
            problem: problem.then_some(counters.state),
            found,
            arrivals,
        }
    };
    Ok(found.into_iter().map(&mut listened).collect())
}

/// Listens to serial ports at the usual baud rates until their protocols are known.
pub fn ports(
    found: Vec<(PathBuf, String)>,
    bit_rate: Option<u32>,
    listen_s: f64,
) -> anyhow::Result<Vec<Port>> {
    let mut ports: Vec<Port> = found
        .into_iter()
        .map(|(path, driver)| Port {
            path,
            driver,
            state: PortState::Silent,
        })
        .collect();
    for (round, baud) in BAUDS.into_iter().enumerate() {
        let is_open = |port: &&mut Port| match port.state {
            PortState::Silent => round < SILENT_AFTER,
            PortState::Unknown { .. } => true,
            _ => false,
        };
        let open: Vec<&mut Port> = ports.iter_mut().filter(is_open).collect();
        if open.is_empty() {
            break;
        }
        let kinds = open
            .iter()
            .map(|port| serial(&port.path, baud, Setup::None));
        let heard = listen_to(kinds.collect(), listen_s)?;
        for (port, (arrivals, counters)) in open.into_iter().zip(heard) {
            port.take(baud, arrivals, counters);
        }
    }
    ask_for_adapters(&mut ports, listen_s)?;
    for port in &mut ports {
        if matches!(
            port.state,
            PortState::Known {
                format: Format::Slcan,
                ..
            }
        ) {
            port.state = adapter(port, bit_rate, listen_s)?;
        }
    }
    Ok(ports)
}

fn serial(path: &Path, baud: u32, setup: Setup) -> SourceKind {
    SourceKind::Serial(SerialSpec {
        port: PortSpec::new(path, baud),
        setup,
    })
}

impl Port {
    fn take(&mut self, baud: u32, arrivals: Vec<Arc<Arrival>>, counters: SourceCounters) {
        if arrivals.is_empty() {
            if !counters.open {
                self.state = PortState::NotOpen(counters.state);
            }
            return;
        }
        let bytes = bytes_of(&arrivals);
        let format = recognise(&bytes);
        self.state = match format {
            Some(format) if format != Format::OtherBaud => PortState::Known {
                format,
                baud,
                arrivals,
            },
            format => PortState::Unknown {
                format,
                bytes: bytes.len(),
            },
        };
    }
}

/// All bytes of some arrivals.
pub fn bytes_of(arrivals: &[Arc<Arrival>]) -> Vec<u8> {
    let parts = arrivals
        .iter()
        .filter_map(|arrival| match &arrival.payload {
            Payload::Bytes(bytes) => Some(&bytes[..]),
            _ => None,
        });
    parts.collect::<Vec<_>>().concat()
}

/// Asks silent ports for the version of an SLCAN adapter, which sends nothing until it is opened.
fn ask_for_adapters(ports: &mut [Port], listen_s: f64) -> anyhow::Result<()> {
    let silent = |port: &&mut Port| matches!(port.state, PortState::Silent);
    let silent: Vec<&mut Port> = ports.iter_mut().filter(silent).collect();
    if silent.is_empty() {
        return Ok(());
    }
    let version = slcan::Command::ReadVersion.encode().unwrap_or_default();
    let setup = Setup::Commands {
        commands: vec![b"\r\r\r".to_vec(), version],
        pause: Duration::from_millis(100),
    };
    let baud = BAUDS[0];
    let kinds = silent
        .iter()
        .map(|port| serial(&port.path, baud, setup.clone()));
    let heard = listen_to(kinds.collect(), listen_s)?;
    for (port, (arrivals, _)) in silent.into_iter().zip(heard) {
        let mut answers = false;
        let mut decoder = slcan::Decoder::new();
        decoder.push(&bytes_of(&arrivals), &mut |event| {
            answers |= matches!(event, slcan::Event::Identity(_));
        });
        if answers {
            port.state = PortState::Known {
                format: Format::Slcan,
                baud,
                arrivals: Vec::new(),
            };
        }
    }
    Ok(())
}

/// Finds the bit rate of the bus of an SLCAN adapter. The adapter does not acknowledge frames meanwhile.
fn adapter(port: &Port, given: Option<u32>, listen_s: f64) -> anyhow::Result<PortState> {
    let baud = match port.state {
        PortState::Known { baud, .. } => baud,
        _ => BAUDS[0],
    };
    let rates = given.map_or_else(|| BIT_RATES.to_vec(), |rate| vec![rate]);
    for bit_rate in rates {
        let spec = SlcanSpec {
            port: PortSpec::new(&port.path, baud),
            bit_rate: Some(bit_rate),
            listen_only: true,
            timestamps: true,
        };
        let heard = listen_to(vec![SourceKind::Slcan(spec)], listen_s)?;
        let arrivals = heard.into_iter().next().unwrap_or_default().0;
        if !arrivals.is_empty() {
            return Ok(PortState::Adapter {
                baud,
                bit_rate: Some(bit_rate),
                arrivals,
            });
        }
    }
    Ok(PortState::Adapter {
        baud,
        bit_rate: given,
        arrivals: Vec::new(),
    })
}

/// Identifiers of the frames of some arrivals, each with its number of frames.
pub fn identifiers(arrivals: &[Arc<Arrival>]) -> BTreeMap<(u32, bool), u64> {
    let mut counts = BTreeMap::new();
    for arrival in arrivals {
        if let Payload::Can(frames) = &arrival.payload {
            for frame in frames.iter().filter(|frame| !frame.flags.error) {
                *counts.entry((frame.id, frame.flags.extended)).or_default() += 1;
            }
        }
    }
    counts
}
