//! A source in the engine: decoder, device clock and counters.

use sample::{
    Arrival, CanFrame, DeviceTime, LogTime, Measurement, NANOS_PER_SECOND, Notice, Payload, Sample,
    SourceHealth, SourceId,
};
use store::{ClockFit as ClockRecord, Losses, UtcOffset};
use wire::gps_time::{GPS_EPOCH_UNIX_S, SECONDS_PER_DAY};
use wire::{Item, Protocol, Statistics};

use super::adapter::AdapterClock;
use super::can::{Arrived, CanDecoder, Scales, kernel_delay_ns};
use super::clock::{ClockFit, Scale};
use super::counts::MessageCounts;
use super::lateness::Lateness;
use super::rate::{RateClock, RateClocks, counted};
use super::reception::{Reception, Unread};
use super::utc::UtcClock;
use crate::Result;
use crate::config::{self, GnssMeaning, Meaning, Source};

/// Largest time between two velocity records that is used as their interval, s.
const VELOCITY_INTERVAL_MAX_S: f64 = 1.5;

/// Additional time without data that is allowed after a device was opened, because it is set up.
const OPENING_GRACE_NS: i64 = 2 * NANOS_PER_SECOND;

/// A source in the engine.
pub struct SourceState {
    id: SourceId,
    name: String,
    decoder: Decoder,
    timing: Timing,
    silent_after_ns: Option<i64>,
    last_data: Option<LogTime>,
    silent: bool,
    open: bool,
    opened: u64,
    bytes: u64,
    frames: u64,
    adapter: AdapterClock,
    /// Clocks of the identifiers on a bus whose stamps are coarse or missing.
    rates: RateClocks,
    late: Lateness,
    /// Largest delay of a message that is used, ns.
    limit_ns: i64,
    /// Samples of the last arrival whose messages were later, by their places among its samples.
    too_late: Vec<usize>,
    /// Place among the latencies that are not known, of a source that has no messages.
    uncertain: Option<usize>,
    /// The same of each sample of the last arrival; empty if all latencies are known.
    uncertain_of: Vec<Option<usize>>,
    /// Messages by name.
    named: MessageCounts,
    /// Data of a source from which nothing was understood so far.
    unread: Unread,
    /// Kind in the configuration, and whether data that is not understood is a mistake.
    kind: (&'static str, bool),
}

/// Clock of the devices that send neither time nor date: the recorder sets the rate of the inertial unit,
/// and learns that of a device that writes lines.
fn rate_clock(meaning: &Meaning) -> Option<RateClock> {
    match meaning {
        Meaning::Crossbow440(rate) => Some(RateClock::new(Some(rate.interval_s()))),
        Meaning::Line(_) => Some(RateClock::of_lines()),
        _ => None,
    }
}

enum Decoder {
    Can(Box<CanDecoder>),
    Crossbow440(Box<wire::crossbow440::Decoder>),
    Gnss(Box<wire::gnss::Decoder>),
    Line(Box<wire::line::Decoder>),
    Csv(Box<wire::csv::Decoder>),
    Alog(Box<wire::alog::Decoder>),
}

/// Computes the time of validity from device time and arrival.
struct Timing {
    fits: [ClockFit; 3],
    /// By how much the last message has lowered its fit, ns.
    fell_ns: i64,
    /// Clock of a device without time stamps, with its last counter.
    rate: Option<(RateClock, Option<(u32, u32)>)>,
    transport_delay_s: f64,
    velocity_latency_s: Option<f64>,
    attitude_latency_s: f64,
    last_velocity_tag_s: Option<f64>,
    velocity_interval_s: f64,
    utc: UtcClock,
}

/// Change of the silence of a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SilenceChange {
    /// The source has become silent.
    Began,
    /// The source sends data again.
    Ended,
}

