//! Crossbow IMU440 (Crossbow 440 series user's manual 7430-0131-01, chapters 6 to 8).
//!
//! A packet is `55 55`, two type characters, payload length, payload, CRC; numbers are big-endian
//! two's complement. The CRC (polynomial 0x1021, seed 0x1D0F, not reflected) covers type, length
//! and payload. The unit runs at 8N1, 9600 to 57600 baud.

mod command;
mod setup;

use crc::{CRC_16_SPI_FUJITSU, Crc, Table};
use sample::{DeviceTime, ImuSample, Measurement, STANDARD_GRAVITY_M_S2};

use crate::frame::{Frame, Framer, Scan};
use crate::{Item, Measurements, Message, Protocol, Statistics};

pub use command::{Command, Field, PacketRate};
pub use setup::{Action, BAUDS, Setup, SetupOptions};

static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_SPI_FUJITSU);

/// Header, length byte and CRC around a payload.
const OVERHEAD: usize = 7;
/// The longest packet: its length is one byte.
const MAX_FRAME: usize = OVERHEAD + 255;
const HEADER: [u8; 2] = [0x55, 0x55];

/// m/s^2 in one count of an acceleration: 20 g / 2^16.
const ACCEL_M_S2_PER_COUNT: f64 = 20.0 * STANDARD_GRAVITY_M_S2 / 65_536.0;
/// rad/s in one count of an angular rate: 7 pi / 2^16.
const RATE_RAD_S_PER_COUNT: f64 = 7.0 * std::f64::consts::PI / 65_536.0;
/// Degrees Celsius in one count of a temperature: 200 / 2^16.
const TEMPERATURE_C_PER_COUNT: f64 = 200.0 / 65_536.0;
/// Gauss in one count of a magnetometer: 2 / 2^16.
const FIELD_GAUSS_PER_COUNT: f64 = 2.0 / 65_536.0;
/// m/s in one count of a velocity increment: 200 / 2^32.
const DELTA_V_M_S_PER_COUNT: f64 = 200.0 / 4_294_967_296.0;
/// rad in one count of an angle increment: 7 pi / 2^32.
const DELTA_ANGLE_RAD_PER_COUNT: f64 = 7.0 * std::f64::consts::PI / 4_294_967_296.0;

/// The unit's built-in-test word (manual, chapter 9).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BitStatus(pub u16);

impl BitStatus {
    const FAILURE: u16 = 0x000F;
    const SENSOR: u16 = 1 << 12;

    /// A hardware, communication or software failure: bits 0 to 3. Nothing can be trusted.
    #[must_use]
    pub const fn failed(self) -> bool {
        self.0 & Self::FAILURE != 0
    }

    /// Any of the status bits 8 to 11 (master, hardware, communication, software). A missing 1PPS
    /// signal raises it, so that it does not make the sample bad.
    #[must_use]
    pub const fn has_status(self) -> bool {
        self.0 & 0x0F00 != 0
    }

    /// Bit 12: a sensor is out of its range.
    #[must_use]
    pub const fn sensor_over_range(self) -> bool {
        self.0 & Self::SENSOR != 0
    }

    /// Whether the sample may be used: no failure and no sensor out of range.
    #[must_use]
    pub const fn is_good(self) -> bool {
        !self.failed() && !self.sensor_over_range()
    }
}

/// S1 (scaled sensors) and the inertial part of S0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scaled {
    /// Specific force, sensor axes, m/s^2.
    pub specific_force_m_s2: [f64; 3],
    /// Angular rate, sensor axes, rad/s.
    pub angular_rate_rad_s: [f64; 3],
    /// Temperatures of the three gyros, degrees Celsius.
    pub gyro_temperature_c: [f64; 3],
    /// Temperature of the board, degrees Celsius.
    pub board_temperature_c: f64,
    /// S1: packet counter. S0: low 16 bits of the GPS time of week in ms.
    pub counter: u16,
    /// Built-in test.
    pub bit: BitStatus,
}

/// S2: increments over one output interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increments {
    /// Velocity increment, sensor axes, m/s.
    pub delta_v_m_s: [f64; 3],
    /// Angle increment, sensor axes, rad.
    pub delta_angle_rad: [f64; 3],
    /// Packet counter.
    pub counter: u16,
    /// Built-in test.
    pub bit: BitStatus,
}

