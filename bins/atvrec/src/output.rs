//! Standard output. Who reads it may have had enough (`atvrec info drive.mcap | head -1`): that is no
//! failure, and what a command does beside printing goes on.

pub mod target;

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

use crate::messages;

/// As the standard library's, but silent once nobody reads.
macro_rules! print {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

/// As the standard library's, but silent once nobody reads.
macro_rules! println {
    () => { $crate::output::write_line(format_args!("")) };
    ($($text:tt)*) => { $crate::output::write_line(format_args!($($text)*)) };
}

/// Prints; ends the program if standard output fails otherwise than by its reader's leaving.
pub fn write(text: Arguments<'_>) {
    let printed = std::io::stdout().lock().write_fmt(text);
    if let Err(error) = printed.or_else(reader_left) {
        messages::failed(&anyhow::anyhow!("cannot write to standard output: {error}"));
        std::process::exit(1);
    }
}

/// Prints a line.
pub fn write_line(text: Arguments<'_>) {
    write(format_args!("{text}\n"));
}

/// Takes it for success that nobody reads any more.
pub fn reader_left(error: std::io::Error) -> std::io::Result<()> {
    match error.kind() {
        ErrorKind::BrokenPipe => Ok(()),
        _ => Err(error),
    }
}
