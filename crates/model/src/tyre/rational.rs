//! A parametric tyre of rational functions after Rill's TMeasy.

use super::{Contact, Forces};
use crate::Scalar;

/// One direction's force curve at one load.
///
/// Force rises from the origin with slope dF_0, peaks at F_M for the slip s_M, falls to F_S at s_S
/// and slides on at F_S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// Initial slope dF_0, N per unit slip.
    pub slope_n: f64,
    /// Peak force F_M, N.
    pub peak_n: f64,
    /// Slip s_M of the peak.
    pub peak_slip: f64,
    /// Sliding force F_S, N.
    pub sliding_n: f64,
    /// Slip s_S from which it slides.
    pub sliding_slip: f64,
}

/// The tyre's dynamic offset (pneumatic trail over contact length) at one load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Offset at zero slip, part of the contact length.
    pub at_rest: f64,
    /// Lateral slip at which it first vanishes.
    pub first_zero: f64,
    /// Lateral slip from which it stays zero.
    pub last_zero: f64,
}

/// A parametric tyre: curves at the load F_zN and at twice that load, forces interpolated by a
/// parabola through the origin, slips by a line (Rill, Road Vehicle Dynamics, chapter 3). Slips
/// are referred to the transport velocity R |omega|; combined slip uses Rill's normalisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rational {
    /// Load F_zN of the first set, N.
    pub nominal_load_n: f64,
    /// Greatest load that the interpolation is trusted to, N.
    pub greatest_load_n: f64,
    /// Longitudinal curves at F_zN and 2 F_zN.
    pub longitudinal: [Curve; 2],
    /// Lateral curves at F_zN and 2 F_zN.
    pub lateral: [Curve; 2],
    /// Offsets at F_zN and 2 F_zN.
    pub offset: [Offset; 2],
    /// Unloaded radius, m.
    pub radius_m: f64,
    /// Vertical stiffness, N/m: gives the contact length sqrt(8 R F_z/k_z).
    pub vertical_stiffness_n_m: f64,
}

struct At<T> {
    slope: T,
    peak: T,
    peak_slip: T,
    sliding: T,
    sliding_slip: T,
}

impl Rational {
    pub(super) fn forces<T: Scalar>(&self, contact: &Contact<T>) -> Forces<T> {
        let load = contact.load_n.at_most(self.greatest_load_n);
        let ratio = load / self.nominal_load_n;
        let grip = contact.friction_scale;
        let x = at(&self.longitudinal, ratio, grip, contact.stiffness_scale);
        let y = at(&self.lateral, ratio, grip, contact.stiffness_scale);
        let transport = (contact.slip_ratio + 1.0).magnitude().at_least(0.01);
        let slip_x = contact.slip_ratio / transport;
        let slip_y = contact.slip_tangent / transport;
        // Normalising factors: both directions then share one slip.
        let sum_slip = x.peak_slip + y.peak_slip;
        let (rise_x, rise_y) = (x.peak / x.slope, y.peak / y.slope);
        let hx = x.peak_slip / sum_slip + rise_x / (rise_x + rise_y);
        let hy = y.peak_slip / sum_slip + rise_y / (rise_x + rise_y);
        let (nx, ny) = (slip_x / hx, slip_y / hy);
        let square = nx * nx + ny * ny;
        if square < 1e-20 {
            let trail = self.trail(ratio, load, slip_y);
            return Forces {
                longitudinal_n: x.slope * slip_x,
                lateral_n: -y.slope * slip_y,
                aligning_n_m: trail * y.slope * slip_y,
            };
        }
        let slip = square.sqrt();
        let (cos, sin) = (nx / slip, ny / slip);
        let mix = |a: T, b: T| (a * a * cos * cos + b * b * sin * sin).sqrt();
        let both = At {
            slope: mix(x.slope * hx, y.slope * hy),
            peak: mix(x.peak, y.peak),
            peak_slip: mix(x.peak_slip / hx, y.peak_slip / hy),
            sliding: mix(x.sliding, y.sliding),
            sliding_slip: mix(x.sliding_slip / hx, y.sliding_slip / hy),
        };
        let force = magnitude(&both, slip);
        let lateral_n = -force * sin;
        Forces {
            longitudinal_n: force * cos,
            lateral_n,
            aligning_n_m: -self.trail(ratio, load, slip_y) * lateral_n,
        }
    }

    /// Pneumatic trail n = L (n/L), m.
    fn trail<T: Scalar>(&self, ratio: T, load: T, slip_y: T) -> T {
        let between = |a: f64, b: f64| (ratio - 1.0) * (b - a) + a;
        let [one, two] = &self.offset;
        let start = between(one.at_rest, two.at_rest);
        let first = between(one.first_zero, two.first_zero);
        let last = between(one.last_zero, two.last_zero);
        let slip = slip_y.magnitude();
        let weight = first / last;
        let shape = if slip <= first {
            let s = slip / first;
            (-weight + 1.0) * (-s + 1.0) + weight * (-(-s * 2.0 + 3.0) * s * s + 1.0)
        } else if slip <= last {
            let left = (last - slip) / (last - first);
            -(-weight + 1.0) * (slip - first) / first * left * left
        } else {
            T::from(0.0)
        };
        let length = (load * (8.0 * self.radius_m / self.vertical_stiffness_n_m)).sqrt();
        length * start * shape
    }
}

