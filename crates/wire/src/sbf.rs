//! Septentrio Binary Format, the blocks of the PolaRx2e (PolaRx2/2e SBF reference guide) and
//! those of the receivers since (mosaic-X5 reference guide).

mod body;
mod convert;
mod ins;

pub use body::{AttitudeCovariance, Body, Covariance, EulerAttitude, Pvt, PvtV1};
pub(crate) use convert::Memory;
pub use ins::{ExternalSensor, InsNavigation, SENSORS_MAX};

use crc::{CRC_16_XMODEM, Crc, Table};
use sample::DeviceTime;

use crate::codec::{BinaryReader, BinaryWriter, Codec};
use crate::frame::Scan;

static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_XMODEM);

const SYNC: [u8; 2] = [0x24, 0x40];
const HEADER: usize = 8;
/// Longest block that is waited for.
pub(crate) const MAX_FRAME: usize = 8192;

/// Number and name of the blocks that are decoded.
const BLOCKS: [(u16, &str); 15] = [
    (4050, "ExtSensorMeas"),
    (4225, "INSNavCart"),
    (4226, "INSNavGeod"),
    (4006, "PVTCartesian"),
    (4007, "PVTGeodetic"),
    (5903, "PVTCartesianV1"),
    (5904, "PVTGeodeticV1"),
    (5905, "PosCovCartesian"),
    (5906, "PosCovGeodetic"),
    (5907, "VelCovCartesian"),
    (5908, "VelCovGeodetic"),
    (5911, "xPPSOffset"),
    (5914, "ReceiverTime"),
    (5938, "AttEuler"),
    (5939, "AttCovEuler"),
];

/// Number and name of the blocks that are known by name alone.
const KNOWN: [(u16, &str); 58] = [
    (4000, "MeasExtra"),
    (4001, "DOP"),
    (4002, "GALNav"),
    (4003, "GALAlm"),
    (4004, "GLONav"),
    (4005, "GLOAlm"),
    (4014, "ReceiverStatus"),
    (4015, "Commands"),
    (4017, "GPSRawCA"),
    (4018, "GPSRawL2C"),
    (4022, "GALRawFNAV"),
    (4023, "GALRawINAV"),
    (4026, "GLORawCA"),
    (4027, "MeasEpoch"),
    (4028, "BaseVectorGeod"),
    (4030, "GALIon"),
    (4031, "GALUtc"),
    (4032, "GALGstGps"),
    (4034, "GALSARRLM"),
    (4036, "GLOTime"),
    (4040, "BBSamples"),
    (4043, "BaseVectorCart"),
    (4047, "BDSRaw"),
    (4052, "PosLocal"),
    (4053, "NTRIPClientStatus"),
    (4058, "IPStatus"),
    (4059, "DiskStatus"),
    (4076, "PVTSupport"),
    (4079, "PVTSupportA"),
    (4081, "BDSNav"),
    (4082, "QualityInd"),
    (4090, "InputLink"),
    (4091, "OutputLink"),
    (4092, "RFStatus"),
    (4103, "RxMessage"),
    (4105, "DynDNSStatus"),
    (4119, "BDSAlm"),
    (4120, "BDSIon"),
    (4121, "BDSUtc"),
    (4122, "NTRIPServerStatus"),
    (4238, "P2PPStatus"),
    (4245, "GALAuthStatus"),
    (5891, "GPSNav"),
    (5892, "GPSAlm"),
    (5893, "GPSIon"),
    (5894, "GPSUtc"),
    (5896, "GEONav"),
    (5897, "GEOAlm"),
    (5902, "ReceiverSetup"),
    (5918, "GEONetworkTime"),
    (5919, "DiffCorrIn"),
    (5921, "EndOfPVT"),
    (5922, "EndOfMeas"),
    (5925, "GEOMT00"),
    (5936, "Comment"),
    (5942, "AuxAntPositions"),
    (5943, "EndOfAtt"),
    (5949, "BaseStation"),
];

/// One block.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Block number, bits 0 to 12 of the id.
    pub number: u16,
    /// Block revision, bits 13 to 15 of the id.
    pub revision: u8,
    /// Milliseconds of the week, GPS time.
    pub time_of_week_ms: Option<u32>,
    /// GPS week.
    pub week: Option<u16>,
    /// Its content.
    pub body: Body,
}

impl Block {
    /// A block of this number at a GPS time; the number must fit the body.
    #[must_use]
    pub fn new(number: u16, revision: u8, week: u16, time_of_week_ms: u32, body: Body) -> Self {
        Self {
            number,
            revision,
            time_of_week_ms: Some(time_of_week_ms),
            week: Some(week),
            body,
        }
    }

