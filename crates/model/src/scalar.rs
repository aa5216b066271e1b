use num_dual::DualNum;

/// A number that the models calculate with: `f64`, or a dual number that carries exact
/// derivatives along.
pub trait Scalar: DualNum<Primitive = f64> + Copy {
    /// The absolute value; its derivative at zero is that from the right.
    #[must_use]
    fn magnitude(self) -> Self {
        if self < 0.0 { -self } else { self }
    }

    /// -1 below zero, +1 otherwise.
    #[must_use]
    fn sign(self) -> f64 {
        if self < 0.0 { -1.0 } else { 1.0 }
    }

    /// The larger of this and a constant.
    #[must_use]
    fn at_least(self, least: f64) -> Self {
        if self < least {
            Self::from(least)
        } else {
            self
        }
    }

    /// The smaller of this and a constant.
    #[must_use]
    fn at_most(self, most: f64) -> Self {
        if self > most { Self::from(most) } else { self }
    }
}

impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {}
