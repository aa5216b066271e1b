//! Wheel lift: warned of ahead, declared, and taken back (section 4.2.3 of the thesis).
//!
//! A wheel is *up* when its load is below a fraction of the static one, and *down* again above a
//! higher fraction. The load is followed by a filter of fading memory for value and slope, which a
//! steady fall does not leave behind, so that a slow lift is not declared late; a fast one is caught
//! by the raw load, which must then stay below for a run of steps. A wheel is warned of when the
//! load, carried on at its slope, would be gone within the lead time while most of it is gone
//! already. Runs of steps set the false-alarm rate: with independent errors, p^n for a chance p of
//! one step. The filter's errors are alike over about five steps, so the runs are long against
//! that.

use sample::{Event, EventKind, LogTime, PerWheel, TyreForce, Wheel};

/// Part of the static load below which a wheel is up, and above which it is down again.
const UP: f64 = 0.02;
const DOWN: f64 = 0.06;
/// Part of the static load below which the vanishing of the load is warned of.
const LIGHT: f64 = 0.3;
/// Lead time of a warning, s.
const LEAD_S: f64 = 2.5;
/// A load that falls more slowly than this is not falling, part of static load per second.
const FALL_MIN: f64 = 0.01;
/// Steps that a condition must hold: of the raw load, of the followed one, of a warning.
const RAW_STEPS: u32 = 6;
const FOLLOWED_STEPS: u32 = 3;
const WARNING_STEPS: u32 = 20;
/// What the fading memory keeps from step to step: half a second.
const KEEP: f64 = 0.98;
/// What remains of a step's error in the followed value, and in what it is in a second's time.
const FOLLOWED_SIGMA: f64 = 0.3;
const AHEAD_SIGMA: f64 = 0.4;
/// Time after the start in which nothing is declared, s.
const SETTLING_S: f64 = 1.0;

#[derive(Clone, Copy, Debug, Default)]
struct WheelState {
    load_n: f64,
    rate_n_s: f64,
    up: bool,
    warned: bool,
    below: [u32; 2],
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
        let transfer = transfer_ratio(forces);
        for wheel in Wheel::ALL {
            let i = wheel.index();
            let [_, _, load] = forces[wheel].force_n;
            let [_, _, sigma] = forces[wheel].sigma_n;
            if !load.is_finite() {
                continue;
            }
            let state = &mut self.wheels[i];
            state.follow(load, dt);
            if self.age_s < SETTLING_S || !moving {
                continue;
            }
            let instant = Instant {
                now,
                wheel,
                load_n: load,
                sigma_n: sigma,
                static_n: self.static_n[i],
                transfer,
            };
            state.judge(&instant, out);
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
                    format!(
                        "both {name} wheels are off the ground; load-transfer ratio {transfer:.2}"
                    ),
                ));
            }
            *up = both;
        }
    }
}

/// One wheel at one instant.
struct Instant {
    now: LogTime,
    wheel: Wheel,
    load_n: f64,
    sigma_n: f64,
    static_n: f64,
    /// Load-transfer ratio of the vehicle.
    transfer: f64,
}

/// (right - left)/(right + left) of the loads: one where the left wheels are up.
fn transfer_ratio(forces: &PerWheel<TyreForce>) -> f64 {
    let [fl, fr, rl, rr] = forces.0.map(|force| force.force_n[2].max(0.0));
    (fr + rr - fl - rl) / (fl + fr + rl + rr).max(1.0)
}

impl WheelState {
    /// Value and slope by least squares with a memory that fades by [`KEEP`] each step.
    fn follow(&mut self, load_n: f64, dt: f64) {
        self.load_n += self.rate_n_s * dt;
        let error = load_n - self.load_n;
        self.load_n += (1.0 - KEEP * KEEP) * error;
        self.rate_n_s += (1.0 - KEEP).powi(2) * error / dt;
    }

    fn judge(&mut self, at: &Instant, out: &mut impl FnMut(Event)) {
        self.warn(at, out);
        let least = UP * at.static_n;
        // A followed load that its error cannot tell from the threshold has reached it.
        let reached = least + (FOLLOWED_SIGMA * at.sigma_n).min(least);
        let judged = [(at.load_n, least), (self.load_n, reached)];
        for (count, (load, least)) in self.below.iter_mut().zip(judged) {
            *count = if load < least { *count + 1 } else { 0 };
        }
        let [raw, followed] = self.below;
        let back = DOWN * at.static_n;
        if !self.up && (raw >= RAW_STEPS || followed >= FOLLOWED_STEPS) {
            self.up = true;
            let steps = if raw >= RAW_STEPS {
                RAW_STEPS
            } else {
                FOLLOWED_STEPS
            };
            let chance = probability(back - self.load_n, FOLLOWED_SIGMA * at.sigma_n);
            out(event(
                at.now,
                at.now.offset_seconds(-0.01 * f64::from(steps - 1)),
                EventKind::Lift(at.wheel),
                Some(chance),
                format!(
                    "the {} wheel is off the ground; load-transfer ratio {:.2}",
                    at.wheel, at.transfer
                ),
            ));
        } else if self.up && at.load_n > back && self.load_n > back {
            self.up = false;
            out(event(
                at.now,
                at.now,
                EventKind::Touchdown(at.wheel),
                None,
                format!("the {} wheel is on the ground again", at.wheel),
            ));
        }
    }

    fn warn(&mut self, at: &Instant, out: &mut impl FnMut(Event)) {
        let light = self.load_n < LIGHT * at.static_n && self.rate_n_s < -FALL_MIN * at.static_n;
        let left_s = self.load_n / -self.rate_n_s;
        self.falling = if light && left_s < LEAD_S && !self.up {
            self.falling + 1
        } else {
            0
        };
        self.calm = if self.load_n > (LIGHT + 0.1) * at.static_n {
            self.calm + 1
        } else {
            0
        };
        if self.calm > 50 {
            self.warned = false;
        }
        if self.falling < WARNING_STEPS || self.warned {
            return;
        }
        self.warned = true;
        let lead = left_s.max(0.0);
        let ahead = self.load_n + self.rate_n_s * LEAD_S;
        let chance = probability(
            DOWN * at.static_n - ahead,
            (FOLLOWED_SIGMA + LEAD_S * AHEAD_SIGMA) * at.sigma_n,
        );
        out(event(
            at.now,
            at.now.offset_seconds(lead),
            EventKind::LiftWarning(at.wheel, lead),
            Some(chance),
            format!(
                "the {} wheel's load would vanish in {lead:.1} s; load-transfer ratio {:.2}",
                at.wheel, at.transfer
            ),
        ));
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