    /// The time that the block's values are for. A PVT is valid at its time tag.
    #[must_use]
    pub fn device_time(&self) -> Option<DeviceTime> {
        self.time_of_week_ms.map(|ms| DeviceTime::Gps {
            week: self.week,
            time_of_week_s: f64::from(ms) / 1000.0,
        })
    }

    /// Appends the block's bytes.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let start = out.len();
        out.extend(SYNC);
        out.extend([0; 2]);
        out.extend((self.number | u16::from(self.revision) << 13).to_le_bytes());
        out.extend([0; 2]);
        let mut writer = BinaryWriter(out);
        let (mut tow, mut week) = (self.time_of_week_ms, self.week);
        let mut body = self.body;
        // A writer never ends the walk.
        let _ = writer.optional_u32(&mut tow);
        let _ = writer.optional_u16(&mut week);
        let _ = body.walk(&mut writer, self.revision);
        while !(out.len() - start).is_multiple_of(4) {
            out.push(0);
        }
        let length = (out.len() - start) as u16;
        out[start + 6..start + 8].copy_from_slice(&length.to_le_bytes());
        let crc = CRC.checksum(&out[start + 4..]);
        out[start + 2..start + 4].copy_from_slice(&crc.to_le_bytes());
    }
}

/// Scans bytes that begin with `$`; an NMEA sentence is none of its business.
pub(crate) fn scan(bytes: &[u8]) -> Scan<()> {
    match bytes.get(1) {
        None => return Scan::Need(2),
        Some(second) if *second != SYNC[1] => return Scan::Skip(1),
        Some(_) => {}
    }
    if bytes.len() < HEADER {
        return Scan::Need(HEADER);
    }
    let len = usize::from(u16::from_le_bytes([bytes[6], bytes[7]]));
    if !(HEADER..=MAX_FRAME).contains(&len) || !len.is_multiple_of(4) {
        return Scan::Skip(1);
    }
    if bytes.len() < len {
        return Scan::Need(len);
    }
    let saved = u16::from_le_bytes([bytes[2], bytes[3]]);
    if CRC.checksum(&bytes[4..len]) == saved {
        Scan::Frame { len, kind: () }
    } else {
        Scan::BadChecksum
    }
}

/// What a block with a good checksum turned out to be.
#[expect(
    clippy::large_enum_variant,
    reason = "it lives for one message, on the stack"
)]
pub(crate) enum Decoded {
    Block(&'static str, Block),
    /// With its name if that is known.
    Unknown(u16, Option<&'static str>),
    Malformed(u16),
}

/// Decodes a block that [`scan`] has checked.
pub(crate) fn decode(bytes: &[u8]) -> Decoded {
    let id = u16::from_le_bytes([bytes[4], bytes[5]]);
    let (number, revision) = (id & 0x1FFF, (id >> 13) as u8);
    let known = BLOCKS.iter().find(|block| block.0 == number);
    let (Some((_, name)), Some(body)) = (known, Body::empty(number)) else {
        let known = KNOWN.iter().find(|block| block.0 == number);
        return Decoded::Unknown(number, known.map(|(_, name)| *name));
    };
    let mut block = Block {
        number,
        revision,
        time_of_week_ms: None,
        week: None,
        body,
    };
    let mut reader = BinaryReader(&bytes[HEADER..]);
    let mut walk = || {
        reader.optional_u32(&mut block.time_of_week_ms)?;
        reader.optional_u16(&mut block.week)?;
        block.body.walk(&mut reader, revision)
    };
    match walk() {
        Some(()) => Decoded::Block(name, block),
        None => Decoded::Malformed(number),
    }
}

/// Commands that make a PolaRx2e send position, velocity and attitude with covariances on `port`
/// every `period_s` seconds, as on the Prowler: `SetPVTInterval 0.1`,
/// `SetSBFOutput COM1, PVTCar+CovCar+AttEuler+CovEuler`.
#[must_use]
pub fn polarx2e_commands(port: &str, period_s: f64) -> [String; 2] {
    [
        format!("SetPVTInterval {period_s}\r\n"),
        format!("SetSBFOutput {port}, PVTCar+CovCar+AttEuler+CovEuler\r\n"),
    ]
}

/// The command that makes a receiver of the current generation send the same on `port`, as stream
/// 1, every `period_ms` milliseconds.
#[must_use]
pub fn output_command(port: &str, period_ms: u32) -> String {
    let blocks = "PVTGeodetic+PosCovGeodetic+VelCovGeodetic+AttEuler+AttCovEuler";
    format!("setSBFOutput, Stream1, {port}, {blocks}, msec{period_ms}\r\n")
}
