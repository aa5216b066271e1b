//! Binary outputs: a byte with a bit for each group, a mask of fields for each group, the fields, and a
//! checksum.

use super::{Form, SYNC, checksum};
use crate::codec::{BinaryReader, BinaryWriter, Codec};
use crate::frame::Scan;

/// Longest output that is waited for: satellites and raw measurements of two receivers.
const MAX_FRAME: usize = 6000;
/// Bit of a mask that says that a further mask follows.
const EXTENDED: usize = 15;
/// Fields of variable length of the groups of receivers: satellites, and raw measurements.
const SATELLITES: usize = 14;
const RAW: usize = 16;

/// A group of fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// The common fields of all others.
    Common,
    /// Clocks.
    Time,
    /// Inertial unit.
    Imu,
    /// First receiver.
    Gnss,
    /// Attitude.
    Attitude,
    /// Navigation by inertial unit and receiver.
    Ins,
    /// Second receiver.
    Gnss2,
}

impl Group {
    const ALL: [Self; 7] = [
        Self::Common,
        Self::Time,
        Self::Imu,
        Self::Gnss,
        Self::Attitude,
        Self::Ins,
        Self::Gnss2,
    ];

    /// Bytes of the fields, in the order of their bits; 0 for a field that is not known.
    const fn lengths(self) -> &'static [u8] {
        match self {
            Self::Common => &[8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8],
            Self::Time => &[8, 8, 8, 2, 8, 8, 8, 4, 4, 1],
            Self::Imu => &[2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2],
            Self::Gnss | Self::Gnss2 => &[8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28],
            Self::Attitude => &[2, 12, 16, 36, 12, 12, 12, 12, 12],
            Self::Ins => &[2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4],
        }
    }

    const fn is_receiver(self) -> bool {
        matches!(self, Self::Gnss | Self::Gnss2)
    }
}

/// The fields of a binary output that are used, in the device's units; the others are passed over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Binary {
    /// Time since the start of the device, ns.
    pub since_start_ns: Option<u64>,
    /// Time since the GPS epoch, ns.
    pub gps_ns: Option<u64>,
    /// GPS time of week, ns, and week.
    pub gps_week: (Option<u64>, Option<u16>),
    /// Bit 0: GPS time of week known; bit 1: date known.
    pub time_status: Option<u8>,
    /// Acceleration without temperature and bias compensation by the filter, m/s^2.
    pub uncompensated_acceleration_m_s2: Option<[f32; 3]>,
    /// Angular rate without compensation, rad/s.
    pub uncompensated_rate_rad_s: Option<[f32; 3]>,
    /// Compensated acceleration, m/s^2: specific force along x forward, y right, z down.
    pub acceleration_m_s2: Option<[f32; 3]>,
    /// Compensated angular rate, rad/s.
    pub rate_rad_s: Option<[f32; 3]>,
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Yaw (clockwise from true north), pitch (nose up), roll (right side down), degrees.
    pub yaw_pitch_roll_deg: Option<[f32; 3]>,
    /// Latitude and longitude in degrees and height above the ellipsoid in m of the navigation.
    pub ins_position: Option<[f64; 3]>,
    /// Velocity north, east, down of the navigation, m/s.
    pub ins_velocity_ned_m_s: Option<[f32; 3]>,
    /// State of the navigation: bits 0, 1: 0 not tracking, 1 aligning, 2 tracking, 3 without receiver.
    pub ins_status: Option<u16>,
    /// Standard deviations of position and velocity of the navigation, m and m/s.
    pub ins_sigma: [Option<f32>; 2],
    /// Fix of the first receiver: 0 none, 1 time, 2 and 3 dimensions, 4 SBAS, 7 and 8 RTK float and fixed.
    pub fix: Option<u8>,
    /// Satellites of the first receiver.
    pub satellites: Option<u8>,
    /// As [`Binary::ins_position`], of the first receiver.
    pub gnss_position: Option<[f64; 3]>,
    /// Velocity north, east, down of the first receiver, m/s.
    pub gnss_velocity_ned_m_s: Option<[f32; 3]>,
    /// Standard deviations north, east, down of the position, m.
    pub gnss_position_sigma_m: Option<[f32; 3]>,
    /// Standard deviation of the velocity, m/s.
    pub gnss_velocity_sigma_m_s: Option<f32>,
    /// Time since the last pulse per second, ns.
    pub since_pulse_ns: Option<u64>,
}

/// Group and bit of each field.
type Fields = Vec<(Group, usize)>;

