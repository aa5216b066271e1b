//! Sensors of the inflation pressure of the tyres.

use sample::CanFrame;

use crate::can_bus::{Ticker, frame};
use crate::{Options, SimError};

/// Identifier of the frame.
pub(crate) const TYRE_PRESSURE_FRAME: u32 = 0x218;
pub(crate) const TYRE_PRESSURE_BYTES: u8 = 8;
/// Readings a second.
pub(crate) const TYRE_PRESSURE_HZ: f64 = 1.0;
/// Resolution, Pa.
const STEP_PA: f64 = 20.0;

/// A sensor in each wheel, without noise.
pub(crate) struct TyrePressureSensors {
    frame: CanFrame,
    ticker: Ticker,
}

impl TyrePressureSensors {
    /// The sensors of the options; `None` if the options have no pressures.
    pub(crate) fn new(options: &Options) -> Result<Option<Self>, SimError> {
        let Some(pressures_pa) = options.tyre_pressure_pa else {
            return Ok(None);
        };
        let steps = pressures_pa.map(|pressure_pa| Some((pressure_pa / STEP_PA).round() as u16));
        Ok(Some(Self {
            frame: frame(TYRE_PRESSURE_FRAME, steps),
            ticker: Ticker::new("tyre pressure", TYRE_PRESSURE_HZ)?,
        }))
    }

    pub(crate) fn next_s(&self) -> f64 {
        self.ticker.next_s()
    }

    /// The frame of an instant; none where none is due.
    pub(crate) fn frame(&mut self, time_s: f64) -> Option<CanFrame> {
        self.ticker.due(time_s).then(|| self.frame.clone())
    }
}
