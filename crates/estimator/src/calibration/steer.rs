//! Steering: both front wheels' maps, play and centre from turn plates.
//!
//! The plates are read at several steering-wheel angles, turned to one side, back through the middle to
//! the other side, and back. Where the gear has play, the steering wheel is ahead of the wheels by half
//! of it on either way, which a regression tells with the centre; the maps are those of the middle,
//! made monotone by pooling neighbours that fall (Barlow and others 1972).

mod sensors;

pub use sensors::WheelSensor;

use model::steering::MonotoneMap;
use nalgebra::{DMatrix, DVector};

use super::SteerCalibration;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::statistics::interval_95;

const WHAT: &str = "steer";
/// Least number of readings and least angle to either side of the middle, rad.
const READINGS_NEEDED: usize = 7;
const SIDE_NEEDED_RAD: f64 = 0.05;

/// One reading of the plates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlateReading {
    /// What the encoder reads, rad, left positive.
    pub steering_wheel_rad: f64,
    /// Left and right front wheel, rad, left positive.
    pub wheels_rad: [f64; 2],
    /// What the sensors of the left and the right front wheel's angle read, rad; `None` without sensors.
    pub sensors_rad: [Option<f64>; 2],
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Steer {
    /// Centre and play with their deviations.
    pub findings: Findings,
    /// What goes into the file, without the sensors at the wheels.
    pub calibration: SteerCalibration,
    /// Sensors of the left and the right front wheel's angle, if the readings have some.
    pub sensors: [Option<WheelSensor>; 2],
}

/// Finds maps, play and centre, and zero and gain of the sensors at the wheels. `plate_sigma_rad` is how well a plate
/// is read.
///
/// # Errors
/// Too few readings, one side only, wheels that turn against the steering wheel, a sensor that does not turn with its
/// wheel.
pub fn steer(readings: &[PlateReading], plate_sigma_rad: f64) -> Result<Steer, Refusal> {
    let mut found = maps(readings, plate_sigma_rad)?;
    for side in [0, 1] {
        if let Some((sensor, findings)) = sensors::sensor(readings, side, plate_sigma_rad)? {
            found.sensors[side] = Some(sensor);
            found.findings.findings.extend(findings);
        }
    }
    Ok(found)
}

