//! Four wheels as one vector of the processor, where it has AVX2.

use std::arch::x86_64::{self, __m256d, __m256i};
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{PerWheelValues, Values};
use crate::scalar::in_quarter;

/// A value of each wheel, of each axle (at both of its wheels) or of the vehicle (at all of them):
/// what each element would come to alone, to the same bits.
///
/// Only functions that are compiled for AVX2, and chosen where the processor has it, may use it.
#[derive(Clone, Copy)]
pub(crate) struct Quad(__m256d);

macro_rules! operations {
    ($($name:ident($($argument:ident: $type:ty),*) -> $result:ty = $intrinsic:ident $(::<$constant:tt>)?;)*) => {
        $(
            #[inline(always)]
            fn $name($($argument: $type),*) -> $result {
                // SAFETY: on numbers only, and part of AVX2, which users of `Quad` have.
                #[allow(unsafe_code, reason = "operations on vectors cannot be had without")]
                unsafe {
                    x86_64::$intrinsic$(::<$constant>)?($($argument),*)
                }
            }
        )*
    };
}

operations! {
    add(a: __m256d, b: __m256d) -> __m256d = _mm256_add_pd;
    sub(a: __m256d, b: __m256d) -> __m256d = _mm256_sub_pd;
    mul(a: __m256d, b: __m256d) -> __m256d = _mm256_mul_pd;
    div(a: __m256d, b: __m256d) -> __m256d = _mm256_div_pd;
    sqrt(a: __m256d) -> __m256d = _mm256_sqrt_pd;
    max(a: __m256d, b: __m256d) -> __m256d = _mm256_max_pd;
    min(a: __m256d, b: __m256d) -> __m256d = _mm256_min_pd;
    less(a: __m256d, b: __m256d) -> __m256d = _mm256_cmp_pd::<{ x86_64::_CMP_LT_OQ }>;
    choose(otherwise: __m256d, then: __m256d, mask: __m256d) -> __m256d = _mm256_blendv_pd;
    and(a: __m256d, b: __m256d) -> __m256d = _mm256_and_pd;
    and_not(not: __m256d, a: __m256d) -> __m256d = _mm256_andnot_pd;
    xor(a: __m256d, b: __m256d) -> __m256d = _mm256_xor_pd;
    everywhere(value: f64) -> __m256d = _mm256_set1_pd;
    less_and_more(a: __m256d, b: __m256d) -> __m256d = _mm256_addsub_pd;
    of_left(a: __m256d) -> __m256d = _mm256_permute_pd::<0b0000>;
    of_right(a: __m256d) -> __m256d = _mm256_permute_pd::<0b1111>;
    sides_changed(a: __m256d) -> __m256d = _mm256_permute_pd::<0b0101>;
    axles_changed(a: __m256d) -> __m256d = _mm256_permute4x64_pd::<0b0100_1110>;
    odd(a: __m256d, b: __m256d) -> __m256d = _mm256_blend_pd::<0b1010>;
    upper_half(a: __m256d, b: __m256d) -> __m256d = _mm256_blend_pd::<0b1100>;
    set(rr: f64, rl: f64, fr: f64, fl: f64) -> __m256d = _mm256_set_pd;
    bits(a: __m256d) -> __m256i = _mm256_castpd_si256;
    from_bits(a: __m256i) -> __m256d = _mm256_castsi256_pd;
    integers(value: i64) -> __m256i = _mm256_set1_epi64x;
    add_integers(a: __m256i, b: __m256i) -> __m256i = _mm256_add_epi64;
    to_sign(a: __m256i) -> __m256i = _mm256_slli_epi64::<63>;
    next_to_sign(a: __m256i) -> __m256i = _mm256_slli_epi64::<62>;
}

macro_rules! operators {
    ($($operator:ident $method:ident),*) => {
        $(
            impl $operator for Quad {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    Self($method(self.0, other.0))
                }
            }
        )*
    };
}

