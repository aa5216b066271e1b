//! Messages and signals: decode and encode.

use std::ops::RangeInclusive;

use sample::{CanFlags, CanFrame};

use super::bits::{Field, RawKind, sign_extend};

/// A message of a DBC file.
#[derive(Clone, Debug, PartialEq)]
pub struct MessageDef {
    /// Name: the long one of `SystemMessageLongSymbol` if the file has it.
    pub name: String,
    /// Name in the `BO_` line, of at most 32 characters in files with long names.
    pub short_name: String,
    /// Identifier without flag bits.
    pub id: u32,
    /// 29-bit identifier.
    pub extended: bool,
    /// CAN FD frame, by the file's `VFrameFormat` or by its size.
    pub fd: bool,
    /// Matched by parameter group as well as by identifier.
    pub j1939: bool,
    /// Bytes of its data.
    pub size: usize,
    /// What the file says about it; empty if nothing.
    pub comment: String,
    /// Its signals, in the file's order.
    pub signals: Vec<SignalDef>,
}

/// A signal of a message.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalDef {
    /// Name: the long one of `SystemSignalLongSymbol` if the file has it.
    pub name: String,
    /// Name in the `SG_` line, of at most 32 characters in files with long names.
    pub short_name: String,
    /// Unit, as in the file.
    pub unit: String,
    /// What the file says about it; empty if nothing.
    pub comment: String,
    /// How its bits make a number.
    pub kind: RawKind,
    /// Physical value of one count.
    pub factor: f64,
    /// Physical value of zero counts.
    pub offset: f64,
    /// Physical range that the file gives; none if both ends are equal.
    pub range: Option<(f64, f64)>,
    /// When it is in the frame; `None` means always.
    pub selector: Option<Selector>,
    /// Names of raw values, in the file's order.
    pub labels: Vec<(i64, String)>,
    pub(super) field: Field,
}

/// When a multiplexed signal is in the frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selector {
    /// Position of the multiplexor in [`MessageDef::signals`].
    pub multiplexor: usize,
    /// Raw values of the multiplexor that select the signal, in order and without overlaps.
    pub values: Vec<RangeInclusive<u64>>,
}

/// A signal found in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalValue<'a> {
    /// Position in [`MessageDef::signals`].
    pub index: usize,
    /// Its definition.
    pub signal: &'a SignalDef,
    /// Its bits, right-aligned.
    pub bits: u64,
    /// Physical value, in the signal's unit.
    pub physical: f64,
}

impl<'a> SignalValue<'a> {
    /// The file's name for this raw value.
    #[must_use]
    pub fn label(&self) -> Option<&'a str> {
        let raw = self.signal.integer(self.bits)?;
        let found = self.signal.labels.iter().find(|(value, _)| *value == raw);
        found.map(|(_, label)| label.as_str())
    }
}

/// Why values cannot be put into a frame.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EncodeError {
    /// The message has no such signal.
    #[error("message {message} has no signal {signal}")]
    UnknownSignal {
        /// The message.
        message: String,
        /// The name.
        signal: String,
    },
    /// The value does not fit the signal's bits.
    #[error("{message}.{signal} cannot be {value}: its range is {low} to {high}")]
    OutOfRange {
        /// The message.
        message: String,
        /// The signal.
        signal: String,
        /// The value.
        value: f64,
        /// Lowest physical value of its bits.
        low: f64,
        /// Highest physical value of its bits.
        high: f64,
    },
    /// The multiplexors given select other signals than this one.
    #[error("{message}.{signal} is not in the frame: set {multiplexor} to a value that selects it")]
    NotSelected {
        /// The message.
        message: String,
        /// The signal.
        signal: String,
        /// Its multiplexor.
        multiplexor: String,
    },
    /// The message is longer than one frame.
    #[error("message {message} has {size} bytes, more than the largest frame")]
    TooLong {
        /// The message.
        message: String,
        /// Its bytes.
        size: usize,
    },
}

impl MessageDef {
    /// The signals that `data` holds, in the file's order.
    pub fn decode<'a>(&'a self, data: &'a [u8]) -> impl Iterator<Item = SignalValue<'a>> {
        self.signals
            .iter()
            .enumerate()
            .filter_map(move |(index, signal)| {
                let bits = signal.field.extract(data)?;
                let selected = self.is_selected(signal, data);
                selected.then(|| SignalValue {
                    index,
                    signal,
                    bits,
                    physical: signal.physical(bits),
                })
            })
    }

    /// Position of the signal with this name, or with this name in its `SG_` line.
    #[must_use]
    pub fn position(&self, signal: &str) -> Option<usize> {
        let signals = &self.signals;
        let own = signals.iter().position(|s| s.name == signal);
        own.or_else(|| signals.iter().position(|s| s.short_name == signal))
    }

