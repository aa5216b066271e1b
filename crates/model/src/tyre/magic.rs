//! The Magic Formula: y = D sin[C atan(B x - E (B x - atan(B x)))] + S_v.

/// Defines a structure of coefficients with the names that property files give them, in lower case.
macro_rules! coefficients {
    ($(#[$doc:meta])* $name:ident { $($field:ident = $value:expr),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[allow(missing_docs, reason = "the names are those of the tyre property file")]
        pub struct $name { $(pub $field: f64),* }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $value),* }
            }
        }

        impl $name {
            /// Names of the coefficients, in lower case.
            pub(in crate::tyre) const NAMES: &[&str] = &[$(stringify!($field)),*];

            pub(in crate::tyre) fn named(&mut self, name: &str) -> Option<&mut f64> {
                match name {
                    $(stringify!($field) => Some(&mut self.$field),)*
                    _ => None,
                }
            }
        }
    };
}
pub(in crate::tyre) use coefficients;

mod mf52;
mod mf61;
mod mf89;

pub use mf52::{Aligning52, Combined52, Lateral52, Longitudinal52, MagicFormula52};
pub(in crate::tyre) use mf61::degressive;
pub use mf61::{Coefficients61, MagicFormula61};
pub use mf89::{Coefficients89, MagicFormula89};

/// Pure lateral slip of Magic Formula 5.2 or 6.1, and what the aligning moment needs of it.
struct Side<T> {
    force: T,
    friction: T,
    stiffness: T,
    by_cy: T,
    shift: T,
    lift: T,
}

/// Slopes of the forces of a free-rolling upright tyre, all positive for a usual tyre.
#[derive(Clone, Copy, Debug)]
pub(in crate::tyre) struct Slopes {
    /// dF_x/dkappa, N.
    pub slip: f64,
    /// -dF_y/dalpha, N/rad.
    pub cornering: f64,
    /// -dF_y/dgamma, N/rad.
    pub camber: f64,
    /// Lateral friction coefficient.
    pub friction: f64,
}

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
