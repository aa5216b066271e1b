use crate::Scalar;

/// How a slip stiffness depends on the load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stiffness {
    /// Constant C, N/rad or N per unit slip.
    Constant(f64),
    /// C = C_0 (F_z/F_z0)^n.
    Power {
        /// C_0, at the reference load.
        at_reference: f64,
        /// F_z0, N.
        reference_load_n: f64,
        /// n.
        exponent: f64,
    },
    /// C = c_1 sin(2 atan(F_z/c_2)): greatest, c_1, at the load c_2.
    Sine {
        /// c_1.
        most: f64,
        /// c_2, N.
        load_of_most_n: f64,
    },
}

impl Stiffness {
    /// This stiffness at a load at which another one is known: two power laws of the same load
    /// share their power.
    #[inline]
    #[allow(clippy::float_cmp)]
    pub(super) fn beside<T: Scalar>(&self, load_n: T, other: &Self, known: T) -> T {
        match (self, other) {
            (
                Self::Power {
                    at_reference: own,
                    reference_load_n: own_load,
                    exponent: own_exponent,
                },
                Self::Power {
                    at_reference: theirs,
                    reference_load_n: their_load,
                    exponent: their_exponent,
                },
            ) if own_load == their_load && own_exponent == their_exponent => known * (own / theirs),
            _ => self.at(load_n),
        }
    }

    /// The stiffness at a load above zero.
    #[inline]
    pub fn at<T: Scalar>(&self, load_n: T) -> T {
        match *self {
            Self::Constant(stiffness) => T::from(stiffness),
            Self::Power {
                at_reference,
                reference_load_n,
                exponent,
            } => power(load_n / reference_load_n, exponent) * at_reference,
            // sin(2 atan x) = 2x/(1 + x^2)
            Self::Sine {
                most,
                load_of_most_n,
            } => {
                let ratio = load_n / load_of_most_n;
                ratio / (ratio * ratio + 1.0) * (2.0 * most)
            }
        }
    }
}

/// x^n for x > 0; the exponents that files commonly give need no logarithm.
#[inline]
#[allow(clippy::float_cmp)]
fn power<T: Scalar>(base: T, exponent: f64) -> T {
    if exponent == 0.0 {
        T::from(1.0)
    } else if exponent == 1.0 {
        base
    } else if exponent == 0.75 {
        let root = base.sqrt();
        root * root.sqrt()
    } else if exponent == 0.5 {
        base.sqrt()
    } else {
        base.power(exponent)
    }
}
