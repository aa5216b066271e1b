//! Wheel lift: warned of ahead, declared, and taken back (section 4.2.3 of the thesis).
//!
//! A wheel is *up* when its load is below a fraction of the static one with high probability, and
//! *down* again above a higher fraction. It is warned of when the load, carried on at its present
//! smoothed rate, would vanish within the lead time while a good part of it is gone already. Each
//! condition must hold for a run of steps, which sets the false-alarm rate: with independent
//! errors, p^n for a chance p of one step. The filter's errors are alike over about five steps,
//! so the runs are long against that.

use sample::{Event, EventKind, LogTime, PerWheel, TyreForce, Wheel};

/// Part of the static load below which a wheel is up, and above which it is down again.
const UP: f64 = 0.02;
const DOWN: f64 = 0.06;
/// Part of the static load below which the vanishing of the load is warned of.
const LIGHT: f64 = 0.45;
/// Lead time of a warning, s.
const LEAD_S: f64 = 2.5;
/// A load that falls more slowly than this is not falling, part of static load per second.
const FALL_MIN: f64 = 0.02;
/// Steps that a condition must hold.
const UP_STEPS: u32 = 6;
const WARNING_STEPS: u32 = 20;
/// Time constant of the load's smoothed value and rate, s.
const SMOOTH_S: f64 = 0.15;
const RATE_SMOOTH_S: f64 = 0.6;
/// Time after the start in which nothing is declared, s.
const SETTLING_S: f64 = 1.0;

#[derive(Clone, Copy, Debug, Default)]
struct WheelState {
    load_n: f64,
    rate_n_s: f64,
    up: bool,
    warned: bool,
    below: u32,
    falling: u32,
    calm: u32,
}

/// Watches all four loads.
#[derive(Clone, Debug)]
pub struct LiftDetector {
    wheels: [WheelState; 4],
    static_n: [f64; 4],
    side_up: [bool; 2],
    age_s: f64,
}

impl LiftDetector {
    /// A detector with the wheels on the ground.
    #[must_use]
    pub fn new(static_n: [f64; 4]) -> Self {
        Self {
            wheels: static_n.map(|load_n| WheelState {
                load_n,
                ..WheelState::default()
            }),
            static_n,
            side_up: [false; 2],
            age_s: 0.0,
        }
    }

    /// Takes the loads of one instant in. Only a moving vehicle is judged: one on jacks hangs its
    /// wheels on purpose.
    pub fn step(
        &mut self,
        now: LogTime,
        dt: f64,
        moving: bool,
        forces: &PerWheel<TyreForce>,
        out: &mut impl FnMut(Event),
    ) {
        self.age_s += dt;
        for wheel in Wheel::ALL {
            let i = wheel.index();
            let [_, _, load] = forces[wheel].force_n;
            let [_, _, sigma] = forces[wheel].sigma_n;
            if !load.is_finite() {
                continue;
            }
            let state = &mut self.wheels[i];
            let before = state.load_n;
            state.load_n += (load - before) * dt / SMOOTH_S;
            let slope = (state.load_n - before) / dt;
            state.rate_n_s += (slope - state.rate_n_s) * dt / RATE_SMOOTH_S;
            if self.age_s < SETTLING_S || !moving {
                continue;
            }
            state.judge(now, wheel, self.static_n[i], load, sigma, out);
        }
        for (side, up) in self.side_up.iter_mut().enumerate() {
            let both = self.wheels[side].up && self.wheels[2 + side].up;
            if both && !*up {
                let name = ["left", "right"][side];
                out(event(
                    now,
                    now,
                    EventKind::TwoWheelLift(side == 0),
                    None,
                    format!("both {name} wheels are off the ground"),
                ));
            }
            *up = both;
        }
    }
}

impl WheelState {
    fn judge(
        &mut self,
        now: LogTime,
        wheel: Wheel,
        static_n: f64,
        load: f64,
        sigma: f64,
        out: &mut impl FnMut(Event),
    ) {
        let light = self.load_n < LIGHT * static_n && self.rate_n_s < -FALL_MIN * static_n;
        let left_s = self.load_n / -self.rate_n_s;
        self.falling = if light && left_s < LEAD_S && !self.up {
            self.falling + 1
        } else {
            0
        };
        self.calm = if self.load_n > (LIGHT + 0.1) * static_n {
            self.calm + 1
        } else {
            0
        };
        if self.falling >= WARNING_STEPS && !self.warned {
            self.warned = true;
            let lead = left_s.max(0.0);
            out(event(
                now,
                now.offset_seconds(lead),
                EventKind::LiftWarning(wheel, lead),
                Some(probability(LIGHT * static_n - self.load_n, sigma)),
                format!("the {wheel} wheel's load would vanish in {lead:.1} s"),
            ));
        }
        if self.calm > 50 {
            self.warned = false;
        }
        self.below = if load < UP * static_n {
            self.below + 1
        } else {
            0
        };
        if !self.up && self.below >= UP_STEPS {
            self.up = true;
            let onset = now.offset_seconds(-0.01 * f64::from(UP_STEPS - 1));
            let chance = probability(DOWN * static_n - self.load_n.min(load), sigma);
            out(event(
                now,
                onset,
                EventKind::Lift(wheel),
                Some(chance),
                format!("the {wheel} wheel is off the ground"),
            ));
        } else if self.up && load > DOWN * static_n && self.load_n > DOWN * static_n {
            self.up = false;
            out(event(
                now,
                now,
                EventKind::Touchdown(wheel),
                None,
                format!("the {wheel} wheel is on the ground again"),
            ));
        }
    }
}

fn event(
    time: LogTime,
    onset: LogTime,
    kind: EventKind,
    probability: Option<f64>,
    text: String,
) -> Event {
    Event {
        time,
        onset,
        kind,
        probability,
        text,
    }
}

/// Chance that a normal error of deviation `sigma` stays below `margin` (logistic approximation
/// of the normal distribution, within 0.01).
fn probability(margin: f64, sigma: f64) -> f64 {
    if sigma.is_finite() && sigma > 0.0 {
        1.0 / (1.0 + (-1.702 * margin / sigma).exp())
    } else {
        0.5
    }
}
