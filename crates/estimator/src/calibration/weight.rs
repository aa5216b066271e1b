//! Preload, rate and friction of each coil from loads on scales.
//!
//! The linkage's statics say what strut force a wheel's load calls for at the length that the
//! potentiometer reads. Over three loads or more,
//!
//! F_s = F_0 + k c + f d
//!
//! with the compression c from the design length, and d = +1 where the strut was being compressed on
//! the way to the load, -1 where it was being let go: f is the friction that holds it back.

use model::suspension::{ChannelKind, CornerStatics, LinkedAxle, SuspensionError, Wrench};
use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector, Vector3};
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use super::imu::lean_rad;
use super::{Calibration, SensitivityMatrix, SpringCalibration};
use crate::EstimatorError;
use crate::corners::corner_of;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::{Fit, least_squares};
use crate::statistics::{interval_95, student_over_normal};

const WHAT: &str = "weight";
/// Different loads that are needed, and how far apart two must be, N.
const LOADS_NEEDED: usize = 3;
const APART_N: f64 = 50.0;
/// Change of length between two loads that counts as a direction, m.
const MOVED_M: f64 = 0.0003;

/// The vehicle at rest on scales.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleReading {
    /// Load of each wheel, N.
    pub load_n: PerWheel<f64>,
    /// Compression of each strut from its design length, m.
    pub compression_m: PerWheel<f64>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Weight {
    /// Preload, rate and friction with their deviations, the vehicle's weight beside them.
    pub findings: Findings,
    /// The calibration with the springs in it.
    pub calibration: Calibration,
}

/// Finds the springs.
///
/// # Errors
/// Fewer than three different loads, a vehicle whose corners have neither hard-points nor motion ratios.
pub fn weight(
    vehicle: &Vehicle,
    known: &Calibration,
    readings: &[ScaleReading],
) -> Result<Weight, EstimatorError> {
    let mut found = Weight {
        findings: Findings {
            what: "springs".to_owned(),
            ..Findings::default()
        },
        calibration: known.clone(),
    };
    let mut figure = Figure {
        title: "Strut force against compression".to_owned(),
        x_label: "compression from the design length (mm)".to_owned(),
        y_label: "strut force (N)".to_owned(),
        series: Vec::new(),
    };
    for wheel in Wheel::ALL {
        different(wheel, readings).map_err(|refusal| refusal.of(WHAT))?;
        let matrix = match known.corner.get(&wheel).and_then(|c| c.matrix.as_ref()) {
            Some(given) => Some(SensitivityMatrix::new(wheel, given)?),
            None => None,
        };
        let forces = readings
            .iter()
            .map(|reading| strut_force_n(vehicle, wheel, matrix.as_ref(), reading))
            .collect::<Result<Vec<f64>, _>>()
            .map_err(|error| EstimatorError::Suspension(error.to_string()))?;
        let compression: Vec<f64> = readings.iter().map(|r| r.compression_m[wheel]).collect();
        let (fit, with_friction) =
            fit(&compression, &forces).map_err(|refusal| refusal.of(WHAT))?;
        found.tell(wheel, &fit, with_friction, readings.len());
        let corner = found.calibration.corner.entry(wheel).or_default();
        // What a load rig found to be wrong with the spring of the vehicle file is in the new one.
        if let Some(strut) = (corner.matrix.as_mut()).and_then(|matrix| matrix.strut.as_mut()) {
            strut.offset_n = 0.0;
        }
        corner.spring = Some(SpringCalibration {
            preload_n: fit.coefficients[0],
            rate_n_m: fit.coefficients[1],
            friction_n: if with_friction {
                fit.coefficients[2].max(0.0)
            } else {
                0.0
            },
        });
        figure.series.push(Series {
            name: wheel.abbreviation().to_owned(),
            line: false,
            x: compression.iter().map(|c| 1e3 * c).collect(),
            y: forces,
        });
    }
    found.findings.figures.push(figure);
    let first = &readings[0].load_n;
    let total: f64 = first.0.iter().sum();
    let mass_kg = total / STANDARD_GRAVITY_M_S2;
    let front = (first.0[0] + first.0[1]) / total;
    let left = (first.0[0] + first.0[2]) / total;
    let by_file = vehicle.body.cg_to_rear_axle_m / vehicle.wheelbase_m();
    found.findings.beside = vec![
        (
            "mass on the scales, first load".to_owned(),
            mass_kg,
            "kg".to_owned(),
        ),
        (
            "mass by the vehicle file".to_owned(),
            vehicle.body.mass_kg,
            "kg".to_owned(),
        ),
        ("part on the front axle".to_owned(), front, "-".to_owned()),
        (
            "part on the front axle by the vehicle file".to_owned(),
            by_file,
            "-".to_owned(),
        ),
        ("part on the left wheels".to_owned(), left, "-".to_owned()),
    ];
    if (mass_kg / vehicle.body.mass_kg - 1.0).abs() > 0.02 {
        found.findings.notes.push(format!(
            "the scales say {mass_kg:.1} kg, the vehicle file {:.1} kg; correct body.mass_kg",
            vehicle.body.mass_kg
        ));
    }
    Ok(found)
}

