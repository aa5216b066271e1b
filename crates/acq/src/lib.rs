//! The only crate that touches devices and clocks: sources, stamps, supervision.
