//! Raw channels: arrivals in groups of columnar batches, and back.

use std::collections::BTreeMap;

use prost::Message as _;
use sample::{Arrival, CanFlags, CanFrame, LogTime, LossPlace, Notice, Payload, SourceId};

use crate::Session;
use crate::column::{self, bit, bits, deltas, expect_len, sums};
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
    "atvrec.RawNotices",
];

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

/// The messages of one group: `arrivals` in rising order of their sequences, the last of which is
/// below `end_sequence`.
pub(crate) fn encode_group(
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
    let encode = |(lane, arrivals): (Lane, Vec<&Arrival>)| {
        let stamps = stamps(&arrivals, first.sequence, end_sequence, latched);
        let time = LogTime(stamps.first_log_time_ns);
        let (mut message, source) = match lane {
            Lane::Clock => {
                let ticks = ticks(stamps, &arrivals);
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
                let topic = format!("/can/{}/raw", session.source_name(source));
                let frames = can(stamps, &arrivals);
                (Encoded::new(topic, time, time, &frames), Some(source))
            }
            Lane::Bytes(source) => {
                let topic = format!("/raw/{}", session.source_name(source));
                let reads = bytes(stamps, &arrivals);
                (Encoded::new(topic, time, time, &reads), Some(source))
            }
        };
        message.source = source;
        message
    };
    lanes.into_iter().map(encode).collect()
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

fn can(stamps: pb::ArrivalStamps, arrivals: &[&Arrival]) -> pb::RawCan {
    let mut message = pb::RawCan::default();
    let mut kinds: BTreeMap<(u32, u8, u8), u32> = BTreeMap::new();
    let mut order: Vec<(u32, u8, u8)> = Vec::new();
    let mut frames: Vec<(&CanFrame, i64)> = Vec::new();
    for arrival in arrivals {
        if let Payload::Can(list) = &arrival.payload {
            message.frames.push(list.len() as u32);
            frames.extend(list.iter().map(|frame| (frame, arrival.realtime_ns)));
        }
    }
    if message.frames.iter().all(|count| *count == 1) {
        message.frames.clear();
    }
    for (frame, _) in &frames {
        let kind = (frame.id, frame.flags.to_bits(), frame.len.min(64));
        let index = *kinds.entry(kind).or_insert_with(|| {
            order.push(kind);
            order.len() as u32 - 1
        });
        message.kind.push(index);
    }
    message.kind_id = order.iter().map(|kind| kind.0).collect();
    message.kind_flags = order.iter().map(|kind| kind.1).collect();
    message.kind_length = order.iter().map(|kind| kind.2).collect();

    let delays: Vec<i64> = frames
        .iter()
        .filter_map(|(frame, realtime)| Some(realtime.wrapping_sub(frame.kernel_ns?)))
        .collect();
    message.kernel_none = delays.is_empty();
    if !message.kernel_none && delays.len() < frames.len() {
        message.kernel_present = bits(frames.iter().map(|(frame, _)| frame.kernel_ns.is_some()));
    }
    message.kernel_delay_ns = column::encode(&delays);
    let hardware = deltas(0, frames.iter().filter_map(|(frame, _)| frame.hardware_ns));
    if !hardware.is_empty() {
        message.hardware_present =
            bits(frames.iter().map(|(frame, _)| frame.hardware_ns.is_some()));
    }
    message.hardware_delta_ns = column::encode(&hardware);
    message.data_zstd = pack(&transpose(order.len(), &message.kind, &frames));
    message.stamps = Some(stamps);
    message
}

/// zstd level of the frames' data: higher ones gain nothing.
const DATA_LEVEL: i32 = 1;

fn pack(data: &[u8]) -> Vec<u8> {
    // Compression into memory has no way to fail; an empty field would be told when read.
    zstd::bulk::compress(data, DATA_LEVEL).unwrap_or_default()
}

fn unpack(data: &[u8], length: usize) -> Result<Vec<u8>, MessageError> {
    let unpacked = zstd::bulk::decompress(data, length).map_err(MessageError::Data)?;
    expect_len("data", length, unpacked.len())?;
    Ok(unpacked)
}

fn transpose(kinds: usize, kind: &[u32], frames: &[(&CanFrame, i64)]) -> Vec<u8> {
    let mut by_kind: Vec<Vec<&[u8]>> = vec![Vec::new(); kinds];
    for (kind, (frame, _)) in kind.iter().zip(frames) {
        by_kind[*kind as usize].push(frame.bytes());
    }
    let mut data = Vec::new();
    for rows in &by_kind {
        let width = rows.first().map_or(0, |row| row.len());
        for column in 0..width {
            let mut before = 0_u8;
            for row in rows {
                data.push(row[column].wrapping_sub(before));
                before = row[column];
            }
        }
    }
    data
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

/// One batch, read back.
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
    let (stamps, payloads) = match schema {
        "atvrec.RawBytes" => {
            let message = pb::RawBytes::decode(data)?;
            (
                message.stamps,
                split_reads(source, &message.length, &message.data)?,
            )
        }
        "atvrec.RawCan" => {
            let message = pb::RawCan::decode(data)?;
            let stamps = message.stamps.clone();
            (stamps, can_payloads(source, &message)?)
        }
        "atvrec.RawTicks" => {
            let message = pb::RawTicks::decode(data)?;
            let count = message.stamps.as_ref().map_or(0, |s| s.sequence_gap.len());
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

/// Until the arrival's wall clock is known, a frame holds its delay in place of the kernel's stamp.
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

/// Frames of each arrival; kernel stamps still as delays.
fn can_payloads(
    source: SourceId,
    message: &pb::RawCan,
) -> Result<Vec<(SourceId, Payload)>, MessageError> {
    let mut frames = can_frames(message)?.into_iter();
    let arrivals = message.stamps.as_ref().map_or(0, |s| s.sequence_gap.len());
    if message.frames.is_empty() {
        expect_len("kind", arrivals, frames.len())?;
        return Ok(frames
            .map(|frame| (source, Payload::Can(vec![frame])))
            .collect());
    }
    let total: u64 = message.frames.iter().map(|count| u64::from(*count)).sum();
    expect_len("kind", total as usize, frames.len())?;
    let payloads = message.frames.iter().map(|count| {
        let frames = frames.by_ref().take(*count as usize).collect();
        (source, Payload::Can(frames))
    });
    Ok(payloads.collect())
}

fn can_frames(message: &pb::RawCan) -> Result<Vec<CanFrame>, MessageError> {
    let kinds = message.kind_id.len();
    expect_len("kind_flags", kinds, message.kind_flags.len())?;
    expect_len("kind_length", kinds, message.kind_length.len())?;
    let mut count = vec![0_usize; kinds];
    for kind in &message.kind {
        *count.get_mut(*kind as usize).ok_or(MessageError::Range {
            field: "kind",
            value: (*kind).into(),
        })? += 1;
    }
    // Where each kind's block begins in the data, and how wide its rows are.
    let mut start = Vec::with_capacity(kinds);
    let mut total = 0_usize;
    for (kind, frames) in count.iter().enumerate() {
        start.push(total);
        total += frames * row_width(message, kind)?;
    }
    // zstd gains at most some 2^17 in one block: a length beyond that is a lie.
    if total / (1 << 18) > message.data_zstd.len() {
        return Err(MessageError::Absent("data"));
    }
    let packed = unpack(&message.data_zstd, total)?;

    let total = message.kind.len();
    let kernel_at = |index: usize| {
        !message.kernel_none
            && (message.kernel_present.is_empty() || bit(&message.kernel_present, index))
    };
    let hardware_at = |index: usize| bit(&message.hardware_present, index);
    let mut kernel = column::decode(
        "kernel_delay_ns",
        message.kernel_delay_ns.as_ref(),
        (0..total).filter(|index| kernel_at(*index)).count(),
    )?
    .into_iter();
    let hardware = column::decode(
        "hardware_delta_ns",
        message.hardware_delta_ns.as_ref(),
        (0..total).filter(|index| hardware_at(*index)).count(),
    )?;
    let mut hardware = sums(0, hardware);
    let mut seen = vec![0_usize; kinds];
    let mut before = vec![[0_u8; 64]; kinds];
    let mut frames = Vec::with_capacity(total);
    for (index, kind) in message.kind.iter().enumerate() {
        let kind = *kind as usize;
        let data = &mut before[kind];
        for (column, byte) in data.iter_mut().take(row_width(message, kind)?).enumerate() {
            let difference = packed[start[kind] + column * count[kind] + seen[kind]];
            *byte = byte.wrapping_add(difference);
        }
        seen[kind] += 1;
        frames.push(CanFrame {
            id: message.kind_id[kind],
            flags: CanFlags::from_bits(message.kind_flags[kind]),
            len: message.kind_length[kind],
            data: *data,
            kernel_ns: if kernel_at(index) {
                kernel.next()
            } else {
                None
            },
            hardware_ns: if hardware_at(index) {
                hardware.next()
            } else {
                None
            },
        });
    }
    Ok(frames)
}

fn row_width(message: &pb::RawCan, kind: usize) -> Result<usize, MessageError> {
    let length = message.kind_length[kind];
    if length > 64 {
        return Err(MessageError::Range {
            field: "kind_length",
            value: length.into(),
        });
    }
    let remote = CanFlags::from_bits(message.kind_flags[kind]).remote;
    Ok(if remote { 0 } else { length.into() })
}
