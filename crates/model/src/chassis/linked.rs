//! The 14-degree-of-freedom vehicle on its linkages and on any ground.
//!
//! Six degrees of freedom of the body, four strut lengths l_i and four spins. Other than
//! [`fourteen_dof`](super::fourteen_dof), every outboard part moves along the path that the hard-points
//! give it, so that its mass accelerates with l'', and the ground is asked for the contact of each
//! tyre ([`Ground`](crate::road::Ground)). Vehicles without hard-points have a straight path.
//!
//! Kane's equations in body axes at the sprung part's centre of gravity. A part j of corner i with
//! mass m, inertia I (about its own centre of gravity, the wheel's without spin) and centre of
//! gravity r has the velocity v + w x r + r_l l' + r_z z' and the rate w_j = w + w_l l' + w_z z'. With
//! a = v' + w x v,
//!
//! a_j = a + w' x r + r_l l'' + b_j, b_j = w x (w x r) + 2 w x r' + r_z z'' + (second derivatives)
//!
//! w_j' = w' + w_l l'' + c_j, c_j = w x (w_l l' + w_z z') + w_z z'' + (second derivatives)
//!
//! | equation | what |
//! |---|---|
//! | m_s a + sum m a_j = sum F | force |
//! | I_s w' + w x I_s w + sum (r x m a_j + I w_j' + w_j x I w_j + I_w s_i w_j x s) = sum (p x F + M) | moment |
//! | sum (r_l m a_j + w_l (I w_j' + w_j x I w_j + I_w s_i w_j x s)) = F_s + F p_l + M w_l - bar | strut length |
//! | I_w s_i' = M s + drive - brake | spin |
//!
//! s is the spindle, s_i the wheel's whole rate about it, p the wheel centre, F the force of the
//! ground and M its moment about the wheel centre across the spindle, F_s the force of spring, damper
//! and stops. The four equations of the struts are solved for l'' and put into the six of the body.
//!
//! The tyre's load is c_z depth + d_z (approach along the ground's normal), never negative, along
//! that normal. The forces act at the contact point, in the wheel plane at the unloaded radius less
//! the depth; the tread's tilt against the ground adds its overturning moment.

mod balance;
mod dynamics;
mod members;
mod parameters;
mod rest;
mod state;
#[cfg(test)]
mod tests;
mod tyres;

pub use balance::{Momentum, energy_j, momentum};
pub use dynamics::{Outputs, WheelOutputs, outputs, step};
pub use members::{Carried, carried};
pub use parameters::{Corner, Parameters, Suspension};
pub use rest::at_rest;
pub use state::{Inputs, STATES, State};
