#![doc = include_str!("../README.md")]
//!
//! The C library selects its variants of these functions by the features of the processor, and the
//! variants differ in the last bit. A log that was recorded on a small vehicle PC would then not
//! replay bit for bit on a newer computer. The functions here are those of the crate `libm`, which
//! has one variant of each. Clippy's list of disallowed methods excludes the functions of the
//! standard library from the project.
//!
//! [`Random`] gives the random numbers of a seed, the same ones on every processor.

mod random;

pub use random::Random;

macro_rules! of_one {
    ($($(#[$doc:meta])* $name:ident = $of:ident;)*) => {
        $(
            $(#[$doc])*
            #[must_use]
            #[inline]
            pub fn $name(x: f64) -> f64 {
                libm::$of(x)
            }
        )*
    };
}

of_one! {
    /// Sine of an angle, rad.
    sin = sin;
    /// Cosine of an angle, rad.
    cos = cos;
    /// Tangent of an angle, rad.
    tan = tan;
    /// Angle whose sine is `x`, rad.
    asin = asin;
    /// Angle whose cosine is `x`, rad.
    acos = acos;
    /// Angle whose tangent is `x`, rad.
    atan = atan;
    /// Hyperbolic sine.
    sinh = sinh;
    /// Hyperbolic cosine.
    cosh = cosh;
    /// Hyperbolic tangent.
    tanh = tanh;
    /// e to the power of `x`.
    exp = exp;
    /// 2 to the power of `x`.
    exp2 = exp2;
    /// e to the power of `x`, less 1; accurate near zero.
    exp_m1 = expm1;
    /// Natural logarithm.
    ln = log;
    /// Natural logarithm of 1 + `x`; accurate near zero.
    ln_1p = log1p;
    /// Logarithm to the base 2.
    log2 = log2;
    /// Logarithm to the base 10.
    log10 = log10;
    /// Cube root.
    cbrt = cbrt;
}

/// Sine and cosine of an angle, rad.
#[must_use]
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// Angle from the x axis to the point (`x`, `y`), rad, in (-pi, pi].
#[must_use]
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Square root of x^2 + y^2, without overflow.
#[must_use]
#[inline]
pub fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}

/// `x` to the power of `exponent`.
#[must_use]
#[inline]
pub fn powf(x: f64, exponent: f64) -> f64 {
    libm::pow(x, exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits of each function over many arguments. A change of `libm` that changes any bit
    /// changes this number, and with it the estimates that replays of old logs give.
    #[test]
    fn bits_are_those_of_the_recorded_logs() {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut take = |value: f64| {
            for byte in value.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        };
        for step in 1..2000 {
            let x = f64::from(step) * 0.0137;
            let part = f64::from(step) / 2001.0;
            for f in [
                sin, cos, tan, sinh, cosh, tanh, exp, exp2, exp_m1, ln, ln_1p, log2, log10,
            ] {
                take(f(x));
            }
            for f in [asin, acos, atan, cbrt] {
                take(f(part));
            }
            take(atan2(x, 1.7));
            take(hypot(x, 0.3));
            take(powf(x, 1.37));
            let (sine, cosine) = sin_cos(x);
            assert_eq!([sine, cosine], [sin(x), cos(x)], "of {x}");
        }
        assert_eq!(format!("{hash:016x}"), "b547950d5c14d504");
    }
}
