use nalgebra::{Matrix2, Vector2};
use sample::Wheel;

use crate::suspension::Corner;
use crate::tyre::Tyre;
use crate::vehicle::{Axle, Sprung, Strut, Vehicle};
use crate::{Error, Scalar};

/// Strut lengths between the stops through which the motion ratio's curve is laid.
const SLOPE_POINTS: u32 = 20;

/// Spring, damper and stops of one corner.
#[derive(Clone, Debug, PartialEq)]
pub struct StrutParameters {
    /// The strut.
    pub strut: Strut,
    /// Strut travel for one metre of jounce s in the design position, r_0.
    pub motion_ratio: f64,
    /// How the motion ratio changes with jounce, r = r_0 + r_1 s + r_2 s^2: r_1 in 1/m, r_2 in
    /// 1/m^2. Zero where the vehicle has no hard-points to tell.
    pub motion_ratio_slope: [f64; 2],
}

impl StrutParameters {
    /// Strut travel for one metre of jounce, at a jounce.
    #[inline(always)]
    pub fn motion_ratio_at<T: Scalar>(&self, jounce_m: T) -> T {
        let [one, two] = self.motion_ratio_slope;
        (jounce_m * two + one) * jounce_m + self.motion_ratio
    }

    /// Length of the strut at a jounce, m: the integral of the motion ratio, so that force and
    /// travel do the same work at both ends.
    #[inline(always)]
    pub fn length_m<T: Scalar>(&self, jounce_m: T) -> T {
        let [one, two] = self.motion_ratio_slope;
        let mean = (jounce_m * (two / 3.0) + one / 2.0) * jounce_m + self.motion_ratio;
        -jounce_m * mean + self.strut.design_length_m
    }

    /// Force along the strut, N, pushing its ends apart: coil, damper and stops that push only,
    /// as [`Strut::force`](crate::vehicle::Strut::force).
    #[inline(always)]
    pub fn force_n<T: Scalar>(&self, length_m: T, rate_m_s: T) -> T {
        let strut = &self.strut;
        let smooth = -(length_m - strut.free_length_m) * strut.stiffness_n_m
            - rate_m_s * strut.damping_n_s_m;
        let (stiffness, damping) = (strut.stop_stiffness_n_m, strut.stop_damping_n_s_m);
        let push = |past: T, rate: T| {
            let force = (past * stiffness + rate * damping).at_least(0.0);
            if past > 0.0 { force } else { T::from(0.0) }
        };
        let droop = push(length_m - strut.droop_stop_length_m, rate_m_s);
        let bump = push(-length_m + strut.bump_stop_length_m, -rate_m_s);
        smooth - droop + bump
    }
}

/// One corner.
#[derive(Clone, Debug, PartialEq)]
pub struct CornerParameters {
    /// Wheel centre in the design position from the sprung part's centre of gravity, m.
    pub wheel_centre_m: [f64; 3],
    /// Path e of the contact point per metre of jounce, e_z = 1.
    pub path: [f64; 3],
    /// From the point of the ground about which steering moves the contact point to that point,
    /// design position, along the vehicle's x and y axes, m. It turns with the wheel.
    pub steer_arm_m: [f64; 2],
    /// How the wheel leans beside the body's lean, left end of its spindle up: rad per metre of
    /// jounce, and rad per radian of steer.
    pub inclination: [f64; 2],
    /// Unsprung mass, kg.
    pub mass_kg: f64,
    /// Spin inertia of the wheel, kg m^2.
    pub spin_inertia_kg_m2: f64,
    /// Strut.
    pub strut: StrutParameters,
    /// Force at this wheel per metre of jounce more than the other wheel's, from the anti-roll
    /// bar, N/m.
    pub bar_n_m: f64,
    /// Tyre.
    pub tyre: Tyre,
    /// Unloaded radius, m.
    pub unloaded_radius_m: f64,
    /// Radius that carries spin to the ground, m.
    pub rolling_radius_m: f64,
    /// Vertical stiffness of the tyre, N/m.
    pub vertical_stiffness_n_m: f64,
    /// Vertical damping of the tyre, N s/m.
    pub vertical_damping_n_s_m: f64,
    /// Width of the tread, m, whose overturning moment the tyre has; zero for none.
    pub tread_width_m: f64,
    /// Relaxation length, m; zero for none.
    pub relaxation_length_m: f64,
    /// Rolling resistance coefficient.
    pub rolling_resistance: f64,
}