impl SourceState {
    /// State before the first arrival.
    ///
    /// `estimator` has the latency of receivers without one in their configuration, and the scales of
    /// hub accelerometers and tie rods.
    pub fn new(source: &Source, estimator: Option<&config::Estimator>) -> Result<Self> {
        let sensors = estimator.map(|settings| &settings.sensors);
        let attitude_latency_s = sensors.map_or(0.0, |sensors| sensors.gnss_attitude.latency_s);
        let scales = Scales::of(estimator);
        let (decoder, gnss) = match &source.meaning {
            Meaning::Can(can) => (Decoder::Can(Box::new(CanDecoder::new(can, scales))), None),
            Meaning::Crossbow440(rate) => {
                let decoder = wire::crossbow440::Decoder::new(*rate);
                (Decoder::Crossbow440(Box::new(decoder)), None)
            }
            Meaning::Gnss(gnss) => {
                let decoder = if gnss.is_vectornav {
                    wire::gnss::Decoder::vectornav()
                } else {
                    wire::gnss::Decoder::new()
                };
                (Decoder::Gnss(Box::new(decoder)), Some(gnss))
            }
            Meaning::Line(format) => {
                let decoder = wire::line::Decoder::new(format.clone())?;
                (Decoder::Line(Box::new(decoder)), None)
            }
            Meaning::Csv(map) => {
                let decoder = wire::csv::Decoder::new(map.format.clone())?;
                (Decoder::Csv(Box::new(decoder)), None)
            }
            Meaning::Alog(format) => {
                let decoder = wire::alog::Decoder::new(format.clone())?;
                (Decoder::Alog(Box::new(decoder)), None)
            }
        };
        Ok(Self {
            id: source.spec.id,
            name: source.spec.name.clone(),
            decoder,
            timing: Timing {
                rate: rate_clock(&source.meaning).map(|clock| (clock, None)),
                ..Timing::new(source.transport_delay_s, gnss, attitude_latency_s)
            },
            silent_after_ns: source
                .silent_after
                .map(|limit| i64::try_from(limit.as_nanos()).unwrap_or(i64::MAX)),
            last_data: None,
            silent: false,
            open: false,
            opened: 0,
            bytes: 0,
            frames: 0,
            adapter: AdapterClock::default(),
            rates: RateClocks::default(),
            late: Lateness::default(),
            limit_ns: 0,
            too_late: Vec::new(),
            uncertain: None,
            uncertain_of: Vec::new(),
            named: MessageCounts::default(),
            unread: Unread::default(),
            kind: source.meaning.kind(),
        })
    }

    /// The latency of this source, or of one of its messages, is not known.
    pub fn set_uncertain(&mut self, message: Option<[usize; 2]>, place: usize) {
        match (&mut self.decoder, message) {
            (Decoder::Can(decoder), Some(message)) => decoder.set_uncertain(message, place),
            _ => self.uncertain = Some(place),
        }
    }

    /// Number of the source.
    pub const fn id(&self) -> SourceId {
        self.id
    }

    /// Place of a sample of the last arrival among the latencies that are not known.
    pub fn uncertain(&self, sample: usize) -> Option<usize> {
        self.uncertain_of.get(sample).copied().flatten()
    }

    /// Name in the configuration.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the message of a sample of the last arrival was later than the limit.
    pub fn is_too_late(&self, sample: usize) -> bool {
        self.too_late.binary_search(&sample).is_ok()
    }

    /// Processes an arrival of the source and appends the samples to the empty `sink`.
    /// Messages later than `limit_ns` are not used.
    pub fn push(&mut self, arrival: &Arrival, limit_ns: i64, sink: &mut Vec<Sample>) {
        self.limit_ns = limit_ns;
        self.too_late.clear();
        self.uncertain_of.clear();
        let log_time = arrival.log_time;
        match &arrival.payload {
            Payload::Bytes(bytes) => {
                self.last_data = Some(log_time);
                self.bytes += bytes.len() as u64;
                self.decode(log_time, log_time, Some(bytes), sink);
            }
            Payload::Can(frames) if frames.is_empty() => {}
            Payload::Can(frames) => self.push_frames(arrival, frames, sink),
            Payload::Notice(notice) => {
                if let (Notice::Closed(_), Some(last)) = (notice, self.last_data) {
                    self.decode(log_time, last, None, sink);
                }
                self.push_notice(log_time, notice);
            }
            Payload::Tick => {}
        }
    }

