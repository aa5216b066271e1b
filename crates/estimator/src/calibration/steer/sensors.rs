//! Zero and gain of the sensors of the front wheels' angles, from turn plates.

use super::{PlateReading, WHAT};
use crate::finding::{Finding, Refusal};

/// Names of the sides in findings, left first.
const SIDES: [&str; 2] = ["left", "right"];
/// Least number of readings of a sensor, and least standard deviation of what it reads, rad.
const READINGS_NEEDED: usize = 4;
const SPREAD_NEEDED_RAD: f64 = 0.02;
/// Smallest and largest gain.
const GAIN: [f64; 2] = [0.05, 20.0];

/// Zero, rad, and gain of one sensor: angle = gain (reading - zero).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelSensor {
    /// Reading with the wheel straight ahead, rad.
    pub zero_rad: f64,
    /// Angle of the wheel for one radian of the reading.
    pub gain: f64,
}

/// Finds the sensor of one side (0 left, 1 right); `None` if the log has none. The plates have the noise
/// `plate_sigma_rad`, so that they are regressed on the readings.
pub(super) fn sensor(
    readings: &[PlateReading],
    side: usize,
    plate_sigma_rad: f64,
) -> Result<Option<(WheelSensor, Vec<Finding>)>, Refusal> {
    let pairs: Vec<[f64; 2]> = (readings.iter())
        .filter_map(|reading| Some([reading.sensors_rad[side]?, reading.wheels_rad[side]]))
        .collect();
    if pairs.is_empty() {
        return Ok(None);
    }
    let n = pairs.len() as f64;
    let mean = |k: usize| pairs.iter().map(|pair| pair[k]).sum::<f64>() / n;
    let (read, plate) = (mean(0), mean(1));
    let sum = |f: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(f).sum::<f64>();
    let square = sum(&|pair| (pair[0] - read).powi(2));
    let spread_rad = (square / n).sqrt();
    if pairs.len() < READINGS_NEEDED || spread_rad < SPREAD_NEEDED_RAD {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: format!(
                "the standard deviation of the {} sensor's readings",
                SIDES[side]
            ),
            found: spread_rad,
            needed: SPREAD_NEEDED_RAD,
            unit: "rad".to_owned(),
            help: format!(
                "read the plates at {READINGS_NEEDED} or more angles to both sides, and check that the sensor of \
                 the {} wheel (role steer_{}) turns with its wheel",
                SIDES[side], SIDES[side]
            ),
        });
    }
    let gain = sum(&|pair| (pair[0] - read) * (pair[1] - plate)) / square;
    if !(GAIN[0]..=GAIN[1]).contains(&gain.abs()) {
        return Err(Refusal::Value {
            what: WHAT.to_owned(),
            name: format!("gain of the {} wheel's sensor", SIDES[side]),
            value: gain,
            expected: format!(
                "{} to {}, with either sign: check the unit of the role steer_{}, and that the marks have the \
                 left plate first",
                GAIN[0], GAIN[1], SIDES[side]
            ),
        });
    }
    let zero_rad = read - plate / gain;
    let gain_sigma = plate_sigma_rad / square.sqrt();
    let zero_sigma =
        plate_sigma_rad / gain.abs() * (1.0 / n + (zero_rad - read).powi(2) / square).sqrt();
    let name = |of: &str| format!("{} wheel's sensor, {of}", SIDES[side]);
    let findings = vec![
        Finding::of_rows(
            name("straight ahead"),
            [zero_rad, zero_sigma],
            "rad",
            (spread_rad, "rad"),
            pairs.len(),
        ),
        Finding::of_rows(
            name("gain"),
            [gain, gain_sigma],
            "-",
            (spread_rad, "rad"),
            pairs.len(),
        ),
    ];
    Ok(Some((WheelSensor { zero_rad, gain }, findings)))
}
