//! Tyre grip: cornering stiffness and friction of each axle from measured lateral forces and slip
//! angles, and changes of the surface.
//!
//! Each axle has an extended Kalman filter of four states: the logarithms of the factors on the
//! tyre file's cornering stiffness and friction; a constant error of the slip angle (of the
//! steering wheel's zero at the front axle, of the heading at both), which straight driving
//! separates from stiffness; and the shape of the curve between the two (`part_of_grip`): how near
//! the friction limit is can be seen only as well as the shape is known. One value is taken every
//! `block_steps` steps: the mean lateral force of the axle against the curve at the same slip
//! angles and loads. The slip angle's error is correlated for about a second, so each value has a
//! reduced weight.
//!
//! Friction is observable only while a good part of it is in use, above about 0.4. Below, the
//! sensitivity to friction vanishes, the factor walks and its standard deviation grows. Then
//! [`Grip::axle`] reports no friction, only the largest part in use within the last `USED_SECONDS`.
//!
//! The lower bound of the friction coefficient (`bound`) holds on any ground: the force of an axle
//! along the ground over its load, less `bound_sigma` standard deviations, which contain the
//! unknown normal of rough ground. It is the largest value within the last `USED_SECONDS`. These
//! have about ten values with independent errors, so that three standard deviations of each give a
//! bound that holds with a probability of 0.98.
//!
//! A change of surface is found by a two-sided cumulative sum of normalised differences with the
//! sign of the expected force while the tyres are excited. With k = 0.5 and h = 10.94 white
//! differences would give one false alarm an hour at 100 Hz; the differences are slower and not
//! white, so the reference is `cusum_reference`. A change is declared only at a posterior
//! probability of at least `posterior_min`. On rough ground the differences have errors of unknown
//! size, such a posterior is not reached, and no change is declared.

mod bound;
mod surface;

use model::vehicle::{self, Vehicle};
use nalgebra::{Matrix4, Vector4};
use sample::{Axle, AxleGrip, Event, EventKind, LogTime, PerWheel, TyreForce};

use crate::tuning::GripTuning;

use bound::{BoundBlock, UsedFriction};

/// Part of the grip mu N at the slip for which the linear stiffness alone would give `linear` of
/// it: the rational curve of Rill's TMeasy (*Road Vehicle Dynamics*, 2012, section 3.3), which
/// rises with slope 1 and reaches 1 at `linear` = `shape`. With 3 it is within 0.02 of Fiala's
/// parabola; with 2, the smallest value, it stays linear the longest.
fn part_of_grip(linear: f64, shape: f64) -> f64 {
    let full = (linear / shape).min(1.0);
    shape * full / (1.0 + full * (full + shape - 2.0))
}

/// Where [`part_of_grip`] is `part`.
fn linear_part(part: f64, shape: f64) -> f64 {
    let b = shape - part * (shape - 2.0);
    2.0 * part * shape / (b + (b * b - 4.0 * part * part).max(0.0).sqrt())
}

#[derive(Clone, Debug)]
struct AxleTyres {
    tuning: GripTuning,
    stiffness_n_rad: f64,
    reference_n: f64,
    exponent: f64,
    friction: f64,
    relaxation_length_m: f64,
    /// Tangents of the contact patches' slip angles, once known.
    patch: Option<[f64; 2]>,
    /// ln of the stiffness factor and of the friction factor; slip angle's error, rad; shape.
    state: Vector4<f64>,
    covariance: Matrix4<f64>,
    /// Cumulative sums of lost and gained grip.
    runs: [ChangeRun; 2],
    learned: u32,
    used: UsedFriction,
    bound: UsedFriction,
    bounding: BoundBlock,
    block: Block,
}

/// A cumulative sum, and the forces since it left zero.
#[derive(Clone, Copy, Debug, Default)]
struct ChangeRun {
    sum: f64,
    values: u32,
    force_n: f64,
    expected_n: f64,
}

