//! Values of wheels and axles as lists, which go with any scalar.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{PerWheelValues, Values};
use crate::Scalar;
use crate::scalar::{each, sin_cos};

/// Four values, one for each wheel.
#[derive(Clone, Copy)]
pub(crate) struct Listed<T>([T; 4]);

/// Two values, one for each axle.
#[derive(Clone, Copy)]
pub(crate) struct ListedAxles<T>([T; 2]);

#[inline(always)]
fn each_axle<R>(of_axle: impl Fn(usize) -> R) -> [R; 2] {
    [of_axle(0), of_axle(1)]
}

macro_rules! operators {
    ($list:ident, $each:ident, $($operator:ident $method:ident),*) => {
        $(
            impl<T: Scalar> $operator for $list<T> {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    Self($each(|i| $operator::$method(self.0[i], other.0[i])))
                }
            }
        )*
    };
}

/// A list's operators and [`Values`], by what lists its elements and how many wheels share one.
macro_rules! values {
    ($list:ident, $each:ident, $wheels:literal) => {
        operators!($list, $each, Add add, Sub sub, Mul mul, Div div);

        impl<T: Scalar> Neg for $list<T> {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                Self($each(|i| -self.0[i]))
            }
        }

        impl<T: Scalar> Values for $list<T> {
            type Constants = [f64; 4];

            #[inline(always)]
            fn constant(value: f64) -> Self {
                Self($each(|_| T::from(value)))
            }
            #[inline(always)]
            fn times(self, by: [f64; 4]) -> Self {
                Self($each(|i| self.0[i] * by[i * $wheels]))
            }
            #[inline(always)]
            fn scaled(self, by: f64) -> Self {
                Self($each(|i| self.0[i] * by))
            }
            #[inline(always)]
            fn plus(self, more: f64) -> Self {
                Self($each(|i| self.0[i] + more))
            }
            #[inline(always)]
            fn root(self) -> Self {
                Self($each(|i| self.0[i].sqrt()))
            }
            #[inline(always)]
            fn absolute(self) -> Self {
                Self($each(|i| self.0[i].magnitude()))
            }
            #[inline(always)]
            fn not_below(self, least: f64) -> Self {
                Self($each(|i| self.0[i].at_least(least)))
            }
            #[inline(always)]
            fn not_above(self, most: f64) -> Self {
                Self($each(|i| self.0[i].at_most(most)))
            }
            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                Self($each(|i| self.0[i].lesser(other.0[i])))
            }
            #[inline(always)]
            fn if_less(self, limit: Self, then: Self, otherwise: Self) -> Self {
                Self($each(|i| {
                    self.0[i].if_less(limit.0[i], then.0[i], otherwise.0[i])
                }))
            }
            #[inline(always)]
            fn sine_cosine(self) -> (Self, Self) {
                let turned = $each(|i| sin_cos(self.0[i]));
                (
                    Self($each(|i| turned[i].0)),
                    Self($each(|i| turned[i].1)),
                )
            }
        }
    };
}

values!(Listed, each, 1);
values!(ListedAxles, each_axle, 2);

impl<T: Scalar> PerWheelValues for Listed<T> {
    type Number = T;
    type Axles = ListedAxles<T>;

    #[inline(always)]
    fn of(list: [T; 4]) -> Self {
        Self(list)
    }
    #[inline(always)]
    fn list(self) -> [T; 4] {
        self.0
    }
    #[inline(always)]
    fn all(number: T) -> Self {
        Self([number; 4])
    }
    #[inline(always)]
    fn both(number: T) -> ListedAxles<T> {
        ListedAxles([number; 2])
    }
    #[inline(always)]
    fn axles(self) -> ListedAxles<T> {
        let [fl, fr, rl, rr] = self.0;
        ListedAxles([fl + fr, rl + rr])
    }
    #[inline(always)]
    fn whole(axles: ListedAxles<T>) -> T {
        let [front, rear] = axles.0;
        front + rear
    }
    #[inline(always)]
    fn of_axles(axles: ListedAxles<T>) -> Self {
        let [front, rear] = axles.0;
        Self([front, front, rear, rear])
    }
    #[inline(always)]
    fn shifted(axles: ListedAxles<T>, by: ListedAxles<T>) -> Self {
        let ([front, rear], [by_front, by_rear]) = (axles.0, by.0);
        Self([
            front - by_front,
            front + by_front,
            rear - by_rear,
            rear + by_rear,
        ])
    }
}
