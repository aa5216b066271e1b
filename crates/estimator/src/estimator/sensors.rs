//! How the sensors of motion are taken in: judged by those who watch them, then given to the motion
//! filter.

use nalgebra::Vector3;
use sample::{
    GnssAttitude, GnssVelocity, ImuSample, InnovationKind, LogTime, PerWheel, SourceId, Wheel,
};

use super::events::motion_event;
use super::{Estimator, GRID_S, Output};
use crate::corners::Corners;
use crate::inputs::finite3;
use crate::kinematics;
use crate::motion::{MotionState, VelocityReceiver};
use crate::tuning::WatchTuning;
use crate::waiting::Held;
use crate::watch::{
    BiasWatch, InertialWatch, ReceiverWatch, Rolling, SensorChange, SteeringWatch, Triads,
    WheelWatch,
};

/// Those who watch the sensors of motion.
#[derive(Clone, Debug)]
pub(super) struct Watches {
    tuning: WatchTuning,
    pub(super) inertial: InertialWatch,
    pub(super) steering: SteeringWatch,
    bias: BiasWatch,
    velocity: [ReceiverWatch; 2],
    attitude: ReceiverWatch,
    wheels: WheelWatch,
    /// Part of the time in which the inertial unit has contradicted the balances, lately.
    doubt: f64,
    /// Whether the rear axle slips otherwise than its lateral force calls for.
    rear_slips: bool,
    /// What the hand wheel should say, rad, and its variance.
    expected_hand_wheel: Option<[f64; 2]>,
}

impl Watches {
    pub(super) fn new(tuning: &WatchTuning) -> Self {
        Self {
            tuning: *tuning,
            inertial: InertialWatch::new(tuning.inertial),
            steering: SteeringWatch::new(tuning.steering),
            bias: BiasWatch::default(),
            velocity: ["GNSS velocity", "GNSS velocity of the attitude receiver"]
                .map(ReceiverWatch::new),
            attitude: ReceiverWatch::new("GNSS attitude"),
            wheels: WheelWatch::default(),
            doubt: 1.0,
            rear_slips: false,
            expected_hand_wheel: None,
        }
    }

    /// Takes note of whether the inertial unit agrees with the balances at this step.
    pub(super) fn agree(&mut self, agrees: bool) {
        let time_s = self.tuning.imu_consistency.time_s;
        self.doubt += GRID_S / time_s * (f64::from(!agrees || self.rear_slips) - self.doubt);
    }

    /// Whether the balances vouch for what the inertial unit makes of the motion.
    pub(super) fn vouch(&self) -> bool {
        self.doubt < self.tuning.imu_consistency.inconsistent_max
    }
}

/// Hands what changed at `now` on as events.
fn telling(now: LogTime, out: &mut impl FnMut(Output)) -> impl FnMut(SensorChange) {
    move |change| out(Output::Event(motion_event(now, change)))
}

impl Estimator {
    pub(super) fn push_imu(&mut self, time: LogTime, imu: &ImuSample) {
        if !imu.valid {
            self.waiting.push(time, Held::NoInertial);
            return;
        }
        let (Some(force), Some(rate)) = (
            finite3(imu.specific_force_m_s2),
            finite3(imu.angular_rate_rad_s),
        ) else {
            return;
        };
        let c = &self.calibration;
        let held = Held::Inertial {
            force: c.body_from_imu * (force - c.accel_bias_m_s2),
            rate: c.body_from_imu * (rate - c.gyro_bias_rad_s),
        };
        self.waiting.push(time, held);
    }

    pub(super) fn take_inertial(
        &mut self,
        time: LogTime,
        force: Vector3<f64>,
        rate: Vector3<f64>,
        now: LogTime,
        out: &mut impl FnMut(Output),
    ) {
        let ahead_s = time.seconds_since(now) + GRID_S;
        let fusion = self.fusion.as_ref();
        let expected = fusion.map_or_else(Triads::default, |fusion| {
            fusion.expected_reading(ahead_s, self.calibration.imu_m)
        });
        let bias = Triads {
            rate: self.motion.gyro_bias(),
            force: self.motion.accel_bias(),
        };
        let [rate_sigma, force_sigma] = self.imu_sigma;
        let sigma = Triads {
            rate: rate_sigma,
            force: force_sigma,
        };
        let read = Triads { rate, force };
        let watch = &mut self.watches.inertial;
        let told = watch.judge(read, bias, sigma, &expected, &mut telling(now, out));
        let untold = watch.untold();
        self.motion.push_imu(time, told.force, told.rate, &untold);
    }

    /// Takes note of a reading that the inertial unit itself calls bad.
    pub(super) fn miss_inertial(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        self.watches.inertial.miss(&mut telling(now, out));
    }

