//! The system calls that no safe crate wraps. Everything `unsafe` of this crate is in this file.
#![allow(unsafe_code)]

use std::fs::File;
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsRawFd, BorrowedFd, FromRawFd, OwnedFd};
use std::sync::Arc;
use std::time::Duration;

use libc::{c_int, c_uchar, c_uint, c_ulong, c_ushort};
use socketcan::CanSocket;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

/// `ASYNC_LOW_LATENCY` of `linux/tty_flags.h`.
const LOW_LATENCY: c_int = 1 << 13;

/// `struct serial_struct` of `linux/serial.h`.
#[repr(C)]
#[derive(Clone, Copy)]
struct SerialStruct {
    kind: c_int,
    line: c_int,
    port: c_uint,
    irq: c_int,
    flags: c_int,
    xmit_fifo_size: c_int,
    custom_divisor: c_int,
    baud_base: c_int,
    close_delay: c_ushort,
    io_type: c_uchar,
    reserved: c_uchar,
    hub6: c_int,
    closing_wait: c_ushort,
    closing_wait2: c_ushort,
    iomem_base: *mut c_uchar,
    iomem_reg_shift: c_ushort,
    port_high: c_uint,
    iomap_base: c_ulong,
}

/// `struct serial_icounter_struct` of `linux/serial.h`: what a UART counted since it was set up.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UartCounters {
    cts: c_int,
    dsr: c_int,
    rng: c_int,
    dcd: c_int,
    rx: c_int,
    tx: c_int,
    frame: c_int,
    overrun: c_int,
    parity: c_int,
    brk: c_int,
    buf_overrun: c_int,
    reserved: [c_int; 9],
}

impl UartCounters {
    /// Bytes lost since `earlier`: overruns of the UART and of the driver's buffer.
    pub fn overruns_since(&self, earlier: &Self) -> u64 {
        let uart = self.overrun.wrapping_sub(earlier.overrun).max(0);
        let buffer = self.buf_overrun.wrapping_sub(earlier.buf_overrun).max(0);
        u64::from(uart.unsigned_abs()) + u64::from(buffer.unsigned_abs())
    }

    /// Bytes with a framing or parity error since `earlier`: a wrong baud rate or a bad line.
    pub fn line_errors_since(&self, earlier: &Self) -> u64 {
        let frame = self.frame.wrapping_sub(earlier.frame).max(0);
        let parity = self.parity.wrapping_sub(earlier.parity).max(0);
        u64::from(frame.unsigned_abs()) + u64::from(parity.unsigned_abs())
    }
}

/// Asks the driver of a serial port to hand over bytes at once. Pseudo-terminals and many drivers
/// answer that they do not know the request.
pub fn set_low_latency(port: &impl AsRawFd) -> io::Result<()> {
    let mut serial = MaybeUninit::<SerialStruct>::zeroed();
    // SAFETY: `port` keeps its descriptor open during the call; TIOCGSERIAL writes one
    // serial_struct, which `serial` has the size and layout of.
    check(unsafe { libc::ioctl(port.as_raw_fd(), libc::TIOCGSERIAL, serial.as_mut_ptr()) })?;
    // SAFETY: zeroed above, and all of its fields are valid for every bit pattern.
    let mut serial = unsafe { serial.assume_init() };
    serial.flags |= LOW_LATENCY;
    // SAFETY: as above; TIOCSSERIAL only reads the structure.
    check(unsafe { libc::ioctl(port.as_raw_fd(), libc::TIOCSSERIAL, &raw const serial) })?;
    Ok(())
}

/// Reads the counters of a UART. Pseudo-terminals have none.
pub fn uart_counters(port: &impl AsRawFd) -> io::Result<UartCounters> {
    let mut counters = UartCounters::default();
    // SAFETY: `port` keeps its descriptor open during the call; TIOCGICOUNT writes one
    // serial_icounter_struct, which `counters` has the size and layout of.
    check(unsafe { libc::ioctl(port.as_raw_fd(), libc::TIOCGICOUNT, &raw mut counters) })?;
    Ok(counters)
}

