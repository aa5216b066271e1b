//! Tyres: from load and slip to force, behind one interface ([`Tyre::forces`]).
//!
//! All in the wheel's contact frame (ISO 8855): a positive slip angle gives a negative lateral
//! force, which is the minus sign that equation 2.28 of the thesis lacks. The slip angle enters as
//! its tangent, since that is what the contact patch sees and what [relaxation](relaxed_rate)
//! integrates; it stays finite at rest.

mod brush;
mod curve;
pub mod magic;
mod physical;
mod property;
mod rational;
mod spring;
mod stiffness;
mod tir;
mod tread;

pub(crate) use brush::{Brush, OnSurface, Slipping};
pub use curve::{brush_over_grip, brush_over_linear};
pub use magic::{MagicFormula52, MagicFormula61, MagicFormula89};
pub use physical::{Law, Physical};
pub use property::PropertyTyre;
pub use rational::{Curve, Offset, Rational};
pub use spring::{RadialSpringTyre, SpringForce};
pub use stiffness::Stiffness;
pub(crate) use tir::Entry;
pub use tir::Tir;
pub(crate) use tread::tread_moment;

use crate::values::Values;
use crate::{Scalar, vehicle};

/// State of one contact patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<T> {
    /// Normal load F_z, N; at or below zero the tyre is airborne and every force is zero.
    pub load_n: T,
    /// Tangent of the slip angle, tan(alpha) = v_y/|v_x| in the wheel's frame.
    pub slip_tangent: T,
    /// Longitudinal slip kappa = (omega R - v_x)/|v_x|; -1 is a locked wheel.
    pub slip_ratio: T,
    /// Camber angle gamma, rad; positive when the wheel's top leans right (about x by the
    /// right-hand rule), which gives a negative lateral force.
    pub camber_rad: T,
    /// Factor on the friction coefficient: 1 on the surface that the tyre's file means.
    pub friction_scale: T,
    /// Factor on all slip stiffnesses.
    pub stiffness_scale: T,
}

impl<T: Scalar> Contact<T> {
    /// A free-rolling, upright tyre at a slip angle.
    pub fn lateral(load_n: T, slip_angle_rad: T) -> Self {
        Self::combined(load_n, slip_angle_rad, T::from(0.0))
    }

    /// An upright tyre at a slip angle and a longitudinal slip.
    pub fn combined(load_n: T, slip_angle_rad: T, slip_ratio: T) -> Self {
        Self {
            load_n,
            slip_tangent: slip_angle_rad.tangent(),
            slip_ratio,
            camber_rad: T::from(0.0),
            friction_scale: T::from(1.0),
            stiffness_scale: T::from(1.0),
        }
    }
}

/// What the ground exerts on a tyre, in the wheel's contact frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forces<T> {
    /// Longitudinal force F_x, N.
    pub longitudinal_n: T,
    /// Lateral force F_y, N.
    pub lateral_n: T,
    /// Aligning moment M_z, N m, about the contact point.
    pub aligning_n_m: T,
}

impl<T: Scalar> Forces<T> {
    /// No force: an airborne tyre.
    #[must_use]
    pub fn zero() -> Self {
        let zero = T::from(0.0);
        Self {
            longitudinal_n: zero,
            lateral_n: zero,
            aligning_n_m: zero,
        }
    }
}

/// A tyre of any kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Tyre {
    /// Stiffnesses and friction: linear, Fiala, brush, exponential, Dugoff.
    Physical(Physical),
    /// Magic Formula of 1987/89.
    MagicFormula89(Box<MagicFormula89>),
    /// Magic Formula 5.2.
    MagicFormula52(Box<MagicFormula52>),
    /// Rational parametric curves.
    Rational(Box<Rational>),
    /// Magic Formula of a tyre property file.
    Property(Box<PropertyTyre>),
}

impl Tyre {
    /// The tyre of a vehicle file: that of its property file, or a brush tyre (Fiala in pure slip) with
    /// the file's stiffnesses, load exponent and friction.
    #[must_use]
    pub fn from_vehicle(tyre: &vehicle::Tyre) -> Self {
        if let Some(tir) = &tyre.tir {
            return Self::Property(Box::new(PropertyTyre::from_vehicle(tir, tyre)));
        }
        Self::Physical(Physical::from_vehicle(tyre, Law::Brush))
    }

    /// Force and aligning moment on a wheel of the left or the right side: a tyre that was measured on
    /// the other side is mirrored.
    #[inline]
    pub fn forces_on<T: Scalar>(&self, left: bool, contact: &Contact<T>) -> Forces<T> {
        match self {
            Self::Property(tyre) if contact.load_n > 0.0 => tyre.forces(left, contact),
            _ => self.forces(contact),
        }
    }

