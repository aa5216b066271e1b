//! The CAN bus: four strain boxes, wheel speeds, steering wheel and hub accelerometers.

use model::sensors::{HubAcceleration, Sensors};
use model::strain::ABSENT_COUNT;
use model::vehicle::Vehicle;
use sample::{CanFlags, CanFrame, FrameData, PerWheel, StrainChannel, Wheel};

use crate::corner::Corner;
use crate::emission::{Emission, Output, Port};
use crate::hidden::Hidden;
use crate::hub::HubAccelerometer;
use crate::random::Noise;
use crate::steering::{ENCODER_FRAME, RODS_FRAME, RODS_FRAME_BYTES, SteeringSensor};
use crate::tyre_pressure::{TYRE_PRESSURE_BYTES, TYRE_PRESSURE_FRAME, TyrePressureSensors};
use crate::wheel_angles::{WHEEL_ANGLES_BYTES, WHEEL_ANGLES_FRAME, WheelAngleSensors};
use crate::{Motion, Options, SimError};

/// Strain boxes by corner (thesis Table 3.2; its second "rear left" is the rear right).
const BOX: PerWheel<u32> = PerWheel([1, 3, 4, 5]);

/// First identifier of the hub accelerometers' frames; 16 times the number of the corner's box is added.
/// They are behind all others, so that hub accelerometers delay no other frame of the same instant.
const HUB_FRAMES: u32 = 0x300;

/// Length of a hub accelerometer's frame.
pub(crate) const HUB_FRAME_BYTES: u8 = 6;

/// Time from a box's conversion to its frame's claim on the bus, s.
const BOX_LATENCY_S: f64 = 200e-6;
/// Mean of the random part of that time, s.
const BOX_JITTER_S: f64 = 20e-6;
/// Identifier of the wheel speeds.
const WHEEL_SPEED_FRAME: u32 = 0x210;

/// The bus and all devices on it.
pub(crate) struct CanBus {
    corners: [Corner; 4],
    hubs: Option<Hubs>,
    noise_wheel_speed: Noise,
    noise_bus: Noise,
    wheel_noise_fraction: f64,
    bit_time_s: f64,
    boxes: Ticker,
    steering: Option<SteeringSensor>,
    wheel_angles: Option<WheelAngleSensors>,
    tyre_pressure: Option<TyrePressureSensors>,
    wheel_speed: Ticker,
    /// Converter instants of the potentiometers.
    deflection: Ticker,
    free_at_s: f64,
    end_s: f64,
}

/// The hub accelerometers of all wheels.
struct Hubs {
    sensors: [HubAccelerometer; 4],
    ticker: Ticker,
    noise_bus: Noise,
}

impl Hubs {
    fn new(
        motion: &Motion,
        vehicle: &Vehicle,
        hub: &HubAcceleration,
        options: &Options,
        seed: u64,
    ) -> Result<Self, SimError> {
        let sensor =
            |wheel| HubAccelerometer::new(wheel, motion, vehicle, hub, &options.faults, seed);
        let [fl, fr, rl, rr] = Wheel::ALL;
        Ok(Self {
            sensors: [sensor(fl)?, sensor(fr)?, sensor(rl)?, sensor(rr)?],
            ticker: Ticker::new("hub_acceleration.rate_hz", hub.rate_hz)?,
            noise_bus: Noise::new(seed, "can0 hub accelerometers"),
        })
    }

    /// The frames of an instant; none where none is due.
    fn frames(&mut self, motion: &Motion, time_s: f64) -> Vec<CanFrame> {
        if !self.ticker.due(time_s) {
            return Vec::new();
        }
        let sensors = self.sensors.iter_mut().zip(BOX.0);
        sensors
            .map(|(sensor, number)| {
                let [x, y, z] = sensor.counts(motion, time_s);
                let mut frame = frame(HUB_FRAMES + 16 * number, [x, y, z, None]);
                frame.len = HUB_FRAME_BYTES;
                frame.data[usize::from(HUB_FRAME_BYTES)..].fill(0);
                frame
            })
            .collect()
    }
}

