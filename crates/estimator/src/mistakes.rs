//! Mistakes of the configuration as hypotheses.
//!
//! A wrong configuration contradicts the readings during the whole drive. A [`RelationWindow`] has the relations
//! between strain channels, struts and the inertial unit as means over half a second. They are linear in what may be
//! wrong: offsets and gains of channels, exchanged plugs, the mass of the vehicle, the direction of the inertial
//! unit. The evidence is the information of the drive on all these parameters. Each hypothesis is a distribution
//! of the parameters before the drive:
//!
//! - as configured: each parameter is within the tolerance of a careful workshop
//! - a mistake: its own parameters are as the mistake makes them, and all others are within their tolerances
//!
//! The ratio of the likelihoods, in which the parameters are integrated out, decides (Bayes factor; Kass and Raftery,
//! J. Am. Stat. Assoc. 90 (1995), 773-795, section 3).

mod considered;
mod driven;
mod evidence;
mod hypotheses;
mod layout;
mod linear;
mod rows;
mod texts;
mod tolerances;

use crate::fusion::relations::{CHANNELS, Loads, RelationWindow};
use crate::statics::AXIAL;
use crate::tuning::MistakeTuning;

pub use driven::Driven;
use evidence::Evidence;
pub use evidence::Setup;
pub(crate) use evidence::right_angles;
pub use hypotheses::Hypothesis;
use layout::{PAIRS, TOLERATED};
pub use texts::Described;
pub use tolerances::Stated;
pub(crate) use tolerances::stated_tuning;

/// Most parameters of a hypothesis.
const MOST: usize = CHANNELS;
/// Number of hypotheses.
const HYPOTHESES: usize = 9 + 3 * CHANNELS + 4 * PAIRS.len() + 6 + layout::ROTATIONS + 4;

/// What the drive says of a hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// The hypothesis.
    pub hypothesis: Hypothesis,
    /// Natural logarithm of the ratio of its likelihood to that of the configuration.
    pub ratio: f64,
    /// Its parameters; SI units.
    pub value: [f64; MOST],
    /// Their standard deviations.
    pub sigma: [f64; MOST],
}

impl Judged {
    /// More than one mistake: the residuals are `factor` times as large as they should be.
    fn several(ratio: f64, factor: f64) -> Self {
        let mut value = [0.0; MOST];
        value[0] = factor;
        Self {
            hypothesis: Hypothesis::Several,
            ratio,
            value,
            sigma: [0.0; MOST],
        }
    }
}

/// The evidence of a drive.
#[derive(Clone, Debug)]
pub struct Mistakes {
    tuning: MistakeTuning,
    evidence: Evidence,
    /// Hypotheses, the likeliest first.
    judged: Vec<Judged>,
    /// Windows that did not contradict the configuration.
    agreeing: u32,
    driven: Driven,
}

impl Mistakes {
    /// No evidence yet.
    #[must_use]
    pub fn new(setup: Setup, tuning: &MistakeTuning) -> Self {
        Self {
            tuning: *tuning,
            evidence: Evidence::new(setup, *tuning),
            judged: Vec::with_capacity(HYPOTHESES),
            agreeing: 0,
            driven: Driven::default(),
        }
    }

    /// Makes the standard deviations contain errors of `factor` times the tolerances, from now on.
    pub fn doubt(&mut self, factor: f64) {
        self.evidence.doubt(factor);
    }

    /// Begins again, for a configuration that was corrected.
    pub fn restart(&mut self, setup: Setup) {
        self.evidence = Evidence::new(setup, self.tuning);
        self.judged.clear();
        self.agreeing = 0;
        self.driven = Driven::default();
    }

