//! Ports without hardware, for virtual devices.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use crate::sys;

/// The device's end of a pseudo-terminal. Nothing here blocks.
#[derive(Debug)]
pub struct VirtualPort {
    device: File,
    path: PathBuf,
}

/// What came from the program at the other end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// No program has the port open.
    Nobody,
    /// The port is open, and this many bytes came.
    Bytes(usize),
}

impl VirtualPort {
    /// Makes a pseudo-terminal.
    ///
    /// # Errors
    /// If the system has none left.
    pub fn new() -> io::Result<Self> {
        let (device, path) = sys::open_pseudo_terminal_nonblocking()?;
        Ok(Self { device, path })
    }

    /// What a program opens.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads what the program wrote.
    ///
    /// # Errors
    /// If the pseudo-terminal fails.
    pub fn read(&mut self, buffer: &mut [u8]) -> io::Result<Heard> {
        match self.device.read(buffer) {
            Ok(count) => Ok(Heard::Bytes(count)),
            Err(error) if is_waiting(&error) => Ok(Heard::Bytes(0)),
            // Linux says so when the other end is not open.
            Err(error) if error.raw_os_error() == Some(libc::EIO) => Ok(Heard::Nobody),
            Err(error) => Err(error),
        }
    }

    /// Sends bytes, as a device does: what the line cannot take is gone. Gives the number of bytes
    /// that went out.
    ///
    /// # Errors
    /// If the pseudo-terminal fails.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.device.write(bytes) {
            Ok(count) => Ok(count),
            Err(error) if is_waiting(&error) => Ok(0),
            Err(error) if error.raw_os_error() == Some(libc::EIO) => Ok(0),
            Err(error) => Err(error),
        }
    }
}

fn is_waiting(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;

    use super::*;

    #[test]
    fn an_unopened_port_has_nobody_and_an_open_one_talks() {
        let mut port = VirtualPort::new().expect("a pseudo-terminal");
        let mut buffer = [0; 16];
        let mut program = OpenOptions::new()
            .read(true)
            .write(true)
            .open(port.path())
            .expect("the port opens");
        assert_eq!(port.read(&mut buffer).expect("read"), Heard::Bytes(0));
        program.write_all(b"C\r").expect("write");
        assert_eq!(port.read(&mut buffer).expect("read"), Heard::Bytes(2));
        assert_eq!(port.write(b"ok\n").expect("write"), 3);
        drop(program);
        assert_eq!(port.read(&mut buffer).expect("read"), Heard::Nobody);
    }
}
