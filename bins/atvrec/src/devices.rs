//! The virtual vehicle's devices on pseudo-terminals: they send on their own and answer what a
//! recorder says to them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use acq::{Heard, VirtualPort};
use anyhow::Context;
use engine::Rig;
use sample::CanFrame;
use sim::{Output, Port};
use wire::crossbow440::{Field, encode_packet};
use wire::slcan;

/// Longest time between two looks at what a recorder says.
const LOOK: Duration = Duration::from_millis(2);
/// Bytes read at once.
const READ_BYTES: usize = 512;
/// Longest command of the inertial unit that is waited for.
const COMMAND_MAX: usize = 262;

/// All devices of a virtual vehicle, linked in a directory by the names of its ports. The links go
/// when this is dropped.
pub struct Devices {
    devices: Vec<Device>,
}

struct Device {
    name: Port,
    link: PathBuf,
    port: VirtualPort,
    manner: Manner,
    attended: bool,
    /// What is begun and waits for room on the line.
    begun: Vec<u8>,
    sent: u64,
    left_out: u64,
}

/// How a device behaves.
enum Manner {
    /// Sends whatever it is told; swallows commands. Also the controllers.
    Receiver,
    /// Crossbow 440.
    Inertial(Inertial),
    /// SLCAN adapter.
    Adapter(Adapter),
}

/// A Crossbow 440 as its owner's commands have left it.
struct Inertial {
    heard: Vec<u8>,
    divider: u16,
    packet_type: u16,
    packets: u64,
}

/// A SLCAN adapter as its owner's commands have left it.
#[derive(Default)]
struct Adapter {
    decoder: slcan::Decoder,
    open: bool,
    stamps: bool,
}

/// What a device did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Which.
    pub name: &'static str,
    /// Messages that went out.
    pub messages: u64,
    /// Messages that found no room on the line.
    pub left_out: u64,
}

impl fmt::Display for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            messages,
            left_out,
        } = self;
        write!(
            f,
            "{name:<14}{messages:>10} messages sent, {left_out} left out: no room on the line"
        )
    }
}

impl Devices {
    /// Makes the devices and links them in `directory`; those on CAN only if `slcan`.
    pub fn new(directory: &Path, slcan: bool) -> anyhow::Result<Self> {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("cannot make the directory {}", directory.display()))?;
        let devices = Port::ALL
            .into_iter()
            .filter(|port| slcan || !port.is_can())
            .map(|port| Device::new(port, directory))
            .collect::<anyhow::Result<_>>()?;
        Ok(Self { devices })
    }

    /// Where the devices are linked.
    pub fn links(&self) -> impl Iterator<Item = &Path> {
        self.devices.iter().map(|device| device.link.as_path())
    }

    /// Lets the rig drive in real time until its end or until `stop`. Frames without a device go
    /// to `bus`.
    pub fn drive(
        &mut self,
        rig: &mut Rig,
        stop: &AtomicBool,
        bus: &mut dyn FnMut(&CanFrame) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let start = Instant::now();
        let duration_s = rig.duration_s();
        for emission in rig.vehicle.by_ref() {
            if emission.time_s > duration_s {
                break;
            }
            let due = start + Duration::from_secs_f64(emission.time_s);
            loop {
                if stop.load(Ordering::Relaxed) {
                    return Ok(());
                }
                self.listen()?;
                let left = due.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    break;
                }
                std::thread::sleep(left.min(LOOK));
            }
            let device = self
                .devices
                .iter_mut()
                .find(|device| device.name == emission.port);
            match (device, &emission.output) {
                (Some(device), output) => device.send(output, emission.time_s)?,
                (None, Output::Can(frame)) => bus(frame)?,
                (None, Output::Bytes(_)) => {}
            }
        }
        Ok(())
    }

    /// Hears what recorders say and answers.
    fn listen(&mut self) -> anyhow::Result<()> {
        for device in &mut self.devices {
            device.listen()?;
        }
        Ok(())
    }

    /// Counters.
    pub fn sent(&self) -> Vec<Sent> {
        self.devices
            .iter()
            .map(|device| Sent {
                name: device.name.name(),
                messages: device.sent,
                left_out: device.left_out,
            })
            .collect()
    }
}

impl Drop for Devices {
    fn drop(&mut self) {
        for device in &self.devices {
            // A link that is gone already needs no removal.
            let _ = std::fs::remove_file(&device.link);
        }
    }
}

