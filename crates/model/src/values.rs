//! One number, or one for each wheel, as one value: the equations of tyres and wheels are written
//! once, and calculate a wheel at a time or all four at once.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::Scalar;
use crate::scalar::each;

/// What equations in a straight line calculate with.
pub trait Values:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Constants of an equation: a number, or one for each wheel.
    type Constants: Copy;

    /// A constant.
    #[must_use]
    fn constant(value: f64) -> Self;
    /// Times constants.
    #[must_use]
    fn times(self, by: Self::Constants) -> Self;
    /// Times one constant.
    #[must_use]
    fn scaled(self, by: f64) -> Self;
    /// Plus one constant.
    #[must_use]
    fn plus(self, more: f64) -> Self;
    /// The square root.
    #[must_use]
    fn root(self) -> Self;
    /// The absolute value.
    #[must_use]
    fn absolute(self) -> Self;
    /// The larger of this and a constant.
    #[must_use]
    fn not_below(self, least: f64) -> Self;
    /// The smaller of this and a constant.
    #[must_use]
    fn not_above(self, most: f64) -> Self;
    /// One of two, by whether this is less than a limit.
    #[must_use]
    fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self;
}

impl<T: Scalar> Values for T {
    type Constants = f64;

    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::from(value)
    }
    #[inline(always)]
    fn times(self, by: f64) -> Self {
        self * by
    }
    #[inline(always)]
    fn scaled(self, by: f64) -> Self {
        self * by
    }
    #[inline(always)]
    fn plus(self, more: f64) -> Self {
        self + more
    }
    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn absolute(self) -> Self {
        self.magnitude()
    }
    #[inline(always)]
    fn not_below(self, least: f64) -> Self {
        self.at_least(least)
    }
    #[inline(always)]
    fn not_above(self, most: f64) -> Self {
        self.at_most(most)
    }
    #[inline(always)]
    fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self {
        if self < limit { then } else { otherwise }
    }
}

/// Four values, one for each wheel.
pub(crate) trait PerWheelValues: Values<Constants = [f64; 4]> {
    /// Number of one wheel.
    type Number: Scalar;

    /// From a list.
    fn of(list: [Self::Number; 4]) -> Self;
    /// The same for all wheels.
    fn all(value: Self::Number) -> Self;
    /// As a list.
    fn list(self) -> [Self::Number; 4];
    /// Sum of left and right, of each axle.
    fn axles(self) -> [Self::Number; 2];
}

/// Four values as a list, which goes with any scalar.
#[derive(Clone, Copy)]
pub(crate) struct Listed<T>([T; 4]);

macro_rules! wheel_by_wheel {
    ($($operator:ident $method:ident),*) => {
        $(
            impl<T: Scalar> $operator for Listed<T> {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    Self(each(|i| $operator::$method(self.0[i], other.0[i])))
                }
            }
        )*
    };
}

wheel_by_wheel!(Add add, Sub sub, Mul mul, Div div);

impl<T: Scalar> Neg for Listed<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(each(|i| -self.0[i]))
    }
}

impl<T: Scalar> Values for Listed<T> {
    type Constants = [f64; 4];

    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::all(T::from(value))
    }
    #[inline(always)]
    fn times(self, by: [f64; 4]) -> Self {
        Self(each(|i| self.0[i] * by[i]))
    }
    #[inline(always)]
    fn scaled(self, by: f64) -> Self {
        Self(each(|i| self.0[i] * by))
    }
    #[inline(always)]
    fn plus(self, more: f64) -> Self {
        Self(each(|i| self.0[i] + more))
    }
    #[inline(always)]
    fn root(self) -> Self {
        Self(each(|i| self.0[i].sqrt()))
    }
    #[inline(always)]
    fn absolute(self) -> Self {
        Self(each(|i| self.0[i].magnitude()))
    }
    #[inline(always)]
    fn not_below(self, least: f64) -> Self {
        Self(each(|i| self.0[i].at_least(least)))
    }
    #[inline(always)]
    fn not_above(self, most: f64) -> Self {
        Self(each(|i| self.0[i].at_most(most)))
    }
    #[inline(always)]
    fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self {
        Self(each(|i| {
            self.0[i].if_less(limit.0[i], then.0[i], otherwise.0[i])
        }))
    }
}

impl<T: Scalar> PerWheelValues for Listed<T> {
    type Number = T;

    #[inline(always)]
    fn of(list: [T; 4]) -> Self {
        Self(list)
    }
    #[inline(always)]
    fn all(value: T) -> Self {
        Self([value; 4])
    }
    #[inline(always)]
    fn list(self) -> [T; 4] {
        self.0
    }
    #[inline(always)]
    fn axles(self) -> [T; 2] {
        let [fl, fr, rl, rr] = self.0;
        [fl + fr, rl + rr]
    }
}

/// Four numbers as the processor's vectors where every processor of the architecture has them: what
/// is written for lists comes out as single operations and shuffles.
#[cfg(target_arch = "x86_64")]
pub(crate) type Together = vectors::Pairs;
#[cfg(not(target_arch = "x86_64"))]
pub(crate) type Together = Listed<f64>;

#[cfg(target_arch = "x86_64")]
mod vectors {
    use std::arch::x86_64::{self, __m128d};
    use std::ops::{Add, Div, Mul, Neg, Sub};

