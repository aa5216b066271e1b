//! Inputs and measurements of the single-track filter, from samples.

use model::steering::Lash;
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{LogTime, Measurement, STANDARD_GRAVITY_M_S2, Sample};

use crate::calibration::Resolved;
use crate::grid::HOLD_NANOS;
use crate::steering_column::SteeringColumn;
use crate::tuning::PlanarInputTuning;
use crate::{EstimatorError, Input, Settings};

/// Input at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarInput {
    /// The instant, s from any zero.
    pub time_s: f64,
    /// Forward speed, m/s.
    pub speed_m_s: f64,
    /// Its rate of change, m/s^2.
    pub acceleration_m_s2: f64,
    /// Road-wheel angle over the vehicle file's steering ratio, left positive, rad.
    pub steer_rad: f64,
    /// Yaw rate, if it was measured since the instant before, rad/s.
    pub yaw_rate_rad_s: Option<f64>,
    /// Lateral specific force at the inertial unit, likewise, m/s^2.
    pub lateral_m_s2: Option<f64>,
    /// Last readings of the inertial unit.
    pub inertial: LastInertial,
}

/// Last readings of the inertial unit, means over a step; `NaN` where there is none that is recent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastInertial {
    /// Specific force, body axes, m/s^2.
    pub force_m_s2: [f64; 3],
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
}

impl Default for LastInertial {
    fn default() -> Self {
        Self {
            force_m_s2: [f64::NAN; 3],
            yaw_rate_rad_s: f64::NAN,
        }
    }
}

/// Accepted difference between two values: at once, and for each second between them.
#[derive(Clone, Copy, Debug)]
struct Reach {
    at_once: f64,
    per_second: f64,
}

impl Reach {
    fn new([at_once, per_second]: [f64; 2]) -> Self {
        Self {
            at_once,
            per_second,
        }
    }
}

/// Yaw rate and force: the filter has its own gate.
const ANY: Reach = Reach {
    at_once: f64::INFINITY,
    per_second: 0.0,
};

/// Measured quantities, in the order in which values of one instant are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Quantity {
    Speed,
    Satellite,
    Wheels,
    SteeringWheel,
    YawRate,
    Forward,
    Lateral,
    Upward,
}

/// Mean of the values since the last step, else the last value.
#[derive(Clone, Copy, Debug)]
struct Slot {
    out_of_reach_max_s: f64,
    held_max_s: f64,
    reach: Reach,
    sum: f64,
    count: u32,
    last: Option<(LogTime, f64)>,
    /// Mean of the values of the last step that had any.
    mean: f64,
    /// Since when values have been out of reach.
    astray: Option<LogTime>,
}

impl Slot {
    fn new(reach: Reach, tuning: &PlanarInputTuning) -> Self {
        Self {
            out_of_reach_max_s: tuning.out_of_reach_max_s,
            held_max_s: tuning.held_max_s,
            reach,
            sum: 0.0,
            count: 0,
            last: None,
            mean: f64::NAN,
            astray: None,
        }
    }

    fn push(&mut self, time: LogTime, value: f64) {
        if !value.is_finite() || self.last.is_some_and(|(last, _)| time < last) {
            return;
        }
        let is_astray = self.last.is_some_and(|(last, before)| {
            let since_s = time.seconds_since(last);
            (value - before).abs() > self.reach.at_once + self.reach.per_second * since_s
        });
        if is_astray {
            let since = *self.astray.get_or_insert(time);
            if time.seconds_since(since) < self.out_of_reach_max_s {
                return;
            }
        }
        self.astray = None;
        self.sum += value;
        self.count += 1;
        self.last = Some((time, value));
    }

    /// The mean of the new values, if there are any.
    fn fresh(&mut self) -> Option<f64> {
        let mean = (self.count > 0).then(|| self.sum / f64::from(self.count));
        (self.sum, self.count) = (0.0, 0);
        self.mean = mean.unwrap_or(self.mean);
        mean
    }

    /// The last mean, with the values since; `NaN` if it is too old.
    fn latest(&mut self, now: LogTime, late_s: f64) -> f64 {
        let _ = self.fresh();
        let held_s = self.held_max_s + late_s;
        let recent = self
            .last
            .is_some_and(|(time, _)| now.seconds_since(time) < held_s);
        if recent { self.mean } else { f64::NAN }
    }

