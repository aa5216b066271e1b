//! NMEA 0183 sentences of GNSS receivers: GGA, RMC, VTG, HDT, ZDA, and Septentrio's
//! attitude sentence `$PSSN,HRP`.

use sample::{DeviceTime, FixQuality, GnssAttitude, GnssPosition, GnssVelocity, Measurement};

use crate::Measurements;
use crate::frame::Scan;
use crate::geodesy::{Geodetic, heading_deg_from_yaw, yaw_from_heading_deg};

/// m/s in one knot (the 1929 international nautical mile).
const M_S_PER_KNOT: f64 = 1852.0 / 3600.0;
/// Longest sentence that is waited for; the standard allows 82 characters, makers take more.
const MAX_SENTENCE: usize = 256;

/// A decoded sentence, in the sentence's own units.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Sentence {
    /// Position.
    Gga {
        /// UTC time of day, s.
        utc_s: Option<f64>,
        /// Quality.
        quality: FixQuality,
        /// Latitude and longitude, degrees.
        position_deg: Option<[f64; 2]>,
        /// Height above mean sea level, m.
        height_msl_m: Option<f64>,
        /// Height of the geoid above the ellipsoid, m.
        undulation_m: Option<f64>,
        /// Satellites in the solution.
        satellites: Option<u8>,
    },
    /// Position, speed and course.
    Rmc {
        /// UTC time of day, s.
        utc_s: Option<f64>,
        /// Whether the receiver calls it good.
        valid: bool,
        /// Latitude and longitude, degrees.
        position_deg: Option<[f64; 2]>,
        /// Speed over ground, m/s.
        speed_m_s: Option<f64>,
        /// Course over ground, degrees.
        course_deg: Option<f64>,
        /// UTC date: year, month, day.
        date: Option<(u16, u8, u8)>,
    },
    /// Date and time.
    Zda {
        /// UTC time of day, s.
        utc_s: Option<f64>,
        /// UTC date: year, month, day.
        date: Option<(u16, u8, u8)>,
    },
    /// Speed and course; without a time.
    Vtg {
        /// Speed over ground, m/s.
        speed_m_s: Option<f64>,
        /// Course over ground, degrees.
        course_deg: Option<f64>,
    },
    /// Heading; without a time.
    Hdt {
        /// Clockwise from true north, degrees.
        heading_deg: Option<f64>,
    },
    /// Septentrio's heading, roll and pitch.
    Hrp {
        /// UTC time of day, s.
        utc_s: Option<f64>,
        /// Clockwise from true north, degrees.
        heading_deg: Option<f64>,
        /// Right side down positive, degrees.
        roll_deg: Option<f64>,
        /// Nose up positive, degrees.
        pitch_deg: Option<f64>,
        /// Standard deviations of heading, roll, pitch, degrees.
        sigma_deg: [Option<f64>; 3],
        /// Satellites.
        satellites: Option<u8>,
        /// As the mode of AttEuler: 0 none; 1, 2 heading and pitch; 3, 4 with roll.
        mode: u8,
    },
}

/// Scans bytes that begin with `$` and a capital letter. The frame ends with the checksum, so that
/// nothing waits for the line end.
pub(crate) fn scan(bytes: &[u8]) -> Scan<()> {
    match bytes.get(1) {
        None => return Scan::Need(2),
        Some(first) if first.is_ascii_uppercase() => {}
        Some(_) => return Scan::Skip(1),
    }
    let window = &bytes[1..bytes.len().min(MAX_SENTENCE)];
    let end = window.iter().position(|b| ends_sentence(*b));
    let Some(end) = end.map(|end| end + 1) else {
        return if bytes.len() < MAX_SENTENCE {
            Scan::Need(bytes.len() + 1)
        } else {
            Scan::Skip(1)
        };
    };
    if bytes[end] != b'*' {
        return Scan::Skip(1);
    }
    let len = end + 3;
    let digits = &bytes[end + 1..bytes.len().min(len)];
    if !digits.iter().all(u8::is_ascii_hexdigit) {
        return Scan::Skip(1);
    }
    if bytes.len() < len {
        return Scan::Need(len);
    }
    let saved = std::str::from_utf8(digits).ok();
    let saved = saved.and_then(|text| u8::from_str_radix(text, 16).ok());
    if saved == Some(checksum(&bytes[1..end])) {
        Scan::Frame { len, kind: () }
    } else {
        Scan::BadChecksum
    }
}

