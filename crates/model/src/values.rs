//! One number, or one for each wheel, as one value: the equations of tyres and wheels are written
//! once, and calculate a wheel at a time or all four at once.

mod listed;

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::Scalar;
use crate::scalar::sin_cos;

pub(crate) use listed::Listed;

/// A value that equations without branches calculate with.
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
    /// The smaller of this and another.
    #[must_use]
    fn lesser(self, other: Self) -> Self;
    /// One of two, by whether this is less than a limit.
    #[must_use]
    fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self;
    /// Sine and cosine.
    #[must_use]
    fn sine_cosine(self) -> (Self, Self);
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
    fn lesser(self, other: Self) -> Self {
        if self > other { other } else { self }
    }
    #[inline(always)]
    fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self {
        if self < limit { then } else { otherwise }
    }
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        sin_cos(self)
    }
}

/// Four values, one for each wheel.
pub(crate) trait PerWheelValues: Values<Constants = [f64; 4]> {
    /// One value of a wheel or of the whole vehicle.
    type Number: Scalar;
    /// One value for each axle; its constants are those of the axle's wheels, which are alike.
    type Axles: Values<Constants = [f64; 4]>;

    /// From a list.
    fn of(list: [Self::Number; 4]) -> Self;
    /// As a list.
    fn list(self) -> [Self::Number; 4];
    /// The same for all wheels.
    fn all(number: Self::Number) -> Self;
    /// The same for both axles.
    fn both(number: Self::Number) -> Self::Axles;
    /// Sum of left and right, of each axle.
    fn axles(self) -> Self::Axles;
    /// Sum of front and rear.
    fn whole(axles: Self::Axles) -> Self::Number;
    /// What an axle has, for both of its wheels.
    fn of_axles(axles: Self::Axles) -> Self;
    /// What an axle has, less at the left and more at the right.
    fn shifted(axles: Self::Axles, by: Self::Axles) -> Self;
}
