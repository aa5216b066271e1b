//! `atvrec`: a telemetry recorder and tyre-force estimator for rugged vehicle PCs.

fn main() {}
