use num_dual::DualNum;

use crate::values::Values;

/// A number that the models calculate with: `f64`, or a dual number that carries exact
/// derivatives along.
pub trait Scalar: DualNum<Primitive = f64> + Copy {
    /// The absolute value; its derivative at zero is that from the right.
    #[must_use]
    #[inline(always)]
    fn magnitude(self) -> Self {
        if Self::NDERIV == 0 {
            Self::from(self.re().abs())
        } else if self < 0.0 {
            -self
        } else {
            self
        }
    }

    /// -1 below zero, +1 otherwise.
    #[must_use]
    #[inline(always)]
    fn sign(self) -> f64 {
        if self < 0.0 { -1.0 } else { 1.0 }
    }

    /// The larger of this and a constant.
    #[must_use]
    #[inline(always)]
    fn at_least(self, least: f64) -> Self {
        if self < least {
            Self::from(least)
        } else {
            self
        }
    }

    /// A function of this number by its value and its slope here, to the first derivative.
    #[must_use]
    #[inline(always)]
    fn chained(self, value: f64, slope: impl FnOnce() -> f64) -> Self {
        if Self::NDERIV == 0 {
            Self::from(value)
        } else {
            (self - self.re()) * slope() + value
        }
    }

    /// The sine.
    #[must_use]
    #[inline(always)]
    fn sine(self) -> Self {
        self.chained(math::sin(self.re()), || math::cos(self.re()))
    }

    /// The cosine.
    #[must_use]
    #[inline(always)]
    fn cosine(self) -> Self {
        self.chained(math::cos(self.re()), || -math::sin(self.re()))
    }

    /// The tangent.
    #[must_use]
    #[inline(always)]
    fn tangent(self) -> Self {
        let tangent = math::tan(self.re());
        self.chained(tangent, || 1.0 + tangent * tangent)
    }

    /// The angle whose tangent this is.
    #[must_use]
    #[inline(always)]
    fn arctangent(self) -> Self {
        self.chained(math::atan(self.re()), || {
            1.0 / (1.0 + self.re() * self.re())
        })
    }

    /// The angle from the x axis to the point (`x`, this), rad.
    #[must_use]
    #[inline(always)]
    fn arctangent_over(self, x: Self) -> Self {
        let value = math::atan2(self.re(), x.re());
        if Self::NDERIV == 0 {
            return Self::from(value);
        }
        let square = self.re() * self.re() + x.re() * x.re();
        let turn = (self - self.re()) * x.re() - (x - x.re()) * self.re();
        turn / square + value
    }

    /// e to the power of this.
    #[must_use]
    #[inline(always)]
    fn exponential(self) -> Self {
        let value = math::exp(self.re());
        self.chained(value, || value)
    }

    /// e to the power of this, less 1.
    #[must_use]
    #[inline(always)]
    fn exponential_less_one(self) -> Self {
        let value = math::exp_m1(self.re());
        self.chained(value, || value + 1.0)
    }

    /// This to the power of a constant.
    #[must_use]
    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        self.chained(math::powf(self.re(), exponent), || {
            exponent * math::powf(self.re(), exponent - 1.0)
        })
    }

    /// The smaller of this and a constant.
    #[must_use]
    #[inline(always)]
    fn at_most(self, most: f64) -> Self {
        if self > most { Self::from(most) } else { self }
    }
}

impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {}

/// Four values, one for each wheel. Written out, so that optimisers see no loop.
#[inline(always)]
pub(crate) fn each<R>(of_wheel: impl Fn(usize) -> R) -> [R; 4] {
    [of_wheel(0), of_wheel(1), of_wheel(2), of_wheel(3)]
}

