//! Calibration on arrays: what is put in is found, as surely as is said, and what cannot be found is
//! refused by name.

mod gnss;
mod intervals;
mod mounting;
mod workshop;
mod zero;
