//! What the vehicle did: forces, motion, events, calibration and identification from samples.
