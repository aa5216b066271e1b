//! Raw channels: encodes groups of arrivals as columnar batches, and decodes them.

mod can;
mod kinds;

use std::collections::BTreeMap;

use prost::Message as _;
use sample::{Arrival, LogTime, LossPlace, Notice, Payload, SourceId};

use crate::Session;
use crate::column::{self, deltas, expect_len, sums};
use crate::convert::{Encoded, narrow};
use crate::error::MessageError;
use crate::proto::atvrec as pb;

/// Topic of the ticks.
pub(crate) const CLOCK_TOPIC: &str = "/clock";
/// Topic of the notices.
pub(crate) const NOTICE_TOPIC: &str = "/notice";

/// Schemas of the raw channels.
pub(crate) const SCHEMAS: [&str; 4] = [
    "atvrec.RawBytes",
    "atvrec.RawCan",
    "atvrec.RawTicks",
    NOTICES_SCHEMA,
];

/// Schema of the notices.
pub(crate) const NOTICES_SCHEMA: &str = "atvrec.RawNotices";

/// Arrivals, and CAN frames, that a message may contain. A group has some thousands, or as many as the
/// backlog after a failure of the disk. A few bytes of each take a hundred bytes of memory.
const ARRIVALS_MAX: usize = 1 << 20;
/// Bytes that a raw message may have, unless it contains reads of a port.
const MESSAGE_BYTES_MAX: usize = 8 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Lane {
    Clock,
    Notice,
    Can(SourceId),
    Bytes(SourceId),
}

impl Lane {
    fn of(arrival: &Arrival) -> Self {
        match arrival.payload {
            Payload::Bytes(_) => Self::Bytes(arrival.source),
            Payload::Can(_) => Self::Can(arrival.source),
            Payload::Tick => Self::Clock,
            Payload::Notice(_) => Self::Notice,
        }
    }
}

/// What the encoding of a group optimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Packing {
    /// Size, for the log.
    Compact,
    /// Time, for the journal, which is replaced soon.
    Fast,
}

/// Encodes groups and keeps its compressor between them.
pub(crate) struct Encoder {
    packer: can::Packer,
}

impl Encoder {
    pub(crate) fn new(packing: Packing) -> Self {
        Self {
            packer: can::Packer::new(packing),
        }
    }

    /// The messages of one group: `arrivals` in rising order of their sequences, the last of which
    /// is below `end_sequence`.
    pub(crate) fn encode_group(
        &mut self,
        session: &Session,
        arrivals: &[Arrival],
        end_sequence: u64,
        latched: bool,
    ) -> Vec<Encoded> {
        let Some(first) = arrivals.first() else {
            return Vec::new();
        };
        let mut lanes: BTreeMap<Lane, Vec<&Arrival>> = BTreeMap::new();
        for arrival in arrivals {
            lanes.entry(Lane::of(arrival)).or_default().push(arrival);
        }
        let mut messages = Vec::with_capacity(lanes.len());
        for (lane, arrivals) in lanes {
            let stamps = stamps(&arrivals, first.sequence, end_sequence, latched);
            messages.push(self.encode(session, lane, stamps, &arrivals));
        }
        messages
    }

    fn encode(
        &mut self,
        session: &Session,
        lane: Lane,
        stamps: pb::ArrivalStamps,
        arrivals: &[&Arrival],
    ) -> Encoded {
        let time = LogTime(stamps.first_log_time_ns);
        let (mut message, source) = match lane {
            Lane::Clock => {
                let ticks = ticks(stamps, arrivals);
                let topic = CLOCK_TOPIC.to_owned();
                (Encoded::new(topic, time, time, &ticks), None)
            }
            Lane::Notice => {
                let notices = pb::RawNotices {
                    stamps: Some(stamps),
                    notices: arrivals.iter().filter_map(|a| notice(a)).collect(),
                };
                let topic = NOTICE_TOPIC.to_owned();
                (Encoded::new(topic, time, time, &notices), None)
            }
            Lane::Can(source) => {
                let topic = format!("/raw/{}", session.source_name(source));
                let frames = self.packer.encode(stamps, arrivals);
                (Encoded::new(topic, time, time, &frames), Some(source))
            }
            Lane::Bytes(source) => {
                let topic = format!("/raw/{}", session.source_name(source));
                let reads = bytes(stamps, arrivals);
                (Encoded::new(topic, time, time, &reads), Some(source))
            }
        };
        message.source = source;
        message
    }
}

fn realtime_offset(arrival: &Arrival) -> i64 {
    arrival.realtime_ns.wrapping_sub(arrival.log_time.0 as i64)
}

