//! Identification on drives whose truth is known: the four-wheel model's with the noise of the
//! thesis's sensors, and the independent simulator's.

mod coverage;
mod rides;
#[path = "../truth/run.rs"]
#[allow(
    dead_code,
    clippy::unwrap_used,
    reason = "shared with the tests of the forces"
)]
mod run;

mod cornering;
mod independent;
mod others;