/// Sine and cosine without a branch or a call, so that loops over runs become vector code.
///
/// The sine of a library branches on the angle and is a call, which vector code cannot hold. The
/// kernels of the chassis models use this function; all other code uses those of the crate `math`.
///
/// The angle less the nearest multiple of pi/2 (in three parts, Cody and Waite) goes into the
/// polynomials of fdlibm (Sun Microsystems, 1993: kernels of sine and cosine on +-pi/4, error below
/// one unit in the last place). The error stays within two units in the last place of 1 up to
/// angles of 1e5 rad. Dual numbers take their own.
#[inline(always)]
pub(crate) fn sin_cos<T: Scalar>(angle: T) -> (T, T) {
    if T::NDERIV > 0 {
        return (angle.sine(), angle.cosine());
    }
    let (quarter, sine, cosine) = in_quarter(angle.re());
    let quarter = quarter.to_bits();
    // In odd quarters the two change places: where their bits differ, both are turned over.
    let (sine, cosine) = (sine.to_bits(), cosine.to_bits());
    let change = (sine ^ cosine) & 0_u64.wrapping_sub(quarter & 1);
    let sine = sine ^ change ^ ((quarter & 2) << 62);
    let cosine = cosine ^ change ^ (((quarter + 1) & 2) << 62);
    (
        T::from(f64::from_bits(sine)),
        T::from(f64::from_bits(cosine)),
    )
}

/// Of an angle, the number whose last bits count its quarters of a turn, and sine and cosine of what
/// is left of it beyond the nearest quarter.
#[inline(always)]
pub(crate) fn in_quarter<V: Values>(angle: V) -> (V, V, V) {
    /// Added to a number of less than 2^51, it leaves the nearest integer in the last bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const PARTS: [f64; 3] = [
        1.570_796_326_734_125_6,
        6.077_100_506_303_966e-11,
        2.022_266_248_795_950_7e-21,
    ];
    const SINE: [f64; 6] = [
        1.589_690_995_211_55e-10,
        -2.505_076_025_340_686_3e-8,
        2.755_731_370_707_006_8e-6,
        -1.984_126_982_985_795e-4,
        8.333_333_333_322_49e-3,
        -1.666_666_666_666_663_2e-1,
    ];
    const COSINE: [f64; 6] = [
        -1.135_964_755_778_819_5e-11,
        2.087_572_321_298_175e-9,
        -2.755_731_435_139_066_3e-7,
        2.480_158_728_947_673e-5,
        -1.388_888_888_887_411e-3,
        4.166_666_666_666_66e-2,
    ];
    let quarter = angle.scaled(std::f64::consts::FRAC_2_PI).plus(ROUND);
    let turns = quarter.plus(-ROUND);
    let rest = angle - turns.scaled(PARTS[0]) - turns.scaled(PARTS[1]) - turns.scaled(PARTS[2]);
    let z = rest * rest;
    let square = z * z;
    let fourth = square * square;
    let sine = polynomial(&SINE, z, square, fourth) * (z * rest) + rest;
    let cosine = polynomial(&COSINE, z, square, fourth) * square + z.scaled(-0.5).plus(1.0);
    (quarter, sine, cosine)
}

/// Coefficients from the highest power on; pairs of them do not wait for each other.
#[inline(always)]
fn polynomial<V: Values>(c: &[f64; 6], x: V, square: V, fourth: V) -> V {
    x.scaled(c[0]).plus(c[1]) * fourth
        + (x.scaled(c[2]).plus(c[3]) * square + x.scaled(c[4]).plus(c[5]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_meet_the_libraries() {
        for k in -200_000..200_000 {
            let angle = f64::from(k) * 1.7e-4 + 1e-9;
            let (sine, cosine) = sin_cos(angle);
            let (expected_sine, expected_cosine) = math::sin_cos(angle);
            assert!((sine - expected_sine).abs() <= 4.5e-16, "{angle}");
            assert!((cosine - expected_cosine).abs() <= 4.5e-16, "{angle}");
        }
        for angle in [1e3_f64, -4.7e4, 9.9e4] {
            let (sine, cosine) = sin_cos(angle);
            assert!(
                (sine - math::sin(angle)).abs() <= 4.5e-16
                    && (cosine - math::cos(angle)).abs() <= 4.5e-16
            );
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert!(sin_cos(f64::NAN).0.is_nan());
    }
}