fn maps(readings: &[PlateReading], plate_sigma_rad: f64) -> Result<Steer, Refusal> {
    check(readings).map_err(|refusal| refusal.of(WHAT))?;
    let slope = slope(readings, mean);
    if slope <= 0.0 {
        return Err(Refusal::Value {
            what: WHAT.to_owned(),
            name: "road wheels' angle per steering-wheel angle".to_owned(),
            value: slope,
            expected:
                "above zero; left is positive for both, turn the sign of the plates or of the \
                       encoder"
                    .to_owned(),
        });
    }
    let gear = Gear::fit(readings, slope, plate_sigma_rad);
    let [centre_rad, centre_sigma] = gear.centre_rad;
    let [lash_rad, lash_sigma] = gear.lash_rad;
    let middle: Vec<f64> = readings
        .iter()
        .zip(directions(readings))
        .map(|(reading, way)| reading.steering_wheel_rad - 0.5 * lash_rad * way)
        .collect();
    let map = |value: &dyn Fn(&PlateReading) -> f64| {
        monotone(
            middle
                .iter()
                .copied()
                .zip(readings.iter().map(value))
                .collect(),
        )
    };
    let shifted = |points: Vec<[f64; 2]>| -> Vec<[f64; 2]> {
        points
            .into_iter()
            .map(|[x, y]| [x - centre_rad, y])
            .collect()
    };
    let left_map_rad = shifted(map(&|r| r.wheels_rad[0]));
    let right_map_rad = shifted(map(&|r| r.wheels_rad[1]));
    for points in [&left_map_rad, &right_map_rad] {
        MonotoneMap::new(points).map_err(|error| Refusal::Value {
            what: WHAT.to_owned(),
            name: error.to_string(),
            value: points.len() as f64,
            expected: "readings at two or more different steering-wheel angles".to_owned(),
        })?;
    }
    let finding = |name: &str, value: f64, sigma: f64| Finding {
        name: name.to_owned(),
        value,
        unit: "rad".to_owned(),
        sigma,
        interval: Some(interval_95(value, sigma)),
        condition: 1.0,
        excitation: Some(Excitation {
            rms: (readings.iter().map(|r| mean(r).powi(2)).sum::<f64>() / readings.len() as f64)
                .sqrt(),
            unit: "rad".to_owned(),
        }),
        whiteness: None,
        span: Span {
            rows: readings.len(),
            ..Span::default()
        },
    };
    let line = |name: &str, points: &[[f64; 2]]| Series {
        name: name.to_owned(),
        line: true,
        x: points.iter().map(|p| p[0].to_degrees()).collect(),
        y: points.iter().map(|p| p[1].to_degrees()).collect(),
    };
    let dots = |name: &str, wheel: usize| Series {
        name: name.to_owned(),
        line: false,
        x: readings
            .iter()
            .map(|r| (r.steering_wheel_rad - centre_rad).to_degrees())
            .collect(),
        y: readings
            .iter()
            .map(|r| r.wheels_rad[wheel].to_degrees())
            .collect(),
    };
    Ok(Steer {
        findings: Findings {
            what: "steering".to_owned(),
            findings: vec![
                finding("steering wheel straight ahead", centre_rad, centre_sigma),
                finding("play at the steering wheel", lash_rad, lash_sigma),
            ],
            beside: vec![(
                "ratio at the middle".to_owned(),
                1.0 / slope,
                "-".to_owned(),
            )],
            figures: vec![Figure {
                title: "Road wheels against the steering wheel".to_owned(),
                x_label: "steering wheel from the middle (deg)".to_owned(),
                y_label: "road wheel (deg)".to_owned(),
                series: vec![
                    dots("left, read", 0),
                    dots("right, read", 1),
                    line("left", &left_map_rad),
                    line("right", &right_map_rad),
                ],
            }],
            ..Findings::default()
        },
        calibration: SteerCalibration {
            offset_rad: centre_rad,
            lash_rad,
            left_map_rad,
            right_map_rad,
            ..SteerCalibration::default()
        },
        sensors: [None; 2],
    })
}

fn check(readings: &[PlateReading]) -> Result<(), Refusal> {
    let refuse = |quantity: &str, found: f64, needed: f64, unit: &str| {
        Err(Refusal::NotExcited {
            what: String::new(),
            quantity: quantity.to_owned(),
            found,
            needed,
            unit: unit.to_owned(),
            help: "read the plates at seven or more steering-wheel angles, to both sides, such as \
                   `atvrec mark \"plates 9.5 10.2\"` (left, right in degrees)"
                .to_owned(),
        })
    };
    if readings.len() < READINGS_NEEDED {
        let found = readings.len() as f64;
        return refuse("number of readings", found, READINGS_NEEDED as f64, "-");
    }
    for side in [1.0, -1.0] {
        let most = readings.iter().map(|r| side * mean(r)).fold(0.0, f64::max);
        if most < SIDE_NEEDED_RAD {
            let name = if side > 0.0 {
                "angle to the left"
            } else {
                "angle to the right"
            };
            return refuse(name, most, SIDE_NEEDED_RAD, "rad");
        }
    }
    Ok(())
}

/// Slope of the least-squares line.
fn slope(readings: &[PlateReading], value: impl Fn(&PlateReading) -> f64) -> f64 {
    let n = readings.len() as f64;
    let mx = readings.iter().map(|r| r.steering_wheel_rad).sum::<f64>() / n;
    let my = readings.iter().map(&value).sum::<f64>() / n;
    let cross: f64 = readings
        .iter()
        .map(|r| (r.steering_wheel_rad - mx) * (value(r) - my))
        .sum();
    let square: f64 = readings
        .iter()
        .map(|r| (r.steering_wheel_rad - mx).powi(2))
        .sum();
    cross / square.max(1e-12)
}