/// One packet of the unit.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Packet {
    /// `S0`: scaled sensors with the magnetometer's field in gauss.
    S0(Scaled, [f64; 3]),
    /// `S1`: scaled sensors.
    S1(Scaled),
    /// `S2`: increments.
    S2(Increments),
    /// `ID`: serial number and model text.
    Identity {
        /// Serial number.
        serial: u32,
        /// Model, as printable text.
        model: String,
    },
    /// `VR`: firmware version.
    Version([u8; 5]),
    /// `PK`: answer to a ping.
    Pong,
    /// `GF`, `RF`: fields with their values.
    Fields {
        /// `true` for the stored (EEPROM) values.
        stored: bool,
        /// Field identifier and value.
        fields: Vec<(u16, u16)>,
    },
    /// `SF`, `WF`: identifiers of the fields that were taken.
    FieldsSet {
        /// `true` for the stored (EEPROM) values.
        stored: bool,
        /// Field identifiers.
        fields: Vec<u16>,
    },
    /// `15 15`: a command was refused; its type characters.
    Refused([u8; 2]),
    /// Known and checked, with nothing that is used here (`A0` to `A2`, `N0`, `N1`, `T0`, ...).
    Other([u8; 2]),
}

/// Name of a packet type and, where the manual fixes it, the payload's length.
///
/// Types that the manual does not have are noise: a stray `55` before a header would otherwise
/// read as a header of the type `U?`, and a unit that was just silenced would never send the
/// bytes that such a packet waits for.
fn packet_type(kind: [u8; 2]) -> Option<(&'static str, Option<usize>)> {
    Some(match &kind {
        b"S0" => ("S0", Some(30)),
        b"S1" => ("S1", Some(24)),
        b"S2" => ("S2", Some(28)),
        b"A0" => ("A0", Some(30)),
        b"A1" => ("A1", Some(32)),
        b"A2" => ("A2", Some(30)),
        b"N0" => ("N0", Some(32)),
        b"N1" => ("N1", Some(42)),
        b"T0" => ("T0", Some(28)),
        b"VR" => ("VR", Some(5)),
        b"PK" => ("PK", Some(0)),
        b"SR" => ("SR", Some(0)),
        [0x15, 0x15] => ("NAK", Some(2)),
        b"ID" => ("ID", None),
        b"CH" => ("CH", None),
        b"GF" => ("GF", None),
        b"RF" => ("RF", None),
        b"SF" => ("SF", None),
        b"WF" => ("WF", None),
        _ => return None,
    })
}

pub(crate) fn scan(bytes: &[u8]) -> Scan<[u8; 2]> {
    if bytes[0] != HEADER[0] {
        return Scan::Skip(
            bytes
                .iter()
                .position(|b| *b == HEADER[0])
                .unwrap_or(bytes.len()),
        );
    }
    match bytes.get(1) {
        None => return Scan::Need(2),
        Some(second) if *second != HEADER[1] => return Scan::Skip(1),
        Some(_) => {}
    }
    if bytes.len() < 5 {
        return Scan::Need(5);
    }
    let kind = [bytes[2], bytes[3]];
    let payload = usize::from(bytes[4]);
    match packet_type(kind) {
        Some((_, fixed)) if fixed.is_none_or(|fixed| fixed == payload) => {}
        _ => return Scan::Skip(1),
    }
    let len = OVERHEAD + payload;
    if bytes.len() < len {
        return Scan::Need(len);
    }
    let saved = u16::from_be_bytes([bytes[len - 2], bytes[len - 1]]);
    if CRC.checksum(&bytes[2..len - 2]) == saved {
        Scan::Frame { len, kind }
    } else {
        Scan::BadChecksum
    }
}

/// Incremental decoder of one unit's stream.
#[derive(Clone, Debug)]
pub struct Decoder {
    framer: Framer,
    statistics: Statistics,
    last_counter: Option<([u8; 2], u16)>,
    interval_s: f64,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new(PacketRate::Hz100)
    }
}

impl Decoder {
    /// A decoder for a unit that sends at `rate`: an S2 packet holds increments over one output
    /// interval and does not say how long that is.
    #[must_use]
    pub fn new(rate: PacketRate) -> Self {
        Self {
            framer: Framer::new(MAX_FRAME),
            statistics: Statistics::default(),
            last_counter: None,
            interval_s: rate.interval_s(),
        }
    }

