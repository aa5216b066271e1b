//! Sources through the public interface.

mod ports;
mod vcan;