/// Takes the advisory lock that keeps a second program from the same port; `false` if another
/// holds it. The lock ends when `port` is closed.
pub fn lock_port(port: &impl AsRawFd) -> io::Result<bool> {
    // SAFETY: `port` keeps its descriptor open during the call, and the borrow ends before it.
    let borrowed = unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) };
    let file = File::from(borrowed.try_clone_to_owned()?);
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(std::fs::TryLockError::WouldBlock) => Ok(false),
        Err(std::fs::TryLockError::Error(error)) => Err(error),
    }
}

/// Most bytes of a datagram of a CAN socket: `struct canfd_frame`.
const FRAME_BYTES: usize = 72;
/// Room for the control messages of one datagram: stamps and drop counter take 104 bytes.
const CONTROL_BYTES: usize = 256;

/// Memory for one datagram. The alignment is that of `cmsghdr`.
#[repr(C, align(8))]
#[derive(Clone, Copy)]
struct Slot {
    control: [u8; CONTROL_BYTES],
    frame: [u8; FRAME_BYTES],
    control_len: usize,
    frame_len: usize,
    flags: c_int,
}

/// Datagrams received with one system call.
pub struct Datagrams {
    slots: Box<[Slot]>,
    count: usize,
}

/// One datagram.
pub struct Datagram<'a> {
    /// Its bytes.
    pub data: &'a [u8],
    /// Its control messages.
    pub control: &'a [u8],
    /// `MSG_*` flags.
    pub flags: c_int,
}

impl Datagrams {
    /// The most that a call takes: each place costs time, used or not, and a call that fills them
    /// all is followed by another one.
    const FEW: usize = 4;
    const SOME: usize = 16;
    const CAPACITY: usize = 64;

    pub fn new() -> Self {
        let empty = Slot {
            control: [0; CONTROL_BYTES],
            frame: [0; FRAME_BYTES],
            control_len: 0,
            frame_len: 0,
            flags: 0,
        };
        Self {
            slots: vec![empty; Self::CAPACITY].into_boxed_slice(),
            count: 0,
        }
    }

    /// Takes what waits on `socket`, without waiting for more; `true` if more may be waiting.
    pub fn receive(&mut self, socket: &impl AsRawFd) -> io::Result<bool> {
        // About as many come as the last time; one more is no surprise.
        let likely = std::mem::take(&mut self.count) + 1;
        let most = if likely < Self::FEW {
            self.count = self.receive_most::<{ Self::FEW }>(socket)?;
            Self::FEW
        } else if likely < Self::SOME {
            self.count = self.receive_most::<{ Self::SOME }>(socket)?;
            Self::SOME
        } else {
            self.count = self.receive_most::<{ Self::CAPACITY }>(socket)?;
            Self::CAPACITY
        };
        Ok(self.count == most)
    }