    /// The new values' mean, or the last value while it is not too old. Values arrive up to `late_s`
    /// after their time.
    fn held(&mut self, now: LogTime, late_s: f64) -> Option<Held> {
        let last = self.last;
        let age_s = last.map_or(0.0, |(time, _)| now.seconds_since(time).max(0.0));
        let last = last.filter(|_| age_s < self.held_max_s + late_s);
        let value = self.fresh().or(last.map(|(_, value)| value))?;
        Some(Held { value, age_s })
    }
}

/// A value with the time since it was measured.
#[derive(Clone, Copy, Debug)]
struct Held {
    value: f64,
    age_s: f64,
}

/// Capacity of the buffer; a step of 10 ms has a handful of values.
const CAPACITY: usize = 1024;

/// Buffer of samples. A step takes them in the order of their own time, so the order of arrival has
/// no effect; values faster than 100 Hz are averaged over the step.
///
/// Sources have different latencies. Values stay in the buffer until all values of their time have
/// arrived; [`Self::take_ahead`] looks at those that have arrived so far.
#[derive(Clone, Debug)]
pub struct PlanarReadings {
    tuning: PlanarInputTuning,
    waiting: Vec<(LogTime, Quantity, f64)>,
    column: SteeringColumn,
    steering_ratio: f64,
    rolling_radius_m: f64,
    slots: Slots,
    /// Time after an instant until its last values arrive, s.
    late_s: f64,
}

/// Last values of all quantities.
#[derive(Clone, Copy, Debug)]
struct Slots {
    speed: Slot,
    satellite: Slot,
    wheels: Slot,
    steer: Slot,
    yaw_rate: Slot,
    /// Specific force, body axes.
    force: [Slot; 3],
    speed_trend: Trend,
    steer_trend: Trend,
}

/// Filtered difference quotient of a value.
#[derive(Clone, Copy, Debug, Default)]
struct Trend {
    smoothed: Option<(LogTime, f64)>,
    slope: f64,
}

impl Trend {
    /// Takes a value; `time_s` is the time constant, `most` the largest slope.
    fn push(&mut self, now: LogTime, value: f64, time_s: f64, most: f64) -> f64 {
        match &mut self.smoothed {
            Some((then, smooth)) if (0.0..1.0).contains(&now.seconds_since(*then)) => {
                let dt = now.seconds_since(*then);
                self.slope = ((value - *smooth) / time_s).clamp(-most, most);
                *smooth += (dt / time_s).min(1.0) * (value - *smooth);
                *then = now;
            }
            _ => {
                self.smoothed = Some((now, value));
                self.slope = 0.0;
            }
        }
        self.slope
    }
}

/// State of the readings before a look ahead.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    slots: Slots,
    lash: Lash,
    /// Number of values at the beginning of the buffer that were taken.
    used: usize,
}

impl PlanarReadings {
    /// Readings without any value.
    pub fn new(vehicle: &Vehicle, tuning: PlanarInputTuning) -> Result<Self, EstimatorError> {
        let slot = |reach| Slot::new(reach, &tuning);
        let speed = Reach::new(tuning.speed_reach);
        Ok(Self {
            tuning,
            waiting: Vec::with_capacity(CAPACITY),
            column: SteeringColumn::new(vehicle)?,
            steering_ratio: vehicle.steering.ratio,
            rolling_radius_m: rolling_radius_m(vehicle),
            slots: Slots {
                speed: slot(speed),
                satellite: slot(speed),
                wheels: slot(speed),
                steer: slot(Reach::new(tuning.steer_reach)),
                yaw_rate: slot(ANY),
                force: [slot(ANY); 3],
                speed_trend: Trend::default(),
                steer_trend: Trend::default(),
            },
            late_s: 0.0,
        })
    }

    /// The rolling radius of other tyres.
    pub fn load_tyres(&mut self, vehicle: &Vehicle) {
        self.rolling_radius_m = rolling_radius_m(vehicle);
    }

