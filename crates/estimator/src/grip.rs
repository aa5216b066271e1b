//! What the tyres have to do with the road: stiffness and friction of each axle, found from the
//! measured lateral forces and the measured slip angles, and changes of the surface.
//!
//! Per axle an extended Kalman filter of four states: the logarithms of the factors on the tyre
//! file's cornering stiffness and friction; a constant error of the slip angle (of the hand wheel's
//! zero at the front axle, of the heading at both), which straight driving tells apart from
//! stiffness; and the shape of the curve between the two (`part_of_grip`), since how far a tyre
//! bends tells how near its friction is only as well as it is known how it bends. One value comes
//! every `BLOCK_STEPS` steps: the mean of the axle's lateral force against the curve's at the same
//! slip angles and loads. The slip angle's error stays alike for about a second, so each value
//! counts for a part only.
//!
//! Friction is visible only where a good part of it is used, above about 0.4: below, the slope by
//! it vanishes, its factor walks, and its deviation says so. [`Grip::axle`] then tells none, only
//! what the lateral forces of the last `USED_SECONDS` call for at least.
//!
//! A change of surface is a two-sided cumulative sum over the normalised differences while the
//! tyres are excited, with the sign of the expected force: falling where grip is lost. At k = 0.5
//! and h = 10.94 white differences would alarm once an hour at 100 Hz; these are slower and not
//! white, so the reference is raised to `CUSUM_REFERENCE`.

use model::vehicle::{self, Vehicle};
use nalgebra::{Matrix4, Vector4};
use sample::{Axle, AxleGrip, Event, EventKind, LogTime, NANOS_PER_SECOND, PerWheel, TyreForce};

/// Steps of one value.
const BLOCK_STEPS: u32 = 5;
/// How many values one error lasts.
const CORRELATED: f64 = 6.0;
/// Sideslip's error lasts for longer: so many of its deviations are counted.
const SLIP_LASTS: f64 = 2.0;
/// Walk of ln stiffness and ln friction, 1/sqrt(s), of the slip angle's error, rad/sqrt(s), and of
/// the shape, which is the tyre's own.
const WALK: [f64; 4] = [0.01, 0.03, 1e-4, 0.0];
/// The four at the start, and their deviations.
const START: [f64; 4] = [0.0, 0.0, 0.0, 2.7];
const START_SIGMA: [f64; 4] = [0.4, 0.3, 0.015, 0.5];
/// Bounds of the factors' logarithms, of the slip angle's error, rad, and of the shape.
const FACTOR_LN: (f64, f64) = (-2.0, 1.5);
const SLIP_ERROR_RAD: (f64, f64) = (-0.05, 0.05);
const SHAPE: (f64, f64) = (2.0, 3.2);
/// Deviation of ln stiffness and ln friction after a change of surface: it is friction that grounds
/// differ in.
const CHANGED: [f64; 2] = [0.3, 0.7];
/// Deviation of ln friction above which the tyres have not been used enough to tell it.
const FRICTION_SIGMA_MAX: f64 = 0.2;
/// Part of the friction that must have been used to tell it, and how long ago at most, s.
const UTILISATION_MIN: f64 = 0.4;
const USED_SECONDS: usize = 10;
/// Model error as a part of the axle's load.
const MODEL_PART: f64 = 0.018;
/// Slowest speed, m/s, and largest deviation of sideslip, rad, at which slip angles are used.
const SPEED_MIN_M_S: f64 = 2.5;
const SIDESLIP_SIGMA_MAX_RAD: f64 = 0.01;
/// Deviation of a wheel's lateral force above which it is the tyre model's own guess, N.
const LATERAL_SIGMA_MAX_N: f64 = 100.0;
/// Load of an axle below which its tyres tell nothing, N.
const LOAD_MIN_N: f64 = 100.0;
/// Axle force over load below which nothing is excited.
const EXCITED: f64 = 0.15;
/// Longitudinal force over load from which lateral force is not the tyres' pure one.
const LONGITUDINAL_MAX: f64 = 0.2;
/// Reference value and threshold of the cumulative sums.
const CUSUM_REFERENCE: f64 = 0.75;
const CUSUM_THRESHOLD: f64 = 10.94;
/// Logarithm of the odds that no change has come, at one an hour and twenty values a second.
const LOG_ODDS: f64 = 11.2;
/// Least change of the lateral force that is called one.
const CHANGE_MIN: f64 = 0.1;
/// Where the front axle's ground has changed the rear axle's will within this time, s: so much less
/// is asked of it.
const FOLLOWS_S: f64 = 3.0;
const FOLLOWS_PART: f64 = 0.35;
/// Excited values before changes are declared.
const LEARNED: u32 = 100;

