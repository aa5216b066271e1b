//! Height of the centre of gravity from scales under the axles, level and with one axle raised.
//!
//! With the lines from the centre of gravity to the axle a and b, the wheelbase L and the angle theta of the
//! line through the wheel centres, the load of the raised axle is
//!
//! F = m g/L (b - (h - r) tan theta)
//!
//! for the front axle, and with a in the place of b for the rear one. h is the height of the centre of
//! gravity above the ground, r that of the wheel centres. (Moments about the contact of the lower axle; the
//! wheels roll freely. T. D. Gillespie, Fundamentals of Vehicle Dynamics, SAE, 1992, chapter 1, has the same
//! balance for a grade.) Tyres and springs change their length with the load, which turns the vehicle a little
//! further; this angle is added to theta.

use model::vehicle::Vehicle;
use sample::{Axle, STANDARD_GRAVITY_M_S2, Wheel};

use crate::finding::{Figure, Finding, Findings, Refusal, Series, Span};

const WHAT: &str = "height of the centre of gravity";
/// Least tangent of the angle of a raised vehicle.
const SLOPE_NEEDED: f64 = 0.1;
/// Totals of the rows may differ by this many standard deviations of a total.
const TOTAL_SIGMAS: f64 = 5.0;
/// Standard deviation of the stiffness of springs and tyres, as a fraction.
const STIFFNESS_SIGMA: f64 = 0.2;
/// Standard deviation of the height of the wheel centres above the ground, m.
const RADIUS_SIGMA_M: f64 = 0.003;

/// Readings of the scales in one position of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The raised axle; `None` for a level vehicle.
    pub raised: Option<Axle>,
    /// Height of the ground below the raised wheels above that below the others, m.
    pub lift_m: f64,
    /// Readings of the scales under the front and the rear axle, kg.
    pub axle_kg: [f64; 2],
}

/// What is known of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The springs were held at their length of the level vehicle.
    pub locked: bool,
    /// Standard deviation of the reading of an axle, kg.
    pub scale_sigma_kg: f64,
    /// Standard deviation of the lift, m.
    pub lift_sigma_m: f64,
}

/// A row of the regression.
struct Row {
    /// Tangent of the angle.
    slope: f64,
    /// The part of the angle that tyres and springs make.
    soft: f64,
    /// (h - r) tan theta, m.
    moved_m: f64,
}

/// Finds the height of the centre of gravity, and the distances of the axles from it.
///
/// # Errors
/// If there is no level reading or none with a raised axle, if an axle is raised too little, if the readings of
/// a row do not add up to the mass of the others, or if a value is not usable.
pub fn cg_height(
    vehicle: &Vehicle,
    readings: &[Reading],
    options: &Options,
) -> Result<Findings, Refusal> {
    let (level, raised) = sorted(readings)?;
    let mass_kg = total(readings, options)?;
    let mean = |axle: usize| {
        let sum: f64 = level.iter().map(|reading| reading.axle_kg[axle]).sum();
        sum / level.len() as f64
    };
    let level_kg = [mean(0), mean(1)];
    let wheelbase_m = vehicle.wheelbase_m();
    let rows = raised
        .iter()
        .map(|reading| row(vehicle, reading, level_kg, options))
        .collect::<Result<Vec<Row>, Refusal>>()?;
    let square: f64 = rows.iter().map(|row| row.slope * row.slope).sum();
    let product: f64 = rows.iter().map(|row| row.slope * row.moved_m).sum();
    let above_m = product / square;
    // The wheel centres are as high below the centre of gravity as the line through them.
    let share = level_kg[1] / mass_kg;
    let centres_m = [Wheel::FrontLeft, Wheel::RearLeft].map(|wheel| wheel_centre_m(vehicle, wheel));
    let radius_m = (1.0 - share) * centres_m[0] + share * centres_m[1];
    let sigma_m = deviation(
        &rows,
        above_m,
        wheelbase_m / mass_kg,
        level.len(),
        wheelbase_m,
        options,
    );
    let height_m = radius_m + above_m;
    let finding = |name, value, sigma| finding(name, value, sigma, readings.len());
    let along_m = wheelbase_m / mass_kg * options.scale_sigma_kg / (level.len() as f64).sqrt();
    let mut found = Findings {
        what: WHAT.to_owned(),
        findings: vec![
            finding("cg_height", height_m, sigma_m),
            finding("front_axle_to_cg", share * wheelbase_m, along_m),
        ],
        beside: vec![
            ("mass".to_owned(), mass_kg, "kg".to_owned()),
            (
                "height in the vehicle file".to_owned(),
                vehicle.body.cg_height_m,
                "m".to_owned(),
            ),
            (
                "height of the wheel centres".to_owned(),
                radius_m,
                "m".to_owned(),
            ),
        ],
        ..Findings::default()
    };
    let soft = rows
        .iter()
        .map(|row| row.soft / row.slope)
        .fold(0.0, f64::max);
    if soft > 0.0 {
        found.notes.push(format!(
            "tyres{} turn the vehicle by up to {:.1} % of its angle; this is corrected with the stiffnesses of \
             the vehicle file, which are taken as right within 20 %",
            if options.locked { "" } else { " and springs" },
            100.0 * soft
        ));
    }
    found.figures.push(figure(&rows, above_m));
    Ok(found)
}

