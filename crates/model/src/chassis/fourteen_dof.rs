//! The 14-degree-of-freedom model: six of the body, four of the wheels' travel, four of their
//! spin. A wheel really lifts: tyres push only, stops touch and let go.
//!
//! The thesis stops at the four-wheel model, whose load transfer (equations 2.13, 2.14) gives
//! negative loads once a wheel is up (section 4.2.3); clamping them breaks the moment balance.
//! Section 2.2.3 asks for the full car and prints no equations; they are derived here.
//!
//! Body axes stand at the centre of gravity of the sprung part. Wheel i is a mass m_i at
//! r_i = r_0i + e_i s_i + (T(delta_i) - 1) c_i: jounce s_i goes along the path e_i of its contact
//! point (e_z = 1; its lateral slope is what gives the axle its roll centre), and steering turns it
//! by T on the arm c_i. Jounce and steer incline it besides. With a_0 = v' + omega x v,
//! A_i = a_0 + alpha x r_i + omega x (omega x r_i) + 2 omega x e_i s_i' and P_i = 1 - e e'/(e'e):
//!
//! | equation | what |
//! |---|---|
//! | m_i (e'e) s_i'' = e_i.(F_i + m_i g - m_i A_i) - S_i | wheel travel |
//! | m_s a_0 + sum m_i P_i A_i = m_s g + sum (P_i (F_i + m_i g) + e_i S_i/(e'e)) | force |
//! | I alpha + omega x I omega + sum r_i x m_i P_i A_i = sum (rho_i x F_i + M_i - L_i' + r_i x (m_i g - e e'(F_i + m_i g)/(e'e) + e_i S_i/(e'e))) | moment |
//! | I_w omega_i' = T_i - F_x R - brake and rolling resistance | spin |
//!
//! F_i is the ground's force at the contact point rho_i, S_i the force of strut and bar referred
//! to jounce (with the motion ratio that the hard-points give at that jounce), L_i the wheel's spin
//! momentum with its gyroscopic part. Of the two body equations, the force's is solved for a_0,
//! whose matrix m_s + sum m_i P_i is constant, and put into the moment's; nothing is allocated.

mod dynamics;
mod model;
mod parameters;
mod rest;
mod state;
mod steps;
#[cfg(test)]
mod tests;
mod vector;

pub use model::{Outputs, derivative, guards, jacobian, outputs};
pub use parameters::{CornerParameters, Parameters, StrutParameters};
pub use rest::at_rest;
pub use state::{INPUTS, Inputs, STATES, State};
pub(crate) use steps::{advance, stepped};
