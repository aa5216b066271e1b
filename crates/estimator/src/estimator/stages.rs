//! The stages of one step.

use model::vehicle::Vehicle;
use nalgebra::{Vector3, Vector6};
use sample::{Estimate, ForceSource, LogTime, Motion, PerWheel, Rollover, TyreForce, Wheel};

use super::events::{channel_event, frozen_event, range_event, vehicle_event};
use super::lagged::LAG_STEPS;
use super::{Estimator, Output};
use crate::expected::ExpectedInput;
use crate::feedback::EstimatorFeedback;
use crate::fusion::{Fusion, StepInput};
use crate::gaussian::Gaussian;
use crate::grid::GRID_S;
use crate::grip::GripInput;
use crate::inputs::{Readings, Stamp};
use crate::kinematics;
use crate::lift::LiftInput;
use crate::motion::MotionState;
use crate::planar::{Planar, PlanarMotion};
use crate::smoother::Step;
use crate::statics::{self, CornerAssumptions};
use crate::waiting::{Entry, Held};
use crate::wheel_frame::WheelFrame;
use crate::{Input, ModelFriction, Tuning};

/// Forces of the tyres by the measurement path.
#[derive(Default)]
pub(super) struct MeasuredForces {
    /// In the contact frame, as the stages after this one use them.
    pub(super) contact: PerWheel<TyreForce>,
    /// The same with the unknown normal of the ground in the standard deviations.
    pub(super) reported: PerWheel<TyreForce>,
    /// In the wheel-carrier frame.
    pub(super) carrier: PerWheel<TyreForce>,
    /// Two steps before, by the force filter, wheel-carrier frame.
    pub(super) lagged: Option<PerWheel<TyreForce>>,
    /// Axes of the wheels, if the vehicle has linkages.
    pub(super) frames: Option<PerWheel<WheelFrame>>,
}

impl Estimator {
    /// Stage 1: takes all waiting samples in the order of their own time. Inertial readings
    /// propagate the motion filter, GNSS values correct it. Returns whether the filter has settled.
    pub(super) fn collect(&mut self, time: LogTime, out: &mut impl FnMut(Output)) -> bool {
        let resets = self.motion.resets();
        self.motion.set_imu_consistent(self.feedback.imu_consistent);
        self.take_waiting(time, out);
        self.correct_drift(time, out);
        self.follow_pressure();
        self.monitor_biases(time, out);
        let settling_s = self.settings.tuning.settling_s;
        let settled = |since| time.seconds_since(since) > settling_s;
        let starting = !self.moving_since.is_some_and(settled);
        self.divergences[0].step(time, self.motion.resets().into(), starting, out);
        if self.motion.resets() > resets {
            self.moving_since = None;
        }
        self.readings
            .frozen_changes(&self.calibration, &mut |change| {
                out(Output::Event(frozen_event(time, change, &self.vehicle)));
            });
        self.readings.range_faults(&self.calibration, &mut |fault| {
            out(Output::Event(range_event(time, &fault, &self.vehicle)));
        });
        settled(*self.moving_since.get_or_insert(time))
    }

    fn take_waiting(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        self.waiting.sort();
        while let Some(Entry { time, stream, held }) = self.waiting.take() {
            let stamp = Stamp { time, stream };
            let fresh = now.seconds_since(time) <= self.settings.tuning.fresh_s;
            match held {
                Held::Corner(_)
                | Held::SteeringWheel(_)
                | Held::WheelAngles(_)
                | Held::WheelSpeed(_)
                | Held::HitchForce(_)
                | Held::WheelTorque(_)
                | Held::HubAcceleration(..)
                    if !fresh => {}
                Held::Inertial { force, rate } => self.take_inertial(stamp, force, rate, now, out),
                Held::NoInertial => self.take_invalid_inertial(now, out),
                Held::Velocity(source, gnss) => {
                    self.motion
                        .set_latency_sigma_s(self.latency_sigma_s(stream));
                    self.take_velocity(time, source, &gnss, now, out);
                }
                Held::Attitude(gnss) => {
                    self.motion
                        .set_latency_sigma_s(self.latency_sigma_s(stream));
                    self.take_attitude(time, &gnss, now, out);
                }
                Held::Corner(corner) => {
                    let watch = self.mistakes.as_ref();
                    let corner = watch.map_or(corner, |watch| watch.routed(&corner));
                    self.readings.push_corner(
                        stamp,
                        &corner,
                        &self.calibration.corners[corner.wheel],
                        self.settings.uses(Input::Strain),
                        self.settings.uses(Input::Deflection),
                    );
                }
                Held::SteeringWheel(angle) => self.take_steering_wheel(time, angle, now, out),
                Held::HubAcceleration(hub) => {
                    self.take_hub_acceleration(stamp, &hub, now, out);
                }
                Held::HitchForce(force_n) => self.readings.hitch_n = Some((time, force_n)),
                Held::BridgeTemperature(temperatures_c) => {
                    self.temperatures.push(time, &temperatures_c);
                }
                Held::TyrePressure(pressures_pa) => self.pressures.push(time, &pressures_pa),
                Held::WheelAngles(angles) => self.readings.push_wheel_angles(time, &angles),
                Held::WheelTorque(torques) => self.readings.push_torques(time, &torques),
                Held::WheelSpeed(speeds) => {
                    for wheel in Wheel::ALL {
                        if let Some(speed) = speeds[wheel] {
                            let speed = self.in_own_unit(wheel, speed);
                            self.readings.push_wheel_speed(time, wheel, speed);
                        }
                    }
                }
            }
        }
    }