/// A detected change.
#[derive(Clone, Copy, Debug)]
struct Change {
    ratio: f64,
    values: u32,
    probability: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Block {
    steps: u32,
    force_n: f64,
    variance: f64,
    load_n: [f64; 2],
    slip: [f64; 2],
    longitudinal_n: f64,
}

/// Stiffness and friction of both axles.
#[derive(Clone, Debug)]
pub struct Grip {
    tuning: GripTuning,
    axles: [AxleTyres; 2],
    front_changed: Option<LogTime>,
}

/// Input of one step.
#[derive(Clone, Copy, Debug)]
pub struct GripInput<'a> {
    /// The instant.
    pub now: LogTime,
    /// Since the last one, s.
    pub dt: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Slip angles, rad.
    pub slip_angle_rad: &'a PerWheel<f64>,
    /// Part of the front steer angle that corrects the steering wheel's zero, rad.
    pub corrected_rad: f64,
    /// Standard deviation of the sideslip angle, rad.
    pub sideslip_sigma_rad: f64,
    /// Measured forces.
    pub forces: &'a PerWheel<TyreForce>,
    /// The same with the unknown normal of the ground in the standard deviations.
    pub reported: &'a PerWheel<TyreForce>,
    /// Whether the ground is rough: what it does to the forces is no other surface.
    pub rough: bool,
}

impl Grip {
    /// The tyre file's stiffness and friction.
    #[must_use]
    pub fn new(vehicle: &Vehicle, tuning: &GripTuning) -> Self {
        Self {
            tuning: *tuning,
            axles: [
                AxleTyres::new(&vehicle.front.tyre, tuning),
                AxleTyres::new(&vehicle.rear.tyre, tuning),
            ],
            front_changed: None,
        }
    }

    /// The same factors on the stiffness and friction of other tyres.
    pub fn load(&mut self, vehicle: &Vehicle) {
        let tyres = [&vehicle.front.tyre, &vehicle.rear.tyre];
        for (axle, tyre) in self.axles.iter_mut().zip(tyres) {
            axle.stiffness_n_rad = tyre.cornering_stiffness_n_rad;
            axle.friction = tyre.friction;
        }
    }

    /// Estimated grip of an axle at `now`, front (0) or rear (1).
    #[must_use]
    pub fn axle(&self, axle: usize, now: LogTime) -> AxleGrip {
        let a = &self.axles[axle];
        let [stiffness_sigma, friction_sigma] = [0, 1].map(|i| a.covariance[(i, i)].sqrt());
        let (stiffness_factor, friction) = (math::exp(a.state[0]), a.friction());
        let utilisation = a.used.largest(now) / friction;
        let t = &self.tuning;
        let seen = utilisation >= t.utilisation_min && friction_sigma < t.friction_sigma_max;
        AxleGrip {
            stiffness_factor,
            stiffness_factor_sigma: stiffness_factor * stiffness_sigma,
            friction: seen.then_some(friction),
            friction_sigma: seen.then_some(friction * friction_sigma),
            friction_min: a.bound.largest(now),
            utilisation,
            utilisation_sigma: utilisation * friction_sigma,
        }
    }

    /// Steer offset: how much further left the front wheels point than the steering wheel's zero
    /// states, and its standard deviation, rad. It is the difference of the axles' slip-angle
    /// errors.
    #[must_use]
    pub fn steer_offset(&self) -> (f64, f64) {
        let [front, rear] = &self.axles;
        (
            front.state[2] - rear.state[2],
            (front.covariance[(2, 2)] + rear.covariance[(2, 2)]).sqrt(),
        )
    }

    /// Slip angle that an axle's measured lateral force implies and its standard deviation, rad;
    /// `None` if the force is unknown or near the friction limit.
    #[must_use]
    pub fn slip_angle(&self, axle: usize, forces: &PerWheel<TyreForce>) -> Option<(f64, f64)> {
        let t = &self.tuning;
        let a = &self.axles[axle];
        let pair = [&forces.0[2 * axle], &forces.0[2 * axle + 1]];
        let lateral: f64 = pair.iter().map(|f| f.force_n[1]).sum();
        let loads = pair.map(|f| f.force_n[2].max(0.0));
        let load: f64 = loads.iter().sum();
        let stiffness: f64 = loads.iter().map(|n| a.stiffness_at(*n)).sum();
        let used = lateral.abs() / (load * a.friction()).max(1.0);
        let known = lateral.is_finite()
            && load > t.load_min_n
            && stiffness > 0.0
            && used < t.slip_utilisation_max;
        known.then(|| {
            let angle = linear_part(used, a.state[3]) * a.friction() * load / stiffness;
            let doubt =
                a.covariance[(0, 0)].sqrt() + t.slip_sigma_part + t.slip_sigma_utilisation * used;
            (
                -math::atan(angle) * lateral.signum(),
                t.slip_sigma_rad + doubt * angle,
            )
        })
    }

