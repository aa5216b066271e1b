//! Lift of wheels and of sides: warning, detection and touchdown (section 4.2.3 of the thesis);
//! load-transfer ratios and times to lift.
//!
//! The rules for a wheel apply to both wheels of a side with the sum of their loads: a side off the
//! ground is a vehicle that tips over. A wheel is *up* when its load, by the estimate with a lag where there
//! is one, stays below a limit for a tenth of a second, and *down* again above a higher one. The limit is a
//! fraction of the static load that grows with the standard deviation of the load up to a tenth: a load that
//! is known to a newton need not be given a margin.
//!
//! Warnings have rules of their own, see `warning.rs`.

mod warning;

use sample::{Event, EventKind, LogTime, PerWheel, Rollover, Side, TyreForce, Wheel};

use crate::tuning::LiftTuning;
use warning::{Part, Scope, Trend, Warning, Watch};

/// A wheel or a side.
#[derive(Clone, Copy, Debug)]
enum Place {
    Wheel(Wheel),
    Side(Side),
}

/// Monitor of one load.
#[derive(Clone, Copy, Debug)]
struct LoadState {
    tuning: LiftTuning,
    place: Place,
    static_n: f64,
    /// Limits of up and down, N.
    thresholds_n: [f64; 2],
    /// The load in N, by which the time to lift is reported.
    trend_n: Trend,
    watch: Watch,
    up: bool,
    below: u32,
}

/// Monitors the loads of all wheels and of both sides.
#[derive(Clone, Debug)]
pub struct LiftDetector {
    wheels: [LoadState; 4],
    sides: [LoadState; 2],
    age_s: f64,
    settling_s: f64,
}

impl LiftDetector {
    /// A detector with the wheels on the ground.
    #[must_use]
    pub fn new(static_n: PerWheel<f64>, tuning: &LiftTuning) -> Self {
        let wheel = |wheel| {
            let load_n = static_n[wheel];
            LoadState::new(Place::Wheel(wheel), load_n, load_n, tuning)
        };
        let side = |side: Side| {
            let [front_n, rear_n] = side.wheels().map(|wheel| static_n[wheel]);
            let heavier_n = front_n.max(rear_n);
            LoadState::new(Place::Side(side), front_n + rear_n, heavier_n, tuning)
        };
        Self {
            wheels: Wheel::ALL.map(wheel),
            sides: Side::ALL.map(side),
            age_s: 0.0,
            settling_s: tuning.settling_s,
        }
    }

    /// The same detector for other static loads.
    pub fn load(&mut self, static_n: PerWheel<f64>, tuning: &LiftTuning) {
        let fresh = Self::new(static_n, tuning);
        let states = self.wheels.iter_mut().chain(&mut self.sides);
        for (state, fresh) in states.zip(fresh.wheels.iter().chain(&fresh.sides)) {
            state.static_n = fresh.static_n;
            state.thresholds_n = fresh.thresholds_n;
        }
    }

    /// Whether both wheels of a side are off the ground.
    #[must_use]
    pub fn is_tipping(&self) -> bool {
        self.sides.iter().any(|side| side.up)
    }

    /// Takes the loads of one instant. Only lifts of a moving vehicle are reported: wheels of a
    /// vehicle on jacks hang.
    pub fn step(&mut self, input: &LiftInput<'_>, out: &mut impl FnMut(Event)) -> Rollover {
        let dt = input.dt;
        self.age_s += dt;
        let judged = self.age_s >= self.settling_s && input.judged;
        let of_all = |forces: &PerWheel<TyreForce>| {
            let loads = Wheel::ALL.map(|wheel| Load::of_wheel(&forces[wheel]));
            let [left, right] = Side::ALL.map(|side| {
                let [front, rear] = side.wheels().map(|wheel| loads[wheel.index()]);
                front.and(rear)
            });
            let [fl, fr, rl, rr] = loads;
            [fl, fr, rl, rr, left, right]
        };
        let loads = of_all(input.forces);
        let lagged = of_all(input.lagged.unwrap_or(input.forces));
        let [fl, fr, rl, rr, left, right] = loads;
        let parts = self.parts(&[fl, fr, rl, rr]);
        let (ratio, ratio_sigma) = transfer_ratio(left, right);
        let states = self.wheels.iter_mut().chain(&mut self.sides);
        for (state, ((load, part), lagged)) in states.zip(loads.into_iter().zip(parts).zip(lagged))
        {
            if !load.value_n.is_finite() {
                continue;
            }
            let keep = state.tuning.keep;
            state.trend_n.follow(load.value_n, keep, dt);
            state.watch.follow(part.value, dt, &state.tuning);
            if judged {
                let instant = Instant {
                    now: input.now,
                    lag_s: if input.lagged.is_some() {
                        input.lag_s
                    } else {
                        0.0
                    },
                    part,
                    lagged,
                    rough: input.rough,
                    transfer: ratio,
                };
                state.judge(&instant, out);
            }
        }
        let known = ratio.is_finite();
        let time_s = |state: &LoadState| {
            if known {
                state.time_to_lift_s()
            } else {
                f64::NAN
            }
        };
        Rollover {
            load_transfer_ratio: ratio,
            load_transfer_ratio_sigma: ratio_sigma,
            axle_load_transfer_ratio: [(fl, fr), (rl, rr)].map(|(l, r)| transfer_ratio(l, r).0),
            time_to_lift_s: PerWheel(self.wheels.each_ref().map(time_s)),
            time_to_two_wheel_lift_s: self.sides.each_ref().map(time_s),
        }
    }
}

