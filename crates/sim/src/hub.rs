//! Accelerometers on the uprights.
//!
//! The sensor of a wheel stands at r from the wheel centre c, fixed to the upright, whose rate is w and
//! whose axes are the columns of C in body axes. It reads, in its own axes,
//!
//! f = S C^T (a_c - g + w' x r + w x (w x r)) + bias
//!
//! with the small turn S from the carrier's to the sensor's axes.

use model::sensors::HubAcceleration;
use model::strain::{ChannelScale, Lag};
use model::vehicle::Vehicle;
use nalgebra::{Matrix3, Rotation3, Vector3};
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use crate::faults::{Faults, HubAxisFaultKind};
use crate::imu::sensor_from_body;
use crate::linkage::Linkage;
use crate::random::Noise;
use crate::{Motion, SimError, TruthState};

/// The accelerometer of one upright, its filters and its converters.
pub(crate) struct HubAccelerometer {
    /// Specific force at the sensor at each state of a lap, carrier axes, m/s^2.
    force_m_s2: Vec<Vector3<f64>>,
    /// True turn from the carrier's to the sensor's axes, about x, y, z, rad.
    turn_rad: [f64; 3],
    bias_m_s2: [f64; 3],
    noise_m_s2: f64,
    scale: ChannelScale,
    /// Filter of each measured axis, on the specific force.
    lags: [Option<Lag>; 3],
    sensor_from_carrier: Rotation3<f64>,
    noise: Noise,
    wheel: Wheel,
    faults: Faults,
    /// Last count of each axis.
    held: [Option<u16>; 3],
    time_s: f64,
    next_row: usize,
}

impl HubAccelerometer {
    pub(crate) fn new(
        wheel: Wheel,
        motion: &Motion,
        vehicle: &Vehicle,
        hub: &HubAcceleration,
        faults: &Faults,
        seed: u64,
    ) -> Result<Self, SimError> {
        let mut mounting = Noise::new(seed, &format!("hub accelerometer mounting {wheel}"));
        let turn = std::array::from_fn(|_| mounting.within(hub.misalignment_rad));
        let bias_m_s2 = std::array::from_fn(|_| mounting.within(hub.bias_m_s2));
        let turned = faults.hub_turn_rad(wheel);
        let carriers = Carriers::new(motion.states(), vehicle, wheel)?;
        let force_m_s2 = carriers.specific_force(motion.states(), hub.position_of_m(wheel).into());
        let mut sensor = Self {
            turn_rad: turn,
            bias_m_s2,
            noise_m_s2: hub.noise_m_s2,
            scale: hub.scale(),
            lags: [None; 3],
            sensor_from_carrier: sensor_from_body(turn) * sensor_from_body(turned),
            noise: Noise::new(seed, &format!("hub accelerometer {wheel}")),
            wheel,
            faults: faults.clone(),
            held: [None; 3],
            time_s: 0.0,
            next_row: 1,
            force_m_s2,
        };
        let first = sensor.force_at(motion, 0.0);
        sensor.lags = std::array::from_fn(|axis| {
            hub.measures(axis)
                .then(|| Lag::settled(hub.lag_hz, first[axis]))
        });
        Ok(sensor)
    }

    /// Turn from the carrier's to the sensor's axes about x, y, z, rad, and bias, sensor axes, m/s^2.
    pub(crate) fn truth(&self) -> ([f64; 3], [f64; 3]) {
        (self.turn_rad, self.bias_m_s2)
    }

    /// What the converters give at `time_s`, which must not fall from call to call; none for an
    /// axis that is not measured.
    pub(crate) fn counts(&mut self, motion: &Motion, time_s: f64) -> [Option<u16>; 3] {
        while let Some(row) = motion.row(self.next_row) {
            if row.time_s > time_s {
                break;
            }
            self.filter(motion, row.time_s);
            self.next_row += 1;
        }
        self.filter(motion, time_s);
        std::array::from_fn(|axis| {
            // Drawn for absent axes too, so that an axis's noise does not depend on others.
            let error = self.noise.normal(self.noise_m_s2);
            let lag = self.lags[axis].as_ref()?;
            let level = self.scale.level(lag.output() + error);
            let count = self.scale.convert(level);
            let count = match self.faults.of_hub_axis(self.wheel, axis, time_s) {
                None => count,
                Some(HubAxisFaultKind::Dead) => 0,
                Some(HubAxisFaultKind::Frozen) => self.held[axis].unwrap_or(count),
            };
            self.held[axis] = Some(count);
            Some(count)
        })
    }

    fn filter(&mut self, motion: &Motion, time_s: f64) {
        let force = self.force_at(motion, time_s);
        let dt_s = time_s - self.time_s;
        self.time_s = time_s;
        for (lag, force) in self.lags.iter_mut().zip(&force) {
            if let Some(lag) = lag {
                lag.advance(dt_s, *force);
            }
        }
    }

    /// Input of the filters, sensor axes, m/s^2.
    fn force_at(&self, motion: &Motion, time_s: f64) -> Vector3<f64> {
        let carrier = match motion.place(time_s) {
            (row, None) => self.force_m_s2[row],
            (row, Some(weight)) => self.force_m_s2[row].lerp(&self.force_m_s2[row + 1], weight),
        };
        self.sensor_from_carrier * carrier + Vector3::from(self.bias_m_s2)
    }
}