    /// Tells which of the inertial unit's biases has jumped.
    pub(super) fn watch_biases(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        if let Some(before) = self.motion.take_jump() {
            self.watches.bias.suspect(now, before);
            self.watches.inertial.forgive();
        }
        let sigma = self.motion.bias_sigma_at_start();
        let biases = self.motion.biases();
        let watches = &mut self.watches;
        let tuning = &watches.tuning.bias;
        (watches.bias).judge(now, biases, sigma, tuning, &mut telling(now, out));
    }

    pub(super) fn take_hand_wheel(
        &mut self,
        time: LogTime,
        angle_rad: f64,
        now: LogTime,
        out: &mut impl FnMut(Output),
    ) {
        let watches = &mut self.watches;
        let expected = watches.expected_hand_wheel;
        let angle = self.column.follow(angle_rad);
        let angle = watches
            .steering
            .judge(time, angle, expected, &mut telling(now, out));
        self.readings.push_hand_wheel(time, angle);
    }

    /// Whose antenna a source's velocity is of: a receiver of attitude has one of its own.
    pub(super) fn velocity_receiver(&self, source: SourceId) -> VelocityReceiver {
        if self.attitude_source == Some(source) {
            VelocityReceiver::OfAttitude
        } else {
            VelocityReceiver::Own
        }
    }

    pub(super) fn take_velocity(
        &mut self,
        time: LogTime,
        source: SourceId,
        gnss: &GnssVelocity,
        now: LogTime,
        out: &mut impl FnMut(Output),
    ) {
        let usable = gnss.quality.is_measured();
        let receiver = self.velocity_receiver(source);
        if let Some(velocity) = finite3(gnss.velocity_enu_m_s).filter(|_| usable) {
            let verdict = self
                .motion
                .push_velocity(time, receiver, velocity, gnss.sigma_enu_m_s);
            let vouched = self.motion.is_vouched();
            self.watches.velocity[receiver as usize].judge(
                time,
                verdict,
                vouched,
                &self.watches.tuning.receiver,
                &mut telling(now, out),
            );
        }
    }

    pub(super) fn take_attitude(
        &mut self,
        time: LogTime,
        gnss: &GnssAttitude,
        now: LogTime,
        out: &mut impl FnMut(Output),
    ) {
        if !gnss.quality.is_solved() {
            return;
        }
        let offset = self.calibration.attitude_offset_rad;
        let angles = [gnss.yaw_rad, gnss.pitch_rad, gnss.roll_rad];
        let angles =
            std::array::from_fn(|i| angles[i].filter(|a| a.is_finite()).map(|a| a - offset[i]));
        let verdict = self.motion.push_attitude(time, angles, gnss.sigma_rad);
        let vouched = self.motion.is_vouched();
        let watches = &mut self.watches;
        let tuning = &watches.tuning.receiver;
        (watches.attitude).judge(time, verdict, vouched, tuning, &mut telling(now, out));
    }

    /// Holds wheel speeds and the hand wheel against the motion and the measured forces.
    pub(super) fn watch_wheels(
        &mut self,
        now: LogTime,
        state: &MotionState,
        settled: bool,
        out: &mut impl FnMut(Output),
    ) {
        let t = self.settings.tuning;
        let rolling = PerWheel::from_fn(|wheel| {
            let reading = self.readings.wheel_speed_rad_s[wheel]?.fresh(now, t.fresh_s)?;
            let left_m = 0.5 * self.axle(wheel).track_m * wheel.side();
            Some(Rolling {
                read_m_s: reading * self.rolling_radius_m(wheel),
                over_ground_m_s: state.velocity_m_s.x - state.rate_rad_s.z * left_m,
                force_n: self.measured[wheel].force_n,
            })
        });
        let wheels = &mut self.watches.wheels;
        wheels.judge(now, &rolling, &t.watch.wheels, &mut telling(now, out));
        self.readings.wheel_speed_doubted = Wheel::ALL.map(|wheel| !wheels.believed(wheel));
        // A heading that a wrong gyro has turned shows as slip that the rear axle's force does not know.
        let gate = t.watch.imu_consistency.rear_slip_gate_sigma;
        self.watches.rear_slips = self
            .steer_apart(1, state)
            .is_some_and(|[apart, variance]| apart * apart > gate * gate * variance);
        // A motion that GNSS contradicts may be wrong itself; a wrong hand wheel breaks the balances.
        let sure = self.motion.is_vouched()
            || self.motion.is_confirmed()
            || self.watches.steering.strange();
        let known = sure && self.motion.velocity_age_s(now) < t.gnss_silent_s;
        self.watches.expected_hand_wheel =
            (known && settled).then(|| self.steer_told(state)).flatten();
    }

