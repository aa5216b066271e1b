//! The brush tyre of vehicle files, cut into what depends on the surface, on the slip and on the
//! load, in straight lines without branches: the chassis models ask it often, and batches of runs
//! become vector code.

use super::{Law, Stiffness, Tyre};
use crate::Scalar;

/// A brush tyre whose stiffnesses do not depend on the load, or grow with its power of 3/4: both
/// need square roots only. Which of the two is the constant `GROWS` of the functions.
///
/// With q = F_z/F_z0, C = C_0 q^n and the slip s = (C_kappa/C_alpha kappa, -tan alpha) the law of
/// [`Law::Brush`] is F = C s f with f = 1 - h + h^2/3 and h = C |s|/(mu F_z), F = mu F_z s/|s| from
/// h = 3 on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Brush {
    /// C_0, N/rad.
    cornering_n_rad: f64,
    /// C_kappa/C_alpha.
    slip_over_cornering: f64,
    /// mu F_z0, N.
    grip_n: f64,
    /// 1/F_z0, 1/N; 1 for stiffnesses that do not grow.
    inverse_load_1_n: f64,
}

/// A brush tyre on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnSurface<T> {
    /// C_0 times the stiffness factor.
    pub stiffness: T,
    /// C_0/(3 mu F_z0): with the factors.
    pub slope: T,
    /// mu F_z0/C_0, with the factors.
    pub slide: T,
}

/// A brush tyre's slip.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slipping<T> {
    /// s along the wheel: C_kappa/C_alpha kappa.
    pub along: T,
    /// s to the left: -tan alpha.
    pub across: T,
    /// |s| C_0/(3 mu F_z0): h/3 at the reference load.
    part: T,
    /// mu F_z0/(C_0 |s|): 1/h at the reference load.
    sliding: T,
}

/// Slip below which |s| is held, squared: there f is 1 to the last bit.
const LEAST_SQUARE: f64 = 1e-60;

/// Least F_z/F_z0 that the powers see.
const LEAST_LOAD: f64 = 1e-12;

impl Brush {
    /// The tyre in this form and whether its stiffness grows, if it can be brought to it: no
    /// camber thrust, no aligning moment, one law of load for both stiffnesses.
    #[allow(clippy::float_cmp, reason = "exponents as files give them")]
    pub(crate) fn of(tyre: &Tyre) -> Option<(Self, bool)> {
        let Tyre::Physical(physical) = tyre else {
            return None;
        };
        if physical.law != Law::Brush
            || physical.camber_stiffness_n_rad != 0.0
            || physical.contact_length_m != 0.0
        {
            return None;
        }
        let (cornering, slip, reference_load_n, grows) = match (physical.cornering, physical.slip) {
            (Stiffness::Constant(cornering), Stiffness::Constant(slip)) => {
                (cornering, slip, 1.0, false)
            }
            (
                Stiffness::Power {
                    at_reference: cornering,
                    reference_load_n: load,
                    exponent,
                },
                Stiffness::Power {
                    at_reference: slip,
                    reference_load_n: other_load,
                    exponent: other,
                },
            ) if exponent == 0.75 && other == 0.75 && load == other_load => {
                (cornering, slip, load, true)
            }
            _ => return None,
        };
        let brush = Self {
            cornering_n_rad: cornering,
            slip_over_cornering: slip / cornering,
            grip_n: physical.friction * reference_load_n,
            inverse_load_1_n: reference_load_n.recip(),
        };
        (cornering > 0.0 && slip > 0.0).then_some((brush, grows))
    }

    /// On a surface with factors on friction and stiffness.
    #[inline(always)]
    pub(crate) fn on_surface<T: Scalar>(&self, friction: T, stiffness: T) -> OnSurface<T> {
        let stiffness = stiffness * self.cornering_n_rad;
        let grip = friction * self.grip_n;
        OnSurface {
            stiffness,
            slope: stiffness / (grip * 3.0),
            slide: grip / stiffness,
        }
    }