/// Part of the grip mu N that a tyre gives where its stiffness alone would give `linear` of it: the
/// rational curve of Rill's TMeasy (*Road Vehicle Dynamics*, 2012, section 3.3), which rises with
/// slope 1 and is full at `linear` = `shape`. At 3 it runs within 0.02 of Fiala's parabola; at 2,
/// its least, it keeps straight the longest.
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
    stiffness_n_rad: f64,
    reference_n: f64,
    exponent: f64,
    friction: f64,
    relaxation_length_m: f64,
    /// Tangents of the slip angles that the contact patches see, once any are known.
    patch: Option<[f64; 2]>,
    /// ln of the stiffness factor and of the friction factor; slip angle's error, rad; shape.
    state: Vector4<f64>,
    covariance: Matrix4<f64>,
    /// Grip lost, grip won.
    runs: [ChangeRun; 2],
    learned: u32,
    used: UsedFriction,
    block: Block,
}

/// Largest lateral force over load in each of the last seconds of the log clock, with the second.
#[derive(Clone, Copy, Debug, Default)]
struct UsedFriction([(u64, f64); USED_SECONDS]);

/// A cumulative sum and what has come together since it left zero.
#[derive(Clone, Copy, Debug, Default)]
struct ChangeRun {
    sum: f64,
    values: u32,
    force_n: f64,
    expected_n: f64,
}

/// A change that was found.
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
    axles: [AxleTyres; 2],
    front_changed: Option<LogTime>,
}

/// What one step is given.
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
    /// Part of the front axle's steer angle that stands for the error of the hand wheel's zero, rad.
    pub corrected_rad: f64,
    /// Deviation of the sideslip angle, rad.
    pub sideslip_sigma_rad: f64,
    /// Measured forces.
    pub forces: &'a PerWheel<TyreForce>,
}

impl Grip {
    /// The tyre file's stiffness and friction.
    #[must_use]
    pub fn new(vehicle: &Vehicle) -> Self {
        Self {
            axles: [
                AxleTyres::new(&vehicle.front.tyre),
                AxleTyres::new(&vehicle.rear.tyre),
            ],
            front_changed: None,
        }
    }

    /// What is known at `now` of the tyres of an axle, front (0) or rear (1).
    #[must_use]
    pub fn axle(&self, axle: usize, now: LogTime) -> AxleGrip {
        let a = &self.axles[axle];
        let [stiffness_sigma, friction_sigma] = [0, 1].map(|i| a.covariance[(i, i)].sqrt());
        let (stiffness_factor, friction) = (math::exp(a.state[0]), a.friction());
        let friction_min = a.used.largest(now);
        let utilisation = friction_min / friction;
        let seen = utilisation >= UTILISATION_MIN && friction_sigma < FRICTION_SIGMA_MAX;
        AxleGrip {
            stiffness_factor,
            stiffness_factor_sigma: stiffness_factor * stiffness_sigma,
            friction: seen.then_some(friction),
            friction_sigma: seen.then_some(friction * friction_sigma),
            friction_min,
            utilisation,
            utilisation_sigma: utilisation * friction_sigma,
        }
    }

    /// How much further left the front wheels stand than the hand wheel's zero has it, and its
    /// deviation, rad: the error of their slip angle beside the rear wheels'.
    #[must_use]
    pub fn steer_offset(&self) -> (f64, f64) {
        let [front, rear] = &self.axles;
        (
            front.state[2] - rear.state[2],
            (front.covariance[(2, 2)] + rear.covariance[(2, 2)]).sqrt(),
        )
    }

