//! The estimator from outside.
//!
//! Seeds 1 to 4 are for scoring. Tests that a change of the estimator is tuned on use seeds from 11.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's helpers stand outside its functions"
)]

mod accuracy;
mod calibration;
mod campaign;
mod car;
mod cost;
mod coverage;
mod fault;
mod filter_spec;
mod golden;
mod identification;
mod inertial_forces;
mod latency;
mod limits;
mod matrix;
mod mistakes;
mod motion_faults;
mod road;
mod robust;
mod second_filter;
mod sensitivity;
mod slippery;
mod smoother;
mod subsets;
mod terrain;
mod truth;
mod turning;
mod units;
mod workshop;

#[global_allocator]
static COUNTING: testkit::Counting = testkit::Counting;

/// Truth runs on the road; the jackstand run is apart.
const RUNS: [&str; 4] = ["b_circle", "c_sine03", "d_sine_mu", "f_launch_brake"];
