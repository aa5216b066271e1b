//! Calibration on arrays: what is put in is found, as surely as is said, and what cannot be found is
//! refused by name.

#[path = "identification/coverage.rs"]
mod coverage;
#[path = "calibration/gnss.rs"]
mod gnss;
#[path = "calibration/intervals.rs"]
mod intervals;
#[path = "calibration/mounting.rs"]
mod mounting;
#[path = "calibration/workshop.rs"]
mod workshop;
#[path = "calibration/zero.rs"]
mod zero;
