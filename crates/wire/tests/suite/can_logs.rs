//! Logs of CAN frames that other programs wrote, against reference content that independent readers
//! gave.

mod blf;
mod mf4;
mod reference;
