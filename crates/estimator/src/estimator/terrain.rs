//! The kind of ground.

use sample::{ForceSource, LogTime, Motion, PerWheel, TyreForce};

use super::{Estimator, Output};
use crate::grid::GRID_S;

/// Spacing of the instants that have a kind of ground, ns.
const TERRAIN_NANOS: u64 = 100_000_000;

impl Estimator {
    /// Stage 11c: the kind of ground, for vehicles with the force filter.
    pub(super) fn classify_terrain(
        &mut self,
        now: LogTime,
        motion: &Motion,
        forces: &PerWheel<TyreForce>,
        settled: bool,
        out: &mut impl FnMut(Output),
    ) {
        let Some(fusion) = &self.fusion else {
            return;
        };
        let known = settled && forces.0[0].source == ForceSource::Fusion;
        if known {
            self.terrain.step(GRID_S, motion.velocity_x_m_s, forces);
        }
        if !now.0.is_multiple_of(TERRAIN_NANOS) {
            return;
        }
        out(Output::Terrain(if known {
            let grip = [0, 1].map(|axle| self.grip.axle(axle, now));
            let dt = TERRAIN_NANOS as f64 * 1e-9;
            let density = fusion.roughness();
            (self.terrain).terrain(now, dt, [&grip[0], &grip[1]], density)
        } else {
            self.terrain.present(now)
        }));
    }
}
