//! Parameters of a vehicle from what it did on a drive.
//!
//! Everything here works on plain arrays on an even time grid, `NaN` where nothing is known, and
//! gives [`Findings`](crate::finding::Findings) or refuses with a [`Refusal`](crate::finding::Refusal)
//! that names what the data lack. Axes and signs are those of `sample` (ISO 8855).

pub mod against;
pub mod aligning;
mod both_wheels;
pub mod camber;
pub mod cornering;
pub mod drive;
pub mod friction;
pub mod handling;
mod inclination;
pub mod inertia;
mod method;
mod overrides;
pub mod pressure;
mod recorded;
pub mod response;
pub mod roll_centre;
pub mod roll_pitch;
pub mod signals;
pub mod slip;
pub mod toe;
pub mod tyre;
pub mod understeer;

pub use drive::Drive;
pub use method::{Identified, Method, Sense, roll_centres, swing};
pub use overrides::Overrides;
pub use recorded::{Motion, Recorded, TyreForces};
