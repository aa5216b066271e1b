//! Kinematics of a solid axle on two lower links, two upper links and a Panhard rod: one body with two wheels.
//!
//! The coordinates are the lengths of both springs, left and right. They leave four of the six degrees of
//! freedom of a rigid body to five links of constant length: one constraint too many. A real axle takes the
//! excess up in its bushings (roll bind). With equally stiff links, the elongations r of the links are those
//! of the state of self-stress s that links and springs can have without an outer force: r = s t. The pose
//! therefore solves six equations,
//!
//! N (|b_i - x_i| - L_i) = 0, |b_k - x_k| = l_k,
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | x_i, b_i | ends on the axle and on the body of link i (0 to 4) and of spring k (left, right) | m |
//! | L_i, l_k | length of link i in the design position, wanted length of spring k | m |
//! | N | four orthonormal rows that are orthogonal to s | 1 |
//!
//! with s of the design position. In other poses s turns by a few degrees, which moves the axle by this part
//! of the elongations of the links.

mod path;
mod rest;
mod statics;

use nalgebra::{Matrix3, Matrix6, Rotation3, SMatrix, SVector, Vector3, Vector6};

use super::linkage::PointPath;
use super::{SuspensionError, finite};
use crate::vehicle::Vehicle;

pub use rest::LiveAxleAtRest;
pub use statics::{LiveAxleMembers, LiveAxleMotion, LiveAxleStatics};

/// Number of links: lower left, lower right, upper left, upper right, Panhard rod.
pub const LINKS: usize = 5;
/// Links and springs.
const LENGTHS: usize = LINKS + 2;
/// Largest error of a length in a pose, m.
const CLOSED_M: f64 = 1e-12;
/// Newton's steps at most: four suffice over the travel of a vehicle.
const ROUNDS: usize = 30;
/// Largest step of Newton's method, m and rad.
const LONGEST_STEP: f64 = 0.1;
/// Shortest line, m.
const SHORTEST_M: f64 = 1e-3;
/// Smallest determinant of the constraints' directions that hold an axle, m^3.
const SINGULAR: f64 = 1e-9;

/// A line between a point of the body and one of the axle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxleLine {
    /// End at the body, vehicle axes, m.
    pub body_m: Vector3<f64>,
    /// End at the axle from the origin of the axle, axes of the design position, m.
    pub axle_m: Vector3<f64>,
}

/// A solid axle on links, vehicle axes.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkedAxle {
    /// Middle between the wheel centres in the design position: the origin of the axle, m.
    pub origin_m: Vector3<f64>,
    /// Links in the order of [`LINKS`].
    pub links: [AxleLine; LINKS],
    /// Springs, left and right.
    pub springs: [AxleLine; 2],
    /// Dampers, left and right.
    pub dampers: [AxleLine; 2],
    /// Wheel centres from the origin, left and right, m.
    pub wheel_centres_m: [Vector3<f64>; 2],
    /// Centre of gravity of the axle without its wheels, from the origin, m.
    pub cg_m: Vector3<f64>,
    /// Moments of inertia of the axle without its wheels about its own centre of gravity, kg m^2.
    pub inertia_kg_m2: Vector3<f64>,
    /// Sections of the tubes with bending gauges, if the file tells them.
    pub section: Option<TubeSection>,
    link_lengths_m: [f64; LINKS],
    design_lengths_m: [f64; 2],
    /// Rows N.
    held: SMatrix<f64, 4, LINKS>,
    /// Unit vector of the part of the links in the state of self-stress.
    self_stress: SVector<f64, LINKS>,
}

/// Section of an axle tube, and what is outboard of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeSection {
    /// Distance from the middle plane, m.
    pub y_m: f64,
    /// Mass of the tube outboard of it, without the wheel, kg.
    pub end_mass_kg: f64,
    /// Centre of gravity of this part on the left side, from the origin of the axle, m.
    pub end_cg_m: Vector3<f64>,
}

