//! A recording as columns: what the steps of a calibration take.

use std::collections::BTreeMap;

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{ImuSample, LogTime, Measurement, PerWheel, Sample, StrainChannel, Wheel};

use super::imu::{ImuSignal, Lean, Leaning};
use super::rest::{self, Signal, Stretch};
use super::{RecordingError, Resolved};

/// Values and their times of validity, s from the start of the log.
#[derive(Debug, Default)]
pub struct Column {
    time_s: Vec<f64>,
    value: Vec<f64>,
}

impl Column {
    fn push(&mut self, time_s: f64, value: f64) {
        // A time that decreases, after a correction of a clock, is ignored to keep the order.
        if self.time_s.last().is_none_or(|last| time_s > *last) {
            self.time_s.push(time_s);
            self.value.push(value);
        }
    }

    /// View for the functions of the estimator.
    pub fn signal(&self) -> Signal<'_> {
        Signal {
            time_s: &self.time_s,
            value: &self.value,
        }
    }

    /// Replaces each value by another, in order.
    pub(crate) fn map(&mut self, mut of: impl FnMut(f64) -> f64) {
        for value in &mut self.value {
            *value = of(*value);
        }
    }

    /// Value at a time on the line between the readings beside it; `None` in a gap of more than `gap_s`.
    pub(crate) fn at(&self, time_s: f64, gap_s: f64) -> Option<f64> {
        let after = self.time_s.partition_point(|&known_s| known_s < time_s);
        let (to_s, to) = (*self.time_s.get(after)?, *self.value.get(after)?);
        if to_s == time_s {
            return Some(to);
        }
        let before = after.checked_sub(1)?;
        let (from_s, from) = (self.time_s[before], self.value[before]);
        let part = (time_s - from_s) / (to_s - from_s);
        (to_s - from_s <= gap_s).then_some(from + part * (to - from))
    }

    /// Value at or after a time.
    fn near(&self, time_s: f64) -> Option<f64> {
        let next = self.time_s.partition_point(|&known_s| known_s < time_s);
        let last = self.value.len().checked_sub(1)?;
        Some(self.value[next.min(last)])
    }

    /// Whether there is any value.
    pub fn is_known(&self) -> bool {
        self.value.iter().any(|value| value.is_finite())
    }
}

/// Vectors and their times of validity.
#[derive(Debug, Default)]
pub struct Vectors {
    /// Times, s from the start of the log.
    pub time_s: Vec<f64>,
    /// Values; `NaN` if the device sent none.
    pub value: Vec<[f64; 3]>,
}

impl Vectors {
    fn push(&mut self, time_s: f64, value: [f64; 3]) {
        if self.time_s.last().is_none_or(|last| time_s > *last) {
            self.time_s.push(time_s);
            self.value.push(value);
        }
    }
}

/// Readings of an inertial unit.
#[derive(Debug, Default)]
pub struct ImuColumns {
    time_s: Vec<f64>,
    force_m_s2: Vec<[f64; 3]>,
    rate_rad_s: Vec<[f64; 3]>,
}

impl ImuColumns {
    fn push(&mut self, time_s: f64, imu: &ImuSample) {
        if self.time_s.last().is_none_or(|last| time_s > *last) {
            self.time_s.push(time_s);
            self.force_m_s2.push(imu.specific_force_m_s2);
            self.rate_rad_s.push(imu.angular_rate_rad_s);
        }
    }

    /// View for the functions of the estimator.
    pub fn signal(&self) -> ImuSignal<'_> {
        ImuSignal {
            time_s: &self.time_s,
            force_m_s2: &self.force_m_s2,
            rate_rad_s: &self.rate_rad_s,
        }
    }
}

