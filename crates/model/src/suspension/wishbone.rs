//! Exact kinematics of a corner from its hard-points: double wishbone, MacPherson strut, five links, trailing arm.
//!
//! The lower arm turns about its hinge until the strut has the wanted length; the upper ball
//! joint is where the circle of the upper arm meets the sphere about the lower ball joint; the
//! tie rod's outer end is where its circle about the line through both ball joints meets the
//! sphere about the tie rod's inner end. Each of the three is
//! A cos(phi) + B sin(phi) = C, solved in closed form; of both roots the one of the design
//! position is kept. The thesis (2.2.4) has the lever of one arm only, and upside down.
//!
//! The upright of a MacPherson strut slides along the strut's axis and turns about its top. The top takes the
//! place of the upper ball joint: it stands still in the body, and moves in the upright with the strut's
//! length. With the length, the distance between top and lower ball joint is known, and the lower arm turns
//! until it has this distance.
//!
//! A trailing arm carries the wheel itself: it turns about its bushings until the strut has the wanted length. Five
//! links have no closed form (`links.rs`).

mod circle;
mod links;
mod path;
mod points;
mod straight;
mod trailing;

use nalgebra::{Matrix3, Vector3};
use sample::Wheel;

use super::{PointPath, SuspensionError, finite};
use crate::vehicle::{Axle, Vehicle};

use circle::{Circle, Turn, branch};
pub(super) use links::Links;
pub use points::HardPoints;

/// Largest step of a strut's length in the search for a jounce, m.
const LONGEST_STRUT_STEP_M: f64 = 0.05;

/// The linkage of one corner in vehicle axes, left or right.
#[derive(Clone, Debug, PartialEq)]
pub struct Corner {
    /// Which wheel it carries.
    pub wheel: Wheel,
    /// Hard-points in the design position, vehicle axes; a right corner is mirrored already.
    pub points: HardPoints,
    /// Unit vector of the lower arm's hinge, rear to front.
    pub lower_axis: Vector3<f64>,
    /// Unit vector of the upper arm's hinge, rear to front.
    pub upper_axis: Vector3<f64>,
    /// Direction in which the rack moves for positive travel (that steers left): -1 towards -y
    /// (tie rods behind the king-pin), +1 towards +y (in front of it).
    pub rack_direction: f64,
    /// Part of the force along the hinge of a MacPherson strut's arm that the front bushing takes, if the file has it.
    pub(super) hinge_front_share: Option<f64>,
    /// Of the strut's end at the lower arm; of the lower ball joint under a MacPherson strut.
    strut_circle: Circle,
    guide: Guide,
    design: Upright,
    tie_rod_length_m: f64,
    tie_rod_branch: f64,
    design_strut_length_m: f64,
}

/// What guides the upright above the lower ball joint.
#[derive(Clone, Debug, PartialEq)]
enum Guide {
    /// An arm, by the circle of its ball joint.
    Arm(Circle),
    /// A strut that is part of the upright, by its direction from the top down in the design position.
    Strut(Vector3<f64>),
    /// Five links that hold it with the strut.
    Links(Box<Links>),
    /// The lower arm itself, of which it is a part.
    Trailing,
    /// No linkage is known: the wheel moves as this path tells, and turns about an upright axis. All outboard
    /// mass is at the wheel centre.
    Straight(WheelPath),
}

/// How a wheel moves with the length of its strut, where no hard-points tell it. Vehicle axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelPath {
    /// Movement of the wheel centre for one metre of strut in the design position.
    pub travel: Vector3<f64>,
    /// Change of that for one metre, 1/m.
    pub bend: Vector3<f64>,
    /// Turn of the upright for one metre of strut in the design position, rad/m.
    pub turn: Vector3<f64>,
    /// Change of that for one metre, rad/m^2.
    pub turn_bend: Vector3<f64>,
}

