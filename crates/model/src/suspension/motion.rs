//! How the unsprung parts of a corner move: what their inertia and weight add to the statics.

use nalgebra::{Vector3, Vector6};

use super::{Coordinates, Corner, CornerPath, CornerPose, PointPath};
use crate::vehicle::Unsprung;

/// Motion of the sprung body, vehicle axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyMotion {
    /// Specific force at `reference_m` (what an accelerometer reads there), m/s^2.
    pub specific_force_m_s2: Vector3<f64>,
    /// Where that holds, vehicle axes, m: (0, 0, h) for the centre of gravity.
    pub reference_m: Vector3<f64>,
    /// Angular rate w, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Angular acceleration w', rad/s^2.
    pub rate_dot_rad_s2: Vector3<f64>,
}

impl BodyMotion {
    /// Specific force at another point of the body: f + w' x r + w x (w x r).
    #[must_use]
    pub fn specific_force_at(&self, point_m: Vector3<f64>) -> Vector3<f64> {
        let r = point_m - self.reference_m;
        self.specific_force_m_s2
            + self.rate_dot_rad_s2.cross(&r)
            + self.rate_rad_s.cross(&self.rate_rad_s.cross(&r))
    }
}

/// Motion of one corner's unsprung parts, vehicle axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CornerMotion {
    /// Specific force at the wheel centre, m/s^2.
    pub wheel_specific_force_m_s2: Vector3<f64>,
    /// Specific force at the upright's centre of gravity, m/s^2.
    pub upright_specific_force_m_s2: Vector3<f64>,
    /// Specific force at the upper arm's centre of gravity, m/s^2.
    pub upper_arm_specific_force_m_s2: Vector3<f64>,
    /// Specific force at the lower arm's centre of gravity, m/s^2.
    pub lower_arm_specific_force_m_s2: Vector3<f64>,
    /// Velocity of the wheel centre against the body, m/s.
    pub wheel_travel_m_s: Vector3<f64>,
    /// Angular rate of the upright, rad/s.
    pub upright_rate_rad_s: Vector3<f64>,
    /// Angular acceleration of the upright, rad/s^2.
    pub upright_rate_dot_rad_s2: Vector3<f64>,
    /// Spin of the wheel about the spindle against the upright, forward rolling positive, rad/s.
    pub spin_rad_s: f64,
    /// Its rate of change, rad/s^2.
    pub spin_dot_rad_s2: f64,
    /// Torque that a half-shaft exerts on the wheel, reacted by the chassis; forward driving
    /// positive, N m. Torque between wheel and upright (an outboard brake) is internal to the
    /// corner and does not appear.
    pub axle_torque_n_m: f64,
}

impl CornerMotion {
    /// Outboard parts that do not move against the body.
    #[must_use]
    pub fn fixed_to(body: &BodyMotion, pose: &CornerPose) -> Self {
        Self {
            wheel_specific_force_m_s2: body.specific_force_at(pose.wheel_centre_m),
            upright_specific_force_m_s2: body.specific_force_at(pose.upright_cg_m),
            upper_arm_specific_force_m_s2: body.specific_force_at(pose.upper_arm_cg_m),
            lower_arm_specific_force_m_s2: body.specific_force_at(pose.lower_arm_cg_m),
            upright_rate_rad_s: body.rate_rad_s,
            upright_rate_dot_rad_s2: body.rate_dot_rad_s2,
            ..Self::default()
        }
    }

