//! Stage 7 without sensors on the suspension: tyre forces from the balances of the whole vehicle.

use nalgebra::Vector6;
use sample::{ForceSource, LogTime, PerWheel, TyreForce, Wheel};

use super::stages::{MeasuredForces, hitch_wrench};
use super::{Estimator, Output};
use crate::grid::GRID_S;
use crate::inertial_forces::{InertialInput, net_torque};
use crate::motion::MotionState;
use crate::planar::PlanarMotion;

impl Estimator {
    /// Stage 7: tyre forces. A vehicle without linkages has those of the balances, and so has one with linkages while
    /// nothing on its suspension is measured.
    pub(super) fn find_forces(
        &mut self,
        now: LogTime,
        state: &MotionState,
        planar: Option<&PlanarMotion>,
        expected: &PerWheel<TyreForce>,
        steer_rad: [f64; 4],
        out: &mut impl FnMut(Output),
    ) -> MeasuredForces {
        if self.corners.is_none() {
            return self.forces_of_balances(now, state, planar, steer_rad);
        }
        let measured = self.measure_forces(now, state, expected, out);
        if self.fusion.is_none() || !self.is_suspension_silent(now) {
            self.inertial_forces.forget();
            return measured;
        }
        let balances = self.forces_of_balances(now, state, planar, steer_rad);
        if balances.carrier[Wheel::FrontLeft].source == ForceSource::None {
            return measured;
        }
        MeasuredForces {
            frames: measured.frames,
            ..balances
        }
    }

    /// Whether strain channels, potentiometers and hub accelerometers have been silent for so long that the force
    /// filter has nothing to go by.
    fn is_suspension_silent(&mut self, now: LogTime) -> bool {
        let started = *self.started.get_or_insert(now);
        let last = self.readings.suspension_time();
        let since = last.map_or(started, |last| last.max(started));
        now.seconds_since(since) > self.settings.tuning.inertial_forces.silent_s
    }

    /// The forces by the balances of the whole vehicle; unknown without an inertial unit or without a speed.
    fn forces_of_balances(
        &mut self,
        now: LogTime,
        state: &MotionState,
        planar: Option<&PlanarMotion>,
        steer_rad: [f64; 4],
    ) -> MeasuredForces {
        let navigated = self.corners.is_some() || self.is_navigated(now);
        let tuning = &self.settings.tuning;
        let (fresh_s, standing_m_s) = (tuning.fresh_s, tuning.planar.standstill_m_s);
        let hitch = hitch_wrench(&self.vehicle, &self.readings, now, tuning);
        let mut input = InertialInput {
            dt_s: GRID_S,
            force_m_s2: state.specific_force_m_s2.into(),
            forward_sigma_m_s2: tuning.inertial_forces.force_sigma_m_s2,
            rate_rad_s: state.rate_rad_s.into(),
            speed_m_s: state.velocity_m_s.x,
            steer_rad,
            torque_n_m: PerWheel::default(),
            wheel_speed_rad_s: PerWheel::from_fn(|wheel| {
                self.readings.wheel_speed(wheel, now, fresh_s)
            }),
            hitch: hitch.unwrap_or_else(Vector6::zeros),
        };
        let forces = &mut self.inertial_forces;
        match (planar, &self.planar) {
            (Some(motion), Some(filter)) => {
                let ahead_m = self.calibration.plain_imu_ahead_m;
                let turning = forces.yaw_acceleration_rad_s2();
                motion.write_input(filter.offsets()[1], ahead_m, turning, &mut input);
            }
            _ if navigated && state.inertial => {}
            _ => {
                forces.forget();
                return MeasuredForces::default();
            }
        }
        let torques = self.readings.torques_n_m(now, fresh_s);
        input.torque_n_m = net_torque(&torques, input.speed_m_s, standing_m_s);
        let contact = forces.step(&input);
        MeasuredForces {
            carrier: forces.in_carrier_frame(&contact, input.steer_rad),
            reported: contact,
            contact,
            lagged: None,
            frames: None,
        }
    }
}