/// Places of the joints in the upright, in the axes of the design position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Upright {
    /// From the lower to the upper ball joint, m.
    length_m: f64,
    /// From the lower ball joint along the king-pin to below the tie rod, m.
    kingpin_foot_m: f64,
    tie_rod_radius_m: f64,
    frame: Matrix3<f64>,
}

impl Upright {
    fn new(lower: Vector3<f64>, upper: Vector3<f64>, outer: Vector3<f64>) -> Self {
        let kingpin = upper - lower;
        let length_m = kingpin.norm();
        let axis = kingpin / length_m;
        let kingpin_foot_m = axis.dot(&(outer - lower));
        let lever = outer - (lower + axis * kingpin_foot_m);
        Self {
            length_m,
            kingpin_foot_m,
            tie_rod_radius_m: lever.norm(),
            frame: frame(lower, upper, outer),
        }
    }
}

/// Where every point of a corner is, vehicle axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerPose {
    /// Length of the strut, m.
    pub strut_length_m: f64,
    /// Rack travel, positive steers left, m.
    pub rack_m: f64,
    /// Turn of the lower arm about its hinge from the design position, rad.
    pub lower_angle_rad: f64,
    /// Turn of the upper arm about its hinge from the design position, rad.
    pub upper_angle_rad: f64,
    /// Lower ball joint, m.
    pub lower_ball_m: Vector3<f64>,
    /// Upper ball joint, m.
    pub upper_ball_m: Vector3<f64>,
    /// Tie rod at the rack, m.
    pub tie_rod_inner_m: Vector3<f64>,
    /// Tie rod at the upright, m.
    pub tie_rod_outer_m: Vector3<f64>,
    /// Strut at the lower arm, m.
    pub strut_arm_m: Vector3<f64>,
    /// Unit vector along the strut, chassis end to arm end.
    pub strut_direction: Vector3<f64>,
    /// Wheel centre, m.
    pub wheel_centre_m: Vector3<f64>,
    /// Unit vector of the spindle; it points left on both sides.
    pub spindle: Vector3<f64>,
    /// Rotation of the upright from the design position.
    pub vehicle_from_upright: Matrix3<f64>,
    /// Centre of gravity of the upright, m.
    pub upright_cg_m: Vector3<f64>,
    /// Centre of gravity of the upper arm, m.
    pub upper_arm_cg_m: Vector3<f64>,
    /// Centre of gravity of the lower arm, m.
    pub lower_arm_cg_m: Vector3<f64>,
}

impl CornerPose {
    /// Steer angle of the wheel about the vehicle's z axis, left positive, rad.
    #[must_use]
    pub fn steer_rad(&self) -> f64 {
        math::atan2(-self.spindle.x, self.spindle.y)
    }

    /// Inclination of the wheel plane about its heading, rad: right-hand rule, so that the top
    /// leans right where positive, on both sides. This is ISO 8855's inclination angle; see
    /// [`CornerPose::camber_rad`].
    #[must_use]
    pub fn inclination_rad(&self) -> f64 {
        math::asin(self.spindle.z.clamp(-1.0, 1.0))
    }

    /// Camber against the vehicle's z axis, rad: positive where the wheel's top leans outwards.
    #[must_use]
    pub fn camber_rad(&self, wheel: Wheel) -> f64 {
        -wheel.side() * self.inclination_rad()
    }

    /// Toe against the vehicle's x axis, rad: positive where the wheel's front points inwards.
    #[must_use]
    pub fn toe_in_rad(&self, wheel: Wheel) -> f64 {
        -wheel.side() * self.steer_rad()
    }

    /// Unit vector from the lower to the upper ball joint.
    #[must_use]
    pub fn kingpin(&self) -> Vector3<f64> {
        (self.upper_ball_m - self.lower_ball_m).normalize()
    }
}

/// Velocity of the wheel centre and rotation rate of the upright for one unit of an input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Movement of the wheel centre, m per unit.
    pub wheel_centre: Vector3<f64>,
    /// Rotation of the upright, rad per unit.
    pub rotation: Vector3<f64>,
}