fn different(wheel: Wheel, readings: &[ScaleReading]) -> Result<(), Refusal> {
    let mut loads: Vec<f64> = readings.iter().map(|r| r.load_n[wheel]).collect();
    loads.sort_by(f64::total_cmp);
    loads.dedup_by(|a, b| (*a - *b).abs() < APART_N);
    if loads.len() >= LOADS_NEEDED {
        return Ok(());
    }
    Err(Refusal::NotExcited {
        what: String::new(),
        quantity: format!("number of different loads on {wheel}"),
        found: loads.len() as f64,
        needed: LOADS_NEEDED as f64,
        unit: "-".to_owned(),
        help: format!(
            "load the vehicle so that each wheel carries three loads at least {APART_N} N apart"
        ),
    })
}

/// Strut force that a wheel's load calls for, N.
fn strut_force_n(
    vehicle: &Vehicle,
    wheel: Wheel,
    matrix: Option<&SensitivityMatrix>,
    reading: &ScaleReading,
) -> Result<f64, SuspensionError> {
    let axle = vehicle.axle(wheel);
    // A load beside the middle leans the body: the ground's normal is not its z axis.
    let [roll, pitch] = lean_rad(vehicle, &reading.compression_m).unwrap_or_default();
    let up = Vector3::new(-pitch, roll, 1.0).normalize();
    if axle.is_solid() {
        let linked = LinkedAxle::of(vehicle)?;
        let [_, _, left, right] = reading.compression_m.0;
        let [left_m, right_m] = linked.design_lengths_m();
        let [_, _, left_n, right_n] = reading.load_n.0;
        let gravity = up * STANDARD_GRAVITY_M_S2;
        let lengths_m = [left_m - left, right_m - right];
        let rest = linked.carrying(axle, lengths_m, [left_n, right_n], gravity)?;
        return Ok(rest.members.springs_n[usize::from(!wheel.is_left())]);
    }
    let corner = corner_of(vehicle, wheel, matrix)?;
    let length_m = corner.design_strut_length_m() - reading.compression_m[wheel];
    let pose = corner.pose(length_m, 0.0)?;
    let load_n = reading.load_n[wheel];
    let kind = ChannelKind::Strut;
    let statics = CornerStatics::standing(&corner, &pose, axle, up, load_n, kind)?;
    let wrench = Wrench {
        force_n: Vector3::z() * load_n,
        ..Wrench::default()
    };
    Ok(statics.members(&wrench).sixth_n)
}

/// The fit, and whether friction is in it: loads must have been put on and taken off.
fn fit(compression_m: &[f64], force_n: &[f64]) -> Result<(Fit, bool), Refusal> {
    let mut direction = vec![0.0; compression_m.len()];
    for k in 1..compression_m.len() {
        let change = compression_m[k] - compression_m[k - 1];
        direction[k] = if change.abs() > MOVED_M {
            change.signum()
        } else {
            direction[k - 1]
        };
    }
    let both = direction.contains(&1.0) && direction.contains(&-1.0);
    let columns = if both && compression_m.len() >= 5 {
        3
    } else {
        2
    };
    let design = DMatrix::from_fn(compression_m.len(), columns, |i, j| match j {
        0 => 1.0,
        1 => compression_m[i],
        _ => direction[i],
    });
    // Three loads leave one residual: its covariance would say little, a repeated reading says more.
    let response = DVector::from_column_slice(force_n);
    let fit = least_squares(&design, &response)?;
    Ok((fit, columns == 3))
}

impl Weight {
    fn tell(&mut self, wheel: Wheel, fit: &Fit, with_friction: bool, rows: usize) {
        let mut names = vec![("preload", "N"), ("rate", "N/m")];
        if with_friction {
            names.push(("friction", "N"));
        }
        // The standard deviation comes from a handful of loads.
        let widen = student_over_normal((rows - fit.coefficients.len()) as f64);
        for (k, (name, unit)) in names.into_iter().enumerate() {
            let value = fit.coefficients[k];
            let sigma = fit.covariance_white[(k, k)].max(0.0).sqrt() * widen;
            self.findings.findings.push(Finding {
                name: format!("{wheel} spring {name}"),
                value,
                unit: unit.to_owned(),
                sigma,
                interval: Some(interval_95(value, sigma)),
                condition: fit.condition,
                excitation: Some(Excitation {
                    rms: fit.excitation[k],
                    unit: if k == 1 { "m" } else { "-" }.to_owned(),
                }),
                whiteness: Some(fit.whiteness),
                span: Span {
                    rows,
                    ..Span::default()
                },
            });
        }
    }
}