impl Device {
    fn new(name: Port, directory: &Path) -> anyhow::Result<Self> {
        let port = VirtualPort::new().context("cannot make a pseudo-terminal")?;
        let link = directory.join(name.name());
        if link.is_symlink() {
            std::fs::remove_file(&link)
                .with_context(|| format!("cannot replace the old link {}", link.display()))?;
        }
        std::os::unix::fs::symlink(port.path(), &link)
            .with_context(|| format!("cannot make the link {}", link.display()))?;
        let manner = match name {
            Port::Imu => Manner::Inertial(Inertial::new()),
            Port::Can0 => Manner::Adapter(Adapter::default()),
            Port::Novatel | Port::Septentrio | Port::Steering | Port::Throttle | Port::Brake => {
                Manner::Receiver
            }
        };
        Ok(Self {
            name,
            link,
            port,
            manner,
            attended: false,
            begun: Vec::new(),
            sent: 0,
            left_out: 0,
        })
    }

    fn listen(&mut self) -> anyhow::Result<()> {
        let mut buffer = [0; READ_BYTES];
        let count = match self.port.read(&mut buffer)? {
            Heard::Nobody => {
                self.attended = false;
                self.begun.clear();
                return Ok(());
            }
            Heard::Bytes(count) => count,
        };
        self.attended = true;
        let heard = &buffer[..count];
        let mut answers = Vec::new();
        match &mut self.manner {
            Manner::Receiver => {}
            Manner::Inertial(unit) => unit.hear(heard, &mut answers),
            Manner::Adapter(adapter) => adapter.hear(heard, &mut answers),
        }
        self.begun.extend(answers);
        self.push()
    }

    fn send(&mut self, output: &Output, time_s: f64) -> anyhow::Result<()> {
        let bytes = match (&mut self.manner, output) {
            (Manner::Adapter(adapter), Output::Can(frame)) => adapter.line(frame, time_s),
            (Manner::Inertial(unit), Output::Bytes(bytes)) => unit.is_due().then(|| bytes.clone()),
            (_, Output::Bytes(bytes)) => Some(bytes.clone()),
            (_, Output::Can(_)) => None,
        };
        let Some(bytes) = bytes.filter(|_| self.attended) else {
            return Ok(());
        };
        self.push()?;
        if !self.begun.is_empty() {
            self.left_out += 1;
            return Ok(());
        }
        self.begun = bytes;
        self.sent += 1;
        self.push()
    }

    /// Sends of what is begun as much as the line takes.
    fn push(&mut self) -> anyhow::Result<()> {
        if !self.begun.is_empty() {
            let gone = self.port.write(&self.begun)?;
            self.begun.drain(..gone);
        }
        Ok(())
    }
}

impl Inertial {
    const fn new() -> Self {
        Self {
            heard: Vec::new(),
            divider: 1,
            packet_type: u16::from_be_bytes(*b"S1"),
            packets: 0,
        }
    }

    /// Whether the next internal step sends a packet.
    fn is_due(&mut self) -> bool {
        self.packets += 1;
        self.divider > 0 && self.packets.is_multiple_of(u64::from(self.divider))
    }

    fn hear(&mut self, bytes: &[u8], answers: &mut Vec<u8>) {
        self.heard.extend(bytes);
        loop {
            let Some(start) = self.heard.windows(2).position(|w| w == [0x55, 0x55]) else {
                let keep = self.heard.len().saturating_sub(1);
                self.heard.drain(..keep);
                return;
            };
            self.heard.drain(..start);
            let length = match self.heard.get(4) {
                Some(payload) => 7 + usize::from(*payload),
                None => return,
            };
            if self.heard.len() < length {
                if self.heard.len() > COMMAND_MAX {
                    self.heard.clear();
                }
                return;
            }
            let command: Vec<u8> = self.heard.drain(..length).collect();
            let (kind, payload) = ([command[2], command[3]], &command[5..length - 2]);
            // The unit is silent about a command with a wrong checksum.
            if encode_packet(kind, payload) == command {
                answers.extend(self.answer(kind, payload));
            }
        }
    }