/// Curve at a load F_z = ratio F_zN under a friction factor: peak and sliding forces and their
/// slips scale with friction, the initial slope does not.
fn at<T: Scalar>(curves: &[Curve; 2], ratio: T, grip: T, stiffness: T) -> At<T> {
    let [one, two] = curves;
    let parabola = |a: f64, b: f64| ratio * (ratio * (0.5 * b - a) + (2.0 * a - 0.5 * b));
    let line = |a: f64, b: f64| (ratio - 1.0) * (b - a) + a;
    At {
        slope: parabola(one.slope_n, two.slope_n) * stiffness,
        peak: parabola(one.peak_n, two.peak_n) * grip,
        peak_slip: line(one.peak_slip, two.peak_slip) * grip / stiffness,
        sliding: parabola(one.sliding_n, two.sliding_n) * grip,
        sliding_slip: line(one.sliding_slip, two.sliding_slip) * grip / stiffness,
    }
}

/// Force over slip: dF_0 s/(1 + q (q + dF_0 s_M/F_M - 2)) with q = s/s_M up to the peak, a cubic
/// down to sliding.
fn magnitude<T: Scalar>(curve: &At<T>, slip: T) -> T {
    if slip < curve.peak_slip {
        let q = slip / curve.peak_slip;
        let steep = curve.slope * curve.peak_slip / curve.peak;
        curve.slope * slip / (q * (q + steep - 2.0) + 1.0)
    } else if slip < curve.sliding_slip {
        let q = (slip - curve.peak_slip) / (curve.sliding_slip - curve.peak_slip);
        curve.peak - (curve.peak - curve.sliding) * q * q * (-q * 2.0 + 3.0)
    } else {
        curve.sliding
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::tyre::Tyre;

    /// The independent simulator's front tyre (params.json).
    pub(in crate::tyre) fn front() -> Rational {
        let curve = |slope_n, peak_n, peak_slip, sliding_n, sliding_slip| Curve {
            slope_n,
            peak_n,
            peak_slip,
            sliding_n,
            sliding_slip,
        };
        let offset = |at_rest, first_zero, last_zero| Offset {
            at_rest,
            first_zero,
            last_zero,
        };
        Rational {
            nominal_load_n: 1600.0,
            greatest_load_n: 5600.0,
            longitudinal: [
                curve(22_400.0, 1472.0, 0.16, 1200.0, 0.8),
                curve(41_600.0, 2752.0, 0.17, 2240.0, 0.8),
            ],
            lateral: [
                curve(7000.0, 1472.0, 0.44, 1360.0, 1.1),
                curve(11_900.0, 2656.0, 0.48, 2464.0, 1.15),
            ],
            offset: [offset(0.178, 0.3, 0.8), offset(0.19, 0.32, 0.85)],
            radius_m: 0.3175,
            vertical_stiffness_n_m: 120_000.0,
        }
    }

    #[test]
    fn curves_pass_through_their_parameters() {
        let tyre = Tyre::Rational(Box::new(front()));
        let lateral = |load: f64, slip: f64| {
            -tyre
                .forces(&Contact {
                    slip_tangent: slip,
                    ..Contact::lateral(load, 0.0)
                })
                .lateral_n
        };
        assert!((lateral(1600.0, 0.44) - 1472.0).abs() < 1e-9);
        assert!((lateral(3200.0, 0.48) - 2656.0).abs() < 1e-9);
        assert!((lateral(1600.0, 2.0) - 1360.0).abs() < 1e-9);
        assert!((lateral(1600.0, 1e-7) / 1e-7 - 7000.0).abs() < 0.1);
        // params.json: 5960.3 N/rad at the static load of 1328.54 N.
        assert!((lateral(1328.54, 1e-7) / 1e-7 - 5960.3).abs() < 0.1);
    }

    #[test]
    fn half_the_friction_gives_half_the_peak_and_the_same_slope() {
        let tyre = Tyre::Rational(Box::new(front()));
        let lateral = |slip: f64, friction_scale: f64| {
            -tyre
                .forces(&Contact {
                    slip_tangent: slip,
                    friction_scale,
                    ..Contact::lateral(1600.0, 0.0)
                })
                .lateral_n
        };
        assert!((lateral(0.22, 0.5) - 736.0).abs() < 1e-9);
        assert!((lateral(1e-6, 0.5) / lateral(1e-6, 1.0) - 1.0).abs() < 1e-4);
    }
}
