//! What a serial port needs of the protocol on it.

use std::time::Duration;

/// The protocol on a serial port: passes received bytes to the stream and answers with actions.
pub(crate) trait SerialProtocol: Send {
    /// The port was opened, for the first time or again.
    fn on_open(&mut self) -> Action;
    /// Bytes were received.
    fn on_bytes(&mut self, bytes: &[u8]) -> Action;
    /// The time of [`Action::wake`] has passed.
    fn on_timer(&mut self) -> Action;
    /// Bytes to write before the port is closed in good order.
    fn on_close(&mut self) -> Vec<u8>;
}

/// What the port does next.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Action {
    /// Change to this baud rate, before writing.
    pub baud: Option<u32>,
    /// Bytes to write.
    pub write: Vec<u8>,
    /// Call [`SerialProtocol::on_timer`] after this time; `None` keeps an earlier request.
    pub wake: Option<Duration>,
}