    /// Takes a window. Returns a mistake that is now certain. A window in which a fault of a channel `has_begun` tells
    /// nothing of the configuration.
    pub fn take(&mut self, window: &RelationWindow, has_begun: bool) -> Option<Judged> {
        let t = &self.tuning;
        if has_begun {
            self.evidence.pass_over(window);
            return None;
        }
        let on_ground = window.least_load.iter().all(|part| *part > t.load_min_part);
        let is_slow = window.speed.abs() < t.speed_min_m_s;
        if !on_ground || is_slow {
            self.driven.leave_out(is_slow, t);
            self.evidence.pass_over(window);
            return None;
        }
        let square = self.evidence.take(window)?;
        self.driven.take(window, t);
        self.agreeing += u32::from(square < t.agreeing_square);
        let windows = self.evidence.windows;
        if windows.is_power_of_two() || windows.is_multiple_of(t.decide_windows) {
            self.evidence.consider();
        }
        if !self.evidence.windows.is_multiple_of(t.decide_windows) {
            return None;
        }
        self.judge();
        self.certain()
    }

    /// Variances of the forces of the tyres by parameters that are not exact, wheel-carrier frame, N^2; `None` while
    /// the readings agree as if all were.
    #[must_use]
    pub fn force_variances(&self, loads: &Loads) -> Option<[f64; 12]> {
        self.evidence.force_variances(loads)
    }

    /// Factor on the tolerances of the parameters; 0 as long as all are taken for exact.
    #[must_use]
    pub fn tolerance_factor(&self) -> f64 {
        self.evidence.care()
    }

    /// Whether a file states tolerances.
    #[must_use]
    pub fn are_tolerances_stated(&self) -> bool {
        self.evidence.setup.stated.is_any
    }

    /// The hypotheses at the last decision, the likeliest first.
    #[must_use]
    pub fn judged(&self) -> &[Judged] {
        &self.judged
    }

    /// What was driven.
    #[must_use]
    pub fn driven(&self) -> &Driven {
        &self.driven
    }

    /// Whether the drive has said that the configuration is right.
    #[must_use]
    pub fn is_agreed(&self) -> bool {
        self.agreeing >= self.tuning.agreeing_windows
    }

    /// Whether a mistake is likely that is not certain yet.
    #[must_use]
    pub fn is_suspected(&self) -> bool {
        let best = self.best_mistake();
        best.is_some_and(|best| best.ratio > self.tuning.suspect_ratio)
    }

    /// The likeliest hypothesis, if it is a mistake of the configuration.
    fn best_mistake(&self) -> Option<&Judged> {
        let best = self.judged.first();
        best.filter(|best| best.hypothesis.is_of_configuration())
    }

    fn certain(&self) -> Option<Judged> {
        let t = &self.tuning;
        let best = self.best_mistake()?;
        if let Hypothesis::Exchanged(wheel, _) = best.hypothesis {
            // A force on the hitch that changes looks like an exchange at any of several wheels.
            let rivals = self.judged.iter().filter(
                |other| matches!(other.hypothesis, Hypothesis::Exchanged(at, _) if at != wheel),
            );
            let rival = rivals.map(|other| other.ratio).fold(0.0, f64::max);
            let is_off = (best.value[0] - 1.0).abs() > t.exchange_error;
            if is_off || rival > t.exchange_rival * best.ratio {
                return None;
            }
        }
        let next = self.judged.get(1);
        let next = next.map_or(f64::NEG_INFINITY, |next| next.ratio);
        if best.ratio < t.report_ratio || best.ratio - next < t.lead_ratio {
            return None;
        }
        let [before, left] = [0.0, best.ratio].map(|ratio| self.evidence.left(ratio));
        if left < t.left_square.max(t.left_part * before) {
            return Some(*best);
        }
        // A second mistake may be among the first windows only.
        (self.evidence.windows >= t.several_windows)
            .then(|| Judged::several(best.ratio, before.sqrt()))
    }

    /// Weighs all hypotheses.
    fn judge(&mut self) {
        self.judged.clear();
        if self.evidence.update().is_some() {
            for hypothesis in hypotheses::all() {
                let judged = self.weigh(hypothesis);
                self.judged
                    .extend(judged.filter(|judged| self.is_possible(judged)));
            }
        }
        self.judged
            .sort_unstable_by(|a, b| b.ratio.total_cmp(&a.ratio));
    }

