//! Estimates that know what came after them: the smoother of replays.
//!
//! The [`Estimator`](crate::Estimator) is causal. Where a [`Smoother`] takes its [`Step`]s, each
//! estimate is made again from the measurements of at least [`LAG_STEPS`] steps more. A log of any
//! length needs the memory of two such windows. The forces forget within a second, so that what a
//! longer wait would add is what strain offsets and biases still learn.
//!
//! All filters are smoothed by the modified Bryson-Frazier form of the fixed-interval smoother
//! (G. J. Bierman, "Fixed interval smoothing with discrete measurements", Int. J. Control 18
//! (1973) 65-75), which equals Rauch, Tung and Striebel's but inverts no covariance: the strain
//! offsets' variances stand eight powers of ten below the forces'. Backward through the filter's
//! operations an adjoint vector l and its matrix L are carried,
//!
//! | operation | l | L |
//! |---|---|---|
//! | x ← F x | F' l | F' L F |
//! | z = h x + v | l - h' (y/S + K' l) | (I - K h)' L (I - K h) + h' h/S |
//!
//! and at each instant x_s = x - P l, P_s = P - P L P.

mod adjoint;

use std::collections::VecDeque;

use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{Estimate, LogTime, Motion, PerWheel};

use crate::fusion::layout::{BODY_RATE, SIZE};
use crate::fusion::{FusionTrace, OUTPUTS};
use crate::kinematics;
use crate::motion::{STATES, Solution};
use crate::planar::{self, PlanarTrace};
use crate::trace::Operation;
use crate::wheel_frame::WheelFrame;
use adjoint::Adjoint;

/// Steps after an instant that its smoothed estimate uses at least: 10 s.
pub const LAG_STEPS: usize = 1000;

/// Record of one step of the estimator for a smoother.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The causal estimate.
    pub estimate: Estimate,
    /// Axes of the wheels, if the vehicle has linkages.
    pub frames: Option<PerWheel<WheelFrame>>,
    /// State of the motion filter.
    pub solution: Solution,
    /// Operations of the motion filter since the step before.
    pub operations: Vec<Operation<STATES>>,
    /// Whether the estimate's motion is the motion filter's, and not the single-track filter's.
    pub navigated: bool,
    /// Record of the single-track filter, if the vehicle has one. [`Smoother::push`] sets it: it comes
    /// with the step that completes it.
    pub planar: Option<PlanarTrace>,
    /// Records of the single-track filter of instants that are complete with this step.
    pub completed: Vec<(LogTime, PlanarTrace)>,
    /// Record of the force filter, if the vehicle has one.
    pub forces: Option<FusionTrace>,
    /// Angular acceleration of the body that the step used, body axes, rad/s².
    pub rate_dot_rad_s2: Vector3<f64>,
}

/// The smoother.
#[derive(Clone, Debug)]
pub struct Smoother {
    vehicle: Vehicle,
    lag: usize,
    steps: VecDeque<Step>,
}

impl Smoother {
    /// A smoother with a lag of `lag` steps.
    #[must_use]
    pub fn new(vehicle: &Vehicle, lag: usize) -> Self {
        Self {
            vehicle: vehicle.clone(),
            lag: lag.max(1),
            steps: VecDeque::new(),
        }
    }

    /// Takes the next step. Smoothed estimates come out `lag` at a time.
    pub fn push(&mut self, mut step: Step, out: &mut impl FnMut(Estimate)) {
        let completed = std::mem::take(&mut step.completed);
        self.steps.push_back(step);
        for (time, trace) in completed {
            let mut steps = self.steps.iter_mut().rev();
            if let Some(step) = steps.find(|step| step.estimate.time == time) {
                step.planar = Some(trace);
            }
        }
        if self.steps.len() >= self.lag.saturating_mul(2) {
            self.smooth(self.lag, out);
        }
    }

    /// Hands out the remaining estimates, after the last step.
    pub fn finish(&mut self, out: &mut impl FnMut(Estimate)) {
        self.smooth(self.steps.len(), out);
    }

    /// Hands out the first `count` steps and removes them.
    fn smooth(&mut self, count: usize, out: &mut impl FnMut(Estimate)) {
        let mut smoothed = Vec::with_capacity(count);
        let mut later = Later::default();
        for (k, step) in self.steps.iter().enumerate().rev() {
            if k < count {
                smoothed.push(self.estimate(step, &later));
            }
            later.pass(step);
        }
        self.steps.drain(..count);
        smoothed.into_iter().rev().for_each(out);
    }