    #[allow(
        clippy::unnecessary_cast,
        reason = "the C libraries differ in these types"
    )]
    fn receive_most<const MOST: usize>(&mut self, socket: &impl AsRawFd) -> io::Result<usize> {
        // SAFETY: zero is a valid value of all fields of both structures: null pointers, no names.
        let mut parts: [libc::iovec; MOST] = unsafe { std::mem::zeroed() };
        // SAFETY: as above.
        let mut headers: [libc::mmsghdr; MOST] = unsafe { std::mem::zeroed() };
        for ((slot, part), header) in self.slots.iter_mut().zip(&mut parts).zip(&mut headers) {
            part.iov_base = slot.frame.as_mut_ptr().cast();
            part.iov_len = FRAME_BYTES;
            header.msg_hdr.msg_iov = part;
            header.msg_hdr.msg_iovlen = 1;
            header.msg_hdr.msg_control = slot.control.as_mut_ptr().cast();
            header.msg_hdr.msg_controllen = CONTROL_BYTES as _;
        }
        // SAFETY: `socket` keeps its descriptor open during the call; each of the MOST headers
        // points to one part and one control buffer with their true sizes, which live in `parts`
        // and `self.slots`, neither of them moved or read before the call returns.
        let count = check(unsafe {
            libc::recvmmsg(
                socket.as_raw_fd(),
                headers.as_mut_ptr(),
                MOST as c_uint,
                libc::MSG_DONTWAIT as _,
                std::ptr::null_mut(),
            )
        })?;
        let count = usize::try_from(count).unwrap_or(0);
        for (slot, header) in self.slots.iter_mut().zip(&headers[..count]) {
            slot.frame_len = (header.msg_len as usize).min(FRAME_BYTES);
            slot.control_len = (header.msg_hdr.msg_controllen as usize).min(CONTROL_BYTES);
            slot.flags = header.msg_hdr.msg_flags;
        }
        Ok(count)
    }

    /// How many the last call received.
    pub fn len(&self) -> usize {
        self.count
    }

    /// What the last call received, in order.
    pub fn iter(&self) -> impl Iterator<Item = Datagram<'_>> {
        self.slots[..self.count].iter().map(|slot| Datagram {
            data: &slot.frame[..slot.frame_len],
            control: &slot.control[..slot.control_len],
            flags: slot.flags,
        })
    }
}

/// Watches a socket for data, and for errors: an interface that goes down wakes without data.
pub fn watch_socket(socket: Arc<CanSocket>) -> io::Result<AsyncFd<Arc<CanSocket>>> {
    // SAFETY: the socket owns its descriptor, gives the same one at every call and closes it only
    // when its last owner drops it, which `AsyncFd` does after it has stopped watching.
    let watched =
        unsafe { AsyncFd::register_with_interest(socket, Interest::READABLE | Interest::ERROR) };
    Ok(watched?)
}

/// A timer that can be read once every `period`, first at once, then at multiples of the period on
/// the monotonic clock, so that timers of like periods go off together.
pub fn watch_timer(period: Duration) -> io::Result<AsyncFd<OwnedFd>> {
    let flags = libc::TFD_NONBLOCK | libc::TFD_CLOEXEC;
    // SAFETY: timerfd_create has no memory arguments.
    let timer = check(unsafe { libc::timerfd_create(libc::CLOCK_MONOTONIC, flags) })?;
    // SAFETY: the descriptor was made above and nothing else owns it.
    let timer = unsafe { OwnedFd::from_raw_fd(timer) };
    // SAFETY: zero is a valid value of all of its fields.
    let mut times: libc::itimerspec = unsafe { std::mem::zeroed() };
    times.it_interval.tv_sec = period.as_secs() as _;
    times.it_interval.tv_nsec = period.subsec_nanos() as _;
    // Long ago: one period after the machine started.
    times.it_value = times.it_interval;
    // SAFETY: `timer` is open; timerfd_settime only reads the structure.
    check(unsafe {
        libc::timerfd_settime(
            timer.as_raw_fd(),
            libc::TFD_TIMER_ABSTIME,
            &raw const times,
            std::ptr::null_mut(),
        )
    })?;
    // SAFETY: the descriptor is owned, and closed after `AsyncFd` has stopped watching it.
    let watched = unsafe { AsyncFd::register_with_interest(timer, Interest::READABLE) };
    Ok(watched?)
}

/// Lets a timer that went off go on. The kernel winds it up with this read.
pub fn read_timer(timer: &OwnedFd) -> io::Result<()> {
    let mut times = 0_u64;
    // SAFETY: `timer` is open; a timer gives eight bytes, which `times` has room for.
    let read = unsafe {
        libc::read(
            timer.as_raw_fd(),
            (&raw mut times).cast(),
            size_of_val(&times),
        )
    };
    let error = io::Error::last_os_error();
    // It has been read since it told that it went off.
    if read >= 0 || error.kind() == io::ErrorKind::WouldBlock {
        Ok(())
    } else {
        Err(error)
    }
}

