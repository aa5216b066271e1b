//! Monitors of the motion sensors. Each sensor is compared with the other sensors and with the tyre
//! forces, so that the faulty one of two is known.
//!
//! | sensor | compared with |
//! |---|---|
//! | gyros | balance of moments |
//! | accelerometers | balance of forces |
//! | biases of both | GNSS velocity and attitude, whose innovations follow a jump's signature |
//! | GNSS velocity and attitude | inertial unit, while the balances confirm it |
//! | steering wheel | front slip angles that the measured lateral forces imply |
//! | steering wheel, GNSS attitude | their own noise, which changes each reading |
//! | wheel speeds | speed over ground of a wheel without drive or brake force |
//! | axes of the hub accelerometers | gravity |

mod bias;
mod hub;
mod inertial;
mod receiver;
mod steering;
mod stuck;
mod wheels;

pub use bias::BiasWatch;
pub use hub::HubWatch;
pub use inertial::InertialWatch;
pub use receiver::ReceiverWatch;
pub use steering::SteeringWatch;
pub use stuck::{Repeats, Stuck};
pub use wheels::{Rolling, WheelWatch};

/// Change of a sensor between good and faulty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorChange {
    /// Name of the sensor in events.
    pub name: &'static str,
    /// Faulty from now on.
    pub faulty: bool,
    /// The fault.
    pub why: &'static str,
}

/// Fault: innovations beyond the gate.
pub const CONTRADICTS: &str = "contradicts the other sensors and is left out";
/// Fault: identical readings.
pub const FROZEN: &str = "does not move at all and is left out";
/// Fault: the sensor marks its readings as invalid.
pub const BAD: &str = "calls its own readings bad and is left out";
/// Fault: a bias has jumped.
pub const JUMPED: &str = "has jumped and is learnt anew";
