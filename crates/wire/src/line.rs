//! Text devices described by the configuration: one reading a line, numbers between delimiters.
//!
//! On the Prowler these are the steering encoder (4000 pulses a turn), the throttle's step motor
//! and the brake's encoder (2000 pulses a turn), each on its own serial port (thesis, appendix A).
//! A line has no checksum: one that does not read as configured is counted and dropped whole.

use sample::{ControlSample, Measurement, Signal, SteerSample};

use crate::frame::Frame;
use crate::text::{Cells, Lines, number};
use crate::{Item, Measurements, Message, Protocol, Statistics, WireError};

const MAX_LINE: usize = 512;

/// One number of the line.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Position in the line, from zero.
    pub index: usize,
    /// Name of the quantity.
    pub name: String,
    /// Value = number * scale + offset.
    pub scale: f64,
    /// Value = number * scale + offset.
    pub offset: f64,
    /// Unit of the value.
    pub unit: String,
    /// Width in bits of a two's-complement count that is sent as an unsigned number; `None` for
    /// numbers with a sign of their own.
    pub signed_bits: Option<u8>,
}

/// What a line's values are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Role {
    /// The field of this name is the steering-wheel angle in rad, left positive.
    Steer(String),
    /// All fields are a controller's values.
    Control,
}

/// How a device writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Format {
    /// Byte between numbers; `None` for any run of blanks.
    pub delimiter: Option<u8>,
    /// What a line begins with; lines that begin otherwise are unknown.
    pub prefix: String,
    /// The numbers that are taken.
    pub fields: Vec<Field>,
    /// What they are.
    pub role: Role,
    /// What to send to get a line, for devices that only answer; empty for the others.
    pub query: Vec<u8>,
}

impl Format {
    /// An incremental encoder that sends its count, one number a line: `role_name` in rad.
    #[must_use]
    pub fn encoder(name: &str, pulses_per_turn: f64, role: Role) -> Self {
        Self {
            delimiter: None,
            prefix: String::new(),
            fields: vec![Field {
                index: 0,
                name: name.to_owned(),
                scale: std::f64::consts::TAU / pulses_per_turn,
                offset: 0.0,
                unit: "rad".to_owned(),
                signed_bits: None,
            }],
            role,
            query: Vec::new(),
        }
    }

    /// Whether a decoder can work with this.
    ///
    /// # Errors
    /// [`WireError::Setting`] names the first setting that cannot work.
    pub fn check(&self) -> Result<(), WireError> {
        let wrong = |what, got: String, expected| {
            Err(WireError::Setting {
                what,
                got,
                expected,
            })
        };
        if self.fields.is_empty() {
            return wrong("fields", "empty".to_owned(), "at least one field");
        }
        for field in &self.fields {
            if !field.scale.is_finite() || field.scale == 0.0 || !field.offset.is_finite() {
                let got = format!("{} and {} in {}", field.scale, field.offset, field.name);
                return wrong("scale or offset", got, "finite numbers, the scale not zero");
            }
            if field
                .signed_bits
                .is_some_and(|bits| !(2..=63).contains(&bits))
            {
                let got = format!("{:?} in {}", field.signed_bits, field.name);
                return wrong("signed_bits", got, "2 to 63");
            }
        }
        if let Role::Steer(name) = &self.role
            && !self.fields.iter().any(|field| field.name == *name)
        {
            return wrong("steer field", name.clone(), "the name of one of the fields");
        }
        Ok(())
    }

    /// Appends a line with these values, in the order of the fields; the inverse of the decoder up
    /// to the rounding to whole counts.
    pub fn encode(&self, values: &[f64], out: &mut Vec<u8>) {
        let columns = self.fields.iter().map(|f| f.index + 1).max().unwrap_or(0);
        out.extend(self.prefix.as_bytes());
        for column in 0..columns {
            if column > 0 {
                out.push(self.delimiter.unwrap_or(b' '));
            }
            let found = self
                .fields
                .iter()
                .zip(values)
                .find(|(f, _)| f.index == column);
            let number = found.map_or(0, |(field, value)| field.to_count(*value));
            out.extend(number.to_string().as_bytes());
        }
        out.extend(b"\r\n");
    }
}

impl Field {
    fn to_count(&self, value: f64) -> i64 {
        let count = ((value - self.offset) / self.scale).round() as i64;
        match self.signed_bits {
            Some(bits) => count.rem_euclid(1 << bits.clamp(2, 62)),
            None => count,
        }
    }

    fn value_of(&self, text: &str) -> Option<f64> {
        let number: f64 = match self.signed_bits {
            None => number(text)?,
            Some(bits) => {
                let bits = bits.clamp(2, 62);
                let count: i64 = text.parse().ok()?;
                if !(0..1 << bits).contains(&count) {
                    return None;
                }
                let negative = count >= 1 << (bits - 1);
                (if negative { count - (1 << bits) } else { count }) as f64
            }
        };
        let value = number * self.scale + self.offset;
        value.is_finite().then_some(value)
    }
}

