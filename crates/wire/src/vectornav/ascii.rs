//! ASCII messages `$VNxxx,…*` with a checksum of two digits (exclusive or) or of four digits (CRC-16).

use super::{Decoded, Form, Output, checksum};
use crate::frame::Scan;
use crate::text::number;

/// Longest message that is waited for.
const MAX_MESSAGE: usize = 256;

/// An ASCII message. Values that the message does not have are absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ascii {
    /// Yaw (clockwise from true north), pitch (nose up), roll (right side down), degrees.
    pub yaw_pitch_roll_deg: Option<[f64; 3]>,
    /// Specific force along x forward, y right, z down, m/s^2.
    pub acceleration_m_s2: Option<[f64; 3]>,
    /// Angular rate, rad/s.
    pub rate_rad_s: Option<[f64; 3]>,
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// GPS time of week, s, and week.
    pub gps_time: Option<(f64, u16)>,
    /// State of the navigation (VNINS), as of [`Binary`](super::Binary::ins_status).
    pub ins_status: Option<u16>,
    /// Fix (VNGPS) and satellites.
    pub fix: Option<(u8, u8)>,
    /// Latitude and longitude in degrees and height above the ellipsoid in m.
    pub position: Option<[f64; 3]>,
    /// Velocity north, east, down, m/s.
    pub velocity_ned_m_s: Option<[f64; 3]>,
    /// Standard deviations of the position north, east, down, m.
    pub position_sigma_m: Option<[f64; 3]>,
    /// Standard deviation of the velocity, m/s.
    pub velocity_sigma_m_s: Option<f64>,
}

/// Messages that are decoded.
const MESSAGES: [&str; 7] = [
    "VNYPR", "VNYMR", "VNIMU", "VNQMR", "VNISL", "VNINS", "VNGPS",
];
/// Messages that are known by name alone.
const KNOWN: [&str; 14] = [
    "VNRRG", "VNWRG", "VNERR", "VNASY", "VNRST", "VNRFS", "VNWNV", "VNTAR", "VNQTN", "VNDTV",
    "VNMAG", "VNYBA", "VNYIA", "VNINE",
];

/// Scans bytes that begin with `$VN`.
pub(super) fn scan(bytes: &[u8]) -> Scan<Form> {
    let window = &bytes[1..bytes.len().min(MAX_MESSAGE)];
    let ends = |byte: &u8| !matches!(byte, b' '..=b'~') || matches!(byte, b'*' | b'$');
    let Some(end) = window.iter().position(ends).map(|end| end + 1) else {
        return if bytes.len() < MAX_MESSAGE {
            Scan::Need(bytes.len() + 1)
        } else {
            Scan::Skip(1)
        };
    };
    if bytes[end] != b'*' {
        return Scan::Skip(1);
    }
    let digits = |count: usize| {
        let text = std::str::from_utf8(bytes.get(end + 1..end + 1 + count)?).ok()?;
        u16::from_str_radix(text, 16).ok()
    };
    let content = &bytes[1..end];
    let frame = |digits: usize| Scan::Frame {
        len: end + 1 + digits,
        kind: Form::Ascii,
    };
    let known = &bytes[end + 1..bytes.len().min(end + 5)];
    let hex = known.iter().take_while(|b| b.is_ascii_hexdigit()).count();
    match (known.len(), hex) {
        (_, 2..) if digits(2) == Some(exclusive_or(content)) => frame(2),
        (4, 4) if digits(4) == Some(checksum(content)) => frame(4),
        (have, _) if have == hex && have < 4 => Scan::Need(end + 1 + have + 1),
        (_, 2..) => Scan::BadChecksum,
        _ => Scan::Skip(1),
    }
}

fn exclusive_or(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte).into()
}

/// Decodes a message that [`scan`] has checked.
pub(super) fn decode(bytes: &[u8]) -> Decoded {
    let text = std::str::from_utf8(bytes).ok();
    let text = text.and_then(|text| text.strip_prefix('$')?.split_once('*'));
    let Some((text, _)) = text else {
        return Decoded::Malformed;
    };
    let (name, fields) = text.split_once(',').unwrap_or((text, ""));
    let same = |known: &&'static str| **known == *name;
    let Some(known) = MESSAGES.iter().copied().find(|known| same(known)) else {
        return Decoded::Unknown(KNOWN.iter().copied().find(|known| same(known)));
    };
    let fields: Vec<&str> = fields.split(',').map(str::trim).collect();
    match Ascii::read(known, &Fields(&fields)) {
        Some(message) => Decoded::Output(known, Output::Ascii(message)),
        None => Decoded::Malformed,
    }
}