    use super::{PerWheelValues, Values};

    macro_rules! operations {
        ($($name:ident($($argument:ident: $type:ty),*) -> $result:ty = $intrinsic:ident;)*) => {
            $(
                #[inline(always)]
                fn $name($($argument: $type),*) -> $result {
                    // SAFETY: on numbers only, and part of SSE2, which x86-64 always has.
                    #[allow(unsafe_code, reason = "operations on vectors cannot be had without")]
                    unsafe {
                        x86_64::$intrinsic($($argument),*)
                    }
                }
            )*
        };
    }

    operations! {
        add(a: __m128d, b: __m128d) -> __m128d = _mm_add_pd;
        sub(a: __m128d, b: __m128d) -> __m128d = _mm_sub_pd;
        mul(a: __m128d, b: __m128d) -> __m128d = _mm_mul_pd;
        div(a: __m128d, b: __m128d) -> __m128d = _mm_div_pd;
        sqrt(a: __m128d) -> __m128d = _mm_sqrt_pd;
        max(a: __m128d, b: __m128d) -> __m128d = _mm_max_pd;
        min(a: __m128d, b: __m128d) -> __m128d = _mm_min_pd;
        less(a: __m128d, b: __m128d) -> __m128d = _mm_cmplt_pd;
        and(a: __m128d, b: __m128d) -> __m128d = _mm_and_pd;
        and_not(not: __m128d, b: __m128d) -> __m128d = _mm_andnot_pd;
        or(a: __m128d, b: __m128d) -> __m128d = _mm_or_pd;
        xor(a: __m128d, b: __m128d) -> __m128d = _mm_xor_pd;
        pair(second: f64, first: f64) -> __m128d = _mm_set_pd;
        both(value: f64) -> __m128d = _mm_set1_pd;
        firsts(a: __m128d, b: __m128d) -> __m128d = _mm_unpacklo_pd;
        seconds(a: __m128d, b: __m128d) -> __m128d = _mm_unpackhi_pd;
        first(a: __m128d) -> f64 = _mm_cvtsd_f64;
    }

    /// The wheels of each axle in one vector.
    #[derive(Clone, Copy)]
    pub(crate) struct Pairs(__m128d, __m128d);

    macro_rules! operators {
        ($($operator:ident $method:ident),*) => {
            $(
                impl $operator for Pairs {
                    type Output = Self;

                    #[inline(always)]
                    fn $method(self, other: Self) -> Self {
                        Self($method(self.0, other.0), $method(self.1, other.1))
                    }
                }
            )*
        };
    }

    operators!(Add add, Sub sub, Mul mul, Div div);

    impl Neg for Pairs {
        type Output = Self;

        #[inline(always)]
        fn neg(self) -> Self {
            let sign = both(-0.0);
            Self(xor(self.0, sign), xor(self.1, sign))
        }
    }

    /// One of two for each of a pair.
    #[inline(always)]
    fn choose(mask: __m128d, then: __m128d, otherwise: __m128d) -> __m128d {
        or(and(mask, then), and_not(mask, otherwise))
    }

    impl Values for Pairs {
        type Constants = [f64; 4];

        #[inline(always)]
        fn constant(value: f64) -> Self {
            Self::all(value)
        }
        #[inline(always)]
        fn times(self, by: [f64; 4]) -> Self {
            self * Self::of(by)
        }
        #[inline(always)]
        fn scaled(self, by: f64) -> Self {
            self * Self::all(by)
        }
        #[inline(always)]
        fn plus(self, more: f64) -> Self {
            self + Self::all(more)
        }
        #[inline(always)]
        fn root(self) -> Self {
            Self(sqrt(self.0), sqrt(self.1))
        }
        // What compares false with a number that is none is kept, as by the scalars.
        #[inline(always)]
        fn absolute(self) -> Self {
            self.if_less(Self::constant(0.0), -self, self)
        }
        #[inline(always)]
        fn not_below(self, least: f64) -> Self {
            let least = both(least);
            Self(max(least, self.0), max(least, self.1))
        }
        #[inline(always)]
        fn not_above(self, most: f64) -> Self {
            let most = both(most);
            Self(min(most, self.0), min(most, self.1))
        }
        #[inline(always)]
        fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self {
            let masks = [less(self.0, limit.0), less(self.1, limit.1)];
            Self(
                choose(masks[0], then.0, otherwise.0),
                choose(masks[1], then.1, otherwise.1),
            )
        }
    }

    impl PerWheelValues for Pairs {
        type Number = f64;

        #[inline(always)]
        fn of([fl, fr, rl, rr]: [f64; 4]) -> Self {
            Self(pair(fr, fl), pair(rr, rl))
        }
        #[inline(always)]
        fn all(value: f64) -> Self {
            Self(both(value), both(value))
        }
        #[inline(always)]
        fn list(self) -> [f64; 4] {
            let Self(front, rear) = self;
            [
                first(front),
                first(seconds(front, front)),
                first(rear),
                first(seconds(rear, rear)),
            ]
        }
        #[inline(always)]
        fn axles(self) -> [f64; 2] {
            let sums = add(firsts(self.0, self.1), seconds(self.0, self.1));
            [first(sums), first(seconds(sums, sums))]
        }
    }
}
