//! The non-linear four-wheel model: planar motion, roll, pitch, lateral and longitudinal load
//! transfer, road bank and grade, wheel spin and tyre relaxation.
//!
//! It is the model of section 2.1.2 of the thesis with its errors put right. ISO 8855 throughout;
//! wheels i at (x_i, y_i), left y > 0, turned by delta_i.
//!
//! | equation here | thesis | difference |
//! |---|---|---|
//! | m(v' + u r) - m_s h_s phi'' = sum F_y - m g sin(bank) | 2.6 | y'' meant v' + u r; F_yFL stood for F_yRL; sprung mass coupling |
//! | I_z r' - I_xz phi'' = sum(x_i F_yi - y_i F_xi), forces turned by delta_i | 2.7 | signs of -a F_x sin(delta) and of the rear track's term |
//! | tan(alpha_i + delta_i) = (v + r x_i)/(u - r y_i) | 2.9 | atan2, ISO signs |
//! | (I_x + m_s h_s^2) phi'' - I_xz r' = m_s h_s (v' + u r + g sin(bank)) + m_s g h_s sin(phi) - K_phi phi - B_phi phi' | 2.10 | phi was missing after K_phi, sprung mass, inertia about the roll axis |
//! | dN_i t_i = K_phi,i phi + B_phi,i phi' + (F_y,i - m_u,i a_y) h_r,i + m_u,i a_y h_u,i | 2.11, 2.13, 2.14 | phi, mass of the axle, unsprung term; the bar is part of K_phi |
//! | (I_y + m_s h_p^2) theta'' = -m_s h_p (u' - v r - g sin(grade)) + m_s g h_p sin(theta) - K_theta theta - B_theta theta' | 2.15 | x'' = u' - v r, arm above the pitch centre |
//! | N_f = m g b/L + (K_theta theta + B_theta theta' - sum F_x h_pc)/L | - | absent in the thesis |
//!
//! Bank and grade turn as roll and pitch do: right side down and nose down are positive.
//!
//! Loads and forces depend on each other through the roll and pitch centres' heights; the loop is
//! closed by a fixed number of passes from a start that is exact in steady turning, so that the
//! model has the same cost and the same derivative everywhere. Where a wheel would pull, its load
//! is held at zero and taken off its neighbour, which keeps vertical balance but not the roll
//! balance: for wheel lift use the 14-degree-of-freedom model.

mod constants;
mod contacts;
mod dynamics;
mod model;
mod motion;
mod parameters;
mod state;
mod steady;
mod steps;
#[cfg(test)]
mod tests;

pub use model::{Outputs, derivative, jacobian, outputs, tyre_forces};
pub use parameters::{AxleParameters, Parameters};
pub use state::{INPUTS, Inputs, Pose, STATES, State};
pub use steady::{Drive, SteadyState, steady_turn};
pub(crate) use steps::{advance, stepped};