/// Where an axle is, and how it moves with the lengths of its springs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveAxlePose {
    /// Lengths of the springs, left and right, m.
    pub lengths_m: [f64; 2],
    /// Rotation of the axle from the design position.
    pub vehicle_from_axle: Matrix3<f64>,
    /// Path of the axle's origin with its rotation. The coordinate `strut` of [`PointPath`] is the length of
    /// the left spring here, and `rack` that of the right one.
    pub path: PointPath,
}

impl LiveAxlePose {
    /// A point of the axle, vehicle axes, m.
    #[must_use]
    pub fn point_m(&self, from_origin_m: Vector3<f64>) -> Vector3<f64> {
        self.path.point_m + self.vehicle_from_axle * from_origin_m
    }

    /// Unit vector of both spindles; it points left.
    #[must_use]
    pub fn spindle(&self) -> Vector3<f64> {
        self.vehicle_from_axle.column(1).into_owned()
    }

    /// Path of a point of the axle.
    #[must_use]
    pub fn path_of(&self, from_origin_m: Vector3<f64>) -> PointPath {
        self.path.at(self.point_m(from_origin_m))
    }

    /// Unit vector from the end at the axle to that at the body, and the length of a line, m.
    #[must_use]
    pub fn line(&self, line: &AxleLine) -> (Vector3<f64>, f64) {
        let between = line.body_m - self.point_m(line.axle_m);
        let length_m = between.norm();
        (between / length_m, length_m)
    }
}

/// Place and rotation of an axle.
#[derive(Clone, Copy)]
struct Place {
    origin_m: Vector3<f64>,
    turned: Rotation3<f64>,
}

impl Place {
    /// Unit vector from axle to body, arm from the origin to the end at the axle, and length of a line.
    fn line(&self, line: &AxleLine) -> (Vector3<f64>, Vector3<f64>, f64) {
        let arm = self.turned * line.axle_m;
        let between = line.body_m - self.origin_m - arm;
        let length_m = between.norm();
        (between / length_m, arm, length_m)
    }
}

impl LinkedAxle {
    /// The rear axle of a vehicle.
    ///
    /// # Errors
    /// When the file has no live axle, or its links do not hold it.
    pub fn of(vehicle: &Vehicle) -> Result<Self, SuspensionError> {
        let file = (vehicle.rear.solid_axle()).ok_or(SuspensionError::Missing {
            axle: "rear",
            table: "live_axle",
        })?;
        let body = &vehicle.body;
        let place =
            |[x, y, z]: [f64; 3]| Vector3::new(x - body.cg_to_rear_axle_m, y - body.cg_y_m, z);
        let [ahead_m, half_track_m, height_m] = file.wheel_centre_m;
        let middle = Vector3::new(ahead_m, 0.0, height_m);
        let origin_m = place(middle.into());
        let seen = |p: [f64; 3]| Vector3::from(p) - middle;
        let one = |body_m: [f64; 3], axle_m: [f64; 3]| AxleLine {
            body_m: place(body_m),
            axle_m: seen(axle_m),
        };
        let both = |body_m: [f64; 3], axle_m: [f64; 3]| {
            [1.0, -1.0].map(|side| {
                let mirrored = |[x, y, z]: [f64; 3]| [x, side * y, z];
                one(mirrored(body_m), mirrored(axle_m))
            })
        };
        let [lower_left, lower_right] = both(file.lower_link_body_m, file.lower_link_axle_m);
        let [upper_left, upper_right] = both(file.upper_link_body_m, file.upper_link_axle_m);
        let panhard = one(file.panhard_body_m, file.panhard_axle_m);
        let section = file.section_y_m.map(|y_m| TubeSection {
            y_m,
            end_mass_kg: file.end_mass_kg.unwrap_or(0.0),
            end_cg_m: file
                .end_cg_m
                .map_or_else(|| Vector3::new(0.0, 0.5 * (y_m + half_track_m), 0.0), seen),
        });
        Self {
            origin_m,
            links: [lower_left, lower_right, upper_left, upper_right, panhard],
            springs: both(file.spring_body_m, file.spring_axle_m),
            dampers: both(file.damper_body_m, file.damper_axle_m),
            wheel_centres_m: [1.0, -1.0].map(|side| Vector3::y() * (side * half_track_m)),
            cg_m: seen(file.cg_m),
            inertia_kg_m2: file.inertia_kg_m2.into(),
            section,
            link_lengths_m: [0.0; LINKS],
            design_lengths_m: [0.0; 2],
            held: SMatrix::zeros(),
            self_stress: SVector::zeros(),
        }
        .closed()
    }