fn stamps(
    arrivals: &[&Arrival],
    group_first_sequence: u64,
    group_end_sequence: u64,
    latched: bool,
) -> pb::ArrivalStamps {
    let first_log_time_ns = arrivals.first().map_or(0, |a| a.log_time.0);
    let first_realtime_offset_ns = arrivals.first().map_or(0, |a| realtime_offset(a));
    let mut next = group_first_sequence;
    let sequence_gap = arrivals
        .iter()
        .map(|a| {
            let gap = a.sequence.wrapping_sub(next);
            next = a.sequence.wrapping_add(1);
            gap
        })
        .collect();
    pb::ArrivalStamps {
        group_first_sequence,
        group_end_sequence,
        latched,
        first_log_time_ns,
        first_realtime_offset_ns,
        sequence_gap,
        log_time_delta_ns: column::encode(&deltas(
            first_log_time_ns as i64,
            arrivals.iter().map(|a| a.log_time.0 as i64),
        )),
        realtime_offset_delta_ns: column::encode(&deltas(
            first_realtime_offset_ns,
            arrivals.iter().map(|a| realtime_offset(a)),
        )),
    }
}

fn bytes(stamps: pb::ArrivalStamps, arrivals: &[&Arrival]) -> pb::RawBytes {
    let reads = arrivals
        .iter()
        .filter_map(|arrival| match &arrival.payload {
            Payload::Bytes(read) => Some(read),
            _ => None,
        });
    pb::RawBytes {
        stamps: Some(stamps),
        length: reads.clone().map(|read| read.len() as u32).collect(),
        data: reads.flatten().copied().collect(),
    }
}

fn ticks(stamps: pb::ArrivalStamps, arrivals: &[&Arrival]) -> pb::RawTicks {
    let source = arrivals.first().map_or(0, |a| u32::from(a.source.0));
    let mixed = arrivals.iter().any(|a| u32::from(a.source.0) != source);
    let each = arrivals.iter().map(|a| u32::from(a.source.0));
    pb::RawTicks {
        stamps: Some(stamps),
        each_source: if mixed { each.collect() } else { Vec::new() },
        source,
    }
}

fn notice(arrival: &Arrival) -> Option<pb::Notice> {
    use pb::notice::Kind;
    let Payload::Notice(notice) = &arrival.payload else {
        return None;
    };
    let kind = match notice {
        Notice::Opened(text) => Kind::Opened(text.clone()),
        Notice::Closed(text) => Kind::Closed(text.clone()),
        Notice::Lost { place, count } => {
            let place = match place {
                LossPlace::Device => pb::LossPlace::Device,
                LossPlace::Kernel => pb::LossPlace::Kernel,
                LossPlace::Queue => pb::LossPlace::Queue,
                LossPlace::Disk => pb::LossPlace::Disk,
            };
            Kind::Lost(pb::Loss {
                place: place.into(),
                count: *count,
            })
        }
        Notice::Mark(text) => Kind::Mark(text.clone()),
        Notice::EstimatorSkipped {
            first_sequence,
            count,
        } => Kind::EstimatorSkipped(pb::Skip {
            first_sequence: *first_sequence,
            count: *count,
        }),
    };
    Some(pb::Notice {
        source: arrival.source.0.into(),
        kind: Some(kind),
    })
}

/// The group that a batch belongs to.
pub(crate) struct Group {
    pub first_sequence: u64,
    pub end_sequence: u64,
    pub latched: bool,
    /// Arrivals of this batch.
    pub arrivals: u64,
}

/// All raw messages begin with their stamps.
#[derive(Clone, PartialEq, prost::Message)]
struct StampsOnly {
    #[prost(message, optional, tag = "1")]
    stamps: Option<pb::ArrivalStamps>,
}

/// The group of a raw message, without decoding the rest of it.
pub(crate) fn group(data: &[u8]) -> Option<Group> {
    let stamps = StampsOnly::decode(data).ok()?.stamps?;
    Some(Group {
        first_sequence: stamps.group_first_sequence,
        end_sequence: stamps.group_end_sequence,
        latched: stamps.latched,
        arrivals: stamps.sequence_gap.len() as u64,
    })
}

/// One decoded batch.
pub(crate) struct Batch {
    pub group_first_sequence: u64,
    pub group_end_sequence: u64,
    pub latched: bool,
    pub arrivals: Vec<Arrival>,
}

/// The batch of a raw message; `None` if `schema` is not one of [`SCHEMAS`].
pub(crate) fn decode(
    schema: &str,
    source: SourceId,
    data: &[u8],
) -> Result<Option<Batch>, MessageError> {
    if !SCHEMAS.contains(&schema) {
        return Ok(None);
    }
    // A read of a port may be long; every other arrival takes some bytes.
    if schema != "atvrec.RawBytes" {
        expect_at_most("bytes", data.len(), MESSAGE_BYTES_MAX)?;
    }
    let (stamps, payloads) = match schema {
        "atvrec.RawBytes" => {
            let message = pb::RawBytes::decode(data)?;
            expect_at_most("length", message.length.len(), ARRIVALS_MAX)?;
            (
                message.stamps,
                split_reads(source, &message.length, &message.data)?,
            )
        }
        "atvrec.RawCan" => {
            let message = pb::RawCan::decode(data)?;
            let stamps = message.stamps.clone();
            expect_at_most("frames", message.frames.len(), ARRIVALS_MAX)?;
            expect_at_most("kind", message.kind.len(), ARRIVALS_MAX)?;
            expect_at_most("kind_id", message.kind_id.len(), message.kind.len())?;
            (stamps, can::decode(source, &message)?)
        }
        "atvrec.RawTicks" => {
            let message = pb::RawTicks::decode(data)?;
            let count = message.stamps.as_ref().map_or(0, |s| s.sequence_gap.len());
            expect_at_most("sequence_gap", count, ARRIVALS_MAX)?;
            let sources = if message.each_source.is_empty() {
                vec![message.source; count]
            } else {
                message.each_source
            };
            let payloads = sources
                .into_iter()
                .map(|source| Ok((SourceId(narrow("source", source)?), Payload::Tick)));
            (
                message.stamps,
                payloads.collect::<Result<_, MessageError>>()?,
            )
        }
        "atvrec.RawNotices" => {
            let message = pb::RawNotices::decode(data)?;
            let payloads = message.notices.into_iter().map(notice_payload);
            (message.stamps, payloads.collect::<Result<_, _>>()?)
        }
        _ => return Ok(None),
    };
    let stamps = stamps.ok_or(MessageError::Absent("stamps"))?;
    batch(&stamps, payloads).map(Some)
}