    /// With a slip.
    #[inline(always)]
    pub(crate) fn slipping<T: Scalar>(
        &self,
        surface: &OnSurface<T>,
        slip_tangent: T,
        slip_ratio: T,
    ) -> Slipping<T> {
        let along = slip_ratio * self.slip_over_cornering;
        let square = (along * along + slip_tangent * slip_tangent).at_least(LEAST_SQUARE);
        let amount = square.sqrt();
        Slipping {
            along,
            across: -slip_tangent,
            part: amount * surface.slope,
            sliding: surface.slide / amount,
        }
    }

    /// Force for each unit of slip s under a load, N, as stiffness C and factor f; C is zero where
    /// the tyre is airborne.
    #[inline(always)]
    pub(crate) fn pull<T: Scalar, const GROWS: bool>(
        &self,
        surface: &OnSurface<T>,
        slipping: &Slipping<T>,
        load_n: T,
    ) -> [T; 2] {
        let share = (load_n * self.inverse_load_1_n).at_least(LEAST_LOAD);
        // q^n and q^(1-n). The division waits for no root.
        let inverse = share.recip();
        let (grown, rest) = if GROWS {
            let root = share.sqrt();
            let fourth = root.sqrt();
            (root * fourth, fourth)
        } else {
            (T::from(1.0), share)
        };
        // h/3 and 1/h.
        let part = grown * (slipping.part * inverse);
        let sliding = rest * slipping.sliding;
        let factor = if part < 1.0 {
            part * part * (1.0 / 3.0) + (-part + 1.0)
        } else {
            sliding
        };
        let stiffness = grown * surface.stiffness;
        let stiffness = if load_n > 0.0 {
            stiffness
        } else {
            T::from(0.0)
        };
        [stiffness, factor]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tyre::{Contact, Physical};

    #[test]
    fn it_is_the_brush_law_at_every_load_slip_and_surface() {
        for grows in [false, true] {
            let stiffness = |at_reference| {
                if grows {
                    Stiffness::Power {
                        at_reference,
                        reference_load_n: 1600.0,
                        exponent: 0.75,
                    }
                } else {
                    Stiffness::Constant(at_reference)
                }
            };
            let tyre = Tyre::Physical(Physical {
                law: Law::Brush,
                cornering: stiffness(7000.0),
                slip: stiffness(22_000.0),
                friction: 0.9,
                sliding_friction: 0.9,
                camber_stiffness_n_rad: 0.0,
                contact_length_m: 0.0,
            });
            let (brush, grown) = Brush::of(&tyre).unwrap();
            assert_eq!(grown, grows);
            for load_n in [-10.0, 0.0, 1e-3, 300.0, 1600.0, 6000.0] {
                for slip_tangent in [-3.0, -0.1, 0.0, 1e-9, 0.02, 0.4] {
                    for slip_ratio in [-1.0, -0.01, 0.0, 0.3] {
                        for (friction_scale, stiffness_scale) in
                            [(1.0, 1.0), (0.3, 0.7), (0.0, 1.0)]
                        {
                            let contact = Contact {
                                load_n,
                                slip_tangent,
                                slip_ratio,
                                camber_rad: 0.0,
                                friction_scale,
                                stiffness_scale,
                            };
                            let law = tyre.forces(&contact);
                            let surface = brush.on_surface(friction_scale, stiffness_scale);
                            let slipping = brush.slipping(&surface, slip_tangent, slip_ratio);
                            let [c, f] = if grows {
                                brush.pull::<_, true>(&surface, &slipping, load_n)
                            } else {
                                brush.pull::<_, false>(&surface, &slipping, load_n)
                            };
                            let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (1.0 + b.abs());
                            assert!(
                                near(c * f * slipping.along, law.longitudinal_n)
                                    && near(c * f * slipping.across, law.lateral_n),
                                "{contact:?} {law:?} {c} {f}"
                            );
                        }
                    }
                }
            }
        }
    }
}
