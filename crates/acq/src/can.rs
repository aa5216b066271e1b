//! SocketCAN interfaces.

use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use sample::{CanFrame, LossPlace, Notice, Payload};
use socketcan::{CanSocket, ShouldRetry as _, Socket, SocketOptions};
use tokio::sync::watch;
use tokio::time::MissedTickBehavior;

use crate::context::{SourceContext, pause, stopped};
use crate::datagram::{DropCounter, controller_event, is_controller_overflow, take_apart};
use crate::pace::{Pace, Pacer, Wake};
use crate::sys::{self, Datagrams};
use crate::{CanSpec, link};

/// Wait between two attempts to open an interface.
const REOPEN_WAIT: Duration = Duration::from_millis(200);
/// How often the interface and the drop counter are looked at, whether frames come or not.
const LOOK_PERIOD: Duration = Duration::from_millis(250);

/// Consecutive failures to bring an interface up before a warning. If the recorder may not bring it
/// up itself, the system needs some time.
const LINK_FAILURES_REPORTED: u32 = 8;

/// Flag bit of 29-bit identifiers in filters (`linux/can.h`).
const EXTENDED_FLAG: u32 = 0x8000_0000;

/// Runs a CAN source until the shutdown.
pub(crate) async fn run(
    context: &SourceContext,
    spec: &CanSpec,
    mut shutdown: watch::Receiver<bool>,
) {
    let mut last_failure = String::new();
    while !*shutdown.borrow() {
        let ended = match Session::open(context, spec) {
            Ok(mut session) => {
                last_failure.clear();
                session.run(&mut shutdown).await
            }
            Err(error) => Err(error),
        };
        match ended {
            Ok(()) => return,
            Err(error) => {
                let text = format!("{}: {}", spec.interface, explain(&error, &spec.interface));
                if text != last_failure {
                    tracing::warn!(
                        source = %context.name,
                        %text,
                        "cannot open the CAN interface; the next attempts follow"
                    );
                    context.notice(Notice::Closed(text.clone()));
                    last_failure = text;
                }
            }
        }
        if pause(REOPEN_WAIT, &mut shutdown).await {
            return;
        }
    }
}

/// What an error means and what to do about it.
fn explain(error: &io::Error, interface: &str) -> String {
    match error.raw_os_error() {
        Some(libc::ENODEV | libc::ENXIO) => {
            "the interface does not exist; connect the adapter or load its driver".to_owned()
        }
        Some(libc::ENETDOWN) => {
            format!("the interface is down; bring it up with `ip link set {interface} up`")
        }
        Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT) => {
            "the kernel has no CAN support; load the modules can and can-raw".to_owned()
        }
        _ => error.to_string(),
    }
}

/// What one system call gave.
#[derive(Clone, Copy, Default)]
struct Batch {
    frames: usize,
    /// More may be waiting.
    more: bool,
}

/// One opening of an interface.
struct Session<'a> {
    context: &'a SourceContext,
    spec: &'a CanSpec,
    socket: Arc<CanSocket>,
    wake: Wake,
    pacer: Pacer,
    settings: String,
    datagrams: Datagrams,
    drops: DropCounter,
    /// Whether the interface is up by the last notice; `None` before the first.
    up: Option<bool>,
    /// Attempts in a row to bring the interface up that failed.
    link_failures: u32,
}

impl<'a> Session<'a> {
    fn open(context: &'a SourceContext, spec: &'a CanSpec) -> io::Result<Self> {
        let socket = CanSocket::open(&spec.interface)?;
        let settings = configure(&socket, spec)?;
        let drops = DropCounter::new(kernel_drops(&socket).unwrap_or(0));
        let socket = Arc::new(socket);
        Ok(Self {
            context,
            spec,
            wake: Wake::new(&socket, Pace::Awaited)?,
            pacer: Pacer::new(Instant::now(), spec.read_within),
            socket,
            settings,
            datagrams: Datagrams::new(),
            drops,
            up: None,
            link_failures: 0,
        })
    }