    fn estimate(&self, step: &Step, later: &Later) -> Estimate {
        let mut estimate = step.estimate.clone();
        if !step.navigated {
            if let Some(belief) = &step.planar {
                estimate.motion = self.planar(step, belief, &later.planar);
            }
        } else if step.solution.time.is_some() {
            estimate.motion = self.motion(step, &later.motion);
        }
        if let Some(belief) = &step.forces {
            put_forces(&mut estimate, belief, &later.forces, step.solution.inertial);
            if let Some(frames) = &step.frames {
                let own = estimate.carrier;
                let all = PerWheel::from_fn(|wheel| frames[wheel].of_carrier(&own[wheel]));
                estimate.carrier = PerWheel::from_fn(|wheel| all[wheel].carrier);
                estimate.measured = PerWheel::from_fn(|wheel| all[wheel].reported);
            }
        }
        estimate
    }

    fn motion(&self, step: &Step, adjoint: &Adjoint<STATES>) -> Motion {
        let filtered = &step.estimate.motion;
        let known = &step.solution.covariance;
        let solution = step
            .solution
            .clone()
            .corrected(&adjoint.correction(known), known - adjoint.shrinkage(known));
        let state = solution.state(step.estimate.time);
        let motion = kinematics::motion(&state);
        // The linkage's travel is not smoothed.
        let slip = |state| kinematics::slip_angles(&self.vehicle, state, filtered.steer_rad.0);
        let (causal, smoothed) = (slip(&step.solution.state(step.estimate.time)), slip(&state));
        let slip_angle_rad = PerWheel::from_fn(|wheel| {
            filtered.slip_angle_rad[wheel] + smoothed[wheel] - causal[wheel]
        });
        // What the causal estimate states beside the filter's standard deviation.
        let own = step.solution.state(step.estimate.time).sideslip_sigma_rad;
        let beside = filtered.sideslip_sigma_rad.powi(2) - own.powi(2);
        let sideslip_sigma_rad = if beside > 0.0 {
            math::hypot(motion.sideslip_sigma_rad, beside.sqrt())
        } else {
            motion.sideslip_sigma_rad
        };
        Motion {
            sideslip_sigma_rad,
            steer_rad: filtered.steer_rad,
            slip_angle_rad,
            longitudinal_slip: filtered.longitudinal_slip,
            longitudinal_slip_sigma: filtered.longitudinal_slip_sigma,
            bank_rad: filtered.bank_rad + motion.roll_rad - filtered.roll_rad,
            grade_rad: filtered.grade_rad + motion.pitch_rad - filtered.pitch_rad,
            ..motion
        }
    }

    fn planar(
        &self,
        step: &Step,
        belief: &PlanarTrace,
        adjoint: &Adjoint<{ planar::STATES }>,
    ) -> Motion {
        let known = &belief.covariance;
        let smoothed = belief.corrected(&adjoint.correction(known), &adjoint.shrinkage(known));
        let mut state = step.solution.state(step.estimate.time);
        smoothed.apply_to(&mut state);
        let mut motion = step.estimate.motion;
        motion.slip_angle_rad = kinematics::slip_angles(&self.vehicle, &state, motion.steer_rad.0);
        smoothed.write_to(&mut motion);
        motion
    }
}

/// Adjoints of all filters.
#[derive(Default)]
struct Later {
    motion: Adjoint<STATES>,
    planar: Adjoint<{ planar::STATES }>,
    forces: Adjoint<SIZE>,
}

impl Later {
    fn pass(&mut self, step: &Step) {
        self.motion.pass(&step.operations);
        if let Some(belief) = &step.planar {
            self.planar.pass(&belief.operations);
        }
        if let Some(belief) = &step.forces {
            self.forces.pass(&belief.operations);
        }
    }
}

/// Writes the smoothed forces and, with an inertial unit, the smoothed rates into the estimate.
fn put_forces(
    estimate: &mut Estimate,
    belief: &FusionTrace,
    adjoint: &Adjoint<SIZE>,
    inertial: bool,
) {
    let correction = adjoint.correction(&belief.covariance);
    let shrinkage = adjoint.shrinkage(&belief.covariance);
    for (k, state) in OUTPUTS.into_iter().enumerate() {
        let value = belief.state[state] + correction[k];
        if let Some(axis) = state.checked_sub(BODY_RATE) {
            if inertial {
                estimate.motion.rate_rad_s[axis] = value;
            }
        } else {
            let force = &mut estimate.carrier.0[state / 3];
            let known = belief.covariance[(k, state)];
            force.force_n[state % 3] = value;
            let variance = (known - shrinkage[(k, k)]).max(0.0) + belief.by_latency[k];
            force.sigma_n[state % 3] = variance.sqrt();
        }
    }
}
