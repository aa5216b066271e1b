mod events;
mod sensors;

use model::sensors::Sensors;
use model::vehicle::{Axle, Vehicle};
use sample::{
    Estimate, Event, ForceSource, LogTime, Measurement, Motion, NANOS_PER_SECOND, Parameters,
    PerWheel, Sample, SourceId, TyreForce, Wheel,
};

use crate::calibration::Resolved;
use crate::corners::{Corners, Told};
use crate::expected::ExpectedForces;
use crate::fusion::{Fusion, StepInput};
use crate::grip::{Grip, GripInput};
use crate::innovation::InnovationTally;
use crate::inputs::Readings;
use crate::kinematics;
use crate::lift::LiftDetector;
use crate::motion::{
    ACCEL_BIAS, GYRO_BIAS, MotionFilter, MotionSettings, MotionState, VelocityReceiver,
};
use crate::planar::{Planar, PlanarMotion};
use crate::smoother::Step;
use crate::statics::{self, CornerAssumptions};
use crate::steering_column::SteeringColumn;
use crate::tuning::Tuning;
use crate::waiting::{Entry, Held, Waiting};
use crate::{Calibration, EstimatorError, Input, Method, Settings};

use events::{Divergence, channel_event, frozen_event};
use sensors::Watches;

/// Spacing of the instants that estimates are given for, ns.
pub const GRID_NANOS: u64 = 10_000_000;

/// Spacing of the instants that parameters are given for, ns.
const PARAMETERS_NANOS: u64 = NANOS_PER_SECOND as u64;
/// How long after an instant its estimate is made, ns: so that what was measured at the instant
/// has arrived.
const HOLD_NANOS: u64 = 5_000_000;
/// A jump of the log clock, ns, that is not bridged: estimates start anew after it.
const GAP_MAX_NANOS: u64 = 10_000_000_000;
/// Step of the grid, s.
const GRID_S: f64 = 0.01;

/// What the estimator hands out.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "handed out on the stack, so that a step allocates nothing"
)]
pub enum Output {
    /// The estimate of one instant of the grid.
    Estimate(Estimate),
    /// What it has found beside, at each full second of the log clock after the estimate.
    Parameters(Parameters),
    /// Something that it declares.
    Event(Event),
    /// The same instant for a [`Smoother`](crate::smoother::Smoother), where one was asked for.
    Step(Box<Step>),
}

/// Forces and motion of one vehicle from its samples.
///
/// For each arrival, first call [`advance`](Self::advance) with its log time, then
/// [`push`](Self::push) each sample that was decoded from it. Ticks advance time too, so that
/// estimates go on when sensors fall silent.
#[derive(Clone, Debug)]
pub struct Estimator {
    vehicle: Vehicle,
    calibration: Resolved,
    settings: Settings,
    next_grid: Option<LogTime>,
    waiting: Waiting,
    /// The receiver of attitude, once it has spoken.
    attitude_source: Option<SourceId>,
    column: SteeringColumn,
    readings: Readings,
    motion: MotionFilter,
    watches: Watches,
    corners: Option<Corners>,
    fusion: Option<Fusion>,
    expected: ExpectedForces,
    measured: PerWheel<TyreForce>,
    lift: LiftDetector,
    grip: Grip,
    /// Since when the motion filter has gone on without a start.
    moving_since: Option<LogTime>,
    planar: Option<Planar>,
    /// Of motion, forces and sideslip.
    divergences: [Divergence; 3],
    imu_sigma: [f64; 2],
    traced: bool,
}