/// The fields of an output, and the length of its head.
fn fields(bytes: &[u8]) -> Result<(Fields, usize), Scan<Form>> {
    let Some(groups) = bytes.get(1).copied() else {
        return Err(Scan::Need(2));
    };
    if groups == 0 || groups & 0x80 != 0 {
        return Err(Scan::Skip(1));
    }
    let mut fields = Vec::new();
    let mut at = 2;
    let used = |(index, _): &(usize, Group)| groups >> index & 1 != 0;
    for (_, group) in Group::ALL.into_iter().enumerate().filter(used) {
        let mut first = 0;
        loop {
            let Some(mask) = bytes.get(at..at + 2) else {
                return Err(Scan::Need(at + 2));
            };
            let mask = u16::from_le_bytes([mask[0], mask[1]]);
            at += 2;
            let bits = (0..EXTENDED).filter(|bit| mask >> bit & 1 != 0);
            fields.extend(bits.map(|bit| (group, first + bit)));
            if mask >> EXTENDED & 1 == 0 {
                break;
            }
            first += EXTENDED + 1;
            if !group.is_receiver() || first > EXTENDED + 1 {
                return Err(Scan::Skip(1));
            }
        }
    }
    if fields.is_empty() {
        return Err(Scan::Skip(1));
    }
    Ok((fields, at))
}

/// Length of a field at the start of `bytes`.
fn length(group: Group, bit: usize, bytes: &[u8], from: usize) -> Result<usize, Scan<Form>> {
    let known = group.lengths().get(bit).copied().unwrap_or(0);
    if known > 0 {
        return Ok(known.into());
    }
    let (head, count_at, each) = match (group.is_receiver(), bit) {
        (true, SATELLITES) => (2, 0, 8),
        (true, RAW) => (12, 10, 28),
        _ => return Err(Scan::Skip(1)),
    };
    let Some(count) = bytes.get(from + count_at) else {
        return Err(Scan::Need(from + head));
    };
    Ok(head + each * usize::from(*count))
}

/// Scans bytes that begin with the sync byte.
pub(super) fn scan(bytes: &[u8]) -> Scan<Form> {
    let scanned = || {
        let (fields, mut at) = fields(bytes)?;
        for (group, bit) in fields {
            at += length(group, bit, bytes, at)?;
            if at > MAX_FRAME {
                return Err(Scan::Skip(1));
            }
        }
        Ok(at + 2)
    };
    let len = match scanned() {
        Ok(len) => len,
        Err(scan) => return scan,
    };
    if bytes.len() < len {
        return Scan::Need(len);
    }
    // The checksum over itself is zero.
    if checksum(&bytes[1..len]) == 0 {
        Scan::Frame {
            len,
            kind: Form::Binary,
        }
    } else {
        Scan::BadChecksum
    }
}

/// Decodes an output that [`scan`] has checked.
pub(super) fn decode(bytes: &[u8]) -> Option<Binary> {
    let (fields, mut at) = fields(bytes).ok()?;
    let mut output = Binary::default();
    for (group, bit) in fields {
        let length = length(group, bit, bytes, at).ok()?;
        let mut reader = BinaryReader(bytes.get(at..at + length)?);
        output.walk(group, bit, &mut reader)?;
        at += length;
    }
    Some(output)
}

fn long(c: &mut impl Codec, value: &mut Option<u64>) -> Option<()> {
    let mut number = value.unwrap_or_default();
    let [mut low, mut high] = [number as u32, (number >> 32) as u32];
    c.u32(&mut low)?;
    c.u32(&mut high)?;
    number = u64::from(high) << 32 | u64::from(low);
    *value = Some(number);
    Some(())
}

fn floats<const N: usize>(c: &mut impl Codec, value: &mut Option<[f32; N]>) -> Option<()> {
    let mut all = value.unwrap_or([0.0; N]);
    all.iter_mut().try_for_each(|v| c.f32(v, 6))?;
    *value = Some(all);
    Some(())
}

fn float(c: &mut impl Codec, value: &mut Option<f32>) -> Option<()> {
    let mut one = value.map(|v| [v]);
    floats(c, &mut one)?;
    *value = one.map(|[v]| v);
    Some(())
}

fn doubles(c: &mut impl Codec, value: &mut Option<[f64; 3]>) -> Option<()> {
    let mut all = value.unwrap_or([0.0; 3]);
    all.iter_mut().try_for_each(|v| c.f64(v, 9))?;
    *value = Some(all);
    Some(())
}