    fn push_frames(&mut self, arrival: &Arrival, frames: &[CanFrame], sink: &mut Vec<Sample>) {
        self.last_data = Some(arrival.log_time);
        self.frames += frames.len() as u64;
        self.bytes += frames.iter().map(|f| f.bytes().len() as u64).sum::<u64>();
        let arrived = Arrived {
            source: self.id,
            log_time: arrival.log_time,
            latency_s: self.timing.transport_delay_s,
            late_ns: 0,
            sampled: None,
        };
        if let Decoder::Can(decoder) = &mut self.decoder {
            for frame in frames {
                let late_ns = match (frame.kernel_ns, frame.hardware_ns) {
                    (Some(kernel_ns), stamp_ns) => {
                        let delay_ns = kernel_delay_ns(arrival.realtime_ns, kernel_ns);
                        let stamped = arrival.log_time.offset_nanos(-delay_ns);
                        // The adapter's own stamp does not contain the delay until the kernel sees the frame.
                        let device = stamp_ns.map(DeviceTime::AdapterNanos);
                        arrival.log_time - self.timing.tag(device, false, stamped)
                    }
                    (None, stamp_ns) => {
                        let now = arrival.log_time;
                        let coarse = stamp_ns.map(|ns| self.adapter.lateness_ns(now, ns));
                        self.rates.lateness_ns(frame, now, coarse)
                    }
                };
                let is_too_late = self.late.count(late_ns, self.limit_ns);
                let before = sink.len();
                let place = decoder.push(&Arrived { late_ns, ..arrived }, frame, sink);
                if place.is_some() || !self.uncertain_of.is_empty() {
                    self.uncertain_of.resize(before, None);
                    self.uncertain_of.resize(sink.len(), place);
                }
                if is_too_late {
                    self.too_late.extend(before..sink.len());
                }
                self.named.count_frame(frame, sink.get(before));
                if self.named.understood() > 0 {
                    self.unread.clear();
                } else {
                    self.unread.push_frame(frame.id, frame.flags.extended);
                }
            }
        }
    }