/// The readings of the level vehicle, and those with a raised axle.
fn sorted(readings: &[Reading]) -> Result<(Vec<&Reading>, Vec<&Reading>), Refusal> {
    for reading in readings {
        check(reading)?;
    }
    let (level, raised): (Vec<&Reading>, Vec<&Reading>) = readings
        .iter()
        .partition(|reading| reading.raised.is_none());
    let (channel, help) = match (level.is_empty(), raised.is_empty()) {
        (true, _) => (
            "reading of the level vehicle",
            "weigh both axles level, too",
        ),
        (false, true) => (
            "reading with a raised axle",
            "raise one axle by a fifth of the wheelbase or more, and weigh both axles again",
        ),
        (false, false) => return Ok((level, raised)),
    };
    Err(Refusal::Missing {
        what: WHAT.to_owned(),
        channel: channel.to_owned(),
        help: help.to_owned(),
    })
}

fn finding(name: &str, value: f64, sigma: f64, rows: usize) -> Finding {
    Finding {
        name: name.to_owned(),
        value,
        unit: "m".to_owned(),
        sigma,
        interval: Some([value - 1.96 * sigma, value + 1.96 * sigma]),
        condition: 1.0,
        excitation: None,
        whiteness: None,
        span: Span {
            rows,
            ..Span::default()
        },
    }
}

fn check(reading: &Reading) -> Result<(), Refusal> {
    let refuse = |name: &str, value: f64, expected: &str| {
        Err(Refusal::Value {
            what: WHAT.to_owned(),
            name: name.to_owned(),
            value,
            expected: expected.to_owned(),
        })
    };
    for (name, value) in ["front_kg", "rear_kg"].into_iter().zip(reading.axle_kg) {
        if !(value.is_finite() && value > 0.0) {
            return refuse(name, value, "a load above 0 kg");
        }
    }
    let is_raised = reading.raised.is_some();
    if !reading.lift_m.is_finite() || (reading.lift_m > 0.0) != is_raised {
        let expected = if is_raised {
            "a height above 0 m"
        } else {
            "0 m for a level vehicle"
        };
        return refuse("lift_m", reading.lift_m, expected);
    }
    Ok(())
}

/// Mean of the sums of the scales, which must agree.
fn total(readings: &[Reading], options: &Options) -> Result<f64, Refusal> {
    let totals: Vec<f64> = readings.iter().map(|r| r.axle_kg.iter().sum()).collect();
    let mut sorted = totals.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    let allowed_kg = TOTAL_SIGMAS * options.scale_sigma_kg * std::f64::consts::SQRT_2;
    for (number, total) in totals.iter().enumerate() {
        if (total - median).abs() > allowed_kg {
            return Err(Refusal::Value {
                what: WHAT.to_owned(),
                name: format!("front_kg + rear_kg of row {}", number + 1),
                value: *total,
                expected: format!(
                    "{median:.1} kg within {allowed_kg:.1} kg, as the other rows; weigh again with the brakes \
                     released and the wheels free to roll"
                ),
            });
        }
    }
    Ok(totals.iter().sum::<f64>() / totals.len() as f64)
}