    /// Stage 2: propagates the motion filter to `time` and, while GNSS is silent, corrects it by
    /// wheel speeds and tyre slip. The angular acceleration is that of the balance of moments, if it is known.
    pub(super) fn propagate(&mut self, time: LogTime) -> MotionState {
        self.motion.coast(time);
        self.aid_motion(time);
        let solution = self.motion.solution();
        let rate_dot = (self.feedback.rate_dot_rad_s2).filter(|_| solution.inertial);
        solution.state_turning(time, rate_dot.unwrap_or(solution.rate_dot))
    }

    /// Stage 3: the single-track filter of a vehicle without linkages. Its motion replaces the
    /// inertial navigation's as [`MotionChoice`] decides.
    pub(super) fn correct_planar(
        &mut self,
        time: LogTime,
        state: &mut MotionState,
        out: &mut impl FnMut(Output),
    ) -> Option<PlanarMotion> {
        let navigated = self.is_navigated(time);
        let planar = self.planar.as_mut()?;
        let motion = planar.step(time, GRID_S);
        self.divergences[2].step(time, planar.resets(), false, out);
        if let Some((contradicts, square)) = planar.contradiction() {
            out(Output::Event(vehicle_event(time, contradicts, square)));
        }
        let hold_s = self.settings.tuning.navigation_hold_s;
        let navigates = self
            .choice
            .step(time, navigated, hold_s, state, motion.as_ref());
        let motion = motion.filter(|_| !navigates);
        if let Some(motion) = &motion {
            motion.apply_to(state);
        }
        motion
    }

    /// Stage 4: places the linkages and the ground. Returns the wheels' steer angles, rad.
    pub(super) fn place_corners(&mut self, time: LogTime, state: &MotionState) -> [f64; 4] {
        if let Some(corners) = &mut self.corners {
            let offset_rad = self.feedback.steer_offset_rad * self.vehicle.steering.ratio;
            corners.update(
                time,
                GRID_S,
                &mut self.readings,
                state,
                &self.feedback,
                offset_rad,
            );
        }
        self.steer_angles(time)
    }

    /// Stage 5: the motion as it is reported, with bank and grade where linkages give the ground.
    pub(super) fn describe_motion(
        &self,
        state: &MotionState,
        planar: Option<&PlanarMotion>,
        navigated: bool,
    ) -> Motion {
        let mut motion = kinematics::motion(state);
        if self.planar.is_some() && planar.is_none() && !navigated {
            motion = Motion::UNKNOWN;
        }
        if let Some(corners) = &self.corners {
            let (roll, pitch) = kinematics::ground_angles(corners.normal());
            motion.bank_rad = motion.roll_rad - roll;
            motion.grade_rad = motion.pitch_rad - pitch;
        }
        motion
    }

    /// Stage 6: tyre forces that the vehicle model expects.
    pub(super) fn expect_forces(
        &mut self,
        now: LogTime,
        state: &MotionState,
        motion: &Motion,
        steer_rad: [f64; 4],
    ) -> PerWheel<TyreForce> {
        let friction = match self.settings.model_friction {
            ModelFriction::Found => self.grip.found_friction(now),
            ModelFriction::Vehicle => None,
        };
        let input = ExpectedInput {
            speed_m_s: state.velocity_m_s.x,
            sideslip_rad: state.sideslip_rad,
            yaw_rate_rad_s: state.rate_rad_s.z,
            motion,
            steer_rad,
            friction,
        };
        self.expected.step(GRID_S, &input)
    }

