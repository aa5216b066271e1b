//! Values of signals as counts of the chain that the sensors file describes.

use model::Error;
use model::sensors::{Potentiometers, StrainChain};
use model::strain::{ABSENT_COUNT, full_scale};
use sample::{Counts, StrainChannel};
use wire::dbc::{RawKind, SignalDef, SignalValue};

use crate::config::{StrainUnit, Travel, is_bending};

/// How the values of a signal become counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Conversion {
    /// They are counts.
    Counts,
    /// They are counts from the middle of the converter's range.
    Centred {
        /// Counts of the middle.
        zero: f64,
    },
    /// They have another unit.
    Scaled {
        /// Counts of the value 0.
        zero: f64,
        /// Counts of 1 in the unit of the signal.
        per_unit: f64,
        /// Counts of one step of the signal; 0 for a floating-point number.
        step: f32,
    },
    /// The sensors file does not say what they are.
    Unknown,
}

impl Conversion {
    /// Conversion of a strain channel's signal.
    ///
    /// # Errors
    /// When the sensors file does not have what the unit needs.
    pub fn of_strain(
        unit: StrainUnit,
        channel: StrainChannel,
        signal: &SignalDef,
        chain: Option<&StrainChain>,
    ) -> Result<Self, Error> {
        let zero = chain.map(|chain| full_scale(chain.adc_bits) / 2.0);
        let StrainUnit::Of(kind, factor) = unit else {
            return Ok(Self::of_counts(signal, zero));
        };
        let Some((chain, zero)) = chain.zip(zero) else {
            return Ok(Self::Unknown);
        };
        if chain.is_not_fitted() {
            return Err(Error::MissingField {
                field: "table [strain]",
            });
        }
        let per_unit = chain.counts_per_unit(kind, is_bending(channel))? * factor;
        let is_span = kind == model::strain::StrainSignal::Voltage && !is_signed(signal);
        Ok(Self::scaled(
            if is_span { 0.0 } else { zero },
            per_unit,
            signal,
        ))
    }

    /// Conversion of a travel's signal; `table` of the sensors file describes the potentiometers.
    ///
    /// # Errors
    /// When the sensors file does not have what the unit needs.
    pub fn of_travel(
        travel: Travel,
        signal: &SignalDef,
        pots: Option<&Potentiometers>,
    ) -> Result<Self, Error> {
        let scale = pots.map(Potentiometers::scale);
        let zero = scale.map(|scale| scale.zero_counts);
        if travel == Travel::Counts {
            return Ok(Self::of_counts(signal, zero));
        }
        let Some((pots, scale)) = pots.zip(scale) else {
            return Ok(Self::Unknown);
        };
        if pots.is_not_fitted() {
            return Err(Error::MissingField {
                field: "table of these potentiometers",
            });
        }
        Ok(match travel {
            Travel::Voltage(factor) => {
                let per_unit = pots.counts_per_volt()? * factor;
                let zero = if is_signed(signal) {
                    scale.zero_counts
                } else {
                    0.0
                };
                Self::scaled(zero, per_unit, signal)
            }
            Travel::Length(factor) => {
                Self::scaled(scale.zero_counts, scale.counts_per_unit * factor, signal)
            }
            Travel::Counts => Self::Counts,
        })
    }

    fn of_counts(signal: &SignalDef, zero: Option<f64>) -> Self {
        match zero.filter(|_| is_signed(signal)) {
            Some(zero) => Self::Centred { zero },
            None => Self::Counts,
        }
    }

    fn scaled(zero: f64, per_unit: f64, signal: &SignalDef) -> Self {
        let step = match signal.kind {
            RawKind::Unsigned | RawKind::Signed => (per_unit * signal.factor).abs() as f32,
            RawKind::Float | RawKind::Double => 0.0,
        };
        Self::Scaled {
            zero,
            per_unit,
            step,
        }
    }

    /// The counts of a value; `None` where the signal says that there is none.
    pub fn counts(&self, value: &SignalValue<'_>) -> Option<Counts> {
        let raw = |zero: f64| match value.signal.integer(value.bits) {
            Some(raw) => {
                let is_field = value.signal.kind == RawKind::Unsigned && value.signal.width() == 16;
                (!is_field || raw != i64::from(ABSENT_COUNT)).then(|| whole(raw, zero))
            }
            None => finite(value.physical + zero, 0.0),
        };
        match *self {
            Self::Counts => raw(0.0),
            Self::Centred { zero } => raw(zero),
            Self::Scaled {
                zero,
                per_unit,
                step,
            } => finite(zero + per_unit * value.physical, step),
            Self::Unknown => None,
        }
    }
}

/// Counts of a converter, which are of 32 bits; others are numbers without its limits.
fn whole(raw: i64, zero: f64) -> Counts {
    let counts = raw.saturating_add(zero as i64);
    i32::try_from(counts).map_or(
        Counts::Equivalent {
            counts: counts as f64,
            step: 1.0,
        },
        Counts::Converter,
    )
}

fn finite(counts: f64, step: f32) -> Option<Counts> {
    counts
        .is_finite()
        .then_some(Counts::Equivalent { counts, step })
}

/// Whether a signal can be negative.
fn is_signed(signal: &SignalDef) -> bool {
    match signal.kind {
        RawKind::Signed => true,
        RawKind::Unsigned => signal.offset < 0.0,
        RawKind::Float | RawKind::Double => signal.range.is_some_and(|(least, _)| least < 0.0),
    }
}
