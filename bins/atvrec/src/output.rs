//! Standard output. If its reader closes it early (`atvrec info drive.mcap | head -1`), the command
//! continues without an error.

pub mod target;

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

use sample::text::printable_lines;

use crate::messages;

/// Like `print!` of the standard library, but without a panic when the reader has closed the output.
macro_rules! print {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

/// Like `println!` of the standard library, but without a panic when the reader has closed the output.
macro_rules! println {
    () => { $crate::output::write_line(format_args!("")) };
    ($($text:tt)*) => { $crate::output::write_line(format_args!($($text)*)) };
}

/// Prints a text without control characters except line feed and tab; in JSON, escapes keep the
/// values. Ends the program if standard output fails, except when its reader has closed it.
pub fn write(text: Arguments<'_>) {
    let text = text.to_string();
    let printed = std::io::stdout()
        .lock()
        .write_all(printable_lines(&text).as_bytes());
    if let Err(error) = printed.or_else(ignore_closed_pipe) {
        messages::failed(&anyhow::anyhow!("cannot write to standard output: {error}"));
        std::process::exit(1);
    }
}

/// Prints a line.
pub fn write_line(text: Arguments<'_>) {
    write(format_args!("{text}\n"));
}

/// Treats output that its reader has closed as success.
pub fn ignore_closed_pipe(error: std::io::Error) -> std::io::Result<()> {
    match error.kind() {
        ErrorKind::BrokenPipe => Ok(()),
        _ => Err(error),
    }
}