fn byte(c: &mut impl Codec, value: &mut Option<u8>) -> Option<()> {
    let mut one = value.unwrap_or_default();
    c.u8(&mut one)?;
    *value = Some(one);
    Some(())
}

fn word(c: &mut impl Codec, value: &mut Option<u16>) -> Option<()> {
    let mut one = value.unwrap_or_default();
    c.u16(&mut one)?;
    *value = Some(one);
    Some(())
}

impl Binary {
    /// Reads or writes one field; a field that is not used is passed over.
    fn walk(&mut self, group: Group, bit: usize, c: &mut impl Codec) -> Option<()> {
        use Group::{Attitude, Common, Gnss, Gnss2, Imu, Ins, Time};
        match (group, bit) {
            (Common | Time, 0) => long(c, &mut self.since_start_ns),
            (Common | Time, 1) => long(c, &mut self.gps_ns),
            (Time, 2) => long(c, &mut self.gps_week.0),
            (Time, 3) => word(c, &mut self.gps_week.1),
            (Time, 5) | (Common, 14) => long(c, &mut self.since_pulse_ns),
            (Time, 9) => byte(c, &mut self.time_status),
            (Common, 3) | (Attitude, 1) => floats(c, &mut self.yaw_pitch_roll_deg),
            (Common, 5) | (Imu, 10) => floats(c, &mut self.rate_rad_s),
            (Common, 6) | (Ins, 1) => doubles(c, &mut self.ins_position),
            (Common, 7) | (Ins, 4) => floats(c, &mut self.ins_velocity_ned_m_s),
            (Common, 8) | (Imu, 9) => floats(c, &mut self.acceleration_m_s2),
            (Common, 9) => {
                floats(c, &mut self.uncompensated_acceleration_m_s2)?;
                floats(c, &mut self.uncompensated_rate_rad_s)
            }
            (Common, 10) => {
                floats(c, &mut Some([0.0_f32; 3]))?;
                float(c, &mut self.temperature_c)?;
                float(c, &mut None)
            }
            (Common, 12) | (Ins, 0) => word(c, &mut self.ins_status),
            (Imu, 2) => floats(c, &mut self.uncompensated_acceleration_m_s2),
            (Imu, 3) => floats(c, &mut self.uncompensated_rate_rad_s),
            (Imu, 4) => float(c, &mut self.temperature_c),
            (Ins, 9) => float(c, &mut self.ins_sigma[0]),
            (Ins, 10) => float(c, &mut self.ins_sigma[1]),
            (Gnss, 3) => byte(c, &mut self.satellites),
            (Gnss, 4) => byte(c, &mut self.fix),
            (Gnss, 5) => doubles(c, &mut self.gnss_position),
            (Gnss, 7) => floats(c, &mut self.gnss_velocity_ned_m_s),
            (Gnss, 9) => floats(c, &mut self.gnss_position_sigma_m),
            (Gnss, 10) => float(c, &mut self.gnss_velocity_sigma_m_s),
            (Common | Time | Imu | Gnss | Gnss2 | Attitude | Ins, _) => {
                let length = group.lengths().get(bit).copied().unwrap_or(0);
                // The reader has the bytes of this field alone; a writer fills it with zeros.
                (0..length).try_for_each(|_| c.u8(&mut 0))
            }
        }
    }
}

/// Appends an output with these fields, in the order of groups and bits. A field that [`Binary`] does not
/// have is zero; fields of variable length are not written.
pub fn encode_binary(output: &Binary, fields: &[(Group, u8)], out: &mut Vec<u8>) {
    let start = out.len();
    out.push(SYNC);
    let mut groups = 0;
    let mut masks = Vec::new();
    let mut content = Vec::new();
    let mut output = *output;
    for (index, group) in Group::ALL.into_iter().enumerate() {
        let of_group = |bit: &usize| fields.contains(&(group, *bit as u8));
        let bits: Vec<usize> = (0..group.lengths().len()).filter(of_group).collect();
        if bits.is_empty() {
            continue;
        }
        groups |= 1 << index;
        let mask = bits.iter().fold(0_u16, |mask, bit| mask | 1 << bit);
        masks.extend(mask.to_le_bytes());
        for bit in bits {
            // A writer never ends the walk.
            let _ = output.walk(group, bit, &mut BinaryWriter(&mut content));
        }
    }
    out.push(groups);
    out.extend(masks);
    out.extend(content);
    let crc = checksum(&out[start + 1..]);
    out.extend(crc.to_be_bytes());
}
