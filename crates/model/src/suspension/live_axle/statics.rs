//! Balance of a live axle with both wheels, and the bending moments of its tubes.
//!
//! E_l w_l + E_r w_r + C (T, S, D) + g + h_l l_l'' + h_r l_r'' = 0 about the origin of the axle, vehicle axes
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | w, E | wrench that the ground exerts on a tyre (contact frame, about the contact point), and its map | N, N m |
//! | T | axial forces of the links, tension positive | N |
//! | S, D | forces of springs and dampers, pushing their ends apart | N |
//! | C | unit forces of links, springs and dampers on the axle, with their moments | 1, m |
//! | g | weight and inertia without the accelerations l'' of the springs' lengths, torque of the propeller shaft | N, N m |
//! | h | inertia for 1 m/s^2 of one length | N, N m |
//!
//! A tube that is cut at its section carries the part outboard of it. Its bending moment about an axis of the
//! axle, outboard part on the rest, is that of tyre, wheel and tube end about the tube's centre there. The
//! torque of the half-shaft is inside of the tube and is about the spindle.

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector2, Vector3, Vector6};

use super::{LINKS, LinkedAxle, LiveAxlePose, self_stress, wrench};
use crate::suspension::linkage::{Coordinates, PointPath};
use crate::suspension::{BodyMotion, SuspensionError, TyreFrame};
use crate::vehicle::Unsprung;

/// Links, springs, dampers.
const MEMBERS: usize = LINKS + 4;

/// Motion of a live axle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LiveAxleMotion {
    /// Motion of the sprung body.
    pub body: BodyMotion,
    /// Rates of the springs' lengths, left and right, m/s.
    pub rates_m_s: [f64; 2],
    /// Spin of the wheels against the axle, rad/s.
    pub spin_rad_s: [f64; 2],
    /// Its rate, rad/s^2.
    pub spin_dot_rad_s2: [f64; 2],
    /// Torque of the propeller shaft on the axle about its backward axis, N m.
    pub shaft_torque_n_m: f64,
}

/// Forces of the members of a live axle, N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LiveAxleMembers {
    /// Links in the order of [`LinkedAxle::links`], tension positive.
    pub links_n: [f64; LINKS],
    /// Springs with their bump stops, left and right, pushing their ends apart.
    pub springs_n: [f64; 2],
    /// Dampers with their rebound stops, left and right, pushing their ends apart.
    pub dampers_n: [f64; 2],
}

impl LiveAxleMembers {
    /// The forces in the order of the fields.
    #[must_use]
    pub fn to_vector(self) -> SVector<f64, MEMBERS> {
        let all = self.links_n.into_iter().chain(self.springs_n);
        SVector::from_iterator(all.chain(self.dampers_n))
    }
}

/// The linear maps of a live axle at one instant. The module has the equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveAxleStatics {
    /// E of both tyres.
    pub balance_from_tyre: [Matrix6<f64>; 2],
    /// C.
    pub balance_from_members: SMatrix<f64, 6, MEMBERS>,
    /// g, h_l, h_r.
    pub balance_offset: [Vector6<f64>; 3],
    /// Bending moments of both tubes about the axle's x and z axes from the wrench of their tyre; zero without a
    /// section in the vehicle file.
    pub bending_from_tyre: [SMatrix<f64, 2, 6>; 2],
    /// Of both tubes: bending moments without the tyre and without l'', and for 1 m/s^2 of both lengths, N m.
    pub bending_offset: [[Vector2<f64>; 3]; 2],
}

impl LiveAxleStatics {
    /// The maps at a pose with tyres that stand in `frames`, left and right.
    #[must_use]
    pub fn new(
        axle: &LinkedAxle,
        pose: &LiveAxlePose,
        frames: &[TyreFrame; 2],
        unsprung: &Unsprung,
        motion: &LiveAxleMotion,
    ) -> Self {
        let origin_m = pose.path.point_m;
        let mut members = SMatrix::<f64, 6, MEMBERS>::zeros();
        for (k, line) in axle.links.iter().enumerate() {
            members.set_column(k, &pull(pose, line));
        }
        for (k, line) in axle.springs.iter().chain(&axle.dampers).enumerate() {
            members.set_column(LINKS + k, &-pull(pose, line));
        }
        let moving = Moving {
            axle,
            pose,
            unsprung,
            motion,
        };
        let ends = [0, 1].map(|side| ACCELERATIONS.map(|at| moving.end(side, at)));
        Self {
            balance_from_tyre: frames.map(|frame| moved(&frame, origin_m)),
            balance_from_members: members,
            balance_offset: axle.inertia(pose, unsprung, motion),
            bending_from_tyre: [0, 1].map(|side| moving.bending(side, &frames[side])),
            bending_offset: ends.map(beyond_first),
        }
    }