impl Twist {
    /// Movement of another point that is fixed to the upright, m per unit.
    #[must_use]
    pub fn at(&self, pose: &CornerPose, point_m: Vector3<f64>) -> Vector3<f64> {
        self.wheel_centre + self.rotation.cross(&(point_m - pose.wheel_centre_m))
    }
}

/// First derivatives of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerRates {
    /// Per metre of strut length, rack held.
    pub strut: Twist,
    /// Per metre of rack travel, strut held.
    pub rack: Twist,
    /// Turn of the lower arm per metre of strut length, rad/m.
    pub lower_angle_per_strut: f64,
    /// Turn of the upper arm per metre of strut length, rad/m.
    pub upper_angle_per_strut: f64,
}

/// Paths of the moving parts of a corner, with first and second derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerPath {
    /// Wheel centre, with the rotation of the upright.
    pub wheel: PointPath,
    /// Centre of gravity of the upper arm.
    pub upper_arm: PointPath,
    /// Centre of gravity of the lower arm.
    pub lower_arm: PointPath,
}

impl CornerRates {
    /// Motion ratio: strut travel for one metre of upward wheel travel, as a positive number.
    /// The wheel rate is its square times the spring stiffness (where the thesis's equation 2.27
    /// multiplies by 2.3, its inverse).
    #[must_use]
    pub fn motion_ratio(&self) -> f64 {
        -1.0 / self.strut.wheel_centre.z
    }

    /// Bump steer: steer angle per metre of upward wheel travel, left positive, rad/m.
    #[must_use]
    pub fn bump_steer_rad_m(&self) -> f64 {
        self.strut.rotation.z / self.strut.wheel_centre.z
    }
}

impl Corner {
    /// The corner of `wheel` of `vehicle`.
    ///
    /// # Errors
    /// When the axle has no hard-points, or degenerate ones.
    pub fn of(vehicle: &Vehicle, wheel: Wheel) -> Result<Self, SuspensionError> {
        let body = &vehicle.body;
        let ahead_m = if wheel.is_front() {
            body.front_axle_to_cg_m
        } else {
            -body.cg_to_rear_axle_m
        };
        Self::placed(vehicle.axle(wheel), [ahead_m, -body.cg_y_m], wheel)
    }

    /// The corner of `wheel` on `axle`, whose frame's origin is `axle_x_m` ahead of the centre of
    /// gravity.
    ///
    /// # Errors
    /// When the axle has no hard-points, or degenerate ones.
    pub fn new(axle: &Axle, axle_x_m: f64, wheel: Wheel) -> Result<Self, SuspensionError> {
        Self::placed(axle, [axle_x_m, 0.0], wheel)
    }

    /// The corner of `wheel` on `axle`, whose frame's origin is `axle_m` ahead and left of the centre
    /// of gravity.
    fn placed(
        axle: &Axle,
        [axle_x_m, axle_y_m]: [f64; 2],
        wheel: Wheel,
    ) -> Result<Self, SuspensionError> {
        let name = if wheel.is_front() { "front" } else { "rear" };
        let origin_m = [finite("axle x", axle_x_m, "m")?, axle_y_m];
        if let Some(file) = &axle.five_link {
            return Self::on_links(axle, file, origin_m, wheel);
        }
        let points = HardPoints::new(axle, origin_m, wheel).ok_or(SuspensionError::Missing {
            axle: name,
            table: "wishbone, macpherson, five_link or trailing_arm",
        })?;
        if axle.trailing_arm.is_some() {
            return Self::on_trailing_arm(points, wheel);
        }
        let has_upper_arm = axle.wishbone.is_some();
        points.check(has_upper_arm)?;
        let mut corner = Self::from_points(points, has_upper_arm, wheel);
        corner.hinge_front_share = (axle.macpherson.as_ref()).and_then(|arm| arm.hinge_front_share);
        Ok(corner)
    }