/// One line's values, in the order of the format's fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// Values in the fields' units.
    pub values: Vec<f64>,
}

/// Incremental decoder of one text device.
#[derive(Clone, Debug)]
pub struct Decoder {
    lines: Lines<MAX_LINE>,
    format: Format,
}

impl Decoder {
    /// A decoder for this format.
    ///
    /// # Errors
    /// As [`Format::check`].
    pub fn new(format: Format) -> Result<Self, WireError> {
        format.check()?;
        Ok(Self {
            lines: Lines::new(),
            format,
        })
    }

    /// Takes bytes and hands on each line that they complete.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(Item<'_>)) {
        let format = &self.format;
        self.lines.push(bytes, |frame, statistics| {
            sink(item(frame, format, statistics));
        });
    }

    /// Counts since the start. An unfinished last line is not a reading.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.lines.statistics()
    }
}

fn item<'a>(frame: Frame<'a, ()>, format: &Format, statistics: &mut Statistics) -> Item<'a> {
    let mut measurements = Measurements::none();
    let text = std::str::from_utf8(frame.bytes).ok();
    let message = match text.map(|text| text.trim().strip_prefix(format.prefix.as_str())) {
        Some(Some(numbers)) => match read(numbers, format) {
            Some(reading) => {
                measurements = Measurements::one(measurement(&reading, format));
                Message::Line(reading)
            }
            None => Message::Malformed(None),
        },
        Some(None) => Message::Unknown(None),
        None => Message::Malformed(None),
    };
    match message {
        Message::Unknown(_) => statistics.unknown += 1,
        Message::Malformed(_) => statistics.malformed += 1,
        _ => {}
    }
    Item {
        protocol: Protocol::Line,
        name: "line",
        device_time: None,
        latency_s: None,
        measurements,
        message,
        raw: frame.bytes,
        range: frame.range,
    }
}

fn read(numbers: &str, format: &Format) -> Option<Reading> {
    let cells = Cells::new(numbers, format.delimiter.map(char::from));
    let values = format
        .fields
        .iter()
        .map(|field| field.value_of(cells.clone().nth(field.index)?))
        .collect::<Option<Vec<f64>>>()?;
    Some(Reading { values })
}

fn measurement(reading: &Reading, format: &Format) -> Measurement {
    let named = || format.fields.iter().zip(&reading.values);
    if let Role::Steer(name) = &format.role
        && let Some((_, value)) = named().find(|(field, _)| field.name == *name)
    {
        return Measurement::Steer(SteerSample {
            steering_wheel_rad: *value,
        });
    }
    Measurement::Control(ControlSample {
        values: named()
            .map(|(field, value)| Signal {
                name: field.name.as_str().into(),
                value: *value,
                unit: field.unit.as_str().into(),
            })
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(format: Format, bytes: &[u8]) -> (Vec<Measurement>, Statistics) {
        let mut decoder = Decoder::new(format).expect("a working format");
        let mut all = Vec::new();
        for byte in bytes {
            decoder.push(&[*byte], |item| all.extend(item.measurements));
        }
        (all, decoder.statistics())
    }

    #[test]
    fn a_steering_encoder() {
        let format = Format::encoder(
            "steering_wheel",
            4000.0,
            Role::Steer("steering_wheel".to_owned()),
        );
        let (all, statistics) = decode(format, b"1000\r\nx12\r\n-2000\r\n+5");
        let steer = |steering_wheel_rad| Measurement::Steer(SteerSample { steering_wheel_rad });
        let turn = std::f64::consts::TAU;
        assert_eq!(all, [steer(turn / 4.0), steer(-turn / 2.0)]);
        assert_eq!((statistics.messages, statistics.malformed), (3, 1));
    }

    #[test]
    fn a_controller_with_prefix_and_wrapped_counts() {
        let mut format = Format::encoder("brake", 2000.0, Role::Control);
        format.prefix = "B,".to_owned();
        format.delimiter = Some(b',');
        format.fields[0].index = 1;
        format.fields[0].signed_bits = Some(16);
        let mut bytes = Vec::new();
        format.encode(&[-0.5], &mut bytes);
        assert_eq!(bytes, b"B,0,65377\r\n");
        bytes.extend(b"T,0,5\r\n");
        let (all, statistics) = decode(format, &bytes);
        let [Measurement::Control(control)] = all.as_slice() else {
            panic!("{all:?}");
        };
        let half_count = std::f64::consts::PI / 2000.0;
        assert!((control.values[0].value + 0.5).abs() <= half_count);
        assert_eq!(&*control.values[0].unit, "rad");
        assert_eq!(statistics.unknown, 1);
    }

    #[test]
    fn a_format_that_cannot_work_is_refused() {
        let mut format = Format::encoder("a", 4000.0, Role::Steer("b".to_owned()));
        assert!(format.check().is_err());
        format.role = Role::Control;
        assert!(format.check().is_ok());
        format.fields[0].scale = 0.0;
        assert!(format.check().is_err());
    }
}