    /// Takes one instant and reports changes of the surface.
    pub fn step(&mut self, input: &GripInput<'_>, out: &mut impl FnMut(Event)) {
        let t = self.tuning;
        for (i, axle) in self.axles.iter_mut().enumerate() {
            let pair = [2 * i, 2 * i + 1].map(|w| &input.reported.0[w]);
            if let Some(bound) = axle.bounding.take(pair, &t) {
                axle.bound.take(input.now, bound);
            }
        }
        let usable = input.speed_m_s > t.speed_min_m_s
            && input.sideslip_sigma_rad < t.sideslip_sigma_max_rad;
        for (i, axle) in self.axles.iter_mut().enumerate() {
            let pair = [2 * i, 2 * i + 1].map(|w| (&input.forces.0[w], input.slip_angle_rad.0[w]));
            let finite = pair.iter().all(|(force, slip)| {
                slip.is_finite()
                    && force.force_n.iter().all(|f| f.is_finite())
                    && force.sigma_n[1] < t.lateral_sigma_max_n
            });
            if !usable || !finite {
                axle.block = Block::default();
                axle.patch = None;
                continue;
            }
            let rolled_m = input.speed_m_s * input.dt;
            let slip = axle.relaxed(pair.map(|(_, slip)| math::tan(slip)), rolled_m);
            axle.block.add(pair.map(|(force, _)| force), slip);
            if axle.block.steps < t.block_steps {
                continue;
            }
            let mut block = axle.block.mean();
            axle.block = Block::default();
            axle.used.take(input.now, block.used_friction(&t));
            if i == 0 {
                block.slip = block.slip.map(|slip| slip + input.corrected_rad);
            }
            let span_s = input.dt * f64::from(t.block_steps);
            let follows = i == 1
                && self
                    .front_changed
                    .is_some_and(|time| input.now.seconds_since(time) < t.follows_s);
            let part = if follows { t.follows_part } else { 1.0 };
            if input.rough {
                axle.forget_changes();
            }
            if let Some(change) = axle.take(&block, span_s, input.sideslip_sigma_rad, part) {
                if i == 0 {
                    self.front_changed = Some(input.now);
                }
                out(change.event(input.now, span_s, Axle::ALL[i]));
            }
        }
    }
}

impl Change {
    fn event(self, now: LogTime, span_s: f64, axle: Axle) -> Event {
        Event {
            time: now,
            onset: now.offset_seconds(-span_s * f64::from(self.values)),
            kind: EventKind::SurfaceChange(axle, self.ratio),
            probability: Some(self.probability),
            load_transfer_ratio: None,
            text: format!(
                "the surface under the {axle} axle changed: {:.0} % of the lateral force",
                100.0 * self.ratio
            ),
        }
    }
}

impl Block {
    fn add(&mut self, pair: [&TyreForce; 2], slip: [f64; 2]) {
        self.steps += 1;
        for (i, force) in pair.into_iter().enumerate() {
            self.force_n += force.force_n[1];
            self.variance += force.sigma_n[1].powi(2);
            self.load_n[i] += force.force_n[2];
            self.slip[i] += slip[i];
            self.longitudinal_n += force.force_n[0].abs();
        }
    }

    fn mean(&self) -> Self {
        let part = 1.0 / f64::from(self.steps.max(1));
        Self {
            steps: self.steps,
            force_n: self.force_n * part,
            variance: self.variance * part,
            load_n: self.load_n.map(|n| n * part),
            slip: self.slip.map(|s| s * part),
            longitudinal_n: self.longitudinal_n * part,
        }
    }