    fn from_points(points: HardPoints, has_upper_arm: bool, wheel: Wheel) -> Self {
        let lower_axis = (points.lower_front - points.lower_rear).normalize();
        let strut = points.strut_arm - points.strut_chassis;
        let (upper_axis, on_lower_arm, guide) = if has_upper_arm {
            let axis = (points.upper_front - points.upper_rear).normalize();
            let (rear, ball) = (points.upper_rear, points.upper_ball);
            let circle = Circle::new(rear, axis, ball, points.lower_ball);
            (axis, points.strut_arm, Guide::Arm(circle))
        } else {
            let direction = strut.normalize();
            (Vector3::x(), points.lower_ball, Guide::Strut(direction))
        };
        let design = Upright::new(points.lower_ball, points.upper_ball, points.tie_rod_outer);
        let axis = (points.upper_ball - points.lower_ball) / design.length_m;
        let foot = points.lower_ball + axis * design.kingpin_foot_m;
        let lever = points.tie_rod_outer - foot;
        Self {
            wheel,
            lower_axis,
            upper_axis,
            rack_direction: if lever.x < 0.0 { -1.0 } else { 1.0 },
            hinge_front_share: None,
            strut_circle: Circle::new(
                points.lower_rear,
                lower_axis,
                on_lower_arm,
                points.strut_chassis,
            ),
            guide,
            design,
            tie_rod_length_m: (points.tie_rod_outer - points.tie_rod_inner).norm(),
            tie_rod_branch: branch(foot, axis, lever, points.tie_rod_inner),
            design_strut_length_m: strut.norm(),
            points,
        }
    }

    /// Directions in which a MacPherson strut's tube is bent in a pose, forwards and to the left: unit vectors
    /// across the strut that turn with the upright. `None` for a double wishbone.
    pub(super) fn across_strut(&self, pose: &CornerPose) -> Option<[Vector3<f64>; 2]> {
        let Guide::Strut(direction) = self.guide else {
            return None;
        };
        let forward = (Vector3::x() - direction * direction.x).normalize();
        let turned = &pose.vehicle_from_upright;
        Some([turned * forward, turned * forward.cross(&direction)])
    }

    /// A corner whose wheel no arm with a ball joint guides.
    fn guided(wheel: Wheel, points: HardPoints, guide: Guide, design_strut_length_m: f64) -> Self {
        let hinge = points.lower_front - points.lower_rear;
        let lower_axis = hinge.try_normalize(0.0).unwrap_or(Vector3::x());
        Self {
            wheel,
            strut_circle: Circle::new(
                points.lower_rear,
                lower_axis,
                points.strut_arm,
                points.strut_chassis,
            ),
            lower_axis,
            upper_axis: Vector3::x(),
            rack_direction: 1.0,
            hinge_front_share: None,
            guide,
            design: Upright::default(),
            tie_rod_length_m: 0.0,
            tie_rod_branch: 1.0,
            design_strut_length_m,
            points,
        }
    }

    /// Places of the joints in the upright with a strut length.
    fn upright(&self, strut_length_m: f64) -> Upright {
        match self.guide {
            Guide::Arm(_) | Guide::Links(_) | Guide::Trailing | Guide::Straight(_) => self.design,
            Guide::Strut(direction) => {
                let p = &self.points;
                let top = p.strut_arm - direction * strut_length_m;
                Upright::new(p.lower_ball, top, p.tie_rod_outer)
            }
        }
    }

    /// Length of the strut in the design position, m.
    #[must_use]
    pub fn design_strut_length_m(&self) -> f64 {
        self.design_strut_length_m
    }