/// A log.
#[derive(Debug)]
pub struct Recording {
    /// Name of the log, for messages.
    pub name: String,
    /// Vehicle.
    pub vehicle: Vehicle,
    /// Sensors of the vehicle.
    pub sensors: Sensors,
    start: LogTime,
    /// Strain counts.
    pub strain: PerWheel<[Column; StrainChannel::COUNT]>,
    /// Potentiometer counts.
    pub deflection: PerWheel<Column>,
    /// Readings of the hub accelerometers in their own axes before calibration, m/s^2.
    pub hub_acceleration: PerWheel<Vectors>,
    /// Wheel speeds, rad/s.
    pub wheel_speed: PerWheel<Column>,
    /// Temperature of the bridges of each corner, degrees Celsius.
    pub temperature_c: PerWheel<Column>,
    /// Measured steering-wheel angle, rad.
    pub steer: Column,
    /// Readings of the sensors of the left and the right front wheel's angle before calibration, rad.
    pub wheel_angle: [Column; 2],
    /// First inertial unit.
    pub imu: ImuColumns,
    imu_source: Option<String>,
    /// GNSS velocity of each receiver, east, north, up, m/s.
    pub velocity: BTreeMap<String, Vectors>,
    /// GNSS attitude of each receiver: yaw, pitch, roll, rad.
    pub attitude: BTreeMap<String, Vectors>,
    /// Marks with their times, s from the start of the log.
    pub marks: Vec<(f64, String)>,
}

impl Recording {
    /// A recording of a vehicle without any values; it begins at `start`.
    #[must_use]
    pub fn new(name: String, vehicle: Vehicle, sensors: Sensors, start: LogTime) -> Self {
        Self {
            name,
            vehicle,
            sensors,
            start,
            strain: PerWheel::default(),
            deflection: PerWheel::default(),
            hub_acceleration: PerWheel::default(),
            wheel_speed: PerWheel::default(),
            temperature_c: PerWheel::default(),
            steer: Column::default(),
            wheel_angle: <[Column; 2]>::default(),
            imu: ImuColumns::default(),
            imu_source: None,
            velocity: BTreeMap::new(),
            attitude: BTreeMap::new(),
            marks: Vec::new(),
        }
    }

    /// Takes a temperature of the bridges of a corner, degrees Celsius.
    pub fn push_temperature(&mut self, time: LogTime, wheel: Wheel, temperature_c: f64) {
        if temperature_c.is_finite() {
            self.temperature_c[wheel].push(time.seconds_since(self.start), temperature_c);
        }
    }

    /// Takes a reading of the sensor of the left (0) or the right (1) front wheel's angle, rad.
    pub fn push_wheel_angle(&mut self, time: LogTime, side: usize, angle_rad: f64) {
        if angle_rad.is_finite() {
            self.wheel_angle[side].push(time.seconds_since(self.start), angle_rad);
        }
    }

    /// Takes a person's mark.
    pub fn mark(&mut self, time: LogTime, text: String) {
        self.marks.push((time.seconds_since(self.start), text));
    }