fn expect_at_most(field: &'static str, value: usize, limit: usize) -> Result<(), MessageError> {
    if value <= limit {
        return Ok(());
    }
    let value = value as i128;
    Err(MessageError::Range { field, value })
}

fn batch(
    stamps: &pb::ArrivalStamps,
    payloads: Vec<(SourceId, Payload)>,
) -> Result<Batch, MessageError> {
    let count = payloads.len();
    expect_len("sequence_gap", count, stamps.sequence_gap.len())?;
    let times = column::decode(
        "log_time_delta_ns",
        stamps.log_time_delta_ns.as_ref(),
        count,
    )?;
    let times = sums(stamps.first_log_time_ns as i64, times);
    let offsets = column::decode(
        "realtime_offset_delta_ns",
        stamps.realtime_offset_delta_ns.as_ref(),
        count,
    )?;
    let offsets = sums(stamps.first_realtime_offset_ns, offsets);
    let mut next = stamps.group_first_sequence;
    let sequences = stamps.sequence_gap.iter().map(move |gap| {
        let sequence = next.wrapping_add(*gap);
        next = sequence.wrapping_add(1);
        sequence
    });
    let arrivals = payloads
        .into_iter()
        .zip(sequences)
        .zip(times.zip(offsets))
        .map(
            |(((source, payload), sequence), (log_time, offset))| Arrival {
                sequence,
                source,
                log_time: LogTime(log_time as u64),
                realtime_ns: log_time.wrapping_add(offset),
                payload,
            },
        );
    let mut arrivals: Vec<Arrival> = arrivals.collect();
    restore_kernel_stamps(&mut arrivals);
    Ok(Batch {
        group_first_sequence: stamps.group_first_sequence,
        group_end_sequence: stamps.group_end_sequence,
        latched: stamps.latched,
        arrivals,
    })
}

/// Replaces the delays of frames by kernel stamps, now that the wall clock of the arrival is known.
fn restore_kernel_stamps(arrivals: &mut [Arrival]) {
    for arrival in arrivals {
        if let Payload::Can(frames) = &mut arrival.payload {
            for frame in frames {
                frame.kernel_ns = frame
                    .kernel_ns
                    .map(|delay| arrival.realtime_ns.wrapping_sub(delay));
            }
        }
    }
}

fn split_reads(
    source: SourceId,
    lengths: &[u32],
    mut data: &[u8],
) -> Result<Vec<(SourceId, Payload)>, MessageError> {
    let total: u64 = lengths.iter().map(|length| u64::from(*length)).sum();
    expect_len("data", total as usize, data.len())?;
    let mut payloads = Vec::with_capacity(lengths.len());
    for length in lengths {
        let (read, rest) = data.split_at(*length as usize);
        payloads.push((source, Payload::Bytes(read.to_vec())));
        data = rest;
    }
    Ok(payloads)
}

fn notice_payload(notice: pb::Notice) -> Result<(SourceId, Payload), MessageError> {
    use pb::notice::Kind;
    let source = SourceId(narrow("source", notice.source)?);
    let notice = match notice.kind.ok_or(MessageError::Absent("kind"))? {
        Kind::Opened(text) => Notice::Opened(text),
        Kind::Closed(text) => Notice::Closed(text),
        Kind::Lost(loss) => Notice::Lost {
            place: match pb::LossPlace::try_from(loss.place) {
                Ok(pb::LossPlace::Device) => LossPlace::Device,
                Ok(pb::LossPlace::Kernel) => LossPlace::Kernel,
                Ok(pb::LossPlace::Queue) => LossPlace::Queue,
                Ok(pb::LossPlace::Disk) => LossPlace::Disk,
                Ok(pb::LossPlace::Unspecified) | Err(_) => {
                    return Err(MessageError::Range {
                        field: "place",
                        value: loss.place.into(),
                    });
                }
            },
            count: loss.count,
        },
        Kind::Mark(text) => Notice::Mark(text),
        Kind::EstimatorSkipped(skip) => Notice::EstimatorSkipped {
            first_sequence: skip.first_sequence,
            count: skip.count,
        },
    };
    Ok((source, Payload::Notice(notice)))
}
