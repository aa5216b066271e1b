//! Samples to MCAP and back: schemas, writing, reading, recovery.