impl Estimator {
    /// An estimator that has seen nothing.
    ///
    /// # Errors
    /// When the calibration is another vehicle's, or a value cannot be used.
    pub fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        calibration: &Calibration,
        settings: Settings,
    ) -> Result<Self, EstimatorError> {
        if calibration.vehicle != vehicle.name {
            return Err(EstimatorError::OtherVehicle {
                expected: vehicle.name.clone(),
                found: calibration.vehicle.clone(),
            });
        }
        let vehicle = &calibration.applied(vehicle);
        let calibration = Resolved::new(sensors, calibration)?;
        let pot = &calibration.corners[Wheel::FrontLeft].deflection;
        let t = &settings.tuning;
        let corners = Corners::new(vehicle, pot.noise_sigma, t)?;
        let fusion = (settings.method == Method::Fusion && corners.is_some())
            .then(|| Fusion::new(vehicle, &sensors.strain, &calibration.corners, t));
        Ok(Self {
            motion: MotionFilter::new(motion_settings(sensors, &calibration, t), &t.motion),
            planar: corners
                .is_none()
                .then(|| Planar::new(vehicle, sensors, &calibration, t))
                .transpose()?,
            divergences: ["motion", "force", "sideslip"]
                .map(|name| Divergence::new(name, t.recovery_s)),
            watches: Watches::new(&t.watch),
            corners,
            fusion,
            expected: ExpectedForces::new(vehicle, &t.expected),
            measured: PerWheel::default(),
            grip: Grip::new(vehicle, &t.grip),
            moving_since: None,
            lift: LiftDetector::new(static_loads(vehicle), &t.lift),
            imu_sigma: [
                sensors.imu.gyro_noise_rad_s.max(t.gyro_sigma_min_rad_s),
                sensors.imu.accel_noise_m_s2.max(t.accel_sigma_min_m_s2),
            ],
            vehicle: vehicle.clone(),
            calibration,
            settings,
            next_grid: None,
            waiting: Waiting::new(),
            attitude_source: None,
            column: SteeringColumn::new(vehicle)?,
            readings: Readings::default(),
            traced: false,
        })
    }

    /// From now on hands out [`Output::Step`] with each estimate.
    #[must_use]
    pub fn traced(mut self) -> Self {
        self.traced = true;
        self.motion.switch_trace_on();
        if let Some(fusion) = &mut self.fusion {
            fusion.switch_trace_on();
        }
        if let Some(planar) = &mut self.planar {
            planar.switch_trace_on();
        }
        self
    }

    /// Moves time to `now` and hands out the estimate of every grid instant up to 5 ms before it,
    /// so that what was measured at an instant has arrived. Instants are multiples of
    /// [`GRID_NANOS`] on the log clock, the first at or after the first call's time.
    pub fn advance(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        for time in grid(&mut self.next_grid, now) {
            let estimate = self.step(time, out);
            out(Output::Estimate(estimate));
            if time.0.is_multiple_of(PARAMETERS_NANOS) {
                out(Output::Parameters(self.parameters(time)));
            }
        }
    }

    /// Takes one sample in. Samples that do not concern the estimator are ignored, and so are
    /// values that no vehicle can have.
    pub fn push(&mut self, sample: &Sample) {
        if let Some(planar) = &mut self.planar {
            planar.push(sample, &self.calibration, &self.settings);
        }
        let time = sample.valid_time.min(sample.log_time);
        let uses = |input| self.settings.uses(input);
        match &sample.measurement {
            Measurement::Imu(imu) if uses(Input::Imu) => self.push_imu(time, imu),
            Measurement::GnssVelocity(gnss) if uses(Input::GnssVelocity) => {
                let time = match self.velocity_receiver(sample.source) {
                    VelocityReceiver::Own => {
                        time.offset_seconds(-self.calibration.velocity_latency_s)
                    }
                    VelocityReceiver::OfAttitude => time,
                };
                self.waiting
                    .push(time, Held::Velocity(sample.source, *gnss));
            }
            Measurement::GnssAttitude(gnss) if uses(Input::GnssAttitude) => {
                let source = self.attitude_source.get_or_insert(sample.source);
                *source = (*source).min(sample.source);
                let time = time.offset_seconds(-self.calibration.attitude_latency_s);
                self.waiting.push(time, Held::Attitude(*gnss));
            }
            Measurement::Corner(corner) => self.waiting.push(time, Held::Corner(*corner)),
            Measurement::Steer(steer) if uses(Input::Steer) => {
                let angle = steer.hand_wheel_rad - self.calibration.steer_offset_rad;
                self.waiting.push(time, Held::HandWheel(angle));
            }
            Measurement::WheelSpeed(speeds) if uses(Input::WheelSpeed) => {
                let speeds = speeds.angular_speed_rad_s;
                self.waiting.push(time, Held::WheelSpeed(speeds));
            }
            _ => {}
        }
    }

    /// Takes in all that has arrived, in the order of its own time.
    fn take_waiting(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        self.waiting.sort();
        while let Some(Entry { time, held }) = self.waiting.take() {
            let fresh = now.seconds_since(time) <= self.settings.tuning.fresh_s;
            match held {
                Held::Corner(_) | Held::HandWheel(_) | Held::WheelSpeed(_) if !fresh => {}
                Held::Inertial { force, rate } => self.take_inertial(time, force, rate, now, out),
                Held::NoInertial => self.miss_inertial(now, out),
                Held::Velocity(source, gnss) => {
                    self.take_velocity(time, source, &gnss, now, out);
                }
                Held::Attitude(gnss) => self.take_attitude(time, &gnss, now, out),
                Held::Corner(corner) => self.readings.push_corner(
                    time,
                    &corner,
                    &self.calibration.corners[corner.wheel],
                    self.settings.uses(Input::Strain),
                    self.settings.uses(Input::Deflection),
                ),
                Held::HandWheel(angle) => self.take_hand_wheel(time, angle, now, out),
                Held::WheelSpeed(speeds) => {
                    for wheel in Wheel::ALL {
                        if let Some(speed) = speeds[wheel] {
                            self.readings.push_wheel_speed(time, wheel, speed);
                        }
                    }
                }
            }
        }
    }

    fn step(&mut self, time: LogTime, out: &mut impl FnMut(Output)) -> Estimate {
        let resets = self.motion.resets();
        self.motion.vouch(self.watches.vouch());
        self.take_waiting(time, out);
        self.watch_biases(time, out);
        let settling_s = self.settings.tuning.settling_s;
        let settled = |since| time.seconds_since(since) > settling_s;
        let starting = !self.moving_since.is_some_and(settled);
        self.divergences[0].step(time, self.motion.resets().into(), starting, out);
        if self.motion.resets() > resets {
            self.moving_since = None;
        }
        let settled = settled(*self.moving_since.get_or_insert(time));
        self.readings
            .frozen_changes(&self.calibration.corners, &mut |change| {
                out(Output::Event(frozen_event(time, change)));
            });
        self.motion.bridge(time);
        self.constrain_motion(time);
        let mut state = self.motion.state(time);
        let navigated = self.is_navigated(time);
        let planar = self.step_planar(time, navigated, out);
        if let Some(planar) = &planar {
            planar.lead(&mut state);
        }
        let load = self.measured.0.map(|force| force.force_n[2]);
        let (steer_offset, _) = self.grip.steer_offset();
        let struts = self
            .fusion
            .as_ref()
            .map_or_else(Default::default, |fusion| {
                std::array::from_fn(|wheel| fusion.strut(wheel))
            });
        if let Some(corners) = &mut self.corners {
            let told = Told {
                load_n: load,
                struts,
                body_motion: self.fusion.as_ref().and_then(Fusion::body_motion),
                hand_wheel_rad: steer_offset * self.vehicle.steering.ratio,
            };
            corners.update(time, GRID_S, &mut self.readings, &state, &told);
        }
        let steer = self.steer_angles(steer_offset);
        let mut motion = kinematics::motion(&state);
        if self.planar.is_some() && planar.is_none() && !navigated {
            motion = Motion::UNKNOWN;
        }
        if let Some(corners) = &self.corners {
            let (roll, pitch) = kinematics::ground_angles(corners.normal());
            motion.bank_rad = motion.roll_rad - roll;
            motion.grade_rad = motion.pitch_rad - pitch;
        }
        let expected = self
            .expected
            .step(GRID_S, state.velocity_m_s.x, &motion, steer);
        self.measured = self.measure(time, &state, &expected, out);
        self.watch_wheels(time, &state, settled, out);
        let speed_m_s = state.velocity_m_s.x.hypot(state.velocity_m_s.y);
        let moving = speed_m_s > self.settings.tuning.lift_speed_min_m_s;
        let rollover = self
            .lift
            .step(time, GRID_S, moving, &self.measured, &mut |event| {
                out(Output::Event(event));
            });
        if let Some(fusion) = self.fusion.as_ref().filter(|_| state.inertial) {
            motion.rate_rad_s = fusion.rate_rad_s();
        }
        if let Some(planar) = &planar {
            planar.tell(&mut motion);
        }
        motion.steer_rad = PerWheel(steer);
        motion.slip_angle_rad = match &self.corners {
            Some(corners) => kinematics::slip_angles_on(corners, &state),
            None => kinematics::slip_angles(&self.vehicle, &state, steer),
        };
        // Grip is learnt from slip angles that GNSS gives; those that grip gave teach nothing, nor
        // do the tyres of a vehicle that tips over.
        if navigated
            && settled
            && self.watches.steering.believed()
            && !self.lift.is_tipping()
            && self.measured.0[0].source == ForceSource::Fusion
        {
            let input = GripInput {
                now: time,
                dt: GRID_S,
                speed_m_s: state.velocity_m_s.x,
                slip_angle_rad: &motion.slip_angle_rad,
                corrected_rad: steer_offset,
                sideslip_sigma_rad: state.sideslip_sigma_rad,
                forces: &self.measured,
            };
            self.grip
                .step(&input, &mut |event| out(Output::Event(event)));
        }
        let estimate = Estimate {
            time,
            motion,
            measured: self.measured,
            expected,
            rollover,
        };
        if self.traced {
            out(Output::Step(Box::new(Step {
                estimate: estimate.clone(),
                solution: self.motion.solution(),
                operations: self.motion.take_operations(),
                navigated: planar.is_none(),
                planar: self.planar.as_mut().and_then(Planar::take_belief),
                forces: self.fusion.as_mut().map(Fusion::take_belief),
            })));
        }
        estimate
    }

    fn parameters(&mut self, time: LogTime) -> Parameters {
        let mut none = InnovationTally::default();
        let beside = match (&mut self.fusion, &mut self.planar) {
            (Some(fusion), _) => fusion.innovations(),
            (None, Some(planar)) => &mut planar.innovations,
            (None, None) => &mut none,
        };
        let innovations = self.motion.innovations.report(beside);
        let (steer_offset_rad, steer_offset_sigma_rad) = self.grip.steer_offset();
        let mut parameters = Parameters {
            time,
            accel_bias_m_s2: self.motion.accel_bias().into(),
            accel_bias_sigma_m_s2: self.motion.sigma(ACCEL_BIAS),
            gyro_bias_rad_s: self.motion.gyro_bias().into(),
            gyro_bias_sigma_rad_s: self.motion.sigma(GYRO_BIAS),
            steer_offset_rad,
            steer_offset_sigma_rad,
            front: self.grip.axle(0, time),
            rear: self.grip.axle(1, time),
            innovations,
        };
        if let Some(planar) = self.planar.as_ref().filter(|_| !self.is_navigated(time)) {
            planar.tell_offsets(&mut parameters);
        }
        parameters
    }

    fn measure(
        &mut self,
        now: LogTime,
        motion: &MotionState,
        expected: &PerWheel<TyreForce>,
        out: &mut impl FnMut(Output),
    ) -> PerWheel<TyreForce> {
        let Some(corners) = &self.corners else {
            return PerWheel::default();
        };
        if let Some(fusion) = &mut self.fusion {
            let input = StepInput {
                now,
                dt: GRID_S,
                fresh_s: self.settings.tuning.fresh_s,
                corners: corners.states(),
                statics_before: corners.statics_before(),
                motion,
                channels: &self.calibration.corners,
                expected,
                imu_m: self.calibration.imu_m,
                imu_sigma: self.imu_sigma,
                believed: self.watches.inertial.believed(),
                turn_over_ground: corners.turn_over_ground(),
            };
            let forces = fusion.step(&input, &mut self.readings.corners, &mut |change| {
                out(Output::Event(channel_event(now, change)));
            });
            self.divergences[1].step(now, fusion.resets().into(), false, out);
            self.watches.agree(fusion.vouches());
            return corners.doubt_frames(&forces, self.grip.steer_offset().1);
        }
        let forces = PerWheel::from_fn(|wheel| {
            let tyre = &self.axle(wheel).tyre;
            let assumed = CornerAssumptions {
                rolling_radius_m: tyre.rolling_resistance
                    * tyre.unloaded_radius_m
                    * motion.velocity_m_s.x.clamp(-1.0, 1.0),
                expected_n: expected[wheel].force_n,
                fresh_s: self.settings.tuning.fresh_s,
            };
            statics::tyre_force(
                now,
                &corners.states()[wheel.index()],
                &self.readings.corners[wheel],
                &self.calibration.corners[wheel],
                &assumed,
                &self.settings.tuning.statics,
            )
        });
        corners.doubt_frames(&forces, self.grip.steer_offset().1)
    }

    fn axle(&self, wheel: Wheel) -> &Axle {
        if wheel.is_front() {
            &self.vehicle.front
        } else {
            &self.vehicle.rear
        }
    }

    /// Whether satellites keep the inertial navigation.
    fn is_navigated(&self, time: LogTime) -> bool {
        let t = &self.settings.tuning;
        self.motion.velocity_age_s(time) < t.gnss_silent_s
            && self.motion.attitude_age_s(time) < t.heading_silent_s
    }

    /// The single-track filter, where it is the best that there is: without corners, and without
    /// an inertial navigation that satellites keep.
    fn step_planar(
        &mut self,
        time: LogTime,
        navigated: bool,
        out: &mut impl FnMut(Output),
    ) -> Option<PlanarMotion> {
        let planar = self.planar.as_mut()?;
        let motion = planar.step(time, GRID_S);
        self.divergences[2].step(time, planar.resets(), false, out);
        motion.filter(|_| !navigated)
    }

    /// Steer angle of each wheel: from the linkages, else the hand wheel over the steering ratio.
    fn steer_angles(&self, offset_rad: f64) -> [f64; 4] {
        if let Some(corners) = &self.corners {
            return std::array::from_fn(|i| corners.states()[i].pose.steer_rad());
        }
        let hand_wheel = self.readings.hand_wheel_rad.map_or(0.0, |r| r.value);
        let front = hand_wheel / self.vehicle.steering.ratio + offset_rad;
        [front, front, 0.0, 0.0]
    }
}