    /// The pose in which the strut is `strut_length_m` long and the rack has moved `rack_m`
    /// (positive steers left; 0 on an axle without a rack).
    ///
    /// # Errors
    /// When no position of the linkage has this length or travel.
    pub fn pose(&self, strut_length_m: f64, rack_m: f64) -> Result<CornerPose, SuspensionError> {
        finite("strut length", strut_length_m, "m")?;
        if let Guide::Straight(path) = self.guide {
            let steer_rad = finite("steer angle", rack_m, "rad")?;
            return Ok(self.straight_pose(strut_length_m, steer_rad, path));
        }
        if let Guide::Links(links) = &self.guide {
            finite("rack travel", rack_m, "m")?;
            return self.links_pose(links, strut_length_m, rack_m);
        }
        let upright = self.upright(strut_length_m);
        let distance_m = match self.guide {
            Guide::Strut(_) => upright.length_m,
            _ => strut_length_m,
        };
        let turn = self
            .strut_circle
            .turn_to(self.points.strut_chassis, distance_m)
            .ok_or(SuspensionError::OutOfReach {
                what: "strut length",
                value: strut_length_m,
                unit: "m",
            })?;
        self.pose_turned(turn, turn.angle_rad(), &upright, rack_m)
    }

    /// The pose in which the lower arm has turned by `angle_rad` about its hinge (rear to front,
    /// right-hand rule) from the design position.
    ///
    /// # Errors
    /// When the linkage cannot follow the arm or the rack that far.
    pub fn pose_at_angle(
        &self,
        angle_rad: f64,
        rack_m: f64,
    ) -> Result<CornerPose, SuspensionError> {
        finite("lower arm angle", angle_rad, "rad")?;
        if let Guide::Links(_) = self.guide {
            return Err(SuspensionError::Missing {
                axle: if self.wheel.is_front() {
                    "front"
                } else {
                    "rear"
                },
                table: "wishbone",
            });
        }
        let turn = Turn::by(angle_rad);
        let length_m =
            self.strut_length_m(turn)
                .ok_or(out_of_reach("lower arm angle", angle_rad, "rad"))?;
        self.pose_turned(turn, angle_rad, &self.upright(length_m), rack_m)
    }

    /// Length of the strut with the lower arm turned, m. Under a MacPherson strut, the top is in the upright
    /// where its distance from the lower ball joint is that in the body.
    fn strut_length_m(&self, lower: Turn) -> Option<f64> {
        let p = &self.points;
        let turned = |point| lower.carry(p.lower_rear, self.lower_axis, point);
        let Guide::Strut(direction) = self.guide else {
            return Some((turned(p.strut_arm) - p.strut_chassis).norm());
        };
        let to_low = p.strut_arm - p.lower_ball;
        let along = to_low.dot(&direction);
        let distance = p.strut_chassis - turned(p.lower_ball);
        let square = along * along - to_low.norm_squared() + distance.norm_squared();
        let side = (self.design_strut_length_m - along).signum();
        (square >= 0.0).then(|| along + side * square.sqrt())
    }