/// Parameters of the 14-degree-of-freedom model.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Sprung mass, kg.
    pub sprung_mass_kg: f64,
    /// Moments of inertia of the sprung part about its centre of gravity, with the wheels'
    /// diametral inertia, kg m^2.
    pub inertia_kg_m2: [f64; 3],
    /// Product of inertia I_xz of the sprung part, kg m^2.
    pub inertia_xz_kg_m2: f64,
    /// Height of the sprung part's centre of gravity in the design position, m.
    pub design_height_m: f64,
    /// Drag, N s^2/m^2.
    pub drag_n_s2_m2: f64,
    /// Gravity, m/s^2.
    pub gravity_m_s2: f64,
    /// Speed below which slip without relaxation is blended, m/s.
    pub low_speed_m_s: f64,
    /// The corners.
    pub corners: [CornerParameters; 4],
}

impl Parameters {
    /// The parameters of a vehicle. Wheel paths and motion ratios come from hard-points where
    /// there are any, otherwise from the roll-centre heights and the file's motion ratio.
    ///
    /// # Errors
    /// Where the file has no unsprung masses or struts, which a lifting wheel cannot do without.
    pub fn from_vehicle(vehicle: &Vehicle) -> Result<Self, Error> {
        let sprung = vehicle.sprung();
        let body = &vehicle.body;
        let mut inertia = sprung.inertia_kg_m2;
        for axle in [&vehicle.front, &vehicle.rear] {
            if let Some(unsprung) = &axle.unsprung {
                inertia[0] += 2.0 * unsprung.wheel_diametral_inertia_kg_m2;
                inertia[2] += 2.0 * unsprung.wheel_diametral_inertia_kg_m2;
            }
        }
        let corner = |wheel: Wheel| {
            let (axle, name, x) = if wheel.is_front() {
                (
                    &vehicle.front,
                    ["front.unsprung", "front.strut"],
                    body.front_axle_to_cg_m,
                )
            } else {
                (
                    &vehicle.rear,
                    ["rear.unsprung", "rear.strut"],
                    -body.cg_to_rear_axle_m,
                )
            };
            corner(vehicle, axle, name, wheel, x, &sprung)
        };
        Ok(Self {
            sprung_mass_kg: sprung.mass_kg,
            inertia_kg_m2: inertia,
            inertia_xz_kg_m2: sprung.inertia_xz_kg_m2,
            design_height_m: sprung.cg_m[2],
            drag_n_s2_m2: body.drag_n_s2_m2,
            gravity_m_s2: sample::STANDARD_GRAVITY_M_S2,
            low_speed_m_s: 0.5,
            corners: [
                corner(Wheel::FrontLeft)?,
                corner(Wheel::FrontRight)?,
                corner(Wheel::RearLeft)?,
                corner(Wheel::RearRight)?,
            ],
        })
    }

    /// Total mass, kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        self.sprung_mass_kg
            + self
                .corners
                .iter()
                .map(|corner| corner.mass_kg)
                .sum::<f64>()
    }
}

