use std::fmt;
use std::ops::{Index, IndexMut};

use serde::{Deserialize, Serialize};

/// One of the four wheels, in the project's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wheel {
    /// Front left.
    FrontLeft,
    /// Front right.
    FrontRight,
    /// Rear left.
    RearLeft,
    /// Rear right.
    RearRight,
}

impl Wheel {
    /// All wheels, in order.
    pub const ALL: [Self; 4] = [
        Self::FrontLeft,
        Self::FrontRight,
        Self::RearLeft,
        Self::RearRight,
    ];

    /// Position in [`Wheel::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Whether this wheel is on the front axle.
    #[must_use]
    pub const fn is_front(self) -> bool {
        matches!(self, Self::FrontLeft | Self::FrontRight)
    }

    /// Whether this wheel is on the left side.
    #[must_use]
    pub const fn is_left(self) -> bool {
        matches!(self, Self::FrontLeft | Self::RearLeft)
    }

    /// +1 on the left side, -1 on the right: the sign of the wheel's y coordinate.
    #[must_use]
    pub const fn side(self) -> f64 {
        if self.is_left() { 1.0 } else { -1.0 }
    }

    /// The abbreviation that topics and tables use: FL, FR, RL, RR.
    #[must_use]
    pub const fn abbreviation(self) -> &'static str {
        match self {
            Self::FrontLeft => "FL",
            Self::FrontRight => "FR",
            Self::RearLeft => "RL",
            Self::RearRight => "RR",
        }
    }

    /// The wheel with this abbreviation, in either case.
    #[must_use]
    pub fn from_abbreviation(text: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|wheel| wheel.abbreviation().eq_ignore_ascii_case(text))
    }
}

/// A side of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
}

impl Side {
    /// Both sides, in order.
    pub const ALL: [Self; 2] = [Self::Left, Self::Right];

    /// Position in [`Side::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The side's front and rear wheel.
    #[must_use]
    pub const fn wheels(self) -> [Wheel; 2] {
        match self {
            Self::Left => [Wheel::FrontLeft, Wheel::RearLeft],
            Self::Right => [Wheel::FrontRight, Wheel::RearRight],
        }
    }

    /// `left` or `right`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An axle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axle {
    /// Front.
    Front,
    /// Rear.
    Rear,
}

impl Axle {
    /// Both axles, in order.
    pub const ALL: [Self; 2] = [Self::Front, Self::Rear];

    /// The axle's left and right wheel.
    #[must_use]
    pub const fn wheels(self) -> [Wheel; 2] {
        match self {
            Self::Front => [Wheel::FrontLeft, Wheel::FrontRight],
            Self::Rear => [Wheel::RearLeft, Wheel::RearRight],
        }
    }

    /// `front` or `rear`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Rear => "rear",
        }
    }
}

impl fmt::Display for Axle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Wheel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.abbreviation())
    }
}

/// One value for each wheel, in the order of [`Wheel::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerWheel<T>(pub [T; 4]);

impl<T> PerWheel<T> {
    /// Makes each wheel's value.
    pub fn from_fn(mut make: impl FnMut(Wheel) -> T) -> Self {
        Self(Wheel::ALL.map(&mut make))
    }
}

impl<T> Index<Wheel> for PerWheel<T> {
    type Output = T;

    fn index(&self, wheel: Wheel) -> &T {
        &self.0[wheel.index()]
    }
}

impl<T> IndexMut<Wheel> for PerWheel<T> {
    fn index_mut(&mut self, wheel: Wheel) -> &mut T {
        &mut self.0[wheel.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_and_signs() {
        for (index, wheel) in Wheel::ALL.into_iter().enumerate() {
            assert_eq!(wheel.index(), index);
            assert_eq!(wheel.side() > 0.0, wheel.is_left());
            assert_eq!(Wheel::from_abbreviation(wheel.abbreviation()), Some(wheel));
        }
        assert_eq!(Wheel::from_abbreviation("fl"), Some(Wheel::FrontLeft));
        assert_eq!(Wheel::from_abbreviation("XX"), None);
    }
}