/// Whether a network interface is up. An error if there is none of this name.
pub fn interface_is_up(socket: &impl AsRawFd, interface: &str) -> io::Result<bool> {
    // SAFETY: zero is a valid value of all of its fields.
    let mut request: libc::ifreq = unsafe { std::mem::zeroed() };
    if interface.len() >= request.ifr_name.len() {
        return Err(io::Error::from_raw_os_error(libc::ENODEV));
    }
    for (to, from) in request.ifr_name.iter_mut().zip(interface.bytes()) {
        *to = from as libc::c_char;
    }
    // SAFETY: `socket` keeps its descriptor open during the call; SIOCGIFFLAGS reads the name,
    // which ends with a zero, and writes the flags within `request`.
    check(unsafe {
        libc::ioctl(
            socket.as_raw_fd(),
            libc::SIOCGIFFLAGS as _,
            &raw mut request,
        )
    })?;
    // SAFETY: SIOCGIFFLAGS succeeded, so this is the field of the union that was written.
    let flags = unsafe { request.ifr_ifru.ifru_flags };
    Ok(c_int::from(flags) & libc::IFF_UP != 0)
}

/// A pseudo-terminal: the device's end, and the path of the end that a program opens.
#[cfg(test)]
pub fn open_pseudo_terminal() -> io::Result<(File, std::path::PathBuf)> {
    pseudo_terminal(0)
}

/// A pseudo-terminal whose device's end never blocks, and the path of the end that a program opens.
pub fn open_pseudo_terminal_nonblocking() -> io::Result<(File, std::path::PathBuf)> {
    pseudo_terminal(libc::O_NONBLOCK)
}

/// Size of the file system that holds a path, and what an unprivileged user may still write, in
/// bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiskSpace {
    /// Size of the file system.
    pub total_bytes: u64,
    /// Free for an unprivileged user.
    pub free_bytes: u64,
}

/// Space of the file system that holds `path`.
///
/// # Errors
/// If the path does not exist or the file system gives no figures.
pub fn disk_space(path: &std::path::Path) -> io::Result<DiskSpace> {
    use std::os::unix::ffi::OsStrExt;

    let path = std::ffi::CString::new(path.as_os_str().as_bytes())?;
    let mut status = MaybeUninit::<libc::statvfs>::zeroed();
    // SAFETY: `path` is a string with its end mark; statvfs writes one structure.
    check(unsafe { libc::statvfs(path.as_ptr(), status.as_mut_ptr()) })?;
    // SAFETY: statvfs succeeded.
    let status = unsafe { status.assume_init() };
    #[allow(
        clippy::unnecessary_cast,
        reason = "the C libraries differ in these types"
    )]
    let bytes = |blocks| (blocks as u64).saturating_mul(status.f_frsize as u64);
    Ok(DiskSpace {
        total_bytes: bytes(status.f_blocks),
        free_bytes: bytes(status.f_bavail),
    })
}

/// Gives the calling thread the processor and the disk only while no other thread wants them
/// (`SCHED_IDLE`, idle I/O class).
///
/// # Errors
/// If the system refuses, as a system call filter may; the thread then runs on as before.
pub fn run_at_idle_priority() -> io::Result<()> {
    /// `IOPRIO_WHO_PROCESS` of `linux/ioprio.h`; process 0 is the calling thread.
    const WHO_PROCESS: c_int = 1;
    /// `IOPRIO_CLASS_IDLE` in the place of the class.
    const CLASS_IDLE: c_int = 3 << 13;
    // SAFETY: all fields of the structure are integers.
    let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
    parameters.sched_priority = 0;
    // SAFETY: sched_setscheduler reads one structure; 0 is the calling thread.
    check(unsafe { libc::sched_setscheduler(0, libc::SCHED_IDLE, &raw const parameters) })?;
    // SAFETY: ioprio_set takes three integers.
    let result = unsafe { libc::syscall(libc::SYS_ioprio_set, WHO_PROCESS, 0, CLASS_IDLE) };
    check(result as c_int).map(drop)
}