    /// Force, N, and moment about a point, N m, that accelerate the outboard parts beyond `other`
    /// motion of them: sum m (f - f_o), sum r x m (f - f_o) + I (w' - w_o'). Vehicle axes.
    #[must_use]
    pub fn wrench_beyond(
        &self,
        other: &Self,
        pose: &CornerPose,
        unsprung: &Unsprung,
        about_m: Vector3<f64>,
    ) -> Vector6<f64> {
        let parts = [
            (
                unsprung.wheel_mass_kg,
                pose.wheel_centre_m,
                self.wheel_specific_force_m_s2 - other.wheel_specific_force_m_s2,
            ),
            (
                unsprung.upright_mass_kg,
                pose.upright_cg_m,
                self.upright_specific_force_m_s2 - other.upright_specific_force_m_s2,
            ),
            (
                unsprung.upper_arm_mass_kg,
                pose.upper_arm_cg_m,
                self.upper_arm_specific_force_m_s2 - other.upper_arm_specific_force_m_s2,
            ),
            (
                unsprung.lower_arm_mass_kg,
                pose.lower_arm_cg_m,
                self.lower_arm_specific_force_m_s2 - other.lower_arm_specific_force_m_s2,
            ),
        ];
        let turning = self.upright_rate_dot_rad_s2 - other.upright_rate_dot_rad_s2;
        let spindle = pose.spindle;
        let diametral = unsprung.wheel_diametral_inertia_kg_m2;
        let polar = unsprung.wheel_spin_inertia_kg_m2 - diametral;
        let mut force = Vector3::zeros();
        let mut moment = turning * diametral + spindle * (spindle.dot(&turning) * polar);
        for (mass, at, beyond) in parts {
            force += beyond * mass;
            moment += (at - about_m).cross(&(beyond * mass));
        }
        Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
    }

    /// A corner that hangs or stands still: every part has the specific force `f`.
    #[must_use]
    pub fn at_rest(specific_force_m_s2: Vector3<f64>) -> Self {
        Self {
            wheel_specific_force_m_s2: specific_force_m_s2,
            upright_specific_force_m_s2: specific_force_m_s2,
            upper_arm_specific_force_m_s2: specific_force_m_s2,
            lower_arm_specific_force_m_s2: specific_force_m_s2,
            ..Self::default()
        }
    }

    /// A corner whose strut lengthens at `strut_rate_m_s` and whose rack moves at `rack[0]`, m/s, and
    /// gathers `rack[1]`, m/s^2, on a moving body. Of the relative acceleration the Coriolis part and
    /// the rack's are in, what comes from l'' is not: on flat ground [`CornerMotion::on_ground`]
    /// replaces it, on rough ground [`CornerMotion::on_path`] has it.
    #[must_use]
    pub fn on_body(
        corner: &Corner,
        pose: &CornerPose,
        body: &BodyMotion,
        strut_rate_m_s: f64,
        rack: [f64; 2],
    ) -> Self {
        let [rack_rate, rack_rate_dot] = rack;
        let rates = corner.rates(pose);
        let to_upright = pose.upright_cg_m - pose.wheel_centre_m;
        let rotation = rates.strut.rotation * strut_rate_m_s + rates.rack.rotation * rack_rate;
        let hub = rates.strut.wheel_centre * strut_rate_m_s + rates.rack.wheel_centre * rack_rate;
        let upright = hub + rotation.cross(&to_upright);
        let rotation_dot = rates.rack.rotation * rack_rate_dot;
        let hub_dot = rates.rack.wheel_centre * rack_rate_dot;
        let upright_dot = hub_dot + rotation_dot.cross(&to_upright);
        let moving = |point: Vector3<f64>, velocity: Vector3<f64>| {
            body.specific_force_at(point) + body.rate_rad_s.cross(&velocity) * 2.0
        };
        let swing = |hinge: Vector3<f64>, axis: Vector3<f64>, per_strut: f64, point| {
            axis.cross(&(point - hinge)) * (per_strut * strut_rate_m_s)
        };
        let p = &corner.points;
        let mut upper = swing(
            p.upper_rear,
            corner.upper_axis,
            rates.upper_angle_per_strut,
            pose.upper_arm_cg_m,
        );
        let mut lower = swing(
            p.lower_rear,
            corner.lower_axis,
            rates.lower_angle_per_strut,
            pose.lower_arm_cg_m,
        );
        if corner.links().is_some() {
            [upper, lower] = [pose.upper_ball_m, pose.lower_ball_m]
                .map(|ball| rates.strut.at(pose, ball) * (0.5 * strut_rate_m_s));
        }
        Self {
            wheel_specific_force_m_s2: moving(pose.wheel_centre_m, hub) + hub_dot,
            upright_specific_force_m_s2: moving(pose.upright_cg_m, upright) + upright_dot,
            upper_arm_specific_force_m_s2: moving(pose.upper_arm_cg_m, upper),
            lower_arm_specific_force_m_s2: moving(pose.lower_arm_cg_m, lower),
            wheel_travel_m_s: hub,
            upright_rate_rad_s: body.rate_rad_s + rotation,
            upright_rate_dot_rad_s2: body.rate_dot_rad_s2
                + body.rate_rad_s.cross(&rotation)
                + rotation_dot,
            ..Self::default()
        }
    }

