//! The friction in use, and the lower bound of the friction coefficient that follows from it.

use sample::{LogTime, NANOS_PER_SECOND, TyreForce};

use crate::tuning::GripTuning;

/// Seconds for which the friction in use is remembered.
const USED_SECONDS: usize = 10;

/// Largest force over load in each of the last seconds of the log clock, with the second.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UsedFriction([(u64, f64); USED_SECONDS]);

/// Sums of an axle's forces in the contact frame, for the lower bound of the friction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BoundBlock {
    steps: u32,
    force_n: [f64; 3],
    sigma_n: [f64; 3],
}

impl BoundBlock {
    /// Takes the forces of one step; gives the bound of a whole block.
    pub(super) fn take(&mut self, pair: [&TyreForce; 2], tuning: &GripTuning) -> Option<f64> {
        let finite = |force: &TyreForce| {
            let mut all = force.force_n.iter().chain(&force.sigma_n);
            all.all(|value| value.is_finite())
        };
        if !pair.iter().all(|force| finite(force)) {
            *self = Self::default();
            return None;
        }
        self.steps += 1;
        for axis in 0..3 {
            self.force_n[axis] += pair[0].force_n[axis] + pair[1].force_n[axis];
            self.sigma_n[axis] += math::hypot(pair[0].sigma_n[axis], pair[1].sigma_n[axis]);
        }
        if self.steps < tuning.block_steps {
            return None;
        }
        let part = 1.0 / f64::from(self.steps);
        let whole = std::mem::take(self);
        // Errors of consecutive steps are the same: the mean of a block is no better than one step.
        let mean = |sums: [f64; 3]| sums.map(|sum| sum * part);
        Some(lower_bound(
            mean(whole.force_n),
            mean(whole.sigma_n),
            tuning,
        ))
    }
}

/// Lower bound of the friction that a force uses: sqrt(F_x^2 + F_y^2)/F_z less standard deviations.
fn lower_bound(force_n: [f64; 3], sigma_n: [f64; 3], tuning: &GripTuning) -> f64 {
    let [x, y, load] = force_n;
    if load < tuning.load_min_n {
        return 0.0;
    }
    let along = math::hypot(x, y);
    let direction = [x / along.max(1.0), y / along.max(1.0)];
    let ratio = along / load;
    let sigma = [
        direction[0] * sigma_n[0],
        direction[1] * sigma_n[1],
        ratio * sigma_n[2],
    ];
    let square: f64 = sigma.iter().map(|part| part * part).sum();
    (ratio - tuning.bound_sigma * square.sqrt() / load).max(0.0)
}

impl UsedFriction {
    /// Takes what a block used.
    pub(super) fn take(&mut self, now: LogTime, used: f64) {
        let second = now.0 / NANOS_PER_SECOND as u64;
        let slot = &mut self.0[second as usize % USED_SECONDS];
        *slot = match *slot {
            (same, before) if same == second => (second, used.max(before)),
            _ => (second, used),
        };
    }

    /// The largest value of the last seconds.
    pub(super) fn largest(&self, now: LogTime) -> f64 {
        let oldest = (now.0 / NANOS_PER_SECOND as u64).saturating_sub(USED_SECONDS as u64);
        let late = self.0.iter().filter(|(second, _)| *second >= oldest);
        late.fold(0.0, |most, (_, used)| used.max(most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lower_bound_has_its_standard_deviation() {
        let t = GripTuning::default();
        let force = [300.0, 400.0, 1000.0];
        let exact = lower_bound(force, [0.0; 3], &t);
        assert!((exact - 0.5).abs() < 1e-12, "{exact}");
        // 10 N along the force and 20 N of the load, of which half counts.
        let bound = lower_bound(force, [10.0, 10.0, 20.0], &t);
        let sigma = (2.0_f64 * 100.0).sqrt() / 1000.0;
        assert!(
            (bound - (0.5 - t.bound_sigma * sigma)).abs() < 1e-12,
            "{bound}"
        );
        assert_eq!(lower_bound([300.0, 0.0, 50.0], [1.0; 3], &t), 0.0);
        // The ground below a force of two steps with an unknown normal.
        let wide = lower_bound(force, [100.0; 3], &t);
        assert!(wide < 0.2, "{wide}");
    }
}
