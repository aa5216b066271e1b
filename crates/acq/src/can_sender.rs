//! Sending frames, for virtual devices.

use std::io;

use sample::CanFrame;
use socketcan::{CanSocket, EmbeddedFrame, ExtendedId, Id, Socket, StandardId};

/// A SocketCAN interface that frames are sent on.
#[derive(Debug)]
pub struct CanSender {
    socket: CanSocket,
}

impl CanSender {
    /// Opens an interface, such as `vcan0`.
    ///
    /// # Errors
    /// If there is no such interface, or it cannot be opened.
    pub fn open(interface: &str) -> io::Result<Self> {
        Ok(Self {
            socket: CanSocket::open(interface)?,
        })
    }

    /// Sends a classic data frame; waits while the interface's queue is full.
    ///
    /// # Errors
    /// If the frame is no classic data frame, or the interface fails.
    pub fn send(&mut self, frame: &CanFrame) -> io::Result<()> {
        self.socket.write_frame_insist(&classic(frame)?)
    }
}

/// The frame for the socket.
pub(crate) fn classic(frame: &CanFrame) -> io::Result<socketcan::CanFrame> {
    let id = if frame.flags.extended {
        ExtendedId::new(frame.id).map(Id::Extended)
    } else {
        u16::try_from(frame.id)
            .ok()
            .and_then(StandardId::new)
            .map(Id::Standard)
    };
    let made = id.and_then(|id| socketcan::CanFrame::new(id, frame.bytes()));
    made.ok_or_else(|| {
        io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("{frame:?} is no classic data frame"),
        )
    })
}
