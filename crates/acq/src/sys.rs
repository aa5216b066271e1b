//! The system calls that no safe crate wraps. Everything `unsafe` of this crate is in this file.
#![allow(unsafe_code)]

use std::fs::File;
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsRawFd, BorrowedFd};

use libc::{c_int, c_uchar, c_uint, c_ulong, c_ushort};

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

/// A pseudo-terminal in raw mode: the device's end, and the path of the end that a program opens.
#[cfg(test)]
pub fn open_pseudo_terminal() -> io::Result<(File, std::path::PathBuf)> {
    use std::ffi::CStr;
    use std::os::fd::FromRawFd;

    // SAFETY: posix_openpt has no memory arguments.
    let descriptor = check(unsafe { libc::posix_openpt(libc::O_RDWR | libc::O_NOCTTY) })?;
    // SAFETY: the descriptor was made above and nothing else owns it.
    let device = unsafe { File::from_raw_fd(descriptor) };
    let mut name = [0_i8; 128].map(|zero| zero as libc::c_char);
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