    /// Takes what the device called `source` measured. Of several inertial units the first one
    /// counts.
    pub fn push(&mut self, source: &str, sample: &Sample) {
        let time = sample.valid_time.min(sample.log_time);
        let time_s = time.seconds_since(self.start);
        let unknown = [f64::NAN; 3];
        match &sample.measurement {
            Measurement::Corner(corner) => {
                for (column, counts) in self.strain[corner.wheel]
                    .iter_mut()
                    .zip(corner.strain_counts)
                {
                    if let Some(counts) = counts {
                        column.push(time_s, counts.number());
                    }
                }
                if let Some(counts) = corner.deflection_counts {
                    self.deflection[corner.wheel].push(time_s, counts.number());
                }
            }
            Measurement::WheelSpeed(speeds) => {
                for wheel in Wheel::ALL {
                    if let Some(speed) = speeds.angular_speed_rad_s[wheel] {
                        self.wheel_speed[wheel].push(time_s, speed);
                    }
                }
            }
            Measurement::HubAcceleration(hub) => {
                let value = hub.specific_force_m_s2.map(|axis| axis.unwrap_or(f64::NAN));
                self.hub_acceleration[hub.wheel].push(time_s, value);
            }
            Measurement::Steer(steer) => self.steer.push(time_s, steer.steering_wheel_rad),
            Measurement::Imu(imu) => {
                let first = self.imu_source.get_or_insert_with(|| source.to_owned());
                if first == source && imu.valid {
                    self.imu.push(time_s, imu);
                }
            }
            Measurement::GnssVelocity(gnss) => {
                let good = gnss.quality.is_measured();
                let velocity = if good {
                    gnss.on_the_level_m_s()
                } else {
                    unknown
                };
                let column = self.velocity.entry(source.to_owned()).or_default();
                column.push(time_s, velocity);
            }
            Measurement::GnssAttitude(gnss) => {
                let good = gnss.quality.is_solved();
                let angles = [gnss.yaw_rad, gnss.pitch_rad, gnss.roll_rad];
                let angles = angles.map(|a| a.filter(|_| good).unwrap_or(f64::NAN));
                let column = self.attitude.entry(source.to_owned()).or_default();
                column.push(time_s, angles);
            }
            Measurement::Control(control) => {
                let angles_rad = control.wheel_angles_rad().unwrap_or([f64::NAN; 2]);
                for (side, angle_rad) in angles_rad.into_iter().enumerate() {
                    self.push_wheel_angle(time, side, angle_rad);
                }
                let temperatures_c = control.bridge_temperatures_c().unwrap_or([f64::NAN; 4]);
                for wheel in Wheel::ALL {
                    self.push_temperature(time, wheel, temperatures_c[wheel.index()]);
                }
            }
            _ => {}
        }
    }

    /// Returns an error if the log has no data of a channel that the step needs.
    pub(super) fn require(
        &self,
        channel: &'static str,
        is_known: bool,
    ) -> Result<(), RecordingError> {
        if is_known {
            return Ok(());
        }
        Err(RecordingError::Missing {
            log: self.name.clone(),
            channel,
        })
    }

    /// Returns an error if the log has no data of an inertial unit.
    pub(super) fn require_imu(&self) -> Result<(), RecordingError> {
        self.require("inertial unit", !self.imu.time_s.is_empty())
    }

    /// Whether a hub accelerometer was recorded.
    #[must_use]
    pub fn has_hub_acceleration(&self) -> bool {
        let wheels = self.hub_acceleration.0.iter();
        wheels.into_iter().any(|vectors| !vectors.time_s.is_empty())
    }

    /// Compression of each strut from its design length, m; empty for a dead potentiometer.
    #[must_use]
    pub fn compression_m(&self, calibration: &Resolved) -> PerWheel<Column> {
        PerWheel::from_fn(|wheel| {
            let pot = &calibration.corners[wheel].deflection;
            let counts = &self.deflection[wheel];
            if pot.dead {
                return Column::default();
            }
            let value = |counts: &f64| pot.gain * (counts - pot.offset_counts);
            Column {
                time_s: counts.time_s.clone(),
                value: counts.value.iter().map(value).collect(),
            }
        })
    }

    /// Steer angle of the left and the right front wheel by their sensors, rad; empty without sensors.
    #[must_use]
    pub fn wheel_angles_rad(&self, calibration: &Resolved) -> [Column; 2] {
        std::array::from_fn(|side| {
            let read = &self.wheel_angle[side];
            let angle = |read: &f64| calibration.wheel_angles_rad([*read; 2])[side];
            Column {
                time_s: read.time_s.clone(),
                value: read.value.iter().map(angle).collect(),
            }
        })
    }

    /// Steering wheel from straight ahead, rad.
    #[must_use]
    pub fn steering_wheel_rad(&self, calibration: &Resolved) -> Column {
        let value = |angle: &f64| angle - calibration.steer_offset_rad;
        Column {
            time_s: self.steer.time_s.clone(),
            value: self.steer.value.iter().map(value).collect(),
        }
    }