    /// Overturning moment M_x about the contact point and size of the rolling resistance moment
    /// (positive against the spin), N m, at a longitudinal and a lateral force and a speed, m/s. `None`
    /// for each moment that the tyre itself does not give: the vehicle file's tread width and rolling
    /// resistance coefficient give these.
    #[inline]
    pub fn moments_on<T: Scalar>(
        &self,
        left: bool,
        contact: &Contact<T>,
        forces: &Forces<T>,
        speed_m_s: T,
    ) -> [Option<T>; 2] {
        match self {
            Self::Property(tyre) if contact.load_n > 0.0 => [
                tyre.has_overturning()
                    .then(|| tyre.overturning_n_m(left, contact, forces.lateral_n)),
                tyre.has_resistance()
                    .then(|| tyre.resistance_n_m(contact, forces.longitudinal_n, speed_m_s)),
            ],
            _ => [None, None],
        }
    }

    /// Force and aligning moment on a wheel of the side on which the tyre was measured.
    #[inline]
    pub fn forces<T: Scalar>(&self, contact: &Contact<T>) -> Forces<T> {
        if contact.load_n <= 0.0 {
            return Forces::zero();
        }
        match self {
            Self::Physical(physical) => physical.forces(contact),
            Self::MagicFormula89(formula) => formula.forces(contact),
            Self::MagicFormula52(formula) => formula.forces(contact),
            Self::Rational(rational) => rational.forces(contact),
            Self::Property(tyre) => tyre.forces(tyre.is_of_left(), contact),
        }
    }
}

/// Scales a force that lies outside of the friction ellipse back onto it, keeping its direction.
///
/// The ellipse is (F_x/(mu_x F_z))^2 + (F_y/(mu_y F_z))^2 = 1 (figure 2.17 of the thesis, with
/// equal semi-axes).
#[inline]
pub fn friction_ellipse<T: Scalar>(longitudinal_n: T, lateral_n: T, most_n: [T; 2]) -> [T; 2] {
    let (x, y) = (longitudinal_n / most_n[0], lateral_n / most_n[1]);
    let square = x * x + y * y;
    if square > 1.0 {
        let shrink = square.sqrt().recip();
        [longitudinal_n * shrink, lateral_n * shrink]
    } else {
        [longitudinal_n, lateral_n]
    }
}

/// Rate of a relaxed slip s: sigma s' + |v_x| s = v_slip, with s the tangent of the slip angle and
/// v_slip = v_y, or s the longitudinal slip and v_slip = omega R - v_x. Well posed at rest, where
/// the slip angle itself is not (thesis, figure 2.3).
#[inline]
pub fn relaxed_rate<T: Scalar>(slip: T, slip_speed: T, rolling_speed: T, length_m: f64) -> T {
    (slip_speed - rolling_speed.magnitude() * slip) / length_m
}

/// Slip s = v_slip/|v_x| without relaxation. Below `low_m_s` the denominator blends smoothly to
/// half that speed, so that the slip stays finite at rest.
#[inline(always)]
pub fn steady_slip<V: Values>(slip_speed: V, rolling_speed: V, low_m_s: f64) -> V {
    slip_speed / slip_base(rolling_speed, low_m_s)
}

/// What a slip speed is divided by: see [`steady_slip`].
#[inline(always)]
pub(crate) fn slip_base<V: Values>(rolling_speed: V, low_m_s: f64) -> V {
    let speed = rolling_speed.absolute();
    let blended = (speed * speed).scaled(0.5 / low_m_s).plus(0.5 * low_m_s);
    speed.if_less(V::constant(low_m_s), blended, speed)
}

/// Rolling resistance moment M_y = -c F_z R sgn(omega), N m, fading smoothly around standstill.
#[inline]
pub fn rolling_resistance_n_m<T: Scalar>(
    coefficient: f64,
    load_n: T,
    radius_m: f64,
    wheel_speed_rad_s: T,
) -> T {
    -load_n * (coefficient * radius_m) * saturated(wheel_speed_rad_s)
}

/// Spin from which brake and rolling resistance act in full, rad/s.
const STICTION_RAD_S: f64 = 0.3;

/// Sign of a wheel's spin, smooth around standstill: (15 x - 10 x^3 + 3 x^5)/8 with
/// x = omega/0.3 rad/s held within +-1, twice continuously differentiable.
#[inline(always)]
pub fn saturated<V: Values>(wheel_speed_rad_s: V) -> V {
    let part = wheel_speed_rad_s
        .scaled(1.0 / STICTION_RAD_S)
        .not_below(-1.0)
        .not_above(1.0);
    let square = part * part;
    part * (square * square.scaled(0.375).plus(-1.25)).plus(1.875)
}

#[cfg(test)]
mod tests;
