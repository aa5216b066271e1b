//! Indices of the states. Wheels in the order of [`sample::Wheel::ALL`].

/// Number of states.
pub const SIZE: usize = 122;
/// One number for each state.
pub type State = [f64; SIZE];
/// Force of wheel w along axis a at `FORCE + 3 w + a`; wheel-carrier frame, N.
pub const FORCE: usize = 0;
/// Rate of the force, N/s; of the load without what the wheel's travel presses the tyre.
pub const RATE: usize = 12;
/// Moments of wheel w about x and z at `MOMENT + 2 w` and one further, beyond tread and trail;
/// wheel-carrier frame, about the contact point, N m.
pub const MOMENT: usize = 24;
/// Rate of strut w, mm/s.
pub const SPEED: usize = 32;
/// Length of strut w by the hard-points, mm.
pub const LENGTH: usize = 36;
/// Error of the strut's model, force of wheel w, N.
pub const STRUT: usize = 40;
/// Moment of the wheel on the spindle of axle a, N m: the mean of left and right at `TORQUE + a`, half
/// their difference, left less right, at `TORQUE + 2 + a`.
pub const TORQUE: usize = 44;
/// Number of states that the balances of forces and moments contain: those up to here.
pub const BALANCED: usize = 48;
/// Angular rate of the body, body axes, rad/s.
pub const BODY_RATE: usize = 48;
/// Remaining accelerometer bias, body axes, m/s^2.
pub const ACCEL_BIAS: usize = 51;
/// Offset of axial channel i of wheel w at `OFFSET + 5 w + i`, N.
pub const OFFSET: usize = 54;
/// Strut length less the potentiometer's reading, wheel w at `LENGTH_ERROR + w`, mm.
pub const LENGTH_ERROR: usize = 74;
/// What the mean load of wheel w since the step before has more than the line between both loads, N.
pub const BETWEEN: usize = 78;
/// Rate at which the road presses the tyre of wheel w, N/s.
pub const ROAD: usize = 82;
/// The forces one step before.
pub const BEFORE: usize = 86;
/// The forces two steps before.
pub const LAGGED: usize = 98;
/// Remaining bias of the hub accelerometer of wheel w, sensor axis a at `HUB_BIAS + 3 w + a`, m/s^2.
/// The last states: a vehicle without these sensors leaves them out.
pub const HUB_BIAS: usize = 110;
