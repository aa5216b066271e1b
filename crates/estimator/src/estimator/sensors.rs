//! Stage 1: the motion sensors. A monitor judges each reading, then the motion filter takes it.

use nalgebra::Vector3;
use sample::{
    ControlSample, GnssAttitude, GnssVelocity, HubAccelerationSample, ImuSample, LogTime, SourceId,
    Wheel,
};

use super::events::hub_event;
use super::monitors::report;
use super::{Estimator, Output};
use crate::Input;
use crate::grid::GRID_S;
use crate::inputs::{Stamp, finite3};
use crate::motion::VelocityReceiver;
use crate::triads::Triads;
use crate::waiting::Held;

impl Estimator {
    pub(super) fn push_control(&mut self, stamp: Stamp, control: &ControlSample) {
        let mut wait = |held| self.waiting.push(stamp, held);
        if let Some(force_n) = control.hitch_force_n() {
            wait(Held::HitchForce(force_n));
        }
        if let Some(temperatures_c) = control.bridge_temperatures_c() {
            wait(Held::BridgeTemperature(temperatures_c));
        }
        if let Some(pressures_pa) = control.tyre_pressures_pa() {
            wait(Held::TyrePressure(pressures_pa));
        }
        let angles = control.wheel_angles_rad();
        if let Some(angles) = angles.filter(|_| self.settings.uses(Input::Steer)) {
            wait(Held::WheelAngles(self.calibration.wheel_angles_rad(angles)));
        }
        if let Some(torques_n_m) = control.wheel_torques_n_m() {
            wait(Held::WheelTorque(torques_n_m));
        }
    }

    pub(super) fn push_imu(&mut self, stamp: Stamp, imu: &ImuSample) {
        if !imu.valid {
            self.waiting.push(stamp, Held::NoInertial);
            return;
        }
        let (Some(force), Some(rate)) = (
            finite3(imu.specific_force_m_s2),
            finite3(imu.angular_rate_rad_s),
        ) else {
            return;
        };
        let c = &self.calibration;
        let scale = self.mistakes.as_ref().map_or(1.0, |watch| watch.scale);
        let held = Held::Inertial {
            force: c.body_from_imu * (scale * force - c.accel_bias_m_s2),
            rate: c.body_from_imu * (rate - c.gyro_bias_rad_s),
        };
        self.waiting.push(stamp, held);
    }

    pub(super) fn take_inertial(
        &mut self,
        Stamp { time, stream }: Stamp,
        force: Vector3<f64>,
        rate: Vector3<f64>,
        now: LogTime,
        out: &mut impl FnMut(Output),
    ) {
        self.imu_stream = stream;
        let rate = match &mut self.mistakes {
            Some(watch) => {
                let rate = watch.units.scales.rates * rate;
                watch.units.take_inertial(rate.z, force.y);
                rate
            }
            None => rate,
        };
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
        let monitor = &mut self.monitors.inertial;
        let used = monitor.judge(read, bias, sigma, &expected, &mut report(now, out));
        let replaced_density = monitor.replaced_density();
        self.motion
            .push_imu(time, used.force, used.rate, &replaced_density);
    }

    /// A reading that the inertial unit itself marks as invalid.
    pub(super) fn take_invalid_inertial(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        (self.monitors.inertial).invalid_reading(&mut report(now, out));
    }

    /// Reports which of the inertial unit's biases has jumped.
    pub(super) fn monitor_biases(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        let watch = self.mistakes.as_ref();
        if watch.is_some_and(|watch| watch.units.is_doubtful(now)) {
            self.motion.take_jump();
            return;
        }
        if let Some(before) = self.motion.take_jump() {
            if !self.monitors.receiver_faulty() {
                self.monitors.bias.suspect(now, before);
            }
            self.monitors.inertial.clear_suspicion();
        }
        let sigma = self.motion.bias_sigma_at_start();
        let biases = self.motion.biases();
        let monitors = &mut self.monitors;
        let tuning = &monitors.tuning.bias;
        (monitors.bias).judge(now, biases, sigma, tuning, &mut report(now, out));
    }

