//! Stage 8: wheel speeds, steering wheel and the inertial unit against motion and forces.

use sample::{LogTime, PerWheel, TyreForce, Wheel};

use super::events::motion_event;
use super::{Estimator, Output};
use crate::gaussian::{Gaussian, beyond};
use crate::grid::GRID_S;
use crate::kinematics;
use crate::motion::MotionState;
use crate::tuning::WatchTuning;
use crate::watch::{
    BiasWatch, HubWatch, InertialWatch, ReceiverWatch, Repeats, Rolling, SensorChange,
    SteeringWatch, WheelWatch,
};

/// Monitors of the motion sensors.
#[derive(Clone, Debug)]
pub(super) struct ConsistencyMonitors {
    pub(super) tuning: WatchTuning,
    pub(super) inertial: InertialWatch,
    pub(super) steering: SteeringWatch,
    pub(super) steering_repeats: Repeats,
    pub(super) bias: BiasWatch,
    pub(super) velocity: [ReceiverWatch; 2],
    pub(super) attitude: ReceiverWatch,
    /// Of yaw, pitch and roll.
    pub(super) attitude_repeats: [Repeats; 3],
    pub(super) hub: HubWatch,
    wheels: WheelWatch,
    /// Part of the recent time in which the inertial unit contradicted the balances.
    inconsistent: f64,
    /// Whether the rear axle's slip angle does not fit its lateral force.
    rear_slips: bool,
}

impl ConsistencyMonitors {
    pub(super) fn new(tuning: &WatchTuning) -> Self {
        Self {
            tuning: *tuning,
            inertial: InertialWatch::new(tuning.inertial),
            steering: SteeringWatch::new(tuning.steering),
            steering_repeats: Repeats::default(),
            bias: BiasWatch::default(),
            velocity: ["GNSS velocity", "GNSS velocity of the attitude receiver"]
                .map(ReceiverWatch::new),
            attitude: ReceiverWatch::new("GNSS attitude"),
            attitude_repeats: Default::default(),
            hub: HubWatch::default(),
            wheels: WheelWatch::default(),
            inconsistent: 1.0,
            rear_slips: false,
        }
    }

    /// Takes into account whether the inertial unit agreed with the balances in this step.
    pub(super) fn update_imu_consistency(&mut self, agrees: bool) {
        let time_s = self.tuning.imu_consistency.time_s;
        let contradicts = f64::from(!agrees || self.rear_slips);
        self.inconsistent += GRID_S / time_s * (contradicts - self.inconsistent);
    }

    /// Whether a receiver counts as faulty: then it is no witness of a jump of the inertial unit's biases.
    pub(super) fn receiver_faulty(&self) -> bool {
        let mut all = self.velocity.iter().chain([&self.attitude]);
        all.any(ReceiverWatch::is_faulty)
    }

    /// Whether the balances of forces and moments confirm the inertial unit.
    pub(super) fn imu_consistent(&self) -> bool {
        self.inconsistent < self.tuning.imu_consistency.inconsistent_max
    }
}

/// Hands a change at `now` out as an event.
pub(super) fn report(now: LogTime, out: &mut impl FnMut(Output)) -> impl FnMut(SensorChange) {
    move |change| out(Output::Event(motion_event(now, change)))
}

impl Estimator {
    /// Stage 8: compares wheel speeds and steering wheel with motion and measured forces. Returns
    /// the steering-wheel angle that the next step expects, rad.
    pub(super) fn monitor(
        &mut self,
        now: LogTime,
        state: &MotionState,
        measured: &PerWheel<TyreForce>,
        settled: bool,
        out: &mut impl FnMut(Output),
    ) -> Option<Gaussian> {
        let t = self.settings.tuning;
        let rolling = PerWheel::from_fn(|wheel| {
            let reading = self.readings.wheel_speed_rad_s[wheel]?.fresh(now, t.fresh_s)?;
            let [_, left_m] = self.vehicle.wheel_place_m(wheel);
            Some(Rolling {
                read_rad_s: reading,
                radius_m: self.rolling_radius_m(wheel),
                over_ground_m_s: state.velocity_m_s.x - state.rate_rad_s.z * left_m,
                force_n: measured[wheel].force_n,
            })
        });
        let wheels = &mut self.monitors.wheels;
        wheels.judge(now, &rolling, &t.watch.wheels, &mut report(now, out));
        self.readings.wheel_speed_faulty = Wheel::ALL.map(|wheel| !wheels.is_used(wheel));
        // An attitude that a wrong gyro has turned appears as slip without force at the rear axle.
        let gate = t.watch.imu_consistency.rear_slip_gate_sigma;
        self.monitors.rear_slips = self
            .slip_difference(1, state, measured)
            .is_some_and(|apart| beyond(gate, apart.mean, apart.variance));
        // A motion that GNSS contradicts can be wrong itself; a wrong steering wheel makes the
        // balances inconsistent.
        let sure = self.motion.is_imu_consistent()
            || self.motion.is_confirmed()
            || self.monitors.steering.is_inconsistent();
        let known = sure && self.motion.velocity_age_s(now) < t.gnss_silent_s;
        (known && settled)
            .then(|| self.expected_steering_wheel(state, measured))
            .flatten()
    }

    /// Steering-wheel angle that the front axle's lateral force implies, rad.
    fn expected_steering_wheel(
        &self,
        state: &MotionState,
        measured: &PerWheel<TyreForce>,
    ) -> Option<Gaussian> {
        let read = self.readings.steering_wheel_rad?.value;
        let apart = self.slip_difference(0, state, measured)?;
        let ratio = self.vehicle.steering.ratio;
        Some(Gaussian::new(
            read + ratio * apart.mean,
            ratio * ratio * apart.variance,
        ))
    }

    /// Slip angle of an axle from motion and steer angle, less the one that its lateral force
    /// implies, rad: how much further left its wheels should point.
    fn slip_difference(
        &self,
        axle: usize,
        state: &MotionState,
        measured: &PerWheel<TyreForce>,
    ) -> Option<Gaussian> {
        let slips = kinematics::slip_angles_on(self.corners.as_ref()?, state);
        let (slip, sigma) = self.grip.slip_angle(axle, measured)?;
        let t = &self.settings.tuning.watch.steering;
        let apart = 0.5 * (slips.0[2 * axle] + slips.0[2 * axle + 1]) - slip;
        let variance =
            sigma.powi(2) + state.sideslip_sigma_rad.powi(2) + t.expected_sigma_rad.powi(2);
        (state.velocity_m_s.x > t.expected_speed_min_m_s).then_some(Gaussian::new(apart, variance))
    }
}
