//! Writes the inputs that fuzzing begins with: what the project's own encoders say.
//!
//! `cargo run --manifest-path fuzz/Cargo.toml --example seeds`

use std::path::{Path, PathBuf};

use sample::{CanFlags, CanFrame};
use wire::geodesy::Geodetic;
use wire::{crossbow440, novatel};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let seeds = Seeds(Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds"));
    inertial(&seeds)?;
    gnss(&seeds)?;
    can(&seeds)?;
    let dbc = include_bytes!("../../bins/atvrec/assets/prowler.dbc");
    seeds.write("dbc", "prowler", &[&[0x5A; 64], &dbc[..]].concat())?;
    // Format (blanks, one field, counts of 16 bits, no prefix), the byte that cuts, the lines.
    seeds.write("line", "counts", b"\0\0\x10\0\x03100\r\n65535\r\n7\r\n")?;
    seeds.write("line", "named", b",\x02\0\x03\x05A=1.5,2,3\r\nA=4,5,6\r\n")
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

fn inertial(seeds: &Seeds) -> Result<()> {
    let mut packets = Vec::new();
    crossbow440::Increments::default().encode_s2(&mut packets);
    packets.extend(crossbow440::encode_packet(*b"S1", &[0; 24]));
    seeds.stream("crossbow440", "s2-s1", &packets)?;
    let echo = crossbow440::Command::quiet().encode();
    seeds.write("crossbow440_setup", "echo", &echo)
}

fn gnss(seeds: &Seeds) -> Result<()> {
    let position = novatel::Body::Position(novatel::Position::default());
    if let Some(log) = novatel::Log::new(42, 1527, 320_400_000, position) {
        let (mut binary, mut ascii) = (Vec::new(), Vec::new());
        log.encode_binary(&mut binary);
        log.encode_ascii(&mut ascii);
        seeds.stream("gnss", "bestpos", &binary)?;
        seeds.stream("gnss", "ascii", &ascii)?;
        // Behind the header: identifier and body, without the checksum.
        let body = &binary[28..binary.len() - 4];
        seeds.write("novatel", "bestpos", &[&[0], &binary[4..6], body].concat())?;
        let end = ascii.iter().rposition(|byte| *byte == b'*').unwrap_or(1);
        seeds.write("novatel", "ascii", &[&[2], &ascii[1..end]].concat())?;
    }
    // Numbers of PVTGeodetic, AttEuler and AttCovEuler, each with a body of zeros.
    for (name, number) in [("pvt", 4007_u16), ("attitude", 5938), ("covariance", 5939)] {
        let block = [&number.to_le_bytes()[..], &[0; 86]].concat();
        seeds.stream("sbf", name, &block.repeat(2))?;
        seeds.stream("gnss", name, &atvrec_fuzz::sbf(&block))?;
    }
    let place = Geodetic {
        latitude_rad: 0.5689,
        longitude_rad: -1.4887,
        height_m: 176.0,
    };
    let mut text = Vec::new();
    wire::nmea::encode_gga(61_200.25, place, -29.0, 9, &mut text);
    wire::nmea::encode_rmc(61_200.25, "150409", place, [3.0, 4.0, 0.0], &mut text);
    wire::nmea::encode_hrp(61_200.25, "150409", [1.0, 0.02, -0.03], [0.1; 3], &mut text);
    seeds.stream("gnss", "nmea", &text)?;
    let text = String::from_utf8(text)?;
    let inner = text.lines().filter_map(|line| line.get(1..line.len() - 3));
    let inner = inner.collect::<Vec<_>>().join("\n");
    seeds.stream("nmea", "gga-rmc-hrp", inner.as_bytes())
}

fn can(seeds: &Seeds) -> Result<()> {
    let (mut slcan, mut candump) = (Vec::new(), String::new());
    for id in 0x100..0x10C_u32 {
        let data = [id as u8; 8];
        let length = (id & 7) as usize;
        let Some(frame) = CanFrame::new(id, CanFlags::default(), &data[..length]) else {
            continue;
        };
        let stamp = (id % 2 == 0).then_some(u64::from(id));
        slcan.extend(wire::slcan::encode_frame(&frame, stamp).unwrap_or_default());
        candump += &wire::candump::format_frame(&frame);
        candump.push('\n');
    }
    slcan.extend(b"F01\r\x07r1232\rT123456782AABB\rd1239");
    candump += "123#R5\n12345678##1AABB\n20000004#0001000000000000\n";
    seeds.stream("slcan", "frames", &slcan)?;
    seeds.write("candump", "lines", candump.as_bytes())
}