    /// Slip angle that an axle's measured lateral force calls for, with its deviation, rad;
    /// `None` where the force is unknown or near the friction's limit.
    #[must_use]
    pub fn slip_angle(&self, axle: usize, forces: &PerWheel<TyreForce>) -> Option<(f64, f64)> {
        let a = &self.axles[axle];
        let pair = [&forces.0[2 * axle], &forces.0[2 * axle + 1]];
        let lateral: f64 = pair.iter().map(|f| f.force_n[1]).sum();
        let loads = pair.map(|f| f.force_n[2].max(0.0));
        let load: f64 = loads.iter().sum();
        let stiffness: f64 = loads.iter().map(|n| a.stiffness_at(*n)).sum();
        let used = lateral.abs() / (load * a.friction()).max(1.0);
        let known = lateral.is_finite() && load > LOAD_MIN_N && stiffness > 0.0 && used < 0.7;
        known.then(|| {
            let angle = linear_part(used, a.state[3]) * a.friction() * load / stiffness;
            let doubt = a.covariance[(0, 0)].sqrt() + 0.1 + 0.5 * used;
            (-math::atan(angle) * lateral.signum(), 0.006 + doubt * angle)
        })
    }

    /// Takes one instant in and hands out changes of the surface.
    pub fn step(&mut self, input: &GripInput<'_>, out: &mut impl FnMut(Event)) {
        let usable =
            input.speed_m_s > SPEED_MIN_M_S && input.sideslip_sigma_rad < SIDESLIP_SIGMA_MAX_RAD;
        for (i, axle) in self.axles.iter_mut().enumerate() {
            let pair = [2 * i, 2 * i + 1].map(|w| (&input.forces.0[w], input.slip_angle_rad.0[w]));
            let finite = pair.iter().all(|(force, slip)| {
                slip.is_finite()
                    && force.force_n.iter().all(|f| f.is_finite())
                    && force.sigma_n[1] < LATERAL_SIGMA_MAX_N
            });
            if !usable || !finite {
                axle.block = Block::default();
                axle.patch = None;
                continue;
            }
            let rolled_m = input.speed_m_s * input.dt;
            let slip = axle.relaxed(pair.map(|(_, slip)| math::tan(slip)), rolled_m);
            axle.block.add(pair.map(|(force, _)| force), slip);
            if axle.block.steps < BLOCK_STEPS {
                continue;
            }
            let mut block = axle.block.mean();
            axle.block = Block::default();
            axle.used.take(input.now, block.used_friction());
            if i == 0 {
                block.slip = block.slip.map(|slip| slip + input.corrected_rad);
            }
            let span_s = input.dt * f64::from(BLOCK_STEPS);
            let follows = i == 1
                && self
                    .front_changed
                    .is_some_and(|time| input.now.seconds_since(time) < FOLLOWS_S);
            let part = if follows { FOLLOWS_PART } else { 1.0 };
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

    /// Least part of the axle's load that its lateral force is, within two deviations.
    fn used_friction(&self) -> f64 {
        let load: f64 = self.load_n.iter().sum();
        let lateral = self.force_n.abs() - 2.0 * self.variance.sqrt();
        if load < LOAD_MIN_N {
            0.0
        } else {
            lateral.max(0.0) / load
        }
    }
}

impl UsedFriction {
    fn take(&mut self, now: LogTime, used: f64) {
        let second = now.0 / NANOS_PER_SECOND as u64;
        let slot = &mut self.0[second as usize % USED_SECONDS];
        *slot = match *slot {
            (same, before) if same == second => (second, used.max(before)),
            _ => (second, used),
        };
    }

    fn largest(&self, now: LogTime) -> f64 {
        let oldest = (now.0 / NANOS_PER_SECOND as u64).saturating_sub(USED_SECONDS as u64);
        let late = self.0.iter().filter(|(second, _)| *second >= oldest);
        late.fold(0.0, |most, (_, used)| used.max(most))
    }
}

impl AxleTyres {
    fn new(tyre: &vehicle::Tyre) -> Self {
        Self {
            stiffness_n_rad: tyre.cornering_stiffness_n_rad,
            reference_n: tyre.reference_load_n.max(1.0),
            exponent: tyre.load_exponent,
            friction: tyre.friction,
            relaxation_length_m: tyre.relaxation_length_m,
            patch: None,
            state: Vector4::from(START),
            covariance: Matrix4::from_diagonal(&Vector4::from(START_SIGMA.map(|s| s * s))),
            runs: [ChangeRun::default(); 2],
            learned: 0,
            used: UsedFriction::default(),
            block: Block::default(),
        }
    }

    /// What the contact patches see of the wheels' slip after `rolled_m` more: a tyre's side bends
    /// first, over its relaxation length ([`model::tyre::relaxed_rate`], by backward Euler).
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

    /// Takes a mean value in; tells where the surface is found to have changed. `part` of the usual
    /// evidence is asked for.
    fn take(
        &mut self,
        block: &Block,
        span_s: f64,
        sideslip_sigma: f64,
        part: f64,
    ) -> Option<Change> {
        let load: f64 = block.load_n.iter().sum();
        for (i, walk) in WALK.into_iter().enumerate() {
            let most = START_SIGMA[i].powi(2);
            let grown = self.covariance[(i, i)] + walk * walk * span_s;
            self.covariance[(i, i)] = grown.min(most.max(self.covariance[(i, i)]));
        }
        if load < LOAD_MIN_N || block.longitudinal_n > LONGITUDINAL_MAX * load {
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
            + (SLIP_LASTS * stiffness * sideslip_sigma).powi(2)
            + (MODEL_PART * load).powi(2);
        let ph = self.covariance * slope;
        let spread = slope.dot(&ph);
        let innovation = block.force_n - expected;
        let excited = expected.abs() >= EXCITED * load;
        let deviation = (own + spread).sqrt();
        let change = excited
            .then(|| self.watch(block.force_n, expected, deviation, part))
            .flatten();
        let total = spread + CORRELATED * own;
        self.state += ph * (innovation / total);
        for (i, (least, most)) in [
            (0, FACTOR_LN),
            (1, FACTOR_LN),
            (2, SLIP_ERROR_RAD),
            (3, SHAPE),
        ] {
            self.state[i] = self.state[i].clamp(least, most);
        }
        self.covariance -= ph * ph.transpose() / total;
        change
    }

    fn watch(&mut self, force_n: f64, expected_n: f64, sigma: f64, part: f64) -> Option<Change> {
        if self.learned < LEARNED {
            self.learned += 1;
            return None;
        }
        let sign = expected_n.signum();
        let size = (force_n - expected_n) * sign / sigma;
        for (run, size) in self.runs.iter_mut().zip([-size, size]) {
            run.sum += size - CUSUM_REFERENCE;
            if run.sum <= 0.0 {
                *run = ChangeRun::default();
                continue;
            }
            run.values += 1;
            run.force_n += force_n * sign;
            run.expected_n += expected_n * sign;
        }
        let found = self.runs.iter().find_map(|run| run.change(part))?;
        self.runs = [ChangeRun::default(); 2];
        self.learned = 0;
        self.used = UsedFriction::default();
        for i in 0..2 {
            self.covariance.row_mut(i).fill(0.0);
            self.covariance.column_mut(i).fill(0.0);
            self.covariance[(i, i)] = CHANGED[i] * CHANGED[i];
        }
        Some(found)
    }
}

impl ChangeRun {
    /// A sum of z - k is the likelihood ratio of a shift by 2k over none, divided by 2k.
    fn change(&self, part: f64) -> Option<Change> {
        let ratio = (self.force_n / self.expected_n.max(1.0)).clamp(0.0, 10.0);
        if self.sum < part * CUSUM_THRESHOLD || (ratio - 1.0).abs() < CHANGE_MIN {
            return None;
        }
        let odds = 2.0 * CUSUM_REFERENCE * self.sum / part - LOG_ODDS;
        Some(Change {
            ratio,
            values: self.values,
            probability: 1.0 / (1.0 + math::exp(-odds)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_has_an_inverse_and_holds_fialas() {
        for shape in [SHAPE.0, START[3], SHAPE.1] {
            for part in [0.1, 0.5, 0.7, 0.99] {
                let linear = linear_part(part, shape);
                assert!((part_of_grip(linear, shape) - part).abs() < 1e-12);
            }
            assert_eq!(part_of_grip(2.0 * shape, shape), 1.0);
        }
        for step in 0..=300 {
            let linear = 0.01 * f64::from(step);
            let fiala = 1.0 - (1.0 - linear / 3.0).powi(3);
            assert!((part_of_grip(linear, 3.0) - fiala).abs() < 0.02, "{linear}");
        }
    }
}