/// `*`, what cannot stand in a sentence, and what begins another message: the checksum has eight
/// bits only, too few to let a stray `$` swallow the message behind it.
fn ends_sentence(byte: u8) -> bool {
    !matches!(byte, b' '..=b'~') || matches!(byte, b'*' | b'$' | b'#' | b'%' | b'!')
}

fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

/// What a sentence with a good checksum turned out to be.
pub(crate) enum Decoded {
    Sentence(&'static str, Sentence),
    Unknown,
    Malformed,
}

/// Decodes a sentence that [`scan`] has checked.
pub(crate) fn decode(bytes: &[u8]) -> Decoded {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return Decoded::Malformed;
    };
    if let Some(fields) = text.strip_prefix("$PSSN,HRP,") {
        return match parse_hrp(fields) {
            Some(sentence) => Decoded::Sentence("HRP", sentence),
            None => Decoded::Malformed,
        };
    }
    if text.get(3..6) == Some("ZDA") && !text.starts_with("$P") {
        return match parse_zda(&text[6..]) {
            Some(sentence) => Decoded::Sentence("ZDA", sentence),
            None => Decoded::Malformed,
        };
    }
    if text.starts_with("$P") {
        return Decoded::Unknown;
    }
    let (name, parse): (_, Parse) = match text.get(3..6) {
        Some("GGA") => ("GGA", parse_gga),
        Some("RMC") => ("RMC", parse_rmc),
        Some("VTG") => ("VTG", parse_vtg),
        Some("HDT") => ("HDT", parse_hdt),
        _ => return Decoded::Unknown,
    };
    let body = text[6..].split_once('*').map_or("", |(body, _)| body);
    let fields: Vec<&str> = body.split(',').skip(1).collect();
    match parse(&fields) {
        Some(sentence) => Decoded::Sentence(name, sentence),
        None => Decoded::Malformed,
    }
}

/// Reads the fields of a sentence behind its name.
type Parse = fn(&[&str]) -> Option<Sentence>;

fn parse_gga(fields: &[&str]) -> Option<Sentence> {
    let [
        utc,
        lat,
        ns,
        lon,
        ew,
        quality,
        satellites,
        _,
        msl,
        _,
        undulation,
        ..,
    ] = fields
    else {
        return None;
    };
    Some(Sentence::Gga {
        utc_s: time_of_day(utc),
        quality: match *quality {
            "1" | "3" => FixQuality::Single,
            "2" => FixQuality::Differential,
            "4" => FixQuality::Fixed,
            "5" => FixQuality::Float,
            "6" => FixQuality::DeadReckoning,
            "0" | "7" | "8" => FixQuality::None,
            _ => return None,
        },
        position_deg: position([lat, ns, lon, ew])?,
        height_msl_m: number(msl),
        undulation_m: number(undulation),
        satellites: satellites.parse().ok(),
    })
}