    fn pose_turned(
        &self,
        lower: Turn,
        lower_angle_rad: f64,
        upright: &Upright,
        rack_m: f64,
    ) -> Result<CornerPose, SuspensionError> {
        finite("rack travel", rack_m, "m")?;
        if let Guide::Trailing = self.guide {
            return Ok(self.trailing_pose(lower, lower_angle_rad, rack_m));
        }
        let p = &self.points;
        let turn_lower = |point| lower.carry(p.lower_rear, self.lower_axis, point);
        let lower_ball = turn_lower(p.lower_ball);
        let upper = match &self.guide {
            Guide::Arm(circle) => circle.turn_to(lower_ball, upright.length_m),
            _ => Some(Turn::by(0.0)),
        };
        let upper = upper.ok_or(out_of_reach("lower arm angle", lower_angle_rad, "rad"))?;
        let turn_upper = |point| upper.carry(p.upper_rear, self.upper_axis, point);
        let upper_ball = turn_upper(p.upper_ball);
        let inner = p.tie_rod_inner + Vector3::y() * (self.rack_direction * rack_m);
        let outer = self
            .tie_rod_outer(upright, lower_ball, upper_ball, inner)
            .ok_or(out_of_reach("rack travel", rack_m, "m"))?;
        let rotation = frame(lower_ball, upper_ball, outer) * upright.frame.transpose();
        let follow = |point: Vector3<f64>| lower_ball + rotation * (point - p.lower_ball);
        let strut_arm = match self.guide {
            Guide::Strut(_) => follow(p.strut_arm),
            _ => turn_lower(p.strut_arm),
        };
        let strut = strut_arm - p.strut_chassis;
        let strut_length_m = strut.norm();
        Ok(CornerPose {
            strut_length_m,
            rack_m,
            lower_angle_rad,
            upper_angle_rad: upper.angle_rad(),
            lower_ball_m: lower_ball,
            upper_ball_m: upper_ball,
            tie_rod_inner_m: inner,
            tie_rod_outer_m: outer,
            strut_arm_m: strut_arm,
            strut_direction: strut / strut_length_m,
            wheel_centre_m: follow(p.wheel_centre),
            spindle: rotation.column(1).into_owned(),
            vehicle_from_upright: rotation,
            upright_cg_m: follow(p.upright_cg),
            upper_arm_cg_m: turn_upper(p.upper_arm_cg),
            lower_arm_cg_m: turn_lower(p.lower_arm_cg),
        })
    }

    /// The pose in which the wheel centre stands `jounce_m` above its design height.
    ///
    /// # Errors
    /// When the linkage does not reach it.
    pub fn pose_at_jounce(
        &self,
        jounce_m: f64,
        rack_m: f64,
    ) -> Result<CornerPose, SuspensionError> {
        let target = self.points.wheel_centre.z + finite("jounce", jounce_m, "m")?;
        let out_of_reach = SuspensionError::OutOfReach {
            what: "jounce",
            value: jounce_m,
            unit: "m",
        };
        let by_length = matches!(self.guide, Guide::Links(_));
        let mut at = if by_length {
            self.design_strut_length_m
        } else {
            0.0
        };
        for _ in 0..30 {
            let pose = if by_length {
                self.pose(at, rack_m)
            } else {
                self.pose_at_angle(at, rack_m)
            };
            let pose = pose.map_err(|_| out_of_reach.clone())?;
            let rates = self.rates(&pose);
            let miss = target - pose.wheel_centre_m.z;
            if miss.abs() < 1e-12 {
                return Ok(pose);
            }
            let (per, most) = if by_length {
                (1.0, LONGEST_STRUT_STEP_M)
            } else {
                (rates.lower_angle_per_strut, 0.2)
            };
            let slope = rates.strut.wheel_centre.z / per;
            at += (miss / slope).clamp(-most, most);
        }
        Err(out_of_reach)
    }