    /// Readings of the inertial unit in its own axes.
    pub fn imu_signal(&self) -> ImuSignal<'_> {
        self.imu.signal()
    }

    /// Readings of the inertial unit in body axes, corrected with `calibration`.
    pub fn body_imu(&self, calibration: &Resolved) -> ImuColumns {
        let turned = |values: &[[f64; 3]], bias: Vector3<f64>| {
            let turn =
                |value: &[f64; 3]| calibration.body_from_imu * (Vector3::from(*value) - bias);
            values.iter().map(|value| turn(value).into()).collect()
        };
        ImuColumns {
            time_s: self.imu.time_s.clone(),
            force_m_s2: turned(&self.imu.force_m_s2, calibration.accel_bias_m_s2),
            rate_rad_s: turned(&self.imu.rate_rad_s, calibration.gyro_bias_rad_s),
        }
    }

    /// Mean specific force over a stretch, body axes, m/s^2.
    pub fn specific_force(&self, calibration: &Resolved, stretch: Stretch) -> Option<[f64; 3]> {
        let body = self.body_imu(calibration);
        let inside = body
            .time_s
            .iter()
            .zip(&body.force_m_s2)
            .filter(|(time_s, _)| (stretch.from_s..=stretch.to_s).contains(*time_s));
        let mut sum = Vector3::zeros();
        let mut count = 0.0;
        for (_, force) in inside {
            sum += Vector3::from(*force);
            count += 1.0;
        }
        (count > 0.0).then(|| (sum / count).into())
    }

    /// Times at rest.
    pub fn rest(&self) -> Vec<Stretch> {
        let rate = |axis: usize| Column {
            time_s: self.imu.time_s.clone(),
            value: self.imu.rate_rad_s.iter().map(|rate| rate[axis]).collect(),
        };
        let rates: [Column; 3] = std::array::from_fn(rate);
        let steady = self.deflection.0.iter().chain(&rates);
        let steady: Vec<_> = steady.map(Column::signal).collect();
        let wheels: Vec<_> = self.wheel_speed.0.iter().map(Column::signal).collect();
        rest::stretches(&steady, &wheels)
    }

    /// Roll and pitch from the spring deflections, rad; empty unless all four are measured.
    pub fn lean(&self, calibration: &Resolved) -> [Column; 2] {
        let mut column = [Column::default(), Column::default()];
        let Some(lean) = Lean::of(&self.vehicle) else {
            return column;
        };
        let pots = &self.deflection.0;
        for (k, time_s) in pots[0].time_s.iter().enumerate() {
            let compression = |wheel: Wheel| {
                let counts = self.deflection[wheel].value.get(k)?;
                let pot = &calibration.corners[wheel].deflection;
                (!pot.dead).then(|| pot.gain * (counts - pot.offset_counts))
            };
            let [Some(fl), Some(fr), Some(rl), Some(rr)] = Wheel::ALL.map(compression) else {
                continue;
            };
            let steering_wheel_rad = self.steer.near(*time_s).unwrap_or_default();
            let angles = lean.roll_pitch_rad(&Leaning {
                compression_m: PerWheel([fl, fr, rl, rr]),
                force_m_s2: self
                    .imu_signal()
                    .force_near(*time_s, calibration.imu_m.into()),
                steering_wheel_rad: steering_wheel_rad - calibration.steer_offset_rad,
            });
            for (column, angle) in column.iter_mut().zip(angles.into_iter().flatten()) {
                column.push(*time_s, angle);
            }
        }
        column
    }

    /// Approximate forward speed from the mean of the wheel speeds, m/s.
    pub fn rolling_speed(&self) -> Column {
        let radius_m = self.vehicle.front.tyre.unloaded_radius_m;
        let known: Vec<&Column> = self.wheel_speed.0.iter().filter(|c| c.is_known()).collect();
        let mut speed = Column::default();
        if let Some(first) = known.first() {
            for (k, time_s) in first.time_s.iter().enumerate() {
                let now = known.iter().filter_map(|column| column.value.get(k));
                let (sum, count) = now.fold((0.0, 0.0), |(sum, n), w| (sum + w, n + 1.0));
                speed.push(*time_s, radius_m * sum / count);
            }
        }
        speed
    }
}
