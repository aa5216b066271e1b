//! Estimates as datagrams to a controller.

use std::net::SocketAddr;
use std::time::Duration;

use store::{Record, Stage};
use tokio::net::UdpSocket;
use tokio::time::{Instant, sleep_until};
use wire::output::{OutputState, encode_datagram, encode_json};

use crate::hub::{Hub, Topics};

/// Period of the datagrams without a new estimate.
const PERIOD: Duration = Duration::from_millis(10);
/// Time without a new estimate after which the output is stale: one period after the next was due,
/// and the period in which the recorder hands over its records.
const STALE_AFTER: Duration = Duration::from_millis(30);
/// Age from which even a new estimate is stale, s.
const AGE_MAX_S: f64 = 0.05;
/// Topics of the output.
const TOPICS: [&str; 5] = [
    "/estimate/motion",
    "/estimate/tyre_forces",
    "/estimate/contact_forces",
    "/estimate/rollover",
    "/estimate/events",
];

/// Form of the datagrams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UdpFormat {
    /// Record of fixed size.
    Binary,
    /// Line of JSON.
    Json,
}

/// Sends each estimate of the hub to `to`, for ever. Without a new estimate, the datagrams are marked
/// stale.
///
/// # Errors
/// If there is no port to send from.
pub async fn send(to: SocketAddr, format: UdpFormat, hub: Hub) -> std::io::Result<()> {
    let any = match to {
        SocketAddr::V4(_) => "0.0.0.0:0",
        SocketAddr::V6(_) => "[::]:0",
    };
    let socket = UdpSocket::bind(any).await?;
    let subscriber = hub.subscribe();
    subscriber.want(Topics::from(TOPICS.map(str::to_owned)));
    let mut state = OutputState::default();
    let mut parts = Parts::default();
    let mut sequence = 0;
    let mut due = Instant::now() + STALE_AFTER;
    let mut is_reported = false;
    loop {
        let mut ages = Vec::new();
        tokio::select! {
            () = subscriber.changed() => {
                for received in subscriber.take() {
                    let record = received.message.record(&received.info);
                    let Ok(Some(record)) = record else { continue };
                    if let Record::Event(event) = &record {
                        state.event(event);
                    } else if let Some(estimate) = parts.take(record) {
                        state.estimate(&estimate);
                        ages.push(AGE_MAX_S);
                    }
                }
                if !ages.is_empty() {
                    due = Instant::now() + STALE_AFTER;
                }
            }
            () = sleep_until(due) => {
                ages.push(0.0);
                due = Instant::now() + PERIOD;
            }
        }
        let now = hub.source().now.unwrap_or_default();
        // Of several estimates that came together, the newest is sent.
        if let Some(age_max_s) = ages.last() {
            let output = state.at(now, *age_max_s);
            let bytes = match format {
                UdpFormat::Binary => encode_datagram(&output, sequence).to_vec(),
                UdpFormat::Json => encode_json(&output, sequence).into_bytes(),
            };
            sequence = sequence.wrapping_add(1);
            match socket.send_to(&bytes, to).await {
                Ok(_) => is_reported = false,
                Err(error) if !is_reported => {
                    is_reported = true;
                    tracing::warn!(%to, %error, "output.udp cannot send; it tries again with each estimate");
                }
                Err(_) => {}
            }
        }
    }
}

/// Assembles estimates from the messages of their parts.
#[derive(Default)]
struct Parts {
    estimate: Option<sample::Estimate>,
}

impl Parts {
    /// Takes a part. Returns the estimate before, if the part is the first of the next one, and an
    /// estimate that is complete.
    fn take(&mut self, record: Record) -> Option<sample::Estimate> {
        match record {
            Record::Motion {
                time,
                stage: Stage::Estimate,
                motion,
            } => {
                let next = sample::Estimate {
                    time,
                    motion: *motion,
                    carrier: sample::PerWheel::default(),
                    measured: sample::PerWheel::default(),
                    expected: sample::PerWheel::default(),
                    rollover: sample::Rollover::default(),
                };
                self.estimate.replace(next)
            }
            Record::TyreForces {
                stage: Stage::Estimate,
                frame,
                forces,
                ..
            } => {
                let estimate = self.estimate.as_mut()?;
                match frame {
                    sample::ForceFrame::WheelCarrier => estimate.carrier = *forces,
                    sample::ForceFrame::Contact => estimate.measured = *forces,
                }
                None
            }
            Record::Rollover { rollover, .. } => {
                let mut complete = self.estimate.take()?;
                complete.rollover = rollover;
                Some(complete)
            }
            _ => None,
        }
    }
}