    /// What the balance lacks: zero where tyres, members and motion belong together. N and N m, about the origin of
    /// the axle, vehicle axes.
    #[must_use]
    pub fn imbalance(
        &self,
        tyres: &[Vector6<f64>; 2],
        members: &LiveAxleMembers,
        accelerations_m_s2: [f64; 2],
    ) -> Vector6<f64> {
        let [still, left, right] = &self.balance_offset;
        let [of_left, of_right] = accelerations_m_s2;
        self.balance_from_tyre[0] * tyres[0]
            + self.balance_from_tyre[1] * tyres[1]
            + self.balance_from_members * members.to_vector()
            + still
            + left * of_left
            + right * of_right
    }

    /// Forces of links and springs in the state of self-stress of this pose. Those of the links are a unit vector, in
    /// the direction of the design position.
    #[must_use]
    pub fn self_stress(&self, axle: &LinkedAxle) -> SVector<f64, 7> {
        let columns = self.balance_from_members.fixed_columns::<7>(0).into_owned();
        let stress = self_stress(&columns);
        let of_links = stress.fixed_rows::<LINKS>(0);
        stress * (axle.self_stress.dot(&of_links).signum() / of_links.norm())
    }

    /// Forces of links and springs for an outer wrench on the axle (about its origin, vehicle axes): those without
    /// a part along the state of self-stress of the links, which no outer wrench calls for.
    ///
    /// # Errors
    /// When links and springs cannot hold the axle.
    pub fn members_from_balance(
        &self,
        axle: &LinkedAxle,
    ) -> Result<SMatrix<f64, 7, 6>, SuspensionError> {
        let mut equations = SMatrix::<f64, 7, 7>::zeros();
        equations
            .fixed_view_mut::<6, 7>(0, 0)
            .copy_from(&self.balance_from_members.fixed_columns::<7>(0));
        for (k, part) in axle.self_stress.iter().enumerate() {
            equations[(6, k)] = *part;
        }
        let inverse = equations.try_inverse().ok_or(SuspensionError::Degenerate {
            what: "links and springs do not hold the live axle",
        })?;
        Ok(-inverse.fixed_columns::<6>(0).into_owned())
    }
}

impl LinkedAxle {
    /// g, h_l and h_r: weight and inertia of axle and wheels with the torque of the propeller shaft, about the origin,
    /// vehicle axes.
    #[must_use]
    pub fn inertia(
        &self,
        pose: &LiveAxlePose,
        unsprung: &Unsprung,
        motion: &LiveAxleMotion,
    ) -> [Vector6<f64>; 3] {
        let moving = Moving {
            axle: self,
            pose,
            unsprung,
            motion,
        };
        beyond_first(ACCELERATIONS.map(|at| moving.whole(at)))
    }
}

/// Accelerations of the lengths: none, 1 m/s^2 of the left, of the right.
const ACCELERATIONS: [Coordinates; 3] = [
    Coordinates {
        strut: 0.0,
        rack: 0.0,
    },
    Coordinates {
        strut: 1.0,
        rack: 0.0,
    },
    Coordinates {
        strut: 0.0,
        rack: 1.0,
    },
];

fn beyond_first<T: std::ops::Sub<Output = T> + Copy>([still, left, right]: [T; 3]) -> [T; 3] {
    [still, left - still, right - still]
}

/// Unit tension of a line on the axle.
fn pull(pose: &LiveAxlePose, line: &super::AxleLine) -> Vector6<f64> {
    let (towards, _) = pose.line(line);
    wrench(towards, pose.vehicle_from_axle * line.axle_m)
}

/// Map of a tyre's wrench to vehicle axes about a point.
fn moved(frame: &TyreFrame, about_m: Vector3<f64>) -> Matrix6<f64> {
    let turn = frame.vehicle_from_tyre;
    let mut map = Matrix6::zeros();
    map.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    map.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    let arm = (frame.contact_m - about_m).cross_matrix();
    map.fixed_view_mut::<3, 3>(3, 0).copy_from(&(arm * turn));
    map
}

/// An axle and its motion.
struct Moving<'a> {
    axle: &'a LinkedAxle,
    pose: &'a LiveAxlePose,
    unsprung: &'a Unsprung,
    motion: &'a LiveAxleMotion,
}

