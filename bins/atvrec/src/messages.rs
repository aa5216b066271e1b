//! Messages of the program on standard error. On a terminal they have times; in the journal, which
//! adds times itself, they have priorities.
//!
//! Every field of a message is printed as one line of printable text, also if it contains bytes of a
//! device or the text of a mark.

mod limit;

use std::fmt;
use std::io::IsTerminal;
use std::os::fd::AsFd;
use std::os::unix::fs::MetadataExt;
use std::time::Instant;

use sample::text::{printable, printable_lines};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::field::MakeExt;
use tracing_subscriber::fmt::format::{Compact, Format, Writer, debug_fn};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

use limit::Limit;

/// Starts the output of messages. `ATVREC_LOG` overrides `verbose` and `quiet` with finer filters. A second call in one
/// process, which Python can make, changes nothing.
pub fn start(verbose: u8, quiet: bool) {
    let level = match (quiet, verbose) {
        (true, _) => "error",
        (false, 0) => "info",
        (false, 1) => "debug",
        (false, _) => "trace",
    };
    let filter = EnvFilter::try_from_env("ATVREC_LOG").unwrap_or_else(|_| EnvFilter::new(level));
    let fields = debug_fn(|writer, field, value| {
        let value = format!("{value:?}");
        match field.name() {
            "message" => write!(writer, "{}", printable(&value)),
            name => write!(writer, "{name}={}", printable(&value)),
        }
    });
    let layer = tracing_subscriber::fmt::layer()
        .fmt_fields(fields.delimited(" "))
        .with_writer(std::io::stderr);
    let subscriber = tracing_subscriber::registry().with(filter);
    // Fails only if the output was started before.
    let _ = if goes_to_journal() {
        let layer = layer.with_ansi(false).event_format(Journal::new());
        subscriber.with(layer.with_filter(Limit)).try_init()
    } else {
        let layer = layer
            .with_ansi(std::io::stderr().is_terminal())
            .with_target(false)
            .compact();
        subscriber.with(layer.with_filter(Limit)).try_init()
    };
}

/// Reports the repeated messages that were not printed since the last report. Call it at the end.
pub fn finish() {
    limit::report(Instant::now(), true);
}

/// Prints the error with which the program ends.
pub fn failed(error: &anyhow::Error) {
    let text = format!("error: {error:#}");
    if goes_to_journal() {
        // Each line is a separate entry of the journal.
        for line in text.lines() {
            eprintln!("<{}>{}", priority(Level::ERROR), printable(line));
        }
    } else {
        eprintln!("{}", printable_lines(&text));
    }
}

/// Whether standard error is connected to the journal: systemd passes device and inode of its stream.
fn goes_to_journal() -> bool {
    #[allow(
        clippy::disallowed_methods,
        reason = "systemd passes it in the environment"
    )]
    let Ok(journal) = std::env::var("JOURNAL_STREAM") else {
        return false;
    };
    let Ok(stream) = std::io::stderr().as_fd().try_clone_to_owned() else {
        return false;
    };
    let Ok(metadata) = std::fs::File::from(stream).metadata() else {
        return false;
    };
    journal == format!("{}:{}", metadata.dev(), metadata.ino())
}

/// Syslog priority of a level.
const fn priority(level: Level) -> u8 {
    match level {
        Level::ERROR => 3,
        Level::WARN => 4,
        Level::INFO => 6,
        Level::DEBUG | Level::TRACE => 7,
    }
}

/// Format `<priority>text fields`, which the journal reads from the standard error of a service.
struct Journal(Format<Compact, ()>);

impl Journal {
    fn new() -> Self {
        Self(
            tracing_subscriber::fmt::format()
                .compact()
                .without_time()
                .with_level(false)
                .with_target(false)
                .with_ansi(false),
        )
    }
}

impl<S, N> FormatEvent<S, N> for Journal
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let priority = priority(*event.metadata().level());
        write!(writer, "<{priority}>")?;
        self.0.format_event(context, writer, event)
    }
}