    /// First derivatives at `pose`.
    #[must_use]
    pub fn rates(&self, pose: &CornerPose) -> CornerRates {
        let p = &self.points;
        if let Some(path) = self.straight_path(pose) {
            return CornerRates {
                strut: Twist {
                    wheel_centre: path.travel,
                    rotation: path.turn,
                },
                rack: Twist {
                    wheel_centre: Vector3::zeros(),
                    rotation: Vector3::z(),
                },
                lower_angle_per_strut: 0.0,
                upper_angle_per_strut: 0.0,
            };
        }
        match &self.guide {
            Guide::Links(links) => return self.links_rates(links, pose),
            Guide::Trailing => return self.trailing_rates(pose),
            _ => {}
        }
        let rack_velocity = Vector3::y() * self.rack_direction;
        let by_rack = upright_twist(pose, Vector3::zeros(), Vector3::zeros(), rack_velocity);
        if let Guide::Strut(_) = self.guide {
            // The point of the upright that is at the top moves along the strut.
            let upper = pose.strut_direction;
            let along = self.lower_axis.cross(&(pose.lower_ball_m - p.lower_rear));
            let kingpin = pose.upper_ball_m - pose.lower_ball_m;
            let lower_angle_per_strut = kingpin.dot(&upper) / kingpin.dot(&along);
            let lower = along * lower_angle_per_strut;
            return CornerRates {
                strut: upright_twist(pose, lower, upper, Vector3::zeros()),
                rack: by_rack,
                lower_angle_per_strut,
                upper_angle_per_strut: 0.0,
            };
        }
        let strut_per_angle = self
            .lower_axis
            .cross(&(pose.strut_arm_m - p.lower_rear))
            .dot(&pose.strut_direction);
        let lower_angle_per_strut = 1.0 / strut_per_angle;
        let lower =
            self.lower_axis.cross(&(pose.lower_ball_m - p.lower_rear)) * lower_angle_per_strut;
        let upper_path = self.upper_axis.cross(&(pose.upper_ball_m - p.upper_rear));
        let kingpin = pose.upper_ball_m - pose.lower_ball_m;
        let upper_angle_per_strut = kingpin.dot(&lower) / kingpin.dot(&upper_path);
        CornerRates {
            strut: upright_twist(
                pose,
                lower,
                upper_path * upper_angle_per_strut,
                Vector3::zeros(),
            ),
            rack: by_rack,
            lower_angle_per_strut,
            upper_angle_per_strut,
        }
    }

    fn tie_rod_outer(
        &self,
        upright: &Upright,
        lower_ball: Vector3<f64>,
        upper_ball: Vector3<f64>,
        inner: Vector3<f64>,
    ) -> Option<Vector3<f64>> {
        let radius_m = upright.tie_rod_radius_m;
        let axis = (upper_ball - lower_ball) / upright.length_m;
        let foot = lower_ball + axis * upright.kingpin_foot_m;
        let to_inner = inner - foot;
        let along = axis.dot(&to_inner);
        let radial = to_inner - axis * along;
        let reach = radial.norm();
        let cosine = (radius_m.powi(2) + reach * reach + along * along
            - self.tie_rod_length_m.powi(2))
            / (2.0 * radius_m * reach);
        if cosine.is_nan() || cosine.abs() > 1.0 {
            return None;
        }
        let sine = self.tie_rod_branch * (1.0 - cosine * cosine).sqrt();
        let e = radial / reach;
        Some(foot + (e * cosine + axis.cross(&e) * sine) * radius_m)
    }
}

fn out_of_reach(what: &'static str, value: f64, unit: &'static str) -> SuspensionError {
    SuspensionError::OutOfReach { what, value, unit }
}

/// Orthonormal axes of the upright from its three joints.
fn frame(lower: Vector3<f64>, upper: Vector3<f64>, outer: Vector3<f64>) -> Matrix3<f64> {
    let z = (upper - lower).normalize();
    let y = z.cross(&(outer - lower)).normalize();
    Matrix3::from_columns(&[y.cross(&z), y, z])
}

/// The upright's twist from its joints' velocities; of the tie rod's, the inner end's is given.
fn upright_twist(
    pose: &CornerPose,
    lower: Vector3<f64>,
    upper: Vector3<f64>,
    inner: Vector3<f64>,
) -> Twist {
    let kingpin = pose.upper_ball_m - pose.lower_ball_m;
    let across = kingpin.cross(&(upper - lower)) / kingpin.norm_squared();
    let rod = pose.tie_rod_outer_m - pose.tie_rod_inner_m;
    let arm = pose.tie_rod_outer_m - pose.lower_ball_m;
    let along = rod.dot(&(inner - lower - across.cross(&arm))) / rod.dot(&kingpin.cross(&arm));
    let rotation = across + kingpin * along;
    Twist {
        wheel_centre: lower + rotation.cross(&(pose.wheel_centre_m - pose.lower_ball_m)),
        rotation,
    }
}