    /// Stage 7: tyre forces from strain, struts and the inertial unit, by the force filter or by
    /// the statics of each corner.
    pub(super) fn measure_forces(
        &mut self,
        now: LogTime,
        motion: &MotionState,
        expected: &PerWheel<TyreForce>,
        out: &mut impl FnMut(Output),
    ) -> MeasuredForces {
        let Some(corners) = &self.corners else {
            return MeasuredForces::default();
        };
        let mut lagged = None;
        let hitched = hitch_wrench(&self.vehicle, &self.readings, now, &self.settings.tuning)
            .map(|wrench| corners.states_with(&wrench));
        let forces = if let Some(fusion) = &mut self.fusion {
            let input = StepInput {
                now,
                dt: GRID_S,
                fresh_s: self.settings.tuning.fresh_s,
                corners: hitched.as_ref().unwrap_or(corners.states()),
                statics_before: corners.statics_before(),
                motion,
                channels: &self.calibration.corners,
                expected,
                imu_m: self.calibration.imu_m,
                imu_sigma: self.imu_sigma,
                imu_stream: self.imu_stream,
                used: self.monitors.inertial.used(),
                axle: corners.live_axle(),
                turn_over_ground: corners.turn_over_ground(),
                tilt_rad: corners.tilt_rad(),
            };
            let mut forces = fusion.step(&input, &mut self.readings, &mut |change| {
                out(Output::Event(channel_event(now, change, &self.vehicle)));
            });
            self.divergences[1].step(now, fusion.resets().into(), false, out);
            self.monitors.update_imu_consistency(fusion.imu_agrees());
            if let Some(watch) = &mut self.mistakes {
                watch.consider(fusion, &mut forces);
            }
            lagged = Some(forces.lagged);
            forces.now
        } else {
            self.statics_of_corners(now, motion, expected)
        };
        let steer_sigma_rad = self.grip.steer_offset().1;
        let fusion = self.fusion.as_ref();
        let frames = PerWheel::from_fn(|wheel| {
            let corner = &corners.states()[wheel.index()];
            let moment =
                fusion.map(|fusion| fusion.moment(wheel.index(), corner, motion.velocity_m_s.x));
            let errors = corners.frame_errors(wheel, steer_sigma_rad);
            WheelFrame::new(corner, errors, moment)
        });
        let all = PerWheel::from_fn(|wheel| {
            if fusion.is_some() {
                frames[wheel].of_carrier(&forces[wheel])
            } else {
                frames[wheel].of_contact(&forces[wheel])
            }
        });
        MeasuredForces {
            carrier: PerWheel::from_fn(|wheel| all[wheel].carrier),
            contact: PerWheel::from_fn(|wheel| all[wheel].contact),
            reported: PerWheel::from_fn(|wheel| all[wheel].reported),
            lagged,
            frames: Some(frames),
        }
    }

    fn statics_of_corners(
        &self,
        now: LogTime,
        motion: &MotionState,
        expected: &PerWheel<TyreForce>,
    ) -> PerWheel<TyreForce> {
        let Some(corners) = &self.corners else {
            return PerWheel::default();
        };
        PerWheel::from_fn(|wheel| {
            let tyre = &self.vehicle.axle(wheel).tyre;
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
        })
    }

    /// Whether the loads tell lifts: those of the balances do unless mass properties are guessed.
    fn are_loads_known(&self, forces: &PerWheel<TyreForce>) -> bool {
        let part = self.settings.tuning.lift.balance_sigma_max;
        Wheel::ALL.into_iter().all(|wheel| {
            let force = &forces[wheel];
            force.source != ForceSource::Inertial
                || force.sigma_n[2] < part * self.vehicle.static_load_n(wheel)
        })
    }

    /// Whether the road shakes the wheels.
    fn is_rough(&self) -> bool {
        let roughness = self.fusion.as_ref().map_or(0.0, Fusion::roughness);
        roughness > self.settings.tuning.lift.rough_density
    }

    /// Stage 9: warnings, lift and touchdown of wheels and sides.
    pub(super) fn detect_lift(
        &mut self,
        time: LogTime,
        state: &MotionState,
        measured: &PerWheel<TyreForce>,
        lagged: Option<&PerWheel<TyreForce>>,
        out: &mut impl FnMut(Output),
    ) -> Rollover {
        let speed_m_s = math::hypot(state.velocity_m_s.x, state.velocity_m_s.y);
        let t = &self.settings.tuning;
        let input = LiftInput {
            now: time,
            dt: GRID_S,
            judged: speed_m_s > t.lift_speed_min_m_s && self.are_loads_known(measured),
            rough: self.is_rough(),
            forces: measured,
            lagged,
            lag_s: LAG_STEPS as f64 * GRID_S,
        };
        self.lift.step(&input, &mut |event| {
            out(Output::Event(event));
        })
    }

