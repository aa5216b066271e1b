//! Indices of the states. Wheels in the order of [`sample::Wheel::ALL`].

/// Number of states.
pub const SIZE: usize = 66;
/// One number for each state.
pub type State = [f64; SIZE];
/// Force of wheel w along axis a at `FORCE + 3 w + a`; contact frame, N.
pub const FORCE: usize = 0;
/// Rate of the force, N/s.
pub const RATE: usize = 12;
/// Moments of wheel w about x and z at `MOMENT + 2 w` and one further; contact frame, N m.
pub const MOMENT: usize = 24;
/// Torque of the half-shafts of axle a, N m: the mean of left and right at `TORQUE + a`, half their
/// difference, left less right, at `TORQUE + 2 + a`.
pub const TORQUE: usize = 32;
/// Angular rate of the body, body axes, rad/s.
pub const BODY_RATE: usize = 36;
/// Remaining accelerometer bias, body axes, m/s^2.
pub const ACCEL_BIAS: usize = 39;
/// Offset of axial channel i of wheel w at `OFFSET + 5 w + i`, N.
pub const OFFSET: usize = 42;
/// Strut length less the potentiometer's reading, wheel w at `STRUT_LENGTH + w`, mm.
pub const STRUT_LENGTH: usize = 62;
