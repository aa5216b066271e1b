//! `[output]`: what is made of the estimates for viewers and controllers.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use model::file::{ErrorCollector, Field, Section};
use sample::CanFrame;

use super::source::{Meaning, Source};

/// Identifiers of the frames by default; docs/live.md has the frames.
const FIRST_ID: u32 = 0x500;
/// Number of frames of an estimate.
const FRAMES: u32 = 11;

/// What is made of the estimates.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Whether the engine makes `/tf` and `/scene`.
    pub scene: bool,
    /// Frames on a CAN bus.
    pub can: Option<CanOutput>,
    /// Datagrams, sent by the live process.
    pub udp: Option<UdpOutput>,
}

/// `[output.can]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanOutput {
    /// Where the frames are sent.
    pub port: CanPort,
    /// Identifier of the first frame; the others follow it.
    pub first_id: u32,
    /// Identifiers of 29 bits.
    pub extended: bool,
}

impl CanOutput {
    /// Whether a frame has an identifier of this output.
    pub fn has(&self, frame: &CanFrame) -> bool {
        let ids = self.first_id..self.first_id + FRAMES;
        frame.flags.extended == self.extended && ids.contains(&frame.id)
    }
}

/// Port of the frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CanPort {
    /// A SocketCAN interface.
    Interface(String),
    /// An SLCAN adapter that is no source.
    Slcan {
        /// Device file.
        device: PathBuf,
        /// Bits per second of the serial port.
        baud: u32,
        /// Bit rate of the bus; `None` leaves the adapter as it is.
        bit_rate: Option<u32>,
    },
    /// The adapter of an SLCAN source, by name.
    Source(String),
}

/// `[output.udp]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UdpOutput {
    /// Where the datagrams are sent.
    pub address: SocketAddr,
    /// Whether they are JSON lines instead of the binary record.
    pub json: bool,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            scene: true,
            can: None,
            udp: None,
        }
    }
}

impl Output {
    /// Reads the table.
    pub fn read(
        mut section: Section<'_>,
        sources: &[Source],
        collector: &mut ErrorCollector<'_>,
    ) -> Self {
        let scene = section.or("scene", true, collector);
        let can = section.present("can", collector);
        let can = can.and_then(|section| read_can(section, sources, collector));
        let udp = section.present("udp", collector);
        let udp = udp.and_then(|section| read_udp(section, collector));
        section.finish(collector);
        Self { scene, can, udp }
    }
}

impl Output {
    /// Resolves the port from the directory of the configuration.
    pub(super) fn look_from(&mut self, directory: &Path) {
        let port = self.can.as_mut().map(|can| &mut can.port);
        if let Some(CanPort::Slcan { device, .. }) = port {
            *device = directory.join(&*device);
        }
    }
}

fn read_can(
    mut section: Section<'_>,
    sources: &[Source],
    collector: &mut ErrorCollector<'_>,
) -> Option<CanOutput> {
    let span = section.span();
    let interface = section.optional::<String>("interface", collector);
    let device = section.optional::<String>("device", collector);
    let share = section.or("share", false, collector);
    let baud = section.number_in("baud", 9_600.0..=4e6, 115_200.0, collector) as u32;
    let bit_rate = section.optional::<u32>("bitrate", collector);
    let extended = section.or("extended", false, collector);
    let first = section.optional::<u32>("first_id", collector);
    let name = section.field_name("interface");
    section.finish(collector);
    let first_id = first.as_ref().map_or(FIRST_ID, |field| field.value);
    let last_id = if extended { 0x1FFF_FFFF } else { 0x7FF };
    if let Some(field) = first.filter(|f| f.value > last_id + 1 - FRAMES) {
        collector.add(
            &field.span,
            &field.name,
            format!("{FRAMES} identifiers from {:#X} do not fit", field.value),
            format!("use at most {:#X}", last_id + 1 - FRAMES),
        );
    }
    if let Some(field) = &bit_rate
        && !wire::slcan::BIT_RATES.contains(&field.value)
    {
        let message = format!("SLCAN adapters do not support {} bit/s", field.value);
        let known = wire::slcan::BIT_RATES
            .map(|rate| rate.to_string())
            .join(", ");
        collector.add(
            &field.span,
            &field.name,
            message,
            format!("use one of: {known}"),
        );
    }
    let port = match (interface, device) {
        (Some(field), None) => {
            refuse_shared(&field, share, &interface_of, sources, collector);
            CanPort::Interface(field.value)
        }
        (None, Some(field)) => match refuse_shared(&field, share, &device_of, sources, collector) {
            Some(source) => CanPort::Source(source),
            None => CanPort::Slcan {
                device: PathBuf::from(field.value),
                baud,
                bit_rate: bit_rate.map(|field| field.value),
            },
        },
        _ => {
            collector.add(
                &span,
                &name,
                "needs one port",
                "set interface = \"can1\" for SocketCAN, or device = \"/dev/ttyACM1\" for SLCAN",
            );
            return None;
        }
    };
    Some(CanOutput {
        port,
        first_id,
        extended,
    })
}