    /// Lower bound of the friction in use: lateral force less two standard deviations, over the
    /// load.
    fn used_friction(&self, tuning: &GripTuning) -> f64 {
        let load: f64 = self.load_n.iter().sum();
        let lateral = self.force_n.abs() - tuning.used_sigma * self.variance.sqrt();
        if load < tuning.load_min_n {
            0.0
        } else {
            lateral.max(0.0) / load
        }
    }
}

impl AxleTyres {
    fn new(tyre: &vehicle::Tyre, tuning: &GripTuning) -> Self {
        Self {
            tuning: *tuning,
            stiffness_n_rad: tyre.cornering_stiffness_n_rad,
            reference_n: tyre.reference_load_n.max(1.0),
            exponent: tyre.load_exponent,
            friction: tyre.friction,
            relaxation_length_m: tyre.relaxation_length_m,
            patch: None,
            state: Vector4::from(tuning.start),
            covariance: Matrix4::from_diagonal(&Vector4::from(tuning.start_sigma.map(|s| s * s))),
            runs: [ChangeRun::default(); 2],
            learned: 0,
            used: UsedFriction::default(),
            bound: UsedFriction::default(),
            bounding: BoundBlock::default(),
            block: Block::default(),
        }
    }

    /// Slip at the contact patches after `rolled_m`: the tyre's side deflects over its relaxation
    /// length ([`model::tyre::relaxed_rate`], by backward Euler).
    fn relaxed(&mut self, slip: [f64; 2], rolled_m: f64) -> [f64; 2] {
        let part = rolled_m / (rolled_m + self.relaxation_length_m);
        let before = self.patch.unwrap_or(slip);
        let now = std::array::from_fn(|i| before[i] + part * (slip[i] - before[i]));
        self.patch = Some(now);
        now
    }

    fn stiffness_at(&self, load_n: f64) -> f64 {
        self.file_stiffness(load_n) * math::exp(self.state[0])
    }

    fn file_stiffness(&self, load_n: f64) -> f64 {
        self.stiffness_n_rad * math::powf(load_n.max(0.0) / self.reference_n, self.exponent)
    }

    fn friction(&self) -> f64 {
        self.friction * math::exp(self.state[1])
    }

    fn lateral_n(&self, block: &Block, state: &Vector4<f64>) -> f64 {
        let [stiffness, friction] = [math::exp(state[0]), self.friction * math::exp(state[1])];
        let wheels = block.load_n.iter().zip(block.slip);
        wheels
            .map(|(load, slip)| {
                let grip = (friction * load).max(1.0);
                let linear = self.file_stiffness(*load) * stiffness * (slip - state[2]);
                -grip * part_of_grip(linear.abs() / grip, state[3]) * linear.signum()
            })
            .sum()
    }

    /// Takes a mean value; returns a change of the surface, if one is found. `part` scales the
    /// threshold.
    fn take(
        &mut self,
        block: &Block,
        span_s: f64,
        sideslip_sigma: f64,
        part: f64,
    ) -> Option<Change> {
        let t = self.tuning;
        let load: f64 = block.load_n.iter().sum();
        for (i, walk) in t.walk.into_iter().enumerate() {
            let most = t.start_sigma[i].powi(2);
            let grown = self.covariance[(i, i)] + walk * walk * span_s;
            self.covariance[(i, i)] = grown.min(most.max(self.covariance[(i, i)]));
        }
        if load < t.load_min_n || block.longitudinal_n > t.longitudinal_max * load {
            return None;
        }
        let expected = self.lateral_n(block, &self.state);
        let step = 1e-4;
        let slope = Vector4::from_fn(|i, _| {
            let mut moved = self.state;
            moved[i] += step;
            (self.lateral_n(block, &moved) - expected) / step
        });
        let stiffness: f64 = block.load_n.iter().map(|n| self.stiffness_at(*n)).sum();
        let own = block.variance
            + (t.sideslip_factor * stiffness * sideslip_sigma).powi(2)
            + (t.model_part * load).powi(2);
        let ph = self.covariance * slope;
        let spread = slope.dot(&ph);
        let innovation = block.force_n - expected;
        let excited = expected.abs() >= t.excited * load;
        let deviation = (own + spread).sqrt();
        let change = excited
            .then(|| self.watch(block.force_n, expected, deviation, part))
            .flatten();
        let total = spread + t.correlated_values * own;
        self.state += ph * (innovation / total);
        for (i, [least, most]) in [
            (0, t.factor_ln_bounds),
            (1, t.factor_ln_bounds),
            (2, t.slip_error_bounds_rad),
            (3, t.shape_bounds),
        ] {
            self.state[i] = self.state[i].clamp(least, most);
        }
        self.covariance -= ph * ph.transpose() / total;
        change
    }