    /// A frame with these physical values, each rounded to the nearest count; all other bits are
    /// zero.
    ///
    /// # Errors
    /// A name that the message does not have, a value that does not fit, or a signal that the
    /// multiplexors among the values do not select.
    pub fn encode(&self, values: &[(&str, f64)]) -> Result<CanFrame, EncodeError> {
        let mut data = [0; 64];
        let Some(data) = data.get_mut(..self.size) else {
            return Err(EncodeError::TooLong {
                message: self.name.clone(),
                size: self.size,
            });
        };
        let mut written = Vec::with_capacity(values.len());
        for (name, value) in values {
            let Some(index) = self.position(name) else {
                return Err(EncodeError::UnknownSignal {
                    message: self.name.clone(),
                    signal: (*name).to_owned(),
                });
            };
            let signal = &self.signals[index];
            let bits = signal.bits(*value).ok_or_else(|| {
                let (low, high) = signal.limits();
                EncodeError::OutOfRange {
                    message: self.name.clone(),
                    signal: signal.name.clone(),
                    value: *value,
                    low,
                    high,
                }
            })?;
            signal.field.insert(data, bits);
            written.push(index);
        }
        self.check_selection(&written, data)?;
        let flags = CanFlags {
            extended: self.extended,
            fd: self.fd || self.size > 8,
            ..CanFlags::default()
        };
        CanFrame::new(self.id, flags, data).ok_or_else(|| EncodeError::TooLong {
            message: self.name.clone(),
            size: self.size,
        })
    }

    fn check_selection(&self, written: &[usize], data: &[u8]) -> Result<(), EncodeError> {
        for index in written {
            let signal = &self.signals[*index];
            if let Some(selector) = &signal.selector
                && !self.is_selected(signal, data)
            {
                return Err(EncodeError::NotSelected {
                    message: self.name.clone(),
                    signal: signal.name.clone(),
                    multiplexor: self.signals[selector.multiplexor].name.clone(),
                });
            }
        }
        Ok(())
    }

    /// Whether the multiplexors in `data`, up to the outermost, select a signal. The loader has
    /// made sure that they form no ring.
    fn is_selected(&self, signal: &SignalDef, data: &[u8]) -> bool {
        let mut signal = signal;
        while let Some(selector) = &signal.selector {
            signal = &self.signals[selector.multiplexor];
            let Some(bits) = signal.field.extract(data) else {
                return false;
            };
            let after = selector.values.partition_point(|range| *range.end() < bits);
            if !selector
                .values
                .get(after)
                .is_some_and(|range| range.contains(&bits))
            {
                return false;
            }
        }
        true
    }
}

impl SignalDef {
    /// Number of bits.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.field.width
    }

    /// The integer that these bits stand for; `None` for floating-point signals.
    #[must_use]
    pub fn integer(&self, bits: u64) -> Option<i64> {
        match self.kind {
            RawKind::Unsigned => i64::try_from(bits).ok(),
            RawKind::Signed => Some(sign_extend(bits, self.field.width)),
            RawKind::Float | RawKind::Double => None,
        }
    }

    /// Physical value of these bits: raw value times factor plus offset.
    #[must_use]
    pub fn physical(&self, bits: u64) -> f64 {
        let raw = match self.kind {
            RawKind::Unsigned => bits as f64,
            RawKind::Signed => sign_extend(bits, self.field.width) as f64,
            RawKind::Float => f64::from(f32::from_bits(bits as u32)),
            RawKind::Double => f64::from_bits(bits),
        };
        raw * self.factor + self.offset
    }

    /// The bits of a physical value; `None` if they cannot hold it.
    #[must_use]
    pub fn bits(&self, physical: f64) -> Option<u64> {
        let raw = (physical - self.offset) / self.factor;
        match self.kind {
            RawKind::Float => Some(u64::from((raw as f32).to_bits())),
            RawKind::Double => Some(raw.to_bits()),
            RawKind::Unsigned | RawKind::Signed => {
                let raw = raw.round();
                let (low, high) = self.raw_limits();
                if !(low as f64..=high as f64).contains(&raw) {
                    return None;
                }
                // The casts saturate: a value rounded up to 2^63 or 2^64 becomes the highest one.
                Some(match self.kind {
                    RawKind::Signed => raw as i64 as u64,
                    _ => raw as u64,
                })
            }
        }
    }

    /// Lowest and highest physical value that the bits can hold.
    #[must_use]
    pub fn limits(&self) -> (f64, f64) {
        let (low, high) = match self.kind {
            RawKind::Float => (f64::from(f32::MIN), f64::from(f32::MAX)),
            RawKind::Double => (f64::MIN, f64::MAX),
            RawKind::Unsigned | RawKind::Signed => {
                let (low, high) = self.raw_limits();
                (low as f64, high as f64)
            }
        };
        let ends = [low, high].map(|raw| raw * self.factor + self.offset);
        (ends[0].min(ends[1]), ends[0].max(ends[1]))
    }

    const fn raw_limits(&self) -> (i128, i128) {
        let width = self.field.width;
        match self.kind {
            RawKind::Signed => (-(1 << (width - 1)), (1 << (width - 1)) - 1),
            _ => (0, (1 << width) - 1),
        }
    }
}