    /// Reads until the shutdown (`Ok`) or until the interface is gone. One that goes down is waited
    /// for: the socket stays bound to it and its first frame is not missed.
    async fn run(&mut self, shutdown: &mut watch::Receiver<bool>) -> io::Result<()> {
        let mut look = tokio::time::interval(LOOK_PERIOD);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut stopped = std::pin::pin!(stopped(shutdown));
        loop {
            tokio::select! {
                biased;
                () = &mut stopped => break,
                _ = look.tick() => {
                    self.look().await?;
                    // Also finds an error that came between two datagrams and woke nobody.
                    self.receive_all()?;
                }
                on_timer = self.wake.wait() => {
                    on_timer?;
                    self.receive_all()?;
                }
            }
        }
        while self.receive().unwrap_or_default().more {}
        self.look_at_drops();
        self.context.notice(Notice::Closed("stopped".to_owned()));
        Ok(())
    }

    /// Takes what waits into the stream, and sets when to look again by how much it was.
    fn receive_all(&mut self) -> io::Result<()> {
        let mut count = 0;
        loop {
            let batch = self.receive()?;
            count += batch.frames;
            if !batch.more {
                break;
            }
        }
        if let Some(pace) = self.pacer.looked(Instant::now(), count) {
            self.wake = Wake::new(&self.socket, pace)?;
        }
        Ok(())
    }

    /// Takes one batch into the stream.
    fn receive(&mut self) -> io::Result<Batch> {
        let more = match self.datagrams.receive(&*self.socket) {
            Ok(more) => more,
            Err(error) if error.should_retry() => return Ok(Batch::default()),
            Err(error) if error.raw_os_error() == Some(libc::ENETDOWN) => {
                self.tell_state(false);
                return Ok(Batch::default());
            }
            Err(error) => return Err(error),
        };
        let mut frames: Vec<CanFrame> = Vec::with_capacity(self.datagrams.len());
        let (mut kernel, mut device) = (0, 0);
        for datagram in self.datagrams.iter() {
            let (frame, drops) = take_apart(&datagram);
            kernel += drops.map_or(0, |now| self.drops.since(now));
            // An overflow is at least one frame; the controller does not say how many.
            device += u64::from(frame.as_ref().is_some_and(is_controller_overflow));
            if let Some(event) = frame.as_ref().and_then(controller_event) {
                tracing::warn!(source = %self.context.name, "{event}");
            }
            frames.extend(frame);
        }
        self.context.lost(LossPlace::Kernel, kernel);
        self.context.lost(LossPlace::Device, device);
        let batch = Batch {
            frames: frames.len(),
            more,
        };
        if !frames.is_empty() {
            self.tell_state(true);
            let payload = Payload::Can(frames);
            self.context.sequencer.push(self.context.id, payload);
        }
        Ok(batch)
    }

    async fn look(&mut self) -> io::Result<()> {
        let interface = &self.spec.interface;
        let mut up = sys::interface_is_up(&*self.socket, interface)?;
        if !up && self.spec.link.is_some() {
            self.bring_up().await;
            up = sys::interface_is_up(&*self.socket, interface)?;
        }
        self.tell_state(up);
        self.look_at_drops();
        Ok(())
    }

    async fn bring_up(&mut self) {
        let Some(link) = self.spec.link else {
            return;
        };
        let interface = self.spec.interface.clone();
        // Drivers of USB adapters take their time over it.
        let task = tokio::task::spawn_blocking(move || link::bring_up(&interface, &link));
        let failure = match task.await {
            Ok(Ok(())) => {
                self.link_failures = 0;
                return;
            }
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        };
        self.link_failures = self.link_failures.saturating_add(1);
        if self.link_failures == LINK_FAILURES_REPORTED {
            tracing::warn!(source = %self.context.name, "{failure}");
        }
    }

    /// Reports dropped frames that no later frame has reported.
    fn look_at_drops(&mut self) {
        if let Some(now) = kernel_drops(&self.socket) {
            self.context.lost(LossPlace::Kernel, self.drops.since(now));
        }
    }

    /// Sends a notice if the state has changed.
    fn tell_state(&mut self, up: bool) {
        if self.up == Some(up) {
            return;
        }
        self.up = Some(up);
        let interface = &self.spec.interface;
        if up {
            let text = format!("{interface}, {}", self.settings);
            tracing::info!(source = %self.context.name, interface = %text, "opened");
            self.context.notice(Notice::Opened(text));
        } else {
            let down = io::Error::from_raw_os_error(libc::ENETDOWN);
            let text = format!("{interface}: {}", explain(&down, interface));
            tracing::warn!(source = %self.context.name, "{text}");
            self.context.notice(Notice::Closed(text));
        }
    }
}