/// Name of the source that has the same port; an error if it is not shared.
fn refuse_shared(
    field: &Field<String>,
    share: bool,
    port_of: &dyn Fn(&Source) -> Option<String>,
    sources: &[Source],
    collector: &mut ErrorCollector<'_>,
) -> Option<String> {
    let has_port = |source: &&Source| {
        matches!(source.meaning, Meaning::Can(_)) && port_of(source).as_ref() == Some(&field.value)
    };
    let source = sources.iter().find(has_port)?;
    if !share {
        collector.add(
            &field.span,
            &field.name,
            format!("source.{} records this bus", source.spec.name),
            "set share = true to send on the bus of a source, or use another bus",
        );
    }
    Some(source.spec.name.clone())
}

fn interface_of(source: &Source) -> Option<String> {
    match &source.spec.kind {
        acq::SourceKind::Can(can) => Some(can.interface.clone()),
        _ => None,
    }
}

fn device_of(source: &Source) -> Option<String> {
    match &source.spec.kind {
        acq::SourceKind::Slcan(slcan) => Some(slcan.port.path.display().to_string()),
        _ => None,
    }
}

fn read_udp(mut section: Section<'_>, collector: &mut ErrorCollector<'_>) -> Option<UdpOutput> {
    let help = "set an address and a port, such as address = \"127.0.0.1:9870\"";
    let address = section.required::<String>("address", help, collector);
    let format = section.optional::<String>("format", collector);
    section.finish(collector);
    let json = match format.as_ref().map(|field| field.value.as_str()) {
        None | Some("binary") => false,
        Some("json") => true,
        Some(_) => {
            let field = format?;
            let message = format!("\"{}\" is not a format", field.value);
            collector.add(
                &field.span,
                &field.name,
                message,
                "use \"binary\" or \"json\"",
            );
            return None;
        }
    };
    let field = address?;
    match field.value.parse() {
        Ok(address) => Some(UdpOutput { address, json }),
        Err(_) => {
            let message = format!("\"{}\" is not an address with a port", field.value);
            collector.add(&field.span, &field.name, message, help);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;

    const SOURCE: &str = "[source.bus]\nkind = \"slcan\"\ndevice = \"/dev/ttyACM0\"\n";

    fn output(text: &str) -> Result<Output, String> {
        let text = format!("{SOURCE}{text}");
        let config = Config::from_text(&text, Path::new("."));
        config.map(|c| c.output).map_err(|error| error.to_string())
    }

    #[test]
    fn outputs_are_off_by_default_and_the_scene_is_on() {
        assert_eq!(output("").expect("valid"), Output::default());
        assert!(!output("[output]\nscene = false\n").expect("valid").scene);
    }

    #[test]
    fn a_bus_that_is_recorded_is_shared_on_request_only() {
        let own = "[output.can]\ndevice = \"/dev/ttyACM0\"\n";
        let error = output(own).expect_err("not shared");
        assert!(
            error.contains("source.bus") && error.contains("share = true"),
            "{error}"
        );
        let shared = output(&format!("{own}share = true\n")).expect("valid").can;
        let shared = shared.expect("an output");
        assert_eq!(shared.port, CanPort::Source("bus".to_owned()));
        assert_eq!(shared.first_id, FIRST_ID);
    }

    #[test]
    fn wrong_values_are_errors_with_the_next_step() {
        let error = output("[output.can]\ninterface = \"can1\"\nfirst_id = 0x7FA\n");
        assert!(error.expect_err("too high").contains("use at most 0x7F5"));
        let error = output("[output.can]\n").expect_err("no port");
        assert!(error.contains("needs one port"), "{error}");
        let error = output("[output.udp]\naddress = \"localhost\"\n").expect_err("no port");
        assert!(error.contains("127.0.0.1:9870"), "{error}");
    }
}
