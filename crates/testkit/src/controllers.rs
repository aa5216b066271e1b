//! Frames of `output.can`, decoded by the DBC file that ships, against the estimates of a log.

use std::collections::BTreeMap;

use sample::{CanFrame, Estimate, Wheel};
use wire::dbc::Database;
use wire::output::{DBC, FRAMES, Validity};

/// First identifier of the DBC file.
const FIRST_ID: u32 = 0x500;
/// Number of values of the counter.
const COUNTER_VALUES: f64 = 15.0;
/// Largest age of an estimate that is sent as valid, s.
const AGE_MAX_S: f64 = 0.05;
/// Largest delay from the sending of a set to its reader, ns: tenfold that of a loaded machine.
const DELAY_MAX_NS: i64 = 500_000_000;
/// Difference between readings of the wall clock by two processes, ns.
const CLOCK_NS: i64 = 1_000_000;
/// Half of the last bit, and the rounding of the decoder.
const HALF: f64 = 0.5001;

/// Numbers of sets of frames.
#[derive(Clone, Copy, Debug)]
pub struct Sets {
    /// Each has the values of an estimate.
    pub valid: usize,
    /// None has a value.
    pub stale: usize,
    /// Estimates between the valid sets whose values were not sent, because they were late.
    pub left_out: usize,
}

/// Checks frames, each with the wall clock in ns when it came, by the DBC file: identifiers, checksums
/// and counters, and that the valid sets have the values of consecutive estimates, and the stale sets
/// none. `realtime_less_log_ns` is the difference between wall clock and log clock.
///
/// # Panics
/// If a frame is not as it should be.
#[must_use]
pub fn assert_frames(
    frames: &[(CanFrame, i64)],
    estimates: &[Estimate],
    realtime_less_log_ns: i64,
) -> Sets {
    let database = Database::parse(DBC.as_bytes()).expect("a valid file");
    // The end of the recording can cut the last set.
    let sets = frames.chunks_exact(FRAMES);
    let sets: Vec<Set> = sets.map(|set| Set::decode(&database, set)).collect();
    for pair in sets.windows(2) {
        let next = (pair[0].counter + 1.0) % COUNTER_VALUES;
        assert_eq!(pair[1].counter, next, "no frame is lost");
    }
    let (mut valid, mut stale, mut left_out) = (0, 0, 0);
    let mut rest = estimates.iter();
    for set in &sets {
        if set.is(Validity::Valid) {
            let before = rest.len();
            let estimate = rest.find(|estimate| set.is_of(estimate));
            let estimate = estimate.unwrap_or_else(|| panic!("no estimate has {:?}", set.values));
            // The first estimates may be older than the first frame.
            if valid > 0 {
                left_out += before - rest.len() - 1;
            }
            valid += 1;
            set.assert_age(estimate.time.0 as i64 + realtime_less_log_ns);
        } else {
            set.assert_empty(&estimates[0]);
            stale += usize::from(set.is(Validity::Stale));
        }
    }
    assert!(
        left_out <= sets.len() - valid,
        "{left_out} estimates are left out"
    );
    Sets {
        valid,
        stale,
        left_out,
    }
}

/// CRC-8 with the polynomial of SAE J1850 over the data identifier and the bytes from 1 on, bit by bit.
fn crc(frame: &CanFrame) -> u8 {
    let id = (frame.id as u16).to_le_bytes();
    let bytes = id.into_iter().chain(frame.bytes()[1..].iter().copied());
    bytes.fold(0_u8, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| {
            let shifted = crc << 1;
            if crc & 0x80 == 0 {
                shifted
            } else {
                shifted ^ 0x1D
            }
        })
    })
}

/// The frames of one instant by the DBC file that ships, and the wall clock, ns, of the last one.
struct Set {
    values: BTreeMap<String, f64>,
    counter: f64,
    validity: f64,
    received_ns: i64,
}

