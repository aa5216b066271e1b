//! Datagrams of estimates: a record of fixed size, or a line of JSON.

use sample::{LogTime, PerWheel, Wheel};

use super::{ControllerOutput, OutputState, Validity};

/// First bytes of a record: `ATVR` and the version of the layout.
const MAGIC: [u8; 4] = *b"ATVR";
const VERSION: u16 = 1;
/// Size of a record, bytes.
pub const DATAGRAM_BYTES: usize = 176;

/// The record of `output`, little-endian. docs/live.md has the table of its fields.
#[must_use]
pub fn encode_datagram(output: &ControllerOutput, sequence: u32) -> [u8; DATAGRAM_BYTES] {
    let mut bytes = Vec::with_capacity(DATAGRAM_BYTES);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((DATAGRAM_BYTES as u16).to_le_bytes());
    bytes.extend(sequence.to_le_bytes());
    bytes.extend([output.validity as u8, 0]);
    let lift = &output.lift;
    let flags = lift.lifted.0.into_iter().chain(lift.warned.0);
    let flags = flags.chain(lift.side_lifted).chain(lift.side_warned);
    let flags = flags.enumerate();
    let flags = flags.fold(0_u16, |bits, (n, set)| bits | u16::from(set) << n);
    bytes.extend(flags.to_le_bytes());
    bytes.extend(output.time.0.to_le_bytes());
    let age_us = (output.age_s * 1e6).clamp(0.0, f64::from(u32::MAX)) as u32;
    bytes.extend(age_us.to_le_bytes());
    bytes.extend(lift.surface_changes);
    bytes.extend([lift.events, 0]);
    for value in numbers(output) {
        bytes.extend((value as f32).to_le_bytes());
    }
    bytes
        .try_into()
        .expect("the fields have the size of the record")
}

/// The 36 numbers of a record.
fn numbers(output: &ControllerOutput) -> [f64; 36] {
    let mut numbers = [f64::NAN; 36];
    let forces = output.forces.0.iter();
    let each = forces.clone().flat_map(|force| force.force_n);
    let sigma = forces.flat_map(|force| force.sigma_n);
    let rollover = &output.rollover;
    let motion = &output.motion;
    let rest = [
        rollover.load_transfer_ratio,
        rollover.load_transfer_ratio_sigma,
    ];
    let times = rollover.time_to_lift_s.0;
    let all = each
        .chain(sigma)
        .chain(rest)
        .chain(times)
        .chain(rollover.time_to_two_wheel_lift_s)
        .chain([
            motion.velocity_x_m_s,
            motion.velocity_y_m_s,
            motion.roll_rad,
            motion.pitch_rad,
        ]);
    for (place, value) in numbers.iter_mut().zip(all) {
        *place = value;
    }
    numbers
}

/// Output and sequence number of a record; `None` if the bytes are no record of this version.
#[must_use]
pub fn decode_datagram(bytes: &[u8]) -> Option<(ControllerOutput, u32)> {
    let bytes: &[u8; DATAGRAM_BYTES] = bytes.try_into().ok()?;
    let short = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let word = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    if bytes[..4] != MAGIC || short(4) != VERSION || usize::from(short(6)) != DATAGRAM_BYTES {
        return None;
    }
    let mut output = OutputState::default().at(LogTime::default(), 0.0);
    output.validity = Validity::from_number(bytes[12])?;
    let flag = |n: usize| short(14) >> n & 1 != 0;
    let lift = &mut output.lift;
    lift.lifted = PerWheel::from_fn(|wheel: Wheel| flag(wheel.index()));
    lift.warned = PerWheel::from_fn(|wheel: Wheel| flag(4 + wheel.index()));
    lift.side_lifted = [flag(8), flag(9)];
    lift.side_warned = [flag(10), flag(11)];
    lift.surface_changes = [bytes[28], bytes[29]];
    lift.events = bytes[30];
    output.time = LogTime(u64::from(word(16)?) | u64::from(word(20)?) << 32);
    output.age_s = f64::from(word(24)?) / 1e6;
    let number = |n: usize| Some(f64::from(f32::from_bits(word(32 + 4 * n)?)));
    for n in 0..12 {
        output.forces.0[n / 3].force_n[n % 3] = number(n)?;
        output.forces.0[n / 3].sigma_n[n % 3] = number(12 + n)?;
    }
    let rollover = &mut output.rollover;
    rollover.load_transfer_ratio = number(24)?;
    rollover.load_transfer_ratio_sigma = number(25)?;
    for n in 0..4 {
        rollover.time_to_lift_s.0[n] = number(26 + n)?;
    }
    rollover.time_to_two_wheel_lift_s = [number(30)?, number(31)?];
    let motion = &mut output.motion;
    motion.velocity_x_m_s = number(32)?;
    motion.velocity_y_m_s = number(33)?;
    motion.roll_rad = number(34)?;
    motion.pitch_rad = number(35)?;
    Some((output, word(8)?))
}