    pub(super) fn take_steering_wheel(
        &mut self,
        time: LogTime,
        angle_rad: f64,
        now: LogTime,
        out: &mut impl FnMut(Output),
    ) {
        let moves = self.moves();
        let monitors = &mut self.monitors;
        let repeats = &monitors.tuning.repeats;
        let frozen =
            (monitors.steering_repeats).take(angle_rad, moves, repeats.steering_readings, repeats);
        monitors.steering.take_frozen(frozen);
        let expected = self.feedback.steering_wheel;
        let angle = self.column.follow(angle_rad);
        let angle = (self.monitors.steering).judge(time, angle, expected, &mut report(now, out));
        self.readings.push_steering_wheel(time, angle);
    }

    /// Whether the vehicle drives, so that a sensor with noise does not repeat its reading.
    fn moves(&self) -> bool {
        self.motion.speed_m_s() > self.settings.tuning.motion.receivers.stuck_speed_m_s
    }

    /// Speed of a wheel in rad/s, with a wrong unit corrected.
    pub(super) fn in_own_unit(&mut self, wheel: Wheel, speed: f64) -> f64 {
        let radius_m = self.rolling_radius_m(wheel);
        let Some(watch) = &mut self.mistakes else {
            return speed;
        };
        let speed = watch.units.scales.wheel_speeds * speed;
        watch.units.take_wheel(radius_m * speed.abs());
        speed
    }

    pub(super) fn take_hub_acceleration(
        &mut self,
        stamp: Stamp,
        hub: &HubAccelerationSample,
        now: LogTime,
        out: &mut impl FnMut(Output),
    ) {
        let Some(sensor) = &self.calibration.hubs[hub.wheel] else {
            return;
        };
        let axes_m_s2 = self.readings.push_hub_acceleration(stamp, hub, sensor);
        let tuning = &self.monitors.tuning.hub;
        let mut changes = |wheel, wrong| out(Output::Event(hub_event(now, wheel, wrong)));
        (self.monitors.hub).judge(stamp.time, hub.wheel, axes_m_s2, tuning, &mut changes);
    }

    /// The antenna of a source's velocity: the receiver of attitude has an antenna of its own.
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
        if let Some(velocity) = finite3(gnss.on_the_level_m_s()).filter(|_| usable) {
            let (mut velocity, mut sigma_m_s) = (velocity, gnss.sigma_enu_m_s);
            if let Some(watch) = &mut self.mistakes {
                let scale = watch.units.scales.velocity;
                velocity *= scale;
                sigma_m_s = sigma_m_s.map(|sigma| sigma.map(|sigma| scale * sigma));
                watch.units.take_velocity(time, velocity.x, velocity.y);
            }
            let verdict = self
                .motion
                .push_velocity(time, receiver, velocity, sigma_m_s);
            let monitors = &mut self.monitors;
            let trusted = self.motion.is_imu_consistent() && !monitors.bias.is_suspected();
            let tuning = &monitors.tuning.receiver;
            let monitor = &mut monitors.velocity[receiver as usize];
            monitor.judge(time, verdict, trusted, tuning, &mut report(now, out));
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
        let moves = self.moves();
        let angles = [gnss.yaw_rad, gnss.pitch_rad, gnss.roll_rad];
        let angles =
            std::array::from_fn(|i| angles[i].filter(|a| a.is_finite()).map(|a| a - offset[i]));
        let (mut angles, mut sigma_rad) = (angles, gnss.sigma_rad);
        if let Some(watch) = &mut self.mistakes {
            let scale = watch.units.scales.attitude;
            angles = angles.map(|angle| angle.map(|angle| scale * angle));
            sigma_rad = sigma_rad.map(|sigma| sigma.map(|sigma| scale * sigma));
            if let Some(heading) = angles[0] {
                watch.units.take_heading(time, heading);
            }
        }
        let monitors = &mut self.monitors;
        let repeats = &monitors.tuning.repeats;
        let mut frozen = false;
        for (angle, of_angle) in angles.iter_mut().zip(&mut monitors.attitude_repeats) {
            let reading = angle.unwrap_or(f64::NAN);
            if of_angle.take(reading, moves, repeats.attitude_values, repeats) {
                (*angle, frozen) = (None, true);
            }
        }
        let verdict = self.motion.push_attitude(time, angles, sigma_rad);
        let monitors = &mut self.monitors;
        monitors.attitude.take_frozen(frozen);
        let trusted = self.motion.is_imu_consistent() && !monitors.bias.is_suspected();
        let tuning = &monitors.tuning.receiver;
        (monitors.attitude).judge(time, verdict, trusted, tuning, &mut report(now, out));
    }
}