fn parse_rmc(fields: &[&str]) -> Option<Sentence> {
    let [utc, status, lat, ns, lon, ew, speed, course, date, ..] = fields else {
        return None;
    };
    let part = |range: std::ops::Range<usize>| date.get(range)?.parse::<u8>().ok();
    let date = part(0..2).zip(part(2..4)).zip(part(4..6));
    let date = date.map(|((day, month), year)| {
        // The standard was released in 1983.
        let century = if year >= 83 { 1900 } else { 2000 };
        (century + u16::from(year), month, day)
    });
    let exists =
        |&(_, month, day): &(u16, u8, u8)| (1..=12).contains(&month) && (1..=31).contains(&day);
    Some(Sentence::Rmc {
        utc_s: time_of_day(utc),
        valid: match *status {
            "A" | "D" => true,
            "V" => false,
            _ => return None,
        },
        position_deg: position([lat, ns, lon, ew])?,
        speed_m_s: number(speed).map(|knots| knots * M_S_PER_KNOT),
        course_deg: number(course),
        date: date.filter(exists),
    })
}

fn parse_vtg(fields: &[&str]) -> Option<Sentence> {
    let [course, _, _, _, speed, ..] = fields else {
        return None;
    };
    Some(Sentence::Vtg {
        speed_m_s: number(speed).map(|knots| knots * M_S_PER_KNOT),
        course_deg: number(course),
    })
}

fn parse_hdt(fields: &[&str]) -> Option<Sentence> {
    let heading_deg = number(fields.first()?);
    Some(Sentence::Hdt { heading_deg })
}

/// A number with the precision of single floats, as in every version of the program: existing logs
/// replay to the same bits.
fn number(field: &str) -> Option<f64> {
    let number: f32 = field.parse().ok()?;
    number.is_finite().then(|| number.into())
}

/// Seconds of `hhmmss.ss` with the resolution of a nanosecond.
fn time_of_day(field: &str) -> Option<f64> {
    let part = |range: std::ops::Range<usize>| field.get(range)?.parse::<f64>().ok();
    let (hours, minutes, seconds) = (part(0..2)?, part(2..4)?, part(4..field.len().max(4))?);
    let exists = hours < 24.0 && minutes < 60.0 && (0.0..60.0).contains(&seconds);
    let nanos = (seconds * 1e9).round();
    exists.then_some((hours * 60.0 + minutes) * 60.0 + nanos / 1e9)
}

/// Latitude and longitude, degrees; without them `Some(None)`. `None`: not a position.
fn position([lat, ns, lon, ew]: [&str; 4]) -> Option<Option<[f64; 2]>> {
    if [lat, ns, lon, ew] == [""; 4] {
        return Some(None);
    }
    let degrees = |field: &str, digits: usize| {
        let whole: u8 = field.get(..digits)?.parse().ok()?;
        Some(f64::from(whole) + field.get(digits..)?.parse::<f64>().ok()? / 60.0)
    };
    let signed = |value: f64, side: &str, sides: [&str; 2]| match side {
        _ if side == sides[0] => Some(value),
        _ if side == sides[1] => Some(-value),
        _ => None,
    };
    let latitude = signed(degrees(lat, 2)?, ns, ["N", "S"])?;
    Some(Some([latitude, signed(degrees(lon, 3)?, ew, ["E", "W"])?]))
}

/// `,hhmmss.ss,dd,mm,yyyy,zone,zone*…`; a receiver without the time leaves the fields empty.
fn parse_zda(fields: &str) -> Option<Sentence> {
    let (fields, _) = fields.strip_prefix(',')?.split_once('*')?;
    let fields: Vec<&str> = fields.split(',').collect();
    let [time, day, month, year, ..] = fields.as_slice() else {
        return None;
    };
    let part = |range: std::ops::Range<usize>| time.get(range)?.parse::<f64>().ok();
    let utc_s = part(0..2)
        .zip(part(2..4))
        .zip(part(4..time.len().max(4)))
        .map(|((hours, minutes), seconds)| 3600.0 * hours + 60.0 * minutes + seconds);
    let date = year
        .parse()
        .ok()
        .zip(month.parse().ok())
        .zip(day.parse().ok());
    Some(Sentence::Zda {
        utc_s,
        date: date.map(|((year, month), day)| (year, month, day)),
    })
}