/// Axes and centre of one upright at each state of a lap.
struct Carriers {
    /// Rotation of vectors from the upright's into body axes.
    body_from_carrier: Vec<Matrix3<f64>>,
    /// Wheel centre from the centre of gravity, body axes, m.
    centre_m: Vec<Vector3<f64>>,
    wheel: Wheel,
}

impl Carriers {
    fn new(states: &[TruthState], vehicle: &Vehicle, wheel: Wheel) -> Result<Self, SimError> {
        let linkage = Linkage::new(vehicle)?;
        let [ahead_m, left_m] = vehicle.wheel_place_m(wheel);
        let height_m = vehicle.axle(wheel).tyre.unloaded_radius_m - vehicle.body.cg_height_m;
        let design_m = Vector3::new(ahead_m, left_m, height_m);
        let mut carriers = Self {
            body_from_carrier: Vec::with_capacity(states.len()),
            centre_m: Vec::with_capacity(states.len()),
            wheel,
        };
        for state in states {
            let (axes, centre_m) = match &linkage {
                Some(linkage) => linkage.carrier(state, wheel)?,
                None => (axes_of_spindle(state, wheel), design_m),
            };
            carriers.body_from_carrier.push(axes);
            carriers.centre_m.push(centre_m);
        }
        Ok(carriers)
    }

    /// Specific force at a place fixed to the upright, carrier axes, m/s^2.
    fn specific_force(&self, states: &[TruthState], place_m: Vector3<f64>) -> Vec<Vector3<f64>> {
        let turning: Vec<Vector3<f64>> = (0..states.len())
            .map(|row| {
                let [before, after] = beside(row, states.len());
                let [a, b] = [before, after].map(|k| self.body_from_carrier[k]);
                small_turn(&(b * a.transpose())) / (states[after].time_s - states[before].time_s)
            })
            .collect();
        (0..states.len())
            .map(|row| {
                let state = &states[row];
                let [before, after] = beside(row, states.len());
                let span_s = states[after].time_s - states[before].time_s;
                let own = (turning[after] - turning[before]) / span_s;
                let body_rate = Vector3::from(state.rate_rad_s);
                let rate = body_rate + turning[row];
                let rate_dot = Vector3::from(state.rate_derivative_rad_s2)
                    + own
                    + body_rate.cross(&turning[row]);
                let arm = self.body_from_carrier[row] * place_m;
                let acceleration = self.centre_acceleration(state, self.centre_m[row])
                    + rate_dot.cross(&arm)
                    + rate.cross(&rate.cross(&arm));
                let force = acceleration + state.up_body() * STANDARD_GRAVITY_M_S2;
                self.body_from_carrier[row].transpose() * force
            })
            .collect()
    }

    /// Acceleration of the wheel centre, body axes, m/s^2: as the motion tells it, otherwise that of
    /// the body there without its part along the ground's normal.
    fn centre_acceleration(&self, state: &TruthState, centre_m: Vector3<f64>) -> Vector3<f64> {
        let ground = state.wheels[self.wheel].ground;
        if let Some(told) = ground.and_then(|ground| ground.centre_acceleration_m_s2) {
            return told.into();
        }
        let rate = Vector3::from(state.rate_rad_s);
        let of_body = Vector3::from(state.specific_force_m_s2)
            - state.up_body() * STANDARD_GRAVITY_M_S2
            + Vector3::from(state.rate_derivative_rad_s2).cross(&centre_m)
            + rate.cross(&rate.cross(&centre_m));
        let normal = ground.map_or_else(
            || state.ground_normal_body(),
            |ground| ground.normal_body.into(),
        );
        of_body - normal * of_body.dot(&normal)
    }
}

/// Carrier axes by the spindle alone: y along it, x = unit(y × z of the body), z = x × y.
fn axes_of_spindle(state: &TruthState, wheel: Wheel) -> Matrix3<f64> {
    let truth = &state.wheels[wheel];
    let steer_rad = if truth.steer_rad.is_finite() {
        truth.steer_rad
    } else {
        0.0
    };
    let (sine, cosine) = math::sin_cos(steer_rad);
    let y = truth.ground.map_or_else(
        || Vector3::new(-sine, cosine, 0.0),
        |ground| ground.spindle_body.into(),
    );
    let x = y.cross(&Vector3::z()).normalize();
    Matrix3::from_columns(&[x, y, x.cross(&y)])
}

/// Axis times angle of a rotation by a small angle: the skew part of its matrix.
fn small_turn(r: &Matrix3<f64>) -> Vector3<f64> {
    let [x, y, z] = [[(2, 1), (1, 2)], [(0, 2), (2, 0)], [(1, 0), (0, 1)]]
        .map(|[plus, minus]| 0.5 * (r[plus] - r[minus]));
    Vector3::new(x, y, z)
}

/// The rows on both sides of a row, itself at the ends.
fn beside(row: usize, rows: usize) -> [usize; 2] {
    [row.saturating_sub(1), (row + 1).min(rows - 1)]
}