impl Moving<'_> {
    fn rate(&self) -> Coordinates {
        let [strut, rack] = self.motion.rates_m_s;
        Coordinates { strut, rack }
    }

    /// Weight and inertia of a mass at a point of the axle.
    fn mass(&self, mass_kg: f64, path: &PointPath, acceleration: Coordinates) -> Vector3<f64> {
        path.specific_force_m_s2(&self.motion.body, self.rate(), acceleration) * -mass_kg
    }

    /// Rate and angular acceleration of the axle.
    fn turning(&self, acceleration: Coordinates) -> [Vector3<f64>; 2] {
        let (body, path) = (&self.motion.body, &self.pose.path);
        [
            body.rate_rad_s + path.rotation.rate(self.rate()),
            path.rate_dot_rad_s2(body, self.rate(), acceleration),
        ]
    }

    /// Weight, inertia and spin of a wheel as a wrench about its centre.
    fn wheel(&self, side: usize, acceleration: Coordinates) -> Vector6<f64> {
        let path = self.pose.path_of(self.axle.wheel_centres_m[side]);
        let unsprung = self.unsprung;
        let s = self.pose.spindle();
        let (spin, diametral) = (
            unsprung.wheel_spin_inertia_kg_m2,
            unsprung.wheel_diametral_inertia_kg_m2,
        );
        let inertia = Matrix3::identity() * diametral + s * s.transpose() * (spin - diametral);
        let [rate, rate_dot] = self.turning(acceleration);
        let momentum = inertia * rate + s * (spin * self.motion.spin_rad_s[side]);
        let moment = inertia * rate_dot
            + s * (spin * self.motion.spin_dot_rad_s2[side])
            + rate.cross(&momentum);
        let force = self.mass(unsprung.wheel_mass_kg, &path, acceleration);
        Vector6::new(force.x, force.y, force.z, -moment.x, -moment.y, -moment.z)
    }

    /// Weight and inertia of axle and wheels and the shaft's torque, about the origin.
    fn whole(&self, acceleration: Coordinates) -> Vector6<f64> {
        let turned = &self.pose.vehicle_from_axle;
        let arm = turned * self.axle.cg_m;
        let path = self.pose.path_of(self.axle.cg_m);
        let mass_kg = 2.0 * (self.unsprung.total_mass_kg() - self.unsprung.wheel_mass_kg);
        let inertia =
            turned * Matrix3::from_diagonal(&self.axle.inertia_kg_m2) * turned.transpose();
        let [rate, rate_dot] = self.turning(acceleration);
        let moment = -(inertia * rate_dot + rate.cross(&(inertia * rate)))
            - turned.column(0) * self.motion.shaft_torque_n_m;
        let mut whole = wrench(self.mass(mass_kg, &path, acceleration), arm);
        for side in 0..2 {
            let wheel = self.wheel(side, acceleration);
            let arm = turned * self.axle.wheel_centres_m[side];
            whole += wrench(wheel.fixed_rows::<3>(0).into_owned(), arm);
            let mut own = whole.fixed_rows_mut::<3>(3);
            own += wheel.fixed_rows::<3>(3);
        }
        let mut own = whole.fixed_rows_mut::<3>(3);
        own += moment;
        whole
    }

    /// Rows that take moments about the axle's x and z axes.
    fn across(&self) -> SMatrix<f64, 2, 3> {
        let turned = &self.pose.vehicle_from_axle;
        SMatrix::from_rows(&[turned.column(0).transpose(), turned.column(2).transpose()])
    }

    /// Centre of the tube at its section, from the origin of the axle.
    fn section(&self, side: usize) -> Option<(Vector3<f64>, f64)> {
        let section = self.axle.section.as_ref()?;
        let sign = if side == 0 { 1.0 } else { -1.0 };
        Some((Vector3::y() * (sign * section.y_m), sign))
    }

    fn bending(&self, side: usize, frame: &TyreFrame) -> SMatrix<f64, 2, 6> {
        let Some((place, _)) = self.section(side) else {
            return SMatrix::zeros();
        };
        let map = moved(frame, self.pose.point_m(place));
        self.across() * map.fixed_rows::<3>(3)
    }

    /// Bending moments of weight and inertia of wheel and tube end. The rotation of the end about its own centre of
    /// gravity is left out.
    fn end(&self, side: usize, acceleration: Coordinates) -> Vector2<f64> {
        let (Some((place, sign)), Some(section)) = (self.section(side), &self.axle.section) else {
            return Vector2::zeros();
        };
        let turned = &self.pose.vehicle_from_axle;
        let [x, y, z] = section.end_cg_m.into();
        let cg = Vector3::new(x, sign * y, z);
        let end = self.mass(section.end_mass_kg, &self.pose.path_of(cg), acceleration);
        let wheel = self.wheel(side, acceleration);
        let to_wheel = turned * (self.axle.wheel_centres_m[side] - place);
        let moment = (turned * (cg - place)).cross(&end)
            + to_wheel.cross(&wheel.fixed_rows::<3>(0).into_owned())
            + wheel.fixed_rows::<3>(3);
        self.across() * moment
    }
}
