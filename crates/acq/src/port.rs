//! The life of a serial port: open, protocol, notice that it went, open again.

use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::Duration;

use sample::{LossPlace, Notice};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::watch;
use tokio::time::{Instant, MissedTickBehavior};
use tokio_serial::{DataBits, SerialPort, SerialPortBuilderExt, SerialStream, StopBits};

use crate::context::{SourceContext, pause, stopped};
use crate::protocol::{Action, SerialProtocol};
use crate::sys::{self, UartCounters};
use crate::{Parity, PortSpec};

/// Size of one read, bytes.
const READ_BYTES: usize = 4096;
/// How often the UART's error counters are looked at.
const COUNTER_PERIOD: Duration = Duration::from_secs(1);
/// Wait before the first attempt to reopen a port; doubled after each failure.
const REOPEN_FIRST: Duration = Duration::from_millis(50);
/// Longest wait between two attempts to reopen a port.
const REOPEN_LONGEST: Duration = Duration::from_millis(500);
/// Longest time for a write: a device that takes no commands must not hold up its data.
const WRITE_DEADLINE: Duration = Duration::from_millis(500);

/// Runs a port until the shutdown.
pub(crate) async fn run(
    context: &SourceContext,
    spec: &PortSpec,
    protocol: &mut dyn SerialProtocol,
    mut shutdown: watch::Receiver<bool>,
) {
    let mut wait = REOPEN_FIRST;
    let mut last_failure = String::new();
    while !*shutdown.borrow() {
        match open(spec) {
            Ok(port) => {
                last_failure.clear();
                wait = REOPEN_FIRST;
                let text = format!("{} at {} baud", spec.path.display(), spec.baud);
                tracing::info!(source = %context.name, port = %text, "opened");
                context.notice(Notice::Opened(text));
                match Session::new(context, port)
                    .run(protocol, &mut shutdown)
                    .await
                {
                    Ok(()) => return,
                    Err(error) => {
                        let text = format!("{}: {error}", spec.path.display());
                        tracing::warn!(source = %context.name, %text, "the port failed; it is opened again");
                        context.notice(Notice::Closed(text));
                    }
                }
            }
            Err(error) => {
                let text = explain(&error, &spec.path);
                if text != last_failure {
                    tracing::warn!(
                        source = %context.name,
                        %text,
                        "cannot open the port; the next attempts follow"
                    );
                    context.notice(Notice::Closed(text.clone()));
                    last_failure = text;
                }
            }
        }
        if pause(wait, &mut shutdown).await {
            return;
        }
        wait = (wait * 2).min(REOPEN_LONGEST);
    }
}

/// What an error at opening means and what to do about it.
fn explain(error: &io::Error, path: &Path) -> String {
    let path_text = path.display();
    match error.kind() {
        io::ErrorKind::PermissionDenied => {
            let group = group_of(path).unwrap_or_else(|| "dialout".to_owned());
            format!(
                "{path_text}: permission denied; the group {group} owns the port: run `sudo usermod -aG \
                 {group} $USER`, and log in again"
            )
        }
        // The library answers "not found" to a port that is locked, too.
        io::ErrorKind::NotFound if !path.exists() => {
            format!("{path_text}: the device does not exist; connect it or correct the path")
        }
        io::ErrorKind::NotFound | io::ErrorKind::ResourceBusy => {
            format!("{path_text}: {error}; if another program has the port, stop it")
        }
        _ => format!("{path_text}: {error}"),
    }
}

/// Name of the group that owns a device.
fn group_of(path: &Path) -> Option<String> {
    let number = std::fs::metadata(path).ok()?.gid().to_string();
    let groups = std::fs::read_to_string("/etc/group").ok()?;
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)? == number).then(|| name.to_owned())
    })
}

fn open(spec: &PortSpec) -> io::Result<SerialStream> {
    let parity = match spec.parity {
        Parity::None => tokio_serial::Parity::None,
        Parity::Odd => tokio_serial::Parity::Odd,
        Parity::Even => tokio_serial::Parity::Even,
    };
    let stop_bits = if spec.two_stop_bits {
        StopBits::Two
    } else {
        StopBits::One
    };
    // Not `exclusive`: on a pseudo-terminal that flag outlives this process and locks out the next.
    let port = tokio_serial::new(spec.path.to_string_lossy(), spec.baud)
        .data_bits(DataBits::Eight)
        .parity(parity)
        .stop_bits(stop_bits)
        .exclusive(false)
        .open_native_async()?;
    if !sys::lock_port(&port)? {
        return Err(io::Error::new(
            io::ErrorKind::ResourceBusy,
            "the port is locked",
        ));
    }
    if spec.low_latency
        && let Err(error) = sys::set_low_latency(&port)
    {
        tracing::debug!(path = %spec.path.display(), %error, "the driver has no low-latency mode");
    }
    Ok(port)
}

