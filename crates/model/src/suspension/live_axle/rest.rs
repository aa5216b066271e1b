//! A live axle at rest: on stands with its wheels in the air, or on the ground.

use nalgebra::{Matrix2, Vector2, Vector3, Vector6};

use super::{LINKS, LinkedAxle, LiveAxleMembers, LiveAxleMotion, LiveAxlePose, LiveAxleStatics};
use crate::suspension::{BodyMotion, SuspensionError, TyreFrame};
use crate::vehicle::Axle;

/// Largest error of a spring's force, N.
const CLOSED_N: f64 = 1e-6;
/// Newton's steps at most, and the largest one, m.
const ROUNDS: usize = 60;
const LONGEST_STEP_M: f64 = 0.02;
/// Step of the differences, m.
const STEP_M: f64 = 1e-7;

/// A live axle that carries loads without moving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveAxleAtRest {
    /// Where the axle is.
    pub pose: LiveAxlePose,
    /// Forces of its members. Those of the springs are what the balance calls for.
    pub members: LiveAxleMembers,
    /// Bending moments of the left and the right tube about the axle's x and z axes, N m; zero without a section in
    /// the vehicle file.
    pub bending_n_m: [[f64; 2]; 2],
}

impl LinkedAxle {
    /// The axle of `file` with springs of these lengths under vertical loads on its tyres, left and right. The
    /// specific force, m/s^2, is (0, 0, g) in vehicle axes on level ground or stands; the ground is across it.
    ///
    /// # Errors
    /// When the file has no strut or unsprung masses, or the axle does not reach these lengths.
    pub fn carrying(
        &self,
        file: &Axle,
        lengths_m: [f64; 2],
        load_n: [f64; 2],
        specific_force_m_s2: Vector3<f64>,
    ) -> Result<LiveAxleAtRest, SuspensionError> {
        let missing = |table| SuspensionError::Missing {
            axle: "rear",
            table,
        };
        let strut = file.strut.as_ref().ok_or(missing("strut"))?;
        let unsprung = file.unsprung.as_ref().ok_or(missing("unsprung"))?;
        let pose = self.pose(lengths_m)?;
        let normal = specific_force_m_s2.normalize();
        let frames = [0, 1].map(|side| {
            let centre_m = pose.point_m(self.wheel_centres_m[side]);
            let pressed_m = load_n[side] / file.tyre.vertical_stiffness_n_m;
            let radius_m = file.tyre.unloaded_radius_m - pressed_m;
            TyreFrame::of_wheel(centre_m, pose.spindle(), normal, radius_m)
        });
        let motion = LiveAxleMotion {
            body: BodyMotion {
                specific_force_m_s2,
                ..BodyMotion::default()
            },
            ..LiveAxleMotion::default()
        };
        let statics = LiveAxleStatics::new(self, &pose, &frames, unsprung, &motion);
        let tyres = load_n.map(|load_n| Vector6::z() * load_n);
        let dampers_n = [0, 1].map(|side| {
            let past_m = pose.line(&self.dampers[side]).1 - strut.droop_stop_length_m;
            -strut.stop_stiffness_n_m * past_m.max(0.0)
        });
        let mut outer = statics.balance_offset[0];
        for side in 0..2 {
            let damper = statics.balance_from_members.column(LINKS + 2 + side);
            outer += statics.balance_from_tyre[side] * tyres[side] + damper * dampers_n[side];
        }
        let stiffness_n_m = (file.solid_axle()).and_then(|axle| axle.link_stiffness_n_m);
        let bound_n = stiffness_n_m.unwrap_or(0.0) * self.bind_m(&pose);
        let members =
            statics.members_from_balance(self)? * outer + statics.self_stress(self) * bound_n;
        Ok(LiveAxleAtRest {
            members: LiveAxleMembers {
                links_n: std::array::from_fn(|i| members[i]),
                springs_n: [members[LINKS], members[LINKS + 1]],
                dampers_n,
            },
            bending_n_m: [0, 1].map(|side| {
                let of_tyre = statics.bending_from_tyre[side] * tyres[side];
                (of_tyre + statics.bending_offset[side][0]).into()
            }),
            pose,
        })
    }

    /// The axle of `file` where it comes to rest under these loads: see [`LinkedAxle::carrying`]. Without loads,
    /// both wheels hang.
    ///
    /// # Errors
    /// As [`LinkedAxle::carrying`], and if the springs find no rest.
    pub fn at_rest(
        &self,
        file: &Axle,
        load_n: [f64; 2],
        specific_force_m_s2: Vector3<f64>,
    ) -> Result<LiveAxleAtRest, SuspensionError> {
        let no_rest = |surplus: Vector2<f64>| SuspensionError::OutOfReach {
            what: "spring force at rest",
            value: surplus.amax(),
            unit: "N",
        };
        // What the springs push more than the balance calls for.
        let at = |lengths_m: Vector2<f64>| -> Result<_, SuspensionError> {
            let rest = self.carrying(file, lengths_m.into(), load_n, specific_force_m_s2)?;
            let surplus = [0, 1].map(|side| {
                let force_n = self.spring_n(file, side, lengths_m[side]);
                force_n - rest.members.springs_n[side]
            });
            Ok((rest, Vector2::from(surplus)))
        };
        let mut lengths_m = Vector2::from(self.design_lengths_m);
        let (mut rest, mut surplus) = at(lengths_m)?;
        for _ in 0..ROUNDS {
            if surplus.amax() < CLOSED_N {
                return Ok(rest);
            }
            let mut slope = Matrix2::zeros();
            for side in 0..2 {
                let mut beside = lengths_m;
                beside[side] += STEP_M;
                slope.set_column(side, &((at(beside)?.1 - surplus) / STEP_M));
            }
            let step = slope.lu().solve(&-surplus).ok_or(no_rest(surplus))?;
            lengths_m += step * (LONGEST_STEP_M / step.amax()).min(1.0);
            (rest, surplus) = at(lengths_m)?;
        }
        Err(no_rest(surplus))
    }

    /// Force of a spring with its bump stop at a length of the line, N.
    fn spring_n(&self, file: &Axle, side: usize, length_m: f64) -> f64 {
        let Some(strut) = &file.strut else {
            return 0.0;
        };
        // The droop stop is in the damper.
        let spring_m = length_m + strut.design_length_m - self.design_lengths_m[side];
        let force = strut.force(spring_m, 0.0);
        force.spring_n + force.stop_n.max(0.0)
    }
}
