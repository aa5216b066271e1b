//! Warnings before a wheel or a side leaves the ground.
//!
//! Two fading-memory filters follow the load as a part of the static load: a slow one with little noise, and
//! a quick one for a load that vanishes within some tenths of a second. A warning is given when most of the
//! load is gone and
//!
//! - the load on the parabola of either filter reaches the ground's limit within its lead time. The load of a
//!   wheel on the inner side of a sine turns before; its curvature shows that ahead. Or
//! - the load neither falls nor rises: a side that hangs in balance near its lift needs little to tip over.
//!
//! The load must be below the limit by the standard deviation that the estimate states: after a wheel landed,
//! the estimates of all loads are uncertain for some tenths of a second.
//!
//! The load of a side is that of its more loaded wheel, as both must be up. On rough ground the wheels lift
//! for moments without any trend of the load: there only sides are warned of, and by the slow filter alone.

use crate::tuning::LiftTuning;

/// A fading-memory filter of value, slope and curvature.
#[derive(Clone, Copy, Debug)]
pub struct Trend {
    pub value: f64,
    /// 1/s of the value.
    pub rate: f64,
    /// 1/s² of the value.
    pub curvature: f64,
}

impl Trend {
    /// At rest.
    pub const fn new(value: f64) -> Self {
        Self {
            value,
            rate: 0.0,
            curvature: 0.0,
        }
    }

    /// Value, slope and curvature by least squares with the fading memory `keep` per step (N. Morrison,
    /// Introduction to Sequential Smoothing and Prediction, 1969, fading-memory polynomial of degree 2).
    pub fn follow(&mut self, value: f64, keep: f64, dt: f64) {
        self.value += dt * (self.rate + 0.5 * dt * self.curvature);
        self.rate += dt * self.curvature;
        let error = value - self.value;
        let fresh = 1.0 - keep;
        self.value += (1.0 - keep * keep * keep) * error;
        self.rate += 1.5 * fresh * fresh * (1.0 + keep) * error / dt;
        self.curvature += fresh * fresh * fresh * error / (dt * dt);
    }

    /// Time until the parabola reaches `level`, s; infinite if it turns before. A curvature that makes the
    /// value fall more quickly is taken as zero.
    fn time_to_s(&self, level: f64) -> f64 {
        let left = self.value - level;
        if left <= 0.0 {
            return 0.0;
        }
        let root = self.rate * self.rate - 2.0 * self.curvature.max(0.0) * left;
        if self.rate >= 0.0 || root < 0.0 {
            return f64::INFINITY;
        }
        2.0 * left / (root.sqrt() - self.rate)
    }
}

/// A load as a part of the static load, with its standard deviation.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub value: f64,
    pub sigma: f64,
}

/// Where warnings are possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Nowhere: the ground is rough, or the load is off the ground.
    Nothing,
    /// By the slow filter.
    Slow,
    /// By both filters.
    All,
}

/// A warning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Warning {
    /// Time to the lift, s; infinite if the load does not fall.
    pub lead_s: f64,
    /// The load after the lead time of the filter, and its standard deviation.
    pub ahead: [f64; 2],
    /// Load now.
    pub part: f64,
}

/// Watches one load.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    slow: Trend,
    quick: Trend,
    /// Consecutive steps with a falling load, by the slow filter and by the quick one, and with a steady one.
    steps: [u32; 3],
    calm: u32,
    warned: bool,
}

impl Watch {
    /// A load at rest.
    pub const fn new() -> Self {
        Self {
            slow: Trend::new(1.0),
            quick: Trend::new(1.0),
            steps: [0; 3],
            calm: 0,
            warned: false,
        }
    }

    /// Takes the next load.
    pub fn follow(&mut self, part: f64, dt: f64, t: &LiftTuning) {
        self.slow.follow(part, t.slow_keep, dt);
        self.quick.follow(part, t.quick_keep, dt);
    }

    /// Judges the load that was taken last.
    pub fn judge(&mut self, part: Part, scope: Scope, t: &LiftTuning) -> Option<Warning> {
        let most = self.slow.value.max(self.quick.value);
        let margin = t.light_sigma * part.sigma;
        let falls = |trend: &Trend, fall: f64, lead_s: f64| {
            trend.rate < -fall && trend.time_to_s(t.up) < lead_s
        };
        let found = [
            scope != Scope::Nothing
                && most + margin < t.light
                // The slow filter overshoots where a load turns quickly.
                && self.quick.value - self.slow.value < t.overshoot
                && falls(&self.slow, t.fall_min, t.lead_s),
            scope == Scope::All
                && self.quick.value + margin < t.quick_light
                && falls(&self.quick, t.quick_fall, t.quick_lead_s),
            scope != Scope::Nothing && most < t.steady_light && self.slow.rate < t.steady_rise,
        ];
        for (steps, found) in self.steps.iter_mut().zip(found) {
            *steps = if found { *steps + 1 } else { 0 };
        }
        self.calm = if self.quick.value > t.calm {
            self.calm + 1
        } else {
            0
        };
        if self.calm > t.calm_steps {
            self.warned = false;
        }
        let least = [t.slow_steps, t.quick_steps, t.steady_steps];
        let due = self
            .steps
            .iter()
            .zip(least)
            .position(|(n, least)| *n >= least)?;
        if self.warned {
            return None;
        }
        self.warned = true;
        let (trend, lead_s) = match due {
            1 => (&self.quick, t.quick_lead_s),
            _ => (&self.slow, t.lead_s),
        };
        let sigma = (t.filtered_sigma + lead_s * t.ahead_sigma) * part.sigma;
        Some(Warning {
            lead_s: if trend.rate < -t.fall_min {
                trend.time_to_s(t.up)
            } else {
                f64::INFINITY
            },
            ahead: [trend.value + lead_s * trend.rate, sigma],
            part: trend.value,
        })
    }
}
