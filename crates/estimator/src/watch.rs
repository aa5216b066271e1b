//! Whether the sensors of motion can be believed: each is held against what the others and the
//! tyres' forces make of it, so that it is known which of them is wrong.
//!
//! | sensor | witness |
//! |---|---|
//! | gyros | balance of moments |
//! | accelerometers | balance of forces |
//! | biases of both | GNSS velocity and attitude, which drift away as a jump's signature has it |
//! | GNSS velocity and attitude | the inertial unit, while the balances vouch for it |
//! | hand wheel | front slip angles that the measured lateral forces call for |
//! | wheel speeds | speed over ground of a wheel that neither drives nor brakes |

mod bias;
mod inertial;
mod receiver;
mod steering;
mod wheels;

pub use bias::BiasWatch;
pub use inertial::InertialWatch;
pub use receiver::ReceiverWatch;
pub use steering::SteeringWatch;
pub use wheels::{Rolling, WheelWatch};

/// A sensor that was found faulty or is good again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorChange {
    /// Its name, as events have it.
    pub name: &'static str,
    /// Faulty from now on.
    pub faulty: bool,
    /// What is wrong with it.
    pub why: &'static str,
}

/// What is wrong with a sensor: it contradicts.
pub const CONTRADICTS: &str = "contradicts the other sensors and is left out";
/// What is wrong with a sensor: it tells the same again and again.
pub const FROZEN: &str = "does not move at all and is left out";
/// What is wrong with a sensor: it says so itself.
pub const BAD: &str = "calls its own readings bad and is left out";
/// What is wrong with a bias.
pub const JUMPED: &str = "has jumped and is learnt anew";
