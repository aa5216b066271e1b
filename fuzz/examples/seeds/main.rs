//! Writes the inputs that fuzzing begins with: what the project's own encoders say.
//!
//! `cargo run --manifest-path fuzz/Cargo.toml --example seeds`

mod can_logs;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Duration;

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Arrival, CanFrame, LogTime, LossPlace, Notice, Payload, SourceId};
use sim::{Manoeuvre, Options, Output, Port, SeptentrioBlocks, VirtualVehicle};
use store::{LogMessage, Record, Session, Source, SourceKind};
use wire::geodesy::Geodetic;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Seconds of the drive whose bytes are taken.
const SECONDS: f64 = 1.0;

fn main() -> Result<()> {
    let seeds = Seeds(Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds"));
    let vehicle = Vehicle::builtin("prowler")?;
    let sensors = Sensors::builtin("thesis-10bit")?;
    let drive = Drive::new(&vehicle, &sensors, SeptentrioBlocks::PolaRx2e)?;
    let newer = Drive::new(&vehicle, &sensors, SeptentrioBlocks::Current)?;
    serial(&seeds, &drive, &newer)?;
    arrivals(&seeds, &drive)?;
    can(&seeds, &drive)?;
    can_logs::write(&seeds)?;
    texts(&seeds)?;
    logs(&seeds, &drive)?;
    Ok(())
}

/// The folder of the seeds, one folder a target.
struct Seeds(PathBuf);

impl Seeds {
    fn write(&self, target: &str, name: &str, bytes: &[u8]) -> Result<()> {
        let folder = self.0.join(target);
        std::fs::create_dir_all(&folder)?;
        Ok(std::fs::write(folder.join(name), bytes)?)
    }

    /// With the byte in front that says how the stream is cut.
    fn stream(&self, target: &str, name: &str, bytes: &[u8]) -> Result<()> {
        self.write(target, name, &[&[7], bytes].concat())
    }
}

/// What left each port in the first second of a drive.
struct Drive(Vec<(f64, Port, Output)>);

impl Drive {
    fn new(vehicle: &Vehicle, sensors: &Sensors, blocks: SeptentrioBlocks) -> Result<Self> {
        let options = Options {
            septentrio_blocks: blocks,
            ..Options::default()
        };
        let motion = Manoeuvre::by_name("step-steer")?.drive(vehicle)?;
        let virtual_vehicle = VirtualVehicle::new(motion, vehicle, sensors, &options, 1)?;
        let emissions = virtual_vehicle.take_while(|emission| emission.time_s < SECONDS);
        Ok(Self(
            emissions
                .map(|emission| (emission.time_s, emission.port, emission.output))
                .collect(),
        ))
    }

    fn messages(&self, port: Port) -> impl Iterator<Item = &[u8]> {
        self.0
            .iter()
            .filter(move |(_, of, _)| *of == port)
            .filter_map(|(_, _, output)| match output {
                Output::Bytes(bytes) => Some(bytes.as_slice()),
                Output::Can(_) => None,
            })
    }

    fn frames(&self) -> impl Iterator<Item = &CanFrame> {
        self.0.iter().filter_map(|(_, _, output)| match output {
            Output::Can(frame) => Some(frame),
            Output::Bytes(_) => None,
        })
    }
}

fn serial(seeds: &Seeds, drive: &Drive, newer: &Drive) -> Result<()> {
    let imu: Vec<&[u8]> = drive.messages(Port::Imu).take(3).collect();
    seeds.stream("crossbow440", "s1", &imu.concat())?;
    let mut s2 = Vec::new();
    wire::crossbow440::Increments::default().encode_s2(&mut s2);
    seeds.stream("crossbow440", "s2", &s2)?;
    seeds.write("crossbow440_setup", "packets", &imu.concat())?;
    let quiet = wire::crossbow440::Command::quiet().encode();
    seeds.write("crossbow440_setup", "echo", &quiet)?;

    for (name, message) in ["bestpos", "bestvel", "time"]
        .iter()
        .zip(drive.messages(Port::Novatel))
    {
        seeds.stream("gnss", name, message)?;
        // Behind the header: identifier and body, without the checksum.
        let body = &message[28..message.len() - 4];
        let sealed = [&[0], &message[4..6], body].concat();
        seeds.write("novatel", name, &sealed)?;
        seeds.write(
            "novatel",
            &format!("{name}-short"),
            &[&[1], &sealed[1..]].concat(),
        )?;
    }
    for (generation, drive) in [("v1", drive), ("v2", newer)] {
        let blocks: Vec<&[u8]> = drive.messages(Port::Septentrio).take(4).collect();
        seeds.stream("gnss", &format!("sbf-{generation}"), &blocks.concat())?;
        for (index, block) in blocks.iter().enumerate() {
            let body = [&block[4..6], &block[8..]].concat();
            let twice = [&body[..], &body[..]].concat();
            seeds.stream("sbf", &format!("{generation}-{index}"), &twice)?;
        }
    }

    let place = Geodetic {
        latitude_rad: 0.5689,
        longitude_rad: -1.4887,
        height_m: 176.0,
    };
    let mut sentences = Vec::new();
    wire::nmea::encode_gga(61_200.25, place, -29.0, 9, &mut sentences);
    wire::nmea::encode_rmc(61_200.25, "150409", place, [3.0, 4.0, 0.0], &mut sentences);
    wire::nmea::encode_hrp(
        61_200.25,
        "150409",
        [1.0, 0.02, -0.03],
        [0.1; 3],
        &mut sentences,
    );
    seeds.stream("gnss", "nmea", &sentences)?;
    let text = String::from_utf8(sentences)?;
    let inner = text.lines().filter_map(|line| line.get(1..line.len() - 3));
    seeds.stream(
        "nmea",
        "gga-rmc-hrp",
        inner.collect::<Vec<_>>().join("\n").as_bytes(),
    )?;

    let pvt = wire::ubx::Body::Pvt(wire::ubx::Pvt::default());
    let mut messages = Vec::new();
    pvt.encode(&mut messages);
    seeds.stream("gnss", "ubx", &messages)?;
    let payload = &messages[6..messages.len() - 2];
    // 92 bytes, in units of three.
    seeds.stream("ubx", "nav-pvt", &[&[0x01, 0x07, 31], payload].concat())?;
    seeds.stream(
        "ubx",
        "esf-meas",
        &[0x10, 0x02, 5, 0, 0, 0, 0, 0, 8, 0, 0, 1, 0, 0, 16],
    )?;
    let mut output = Vec::new();
    let fields = [
        (wire::vectornav::Group::Common, 0),
        (wire::vectornav::Group::Imu, 9),
        (wire::vectornav::Group::Gnss, 5),
    ];
    wire::vectornav::encode_binary(&wire::vectornav::Binary::default(), &fields, &mut output);
    seeds.stream("vectornav", "binary", &output[1..output.len() - 2])?;
    seeds.stream("vectornav", "ymr", b"YMR,1,2,3,4,5,6,7,8,9,10,11,12")?;
    seeds.stream("recognise", "ubx", &messages)?;

    let position = wire::novatel::Body::Position(wire::novatel::Position::default());
    if let Some(log) = wire::novatel::Log::new(42, 1527, 320_400_000, position) {
        let mut ascii = Vec::new();
        log.encode_ascii(&mut ascii);
        seeds.stream("gnss", "ascii", &ascii)?;
        let end = ascii.iter().rposition(|byte| *byte == b'*').unwrap_or(1);
        seeds.write("novatel", "ascii", &[&[2], &ascii[1..end]].concat())?;
    }
    // Format (blanks, one field, counts of 16 bits, no prefix), the byte that cuts, the lines.
    seeds.write("line", "counts", b"\0\0\x10\0\x03100\r\n65535\r\n7\r\n")?;
    seeds.write("line", "named", b",\x02\0\x03\x05A=1.5,2,3\r\nA=4,5,6\r\n")?;
    Ok(())
}

/// The first messages of a drive, each with its source, the time since the last one in 4 ms, and its
/// length.
fn arrivals(seeds: &Seeds, drive: &Drive) -> Result<()> {
    let mut bytes = Vec::new();
    let mut last_s = 0.0;
    for (time_s, port, output) in &drive.0 {
        let source = match port {
            Port::Novatel => 0,
            Port::Imu => 1,
            _ => continue,
        };
        let Output::Bytes(message) = output else {
            continue;
        };
        let wait = ((time_s - last_s) / 0.004).round().min(255.0) as u8;
        if bytes.len() + 3 + message.len() > 512 || message.len() > 255 {
            break;
        }
        last_s = *time_s;
        bytes.extend([source, wait, message.len() as u8]);
        bytes.extend(message);
    }
    seeds.write("engine", "drive", &bytes)
}

fn can(seeds: &Seeds, drive: &Drive) -> Result<()> {
    let mut slcan = Vec::new();
    let mut candump = String::new();
    for (stamp_ms, frame) in drive.frames().take(12).enumerate() {
        let stamp = (stamp_ms % 2 == 0).then_some(stamp_ms as u64);
        slcan.extend(wire::slcan::encode_frame(frame, stamp).unwrap_or_default());
        candump += &wire::candump::format_line("can0", frame);
        candump.push('\n');
        candump += &wire::candump::format_frame(frame);
        candump.push('\n');
    }
    slcan.extend(b"F01\r\x07r1232\rT123456782AABB\rd1239");
    seeds.stream("slcan", "frames", &slcan)?;
    seeds.write("candump", "lines", candump.as_bytes())?;
    seeds.write(
        "candump",
        "kinds",
        b"123#R5\n12345678##1AABB\n20000004#0001000000000000\n",
    )?;
    Ok(())
}

fn texts(seeds: &Seeds) -> Result<()> {
    let dbc = include_bytes!("../../crates/engine/assets/prowler.dbc");
    seeds.write("dbc", "prowler", &[&[0x5A; 64], &dbc[..]].concat())?;
    let multiplexed = b"VERSION \"\"\nBU_: A\nBO_ 2147484160 M: 8 A\n SG_ S m0 : 7|12@0- (0.5,-3) [0|1] \"m\" A\n SG_ X M : 12|4@1+ (1,0) [0|0] \"\" A\nVAL_ 2147484160 X 0 \"off\" 1 \"on\" ;\nSIG_VALTYPE_ 2147484160 S : 1;\n";
    seeds.write(
        "dbc",
        "multiplexed",
        &[&[0xA5; 64], &multiplexed[..]].concat(),
    )?;
    for name in Vehicle::builtin_names() {
        let text = Vehicle::builtin_text(name).unwrap_or_default();
        seeds.write("vehicle", name, text.as_bytes())?;
    }
    for name in Sensors::builtin_names() {
        let text = Sensors::builtin_text(name).unwrap_or_default();
        seeds.write("sensors", name, text.as_bytes())?;
    }
    let calibration = estimator::Calibration::nominal("prowler").to_toml()?;
    seeds.write("calibration", "nominal", calibration.as_bytes())?;
    let sources = concat!(
        "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\nbitrate = 500000\n",
        "dbc = \"prowler.dbc\"\n[source.imu]\nkind = \"crossbow440\"\ndevice = \"/dev/ttyS1\"\n",
        "[source.gnss]\nkind = \"gnss\"\ndevice = \"gnss\"\nbaud = 115200\n",
        "[source.steer]\nkind = \"line\"\ndevice = \"steer\"\n",
        "[storage]\ndirectory = \"logs\"\nquota_mb = 100\nrotate_after_s = 60\n",
        "[estimator]\nenabled = true\n[vehicle]\nfile = \"prowler\"\n[control]\nsocket = \"s\"\n"
    );
    seeds.write("config", "sources", sources.as_bytes())?;
    Ok(())
}

fn arrivals(drive: &Drive) -> Vec<Arrival> {
    let start = LogTime(1_239_814_785_000_000_000);
    let notice = |notice| (0.0, SourceId(0), Payload::Notice(notice));
    let mut all = vec![
        notice(Notice::Opened("virtual".to_owned())),
        notice(Notice::Lost {
            place: LossPlace::Queue,
            count: 3,
        }),
        notice(Notice::Mark("gravel".to_owned())),
        notice(Notice::EstimatorSkipped {
            first_sequence: 1,
            count: 2,
        }),
        (0.0, SourceId::HOST, Payload::Tick),
    ];
    for (time_s, port, output) in drive.0.iter().take(120) {
        all.push(match output {
            Output::Bytes(bytes) => (*time_s, SourceId(0), Payload::Bytes(bytes.clone())),
            Output::Can(frame) => {
                let kernel_ns = Some(start.0 as i64 + (time_s * 1e9) as i64 - 40_000);
                let frame = CanFrame {
                    kernel_ns,
                    ..frame.clone()
                };
                (
                    *time_s,
                    SourceId(1 + *port as u16),
                    Payload::Can(vec![frame]),
                )
            }
        });
    }
    let numbered = all.into_iter().enumerate();
    numbered
        .map(|(sequence, (time_s, source, payload))| Arrival {
            sequence: sequence as u64,
            source,
            log_time: start.offset_seconds(time_s),
            realtime_ns: start.0 as i64 + (time_s * 1e9) as i64,
            payload,
        })
        .collect()
}

fn session() -> Session {
    let source = |id, name: &str, kind| Source {
        id: SourceId(id),
        name: name.to_owned(),
        kind,
    };
    Session {
        run_id: "seed".to_owned(),
        sources: vec![
            source(0, "imu", SourceKind::Serial),
            source(1 + Port::Can0 as u16, "can0", SourceKind::Can),
        ],
        ..Session::default()
    }
}

fn logs(seeds: &Seeds, drive: &Drive) -> Result<()> {
    let options = store::Options {
        raw_interval: Duration::from_millis(40),
        ..store::Options::default()
    };
    let mut writer = store::LogWriter::new(Vec::new(), session(), options, 0)?;
    for arrival in arrivals(drive) {
        if arrival.sequence % 40 == 0 {
            writer.record(&Record::Log(LogMessage {
                time: arrival.log_time,
                severity: sample::Severity::Warning,
                name: "imu".to_owned(),
                text: "fell silent".to_owned(),
            }));
        }
        writer.push(arrival)?;
    }
    let log = writer.finish(&BTreeMap::new())?;
    seeds.write("log_reader", "log", &log)?;
    seeds.write("recovery", "log", &log)?;
    let plain = uncompressed(&log)?;
    seeds.write("log_reader", "plain", &plain)?;
    seeds.write("recovery", "plain", &plain)?;
    seeds.write("recovery", "cut", &plain[..plain.len() * 2 / 3])?;
    raw_messages(seeds, &log)
}

/// The same log in chunks without compression and without checksums, so that a changed byte inside
/// of them is read.
fn uncompressed(log: &[u8]) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let options = mcap::WriteOptions::new()
        .compression(None)
        .chunk_size(Some(4096))
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false);
    let mut writer = options.create(Cursor::new(&mut bytes))?;
    for message in mcap::MessageStream::new(log)? {
        writer.write(&message?)?;
    }
    writer.finish()?;
    drop(writer);
    Ok(bytes)
}