    /// Forgets what may become a change of surface: none is found before as many values as after a change.
    /// The learnt stiffness and friction stay.
    fn forget_changes(&mut self) {
        self.runs = [ChangeRun::default(); 2];
        self.learned = 0;
    }

    fn watch(&mut self, force_n: f64, expected_n: f64, sigma: f64, part: f64) -> Option<Change> {
        if self.learned < self.tuning.learning_values {
            self.learned += 1;
            return None;
        }
        let sign = expected_n.signum();
        let size = (force_n - expected_n) * sign / sigma;
        for (run, size) in self.runs.iter_mut().zip([-size, size]) {
            run.sum += size - self.tuning.cusum_reference;
            if run.sum <= 0.0 {
                *run = ChangeRun::default();
                continue;
            }
            run.values += 1;
            run.force_n += force_n * sign;
            run.expected_n += expected_n * sign;
        }
        let t = &self.tuning;
        let found = self.runs.iter().find_map(|run| run.change(part, t))?;
        self.runs = [ChangeRun::default(); 2];
        self.learned = 0;
        self.used = UsedFriction::default();
        self.bound = UsedFriction::default();
        for i in 0..2 {
            self.covariance.row_mut(i).fill(0.0);
            self.covariance.column_mut(i).fill(0.0);
            self.covariance[(i, i)] = t.changed_sigma[i] * t.changed_sigma[i];
        }
        Some(found)
    }
}

impl ChangeRun {
    /// A sum of z - k is the likelihood ratio of a shift by 2k over none, divided by 2k.
    fn change(&self, part: f64, tuning: &GripTuning) -> Option<Change> {
        let ratio = (self.force_n / self.expected_n.max(1.0)).clamp(0.0, 10.0);
        if self.sum < part * tuning.cusum_threshold || (ratio - 1.0).abs() < tuning.change_min {
            return None;
        }
        let odds = 2.0 * tuning.cusum_reference * self.sum / part - tuning.log_odds;
        let probability = 1.0 / (1.0 + math::exp(-odds));
        (probability >= tuning.posterior_min).then_some(Change {
            ratio,
            values: self.values,
            probability,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum whose posterior is below the limit declares nothing, however low the threshold is.
    #[test]
    fn a_change_needs_its_posterior() {
        let tuning = GripTuning {
            cusum_threshold: 1.0,
            ..GripTuning::default()
        };
        let posterior = |sum: f64| {
            let run = ChangeRun {
                sum,
                values: 5,
                force_n: 500.0,
                expected_n: 1000.0,
            };
            run.change(1.0, &tuning).map(|change| change.probability)
        };
        // ln(0.99/0.01) and the prior odds, over twice the reference.
        let limit = (math::ln(99.0) + tuning.log_odds) / (2.0 * tuning.cusum_reference);
        assert_eq!(posterior(0.99 * limit), None);
        assert!(posterior(1.01 * limit).is_some_and(|p| p >= 0.99));
    }

    #[test]
    fn the_curve_has_an_inverse_and_holds_fialas() {
        let t = GripTuning::default();
        let [least, most] = t.shape_bounds;
        for shape in [least, t.start[3], most] {
            for part in [0.1, 0.5, 0.7, 0.99] {
                let linear = linear_part(part, shape);
                assert!((part_of_grip(linear, shape) - part).abs() < 1e-12);
            }
            assert_eq!(part_of_grip(2.0 * shape, shape), 1.0);
        }
        for step in 0..=300 {
            let linear = 0.01 * f64::from(step);
            let fiala = model::tyre::brush_over_grip(linear / 3.0);
            assert!((part_of_grip(linear, 3.0) - fiala).abs() < 0.02, "{linear}");
        }
    }
}
