//! The road under the wheels, and what the wheels do on it.

use sample::{LogTime, Motion, PerWheel, RoadUnknown, TyreForce, Wheel};

use super::{Estimator, Output};
use crate::grid::GRID_S;
use crate::motion::{ATTITUDE, MotionState, VELOCITY};
use crate::road::RoadInput;

impl Estimator {
    /// Stage 7b: the road at this instant and with the lag, for vehicles with the force filter.
    pub(super) fn estimate_road(
        &mut self,
        now: LogTime,
        motion: &MotionState,
        forces: &PerWheel<TyreForce>,
        lagged: Option<&PerWheel<TyreForce>>,
        out: &mut impl FnMut(Output),
    ) {
        let (Some(road), Some(corners), Some(fusion), Some(lagged)) =
            (&mut self.road, &self.corners, &self.fusion, lagged)
        else {
            return;
        };
        let settled = self
            .moving_since
            .is_some_and(|since| now.seconds_since(since) > self.settings.tuning.settling_s);
        let lengths = [0, 1, 2, 3].map(|wheel| fusion.strut_length_m(wheel));
        let unknown = if !settled || lengths.iter().any(Option::is_none) {
            Some(RoadUnknown::Settling)
        } else if !corners.known(now) {
            Some(RoadUnknown::NoDeflection)
        } else {
            None
        };
        let [east, north, _] = self.motion.sigma(ATTITUDE);
        let tilt = math::hypot(east, north) * std::f64::consts::FRAC_1_SQRT_2;
        let states = corners.states();
        let input = RoadInput {
            now,
            dt: GRID_S,
            motion,
            tilt_sigma_rad: [tilt; 2],
            corners: states,
            strut_m: std::array::from_fn(|i| lengths[i].unwrap_or(states[i].pose.strut_length_m)),
            unknown,
            forces,
            lagged,
        };
        let (now, before) = road.step(&input);
        out(Output::Road(now));
        if let Some(before) = before {
            out(Output::LaggedRoad(before));
        }
    }

    /// Bank and grade of the ground without its roughness, in place of those of the plane through the contacts.
    pub(super) fn complete_slope(
        &mut self,
        now: LogTime,
        motion: &mut Motion,
        state: &MotionState,
        forces: &PerWheel<TyreForce>,
    ) {
        let Some(corners) = &self.corners else {
            return;
        };
        let tuning = &self.settings.tuning.road;
        // A plane through wheels in the air is not the ground.
        let loaded = |wheel: &Wheel| {
            let load_n = forces[*wheel].force_n[2];
            load_n > tuning.contact_part[1] * self.vehicle.static_load_n(*wheel)
        };
        let carried = Wheel::ALL.iter().filter(|wheel| loaded(wheel)).count() >= 3;
        let plane = (corners.known(now) && corners.touches() && carried)
            .then_some([motion.bank_rad, motion.grade_rad]);
        let (_, _, yaw_rad) = state.euler_rad();
        let distance_m = state.velocity_m_s.x.abs() * GRID_S;
        if let Some(slope) = self.slope.step(plane, yaw_rad, distance_m, GRID_S, tuning) {
            [motion.bank_rad, motion.grade_rad] = slope;
        }
    }

    /// Longitudinal slip of each wheel: (R w - v)/|v|, with the rolling radius R at the present load, the spin
    /// w by the wheel speed sensor, and the speed v of the wheel centre along its heading. R at the static load
    /// is the calibration's, else the vehicle file's.
    pub(super) fn complete_wheels(
        &mut self,
        now: LogTime,
        motion: &mut Motion,
        state: &MotionState,
        forces: &PerWheel<TyreForce>,
    ) {
        let t = &self.settings.tuning;
        let [east, north, _] = self.motion.sigma(VELOCITY);
        let speed_sigma = math::hypot(east, north) * std::f64::consts::FRAC_1_SQRT_2;
        let mut slips = [[f64::NAN; 2]; 4];
        for (slip, wheel) in slips.iter_mut().zip(Wheel::ALL) {
            let i = wheel.index();
            let spin = self.readings.wheel_speed(wheel, now, t.fresh_s);
            let reading = self.readings.wheel_speed_rad_s[wheel];
            let [along, rise] = self.wheel_speeds(wheel, motion.steer_rad[wheel], state);
            let before = std::mem::replace(&mut self.slip_before[i], f64::NAN);
            let (Some(spin), Some(reading)) = (spin, reading) else {
                continue;
            };
            if along.is_nan() || along.abs() < t.slip.speed_min_m_s {
                continue;
            }
            let tyre = &self.vehicle.axle(wheel).tyre;
            let static_n = self.vehicle.static_load_n(wheel);
            let load_n = forces[wheel].force_n[2];
            let more_n = if load_n.is_finite() {
                load_n - static_n
            } else {
                0.0
            };
            let radius_m = self.rolling_radius_m(wheel) + tyre.rolling_radius_m(static_n + more_n)
                - tyre.rolling_radius_m(static_n);
            // The wheel rolls along the ground below it, which is not the plane through all wheels.
            let slope = rise / along.abs();
            let speed = along.abs() * (1.0 + slope * slope).sqrt();
            let ratio = radius_m * spin / speed;
            let value = ratio - along.signum();
            self.slip_before[i] = value;
            // The wheel may have gained speed since its reading.
            let age_s = now.seconds_since(reading.time).abs();
            let gained = t.slip.gain_rad_s2 * age_s / spin.abs().max(1.0);
            let noise = ratio * self.sensors.wheel_speed.noise_fraction;
            let changed = ((value - before).abs() - t.slip.changed_sigma * noise.abs()).max(0.0);
            let measured = self.calibration.rolling_radius_m[wheel].is_some();
            let radius_part = t.slip.radius_part[usize::from(measured)];
            let parts = [
                ratio * radius_part,
                ratio * gained,
                noise,
                ratio * speed_sigma / speed,
                t.slip.model + t.slip.slope_part * slope.abs(),
                t.slip.changed_part * changed,
            ];
            let variance: f64 = parts.iter().map(|part| part * part).sum();
            *slip = [value, variance.sqrt()];
        }
        motion.longitudinal_slip = PerWheel(slips.map(|[slip, _]| slip));
        motion.longitudinal_slip_sigma = PerWheel(slips.map(|[_, sigma]| sigma));
    }

    /// Speed of a wheel centre along its heading and along the normal of the ground, m/s.
    fn wheel_speeds(&self, wheel: Wheel, steer_rad: f64, state: &MotionState) -> [f64; 2] {
        if let Some(corners) = &self.corners {
            let i = wheel.index();
            return [
                corners.wheel_velocity(i, state)[0],
                corners.wheel_rise(i, state),
            ];
        }
        let [x, y] = self.vehicle.wheel_place_m(wheel);
        let (velocity, turn) = (state.velocity_m_s, state.rate_rad_s.z);
        let (sine, cosine) = math::sin_cos(steer_rad);
        let along = cosine * (velocity.x - turn * y) + sine * (velocity.y + turn * x);
        [along, 0.0]
    }
}
