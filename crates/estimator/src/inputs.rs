//! The last valid reading of each channel, with calibration applied.

use nalgebra::Vector3;
use sample::{
    CornerSample, Counts, HubAccelerationSample, LogTime, PerWheel, StrainChannel, Wheel,
};

use crate::calibration::range::{BeyondRange, CountRange};
use crate::calibration::{Channel, CornerChannels, HubSensor, Resolved};
use crate::grid::GRID_S;

/// Position of the spring potentiometer among a corner's channels, after the strain channels.
pub const POTENTIOMETER: usize = StrainChannel::COUNT;

/// Names of a hub accelerometer's axes in events.
const HUB_CHANNELS: [&str; 3] = [
    "hub acceleration x",
    "hub acceleration y",
    "hub acceleration z",
];

/// Repeats of a channel's reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Liveness {
    /// The last reading: counts, or the bits of a number.
    reading: u64,
    repeats: u32,
    /// Repeats after which the channel is frozen; `None` if its noise allows many.
    frozen_after: Option<u32>,
    reported: bool,
}

impl Liveness {
    fn frozen(self) -> bool {
        self.frozen_after
            .is_some_and(|repeats| self.repeats >= repeats)
    }

    /// Takes a reading; whether the channel is alive.
    fn is_alive(&mut self, reading: u64, frozen_after: Option<u32>) -> bool {
        self.repeats = if reading == self.reading {
            self.repeats.saturating_add(1)
        } else {
            0
        };
        self.reading = reading;
        self.frozen_after = frozen_after;
        !self.frozen()
    }

    /// The channel's value; `None` while its counts are frozen.
    fn take(&mut self, counts: Counts, channel: &Channel) -> Option<f64> {
        let reading = match counts {
            Counts::Converter(counts) => bits_of(counts),
            Counts::Equivalent { counts, .. } => counts.to_bits(),
        };
        let alive = self.is_alive(reading, channel.frozen_after(counts));
        alive.then(|| channel.value(counts)).flatten()
    }

    /// The change of the channel since the last call, if it froze or changed again.
    fn change(&mut self, frozen: bool) -> Option<bool> {
        let changed = frozen != self.reported;
        self.reported = frozen;
        changed.then_some(frozen)
    }
}

fn bits_of(counts: i32) -> u64 {
    u64::from(counts.cast_unsigned())
}

/// A channel that froze or changed again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrozenChange {
    /// Which corner.
    pub wheel: Wheel,
    /// Name of the channel.
    pub channel: &'static str,
    /// Frozen from now on.
    pub frozen: bool,
}

/// A channel whose counts are beyond the range of the sensors file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeFault {
    /// Which corner.
    pub wheel: Wheel,
    /// Strain channel; `None` for the potentiometer.
    pub channel: Option<StrainChannel>,
    /// The counts.
    pub beyond: BeyondRange,
}

/// When a sample was true, and its message, if the latency of the message is not known.
#[derive(Clone, Copy, Debug)]
pub struct Stamp {
    /// Time of validity.
    pub time: LogTime,
    /// Place of the message among those with unknown latencies.
    pub stream: Option<u8>,
}

impl From<LogTime> for Stamp {
    fn from(time: LogTime) -> Self {
        Self { time, stream: None }
    }
}

/// A value and when it was true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Value, SI.
    pub value: f64,
    /// When it was true.
    pub time: LogTime,
    /// Whether a filter has used it.
    pub taken: bool,
    /// Number of readings whose mean it is.
    pub count: u32,
    /// Its message, if the latency of the message is not known.
    pub stream: Option<u8>,
}

impl Reading {
    /// The value, if it is at most `fresh_s` old.
    #[must_use]
    pub fn fresh(self, now: LogTime, fresh_s: f64) -> Option<f64> {
        (now.seconds_since(self.time) <= fresh_s).then_some(self.value)
    }
}

/// Readings of one corner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CornerReadings {
    /// Strain channels: axial tension in N, bending in N m.
    pub strain: [Option<Reading>; StrainChannel::COUNT],
    /// Compression of the strut from its design length, m.
    pub compression_m: Option<Reading>,
}