fn parse_hrp(fields: &str) -> Option<Sentence> {
    let (fields, _) = fields.split_once('*')?;
    let fields: Vec<&str> = fields.split(',').collect();
    if fields.len() < 10 {
        return None;
    }
    let number = |index: usize| fields[index].parse::<f64>().ok();
    let part = |range: std::ops::Range<usize>| fields[0].get(range)?.parse::<f64>().ok();
    let utc_s = part(0..2)
        .zip(part(2..4))
        .zip(part(4..fields[0].len().max(4)))
        .map(|((hours, minutes), seconds)| 3600.0 * hours + 60.0 * minutes + seconds);
    Some(Sentence::Hrp {
        utc_s,
        heading_deg: number(2),
        roll_deg: number(3),
        pitch_deg: number(4),
        sigma_deg: [number(5), number(6), number(7)],
        satellites: fields[8].parse().ok(),
        mode: fields[9].parse().unwrap_or(0),
    })
}

impl Sentence {
    /// The sentence's UTC time of day.
    #[must_use]
    pub fn device_time(&self) -> Option<DeviceTime> {
        match self {
            Self::Gga { utc_s, .. }
            | Self::Rmc { utc_s, .. }
            | Self::Zda { utc_s, .. }
            | Self::Hrp { utc_s, .. } => utc_s.map(DeviceTime::UtcTimeOfDay),
            Self::Vtg { .. } | Self::Hdt { .. } => None,
        }
    }

    /// What the sentence measured. RMC and VTG have no vertical velocity: it is taken as zero.
    #[must_use]
    pub fn measurements(&self) -> Measurements {
        match *self {
            Self::Gga {
                quality,
                position_deg,
                height_msl_m,
                undulation_m,
                satellites,
                ..
            } => {
                let [latitude, longitude] = position_deg.unwrap_or_default();
                Measurements::one(Measurement::GnssPosition(GnssPosition {
                    quality: if position_deg.is_some() {
                        quality
                    } else {
                        FixQuality::None
                    },
                    latitude_rad: latitude.to_radians(),
                    longitude_rad: longitude.to_radians(),
                    height_m: height_msl_m.unwrap_or(0.0) + undulation_m.unwrap_or(0.0),
                    sigma_enu_m: None,
                    satellites,
                }))
            }
            Self::Rmc {
                valid,
                speed_m_s,
                course_deg,
                ..
            } => horizontal(valid, speed_m_s, course_deg),
            Self::Zda { .. } => Measurements::none(),
            Self::Vtg {
                speed_m_s,
                course_deg,
            } => horizontal(true, speed_m_s, course_deg),
            Self::Hdt { heading_deg } => match heading_deg {
                Some(heading) => Measurements::one(Measurement::GnssAttitude(GnssAttitude {
                    quality: FixQuality::Single,
                    yaw_rad: Some(yaw_from_heading_deg(heading)),
                    ..GnssAttitude::default()
                })),
                None => Measurements::none(),
            },
            Self::Hrp {
                heading_deg,
                roll_deg,
                pitch_deg,
                sigma_deg: [h, r, p],
                mode,
                ..
            } => {
                let sigma = |s: Option<f64>| s.map_or(f64::INFINITY, f64::to_radians);
                Measurements::one(Measurement::GnssAttitude(GnssAttitude {
                    quality: match mode {
                        1 | 3 => FixQuality::Float,
                        2 | 4 => FixQuality::Fixed,
                        _ => FixQuality::None,
                    },
                    yaw_rad: heading_deg.map(yaw_from_heading_deg),
                    pitch_rad: pitch_deg.map(|pitch| -pitch.to_radians()),
                    roll_rad: roll_deg.map(f64::to_radians),
                    sigma_rad: h.map(|h| [h.to_radians(), sigma(p), sigma(r)]),
                }))
            }
        }
    }
}