    /// Decodes bytes that arrived at `arrived`; `None` hands on what the decoder still holds of them.
    fn decode(
        &mut self,
        log_time: LogTime,
        arrived: LogTime,
        bytes: Option<&[u8]>,
        sink: &mut Vec<Sample>,
    ) {
        let (id, timing, named) = (self.id, &mut self.timing, &mut self.named);
        let (late, limit_ns, too_late) = (&mut self.late, self.limit_ns, &mut self.too_late);
        let deliver = |item: Item<'_>| {
            named.count_item(&item);
            let is_measured = !item.measurements.is_empty();
            let mapped = timing.tag(item.device_time, is_measured, arrived);
            late.fit_fell(timing.fell_ns);
            let is_too_late =
                is_measured && late.count_named(item.name, arrived - mapped, limit_ns);
            let tag = timing.of_arrival(mapped);
            timing.utc.push(&item.message, &timing.fits);
            for measurement in item.measurements {
                let latency_s = match item.protocol {
                    Protocol::Csv | Protocol::Alog => item.latency_s.unwrap_or(0.0),
                    _ => timing.latency_s(item.device_time, item.latency_s, &measurement),
                };
                if is_too_late {
                    too_late.push(sink.len());
                }
                sink.push(Sample {
                    source: id,
                    log_time,
                    valid_time: tag.offset_seconds(-latency_s).min(log_time),
                    device_time: item.device_time,
                    measurement,
                });
            }
        };
        match (&mut self.decoder, bytes) {
            (Decoder::Crossbow440(decoder), Some(bytes)) => decoder.push(bytes, deliver),
            (Decoder::Gnss(decoder), Some(bytes)) => decoder.push(bytes, deliver),
            (Decoder::Line(decoder), Some(bytes)) => decoder.push(bytes, deliver),
            (Decoder::Csv(decoder), Some(bytes)) => decoder.push(bytes, deliver),
            (Decoder::Alog(decoder), Some(bytes)) => decoder.push(bytes, deliver),
            (Decoder::Alog(decoder), None) => decoder.finish(deliver),
            (_, None) | (Decoder::Can(_), _) => {}
        }
        if self.uncertain.is_some() {
            self.uncertain_of.resize(sink.len(), self.uncertain);
        }
        if self.named.understood() > 0 {
            self.unread.clear();
        } else {
            self.unread.push_bytes(bytes.unwrap_or_default());
        }
    }

    fn push_notice(&mut self, log_time: LogTime, notice: &Notice) {
        match notice {
            Notice::Opened(_) => {
                self.open = true;
                self.opened += 1;
                self.last_data = Some(log_time + OPENING_GRACE_NS);
            }
            Notice::Closed(_) => self.open = false,
            Notice::Lost { .. } | Notice::Mark(_) | Notice::EstimatorSkipped { .. } => {}
        }
    }

    /// Checks whether the source has become silent or sends data again.
    pub fn watch(&mut self, now: LogTime) -> Option<SilenceChange> {
        let limit_ns = self.silent_after_ns?;
        let silent = self.last_data.is_some_and(|last| now - last > limit_ns);
        if silent == self.silent {
            return None;
        }
        self.silent = silent;
        Some(if silent {
            SilenceChange::Began
        } else {
            SilenceChange::Ended
        })
    }

    /// Counters since the start; `losses` are the losses of all sources.
    pub fn health(&self, losses: &Losses) -> SourceHealth {
        let statistics = self.statistics();
        SourceHealth {
            source: self.id,
            name: self.name.clone(),
            open: self.open,
            silent: self.silent,
            bytes: self.bytes,
            messages: self.frames + statistics.messages,
            checksum_errors: statistics.checksum_errors,
            skipped_bytes: statistics.skipped_bytes,
            gaps: statistics.gaps,
            malformed: statistics.malformed,
            reopened: self.opened.saturating_sub(1),
            lost: losses.of(self.id),
            undecoded: self.named.undecoded(),
            late: self.late.used,
            too_late: self.late.unused,
        }
    }

    /// What arrived since the start.
    pub fn reception(&self) -> Reception {
        let (kind, is_decoded) = self.kind;
        Reception {
            source: self.id,
            name: self.name.clone(),
            kind,
            is_decoded,
            bytes: self.bytes,
            frames: self.frames,
            messages: self.named.clone(),
            format: self.unread.format(),
        }
    }

    fn statistics(&self) -> Statistics {
        match &self.decoder {
            Decoder::Can(_) => Statistics::default(),
            Decoder::Crossbow440(decoder) => decoder.statistics(),
            Decoder::Gnss(decoder) => decoder.statistics(),
            Decoder::Line(decoder) => decoder.statistics(),
            Decoder::Csv(decoder) => decoder.statistics(),
            Decoder::Alog(decoder) => decoder.statistics(),
        }
    }

    /// Fits of the device clocks to the log clock.
    pub fn clocks(&self, now: LogTime) -> impl Iterator<Item = ClockRecord> {
        self.timing
            .fits
            .iter()
            .filter_map(ClockFit::state)
            .map(move |state| {
                let log_s = state.log_time.0 as f64 * 1e-9;
                let offset_s = match state.scale {
                    Scale::Gps => state.device_s + GPS_EPOCH_UNIX_S as f64 - log_s,
                    Scale::UtcDay => {
                        let apart_s = state.device_s - log_s;
                        apart_s - (apart_s / SECONDS_PER_DAY).round() * SECONDS_PER_DAY
                    }
                    Scale::Device => state.device_s - log_s,
                };
                ClockRecord {
                    source: self.id,
                    time: now,
                    offset_s,
                    drift_ppm: -state.drift * 1e6,
                    residual_sigma_s: state.jitter_s,
                    count: state.messages,
                    steps: u64::from(state.restarts),
                }
            })
    }
}

