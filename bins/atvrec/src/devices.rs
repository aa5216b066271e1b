//! Devices of the virtual vehicle on pseudo-terminals: they send data and respond to the commands of a
//! recorder.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use acq::{Heard, LogClock, VirtualPort};
use anyhow::Context;
use engine::VirtualDrive;
use engine::estimator::GRID_NANOS;
use sample::{CanFrame, LogTime};
use sim::{Output, Port};
use store::Record;
use wire::crossbow440::{Field, encode_packet};
use wire::slcan;

/// Longest time between two reads of the recorder's commands.
const POLL_PERIOD: Duration = Duration::from_millis(2);
/// Delay of the program from which the computer has stalled.
const STALL: Duration = Duration::from_millis(20);
/// Bytes of a read.
const READ_BYTES: usize = 512;
/// Longest command to the inertial unit, bytes.
const COMMAND_MAX: usize = 262;

/// All devices of a virtual vehicle, with links in a directory that have the names of the ports. The
/// links are removed on drop.
pub struct Devices {
    devices: Vec<Device>,
}

struct Device {
    name: Port,
    link: PathBuf,
    port: VirtualPort,
    behaviour: Behaviour,
    is_open: bool,
    /// Bytes that wait until the line has space.
    pending: Vec<u8>,
    sent: u64,
    dropped: u64,
}

/// Behaviour of a device.
enum Behaviour {
    /// GNSS receiver or controller: sends all data and ignores commands.
    Receiver,
    /// Crossbow 440.
    Inertial(Inertial),
    /// SLCAN adapter.
    Adapter(Adapter),
}

/// State of a Crossbow 440, which commands change.
struct Inertial {
    received: Vec<u8>,
    divider: u16,
    packet_type: u16,
    packets: u64,
}

/// State of a SLCAN adapter, which commands change.
#[derive(Default)]
struct Adapter {
    decoder: slcan::Decoder,
    open: bool,
    stamps: bool,
}

/// Times at which the computer did not run this program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stalls {
    /// Number of stalls.
    pub count: u64,
    /// The longest one.
    pub longest: Duration,
    is_late: bool,
}

impl Stalls {
    fn add(&mut self, late: Duration) {
        let is_late = late >= STALL;
        self.count += u64::from(is_late && !self.is_late);
        self.is_late = is_late;
        if is_late {
            self.longest = self.longest.max(late);
        }
    }
}

/// Passes the truth to a recording, at the instants of its estimates.
pub struct TruthSink {
    /// Clock of the recording.
    pub clock: LogClock,
    /// Queue of the records.
    pub queue: tokio::sync::mpsc::Sender<Record>,
    start: LogTime,
    next: LogTime,
}

impl TruthSink {
    /// Sink of a recording.
    pub const fn new(clock: LogClock, queue: tokio::sync::mpsc::Sender<Record>) -> Self {
        Self {
            clock,
            queue,
            start: LogTime(0),
            next: LogTime(0),
        }
    }

    fn begin(&mut self) {
        self.start = self.clock.now();
        let spacing = GRID_NANOS;
        self.next = LogTime(self.start.0.div_ceil(spacing) * spacing);
    }

    /// Passes the truth up to a time of the drive.
    fn until(&mut self, time_s: f64, simulated: &VirtualDrive) {
        let until = self.start.offset_seconds(time_s);
        while self.next <= until {
            let mut record = simulated.truth(self.next.seconds_since(self.start));
            if let Record::Truth(truth) = &mut record {
                truth.time = self.next;
            }
            // Fails only when the recording ends.
            let _ = self.queue.try_send(record);
            self.next = LogTime(self.next.0 + GRID_NANOS);
        }
    }
}

/// Counters of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Name of the device.
    pub name: &'static str,
    /// Messages that were sent.
    pub messages: u64,
    /// Messages that were dropped because the line had no space.
    pub dropped: u64,
}

impl fmt::Display for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            messages,
            dropped,
        } = self;
        write!(
            f,
            "{name:<14}{messages:>10} messages sent, {dropped} dropped (the line was full)"
        )
    }
}

