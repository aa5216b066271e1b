//! What measures the steering wheel: an encoder, or potentiometers along the front tie rods.

use model::sensors::Sensors;
use model::strain::{ABSENT_COUNT, ChannelScale};
use model::vehicle::Vehicle;
use sample::CanFrame;

use crate::can_bus::{Ticker, frame};
use crate::corner::potentiometer_scale;
use crate::hidden::Hidden;
use crate::random::Noise;
use crate::{SimError, TruthState};

/// Identifier of the frame of the potentiometers along the tie rods, and its length.
pub(crate) const ENCODER_FRAME: u32 = 0x200;
pub(crate) const RODS_FRAME: u32 = 0x204;
pub(crate) const RODS_FRAME_BYTES: u8 = 4;

/// The device that measures the steering wheel.
pub(crate) struct SteeringSensor {
    /// What the device reads straight ahead, rad.
    offset_rad: f64,
    noise: Noise,
    ticker: Ticker,
    device: Device,
}

enum Device {
    /// Encoder of the steering wheel with this standard deviation, rad.
    Encoder(f64),
    /// Potentiometers along the left and the right tie rod, whose inner ends travel with the rack.
    Rods {
        scale: ChannelScale,
        /// Level at zero beside the middle of the converter, left and right, counts.
        offset_counts: [f64; 2],
        noise_counts: f64,
        rack_m_rad: f64,
    },
}

impl SteeringSensor {
    /// The device of a sensors file; `None` if the file has none.
    pub(crate) fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        hidden: &Hidden,
        seed: u64,
    ) -> Result<Option<Self>, SimError> {
        let make = |name, rate_field, rate_hz, device| {
            Ok(Some(Self {
                offset_rad: hidden.steer_offset_rad,
                noise: Noise::new(seed, name),
                ticker: Ticker::new(rate_field, rate_hz)?,
                device,
            }))
        };
        if let Some(encoder) = &sensors.steer {
            let device = Device::Encoder(encoder.noise_rad);
            return make("steer", "steer.rate_hz", encoder.rate_hz, device);
        }
        let Some(pots) = &sensors.steer_potentiometers else {
            return Ok(None);
        };
        let rack_m_rad = vehicle.steering.rack_m_rad.ok_or_else(|| {
            SimError::Model(model::Error::MissingPart {
                vehicle: vehicle.name.clone(),
                part: "steering.rack_m_rad",
                model: "potentiometers along the tie rods",
            })
        })?;
        let mut zeros = Noise::new(seed, "steer potentiometers' zeros");
        let device = Device::Rods {
            scale: potentiometer_scale("steer_potentiometers", pots)?,
            offset_counts: [(); 2].map(|()| zeros.within(pots.zero_error_counts)),
            noise_counts: pots.noise_counts,
            rack_m_rad,
        };
        let field = "steer_potentiometers.rate_hz";
        make("steer potentiometers", field, pots.rate_hz, device)
    }

    pub(crate) fn next_s(&self) -> f64 {
        self.ticker.next_s()
    }

    /// What the device reads straight ahead, as an angle of the steering wheel, rad.
    pub(crate) fn offset_rad(&self) -> f64 {
        let of_zeros = match &self.device {
            Device::Encoder(_) => 0.0,
            Device::Rods {
                scale,
                offset_counts: [left, right],
                rack_m_rad,
                ..
            } => 0.5 * (left + right) / scale.counts_per_unit / rack_m_rad,
        };
        self.offset_rad + of_zeros
    }

    /// The frame of an instant; none where none is due.
    pub(crate) fn frame(&mut self, state: &TruthState) -> Option<CanFrame> {
        if !self.ticker.due(state.time_s) {
            return None;
        }
        let angle_rad = state.steering_wheel_rad + self.offset_rad;
        let noise = &mut self.noise;
        Some(match &self.device {
            Device::Encoder(sigma_rad) => encoder_frame(angle_rad + noise.normal(*sigma_rad)),
            Device::Rods {
                scale,
                offset_counts,
                noise_counts,
                rack_m_rad,
            } => {
                let level = scale.level(rack_m_rad * angle_rad);
                let [left, right] = offset_counts.map(|offset| {
                    let count = scale.convert(level + offset + noise.normal(*noise_counts));
                    Some(if level.is_finite() {
                        count
                    } else {
                        ABSENT_COUNT
                    })
                });
                let mut frame = frame(RODS_FRAME, [left, right, None, None]);
                frame.len = RODS_FRAME_BYTES;
                frame.data[usize::from(RODS_FRAME_BYTES)..].fill(0);
                frame
            }
        })
    }
}

/// Steering wheel, 0.01 degree.
fn encoder_frame(angle_rad: f64) -> CanFrame {
    let hundredths = if angle_rad.is_finite() {
        (angle_rad.to_degrees() * 100.0).round() as i32
    } else {
        i32::MIN
    };
    let mut frame = frame(ENCODER_FRAME, [Some(0); 4]);
    frame.data[..4].copy_from_slice(&hundredths.to_le_bytes());
    frame
}