operators!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Quad {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(xor(self.0, everywhere(-0.0)))
    }
}

impl Values for Quad {
    type Constants = [f64; 4];

    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self(everywhere(value))
    }
    #[inline(always)]
    fn times(self, by: [f64; 4]) -> Self {
        self * Self::of(by)
    }
    #[inline(always)]
    fn scaled(self, by: f64) -> Self {
        self * Self::constant(by)
    }
    #[inline(always)]
    fn plus(self, more: f64) -> Self {
        self + Self::constant(more)
    }
    #[inline(always)]
    fn root(self) -> Self {
        Self(sqrt(self.0))
    }
    #[inline(always)]
    fn absolute(self) -> Self {
        Self(and_not(everywhere(-0.0), self.0))
    }
    // What compares false with a number that is none is kept, as by the scalars.
    #[inline(always)]
    fn not_below(self, least: f64) -> Self {
        Self(max(everywhere(least), self.0))
    }
    #[inline(always)]
    fn not_above(self, most: f64) -> Self {
        Self(min(everywhere(most), self.0))
    }
    #[inline(always)]
    fn lesser(self, other: Self) -> Self {
        Self(min(other.0, self.0))
    }
    #[inline(always)]
    fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self {
        Self(choose(otherwise.0, then.0, less(self.0, limit.0)))
    }
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        let (quarter, sine, cosine) = in_quarter(self);
        let quarter = bits(quarter.0);
        // The sign bit chooses.
        let odd = from_bits(to_sign(quarter));
        let sign = |quarter| and(from_bits(next_to_sign(quarter)), everywhere(-0.0));
        let next = add_integers(quarter, integers(1));
        (
            Self(xor(choose(sine.0, cosine.0, odd), sign(quarter))),
            Self(xor(choose(cosine.0, sine.0, odd), sign(next))),
        )
    }
}

impl PerWheelValues for Quad {
    type Raw = f64;
    type Number = Self;
    type Axles = Self;

    #[inline(always)]
    fn of([fl, fr, rl, rr]: [f64; 4]) -> Self {
        Self(set(rr, rl, fr, fl))
    }
    #[inline(always)]
    fn list(self) -> [f64; 4] {
        // SAFETY: four numbers either way.
        #[allow(unsafe_code, reason = "operations on vectors cannot be had without")]
        unsafe {
            std::mem::transmute(self.0)
        }
    }
    #[inline(always)]
    fn number(raw: f64) -> Self {
        Self(everywhere(raw))
    }
    #[inline(always)]
    fn raws([a, b, c, d, e, f, g]: [Self; 7]) -> [f64; 7] {
        let four = |a: Self, b: Self, c: Self, d: Self| {
            Self(upper_half(odd(a.0, b.0), odd(c.0, d.0))).list()
        };
        let ([a, b, c, d], [e, f, g, _]) = (four(a, b, c, d), four(e, f, g, g));
        [a, b, c, d, e, f, g]
    }
    #[inline(always)]
    fn two_sine_cosines([a, b]: [Self; 2]) -> [(Self, Self); 2] {
        let (sine, cosine) = Self(odd(a.0, b.0)).sine_cosine();
        [
            (Self(of_left(sine.0)), Self(of_left(cosine.0))),
            (Self(of_right(sine.0)), Self(of_right(cosine.0))),
        ]
    }
    #[inline(always)]
    fn all(number: Self) -> Self {
        number
    }
    #[inline(always)]
    fn both(number: Self) -> Self {
        number
    }
    #[inline(always)]
    fn axles(self) -> Self {
        Self(add(self.0, sides_changed(self.0)))
    }
    #[inline(always)]
    fn whole(axles: Self) -> Self {
        Self(add(axles.0, axles_changed(axles.0)))
    }
    #[inline(always)]
    fn of_axles(axles: Self) -> Self {
        axles
    }
    #[inline(always)]
    fn shifted(axles: Self, by: Self) -> Self {
        Self(less_and_more(axles.0, by.0))
    }
}