    /// Takes bytes and hands on each packet that they complete.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        let (last, interval_s) = (&mut self.last_counter, self.interval_s);
        self.framer
            .push(bytes, &mut self.statistics, scan, |frame, statistics| {
                sink(item(frame, last, interval_s, statistics));
            });
    }

    /// The stream is over: hands on what still waits.
    pub fn finish(&mut self, mut sink: impl FnMut(Item<'_>)) {
        let (last, interval_s) = (&mut self.last_counter, self.interval_s);
        self.framer
            .finish(&mut self.statistics, scan, |frame, statistics| {
                sink(item(frame, last, interval_s, statistics));
            });
    }

    /// Counts since the start.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }
}

fn item<'a>(
    frame: Frame<'a, [u8; 2]>,
    last: &mut Option<([u8; 2], u16)>,
    interval_s: f64,
    statistics: &mut Statistics,
) -> Item<'a> {
    let name = packet_type(frame.kind).map_or("unknown", |(name, _)| name);
    let payload = &frame.bytes[5..frame.bytes.len() - 2];
    let mut device_time = None;
    let mut measurements = Measurements::none();
    let message = match decode_payload(frame.kind, payload) {
        Some(packet) => {
            match &packet {
                Packet::S0(scaled, _) => {
                    measurements = Measurements::one(Measurement::Imu(scaled.to_sample()));
                }
                Packet::S1(scaled) => {
                    measurements = Measurements::one(Measurement::Imu(scaled.to_sample()));
                    device_time = Some(follow(last, frame.kind, scaled.counter, statistics));
                }
                Packet::S2(increments) => {
                    let sample = increments.to_sample(interval_s);
                    measurements = Measurements::one(Measurement::Imu(sample));
                    device_time = Some(follow(last, frame.kind, increments.counter, statistics));
                }
                Packet::Other(_) => statistics.unknown += 1,
                _ => {}
            }
            Message::Crossbow440(packet)
        }
        None => {
            statistics.malformed += 1;
            Message::Malformed(Some(u16::from_be_bytes(frame.kind)))
        }
    };
    Item {
        protocol: Protocol::Crossbow440,
        name,
        device_time,
        latency_s: None,
        measurements,
        message,
        raw: frame.bytes,
        range: frame.range,
    }
}

/// Counts what is missing between the last counter and this one. A jump of more than half the
/// range, or a change of packet type, is a restart of the unit rather than that many lost packets.
fn follow(
    last: &mut Option<([u8; 2], u16)>,
    kind: [u8; 2],
    counter: u16,
    statistics: &mut Statistics,
) -> DeviceTime {
    if let Some((last_kind, last_counter)) = *last {
        let missing = counter.wrapping_sub(last_counter).wrapping_sub(1);
        if last_kind == kind {
            statistics.gaps += if missing > u16::MAX / 2 {
                1
            } else {
                u64::from(missing)
            };
        }
    }
    *last = Some((kind, counter));
    DeviceTime::Counter {
        value: u32::from(counter),
        modulus: 65_536,
    }
}

fn decode_payload(kind: [u8; 2], payload: &[u8]) -> Option<Packet> {
    Some(match &kind {
        b"S0" => {
            let field = [6, 7, 8].map(|i| word(payload, i) * FIELD_GAUSS_PER_COUNT);
            Packet::S0(Scaled::from_words(payload, 9), field)
        }
        b"S1" => Packet::S1(Scaled::from_words(payload, 6)),
        b"S2" => Packet::S2(Increments {
            delta_v_m_s: [0, 1, 2].map(|i| long(payload, i) * DELTA_V_M_S_PER_COUNT),
            delta_angle_rad: [3, 4, 5].map(|i| long(payload, i) * DELTA_ANGLE_RAD_PER_COUNT),
            counter: unsigned(payload, 12),
            bit: BitStatus(unsigned(payload, 13)),
        }),
        b"ID" => {
            let (serial, model) = payload.split_first_chunk::<4>()?;
            let text = model.split(|b| *b == 0).next().unwrap_or_default();
            Packet::Identity {
                serial: u32::from_be_bytes(*serial),
                model: String::from_utf8_lossy(text).into_owned(),
            }
        }
        b"VR" => Packet::Version(payload.try_into().ok()?),
        b"PK" => Packet::Pong,
        [0x15, 0x15] => Packet::Refused(payload.try_into().ok()?),
        b"GF" | b"RF" => Packet::Fields {
            stored: &kind == b"RF",
            fields: command::parse_pairs(payload)?,
        },
        b"SF" | b"WF" => Packet::FieldsSet {
            stored: &kind == b"WF",
            fields: command::parse_identifiers(payload)?,
        },
        _ => Packet::Other(kind),
    })
}

