//! NMEA 0183 sentences of GNSS receivers: GGA, RMC, VTG, HDT, THS, GNS, GST, ZDA, and Septentrio's
//! attitude sentence `$PSSN,HRP` (NMEA 0183 version 4.11, chapter 8.3; Septentrio's reference guide).
//!
//! A value that a sentence does not have is NaN in its measurement: the position, the height above the
//! ellipsoid (if the height of the geoid was not sent), and the upward velocity.

mod encode;
mod parse;

pub use encode::{encode_gga, encode_hrp, encode_rmc, encode_sentence};

use sample::{DeviceTime, FixQuality, GnssAttitude, GnssPosition, GnssVelocity, Measurement};

use crate::Measurements;
use crate::frame::Scan;
use crate::geodesy::yaw_from_heading_deg;

/// m/s in one knot (the 1929 international nautical mile).
const M_S_PER_KNOT: f64 = 1852.0 / 3600.0;
/// Longest sentence that is waited for; the standard allows 82 characters, makers take more.
const MAX_SENTENCE: usize = 256;
/// Least standard deviation of a velocity without a course, m/s: the noise of a standing receiver.
const STANDING_SIGMA_M_S: f64 = 0.1;
/// Oldest standard deviation that goes with a position, s.
const SIGMA_AGE_MAX_S: f64 = 2.0;

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
    /// Position by several satellite systems.
    Gns {
        /// UTC time of day, s.
        utc_s: Option<f64>,
        /// Quality: the best mode of a system.
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
        /// Quality by status and mode.
        quality: FixQuality,
        /// Latitude and longitude, degrees.
        position_deg: Option<[f64; 2]>,
        /// Speed over ground, m/s.
        speed_m_s: Option<f64>,
        /// Course over ground, degrees; a receiver that stands sends none.
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
        /// Quality; `None` if the receiver sends no mode, as before version 2.3.
        quality: Option<FixQuality>,
        /// Speed over ground, m/s.
        speed_m_s: Option<f64>,
        /// Course over ground, degrees; a receiver that stands sends none.
        course_deg: Option<f64>,
    },
    /// Heading; without a time.
    Hdt {
        /// Clockwise from true north, degrees.
        heading_deg: Option<f64>,
    },
    /// Heading with its mode; without a time.
    Ths {
        /// Clockwise from true north, degrees.
        heading_deg: Option<f64>,
        /// Quality.
        quality: FixQuality,
    },
    /// Standard deviations of the position.
    Gst {
        /// UTC time of day, s.
        utc_s: Option<f64>,
        /// East, north, up, m.
        sigma_enu_m: [Option<f64>; 3],
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
    /// A name that is known, or none.
    Unknown(Option<&'static str>),
    Malformed,
}

/// Sentences that are decoded.
const SENTENCES: [&str; 8] = ["GGA", "GNS", "RMC", "VTG", "HDT", "THS", "GST", "ZDA"];
/// Sentences that are known by name.
const KNOWN: [&str; 26] = [
    "GSV", "GSA", "GLL", "GRS", "GBS", "TXT", "DTM", "HDG", "HDM", "ROT", "VHW", "VBW", "VLW",
    "RMB", "DPT", "DBT", "MTW", "MWV", "MWD", "XTE", "BOD", "BWC", "APB", "AAM", "RTE", "WPL",
];

/// Decodes a sentence that [`scan`] has checked.
pub(crate) fn decode(bytes: &[u8]) -> Decoded {
    let text = std::str::from_utf8(bytes).ok();
    let text = text.and_then(|text| text.strip_prefix('$')?.split_once('*'));
    let Some((text, _)) = text else {
        return Decoded::Malformed;
    };
    let (address, fields) = text.split_once(',').unwrap_or((text, ""));
    let (name, fields) = match (address, fields.split_once(',')) {
        ("PSSN", Some(("HRP", fields))) => ("HRP", fields),
        _ if address.starts_with('P') => return Decoded::Unknown(None),
        // Two letters of the talker; longer names are those of other sentences.
        _ => match address.get(2..) {
            Some(name) if name.len() == 3 => (name, fields),
            _ => return Decoded::Unknown(None),
        },
    };
    let same = |known: &&'static str| **known == *name;
    let Some(known) = SENTENCES.iter().chain(&["HRP"]).copied().find(|k| same(k)) else {
        return Decoded::Unknown(KNOWN.iter().copied().find(|k| same(k)));
    };
    match parse::sentence(name, fields) {
        Some(sentence) => Decoded::Sentence(known, sentence),
        None => Decoded::Malformed,
    }
}

impl Sentence {
    /// The sentence's UTC time of day.
    #[must_use]
    pub fn device_time(&self) -> Option<DeviceTime> {
        match self {
            Self::Gga { utc_s, .. }
            | Self::Gns { utc_s, .. }
            | Self::Rmc { utc_s, .. }
            | Self::Zda { utc_s, .. }
            | Self::Gst { utc_s, .. }
            | Self::Hrp { utc_s, .. } => utc_s.map(DeviceTime::UtcTimeOfDay),
            Self::Vtg { .. } | Self::Hdt { .. } | Self::Ths { .. } => None,
        }
    }
}

/// What earlier sentences say about later ones: the quality of a VTG without a mode, and the standard
/// deviation of a position, whose GST follows it. Waiting for the GST would delay the position; the last
/// one, an epoch old, goes with it instead.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    quality: Option<FixQuality>,
    sigma: Option<(f64, [f64; 3])>,
}