impl CanBus {
    pub(crate) fn new(
        motion: &Motion,
        vehicle: &Vehicle,
        sensors: &Sensors,
        options: &Options,
        hidden: &Hidden,
        seed: u64,
    ) -> Result<Self, SimError> {
        let corner = |wheel| Corner::new(wheel, motion, vehicle, sensors, options, hidden, seed);
        let [fl, fr, rl, rr] = Wheel::ALL;
        Ok(Self {
            corners: [corner(fl)?, corner(fr)?, corner(rl)?, corner(rr)?],
            hubs: (sensors.hub_acceleration.as_ref())
                .map(|hub| Hubs::new(motion, vehicle, hub, options, seed))
                .transpose()?,
            noise_wheel_speed: Noise::new(seed, "wheel speed"),
            noise_bus: Noise::new(seed, "can0"),
            wheel_noise_fraction: sensors.wheel_speed.noise_fraction,
            bit_time_s: period_s_of("can_bit_rate", f64::from(options.can_bit_rate(sensors)))?,
            boxes: Ticker::new("strain.rate_hz", sensors.strain.rate_hz)?,
            deflection: Ticker::new("deflection.rate_hz", sensors.deflection.rate_hz)?,
            steering: SteeringSensor::new(vehicle, sensors, hidden, seed)?,
            wheel_angles: WheelAngleSensors::new(sensors, seed)?,
            tyre_pressure: TyrePressureSensors::new(options)?,
            wheel_speed: Ticker::new("wheel_speed.rate_hz", sensors.wheel_speed.rate_hz)?,
            free_at_s: 0.0,
            end_s: motion.duration_s(),
        })
    }

    /// Turn and bias of each hub accelerometer, where there are some.
    pub(crate) fn hubs(&self) -> Option<[([f64; 3], [f64; 3]); 4]> {
        let hubs = self.hubs.as_ref()?;
        Some(hubs.sensors.each_ref().map(HubAccelerometer::truth))
    }

    /// What the device of the steering wheel reads straight ahead, rad.
    pub(crate) fn steer_offset_rad(&self) -> f64 {
        let sensor = self.steering.as_ref();
        sensor.map_or(0.0, SteeringSensor::offset_rad)
    }

    /// Zero, rad, and gain of each sensor of a front wheel's angle, where there are some.
    pub(crate) fn wheel_angles(&self) -> Option<[[f64; 2]; 2]> {
        let sensors = self.wheel_angles.as_ref();
        sensors.map(WheelAngleSensors::calibration)
    }

    /// Counts at zero of each corner's channels.
    pub(crate) fn zeros(&self) -> [([Option<f64>; StrainChannel::COUNT], f64); 4] {
        std::array::from_fn(|i| self.corners[i].zeros())
    }

