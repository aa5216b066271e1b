//! Sensors of the steer angle of both front wheels.

use model::sensors::{Sensors, WheelAngles};
use sample::CanFrame;

use crate::can_bus::{Ticker, frame};
use crate::random::Noise;
use crate::{SimError, TruthState};

/// Identifier of the frame, and its length.
pub(crate) const WHEEL_ANGLES_FRAME: u32 = 0x208;
pub(crate) const WHEEL_ANGLES_BYTES: u8 = 4;
/// Resolution, degrees.
const STEP_DEG: f64 = 0.002;

/// Sensors of the left and the right front wheel.
pub(crate) struct WheelAngleSensors {
    /// Reading straight ahead, rad, and part of the angle that each sensor reads.
    sensors: [[f64; 2]; 2],
    noise_rad: f64,
    noise: Noise,
    ticker: Ticker,
}

impl WheelAngleSensors {
    /// The sensors of a sensors file; `None` if the file has none.
    pub(crate) fn new(sensors: &Sensors, seed: u64) -> Result<Option<Self>, SimError> {
        let Some(file) = &sensors.wheel_angles else {
            return Ok(None);
        };
        let WheelAngles {
            rate_hz,
            noise_rad,
            zero_error_rad,
            gain_error_fraction,
        } = *file;
        let mut drawn = Noise::new(seed, "wheel angles' zeros and gains");
        let sensors = [(); 2].map(|()| {
            [
                drawn.within(zero_error_rad),
                1.0 + drawn.within(gain_error_fraction),
            ]
        });
        Ok(Some(Self {
            sensors,
            noise_rad,
            noise: Noise::new(seed, "wheel angles"),
            ticker: Ticker::new("wheel_angles.rate_hz", rate_hz)?,
        }))
    }

    pub(crate) fn next_s(&self) -> f64 {
        self.ticker.next_s()
    }

    /// Zero, rad, and gain of each sensor as a calibration has them: angle = gain (reading - zero).
    pub(crate) fn calibration(&self) -> [[f64; 2]; 2] {
        self.sensors
            .map(|[zero_rad, part]| [zero_rad, part.recip()])
    }

    /// The frame of an instant; none where none is due.
    pub(crate) fn frame(&mut self, state: &TruthState) -> Option<CanFrame> {
        if !self.ticker.due(state.time_s) {
            return None;
        }
        let fields = [0, 1].map(|side| {
            let [zero_rad, part] = self.sensors[side];
            let angle_rad = state.wheels.0[side].steer_rad;
            let read_rad = zero_rad + part * angle_rad + self.noise.normal(self.noise_rad);
            let steps = read_rad.to_degrees() / STEP_DEG;
            let steps = if steps.is_finite() {
                (steps.round() as i16).max(i16::MIN + 1)
            } else {
                i16::MIN
            };
            Some(steps.cast_unsigned())
        });
        let [left, right] = fields;
        let mut frame = frame(WHEEL_ANGLES_FRAME, [left, right, None, None]);
        frame.len = WHEEL_ANGLES_BYTES;
        frame.data[usize::from(WHEEL_ANGLES_BYTES)..].fill(0);
        Some(frame)
    }
}