impl SourceState {
    /// UTC against the log clock, if the device has sent date and time since the last call.
    pub fn utc_offset(&mut self, now: LogTime) -> Option<UtcOffset> {
        let timing = &mut self.timing;
        let offset = timing.utc.offset(&timing.fits, timing.transport_delay_s)?;
        Some(UtcOffset {
            time: now,
            offset_ns: offset.offset_ns,
            sigma_s: offset.sigma_s,
            source: self.id,
            leap_seconds: offset.leap_seconds,
        })
    }
}

impl Timing {
    fn new(transport_delay_s: f64, gnss: Option<&GnssMeaning>, attitude_latency_s: f64) -> Self {
        Self {
            fits: Scale::ALL.map(ClockFit::new),
            fell_ns: 0,
            rate: None,
            transport_delay_s,
            velocity_latency_s: gnss.and_then(|gnss| gnss.velocity_latency_s),
            attitude_latency_s: gnss
                .and_then(|gnss| gnss.attitude_latency_s)
                .unwrap_or(attitude_latency_s),
            last_velocity_tag_s: None,
            velocity_interval_s: 0.0,
            utc: UtcClock::default(),
        }
    }

    /// Time of a message without a device time.
    fn of_arrival(&self, log_time: LogTime) -> LogTime {
        log_time.offset_seconds(-self.transport_delay_s)
    }

    /// Arrival of a message as it would have been without delay.
    fn tag(&mut self, device: Option<DeviceTime>, is_measured: bool, log_time: LogTime) -> LogTime {
        self.fell_ns = 0;
        let mapped = device.and_then(|device| {
            let fit = &mut self.fits[Scale::of(device)? as usize];
            let mapped = fit.push(device, log_time);
            self.fell_ns = fit.fell_ns();
            mapped
        });
        if let Some(mapped) = mapped {
            return mapped;
        }
        let counter = match device {
            Some(DeviceTime::Counter { value, modulus }) => Some((value, modulus)),
            _ => None,
        };
        match self.rate.as_mut().filter(|_| is_measured) {
            Some((rate, before)) => {
                let steps = counted(std::mem::replace(before, counter), counter);
                rate.push(steps, log_time)
            }
            None => log_time,
        }
    }

    /// Latency of a measurement: time from its validity to its time tag, s.
    fn latency_s(
        &mut self,
        device: Option<DeviceTime>,
        of_message_s: Option<f64>,
        measurement: &Measurement,
    ) -> f64 {
        match measurement {
            Measurement::GnssVelocity(velocity) => {
                let half_interval_s = self.half_velocity_interval_s(device);
                velocity
                    .latency_s
                    .or(of_message_s)
                    .or(self.velocity_latency_s)
                    .unwrap_or(half_interval_s)
            }
            Measurement::GnssAttitude(_) => self.attitude_latency_s,
            _ => 0.0,
        }
    }

    /// Half the time between the last two velocity records, which is the latency of a position
    /// difference or of an averaged Doppler shift, s.
    fn half_velocity_interval_s(&mut self, device: Option<DeviceTime>) -> f64 {
        let tag_s = match device {
            Some(DeviceTime::Gps { time_of_week_s, .. }) => time_of_week_s,
            Some(DeviceTime::UtcTimeOfDay(time_of_day_s)) => time_of_day_s,
            _ => return 0.0,
        };
        if let Some(last_s) = self.last_velocity_tag_s {
            let interval_s = tag_s - last_s;
            if interval_s > 0.0 && interval_s <= VELOCITY_INTERVAL_MAX_S {
                self.velocity_interval_s = interval_s;
            }
        }
        self.last_velocity_tag_s = Some(tag_s);
        0.5 * self.velocity_interval_s
    }
}