    /// Takes a sample. Samples without planar motion and ignored inputs are skipped.
    pub fn push(&mut self, sample: &Sample, calibration: &Resolved, settings: &Settings) {
        let t = self.tuning;
        let arrived = sample.log_time;
        let time = sample.valid_time.min(arrived);
        let uses = |input| settings.uses(input);
        match &sample.measurement {
            Measurement::GroundSpeed(speed)
                if uses(Input::GroundSpeed) && speed.forward_m_s.abs() < t.speed_max_m_s =>
            {
                self.wait(arrived, time, Quantity::Speed, speed.forward_m_s);
            }
            Measurement::GnssVelocity(velocity) if uses(Input::GnssVelocity) => {
                let [east, north, _] = velocity.velocity_enu_m_s;
                let speed = math::hypot(east, north);
                if velocity.quality.is_measured() && speed < t.speed_max_m_s {
                    let time = time.offset_seconds(-calibration.velocity_latency_s);
                    self.wait(arrived, time, Quantity::Satellite, speed);
                }
            }
            Measurement::WheelSpeed(speeds) if uses(Input::WheelSpeed) => {
                let all = speeds.angular_speed_rad_s.0;
                let (sum, count) = all
                    .iter()
                    .flatten()
                    .fold((0.0, 0.0), |(sum, count), speed| (sum + speed, count + 1.0));
                if count > 0.0 {
                    let speed = self.rolling_radius_m * sum / count;
                    self.wait(arrived, time, Quantity::Wheels, speed);
                }
            }
            Measurement::Steer(steer)
                if uses(Input::Steer)
                    && steer.steering_wheel_rad.abs() < t.steering_wheel_max_rad =>
            {
                let angle = steer.steering_wheel_rad - calibration.steer_offset_rad;
                self.wait(arrived, time, Quantity::SteeringWheel, angle);
            }
            Measurement::Imu(imu) if uses(Input::Imu) && imu.valid => {
                // A unit that measures only in the plane has no other axes.
                let or = |value: f64, other: f64| if value.is_finite() { value } else { other };
                let [fx, fy, fz] = imu.specific_force_m_s2;
                let [p, q, r] = imu.angular_rate_rad_s;
                if fy.is_finite() && fy.abs() < t.force_max_m_s2 {
                    let force = Vector3::new(or(fx, 0.0), fy, or(fz, STANDARD_GRAVITY_M_S2));
                    let force = calibration.body_from_imu * (force - calibration.accel_bias_m_s2);
                    self.wait(arrived, time, Quantity::Lateral, force.y);
                    if fx.is_finite() && fx.abs() < t.force_max_m_s2 {
                        self.wait(arrived, time, Quantity::Forward, force.x);
                    }
                    if fz.is_finite() && fz.abs() < t.force_max_m_s2 {
                        self.wait(arrived, time, Quantity::Upward, force.z);
                    }
                }
                if r.is_finite() && r.abs() < t.rate_max_rad_s {
                    let rate = Vector3::new(or(p, 0.0), or(q, 0.0), r);
                    let rate = calibration.body_from_imu * (rate - calibration.gyro_bias_rad_s);
                    self.wait(arrived, time, Quantity::YawRate, rate.z);
                }
            }
            _ => {}
        }
    }

    /// Adds a value. Values beyond the capacity, hundreds of times what a vehicle sends, are
    /// dropped.
    fn wait(&mut self, arrived: LogTime, time: LogTime, quantity: Quantity, value: f64) {
        if self.waiting.len() < CAPACITY {
            self.waiting.push((time, quantity, value));
        }
        // A step waits for the values of its instant in any case.
        let late_s = arrived.seconds_since(time) - HOLD_NANOS as f64 * 1e-9;
        self.late_s = self.late_s.max(late_s.min(self.tuning.late_max_s));
    }

    /// Time after an instant until its last values arrive, s; zero if a step need not wait for them.
    #[must_use]
    pub fn late_s(&self) -> f64 {
        self.late_s
    }

    /// Sorts the values by their time. To be called before values are taken.
    pub fn sort(&mut self) {
        self.waiting
            .sort_unstable_by(|(t, q, x), (u, r, y)| (t, q).cmp(&(u, r)).then(x.total_cmp(y)));
    }