    fn answer(&mut self, kind: [u8; 2], payload: &[u8]) -> Vec<u8> {
        match &kind {
            b"PK" | b"SR" => encode_packet(kind, &[]),
            b"SF" | b"WF" => self.set(kind, payload),
            b"GF" | b"RF" => self.get(kind, payload),
            b"GP" => Vec::new(),
            _ => encode_packet([0x15, 0x15], &kind),
        }
    }

    fn set(&mut self, kind: [u8; 2], payload: &[u8]) -> Vec<u8> {
        let mut taken = vec![0];
        for pair in payload.get(1..).unwrap_or_default().chunks_exact(4) {
            let id = u16::from_be_bytes([pair[0], pair[1]]);
            let value = u16::from_be_bytes([pair[2], pair[3]]);
            match id {
                Field::RATE => self.divider = value,
                Field::PACKET_TYPE => self.packet_type = value,
                _ => {}
            }
            taken.extend(&pair[..2]);
            taken[0] += 1;
        }
        encode_packet(kind, &taken)
    }

    fn get(&self, kind: [u8; 2], payload: &[u8]) -> Vec<u8> {
        let mut values = vec![0];
        for id in payload.get(1..).unwrap_or_default().chunks_exact(2) {
            let value = match u16::from_be_bytes([id[0], id[1]]) {
                Field::RATE => self.divider,
                Field::BAUD => 3,
                Field::PACKET_TYPE => self.packet_type,
                _ => 0,
            };
            values.extend(id);
            values.extend(value.to_be_bytes());
            values[0] += 1;
        }
        encode_packet(kind, &values)
    }
}

impl Adapter {
    fn hear(&mut self, bytes: &[u8], answers: &mut Vec<u8>) {
        use slcan::{Command, Event};
        let (open, stamps) = (&mut self.open, &mut self.stamps);
        self.decoder.push(bytes, &mut |event| match event {
            Event::Command(Command::Open | Command::ListenOnly) => {
                *open = true;
                answers.push(b'\r');
            }
            Event::Command(Command::Close) => {
                *open = false;
                answers.push(b'\r');
            }
            Event::Command(Command::Timestamps(on)) => {
                *stamps = on;
                answers.push(b'\r');
            }
            Event::Command(Command::ReadStatus) => answers.extend(b"F00\r"),
            Event::Command(Command::ReadVersion) => answers.extend(b"V1013\r"),
            Event::Command(Command::ReadSerial) => answers.extend(b"NVIRT\r"),
            Event::Command(Command::BitRate(_)) => answers.push(b'\r'),
            Event::Frame(_) => answers.extend(b"z\r"),
            _ => {}
        });
    }

    /// A frame as the adapter writes it; `None` while it is not on the bus.
    fn line(&self, frame: &CanFrame, time_s: f64) -> Option<Vec<u8>> {
        if !self.open {
            return None;
        }
        let stamp_ms = self.stamps.then_some((time_s * 1e3) as u64);
        slcan::encode_frame(frame, stamp_ms)
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;

    use super::*;

    #[test]
    fn a_line_without_room_gets_whole_messages_or_none() {
        let directory = tempfile::tempdir().expect("a directory");
        let mut device = Device::new(Port::Novatel, directory.path()).expect("a port");
        let mut program = File::open(device.port.path()).expect("it opens");
        device.listen().expect("it listens");
        // Lengths that no buffer is a multiple of; the program reads now and then.
        let mut received = Vec::new();
        let mut buffer = [0; 1000];
        for k in 0..4000 {
            let message = format!("message {k:04} {}\n", "x".repeat(k % 97));
            let output = Output::Bytes(message.into_bytes());
            device.send(&output, 0.0).expect("it sends");
            if k % 200 == 199 {
                let count = program.read(&mut buffer).expect("it reads");
                received.extend_from_slice(&buffer[..count]);
            }
        }
        assert!(device.left_out > 100, "{} left out", device.left_out);
        let mut wanted = device.sent as usize;
        let lines = |bytes: &[u8]| bytes.iter().filter(|byte| **byte == b'\n').count();
        wanted -= lines(&received);
        while wanted > 0 {
            device.listen().expect("it listens");
            let count = program.read(&mut buffer).expect("it reads");
            received.extend_from_slice(&buffer[..count]);
            wanted -= lines(&buffer[..count]);
        }
        for line in String::from_utf8(received).expect("text").lines() {
            let k: usize = line[8..12].parse().expect("its number");
            assert_eq!(line.len(), 13 + k % 97, "{line}");
        }
    }
}