/// Last readings of all channels.
#[derive(Clone, Debug, Default)]
pub struct Readings {
    /// Strain and deflection.
    pub corners: PerWheel<CornerReadings>,
    /// Steering-wheel angle, left positive, rad.
    pub steering_wheel_rad: Option<Reading>,
    /// Measured steer angle of the left and the right front wheel against the chassis, left positive, rad.
    pub wheel_angle_rad: [Option<Reading>; 2],
    /// Specific force along the axes of each hub accelerometer, sensor axes, biases removed, m/s^2.
    /// [`HubSensor`](crate::calibration::HubSensor) has the axes' directions.
    pub hub_acceleration_m_s2: PerWheel<[Option<Reading>; 3]>,
    /// Force of a load on the hitch, vehicle axes, N, and when it was measured.
    pub hitch_n: Option<(LogTime, [f64; 3])>,
    /// Last drive and brake torque of each wheel, N m.
    pub torque_n_m: [[Option<Reading>; 4]; 2],
    /// Wheel speeds, rad/s.
    pub wheel_speed_rad_s: PerWheel<Option<Reading>>,
    /// Wheel speeds that a monitor has found faulty.
    pub wheel_speed_faulty: [bool; 4],
    liveness: [[Liveness; POTENTIOMETER + 1]; 4],
    /// Counts of each channel, and whether it was reported that they are beyond the range.
    ranges: PerWheel<[(CountRange, bool); POTENTIOMETER + 1]>,
    hub_liveness: PerWheel<[Liveness; 3]>,
}

impl Readings {
    /// Takes the counts of a corner. Counts of dead channels and of saturated converters are
    /// ignored.
    pub fn push_corner(
        &mut self,
        stamp: Stamp,
        corner: &CornerSample,
        channels: &CornerChannels,
        use_strain: bool,
        use_deflection: bool,
    ) {
        let readings = &mut self.corners[corner.wheel];
        let liveness = &mut self.liveness[corner.wheel.index()];
        let ranges = &mut self.ranges[corner.wheel];
        if use_strain {
            for (i, counts) in corner.strain_counts.iter().enumerate() {
                if let Some(counts) = counts {
                    ranges[i].0.push(*counts, channels.strain[i].adc_bits);
                }
                let value = counts.and_then(|counts| liveness[i].take(counts, &channels.strain[i]));
                gather(&mut readings.strain[i], stamp, value);
            }
        }
        if use_deflection {
            if let Some(counts) = corner.deflection_counts {
                let bits = channels.deflection.adc_bits;
                ranges[POTENTIOMETER].0.push(counts, bits);
            }
            let value = corner
                .deflection_counts
                .and_then(|counts| liveness[POTENTIOMETER].take(counts, &channels.deflection));
            gather(&mut readings.compression_m, stamp, value);
        }
    }

    /// Reports the channels that froze or changed again since the last call.
    pub fn frozen_changes(&mut self, calibration: &Resolved, out: &mut impl FnMut(FrozenChange)) {
        for wheel in Wheel::ALL {
            let mut report = |channel, change: Option<bool>| {
                if let Some(frozen) = change {
                    out(FrozenChange {
                        wheel,
                        channel,
                        frozen,
                    });
                }
            };
            let corner = &calibration.corners[wheel];
            for (i, liveness) in self.liveness[wheel.index()].iter_mut().enumerate() {
                let channel = corner.strain.get(i).unwrap_or(&corner.deflection);
                let name = StrainChannel::ALL.get(i).map_or("deflection", |c| c.name());
                let frozen = liveness.frozen() && !channel.dead;
                report(name, liveness.change(frozen));
            }
            if calibration.hubs[wheel].is_none() {
                continue;
            }
            for (liveness, name) in self.hub_liveness[wheel].iter_mut().zip(HUB_CHANNELS) {
                report(name, liveness.change(liveness.frozen()));
            }
        }
    }

    /// Reports the channels whose counts are beyond the range of the sensors file, each once: the range is
    /// the same for the whole recording.
    pub fn range_faults(&mut self, calibration: &Resolved, out: &mut impl FnMut(RangeFault)) {
        for wheel in Wheel::ALL {
            let corner = &calibration.corners[wheel];
            for (i, (range, is_reported)) in self.ranges[wheel].iter_mut().enumerate() {
                let channel = StrainChannel::ALL.get(i).copied();
                let (known, field) = match channel {
                    Some(_) => (&corner.strain[i], "strain.adc_bits"),
                    None => (&corner.deflection, "deflection.adc_bits"),
                };
                if *is_reported || known.dead {
                    continue;
                }
                if let Some(beyond) = range.beyond(field, known.adc_bits) {
                    *is_reported = true;
                    out(RangeFault {
                        wheel,
                        channel,
                        beyond,
                    });
                }
            }
        }
    }

    /// Time of the last reading of a strain channel, a potentiometer or a hub accelerometer.
    #[must_use]
    pub fn suspension_time(&self) -> Option<LogTime> {
        let corners = self.corners.0.iter();
        let read = corners.flat_map(|corner| corner.strain.iter().chain([&corner.compression_m]));
        let hubs = self.hub_acceleration_m_s2.0.iter().flatten();
        read.chain(hubs).flatten().map(|reading| reading.time).max()
    }

