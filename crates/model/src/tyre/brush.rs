//! The brush tyre of vehicle files, cut into what depends on the surface, on the slip and on the
//! load, in straight lines without branches: the chassis models ask it often, and batches of runs
//! become vector code.

use super::{Law, Stiffness, Tyre};
use crate::values::Values;

/// A brush tyre whose stiffnesses do not depend on the load, or grow with its power of 3/4: both
/// need square roots only. Which of the two is the constant `GROWS` of the functions. The numbers
/// are one tyre's, or lists for four.
///
/// With C = C_1 F_z^n (C_1 is the stiffness under a load of 1 N) and the slip
/// s = (C_kappa/C_alpha kappa, -tan alpha) the law of [`Law::Brush`] is F = C s (1 - h + h^2/3) with
/// h = C |s|/(3 mu F_z), and F = mu F_z s/|s| from h = 1 on. With p = C_1 |s|/(3 mu), which no load
/// enters, h = p F_z^(n-1) and
///
/// | n | h < 1 | F/(C_1 s) there | beyond |
/// |---|---|---|---|
/// | 3/4 | p < F_z^(1/4) | F_z^(1/4) (F_z^(1/2) + p^2/3) - F_z^(1/2) p | F_z/(3 p) |
/// | 0 | p < F_z | 1 - p/F_z + (p/F_z)^2/3 | F_z/(3 p) |
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Brush<C = f64> {
    /// C_1.
    cornering: C,
    /// C_kappa/C_alpha.
    slip_over_cornering: C,
    /// mu.
    friction: C,
}

/// A brush tyre on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnSurface<T> {
    /// C_1 with the stiffness factor.
    pub stiffness: T,
    /// p/|s| = C_1/(3 mu), with the factors.
    pub slope: T,
    /// |s|/(3 p) = mu/C_1, with the factors.
    pub slide: T,
}

/// A brush tyre's slip.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slipping<T> {
    /// C_1 s along the wheel.
    pub along: T,
    /// C_1 s to the left.
    pub across: T,
    /// p and p^2/3.
    part: T,
    third: T,
    /// 1/(3 p).
    sliding: T,
}

/// Slip below which |s| is held, squared: there f is 1 to the last bit.
const LEAST_SQUARE: f64 = 1e-60;

/// Least grip and stiffness that are divided by: without either nothing pulls.
const LEAST_DIVISOR: f64 = 1e-100;

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
            cornering: if grows {
                cornering / math::powf(reference_load_n, 0.75)
            } else {
                cornering
            },
            slip_over_cornering: slip / cornering,
            friction: physical.friction,
        };
        (cornering > 0.0 && slip > 0.0).then_some((brush, grows))
    }

    /// The tyres of four wheels, by axle.
    pub(crate) fn of_wheels([front, rear]: [Self; 2]) -> Brush<[f64; 4]> {
        let of = |number: fn(&Self) -> f64| {
            let (front, rear) = (number(&front), number(&rear));
            [front, front, rear, rear]
        };
        Brush {
            cornering: of(|brush| brush.cornering),
            slip_over_cornering: of(|brush| brush.slip_over_cornering),
            friction: of(|brush| brush.friction),
        }
    }
}

impl<C: Copy> Brush<C> {
    /// On a surface with factors on friction and stiffness.
    #[inline(always)]
    pub(crate) fn on_surface<V: Values<Constants = C>>(
        &self,
        friction: V,
        stiffness: V,
    ) -> OnSurface<V> {
        let stiffness = stiffness.times(self.cornering);
        let grip = friction.times(self.friction).not_below(LEAST_DIVISOR);
        let held = stiffness.not_below(LEAST_DIVISOR);
        OnSurface {
            stiffness,
            slope: held / grip.scaled(3.0),
            slide: grip / held,
        }
    }

    /// With a slip.
    #[inline(always)]
    pub(crate) fn slipping<V: Values<Constants = C>>(
        &self,
        surface: &OnSurface<V>,
        slip_tangent: V,
        slip_ratio: V,
    ) -> Slipping<V> {
        let along = slip_ratio.times(self.slip_over_cornering);
        let square = (along * along + slip_tangent * slip_tangent).not_below(LEAST_SQUARE);
        let amount = square.root();
        let part = amount * surface.slope;
        Slipping {
            along: along * surface.stiffness,
            across: -slip_tangent * surface.stiffness,
            part,
            third: (part * part).scaled(1.0 / 3.0),
            // The division waits for no root.
            sliding: surface.slide / square * amount,
        }
    }
}

impl<V: Values> Slipping<V> {
    /// F/(C_1 s) under a load; zero where the tyre is airborne.
    #[inline(always)]
    pub(crate) fn pull<const GROWS: bool>(&self, load_n: V) -> V {
        let Self {
            part,
            third,
            sliding,
            ..
        } = *self;
        let (limit, sticking) = if GROWS {
            let half = load_n.root();
            let fourth = half.root();
            (fourth, fourth * (half + third) - half * part)
        } else {
            let inverse = V::constant(1.0) / load_n;
            (load_n, (inverse * (inverse * third - part)).plus(1.0))
        };
        // In the air it slides, whatever the root of its load may be.
        part.if_less(limit, sticking, load_n.not_below(0.0) * sliding)
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
                            [(1.0, 1.0), (0.3, 0.7), (0.0, 1.0), (1.0, 0.0), (0.0, 0.0)]
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
                            let pull = if grows {
                                slipping.pull::<true>(load_n)
                            } else {
                                slipping.pull::<false>(load_n)
                            };
                            let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (1.0 + b.abs());
                            assert!(
                                near(pull * slipping.along, law.longitudinal_n)
                                    && near(pull * slipping.across, law.lateral_n),
                                "{contact:?} {law:?} {pull}"
                            );
                        }
                    }
                }
            }
        }
    }
}