    /// The axle with what follows from its hard-points.
    fn closed(mut self) -> Result<Self, SuspensionError> {
        let design = self.design();
        let length = |line: &AxleLine| design.line(line).2;
        self.link_lengths_m = self.links.each_ref().map(length);
        self.design_lengths_m = self.springs.each_ref().map(length);
        let dampers_m = self.dampers.each_ref().map(length);
        let coincide = SuspensionError::Degenerate {
            what: "both ends of a link, a spring or a damper of the live axle coincide",
        };
        let lengths = (self.link_lengths_m.iter())
            .chain(&self.design_lengths_m)
            .chain(&dampers_m);
        if lengths
            .into_iter()
            .any(|length_m| is_below(*length_m, SHORTEST_M))
        {
            return Err(coincide);
        }
        let loose = SuspensionError::Degenerate {
            what: "links and springs do not hold the live axle",
        };
        let columns = self.gradients(&design);
        let stress = self_stress(&columns);
        let of_links = stress.fixed_rows::<LINKS>(0).into_owned();
        let size = of_links.norm();
        if is_below(size, SINGULAR) {
            return Err(loose);
        }
        self.self_stress = of_links / size;
        self.held = across(&self.self_stress);
        if is_below(self.constraints(&design).determinant().abs(), SINGULAR) {
            return Err(loose);
        }
        Ok(self)
    }

    fn design(&self) -> Place {
        Place {
            origin_m: self.origin_m,
            turned: Rotation3::identity(),
        }
    }

    /// Lengths of the springs in the design position, left and right, m.
    #[must_use]
    pub fn design_lengths_m(&self) -> [f64; 2] {
        self.design_lengths_m
    }

    /// Elongation of the links in a pose along their state of self-stress, m.
    #[must_use]
    pub fn bind_m(&self, pose: &LiveAxlePose) -> f64 {
        let of_link = |i: usize| pose.line(&self.links[i]).1 - self.link_lengths_m[i];
        (0..LINKS).map(|i| self.self_stress[i] * of_link(i)).sum()
    }

    /// Links and springs.
    fn lines(&self) -> impl Iterator<Item = &AxleLine> {
        self.links.iter().chain(&self.springs)
    }

    /// Change of each length for a movement and a rotation of the axle, as columns.
    fn gradients(&self, place: &Place) -> SMatrix<f64, 6, LENGTHS> {
        let mut columns = SMatrix::<f64, 6, LENGTHS>::zeros();
        for (k, line) in self.lines().enumerate() {
            let (towards, arm, _) = place.line(line);
            columns.set_column(k, &-wrench(towards, arm));
        }
        columns
    }

    /// Rows of the six equations of a pose.
    fn constraints(&self, place: &Place) -> Matrix6<f64> {
        let rows = self.gradients(place).transpose();
        let mut matrix = Matrix6::zeros();
        let of_links = self.held * rows.fixed_rows::<LINKS>(0);
        matrix.fixed_rows_mut::<4>(0).copy_from(&of_links);
        matrix
            .fixed_rows_mut::<2>(4)
            .copy_from(&rows.fixed_rows::<2>(LINKS));
        matrix
    }