    /// Stage 10: completes the reported motion by the force filter's angular rate, steer angles and
    /// slip angles.
    pub(super) fn complete_motion(
        &mut self,
        time: LogTime,
        motion: &mut Motion,
        state: &MotionState,
        forces: &PerWheel<TyreForce>,
        planar: Option<&PlanarMotion>,
        steer_rad: [f64; 4],
    ) {
        if let Some(fusion) = self.fusion.as_ref().filter(|_| state.inertial) {
            motion.rate_rad_s = fusion.rate_rad_s();
        }
        if let Some(planar) = planar {
            planar.write_to(motion);
        }
        if planar.is_none() {
            motion.sideslip_sigma_rad = self.sideslip_sigma_rad(time, motion.sideslip_sigma_rad);
        }
        self.complete_slope(time, motion, state, forces);
        motion.steer_rad = PerWheel(steer_rad);
        motion.slip_angle_rad = match &self.corners {
            Some(corners) => kinematics::slip_angles_on(corners, state),
            None => kinematics::slip_angles(&self.vehicle, state, steer_rad),
        };
    }

    /// Stage 11: grip from slip angles that GNSS gives and measured forces. Slip angles that were
    /// derived from grip are not used, nor are those of a vehicle that tips over.
    pub(super) fn learn_grip(
        &mut self,
        time: LogTime,
        state: &MotionState,
        motion: &Motion,
        measured: &PerWheel<TyreForce>,
        reported: &PerWheel<TyreForce>,
        out: &mut impl FnMut(Output),
    ) {
        if !self.monitors.steering.is_used()
            || self.lift.is_tipping()
            || measured.0[0].source != ForceSource::Fusion
        {
            return;
        }
        let input = GripInput {
            now: time,
            dt: GRID_S,
            speed_m_s: state.velocity_m_s.x,
            slip_angle_rad: &motion.slip_angle_rad,
            corrected_rad: self.feedback.steer_offset_rad,
            sideslip_sigma_rad: state.sideslip_sigma_rad,
            forces: measured,
            reported,
            rough: self.is_rough(),
        };
        self.grip
            .step(&input, &mut |event| out(Output::Event(event)));
    }

    /// Stage 12: what the next step uses of this one.
    pub(super) fn feed_back(
        &self,
        forces: PerWheel<TyreForce>,
        steering_wheel: Option<Gaussian>,
    ) -> EstimatorFeedback {
        let fusion = self.fusion.as_ref();
        EstimatorFeedback {
            forces,
            struts: fusion.map_or_else(Default::default, |fusion| {
                std::array::from_fn(|wheel| fusion.strut(wheel))
            }),
            body_motion: fusion.and_then(Fusion::body_motion),
            rate_dot_rad_s2: fusion.and_then(Fusion::rate_dot_rad_s2),
            steer_offset_rad: self.grip.steer_offset().0,
            steering_wheel,
            imu_consistent: self.monitors.imu_consistent(),
        }
    }

    /// Hands the step out for a smoother, if that was asked for.
    pub(super) fn trace(
        &mut self,
        estimate: &Estimate,
        frames: Option<PerWheel<WheelFrame>>,
        rate_dot_rad_s2: Vector3<f64>,
        navigated: bool,
        out: &mut impl FnMut(Output),
    ) {
        if self.traced {
            out(Output::Step(Box::new(Step {
                estimate: estimate.clone(),
                frames,
                solution: self.motion.solution(),
                operations: self.motion.take_operations(),
                navigated,
                planar: None,
                completed: self
                    .planar
                    .as_mut()
                    .map(Planar::take_traces)
                    .unwrap_or_default(),
                forces: self.fusion.as_mut().map(Fusion::take_trace),
                rate_dot_rad_s2,
            })));
        }
    }
}

/// Force and moment about the centre of gravity of a load on the hitch, vehicle axes, N and N m; `None` without a
/// hitch in the vehicle file or a recent value.
pub(super) fn hitch_wrench(
    vehicle: &Vehicle,
    readings: &Readings,
    now: LogTime,
    tuning: &Tuning,
) -> Option<Vector6<f64>> {
    let hitch = vehicle.hitch.as_ref()?;
    let (time, force_n) = readings.hitch_n?;
    if now.seconds_since(time) > tuning.hitch_held_s {
        return None;
    }
    let body = &vehicle.body;
    let [x, y, z] = hitch.position_m;
    let arm = Vector3::new(
        x + body.front_axle_to_cg_m,
        y - body.cg_y_m,
        z - body.cg_height_m,
    );
    let force = Vector3::from(force_n);
    let moment = arm.cross(&force);
    Some(Vector6::new(
        force.x, force.y, force.z, moment.x, moment.y, moment.z,
    ))
}