/// Whether the kernel says that the wall clock is synchronised to a reference (NTP, PTP, GNSS).
///
/// # Errors
/// If the system refuses to say, as a system call filter may.
pub fn clock_is_synchronised() -> io::Result<bool> {
    // SAFETY: all fields of the structure are integers; no mode bit asks for no change.
    let mut state: libc::timex = unsafe { std::mem::zeroed() };
    // SAFETY: adjtimex writes one structure.
    let answer = check(unsafe { libc::adjtimex(&raw mut state) })?;
    Ok(answer != libc::TIME_ERROR && state.status & libc::STA_UNSYNC == 0)
}

/// No line discipline: bytes pass as they are, before a program has set the port up too.
fn make_raw(terminal: &File) -> io::Result<()> {
    let descriptor = terminal.as_raw_fd();
    let mut settings = MaybeUninit::<libc::termios>::zeroed();
    // SAFETY: the descriptor is open; tcgetattr writes one termios.
    check(unsafe { libc::tcgetattr(descriptor, settings.as_mut_ptr()) })?;
    // SAFETY: tcgetattr succeeded; the two calls change and read that structure only.
    check(unsafe {
        libc::cfmakeraw(settings.as_mut_ptr());
        libc::tcsetattr(descriptor, libc::TCSANOW, settings.as_ptr())
    })?;
    Ok(())
}

fn pseudo_terminal(flags: c_int) -> io::Result<(File, std::path::PathBuf)> {
    use std::ffi::CStr;
    use std::os::fd::FromRawFd;

    let flags = flags | libc::O_RDWR | libc::O_NOCTTY | libc::O_CLOEXEC;
    // SAFETY: posix_openpt has no memory arguments.
    let descriptor = check(unsafe { libc::posix_openpt(flags) })?;
    // SAFETY: the descriptor was made above and nothing else owns it.
    let device = unsafe { File::from_raw_fd(descriptor) };
    let mut name = [0_i8; 128].map(|zero| zero as libc::c_char);
    make_raw(&device)?;
    // SAFETY: `device` is open; ptsname_r writes at most `name.len()` bytes, its end mark included.
    unsafe {
        check(libc::grantpt(descriptor))?;
        check(libc::unlockpt(descriptor))?;
        check(-libc::ptsname_r(descriptor, name.as_mut_ptr(), name.len()).abs())?;
    }
    // SAFETY: ptsname_r succeeded, so `name` holds a string with its end mark.
    let path = unsafe { CStr::from_ptr(name.as_ptr()) };
    let path = path.to_string_lossy().into_owned();
    Ok((device, path.into()))
}

fn check(result: c_int) -> io::Result<c_int> {
    if result < 0 {
        Err(io::Error::last_os_error())
    } else {
        Ok(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uart_counters_give_what_was_lost_since() {
        let earlier = UartCounters {
            overrun: c_int::MAX,
            frame: 3,
            ..UartCounters::default()
        };
        let now = UartCounters {
            overrun: c_int::MIN + 1,
            buf_overrun: 4,
            frame: 5,
            parity: 1,
            ..UartCounters::default()
        };
        assert_eq!(now.overruns_since(&earlier), 6);
        assert_eq!(now.line_errors_since(&earlier), 3);
        // A driver that was loaded again counts from zero.
        assert_eq!(UartCounters::default().line_errors_since(&now), 0);
    }

    #[test]
    fn pseudo_terminals_have_no_uart() {
        let (device, _) = open_pseudo_terminal().expect("a pseudo-terminal");
        assert!(uart_counters(&device).is_err());
        assert!(set_low_latency(&device).is_err());
    }
}