/// One opening of a port.
struct Session<'a> {
    context: &'a SourceContext,
    port: SerialStream,
    counters: Option<UartCounters>,
    wake: Option<Instant>,
}

impl<'a> Session<'a> {
    fn new(context: &'a SourceContext, port: SerialStream) -> Self {
        let counters = sys::uart_counters(&port).ok();
        Self {
            context,
            port,
            counters,
            wake: None,
        }
    }

    /// Reads until the shutdown (`Ok`) or until the port fails.
    async fn run(
        mut self,
        protocol: &mut dyn SerialProtocol,
        shutdown: &mut watch::Receiver<bool>,
    ) -> io::Result<()> {
        let mut buffer = vec![0; READ_BYTES];
        let mut counter_timer = tokio::time::interval(COUNTER_PERIOD);
        counter_timer.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let action = protocol.on_open();
        self.run_action(action).await?;
        loop {
            let wake = self.wake.unwrap_or_else(|| Instant::now() + COUNTER_PERIOD);
            let action = tokio::select! {
                biased;
                () = stopped(shutdown) => break,
                read = self.port.read(&mut buffer) => match read? {
                    0 => return Err(io::Error::other("the device was disconnected")),
                    count => protocol.on_bytes(&buffer[..count]),
                },
                () = tokio::time::sleep_until(wake), if self.wake.is_some() => {
                    self.wake = None;
                    protocol.on_timer()
                }
                _ = counter_timer.tick(), if self.counters.is_some() => {
                    self.look_at_counters()?;
                    Action::default()
                }
            };
            self.run_action(action).await?;
        }
        let last = protocol.on_close();
        if let Err(error) = self.write(&last).await {
            tracing::debug!(source = %self.context.name, %error, "the last command was not sent");
        }
        self.look_at_counters().ok();
        self.context.notice(Notice::Closed("stopped".to_owned()));
        Ok(())
    }

    async fn run_action(&mut self, action: Action) -> io::Result<()> {
        if let Some(baud) = action.baud {
            self.port.set_baud_rate(baud)?;
        }
        if let Some(after) = action.wake {
            self.wake = Some(Instant::now() + after);
        }
        self.write(&action.write).await
    }

    async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        if bytes.is_empty() {
            return Ok(());
        }
        match tokio::time::timeout(WRITE_DEADLINE, self.port.write_all(bytes)).await {
            Ok(result) => result,
            Err(_) => {
                tracing::warn!(
                    source = %self.context.name,
                    timeout_s = WRITE_DEADLINE.as_secs_f64(),
                    "cannot send commands to the device; check its cable and flow control"
                );
                Ok(())
            }
        }
    }

    /// Reports what the UART lost since the last look.
    fn look_at_counters(&mut self) -> io::Result<()> {
        let Some(earlier) = self.counters else {
            return Ok(());
        };
        let now = sys::uart_counters(&self.port)?;
        self.context
            .lost(LossPlace::Device, now.overruns_since(&earlier));
        let line_errors = now.line_errors_since(&earlier);
        if line_errors > 0 {
            tracing::warn!(
                source = %self.context.name,
                line_errors,
                "the UART reports framing, parity or break errors; check the baud rate and the cable"
            );
        }
        self.counters = Some(now);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_come_with_a_remedy() {
        let here = Path::new("/dev/null");
        let gone = Path::new("/dev/no-such-port");
        for (kind, path, word) in [
            (
                io::ErrorKind::PermissionDenied,
                here,
                "usermod -aG root $USER",
            ),
            (io::ErrorKind::NotFound, gone, "connect it"),
            (io::ErrorKind::NotFound, here, "another program"),
        ] {
            let text = explain(&io::Error::from(kind), path);
            assert!(text.contains(word), "{text}");
            assert!(text.starts_with("/dev/"), "{text}");
        }
        let missing = open(&PortSpec::new(gone, 9600)).expect_err("no such port");
        assert!(explain(&missing, gone).contains("connect it"));
    }
}