    /// Drive and brake torques that are at most `fresh_s` old at `now`, N m; `NaN` where there is none.
    #[must_use]
    pub fn torques_n_m(&self, now: LogTime, fresh_s: f64) -> [[f64; 4]; 2] {
        let fresh = |held: Option<Reading>| held.and_then(|reading| reading.fresh(now, fresh_s));
        self.torque_n_m
            .map(|kind| kind.map(|held| fresh(held).unwrap_or(f64::NAN)))
    }

    /// Takes the angular speed of one wheel.
    pub fn push_wheel_speed(&mut self, time: LogTime, wheel: Wheel, speed_rad_s: f64) {
        let good = (speed_rad_s.abs() < 1000.0).then_some(speed_rad_s);
        replace(&mut self.wheel_speed_rad_s[wheel], time.into(), good);
    }

    /// Takes drive and brake torques of the wheels, N m; `NaN` where there is none.
    pub fn push_torques(&mut self, time: LogTime, torques_n_m: &[[f64; 4]; 2]) {
        let held = self.torque_n_m.iter_mut().flatten();
        for (held, torque) in held.zip(torques_n_m.iter().flatten()) {
            if torque.is_finite() {
                replace(held, time.into(), Some(*torque));
            }
        }
    }

    /// Angular speed of a wheel, rad/s, if it is at most `fresh_s` old at `now` and not faulty.
    #[must_use]
    pub fn wheel_speed(&self, wheel: Wheel, now: LogTime, fresh_s: f64) -> Option<f64> {
        let reading =
            self.wheel_speed_rad_s[wheel].filter(|_| !self.wheel_speed_faulty[wheel.index()]);
        reading.and_then(|reading| reading.fresh(now, fresh_s))
    }

    /// Takes the readings of a hub accelerometer. Returns those of the axes that are alive, sensor axes,
    /// biases removed, m/s^2.
    pub fn push_hub_acceleration(
        &mut self,
        stamp: Stamp,
        hub: &HubAccelerationSample,
        sensor: &HubSensor,
    ) -> [Option<f64>; 3] {
        let mut axes = sensor.unbiased(hub.specific_force_m_s2);
        for (axis, liveness) in self.hub_liveness[hub.wheel].iter_mut().enumerate() {
            let number = hub.specific_force_m_s2[axis].map(f64::to_bits);
            let reading = hub.counts[axis].map(bits_of).or(number);
            let alive = reading.is_none_or(|bits| liveness.is_alive(bits, sensor.frozen_after));
            if !alive {
                axes[axis] = None;
            }
            let slot = &mut self.hub_acceleration_m_s2[hub.wheel][axis];
            gather(slot, stamp, axes[axis]);
        }
        axes
    }

    /// Takes steer angles of the front wheels, calibration applied, rad; `NaN` where there is none.
    pub fn push_wheel_angles(&mut self, time: LogTime, angles_rad: &[f64; 2]) {
        for (held, angle) in self.wheel_angle_rad.iter_mut().zip(angles_rad) {
            replace(held, time.into(), (angle.abs() < 1.5).then_some(*angle));
        }
    }

    /// Takes a steering-wheel angle.
    pub fn push_steering_wheel(&mut self, time: LogTime, angle_rad: f64) {
        let good = (angle_rad.abs() < 50.0).then_some(angle_rad);
        replace(&mut self.steering_wheel_rad, time.into(), good);
    }
}

/// Replaces an earlier value by a later one.
fn replace(slot: &mut Option<Reading>, stamp: Stamp, value: Option<f64>) {
    let Stamp { time, stream } = stamp;
    let Some(value) = value.filter(|value| value.is_finite()) else {
        return;
    };
    if slot.is_none_or(|held| time > held.time) {
        *slot = Some(Reading {
            value,
            time,
            taken: false,
            count: 1,
            stream,
        });
    }
}

/// Takes a value into the mean of those of the same step that no filter has used.
fn gather(slot: &mut Option<Reading>, stamp: Stamp, value: Option<f64>) {
    let Stamp { time, stream } = stamp;
    let waiting = slot.filter(|held| {
        let since_s = time.seconds_since(held.time);
        !held.taken && since_s > 0.0 && since_s < 0.6 * GRID_S
    });
    let (Some(held), Some(value)) = (waiting, value.filter(|value| value.is_finite())) else {
        return replace(slot, stamp, value);
    };
    let count = held.count.saturating_add(1);
    let part = 1.0 / f64::from(count);
    *slot = Some(Reading {
        value: held.value + part * (value - held.value),
        time: held
            .time
            .offset_seconds(part * time.seconds_since(held.time)),
        taken: false,
        count,
        stream,
    });
}

/// The three numbers, if all are finite.
#[must_use]
pub fn finite3(values: [f64; 3]) -> Option<Vector3<f64>> {
    values
        .iter()
        .all(|value| value.is_finite())
        .then(|| Vector3::from(values))
}
