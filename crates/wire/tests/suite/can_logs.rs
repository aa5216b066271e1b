//! Logs of CAN frames that other programs wrote, against reference content that independent readers
//! gave.

mod blf;
mod made;
mod mf4;
mod reference;
mod text;