    /// What the hand wheel should say, rad, and its variance.
    fn steer_told(&self, state: &MotionState) -> Option<[f64; 2]> {
        let read = self.readings.hand_wheel_rad?.value;
        let [apart, variance] = self.steer_apart(0, state)?;
        let ratio = self.vehicle.steering.ratio;
        Some([read + ratio * apart, ratio * ratio * variance])
    }

    /// How much further left an axle's wheels should stand than they do, rad, and its variance: their
    /// slip angles less the one that its lateral force needs.
    fn steer_apart(&self, axle: usize, state: &MotionState) -> Option<[f64; 2]> {
        let slips = kinematics::slip_angles_on(self.corners.as_ref()?, state);
        let (slip, sigma) = self.grip.slip_angle(axle, &self.measured)?;
        let t = &self.settings.tuning.watch.steering;
        let apart = 0.5 * (slips.0[2 * axle] + slips.0[2 * axle + 1]) - slip;
        let variance =
            sigma.powi(2) + state.sideslip_sigma_rad.powi(2) + t.expected_sigma_rad.powi(2);
        (state.velocity_m_s.x > t.expected_speed_min_m_s).then_some([apart, variance])
    }

    /// Mean forward speed that the wheels tell, rolling freely, m/s.
    fn rolling_speed(&self, time: LogTime) -> Option<f64> {
        let fresh_s = self.settings.tuning.fresh_s;
        let (mut sum, mut count) = (0.0, 0.0);
        for wheel in Wheel::ALL {
            if let Some(speed) = self.readings.wheel_speed(wheel, time, fresh_s) {
                sum += speed * self.rolling_radius_m(wheel);
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum / count)
    }

    /// Speed over wheel speed of a wheel that rolls freely, m: as measured, else of the loaded tyre.
    fn rolling_radius_m(&self, wheel: Wheel) -> f64 {
        let tyre = &self.axle(wheel).tyre;
        let load = self.vehicle.body.mass_kg * sample::STANDARD_GRAVITY_M_S2 / 4.0;
        let pressed = load / tyre.vertical_stiffness_n_m.max(1.0);
        let measured = self.calibration.rolling_radius_m[wheel];
        measured.unwrap_or(tyre.unloaded_radius_m - pressed / 3.0)
    }

    /// What wheel speeds and the tyres' grip tell while GNSS velocity or heading is silent.
    pub(super) fn constrain_motion(&mut self, time: LogTime) {
        let t = self.settings.tuning;
        let aiding = t.motion.aiding;
        let blind = self.motion.velocity_age_s(time) > t.gnss_silent_s;
        if !blind && self.motion.attitude_age_s(time) < t.heading_silent_s {
            return;
        }
        let normal = self
            .corners
            .as_ref()
            .map_or_else(Vector3::z, Corners::normal);
        let left = normal.cross(&Vector3::x()).normalize();
        let ahead = left.cross(&normal);
        let mut forward = self.motion.state(time).velocity_m_s.x;
        if blind {
            let Some(speed) = self.rolling_speed(time) else {
                return;
            };
            forward = speed;
            let doubt =
                aiding.wheel_speed_sigma_m_s + aiding.wheel_speed_sigma_part * forward.abs();
            let centre = Vector3::zeros();
            let kind = Some(InnovationKind::WheelSpeed);
            let _ = self
                .motion
                .push_body_velocity(ahead, centre, forward, doubt, kind);
            let _ = self.motion.push_body_velocity(
                normal,
                centre,
                0.0,
                aiding.vertical_sigma_m_s,
                None,
            );
        }
        self.constrain_axles(forward, left);
    }

    /// An axle moves along its wheels, but for the slip angle that its lateral force needs; where
    /// that is unknown the angle is small.
    fn constrain_axles(&mut self, forward: f64, left: Vector3<f64>) {
        let t = self.settings.tuning.motion.aiding;
        let steer = self.steer_angles(self.grip.steer_offset().0);
        let body = &self.vehicle.body;
        let ahead = [body.front_axle_to_cg_m, -body.cg_to_rear_axle_m];
        for (axle, x) in ahead.into_iter().enumerate() {
            let [place, travel] = match &self.corners {
                Some(corners) => corners.axle_middle(axle),
                None => [Vector3::x() * x, Vector3::zeros()],
            };
            let (slip, sigma) = self
                .grip
                .slip_angle(axle, &self.measured)
                .unwrap_or((0.0, t.slip_unknown_sigma_rad));
            let wheels = 0.5 * (steer[2 * axle] + steer[2 * axle + 1]);
            let across = forward * (wheels + slip).tan() - left.dot(&travel);
            let doubt = t.slip_correlation * (t.lateral_sigma_m_s + sigma * forward.abs());
            let _ = self
                .motion
                .push_body_velocity(left, place, across, doubt, None);
        }
    }
}
