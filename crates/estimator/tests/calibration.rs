//! Calibration on arrays: what is put in is found, as surely as is said, and what cannot be found is
//! refused by name.

#[path = "calibration/gnss.rs"]
mod gnss;
#[path = "calibration/workshop.rs"]
mod workshop;
#[path = "calibration/zero.rs"]
mod zero;