    /// The frames of the next instant, in the order in which they win the bus; none at the end.
    pub(crate) fn produce(&mut self, motion: &Motion) -> Vec<Emission> {
        let hubs = self.hubs.as_ref().map(|hubs| &hubs.ticker);
        let time_s = [&self.boxes, &self.deflection, &self.wheel_speed]
            .into_iter()
            .chain(hubs)
            .map(Ticker::next_s)
            .chain(self.steering.as_ref().map(SteeringSensor::next_s))
            .chain(self.wheel_angles.as_ref().map(WheelAngleSensors::next_s))
            .chain(self.tyre_pressure.as_ref().map(TyrePressureSensors::next_s))
            .fold(f64::INFINITY, f64::min);
        if time_s > self.end_s {
            return Vec::new();
        }
        let state = motion.at(time_s);
        let mut frames = Vec::new();
        let with_deflection = self.deflection.due(time_s);
        if self.boxes.due(time_s) {
            for (corner, number) in self.corners.iter_mut().zip(BOX.0) {
                let strain = corner.strain(motion, time_s);
                let deflection = corner.deflection(&state).filter(|_| with_deflection);
                let [uf, ur, lf, lr, tie, front, rear] = strain;
                frames.push(frame(0x100 + 16 * number, [uf, ur, lf, lr]));
                frames.push(frame(0x101 + 16 * number, [tie, deflection, front, rear]));
            }
        } else if with_deflection {
            for (corner, number) in self.corners.iter_mut().zip(BOX.0) {
                let deflection = corner.deflection(&state);
                frames.push(frame(0x101 + 16 * number, [None, deflection, None, None]));
            }
        }
        let steering = self.steering.as_mut();
        frames.extend(steering.and_then(|sensor| sensor.frame(&state)));
        let angles = self.wheel_angles.as_mut();
        frames.extend(angles.and_then(|sensors| sensors.frame(&state)));
        let pressures = self.tyre_pressure.as_mut();
        frames.extend(pressures.and_then(|sensors| sensors.frame(time_s)));
        if self.wheel_speed.due(time_s) {
            let (noise, sigma) = (&mut self.noise_wheel_speed, self.wheel_noise_fraction);
            let speeds = state
                .wheels
                .0
                .map(|wheel| wheel.angular_speed_rad_s * (1.0 + noise.normal(sigma)));
            frames.push(wheel_speed_frame(speeds));
            frames.extend(state.hitch_force_n.map(hitch_frame));
        }
        frames.sort_by_key(|frame| frame.id);
        let mut sent = Vec::with_capacity(frames.len() + Wheel::ALL.len());
        if !frames.is_empty() {
            let claim_s = time_s + BOX_LATENCY_S + self.noise_bus.delay(BOX_JITTER_S);
            sent.extend(self.send(claim_s, frames));
        }
        let hubs = self.hubs.as_mut().map(|hubs| {
            let frames = hubs.frames(motion, time_s);
            (
                frames,
                time_s + BOX_LATENCY_S + hubs.noise_bus.delay(BOX_JITTER_S),
            )
        });
        if let Some((frames, claim_s)) = hubs {
            sent.extend(self.send(claim_s, frames));
        }
        sent
    }

    /// Puts frames on the bus one after another.
    fn send(&mut self, claim_s: f64, frames: Vec<CanFrame>) -> Vec<Emission> {
        frames
            .into_iter()
            .map(|frame| {
                let bits_s = frame_bits(frame.len) * self.bit_time_s;
                self.free_at_s = self.free_at_s.max(claim_s) + bits_s;
                Emission {
                    time_s: self.free_at_s,
                    port: Port::Can0,
                    output: Output::Can(frame),
                }
            })
            .collect()
    }
}

/// Mean time from the sampling instant of each message to the end of its frame, s, by identifier, at an
/// instant at which all devices send.
pub fn frame_latencies_s(sensors: &Sensors, options: &Options) -> Vec<(u32, f64)> {
    let strain = BOX.0.map(|number| 0x100 + 16 * number);
    let mut frames: Vec<(u32, u8)> = strain
        .iter()
        .flat_map(|id| [(*id, 8), (id + 1, 8)])
        .collect();
    if sensors.steer.is_some() {
        frames.push((ENCODER_FRAME, 8));
    } else if sensors.steer_potentiometers.is_some() {
        frames.push((RODS_FRAME, RODS_FRAME_BYTES));
    }
    if sensors.wheel_angles.is_some() {
        frames.push((WHEEL_ANGLES_FRAME, WHEEL_ANGLES_BYTES));
    }
    frames.push((WHEEL_SPEED_FRAME, 8));
    if options.tyre_pressure_pa.is_some() {
        frames.push((TYRE_PRESSURE_FRAME, TYRE_PRESSURE_BYTES));
    }
    if sensors.hub_acceleration.is_some() {
        frames.extend(
            BOX.0
                .map(|number| (HUB_FRAMES + 16 * number, HUB_FRAME_BYTES)),
        );
    }
    let bit_time_s = 1.0 / f64::from(options.can_bit_rate(sensors));
    let mut end_s = BOX_LATENCY_S + BOX_JITTER_S;
    let on_bus = frames.into_iter().map(|(id, bytes)| {
        end_s += frame_bits(bytes) * bit_time_s;
        (id, end_s)
    });
    on_bus.collect()
}

