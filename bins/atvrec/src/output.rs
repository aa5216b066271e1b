//! Standard output. Its reader may leave early (`atvrec info drive.mcap | head -1`): that is no
//! failure, and the command goes on.

pub mod target;

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

use sample::text::printable_lines;

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

/// Prints without control characters other than line feed and tab; in JSON their escapes keep the
/// value. Ends the program if standard output fails for another reason than that its reader left.
pub fn write(text: Arguments<'_>) {
    let text = text.to_string();
    let printed = std::io::stdout()
        .lock()
        .write_all(printable_lines(&text).as_bytes());
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