    /// Moves the values up to `until` from `used` on to the slots. Returns the number of used values.
    fn use_until(&mut self, mut used: usize, until: LogTime) -> usize {
        let slots = &mut self.slots;
        while let Some((time, quantity, value)) = self
            .waiting
            .get(used)
            .filter(|(time, ..)| *time <= until)
            .copied()
        {
            match quantity {
                Quantity::Speed => slots.speed.push(time, value),
                Quantity::Satellite => slots.satellite.push(time, value),
                Quantity::Wheels => slots.wheels.push(time, value),
                Quantity::SteeringWheel => {
                    let angle = self.column.follow(value);
                    slots.steer.push(time, angle / self.steering_ratio);
                }
                Quantity::YawRate => slots.yaw_rate.push(time, value),
                Quantity::Forward => slots.force[0].push(time, value),
                Quantity::Lateral => slots.force[1].push(time, value),
                Quantity::Upward => slots.force[2].push(time, value),
            }
            used += 1;
        }
        used
    }

    /// Input at `instant`, of the values up to `until`, which are removed; `None` without a speed and
    /// a steer angle.
    pub fn take(&mut self, instant: LogTime, until: LogTime) -> Option<PlanarInput> {
        let used = self.use_until(0, until);
        self.waiting.drain(..used);
        self.input(instant, None)
    }

    /// Begins a look ahead; [`Self::return_to`] ends it.
    #[must_use]
    pub fn look_ahead(&self) -> Taken {
        Taken {
            slots: self.slots,
            lash: self.column.lash(),
            used: 0,
        }
    }

    /// Input at `instant`, of the values up to `until` that have arrived, which stay in the buffer.
    pub fn take_ahead(
        &mut self,
        taken: &mut Taken,
        instant: LogTime,
        until: LogTime,
    ) -> Option<PlanarInput> {
        taken.used = self.use_until(taken.used, until);
        self.input(instant, Some(taken))
    }

    /// Ends a look ahead.
    pub fn return_to(&mut self, taken: &Taken) {
        self.slots = taken.slots;
        self.column.restore(taken.lash);
    }

    /// Input at `now`. In a look ahead, speed and steer angle continue with the slopes that they had in
    /// the last complete instant.
    fn input(&mut self, now: LogTime, ahead: Option<&Taken>) -> Option<PlanarInput> {
        let (t, late_s) = (&self.tuning, self.late_s);
        let slots = &mut self.slots;
        let (satellite, wheels) = (
            slots.satellite.held(now, late_s),
            slots.wheels.held(now, late_s),
        );
        let speed = slots.speed.held(now, late_s).or(satellite).or(wheels);
        let steer = slots.steer.held(now, late_s);
        let (yaw_rate_rad_s, lateral_m_s2) = (slots.yaw_rate.fresh(), slots.force[1].fresh());
        let inertial = LastInertial {
            force_m_s2: std::array::from_fn(|axis| slots.force[axis].latest(now, late_s)),
            yaw_rate_rad_s: slots.yaw_rate.latest(now, late_s),
        };
        let (mut speed, mut steer) = (speed?, steer?);
        if let Some(Taken {
            slots: complete, ..
        }) = ahead
        {
            speed.value += complete.speed_trend.slope * speed.age_s.min(late_s);
            steer.value += complete.steer_trend.slope * steer.age_s.min(late_s);
        }
        let steer_most = t.steer_reach[1];
        slots
            .steer_trend
            .push(now, steer.value, t.steer_trend_s, steer_most);
        Some(PlanarInput {
            time_s: now.0 as f64 * 1e-9,
            speed_m_s: speed.value,
            acceleration_m_s2: slots.speed_trend.push(
                now,
                speed.value,
                t.acceleration_time_s,
                t.acceleration_max_m_s2,
            ),
            steer_rad: steer.value,
            yaw_rate_rad_s,
            lateral_m_s2,
            inertial,
        })
    }
}

/// Speed over the wheels' angular speed, rolling freely, m.
fn rolling_radius_m(vehicle: &Vehicle) -> f64 {
    let load_n = 0.25 * vehicle.body.mass_kg * STANDARD_GRAVITY_M_S2;
    let radii = [&vehicle.front, &vehicle.rear].map(|axle| axle.tyre.rolling_radius_m(load_n));
    0.5 * (radii[0] + radii[1])
}