    /// Whether the channels of a mistake were read, and the vehicle stands on its wheels with it.
    fn is_possible(&self, judged: &Judged) -> bool {
        let is_read = |at: usize| self.evidence.is_read(at);
        match judged.hypothesis {
            Hypothesis::Offset(at) | Hypothesis::Gain(at) | Hypothesis::Bent(at) => is_read(at),
            Hypothesis::Exchanged(wheel, pair) => {
                pair.iter().all(|i| is_read(AXIAL.len() * wheel + i))
            }
            Hypothesis::Payload => {
                let setup = &self.evidence.setup;
                let mut loads = setup.static_n.iter().zip(&setup.weight_n);
                loads.all(|(own_n, added)| own_n + linear::dot(added, &judged.value[..3]) > 0.0)
            }
            _ => true,
        }
    }

    /// Ratio of likelihoods of a hypothesis, with all other parameters integrated out.
    fn weigh(&self, hypothesis: Hypothesis) -> Option<Judged> {
        let prior = hypothesis.prior(&self.evidence.setup, &self.tuning);
        let at = &prior.parameters[..prior.count];
        let n = at.len();
        let mut likelihood = Likelihood {
            n,
            information: [0.0; MOST * MOST],
            vector: [0.0; MOST],
        };
        let mut configured = 0.0;
        if at[0] < TOLERATED {
            let e = &self.evidence;
            let mut own = [0.0; MOST * MOST];
            for (k, value) in own[..n * n].iter_mut().enumerate() {
                *value = e.covariance(at[k / n], at[k % n]);
            }
            linear::factor(&mut own, n)?;
            linear::invert(&own, n, &mut likelihood.information);
            let mean: [f64; MOST] =
                std::array::from_fn(|i| at.get(i).map_or(0.0, |at| e.mean(*at)));
            let rows = likelihood.information.chunks_exact(n);
            for (value, row) in likelihood.vector.iter_mut().zip(rows.take(n)) {
                *value = linear::dot(row, &mean);
            }
            let tolerance: [f64; MOST] =
                std::array::from_fn(|i| at.get(i).map_or(1.0, |at| e.sigma[*at]));
            for i in 0..n {
                likelihood.information[i * n + i] -= tolerance[i].powi(-2);
            }
            configured = likelihood.integrated(&[0.0; MOST], &tolerance)?.ratio;
        } else {
            let Likelihood {
                information,
                vector,
                ..
            } = &mut likelihood;
            self.evidence.reduced(at, information, vector);
        }
        let found = likelihood.integrated(&prior.mean, &prior.sigma)?;
        Some(Judged {
            hypothesis,
            ratio: found.ratio - configured,
            value: found.value,
            sigma: found.sigma,
        })
    }
}

/// The likelihood exp(v'p - p'I p/2) of the parameters p of a hypothesis.
struct Likelihood {
    n: usize,
    information: [f64; MOST * MOST],
    vector: [f64; MOST],
}

/// A likelihood integrated over a distribution of its parameters.
struct Integrated {
    /// Its natural logarithm.
    ratio: f64,
    value: [f64; MOST],
    sigma: [f64; MOST],
}

impl Likelihood {
    /// Integrates over a normal distribution of independent parameters.
    fn integrated(&self, mean: &[f64; MOST], sigma: &[f64; MOST]) -> Option<Integrated> {
        let n = self.n;
        let mut total = self.information;
        let mut value = [0.0; MOST];
        let mut before = 0.0;
        for i in 0..n {
            let precision = sigma[i].powi(-2);
            total[i * n + i] += precision;
            value[i] = self.vector[i] + precision * mean[i];
            before += precision * mean[i] * mean[i];
        }
        let sum = value;
        linear::factor(&mut total, n)?;
        linear::solve(&total, n, &mut value[..n]);
        let spread: f64 = (0..n).map(|i| math::ln(total[i * n + i] * sigma[i])).sum();
        let mut inverse = [0.0; MOST * MOST];
        linear::invert(&total, n, &mut inverse);
        Some(Integrated {
            ratio: 0.5 * (linear::dot(&sum[..n], &value[..n]) - before) - spread,
            value,
            sigma: std::array::from_fn(|i| {
                if i < n {
                    inverse[i * n + i].sqrt()
                } else {
                    0.0
                }
            }),
        })
    }
}
