//! Pairs of quantities of the inertial unit.

/// One quantity of the gyros and one of the accelerometers, about and along the body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Triads<T> {
    /// Of the angular rates, rad/s.
    pub rate: T,
    /// Of the specific forces, m/s².
    pub force: T,
}

/// Which axes of the inertial unit are used.
pub type UsedAxes = Triads<[bool; 3]>;
