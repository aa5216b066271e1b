//! The decoders against reference decodes, mixtures and noise.

mod can_logs;
mod common;
mod crossbow440;
mod dbc_vectors;
mod devices;
mod gnss;
mod works_with;