impl LiftDetector {
    /// The loads as parts of the static loads: of a side, that of its more loaded wheel.
    fn parts(&self, loads: &[Load; 4]) -> [Part; 6] {
        let part = |wheel: Wheel| {
            let Load { value_n, sigma_n } = loads[wheel.index()];
            let static_n = self.wheels[wheel.index()].static_n;
            Part {
                value: value_n / static_n,
                sigma: sigma_n / static_n,
            }
        };
        let of_side = |side: Side| {
            let [front, rear] = side.wheels().map(part);
            if front.value > rear.value {
                front
            } else {
                rear
            }
        };
        let [fl, fr, rl, rr] = Wheel::ALL.map(part);
        let [left, right] = Side::ALL.map(of_side);
        [fl, fr, rl, rr, left, right]
    }
}

/// Loads of one instant.
pub struct LiftInput<'a> {
    /// The instant.
    pub now: LogTime,
    /// Time since the instant before, s.
    pub dt: f64,
    /// Whether lifts are judged: the vehicle moves, and its loads are known well enough.
    pub judged: bool,
    /// Whether the ground is rough.
    pub rough: bool,
    /// Forces, contact or wheel-carrier frame.
    pub forces: &'a PerWheel<TyreForce>,
    /// Forces of `lag_s` ago, by what was measured since.
    pub lagged: Option<&'a PerWheel<TyreForce>>,
    /// The lag, s.
    pub lag_s: f64,
}

/// A load with its standard deviation.
#[derive(Clone, Copy)]
struct Load {
    value_n: f64,
    sigma_n: f64,
}

impl Load {
    fn of_wheel(force: &TyreForce) -> Self {
        let ([_, _, value_n], [_, _, sigma_n]) = (force.force_n, force.sigma_n);
        Self { value_n, sigma_n }
    }

    fn and(self, other: Self) -> Self {
        Self {
            value_n: self.value_n + other.value_n,
            sigma_n: math::hypot(self.sigma_n, other.sigma_n),
        }
    }
}

/// One load at one instant.
struct Instant {
    now: LogTime,
    /// How much earlier the lagged load is, s.
    lag_s: f64,
    /// The load that is warned of.
    part: Part,
    lagged: Load,
    rough: bool,
    /// Load-transfer ratio of the vehicle.
    transfer: f64,
}

/// (right - left)/(right + left), one when the left is up, and its standard deviation for
/// independent errors.
fn transfer_ratio(left: Load, right: Load) -> (f64, f64) {
    // The larger of NaN and zero would be zero.
    if !(left.value_n + right.value_n).is_finite() {
        return (f64::NAN, f64::NAN);
    }
    let [l, r] = [left, right].map(|load| load.value_n.max(0.0));
    let sum = (l + r).max(1.0);
    let sigma = 2.0 * math::hypot(l * right.sigma_n, r * left.sigma_n) / (sum * sum);
    ((r - l) / sum, sigma)
}

impl Place {
    fn lift(self) -> EventKind {
        match self {
            Self::Wheel(wheel) => EventKind::Lift(wheel),
            Self::Side(side) => EventKind::TwoWheelLift(side),
        }
    }

    fn warning(self, lead_s: f64) -> EventKind {
        match self {
            Self::Wheel(wheel) => EventKind::LiftWarning(wheel, lead_s),
            Self::Side(side) => EventKind::TwoWheelLiftWarning(side, lead_s),
        }
    }
}

