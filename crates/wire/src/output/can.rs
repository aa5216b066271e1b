//! Frames of an estimate; the file `atvrec-output.dbc` describes them.

use sample::{CanFlags, CanFrame, PerWheel, Side, Wheel};

use super::{ControllerOutput, LiftState, Validity};
use crate::e2e;

/// Number of frames of an estimate. They have consecutive identifiers.
pub const FRAMES: usize = 11;

/// The DBC file of the frames, for the identifiers from 0x500 on.
pub const DBC: &str = include_str!("../../assets/atvrec-output.dbc");

const FORCES: usize = 0;
const SIGMAS: usize = 4;
const ROLLOVER: usize = 8;
const LIFT_TIMES: usize = 9;

/// Unit of load-transfer ratio and its standard deviation.
const RATIO: f64 = 1e-4;
/// Unit of the age, s.
const AGE_S: f64 = 1e-4;
/// Unit of times to lift, s.
const LIFT_S: f64 = 0.02;
/// Unit of the speed, m/s.
const SPEED_M_S: f64 = 0.2;

/// Frames of `output`, the first of which has the identifier `first_id`. The data identifiers of E2E
/// are the lower 16 bits of the identifiers.
#[must_use]
pub fn encode_frames(
    output: &ControllerOutput,
    first_id: u32,
    extended: bool,
    counter: u8,
) -> [CanFrame; FRAMES] {
    std::array::from_fn(|index| {
        let id = first_id + index as u32;
        let mut data = payload(output, index);
        data[1] = (output.validity as u8) << 4;
        e2e::protect(&mut data, id as u16, counter);
        let flags = CanFlags {
            extended,
            ..CanFlags::default()
        };
        CanFrame::new(id, flags, &data).expect("eight bytes are a classic frame")
    })
}

/// Bytes 2 to 7 of a frame.
fn payload(output: &ControllerOutput, index: usize) -> [u8; 8] {
    let mut data = [0; 8];
    let mut put = |at: usize, bytes: &[u8]| data[at..at + bytes.len()].copy_from_slice(bytes);
    match index {
        FORCES..SIGMAS => {
            let force = &output.forces.0[index - FORCES];
            for axis in 0..3 {
                put(2 + 2 * axis, &signed(force.force_n[axis], 1.0));
            }
        }
        SIGMAS..ROLLOVER => {
            let force = &output.forces.0[index - SIGMAS];
            for axis in 0..3 {
                put(2 + 2 * axis, &unsigned(force.sigma_n[axis], 1.0));
            }
        }
        ROLLOVER => {
            let rollover = &output.rollover;
            put(2, &signed(rollover.load_transfer_ratio, RATIO));
            put(4, &unsigned(rollover.load_transfer_ratio_sigma, RATIO));
            put(6, &unsigned(output.age_s, AGE_S));
        }
        LIFT_TIMES => {
            let rollover = &output.rollover;
            let wheels = rollover.time_to_lift_s.0.into_iter();
            let times = wheels.chain(rollover.time_to_two_wheel_lift_s);
            for (n, time_s) in times.enumerate() {
                put(2 + n, &[byte(time_s, LIFT_S)]);
            }
        }
        _ => {
            let lift = &output.lift;
            let [left, right] = Side::ALL.map(Side::index);
            let sides = |side: [bool; 2]| u8::from(side[left]) | u8::from(side[right]) << 1;
            put(2, &[bits(lift.lifted) | bits(lift.warned) << 4]);
            put(3, &[sides(lift.side_lifted) | sides(lift.side_warned) << 2]);
            put(4, &lift.surface_changes);
            put(
                6,
                &[
                    lift.events,
                    byte(output.motion.velocity_x_m_s.abs(), SPEED_M_S),
                ],
            );
        }
    }
    data
}

fn bits(wheels: PerWheel<bool>) -> u8 {
    let each = wheels.0.into_iter().enumerate();
    each.fold(0, |bits, (n, set)| bits | u8::from(set) << n)
}