/// Sets a socket up and says how, in words.
fn configure(socket: &CanSocket, spec: &CanSpec) -> io::Result<String> {
    socket.set_nonblocking(true)?;
    if !spec.filters.is_empty() {
        let filters: Vec<_> = spec.filters.iter().map(kernel_filter).collect();
        socket.set_filters(&filters)?;
    }
    if spec.errors {
        socket.set_error_filter_accept_all()?;
    }
    if spec.fd {
        socket.set_socket_option_int(libc::SOL_CAN_RAW, libc::CAN_RAW_FD_FRAMES, 1)?;
    }
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, 1)?;
    socket.set_recv_timestamp(true)?;
    let hardware = spec.hardware_stamps && socket.has_hw_timestamps();
    if hardware {
        let flags = libc::SOF_TIMESTAMPING_RX_HARDWARE
            | libc::SOF_TIMESTAMPING_RAW_HARDWARE
            | libc::SOF_TIMESTAMPING_OPT_CMSG;
        socket.set_timestamping(flags)?;
    }
    let queue = enlarge_queue(socket, spec)?;
    let stamps = if hardware {
        "kernel and hardware"
    } else {
        "kernel"
    };
    Ok(format!("queue of {queue} bytes, {stamps} stamps"))
}

fn kernel_filter(filter: &crate::CanFilter) -> socketcan::CanFilter {
    // The flag is part of the mask, so that identifiers of the other length do not match.
    let id = filter.id | if filter.extended { EXTENDED_FLAG } else { 0 };
    socketcan::CanFilter::new(id, filter.mask | EXTENDED_FLAG)
}

/// Asks for the receive queue, beyond the system's limit where this process may, and returns the
/// size that it got.
fn enlarge_queue(socket: &CanSocket, spec: &CanSpec) -> io::Result<usize> {
    let wanted = i32::try_from(spec.receive_buffer_bytes).unwrap_or(i32::MAX);
    let forced = socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUFFORCE, wanted);
    if forced.is_err() {
        socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF, wanted)?;
    }
    let got = socket.get_socket_option_int(libc::SOL_SOCKET, libc::SO_RCVBUF)?;
    // The kernel doubles what is asked for, to pay for its own bookkeeping.
    let got = usize::try_from(got).unwrap_or(0) / 2;
    if got < spec.receive_buffer_bytes {
        tracing::warn!(
            interface = %spec.interface,
            wanted,
            got,
            "the receive queue of the kernel is smaller than configured; raise net.core.rmem_max \
             or grant CAP_NET_ADMIN"
        );
    }
    Ok(got)
}

/// The socket's drop counter as it is now.
fn kernel_drops(socket: &CanSocket) -> Option<u32> {
    const SO_MEMINFO: i32 = 55;
    const DROPS_INDEX: usize = 8;
    let mut words = [0_u8; 4 * (DROPS_INDEX + 1)];
    let read = socket.get_socket_option_bytes(libc::SOL_SOCKET, SO_MEMINFO, &mut words);
    let length = read.ok()?;
    let word = words.get(..length)?.get(4 * DROPS_INDEX..)?.first_chunk()?;
    Some(u32::from_ne_bytes(*word))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CanFilter;

    #[test]
    fn filters_keep_identifiers_of_the_other_length_out() {
        let extended = kernel_filter(&CanFilter {
            id: 0x123,
            mask: 0x7FF,
            extended: true,
        });
        let raw: &libc::can_filter = extended.as_ref();
        assert_eq!((raw.can_id, raw.can_mask), (0x8000_0123, 0x8000_07FF));
        let standard = kernel_filter(&CanFilter {
            id: 0x123,
            mask: 0x7FF,
            extended: false,
        });
        let raw: &libc::can_filter = standard.as_ref();
        assert_eq!((raw.can_id, raw.can_mask), (0x123, 0x8000_07FF));
    }

    #[test]
    fn errors_come_with_a_remedy() {
        for code in [libc::ENODEV, libc::ENETDOWN, libc::EAFNOSUPPORT] {
            let text = explain(&io::Error::from_raw_os_error(code), "can7");
            assert!(text.contains(';'), "{text}");
        }
    }
}