impl Set {
    /// Decodes frames, and checks identifiers, checksums, and that all have one counter and validity.
    fn decode(database: &Database, frames: &[(CanFrame, i64)]) -> Self {
        let mut values = BTreeMap::new();
        let mut common = Vec::new();
        for (n, (frame, _)) in frames.iter().enumerate() {
            assert_eq!(frame.id, FIRST_ID + n as u32, "the order of the frames");
            let decoded = database.decode(frame).expect("a message of the file");
            let each = decoded.signals.iter();
            let mut own: BTreeMap<String, f64> =
                each.map(|s| (s.name.to_string(), s.value)).collect();
            let checksum = own.remove("checksum");
            assert_eq!(checksum, Some(f64::from(crc(frame))), "{frame:?}");
            common.push([own.remove("counter"), own.remove("validity")]);
            values.append(&mut own);
        }
        let [counter, validity] = common[0].map(|value| value.expect("in each frame"));
        let equal = [Some(counter), Some(validity)];
        assert!(common.iter().all(|each| *each == equal), "{common:?}");
        Self {
            values,
            counter,
            validity,
            received_ns: frames[frames.len() - 1].1,
        }
    }

    fn is(&self, validity: Validity) -> bool {
        self.validity == f64::from(validity as u8)
    }

    /// Whether the set has the values of an estimate.
    fn is_of(&self, estimate: &Estimate) -> bool {
        expected(estimate).into_iter().all(|signal| {
            let wanted = match signal.value.is_nan() {
                true => signal.unknown,
                false => signal.value.min(signal.largest()),
            };
            (self.values[&signal.name] - wanted).abs() <= HALF * signal.unit
        })
    }

    /// Age and delay by the wall clock of the instant of the estimate.
    fn assert_age(&self, instant_ns: i64) {
        let age_s = self.values["age"];
        // An age just below the limit is rounded to it.
        assert!((0.0..=AGE_MAX_S).contains(&age_s), "{age_s} s old");
        let delay_ns = self.received_ns - instant_ns - (age_s * 1e9) as i64;
        let possible = -CLOCK_NS..DELAY_MAX_NS;
        assert!(possible.contains(&delay_ns), "{delay_ns} ns later");
    }

    fn assert_empty(&self, any: &Estimate) {
        for signal in expected(any) {
            let found = self.values[&signal.name];
            let is_unknown = (found - signal.unknown).abs() < 1e-9;
            assert!(is_unknown, "{}: {found} in {:?}", signal.name, self.values);
        }
    }
}

/// Value of a signal by an estimate.
struct Signal {
    name: String,
    value: f64,
    /// Value of the last bit.
    unit: f64,
    /// Value of the number that means unknown.
    unknown: f64,
}

impl Signal {
    /// The largest value that can be sent: larger ones are sent as this.
    fn largest(&self) -> f64 {
        self.unknown.abs() - self.unit
    }
}

fn expected(estimate: &Estimate) -> Vec<Signal> {
    let signal = |name: String, value, unit, unknown| Signal {
        name,
        value,
        unit,
        unknown,
    };
    let mut all = Vec::new();
    for wheel in Wheel::ALL {
        let force = &estimate.carrier[wheel];
        let name = wheel.to_string().to_lowercase();
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            let [value, sigma] = [force.force_n[axis], force.sigma_n[axis]];
            all.push(signal(format!("{name}_{letter}"), value, 1.0, -32_768.0));
            all.push(signal(
                format!("{name}_{letter}_sigma"),
                sigma,
                1.0,
                65_535.0,
            ));
        }
        let time_s = estimate.rollover.time_to_lift_s[wheel];
        all.push(signal(format!("{name}_time_to_lift"), time_s, 0.02, 5.1));
    }
    let rollover = &estimate.rollover;
    let [left_s, right_s] = rollover.time_to_two_wheel_lift_s;
    let speed_m_s = estimate.motion.velocity_x_m_s.abs();
    for (name, value, unit, unknown) in [
        (
            "load_transfer_ratio",
            rollover.load_transfer_ratio,
            1e-4,
            -3.2768,
        ),
        (
            "load_transfer_ratio_sigma",
            rollover.load_transfer_ratio_sigma,
            1e-4,
            6.5535,
        ),
        ("left_time_to_lift", left_s, 0.02, 5.1),
        ("right_time_to_lift", right_s, 0.02, 5.1),
        ("speed", speed_m_s, 0.2, 51.0),
    ] {
        all.push(signal(name.to_owned(), value, unit, unknown));
    }
    all
}