/// The line of JSON of `output`, with a line feed. Unknown and infinite values are `null`.
#[must_use]
pub fn encode_json(output: &ControllerOutput, sequence: u32) -> String {
    let number = |value: f64| match value.is_finite() {
        true => format!("{value}"),
        false => "null".to_owned(),
    };
    let list = |values: &[f64]| {
        let values: Vec<String> = values.iter().map(|value| number(*value)).collect();
        format!("[{}]", values.join(","))
    };
    let flags = |values: &[bool]| {
        let values: Vec<String> = values.iter().map(ToString::to_string).collect();
        format!("[{}]", values.join(","))
    };
    let validity = match output.validity {
        Validity::Valid => "valid",
        Validity::None => "none",
        Validity::Stale => "stale",
        Validity::Unknown => "unknown",
    };
    let each = |of: &dyn Fn(usize) -> [f64; 3]| {
        let wheels: Vec<String> = (0..4).map(|n| list(&of(n))).collect();
        format!("[{}]", wheels.join(","))
    };
    let forces = &output.forces.0;
    let (rollover, motion, lift) = (&output.rollover, &output.motion, &output.lift);
    format!(
        "{{\"sequence\":{sequence},\"validity\":\"{validity}\",\"time_ns\":{},\"age_s\":{},\
         \"force_n\":{},\"sigma_n\":{},\"load_transfer_ratio\":{},\
         \"load_transfer_ratio_sigma\":{},\"time_to_lift_s\":{},\"time_to_two_wheel_lift_s\":{},\
         \"velocity_m_s\":{},\"roll_rad\":{},\"pitch_rad\":{},\"lifted\":{},\"lift_warning\":{},\
         \"side_lifted\":{},\"side_lift_warning\":{},\"surface_changes\":[{},{}],\"events\":{}}}\n",
        output.time.0,
        number(output.age_s),
        each(&|n| forces[n].force_n),
        each(&|n| forces[n].sigma_n),
        number(rollover.load_transfer_ratio),
        number(rollover.load_transfer_ratio_sigma),
        list(&rollover.time_to_lift_s.0),
        list(&rollover.time_to_two_wheel_lift_s),
        list(&[motion.velocity_x_m_s, motion.velocity_y_m_s]),
        number(motion.roll_rad),
        number(motion.pitch_rad),
        flags(&lift.lifted.0),
        flags(&lift.warned.0),
        flags(&lift.side_lifted),
        flags(&lift.side_warned),
        lift.surface_changes[0],
        lift.surface_changes[1],
        lift.events,
    )
}

#[cfg(test)]
mod tests {
    use super::super::tests::estimate;
    use super::*;

    fn output() -> ControllerOutput {
        let start = LogTime(1_700_000_000_123_456_789);
        let mut state = OutputState::default();
        state.estimate(&estimate(start));
        state.at(start.offset_seconds(0.0075), 0.1)
    }

    #[test]
    fn a_record_has_the_values() {
        let sent = output();
        let bytes = encode_datagram(&sent, 77);
        let (found, sequence) = decode_datagram(&bytes).expect("a record");
        assert_eq!((sequence, found.validity), (77, Validity::Valid));
        assert_eq!(found.time, sent.time);
        assert!((found.age_s - 0.0075).abs() < 2e-6, "{}", found.age_s);
        for wheel in Wheel::ALL {
            assert_eq!(found.forces[wheel].force_n, sent.forces[wheel].force_n);
        }
        assert_eq!(found.rollover.time_to_lift_s.0[1], f64::INFINITY);
        assert_eq!(found.motion.velocity_x_m_s, 8.0);
        assert!(decode_datagram(&bytes[1..]).is_none());
        assert!(decode_datagram(&[0; DATAGRAM_BYTES]).is_none());
    }

    #[test]
    fn a_line_is_json_with_null_for_unknown_values() {
        let line = encode_json(&output(), 3);
        let value: serde_json::Value = serde_json::from_str(&line).expect("JSON");
        assert_eq!(value["validity"], "valid");
        assert_eq!(value["force_n"][3][2], 1003.0);
        assert_eq!(value["time_to_lift_s"][1], serde_json::Value::Null);
        assert!(line.ends_with("}\n"));
    }
}