struct Fields<'t>(&'t [&'t str]);

impl Fields<'_> {
    fn number(&self, index: usize) -> Option<f64> {
        number(self.0.get(index)?)
    }

    fn vector(&self, index: usize) -> Option<[f64; 3]> {
        Some([
            self.number(index)?,
            self.number(index + 1)?,
            self.number(index + 2)?,
        ])
    }

    /// Time of week and week; a device without GPS time sends the week 0.
    fn gps_time(&self) -> Option<(f64, u16)> {
        let week = self.0.get(1)?.parse().ok().filter(|week| *week > 0)?;
        Some((self.number(0)?, week))
    }
}

impl Ascii {
    /// The message with this name; `None` if a field is missing or is no number.
    fn read(name: &str, fields: &Fields<'_>) -> Option<Self> {
        let mut message = Self::default();
        match name {
            "VNYPR" => message.yaw_pitch_roll_deg = Some(fields.vector(0)?),
            "VNYMR" => {
                message.yaw_pitch_roll_deg = Some(fields.vector(0)?);
                message.acceleration_m_s2 = Some(fields.vector(6)?);
                message.rate_rad_s = Some(fields.vector(9)?);
            }
            "VNIMU" => {
                message.acceleration_m_s2 = Some(fields.vector(3)?);
                message.rate_rad_s = Some(fields.vector(6)?);
                message.temperature_c = fields.number(9);
            }
            "VNQMR" => {
                message.acceleration_m_s2 = Some(fields.vector(7)?);
                message.rate_rad_s = Some(fields.vector(10)?);
            }
            "VNISL" => {
                message.yaw_pitch_roll_deg = Some(fields.vector(0)?);
                message.position = Some(fields.vector(3)?);
                message.velocity_ned_m_s = Some(fields.vector(6)?);
                message.acceleration_m_s2 = Some(fields.vector(9)?);
                message.rate_rad_s = Some(fields.vector(12)?);
            }
            "VNINS" => {
                message.gps_time = fields.gps_time();
                message.ins_status = u16::from_str_radix(fields.0.get(2)?, 16).ok();
                message.yaw_pitch_roll_deg = Some(fields.vector(3)?);
                message.position = Some(fields.vector(6)?);
                message.velocity_ned_m_s = Some(fields.vector(9)?);
                message.position_sigma_m = fields.number(13).map(|sigma| [sigma; 3]);
                message.velocity_sigma_m_s = fields.number(14);
            }
            _ => {
                message.gps_time = fields.gps_time();
                let count = |index: usize| fields.0.get(index)?.parse().ok();
                message.fix = Some((count(2)?, count(3)?));
                message.position = Some(fields.vector(4)?);
                message.velocity_ned_m_s = Some(fields.vector(7)?);
                message.position_sigma_m = fields.vector(10);
                message.velocity_sigma_m_s = fields.number(13);
            }
        }
        Some(message)
    }
}

/// Appends `$`, the text, its checksum of two digits and a line end.
pub fn encode_text(text: &str, out: &mut Vec<u8>) {
    let sum = exclusive_or(text.as_bytes());
    out.extend(format!("${text}*{sum:02X}\r\n").as_bytes());
}

/// Appends VNYMR: yaw, pitch and roll in degrees, acceleration in m/s^2, angular rate in rad/s.
pub fn encode_inertial(
    yaw_pitch_roll_deg: [f64; 3],
    acceleration_m_s2: [f64; 3],
    rate_rad_s: [f64; 3],
    out: &mut Vec<u8>,
) {
    let [yaw, pitch, roll] = yaw_pitch_roll_deg;
    let [ax, ay, az] = acceleration_m_s2;
    let [p, q, r] = rate_rad_s;
    let text = format!(
        "VNYMR,{yaw:+08.3},{pitch:+08.3},{roll:+08.3},+00.0000,+00.0000,+00.0000,{ax:+07.3},{ay:+07.3},\
         {az:+07.3},{p:+010.6},{q:+010.6},{r:+010.6}"
    );
    encode_text(&text, out);
}