/// Bits of a frame on the bus: 47 beside the data, and on average one stuff bit in ten.
pub(crate) fn frame_bits(bytes: u8) -> f64 {
    (47.0 + 8.0 * f64::from(bytes)) * 1.1
}

/// A frame of four 16-bit fields, least significant byte first.
pub(crate) fn frame(id: u32, fields: [Option<u16>; 4]) -> CanFrame {
    let mut data = FrameData::zeros(8);
    for (bytes, field) in data.chunks_exact_mut(2).zip(fields) {
        bytes.copy_from_slice(&field.unwrap_or(ABSENT_COUNT).to_le_bytes());
    }
    CanFrame {
        id,
        flags: CanFlags::default(),
        len: 8,
        data,
        len8_dlc: 0,
        kernel_ns: None,
        hardware_ns: None,
    }
}

/// Wheel speeds, 0.01 rad/s.
fn wheel_speed_frame(speeds_rad_s: [f64; 4]) -> CanFrame {
    let field = |speed: f64| {
        if speed.is_finite() {
            (speed * 100.0).round() as i16
        } else {
            i16::MIN
        }
    };
    frame(
        WHEEL_SPEED_FRAME,
        speeds_rad_s.map(|speed| Some(field(speed).cast_unsigned())),
    )
}

/// Force of a load on the hitch, N.
fn hitch_frame(force_n: [f64; 3]) -> CanFrame {
    let [x, y, z] = force_n.map(|n| Some((n.round() as i16).cast_unsigned()));
    frame(0x220, [x, y, z, None])
}

/// Instants at a fixed rate, the first at zero.
pub(crate) struct Ticker {
    period_s: f64,
    count: u64,
}

impl Ticker {
    pub(crate) fn new(name: &str, rate_hz: f64) -> Result<Self, SimError> {
        Ok(Self {
            period_s: period_if_fitted_s(name, rate_hz)?,
            count: 0,
        })
    }

    /// The next instant, s; not a number for a device that is not fitted.
    pub(crate) fn next_s(&self) -> f64 {
        self.count as f64 * self.period_s
    }

    /// Whether an instant is due at `time_s`; if so, moves on.
    pub(crate) fn due(&mut self, time_s: f64) -> bool {
        let due = self.next_s() <= time_s + 1e-6;
        self.count += u64::from(due);
        due
    }
}

/// The interval of a device's messages; infinite for a device that is not fitted, whose rate is 0.
pub(crate) fn period_if_fitted_s(name: &str, rate_hz: f64) -> Result<f64, SimError> {
    if rate_hz == 0.0 {
        return Ok(f64::INFINITY);
    }
    period_s(name, rate_hz)
}

/// The interval of a message rate.
pub(crate) fn period_s(name: &str, rate_hz: f64) -> Result<f64, SimError> {
    if rate_hz <= 10_000.0 {
        period_s_of(name, rate_hz)
    } else {
        Err(SimError::BadParameter {
            name: name.to_owned(),
            value: rate_hz,
            expected: "at most 10000 Hz",
        })
    }
}

/// The reciprocal of a number that must be above zero.
pub(crate) fn period_s_of(name: &str, rate_hz: f64) -> Result<f64, SimError> {
    if rate_hz > 0.0 {
        Ok(1.0 / rate_hz)
    } else {
        Err(SimError::BadParameter {
            name: name.to_owned(),
            value: rate_hz,
            expected: "above 0",
        })
    }
}
