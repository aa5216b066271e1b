//! The Magic Formula: y = D sin[C atan(B x - E (B x - atan(B x)))] + S_v.

mod mf52;
mod mf89;

pub use mf52::{Aligning52, Combined52, Lateral52, Longitudinal52, MagicFormula52};
pub use mf89::{Coefficients89, MagicFormula89};

use crate::Scalar;

/// D sin[C atan(B x - E (B x - atan(B x)))].
#[inline]
fn sine<T: Scalar>(b: T, c: f64, d: T, e: T, x: T) -> T {
    let bx = b * x;
    d * ((bx - e * (bx - bx.arctangent())).arctangent() * c).sine()
}

/// D cos[C atan(B x - E (B x - atan(B x)))].
#[inline]
fn cosine<T: Scalar>(b: T, c: f64, d: T, e: T, x: T) -> T {
    let bx = b * x;
    d * ((bx - e * (bx - bx.arctangent())).arctangent() * c).cosine()
}