fn horizontal(valid: bool, speed_m_s: Option<f64>, course_deg: Option<f64>) -> Measurements {
    // A receiver that stands still sends no course.
    let (Some(speed), Some(course)) = (speed_m_s, course_deg) else {
        return Measurements::none();
    };
    let (east, north) = math::sin_cos(course.to_radians());
    Measurements::one(Measurement::GnssVelocity(GnssVelocity {
        quality: if valid {
            FixQuality::Single
        } else {
            FixQuality::None
        },
        velocity_enu_m_s: [speed * east, speed * north, 0.0],
        sigma_enu_m_s: None,
        latency_s: None,
    }))
}

/// Appends `$`, the text, its checksum and a line end.
pub fn encode_sentence(text: &str, out: &mut Vec<u8>) {
    let sum = checksum(text.as_bytes());
    out.extend(format!("${text}*{sum:02X}\r\n").as_bytes());
}

/// Appends a GGA sentence of an RTK fixed solution. `undulation_m` is the geoid's height.
pub fn encode_gga(
    utc_s: f64,
    place: Geodetic,
    undulation_m: f64,
    satellites: u8,
    out: &mut Vec<u8>,
) {
    let position = position_fields(place);
    let msl = place.height_m - undulation_m;
    let utc = utc_field(utc_s);
    let text = format!(
        "GPGGA,{utc},{position},4,{satellites:02},0.8,{msl:.3},M,{undulation_m:.3},M,1.0,0000"
    );
    encode_sentence(&text, out);
}

/// Appends an RMC sentence; the date is `ddmmyy`.
pub fn encode_rmc(
    utc_s: f64,
    date: &str,
    place: Geodetic,
    velocity_enu_m_s: [f64; 3],
    out: &mut Vec<u8>,
) {
    let [east, north, _] = velocity_enu_m_s;
    let knots = math::hypot(east, north) / M_S_PER_KNOT;
    let course = heading_deg_from_yaw(math::atan2(north, east));
    let (utc, position) = (utc_field(utc_s), position_fields(place));
    encode_sentence(
        &format!("GPRMC,{utc},A,{position},{knots:.4},{course:.3},{date},,,R"),
        out,
    );
}

/// Appends Septentrio's attitude sentence from the project's axes; a fixed solution with roll.
pub fn encode_hrp(
    utc_s: f64,
    date: &str,
    yaw_pitch_roll_rad: [f64; 3],
    sigma_deg: [f64; 3],
    out: &mut Vec<u8>,
) {
    let [yaw, pitch, roll] = yaw_pitch_roll_rad;
    let heading = heading_deg_from_yaw(yaw);
    let (pitch, roll) = (-pitch.to_degrees(), roll.to_degrees());
    let [sh, sr, sp] = sigma_deg;
    let utc = utc_field(utc_s);
    let text = format!(
        "PSSN,HRP,{utc},{date},{heading:.3},{roll:.3},{pitch:.3},{sh:.3},{sr:.3},{sp:.3},12,4,0.0,E"
    );
    encode_sentence(&text, out);
}

fn utc_field(utc_s: f64) -> String {
    let centis = (utc_s * 100.0).round() as i64;
    let centis = centis.rem_euclid(8_640_000);
    let (h, m, s) = (centis / 360_000, centis / 6000 % 60, centis % 6000);
    format!("{h:02}{m:02}{:02}.{:02}", s / 100, s % 100)
}

fn position_fields(place: Geodetic) -> String {
    let split = |rad: f64| {
        let units = (rad.to_degrees().abs() * 60e7).round() as u64;
        (units / 600_000_000, (units % 600_000_000) as f64 / 1e7)
    };
    let (lat, lat_min) = split(place.latitude_rad);
    let (lon, lon_min) = split(place.longitude_rad);
    let ns = if place.latitude_rad < 0.0 { 'S' } else { 'N' };
    let ew = if place.longitude_rad < 0.0 { 'W' } else { 'E' };
    format!("{lat:02}{lat_min:010.7},{ns},{lon:03}{lon_min:010.7},{ew}")
}
