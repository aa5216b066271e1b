//! GPS time.