/// The instants of the grid up to [`HOLD_NANOS`] before `now`, from `next` on, which moves with
/// them; a jump of the clock is not bridged.
pub(crate) fn grid(
    next: &mut Option<LogTime>,
    now: LogTime,
) -> impl Iterator<Item = LogTime> + use<> {
    let first = match *next {
        Some(grid) if now.0.saturating_sub(grid.0) <= GAP_MAX_NANOS => grid.0,
        _ => now.0.div_ceil(GRID_NANOS) * GRID_NANOS,
    };
    let count = match now.0.checked_sub(first + HOLD_NANOS) {
        Some(behind) => behind / GRID_NANOS + 1,
        None => 0,
    };
    *next = Some(LogTime(first + count * GRID_NANOS));
    (0..count).map(move |step| LogTime(first + step * GRID_NANOS))
}

/// Load of each wheel on level ground at rest, N.
fn static_loads(vehicle: &Vehicle) -> PerWheel<f64> {
    let body = &vehicle.body;
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let half = 0.5 * body.mass_kg * sample::STANDARD_GRAVITY_M_S2 / (a + b);
    PerWheel([half * b, half * b, half * a, half * a])
}

fn motion_settings(sensors: &Sensors, calibration: &Resolved, t: &Tuning) -> MotionSettings {
    let imu = &sensors.imu;
    MotionSettings {
        interval_s: 1.0 / imu.rate_hz.max(1.0),
        accel_sigma_m_s2: imu.accel_noise_m_s2.max(t.accel_sigma_min_m_s2),
        gyro_sigma_rad_s: imu.gyro_noise_rad_s.max(t.gyro_sigma_min_rad_s),
        accel_bias_sigma_m_s2: imu.accel_bias_m_s2,
        gyro_bias_sigma_rad_s: imu.gyro_bias_rad_s,
        imu_m: calibration.imu_m,
        antenna_m: [
            calibration.velocity_antenna_m,
            calibration.attitude_antenna_m,
        ],
        velocity_sigma_m_s: (sensors.gnss_velocity.velocity_noise_m_s)
            .max(t.velocity_sigma_min_m_s),
        heading_sigma_rad: (sensors.gnss_attitude.heading_noise_rad).max(t.attitude_sigma_min_rad),
        tilt_sigma_rad: (sensors.gnss_attitude.roll_pitch_noise_rad).max(t.attitude_sigma_min_rad),
    }
}
