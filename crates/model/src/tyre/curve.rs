//! The brush tyre's curve, which is Fiala's parabola (Fiala 1954; Pacejka, Tyre and Vehicle Dynamics,
//! 3rd edition, section 3.2).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | C s | force that the stiffness alone would give at the slip s | N |
//! | mu F_z | grip | N |
//! | h | C s/(3 mu F_z): part of the contact patch that slides; all of it from 1 on | - |

use crate::Scalar;

/// Force over the force that the stiffness alone would give, for a part h below 1 that slides:
/// F/(C s) = 1 - h + h^2/3.
#[must_use]
#[inline(always)]
pub fn brush_over_linear<T: Scalar>(sliding_part: T) -> T {
    sliding_part * (sliding_part * (1.0 / 3.0) - 1.0) + 1.0
}

/// Force over grip for a part h that slides, zero or greater: F/(mu F_z) = 1 - (1 - h)^3, 1 from
/// h = 1 on.
#[must_use]
#[inline]
pub fn brush_over_grip(sliding_part: f64) -> f64 {
    1.0 - (1.0 - sliding_part).max(0.0).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_one_curve_and_the_force_is_full_where_all_slides() {
        for step in 1..100 {
            let part = 0.01 * f64::from(step);
            // F = (C s) (F/(C s)) and C s = 3 h mu F_z.
            let by_linear = 3.0 * part * brush_over_linear(part);
            assert!((by_linear - brush_over_grip(part)).abs() < 1e-15, "{part}");
        }
        assert_eq!(brush_over_grip(1.0), 1.0);
        assert_eq!(brush_over_grip(7.0), 1.0);
        assert_eq!(brush_over_linear(0.0), 1.0);
    }
}