impl LoadState {
    /// The limits are parts of `part_of_n`: of a side its heavier wheel, as both must be up.
    fn new(place: Place, static_n: f64, part_of_n: f64, tuning: &LiftTuning) -> Self {
        Self {
            tuning: *tuning,
            place,
            static_n,
            thresholds_n: [tuning.up * part_of_n, tuning.down * part_of_n],
            trend_n: Trend::new(static_n),
            watch: Watch::new(),
            up: false,
            below: 0,
        }
    }

    fn is_falling(&self) -> bool {
        self.trend_n.rate < -self.tuning.fall_min * self.static_n
    }

    /// -N/N' of the filtered load.
    fn time_to_lift_s(&self) -> f64 {
        let Trend { value, rate, .. } = self.trend_n;
        if self.up || value <= 0.0 {
            0.0
        } else if self.is_falling() {
            value / -rate
        } else {
            f64::INFINITY
        }
    }

    fn judge(&mut self, at: &Instant, out: &mut impl FnMut(Event)) {
        self.warn(at, out);
        let t = self.tuning;
        let [least, back] = self.thresholds_n;
        let margin = (t.margin_sigma * at.lagged.sigma_n).min((t.up_max / t.up - 1.0) * least);
        let limit = least + margin.max(0.0);
        let back = back.max(t.down_by * limit);
        let load_n = at.lagged.value_n;
        // One noisy load between both limits neither counts nor ends the count.
        if load_n < limit {
            self.below += 1;
        } else if load_n > back {
            self.below = 0;
        }
        if !self.up && self.below >= t.steps {
            self.up = true;
            let onset_s = at.lag_s + 0.01 * f64::from(t.steps - 1);
            let onset = at.now.offset_seconds(-onset_s);
            let chance = probability(back - load_n, at.lagged.sigma_n);
            let text = match self.place {
                Place::Wheel(wheel) => format!("the {wheel} wheel is off the ground"),
                Place::Side(side) => format!("both {side} wheels are off the ground"),
            };
            out(at.event(onset, self.place.lift(), Some(chance), text));
        } else if self.up && load_n > back {
            self.up = false;
            if let Place::Wheel(wheel) = self.place {
                let text = format!("the {wheel} wheel is on the ground again");
                out(at.event(at.now, EventKind::Touchdown(wheel), None, text));
            }
        }
    }

    fn warn(&mut self, at: &Instant, out: &mut impl FnMut(Event)) {
        let scope = match self.place {
            _ if self.up => Scope::Nothing,
            Place::Wheel(_) if at.rough => Scope::Nothing,
            Place::Side(_) if at.rough => Scope::Slow,
            _ => Scope::All,
        };
        let Some(warning) = self.watch.judge(at.part, scope, &self.tuning) else {
            return;
        };
        let Warning {
            lead_s,
            ahead: [ahead, sigma],
            part,
        } = warning;
        let load = match self.place {
            Place::Wheel(wheel) => format!("the {wheel} wheel's load"),
            Place::Side(side) => format!("both {side} wheels' load"),
        };
        let (onset, text) = if lead_s.is_finite() {
            (
                at.now.offset_seconds(lead_s),
                format!("{load} would vanish in {lead_s:.1} s"),
            )
        } else {
            let percent = 100.0 * part;
            (
                at.now,
                format!("{load} is {percent:.0} % of the static load"),
            )
        };
        let chance = probability(self.tuning.down - ahead, sigma);
        out(at.event(onset, self.place.warning(lead_s), Some(chance), text));
    }
}

impl Instant {
    fn event(
        &self,
        onset: LogTime,
        kind: EventKind,
        probability: Option<f64>,
        text: String,
    ) -> Event {
        Event {
            time: self.now,
            onset,
            kind,
            probability,
            load_transfer_ratio: Some(self.transfer).filter(|ratio| ratio.is_finite()),
            text: format!("{text}; load-transfer ratio {:.2}", self.transfer),
        }
    }
}

/// Probability that a normal error with standard deviation `sigma` stays below `margin` (logistic
/// approximation of the normal distribution, within 0.01).
fn probability(margin: f64, sigma: f64) -> f64 {
    if sigma.is_finite() && sigma > 0.0 {
        1.0 / (1.0 + math::exp(-1.702 * margin / sigma))
    } else {
        0.5
    }
}

#[cfg(test)]
mod tests;