    /// Errors of the six equations.
    fn errors(&self, place: &Place, lengths_m: [f64; 2]) -> Vector6<f64> {
        let length = |line: &AxleLine| place.line(line).2;
        let elongation =
            SVector::<f64, LINKS>::from_fn(|i, _| length(&self.links[i]) - self.link_lengths_m[i]);
        let of_links = self.held * elongation;
        let of_springs = [0, 1].map(|k| length(&self.springs[k]) - lengths_m[k]);
        Vector6::new(
            of_links[0],
            of_links[1],
            of_links[2],
            of_links[3],
            of_springs[0],
            of_springs[1],
        )
    }

    /// The pose in which the springs have these lengths, left and right, m.
    ///
    /// # Errors
    /// When the axle does not reach it.
    pub fn pose(&self, lengths_m: [f64; 2]) -> Result<LiveAxlePose, SuspensionError> {
        for length_m in lengths_m {
            finite("spring length", length_m, "m")?;
        }
        let out_of_reach = || {
            let apart = |k: usize| (lengths_m[k] - self.design_lengths_m[k]).abs();
            SuspensionError::OutOfReach {
                what: "spring length",
                value: lengths_m[usize::from(apart(1) > apart(0))],
                unit: "m",
            }
        };
        let mut place = self.design();
        for _ in 0..ROUNDS {
            let errors = self.errors(&place, lengths_m);
            let inverse = (self.constraints(&place))
                .try_inverse()
                .ok_or_else(out_of_reach)?;
            if errors.amax() < CLOSED_M {
                return Ok(self.moving(&place, lengths_m, &inverse));
            }
            let step = inverse * -errors;
            let largest = step.amax();
            if !largest.is_finite() {
                break;
            }
            let step = step * (LONGEST_STEP / largest).min(1.0);
            place.origin_m += step.fixed_rows::<3>(0);
            let turn: Vector3<f64> = step.fixed_rows::<3>(3).into_owned();
            place.turned = rotated(turn) * place.turned;
        }
        Err(out_of_reach())
    }
}

/// Whether a value is below a limit, or not a number.
pub(super) fn is_below(value: f64, limit: f64) -> bool {
    value.is_nan() || value <= limit
}

/// Rotation by a vector (Rodrigues' formula).
pub(super) fn rotated(turn: Vector3<f64>) -> Rotation3<f64> {
    let angle = turn.norm();
    let k = turn.cross_matrix();
    let half = math::sin(0.5 * angle);
    let (once, twice) = if angle > 0.0 {
        (
            math::sin(angle) / angle,
            2.0 * half * half / (angle * angle),
        )
    } else {
        (1.0, 0.5)
    };
    Rotation3::from_matrix_unchecked(Matrix3::identity() + k * once + k * k * twice)
}

/// A unit force and its moment about the origin of the axle.
fn wrench(force: Vector3<f64>, arm: Vector3<f64>) -> Vector6<f64> {
    let moment = arm.cross(&force);
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// Forces of links and springs that balance each other, by the minors of their lines (Cramer's rule).
fn self_stress(columns: &SMatrix<f64, 6, LENGTHS>) -> SVector<f64, LENGTHS> {
    SVector::from_fn(|left_out, _| {
        let minor = Matrix6::from_fn(|row, column| {
            columns[(row, column + usize::from(column >= left_out))]
        });
        let sign = if left_out % 2 == 0 { 1.0 } else { -1.0 };
        sign * minor.determinant()
    })
}

/// Four orthonormal rows that are orthogonal to a unit vector: those of the reflection that takes the unit
/// vector to the last axis, up to its sign (Householder).
fn across(unit: &SVector<f64, LINKS>) -> SMatrix<f64, 4, LINKS> {
    let mut normal = *unit;
    normal[LINKS - 1] += if unit[LINKS - 1] < 0.0 { -1.0 } else { 1.0 };
    let reflection = SMatrix::<f64, LINKS, LINKS>::identity()
        - normal * normal.transpose() * (2.0 / normal.norm_squared());
    reflection.fixed_rows::<4>(0).into_owned()
}

#[cfg(test)]
mod tests;