fn row(
    vehicle: &Vehicle,
    reading: &Reading,
    level_kg: [f64; 2],
    options: &Options,
) -> Result<Row, Refusal> {
    let wheelbase_m = vehicle.wheelbase_m();
    let mass_kg: f64 = level_kg.iter().sum();
    let sine = reading.lift_m / wheelbase_m;
    if !(SLOPE_NEEDED..0.7).contains(&sine) {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "lift over wheelbase".to_owned(),
            found: sine,
            needed: SLOPE_NEEDED,
            unit: "m/m (at most 0.7)".to_owned(),
            help: format!("raise the axle by {:.2} m or more", 0.2 * wheelbase_m),
        });
    }
    let axle = usize::from(reading.raised == Some(Axle::Rear));
    let lost_kg = level_kg[axle] - reading.axle_kg[axle];
    // Both axles change their length by the same load.
    let soft_m_n: f64 = [Wheel::FrontLeft, Wheel::RearLeft]
        .map(|wheel| {
            let of = vehicle.axle(wheel);
            let spring = if options.locked {
                0.0
            } else {
                1.0 / of.wheel_rate_n_m().max(1.0)
            };
            0.5 * (spring + 1.0 / of.tyre.vertical_stiffness_n_m.max(1.0))
        })
        .iter()
        .sum();
    let soft = lost_kg * STANDARD_GRAVITY_M_S2 * soft_m_n / wheelbase_m;
    let slope = math::tan(math::asin(sine) + soft);
    Ok(Row {
        slope,
        soft,
        moved_m: wheelbase_m * lost_kg / mass_kg,
    })
}

/// Height of a wheel's centre above the ground of the level vehicle, m.
fn wheel_centre_m(vehicle: &Vehicle, wheel: Wheel) -> f64 {
    let tyre = &vehicle.axle(wheel).tyre;
    let load_n = vehicle.static_load_n(wheel);
    tyre.unloaded_radius_m - load_n / tyre.vertical_stiffness_n_m.max(1.0)
}

/// Standard deviation of the height: scales and lift of each row, the level reading that all rows share, the
/// height of the wheel centres, and the stiffnesses.
fn deviation(
    rows: &[Row],
    above_m: f64,
    per_kg_m: f64,
    levels: usize,
    wheelbase_m: f64,
    options: &Options,
) -> f64 {
    let square: f64 = rows.iter().map(|row| row.slope * row.slope).sum();
    let scale_m = per_kg_m * options.scale_sigma_kg;
    let lift_m = above_m * options.lift_sigma_m / wheelbase_m;
    let own = (scale_m * scale_m + lift_m * lift_m) / square;
    let sum: f64 = rows.iter().map(|row| row.slope).sum();
    let level = (sum / square * scale_m).powi(2) / levels as f64;
    let soft: f64 = rows.iter().map(|row| row.slope * row.soft).sum();
    let stiffness = STIFFNESS_SIGMA * above_m * soft / square;
    (own + level + stiffness * stiffness + RADIUS_SIGMA_M * RADIUS_SIGMA_M).sqrt()
}

fn figure(rows: &[Row], above_m: f64) -> Figure {
    let slopes: Vec<f64> = rows.iter().map(|row| row.slope).collect();
    let largest = slopes.iter().copied().fold(0.0, f64::max);
    Figure {
        title: "Load that the raised axle loses, as a shift of the centre of gravity".to_owned(),
        x_label: "tangent of the angle".to_owned(),
        y_label: "shift (m)".to_owned(),
        series: vec![
            Series {
                name: "readings".to_owned(),
                line: false,
                x: slopes,
                y: rows.iter().map(|row| row.moved_m).collect(),
            },
            Series {
                name: "height above the wheel centres".to_owned(),
                line: true,
                x: vec![0.0, largest],
                y: vec![0.0, above_m * largest],
            },
        ],
    }
}

#[cfg(test)]
mod tests;
