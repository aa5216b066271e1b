//! The virtual vehicle: the model's motion as each sensor's own bytes.
