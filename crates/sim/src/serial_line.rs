/// A serial line of 8 data bits, no parity, one stop bit.
pub(crate) struct SerialLine {
    byte_time_s: f64,
    free_at_s: f64,
}

impl SerialLine {
    pub(crate) fn new(baud: u32) -> Self {
        Self {
            byte_time_s: Self::byte_time_s(baud),
            free_at_s: 0.0,
        }
    }

    /// How long one byte takes, s.
    pub(crate) fn byte_time_s(baud: u32) -> f64 {
        10.0 / f64::from(baud.max(1))
    }

    /// When the last of `length` bytes that are ready at `ready_s` leaves; messages queue up.
    pub(crate) fn send(&mut self, ready_s: f64, length: usize) -> f64 {
        self.free_at_s = self.free_at_s.max(ready_s) + self.byte_time_s * length as f64;
        self.free_at_s
    }
}