/// The `index`-th 16-bit word. The scanner has checked the payload's length.
fn unsigned(payload: &[u8], index: usize) -> u16 {
    u16::from_be_bytes([payload[2 * index], payload[2 * index + 1]])
}

fn word(payload: &[u8], index: usize) -> f64 {
    f64::from(unsigned(payload, index) as i16)
}

fn long(payload: &[u8], index: usize) -> f64 {
    let high = u32::from(unsigned(payload, 2 * index));
    let low = u32::from(unsigned(payload, 2 * index + 1));
    f64::from((high << 16 | low) as i32)
}

impl Scaled {
    /// `temperatures` is the index of the first temperature; S0 has a magnetometer before it.
    fn from_words(payload: &[u8], temperatures: usize) -> Self {
        let temperature = |i| word(payload, temperatures + i) * TEMPERATURE_C_PER_COUNT;
        Self {
            specific_force_m_s2: [0, 1, 2].map(|i| word(payload, i) * ACCEL_M_S2_PER_COUNT),
            angular_rate_rad_s: [3, 4, 5].map(|i| word(payload, i) * RATE_RAD_S_PER_COUNT),
            gyro_temperature_c: [0, 1, 2].map(temperature),
            board_temperature_c: temperature(3),
            counter: unsigned(payload, temperatures + 4),
            bit: BitStatus(unsigned(payload, temperatures + 5)),
        }
    }

    fn to_sample(self) -> ImuSample {
        ImuSample {
            specific_force_m_s2: self.specific_force_m_s2,
            angular_rate_rad_s: self.angular_rate_rad_s,
            temperature_c: Some(self.board_temperature_c),
            interval_s: 0.0,
            status: self.bit.0,
            valid: self.bit.is_good(),
        }
    }

    /// Appends this as an S1 packet. Values outside the range saturate, as in the unit.
    pub fn encode_s1(&self, out: &mut Vec<u8>) {
        append_packet(*b"S1", out, |out| {
            for value in self.specific_force_m_s2 {
                append_word(out, value / ACCEL_M_S2_PER_COUNT);
            }
            for value in self.angular_rate_rad_s {
                append_word(out, value / RATE_RAD_S_PER_COUNT);
            }
            for value in self.gyro_temperature_c {
                append_word(out, value / TEMPERATURE_C_PER_COUNT);
            }
            append_word(out, self.board_temperature_c / TEMPERATURE_C_PER_COUNT);
            out.extend(self.counter.to_be_bytes());
            out.extend(self.bit.0.to_be_bytes());
        });
    }
}

impl Increments {
    fn to_sample(self, interval_s: f64) -> ImuSample {
        ImuSample {
            specific_force_m_s2: self.delta_v_m_s.map(|v| v / interval_s),
            angular_rate_rad_s: self.delta_angle_rad.map(|v| v / interval_s),
            temperature_c: None,
            interval_s,
            status: self.bit.0,
            valid: self.bit.is_good(),
        }
    }

    /// Appends this as an S2 packet. Values outside the range saturate.
    pub fn encode_s2(&self, out: &mut Vec<u8>) {
        append_packet(*b"S2", out, |out| {
            for value in self.delta_v_m_s {
                out.extend(((value / DELTA_V_M_S_PER_COUNT).round() as i32).to_be_bytes());
            }
            for value in self.delta_angle_rad {
                out.extend(((value / DELTA_ANGLE_RAD_PER_COUNT).round() as i32).to_be_bytes());
            }
            out.extend(self.counter.to_be_bytes());
            out.extend(self.bit.0.to_be_bytes());
        });
    }
}

/// A float-to-integer `as` saturates and maps NaN to zero.
fn append_word(out: &mut Vec<u8>, counts: f64) {
    out.extend((counts.round() as i16).to_be_bytes());
}

/// A packet of this type around a payload of 255 bytes at most; a longer one is cut.
#[must_use]
pub fn encode_packet(kind: [u8; 2], payload: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(OVERHEAD + payload.len());
    let payload = &payload[..payload.len().min(255)];
    append_packet(kind, &mut out, |out| out.extend(payload));
    out
}

/// Appends header, length and CRC around what `payload` appends (255 bytes at most).
pub(crate) fn append_packet(kind: [u8; 2], out: &mut Vec<u8>, payload: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.extend(HEADER);
    out.extend(kind);
    out.push(0);
    payload(out);
    let length = out.len() - start - 5;
    debug_assert!(length <= 255, "payload of {length} bytes");
    out[start + 4] = length as u8;
    let crc = CRC.checksum(&out[start + 2..]);
    out.extend(crc.to_be_bytes());
}
