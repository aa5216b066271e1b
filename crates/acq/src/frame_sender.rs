//! Sending frames to controllers, without ever waiting for the bus.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

use sample::CanFrame;
use serialport::{SerialPort, TTYPort};
use socketcan::{CanSocket, Socket, SocketOptions};
use wire::slcan::{Command, encode_frame};

use crate::can_sender::classic;

/// Longest time for the bytes of one frame.
const WRITE_TIMEOUT: Duration = Duration::from_millis(5);
/// Time for an adapter to take a command.
const COMMAND_PAUSE: Duration = Duration::from_millis(20);

/// A port that frames are sent on. A frame that the port does not take at once is an error.
#[derive(Debug)]
pub struct FrameSender(Port);

#[derive(Debug)]
enum Port {
    Can(CanSocket),
    Slcan(Box<TTYPort>),
    Shared(File),
}

impl FrameSender {
    /// Opens a SocketCAN interface.
    ///
    /// # Errors
    /// If there is no such interface, or it cannot be opened.
    pub fn can(interface: &str) -> io::Result<Self> {
        let socket = CanSocket::open(interface)?;
        socket.set_nonblocking(true)?;
        // Frames of the bus are not read here: none shall wait in the queue of this socket.
        socket.set_filter_drop_all()?;
        Ok(Self(Port::Can(socket)))
    }

    /// Opens an SLCAN adapter and its bus.
    ///
    /// # Errors
    /// If the port cannot be opened or takes no commands.
    pub fn slcan(path: &Path, baud: u32, bit_rate: Option<u32>) -> io::Result<Self> {
        let port = serialport::new(path.to_string_lossy(), baud).timeout(WRITE_TIMEOUT);
        let mut port = TTYPort::open(&port)?;
        let bit_rate = bit_rate.map(Command::BitRate);
        let commands = [Some(Command::Close), bit_rate, Some(Command::Open)];
        port.write_all(b"\r\r\r")?;
        for line in commands.into_iter().flatten().filter_map(Command::encode) {
            std::thread::sleep(COMMAND_PAUSE);
            port.write_all(&line)?;
        }
        Ok(Self(Port::Slcan(Box::new(port))))
    }

    /// Opens the adapter of an SLCAN source for writing. The source has set it up, and reads it.
    ///
    /// # Errors
    /// If the port cannot be opened.
    pub fn shared_slcan(path: &Path) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        let options = options.write(true);
        let flags = libc::O_NOCTTY | libc::O_NONBLOCK;
        let file = options.custom_flags(flags).open(path)?;
        Ok(Self(Port::Shared(file)))
    }

    /// Sends a classic data frame.
    ///
    /// # Errors
    /// If the port takes no frame at present ([`io::ErrorKind::WouldBlock`] if its queue is full), or
    /// the frame is no classic data frame.
    pub fn send(&mut self, frame: &CanFrame) -> io::Result<()> {
        let line = || {
            let error = || io::Error::new(io::ErrorKind::InvalidInput, "no classic data frame");
            encode_frame(frame, None).ok_or_else(error)
        };
        match &mut self.0 {
            Port::Can(socket) => socket.write_frame(&classic(frame)?),
            Port::Slcan(port) => {
                discard(port);
                port.write_all(&line()?)
            }
            Port::Shared(file) => {
                let line = line()?;
                // A line of a terminal is taken as a whole or not, except on a full buffer.
                match file.write(&line)? {
                    count if count == line.len() => Ok(()),
                    _ => Err(io::ErrorKind::WouldBlock.into()),
                }
            }
        }
    }
}

/// Discards the answers and frames of an adapter, so that its buffer does not fill up.
fn discard(port: &mut TTYPort) {
    let mut buffer = [0; 512];
    while port.bytes_to_read().is_ok_and(|count| count > 0) {
        if port.read(&mut buffer).is_err() {
            return;
        }
    }
}
