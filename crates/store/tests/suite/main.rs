//! Logs from outside: written, read, damaged and recovered.

mod common;
mod compat;
mod damage;
mod generated;
mod integrity;
mod others;
mod recorder;
mod recovery;
mod round_trip;
