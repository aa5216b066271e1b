//! The Python package `atvrec`: thin wrappers of the model and the log reader.
