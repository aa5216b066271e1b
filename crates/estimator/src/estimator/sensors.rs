//! How the sensors of motion are taken in: judged by those who watch them, then given to the motion
//! filter.

use nalgebra::Vector3;
use sample::{
    GnssAttitude, GnssVelocity, ImuSample, InnovationKind, LogTime, PerWheel, SourceId, Wheel,
};

use super::events::motion_event;
use super::{Estimator, GNSS_SILENT_S, GRID_S, HEADING_SILENT_S, Output};
use crate::corners::Corners;
use crate::inputs::finite3;
use crate::kinematics;
use crate::motion::{MotionState, VelocityReceiver};
use crate::waiting::Held;
use crate::watch::{
    BiasWatch, InertialWatch, ReceiverWatch, Rolling, SensorChange, SteeringWatch, Triads,
    WheelWatch,
};

/// Slip angle that an axle of unknown force may have, rad.
const BLIND_SLIP_RAD: f64 = 0.06;
/// The slip angle's error is alike for many steps, which the filter takes for independent.
const SLIP_CORRELATED: f64 = 4.0;
/// Part of the last second, and more faintly of what was before, in which the inertial unit may
/// contradict the balances of forces and moments that vouch for the state against GNSS.
const DOUBT_MAX: f64 = 0.1;
const DOUBT_TIME_S: f64 = 1.0;
/// Speed above which the front wheels' slip tells the steer angle, m/s, and how well beside what is
/// known of the slip angle, rad.
const STEER_TOLD_M_S: f64 = 3.0;
const STEER_SIGMA_RAD: f64 = 0.02;
/// Square of the normalised difference of the rear axle's slip angles beyond which the motion is wrong.
const REAR_GATE: f64 = 9.0;
/// How fast a road vehicle's body may rise or sink from the ground, m/s.
const VERTICAL_SIGMA_M_S: f64 = 0.3;

/// Those who watch the sensors of motion.
#[derive(Clone, Debug)]
pub(super) struct Watches {
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
    pub(super) fn new() -> Self {
        Self {
            inertial: InertialWatch::default(),
            steering: SteeringWatch::default(),
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
        self.doubt += GRID_S / DOUBT_TIME_S * (f64::from(!agrees || self.rear_slips) - self.doubt);
    }

    /// Whether the balances vouch for what the inertial unit makes of the motion.
    pub(super) fn vouch(&self) -> bool {
        self.doubt < DOUBT_MAX
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
        let watch = &mut self.watches.bias;
        watch.judge(now, biases, sigma, &mut telling(now, out));
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
        self.watches
            .attitude
            .judge(time, verdict, vouched, &mut telling(now, out));
    }

    /// Holds wheel speeds and the hand wheel against the motion and the measured forces.
    pub(super) fn watch_wheels(
        &mut self,
        now: LogTime,
        state: &MotionState,
        settled: bool,
        out: &mut impl FnMut(Output),
    ) {
        let rolling = PerWheel::from_fn(|wheel| {
            let reading = self.readings.wheel_speed_rad_s[wheel]?.fresh(now)?;
            let left_m = 0.5 * self.axle(wheel).track_m * wheel.side();
            Some(Rolling {
                read_m_s: reading * self.rolling_radius_m(wheel),
                over_ground_m_s: state.velocity_m_s.x - state.rate_rad_s.z * left_m,
                force_n: self.measured[wheel].force_n,
            })
        });
        let wheels = &mut self.watches.wheels;
        wheels.judge(now, &rolling, &mut telling(now, out));
        self.readings.wheel_speed_doubted = Wheel::ALL.map(|wheel| !wheels.believed(wheel));
        // A heading that a wrong gyro has turned shows as slip that the rear axle's force does not know.
        self.watches.rear_slips = self
            .steer_apart(1, state)
            .is_some_and(|[apart, variance]| apart * apart > REAR_GATE * variance);
        // A motion that GNSS contradicts may be wrong itself; a wrong hand wheel breaks the balances.
        let sure = self.motion.is_vouched()
            || self.motion.is_confirmed()
            || self.watches.steering.strange();
        let known = sure && self.motion.velocity_age_s(now) < GNSS_SILENT_S;
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
        let apart = 0.5 * (slips.0[2 * axle] + slips.0[2 * axle + 1]) - slip;
        let variance = sigma.powi(2) + state.sideslip_sigma_rad.powi(2) + STEER_SIGMA_RAD.powi(2);
        (state.velocity_m_s.x > STEER_TOLD_M_S).then_some([apart, variance])
    }

    /// Mean forward speed that the wheels tell, rolling freely, m/s.
    fn rolling_speed(&self, time: LogTime) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0.0);
        for wheel in Wheel::ALL {
            if let Some(speed) = self.readings.wheel_speed(wheel, time) {
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
        let blind = self.motion.velocity_age_s(time) > GNSS_SILENT_S;
        if !blind && self.motion.attitude_age_s(time) < HEADING_SILENT_S {
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
            let doubt = 0.1 + 0.03 * forward.abs();
            let centre = Vector3::zeros();
            let kind = Some(InnovationKind::WheelSpeed);
            let _ = self
                .motion
                .push_body_velocity(ahead, centre, forward, doubt, kind);
            let _ = self
                .motion
                .push_body_velocity(normal, centre, 0.0, VERTICAL_SIGMA_M_S, None);
        }
        self.constrain_axles(forward, left);
    }

    /// An axle moves along its wheels, but for the slip angle that its lateral force needs; where
    /// that is unknown the angle is small.
    fn constrain_axles(&mut self, forward: f64, left: Vector3<f64>) {
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
                .unwrap_or((0.0, BLIND_SLIP_RAD));
            let wheels = 0.5 * (steer[2 * axle] + steer[2 * axle + 1]);
            let across = forward * math::tan(wheels + slip) - left.dot(&travel);
            let doubt = SLIP_CORRELATED * (0.05 + sigma * forward.abs());
            let _ = self
                .motion
                .push_body_velocity(left, place, across, doubt, None);
        }
    }
}
