//! Bytes to samples and back, one protocol a file.