impl Memory {
    /// What a sentence measured, in SI and the project's axes.
    pub fn measurements(&mut self, sentence: &Sentence) -> Measurements {
        match *sentence {
            Sentence::Gga {
                utc_s,
                quality,
                position_deg,
                height_msl_m,
                undulation_m,
                satellites,
            }
            | Sentence::Gns {
                utc_s,
                quality,
                position_deg,
                height_msl_m,
                undulation_m,
                satellites,
            } => {
                self.quality = Some(quality);
                let height_m = height_msl_m.zip(undulation_m).map(|(h, n)| h + n);
                let sigma = self.sigma_enu_m(utc_s);
                Measurements::one(position(quality, position_deg, height_m, sigma, satellites))
            }
            Sentence::Rmc {
                utc_s,
                quality,
                position_deg,
                speed_m_s,
                course_deg,
                ..
            } => {
                self.quality = Some(quality);
                let sigma = self.sigma_enu_m(utc_s);
                Measurements::two(
                    position(quality, position_deg, None, sigma, None),
                    horizontal(quality, speed_m_s, course_deg),
                )
            }
            Sentence::Vtg {
                quality,
                speed_m_s,
                course_deg,
            } => {
                let quality = quality.or(self.quality).unwrap_or(FixQuality::Single);
                Measurements::one(horizontal(quality, speed_m_s, course_deg))
            }
            Sentence::Gst { utc_s, sigma_enu_m } => {
                let [east, north, up] = sigma_enu_m;
                let known = utc_s.zip(east).zip(north).zip(up);
                self.sigma = known.map(|(((utc, e), n), u)| (utc, [e, n, u]));
                Measurements::none()
            }
            Sentence::Zda { .. } => Measurements::none(),
            Sentence::Hdt { heading_deg } => heading(FixQuality::Single, heading_deg),
            Sentence::Ths {
                heading_deg,
                quality,
            } => heading(quality, heading_deg),
            Sentence::Hrp { .. } => attitude(sentence),
        }
    }

    fn sigma_enu_m(&self, utc_s: Option<f64>) -> Option<[f64; 3]> {
        let ((then, sigma), now) = self.sigma.zip(utc_s)?;
        ((now - then).abs() <= SIGMA_AGE_MAX_S).then_some(sigma)
    }
}

fn position(
    quality: FixQuality,
    position_deg: Option<[f64; 2]>,
    height_m: Option<f64>,
    sigma_enu_m: Option<[f64; 3]>,
    satellites: Option<u8>,
) -> Measurement {
    let solved = position_deg.filter(|_| quality.is_solved());
    let [latitude, longitude] = solved.unwrap_or([f64::NAN; 2]);
    Measurement::GnssPosition(GnssPosition {
        quality: solved.map_or(FixQuality::None, |_| quality),
        latitude_rad: latitude.to_radians(),
        longitude_rad: longitude.to_radians(),
        height_m: height_m.filter(|_| solved.is_some()).unwrap_or(f64::NAN),
        sigma_enu_m: sigma_enu_m.filter(|_| solved.is_some()),
        satellites,
    })
}

/// Velocity over ground. A receiver that stands sends a speed without a course: the direction then has
/// no weight, because its standard deviation is the speed.
fn horizontal(quality: FixQuality, speed_m_s: Option<f64>, course_deg: Option<f64>) -> Measurement {
    let solved = speed_m_s.filter(|_| quality.is_solved());
    let (velocity, sigma) = match (solved, course_deg) {
        (None, _) => ([f64::NAN; 3], None),
        (Some(speed), Some(course)) => {
            let (east, north) = math::sin_cos(course.to_radians());
            ([speed * east, speed * north, f64::NAN], None)
        }
        (Some(speed), None) => {
            let sigma = speed.abs().max(STANDING_SIGMA_M_S);
            ([0.0, speed, f64::NAN], Some([sigma; 3]))
        }
    };
    Measurement::GnssVelocity(GnssVelocity {
        quality: solved.map_or(FixQuality::None, |_| quality),
        velocity_enu_m_s: velocity,
        sigma_enu_m_s: sigma,
        latency_s: None,
    })
}

fn heading(quality: FixQuality, heading_deg: Option<f64>) -> Measurements {
    let Some(heading) = heading_deg.filter(|_| quality.is_solved()) else {
        return Measurements::none();
    };
    Measurements::one(Measurement::GnssAttitude(GnssAttitude {
        quality,
        yaw_rad: Some(yaw_from_heading_deg(heading)),
        ..GnssAttitude::default()
    }))
}

fn attitude(sentence: &Sentence) -> Measurements {
    let Sentence::Hrp {
        heading_deg,
        roll_deg,
        pitch_deg,
        sigma_deg: [h, r, p],
        mode,
        ..
    } = *sentence
    else {
        return Measurements::none();
    };
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

#[cfg(test)]
mod tests;