/// The raw messages of a log one by one, and a journal's entry of each.
fn raw_messages(seeds: &Seeds, log: &[u8]) -> Result<()> {
    let mut kinds = BTreeMap::new();
    for message in mcap::MessageStream::new(log)? {
        let message = message?;
        let Some(schema) = &message.channel.schema else {
            continue;
        };
        let choice = match schema.name.as_str() {
            "atvrec.RawBytes" => 0_u8,
            "atvrec.RawCan" => 1,
            "atvrec.RawTicks" => 2,
            "atvrec.RawNotices" => 3,
            _ => continue,
        };
        kinds.entry(choice).or_insert((
            message.channel.topic.clone(),
            schema.name.clone(),
            message.data.to_vec(),
        ));
    }
    for (choice, (topic, schema, data)) in kinds {
        let name = schema.to_ascii_lowercase();
        seeds.write("raw_messages", &name, &[&[choice], &data[..]].concat())?;
        let batch = store::proto::atvrec::JournalBatch {
            topic,
            schema,
            source: Some(0),
            log_time_ns: 1,
            data,
        };
        let entry = store::proto::atvrec::JournalEntry {
            batches: vec![batch],
        };
        let body = prost::Message::encode_to_vec(&entry);
        seeds.write("journal", &name, &[&body[..], &body[..]].concat())?;
    }
    Ok(())
}
