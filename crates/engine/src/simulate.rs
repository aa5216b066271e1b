//! Simulation: processes the bytes of a virtual vehicle with an engine at full speed.

use sample::{LogTime, Notice, Payload, SourceId};
use sim::{Output, Port};

use crate::feed::{Entry, Feed};
use crate::{Config, Error, VirtualDrive};

/// Interval of ticks, equal to that of the recorder, s.
const TICK_S: f64 = 0.1;
/// Interval of the truth, s.
const TRUTH_S: f64 = 0.01;

/// Drives to the end, and passes the entries of a log to `sink`: arrivals, the records of the engine, and
/// the truth every 10 ms. Returns the number of arrivals.
///
/// # Errors
/// The errors of [`Engine::new`](crate::Engine::new) and of `sink`.
pub fn simulate<E: From<Error>>(
    simulated: &mut VirtualDrive,
    config: &Config,
    mut sink: impl FnMut(Entry) -> Result<(), E>,
) -> Result<u64, E> {
    let start = simulated.start();
    let source_of = |port: Port| {
        let mut sources = config.sources.iter();
        sources
            .find(|source| source.spec.name == port.name())
            .map(|source| source.spec.id)
    };
    let mut feed = Feed::new(config)?;
    for source in &config.sources {
        let opened = Payload::Notice(Notice::Opened("virtual vehicle".to_owned()));
        feed.push(source.spec.id, start, opened, &mut sink)?;
    }
    let (mut ticks, mut truths, mut marks) = (0_u64, 0_u64, 0);
    let at = |time_s: f64| -> LogTime { start.offset_seconds(time_s) };
    while let Some(emission) = simulated.vehicle.next() {
        if emission.time_s > simulated.duration_s() {
            break;
        }
        while truths as f64 * TRUTH_S <= emission.time_s {
            sink(Entry::Record(simulated.truth(truths as f64 * TRUTH_S)))?;
            truths += 1;
        }
        while ticks as f64 * TICK_S <= emission.time_s {
            let time = at(ticks as f64 * TICK_S);
            feed.push(SourceId::HOST, time, Payload::Tick, &mut sink)?;
            ticks += 1;
        }
        let known = simulated.vehicle.motion().marks();
        while let Some((time_s, text)) = known.get(marks).filter(|m| m.0 <= emission.time_s) {
            let mark = Payload::Notice(Notice::Mark(text.clone()));
            feed.push(SourceId::HOST, at(*time_s), mark, &mut sink)?;
            marks += 1;
        }
        let Some(source) = source_of(emission.port) else {
            continue;
        };
        let payload = match emission.output {
            Output::Bytes(bytes) => Payload::Bytes(bytes),
            Output::Can(frame) => Payload::Can(vec![frame]),
        };
        feed.push(source, at(emission.time_s), payload, &mut sink)?;
    }
    Ok(feed.arrivals())
}

#[cfg(test)]
mod axle_tests;
#[cfg(test)]
pub(crate) mod drives;
#[cfg(test)]
mod late_tests;
#[cfg(test)]
mod latency_tests;
#[cfg(test)]
mod pressure_tests;
#[cfg(test)]
mod temperature_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod toe_tests;
#[cfg(test)]
mod unit_tests;
