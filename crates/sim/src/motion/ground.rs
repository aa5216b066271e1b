//! What is true of a wheel on its ground.

use sample::{ForceFrame, WheelAxes};

/// A wheel on its ground. Vectors are resolved in chassis axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelGround {
    /// Normal of the ground at the contact, a unit vector. In the air: that of the ground below.
    pub normal_body: [f64; 3],
    /// Force of the ground on the tyre, N.
    pub force_body_n: [f64; 3],
    /// Moment of the ground on the tyre about the wheel centre, N m.
    pub moment_body_n_m: Option<[f64; 3]>,
    /// Spindle axis, a unit vector to the left on both sides of the vehicle.
    pub spindle_body: [f64; 3],
    /// Acceleration of the wheel centre against the earth, without gravity, m/s^2.
    pub centre_acceleration_m_s2: Option<[f64; 3]>,
    /// Mass times acceleration of everything outboard of the arms and the tie rod, N.
    pub unsprung_inertia_n: Option<[f64; 3]>,
    /// Height of the ground below the wheel centre, m.
    pub ground_height_m: Option<f64>,
}

impl WheelGround {
    /// Axes of a frame at this wheel.
    #[must_use]
    pub fn axes(&self, frame: ForceFrame) -> WheelAxes {
        WheelAxes::of(frame, self.spindle_body, self.normal_body)
    }

    /// Force of the ground on the tyre in a frame, N.
    #[must_use]
    pub fn force_n(&self, frame: ForceFrame) -> [f64; 3] {
        self.axes(frame).resolve(self.force_body_n)
    }

    /// Moment of the ground on the tyre about the wheel centre in a frame, N m.
    #[must_use]
    pub fn moment_n_m(&self, frame: ForceFrame) -> Option<[f64; 3]> {
        Some(self.axes(frame).resolve(self.moment_body_n_m?))
    }

    /// The state between `a` (weight 0) and `b` (weight 1).
    pub(super) fn between(a: &Self, b: &Self, weight: f64) -> Self {
        let mix = |a: [f64; 3], b: [f64; 3]| super::mix(&a, &b, weight);
        let both = |a: Option<[f64; 3]>, b: Option<[f64; 3]>| Some(mix(a?, b?));
        let heights = a.ground_height_m.zip(b.ground_height_m);
        Self {
            normal_body: unit(mix(a.normal_body, b.normal_body)),
            force_body_n: mix(a.force_body_n, b.force_body_n),
            moment_body_n_m: both(a.moment_body_n_m, b.moment_body_n_m),
            spindle_body: unit(mix(a.spindle_body, b.spindle_body)),
            centre_acceleration_m_s2: both(a.centre_acceleration_m_s2, b.centre_acceleration_m_s2),
            unsprung_inertia_n: both(a.unsprung_inertia_n, b.unsprung_inertia_n),
            ground_height_m: heights.map(|(a, b)| a + (b - a) * weight),
        }
    }
}

/// Spindle axis from its azimuth and its lean to the ground.
///
/// The azimuth d is the steer angle in the chassis, left positive. The camber c is the elevation
/// above the tangent plane of the ground. With the elevation e above the chassis' x-y plane
/// s = (-sin d cos e, cos d cos e, sin e), and s·n = sin c gives
/// e = asin(sin c / hypot(a, n_z)) - atan2(a, n_z) with a = n_y cos d - n_x sin d.
pub(crate) fn spindle_on_ground(steer_rad: f64, camber_rad: f64, normal: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = math::sin_cos(steer_rad);
    let across = normal[1] * cos - normal[0] * sin;
    let lean = math::sin(camber_rad) / math::hypot(across, normal[2]);
    spindle(
        steer_rad,
        math::asin(lean.clamp(-1.0, 1.0)) - math::atan2(across, normal[2]),
    )
}

/// Spindle axis from its azimuth and its elevation above the chassis' x-y plane.
pub(crate) fn spindle(steer_rad: f64, elevation_rad: f64) -> [f64; 3] {
    let (sin, cos) = math::sin_cos(steer_rad);
    let (up, level) = math::sin_cos(elevation_rad);
    [-sin * level, cos * level, up]
}

/// `v` as a unit vector.
pub(crate) fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|part| part * part).sum::<f64>().sqrt();
    v.map(|part| part / length)
}