impl Devices {
    /// Creates the devices and their links in `directory`, the CAN adapter only if `slcan` is set.
    pub fn new(directory: &Path, slcan: bool) -> anyhow::Result<Self> {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("cannot create the directory {}", directory.display()))?;
        let devices = Port::ALL
            .into_iter()
            .filter(|port| slcan || !port.is_can())
            .map(|port| Device::new(port, directory))
            .collect::<anyhow::Result<_>>()?;
        Ok(Self { devices })
    }

    /// Links of the devices.
    pub fn links(&self) -> impl Iterator<Item = &Path> {
        self.devices.iter().map(|device| device.link.as_path())
    }

    /// Sends the data of the virtual drive in real time until its end or until `stop` is set. Frames
    /// without a device are passed to `bus`, and the truth to `truth`, if there is a place for it.
    /// Returns how long the computer has stalled.
    pub fn drive(
        &mut self,
        simulated: &mut VirtualDrive,
        stop: &AtomicBool,
        bus: &mut dyn FnMut(&CanFrame) -> anyhow::Result<()>,
        mut truth: Option<TruthSink>,
    ) -> anyhow::Result<Stalls> {
        let start = Instant::now();
        let duration_s = simulated.duration_s();
        let mut stalls = Stalls::default();
        if let Some(truth) = &mut truth {
            truth.begin();
        }
        while let Some(emission) = simulated.vehicle.next() {
            if emission.time_s > duration_s {
                break;
            }
            let due = start + Duration::from_secs_f64(emission.time_s);
            loop {
                if stop.load(Ordering::Relaxed) {
                    return Ok(stalls);
                }
                self.poll()?;
                let remaining = due.saturating_duration_since(Instant::now());
                if remaining.is_zero() {
                    break;
                }
                std::thread::sleep(remaining.min(POLL_PERIOD));
            }
            stalls.add(due.elapsed());
            if let Some(truth) = &mut truth {
                truth.until(emission.time_s, simulated);
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
        Ok(stalls)
    }

    /// Reads and answers the commands of recorders.
    fn poll(&mut self) -> anyhow::Result<()> {
        for device in &mut self.devices {
            device.poll()?;
        }
        Ok(())
    }

    /// Counters of all devices.
    pub fn sent(&self) -> Vec<Sent> {
        self.devices
            .iter()
            .map(|device| Sent {
                name: device.name.name(),
                messages: device.sent,
                dropped: device.dropped,
            })
            .collect()
    }
}

impl Drop for Devices {
    fn drop(&mut self) {
        for device in &self.devices {
            // The link may have been removed already.
            let _ = std::fs::remove_file(&device.link);
        }
    }
}

impl Device {
    fn new(name: Port, directory: &Path) -> anyhow::Result<Self> {
        let port = VirtualPort::new().context("cannot create a pseudo-terminal")?;
        let link = directory.join(name.name());
        if link.is_symlink() {
            std::fs::remove_file(&link)
                .with_context(|| format!("cannot replace the old link {}", link.display()))?;
        }
        std::os::unix::fs::symlink(port.path(), &link)
            .with_context(|| format!("cannot create the link {}", link.display()))?;
        let behaviour = match name {
            Port::Imu => Behaviour::Inertial(Inertial::new()),
            Port::Can0 => Behaviour::Adapter(Adapter::default()),
            Port::Novatel | Port::Septentrio | Port::Steering | Port::Throttle | Port::Brake => {
                Behaviour::Receiver
            }
        };
        Ok(Self {
            name,
            link,
            port,
            behaviour,
            is_open: false,
            pending: Vec::new(),
            sent: 0,
            dropped: 0,
        })
    }

    fn poll(&mut self) -> anyhow::Result<()> {
        let mut buffer = [0; READ_BYTES];
        let count = match self.port.read(&mut buffer)? {
            Heard::Nobody => {
                self.is_open = false;
                self.pending.clear();
                return Ok(());
            }
            Heard::Bytes(count) => count,
        };
        self.is_open = true;
        let received = &buffer[..count];
        let mut answers = Vec::new();
        match &mut self.behaviour {
            Behaviour::Receiver => {}
            Behaviour::Inertial(unit) => unit.receive(received, &mut answers),
            Behaviour::Adapter(adapter) => adapter.receive(received, &mut answers),
        }
        self.pending.extend(answers);
        self.flush()
    }

    fn send(&mut self, output: &Output, time_s: f64) -> anyhow::Result<()> {
        let bytes = match (&mut self.behaviour, output) {
            (Behaviour::Adapter(adapter), Output::Can(frame)) => adapter.line(frame, time_s),
            (Behaviour::Inertial(unit), Output::Bytes(bytes)) => {
                unit.is_due().then(|| bytes.clone())
            }
            (_, Output::Bytes(bytes)) => Some(bytes.clone()),
            (_, Output::Can(_)) => None,
        };
        let Some(bytes) = bytes.filter(|_| self.is_open) else {
            return Ok(());
        };
        self.flush()?;
        if !self.pending.is_empty() {
            self.dropped += 1;
            return Ok(());
        }
        self.pending = bytes;
        self.sent += 1;
        self.flush()
    }

    /// Writes as many pending bytes as the line accepts.
    fn flush(&mut self) -> anyhow::Result<()> {
        if !self.pending.is_empty() {
            let written = self.port.write(&self.pending)?;
            self.pending.drain(..written);
        }
        Ok(())
    }
}

impl Inertial {
    const fn new() -> Self {
        Self {
            received: Vec::new(),
            divider: 1,
            packet_type: u16::from_be_bytes(*b"S1"),
            packets: 0,
        }
    }

    /// Counts an internal step; whether the step sends a packet.
    fn is_due(&mut self) -> bool {
        self.packets += 1;
        self.divider > 0 && self.packets.is_multiple_of(u64::from(self.divider))
    }

    fn receive(&mut self, bytes: &[u8], answers: &mut Vec<u8>) {
        self.received.extend(bytes);
        loop {
            let Some(start) = self.received.windows(2).position(|w| w == [0x55, 0x55]) else {
                let keep = self.received.len().saturating_sub(1);
                self.received.drain(..keep);
                return;
            };
            self.received.drain(..start);
            let length = match self.received.get(4) {
                Some(payload) => 7 + usize::from(*payload),
                None => return,
            };
            if self.received.len() < length {
                if self.received.len() > COMMAND_MAX {
                    self.received.clear();
                }
                return;
            }
            let command: Vec<u8> = self.received.drain(..length).collect();
            let (kind, payload) = ([command[2], command[3]], &command[5..length - 2]);
            // The unit does not answer a command with a wrong checksum.
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
        let mut accepted = vec![0];
        for pair in payload.get(1..).unwrap_or_default().chunks_exact(4) {
            let id = u16::from_be_bytes([pair[0], pair[1]]);
            let value = u16::from_be_bytes([pair[2], pair[3]]);
            match id {
                Field::RATE => self.divider = value,
                Field::PACKET_TYPE => self.packet_type = value,
                _ => {}
            }
            accepted.extend(&pair[..2]);
            accepted[0] += 1;
        }
        encode_packet(kind, &accepted)
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
    fn receive(&mut self, bytes: &[u8], answers: &mut Vec<u8>) {
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

    /// Line of a frame; `None` while the channel is closed.
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
    fn a_full_line_receives_complete_messages_or_none() {
        let directory = tempfile::tempdir().expect("a directory");
        let mut device = Device::new(Port::Novatel, directory.path()).expect("a port");
        let mut program = File::open(device.port.path()).expect("it opens");
        device.poll().expect("polled");
        // The lengths differ, so that messages do not fit the buffer exactly.
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
        assert!(device.dropped > 100, "{} dropped", device.dropped);
        let mut wanted = device.sent as usize;
        let lines = |bytes: &[u8]| bytes.iter().filter(|byte| **byte == b'\n').count();
        wanted -= lines(&received);
        while wanted > 0 {
            device.poll().expect("polled");
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