/// Two's complement; the least value means unknown.
fn signed(value: f64, unit: f64) -> [u8; 2] {
    let limit = f64::from(i16::MAX);
    let raw = match value.is_nan() {
        true => i16::MIN,
        false => (value / unit).round().clamp(-limit, limit) as i16,
    };
    raw.to_le_bytes()
}

/// The largest value means unknown.
fn unsigned(value: f64, unit: f64) -> [u8; 2] {
    let raw = match value.is_nan() {
        true => u16::MAX,
        false => (value / unit).round().clamp(0.0, f64::from(u16::MAX - 1)) as u16,
    };
    raw.to_le_bytes()
}

/// The largest value means unknown, the one below it more than can be sent.
fn byte(value: f64, unit: f64) -> u8 {
    match value.is_nan() {
        true => u8::MAX,
        false => (value / unit).round().clamp(0.0, f64::from(u8::MAX - 1)) as u8,
    }
}

/// Values of the frames of one estimate; `None` if a checksum or the order of the identifiers is
/// wrong. Unknown values are NaN.
#[must_use]
pub fn decode_frames(frames: &[CanFrame; FRAMES]) -> Option<(ControllerOutput, u8)> {
    let mut output = super::OutputState::default().at(sample::LogTime::default(), 0.0);
    let mut counter = None;
    for (index, frame) in frames.iter().enumerate() {
        let data: &[u8; 8] = frame.bytes().try_into().ok()?;
        let found = e2e::check(data, frame.id as u16)?;
        if *counter.get_or_insert(found) != found || frame.id != frames[0].id + index as u32 {
            return None;
        }
        output.validity = Validity::from_number(data[1] >> 4)?;
        let pair = |at: usize| [data[at], data[at + 1]];
        match index {
            FORCES..SIGMAS => {
                let force = &mut output.forces.0[index - FORCES];
                force.force_n = [2, 4, 6].map(|at| from_signed(pair(at), 1.0));
            }
            SIGMAS..ROLLOVER => {
                let force = &mut output.forces.0[index - SIGMAS];
                force.sigma_n = [2, 4, 6].map(|at| from_unsigned(pair(at), 1.0));
            }
            ROLLOVER => {
                let rollover = &mut output.rollover;
                rollover.load_transfer_ratio = from_signed(pair(2), RATIO);
                rollover.load_transfer_ratio_sigma = from_unsigned(pair(4), RATIO);
                output.age_s = from_unsigned(pair(6), AGE_S);
            }
            LIFT_TIMES => {
                let times: [f64; 6] = std::array::from_fn(|n| from_byte(data[2 + n], LIFT_S));
                let [a, b, c, d, left, right] = times;
                output.rollover.time_to_lift_s = PerWheel([a, b, c, d]);
                output.rollover.time_to_two_wheel_lift_s = [left, right];
            }
            _ => {
                let wheels = |bits: u8| PerWheel::from_fn(|w: Wheel| bits >> w.index() & 1 != 0);
                let sides = |bits: u8| [bits & 1 != 0, bits & 2 != 0];
                output.lift = LiftState {
                    lifted: wheels(data[2]),
                    warned: wheels(data[2] >> 4),
                    side_lifted: sides(data[3]),
                    side_warned: sides(data[3] >> 2),
                    surface_changes: pair(4),
                    events: data[6],
                };
                output.motion.velocity_x_m_s = from_byte(data[7], SPEED_M_S);
            }
        }
    }
    Some((output, counter?))
}

fn from_signed(bytes: [u8; 2], unit: f64) -> f64 {
    match i16::from_le_bytes(bytes) {
        i16::MIN => f64::NAN,
        raw => f64::from(raw) * unit,
    }
}

fn from_unsigned(bytes: [u8; 2], unit: f64) -> f64 {
    match u16::from_le_bytes(bytes) {
        u16::MAX => f64::NAN,
        raw => f64::from(raw) * unit,
    }
}