/// Whether the steering wheel came to each reading from the right (+1) or from the left (-1).
fn directions(readings: &[PlateReading]) -> Vec<f64> {
    let mut ways = vec![0.0; readings.len()];
    for k in 1..readings.len() {
        let change = readings[k].steering_wheel_rad - readings[k - 1].steering_wheel_rad;
        ways[k] = if change.abs() > 0.02 {
            change.signum()
        } else {
            ways[k - 1]
        };
    }
    ways
}

/// Centre and play, rad, each with its deviation.
struct Gear {
    centre_rad: [f64; 2],
    lash_rad: [f64; 2],
}

impl Gear {
    /// Least squares of the steering wheel on the plates' mean m and the way w that it came:
    ///
    /// steering wheel = centre + s m + q m^2 + k m^3 + w play/2
    ///
    /// Without both ways the play is zero, and not known.
    fn fit(readings: &[PlateReading], slope: f64, plate_sigma_rad: f64) -> Self {
        let ways = directions(readings);
        let both = ways.contains(&1.0) && ways.contains(&-1.0);
        let columns = if both { 5 } else { 4 };
        let most = readings.iter().map(|r| mean(r).abs()).fold(0.0, f64::max);
        let design = DMatrix::from_fn(readings.len(), columns, |row, column| match column {
            4 => ways[row],
            power => (mean(&readings[row]) / most).powi(power as i32),
        });
        let steering_wheel = DVector::from_iterator(
            readings.len(),
            readings.iter().map(|r| r.steering_wheel_rad),
        );
        let inverse = (design.transpose() * &design)
            .pseudo_inverse(1e-12)
            .unwrap_or_else(|_| DMatrix::zeros(columns, columns));
        let found = &inverse * design.transpose() * steering_wheel;
        let noise = plate_sigma_rad / slope / 2.0_f64.sqrt();
        let sigma = |column: usize| noise * inverse[(column, column)].sqrt();
        Self {
            centre_rad: [found[0], sigma(0)],
            lash_rad: if both {
                [(2.0 * found[4]).max(0.0), 2.0 * sigma(4)]
            } else {
                [0.0, f64::NAN]
            },
        }
    }
}

/// Mean angle of the two wheels, rad.
fn mean(reading: &PlateReading) -> f64 {
    0.5 * (reading.wheels_rad[0] + reading.wheels_rad[1])
}

/// Points in order of x, equal ones put together, and pooled where y falls.
fn monotone(mut pairs: Vec<(f64, f64)>) -> Vec<[f64; 2]> {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut points: Vec<([f64; 2], f64)> = Vec::new();
    for (x, y) in pairs {
        match points.last_mut() {
            Some((point, weight)) if x - point[0] < 0.02 => {
                *weight += 1.0;
                point[0] += (x - point[0]) / *weight;
                point[1] += (y - point[1]) / *weight;
            }
            _ => points.push(([x, y], 1.0)),
        }
    }
    // Levels of pooled neighbours: mean and weight, and how many points they hold.
    let mut levels: Vec<(f64, f64, usize)> = Vec::new();
    for (point, weight) in &points {
        levels.push((point[1], *weight, 1));
        while let [.., a, b] = levels[..] {
            if a.0 <= b.0 {
                break;
            }
            let weight = a.1 + b.1;
            levels.truncate(levels.len() - 2);
            levels.push(((a.0 * a.1 + b.0 * b.1) / weight, weight, a.2 + b.2));
        }
    }
    let levels = levels
        .into_iter()
        .flat_map(|(y, _, count)| std::iter::repeat_n(y, count));
    points
        .iter()
        .zip(levels)
        .map(|((point, _), y)| [point[0], y])
        .collect()
}