    /// A corner whose strut and rack move at `rate` and gather `acceleration` on a moving body, all
    /// of it told: the unsprung parts accelerate along the wheel's path, on any ground and in the
    /// air.
    #[must_use]
    pub fn on_path(
        corner: &Corner,
        pose: &CornerPose,
        body: &BodyMotion,
        rate: Coordinates,
        acceleration: Coordinates,
    ) -> Self {
        Self::on_known_path(&corner.path(pose), pose, body, rate, acceleration)
    }

    /// The same with the derivatives of the pose at hand.
    #[must_use]
    pub fn on_known_path(
        path: &CornerPath,
        pose: &CornerPose,
        body: &BodyMotion,
        rate: Coordinates,
        acceleration: Coordinates,
    ) -> Self {
        let force = |point: &PointPath| point.specific_force_m_s2(body, rate, acceleration);
        Self {
            wheel_specific_force_m_s2: force(&path.wheel),
            upright_specific_force_m_s2: force(&path.wheel.at(pose.upright_cg_m)),
            upper_arm_specific_force_m_s2: force(&path.upper_arm),
            lower_arm_specific_force_m_s2: force(&path.lower_arm),
            wheel_travel_m_s: path.wheel.travel.rate(rate),
            upright_rate_rad_s: body.rate_rad_s + path.wheel.rotation.rate(rate),
            upright_rate_dot_rad_s2: path.wheel.rate_dot_rad_s2(body, rate, acceleration),
            ..Self::default()
        }
    }

    /// The same corner with its wheel on flat ground: along the ground's normal the wheel has no
    /// acceleration, whatever the body's roll and pitch do, so that its specific force there is
    /// gravity's. The arms take the part of that correction which their centre of gravity's
    /// distance from the hinge gives them.
    #[must_use]
    pub fn on_ground(
        mut self,
        corner: &Corner,
        pose: &CornerPose,
        normal: Vector3<f64>,
        gravity_along_normal_m_s2: f64,
    ) -> Self {
        let correction =
            normal * (gravity_along_normal_m_s2 - self.wheel_specific_force_m_s2.dot(&normal));
        let p = &corner.points;
        let is_links = corner.links().is_some();
        let share = |hinge: Vector3<f64>, axis: Vector3<f64>, cg: Vector3<f64>, ball| {
            let distance = |point: Vector3<f64>| axis.cross(&(point - hinge)).norm();
            let of_ball = distance(ball);
            if is_links {
                0.5
            } else if of_ball > 0.0 {
                distance(cg) / of_ball
            } else {
                0.0
            }
        };
        let upper = share(
            p.upper_rear,
            corner.upper_axis,
            pose.upper_arm_cg_m,
            pose.upper_ball_m,
        );
        let lower = share(
            p.lower_rear,
            corner.lower_axis,
            pose.lower_arm_cg_m,
            pose.lower_ball_m,
        );
        self.wheel_specific_force_m_s2 += correction;
        self.upright_specific_force_m_s2 += correction;
        self.upper_arm_specific_force_m_s2 += correction * upper;
        self.lower_arm_specific_force_m_s2 += correction * lower;
        self
    }
}