fn corner(
    vehicle: &Vehicle,
    axle: &Axle,
    parts: [&'static str; 2],
    wheel: Wheel,
    ahead_m: f64,
    sprung: &Sprung,
) -> Result<CornerParameters, Error> {
    let missing = |part| Error::MissingPart {
        vehicle: vehicle.name.clone(),
        part,
        model: "the 14-degree-of-freedom model",
    };
    let unsprung = axle.unsprung.as_ref().ok_or_else(|| missing(parts[0]))?;
    let strut = axle.strut.as_ref().ok_or_else(|| missing(parts[1]))?;
    let tyre = &axle.tyre;
    let static_load_n = vehicle.static_load_n(wheel);
    let squeeze = static_load_n / tyre.vertical_stiffness_n_m;
    let side = wheel.side();
    let mut centre = [
        ahead_m,
        0.5 * side * axle.track_m - vehicle.body.cg_y_m,
        tyre.unloaded_radius_m - squeeze,
    ];
    let mut path = [
        0.0,
        side * 2.0 * axle.roll_centre_height_m / axle.track_m,
        1.0,
    ];
    let mut steer_arm = [0.0; 2];
    let mut inclination = [0.0; 2];
    let mut ratio = strut.motion_ratio;
    let mut slope = [0.0; 2];
    if let Ok(linkage) = Corner::of(vehicle, wheel) {
        let pose = linkage
            .pose(linkage.design_strut_length_m(), 0.0)
            .map_err(|_| missing("linkage that assembles"))?;
        let rates = linkage.rates(&pose);
        ratio = Some(rates.motion_ratio());
        slope = motion_ratio_slope(&linkage, strut, rates.motion_ratio(), pose.wheel_centre_m.z);
        centre = pose.wheel_centre_m.into();
        let mut contact = pose.wheel_centre_m;
        contact.z = 0.0;
        let travel = rates.strut.at(&pose, contact);
        path = [travel.x / travel.z, travel.y / travel.z, 1.0];
        let [travel, turn] = [rates.strut, rates.rack];
        inclination[0] = travel.rotation.cross(&pose.spindle).z / travel.wheel_centre.z;
        // The wheel of a trailing arm does not steer.
        if turn.rotation.z != 0.0 {
            inclination[1] = turn.rotation.cross(&pose.spindle).z / turn.rotation.z;
            // A wheel that leans by gamma has its contact point R gamma aside of its centre.
            let moved = turn.wheel_centre / turn.rotation.z;
            steer_arm = [moved.y + centre[2] * inclination[1], -moved.x];
        }
    }
    let motion_ratio = ratio.ok_or_else(|| missing(parts[1]))?;
    Ok(CornerParameters {
        wheel_centre_m: [
            centre[0] - sprung.cg_m[0],
            centre[1] - sprung.cg_m[1],
            centre[2] - sprung.cg_m[2],
        ],
        path,
        steer_arm_m: steer_arm,
        inclination,
        mass_kg: unsprung.total_mass_kg(),
        spin_inertia_kg_m2: unsprung.wheel_spin_inertia_kg_m2,
        strut: StrutParameters {
            strut: strut.clone(),
            motion_ratio,
            motion_ratio_slope: slope,
        },
        bar_n_m: axle.anti_roll_bar_n_m_rad / axle.track_m.powi(2),
        tyre: Tyre::from_vehicle(tyre),
        unloaded_radius_m: tyre.unloaded_radius_m,
        rolling_radius_m: tyre.rolling_radius_m(static_load_n),
        vertical_stiffness_n_m: tyre.vertical_stiffness_n_m,
        vertical_damping_n_s_m: tyre.vertical_damping_n_s_m,
        tread_width_m: tyre.width_m,
        relaxation_length_m: tyre.relaxation_length_m,
        rolling_resistance: tyre.rolling_resistance,
    })
}

/// Least squares of the strut's length over its travel, r_0 given:
/// l_0 - l - r_0 s = r_1 s^2/2 + r_2 s^3/3.
fn motion_ratio_slope(
    linkage: &Corner,
    strut: &Strut,
    ratio: f64,
    design_height_m: f64,
) -> [f64; 2] {
    let travel = strut.droop_stop_length_m - strut.bump_stop_length_m;
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for k in 0..=SLOPE_POINTS {
        let length = strut.bump_stop_length_m + travel * f64::from(k) / f64::from(SLOPE_POINTS);
        let Ok(pose) = linkage.pose(length, 0.0) else {
            continue;
        };
        let s = pose.wheel_centre_m.z - design_height_m;
        let left = linkage.design_strut_length_m() - length - ratio * s;
        let row = Vector2::new(s * s / 2.0, s * s * s / 3.0);
        normal += row * row.transpose();
        right += row * left;
    }
    normal
        .cholesky()
        .map_or([0.0; 2], |factors| factors.solve(&right).into())
}