fn from_byte(raw: u8, unit: f64) -> f64 {
    match raw {
        u8::MAX => f64::NAN,
        254 => f64::INFINITY,
        raw => f64::from(raw) * unit,
    }
}

#[cfg(test)]
mod tests {
    use sample::LogTime;

    use super::super::{OutputState, tests::estimate};
    use super::*;
    use crate::dbc::Database;

    fn output() -> ControllerOutput {
        let start = LogTime(1_000_000_000);
        let mut state = OutputState::default();
        state.estimate(&estimate(start));
        state.at(start.offset_seconds(0.0123), 0.1)
    }

    #[test]
    fn frames_have_the_values() {
        let sent = output();
        let frames = encode_frames(&sent, 0x500, false, 7);
        let (found, counter) = decode_frames(&frames).expect("intact");
        assert_eq!(counter, 7);
        assert_eq!(found.validity, Validity::Valid);
        for wheel in Wheel::ALL {
            assert_eq!(found.forces[wheel].force_n, sent.forces[wheel].force_n);
            assert_eq!(found.forces[wheel].sigma_n, sent.forces[wheel].sigma_n);
        }
        assert!((found.rollover.load_transfer_ratio + 0.25).abs() < 1e-9);
        assert!((found.age_s - 0.0123).abs() < 1e-9);
        let times = found.rollover.time_to_lift_s.0;
        assert_eq!(&times[..3], &[0.5, f64::INFINITY, 1.5]);
        assert!(times[3].is_nan());
        assert_eq!(found.motion.velocity_x_m_s, 8.0);

        let mut broken = frames;
        broken[3].data[4] ^= 1;
        assert!(decode_frames(&broken).is_none());
    }

    #[test]
    fn values_out_of_range_are_limited_and_unknown_ones_are_marked() {
        let mut sent = output();
        sent.forces[Wheel::FrontLeft].force_n = [1e9, -1e9, f64::NAN];
        sent.age_s = f64::INFINITY;
        let frames = encode_frames(&sent, 0x500, false, 0);
        let (found, _) = decode_frames(&frames).expect("intact");
        let force = found.forces[Wheel::FrontLeft].force_n;
        assert_eq!(force[..2], [32_767.0, -32_767.0]);
        assert!(force[2].is_nan());
        assert!((found.age_s - 6.5534).abs() < 1e-9);
    }

    /// The file that users load says the same as the decoder.
    #[test]
    fn the_dbc_file_decodes_the_frames() {
        let database = Database::parse(DBC.as_bytes()).expect("a valid file");
        assert_eq!(database.messages().len(), FRAMES);
        let mut values = std::collections::BTreeMap::new();
        for frame in encode_frames(&output(), 0x500, false, 7) {
            let decoded = database.decode(&frame).expect("a known message");
            for signal in decoded.signals {
                values.insert(format!("{}.{}", decoded.message, signal.name), signal.value);
            }
        }
        for (name, expected) in [
            ("atvrec_force_fl.fl_x", 10.0),
            ("atvrec_force_rr.rr_y", -20.0),
            ("atvrec_force_rr.rr_z", 1003.0),
            ("atvrec_sigma_fr.fr_z_sigma", 7.0),
            ("atvrec_rollover.load_transfer_ratio", -0.25),
            ("atvrec_rollover.load_transfer_ratio_sigma", 0.01),
            ("atvrec_rollover.age", 0.0123),
            ("atvrec_lift_time.fl_time_to_lift", 0.5),
            ("atvrec_lift_time.left_time_to_lift", 2.0),
            ("atvrec_events.speed", 8.0),
            ("atvrec_events.validity", 0.0),
            ("atvrec_force_fl.counter", 7.0),
        ] {
            let found = values
                .get(name)
                .unwrap_or_else(|| panic!("{name}: {values:?}"));
            assert!((found - expected).abs() < 1e-9, "{name}: {found}");
        }
    }
}
