//! Loads at rest against the vehicle file.

use estimator::calibration::Resolved;
use model::nalgebra::Vector3;
use model::suspension::motion_ratio;
use model::vehicle::Vehicle;
use sample::{StrainChannel, Wheel};

use super::columns::{Column, Columns};
use super::line::ROWS_MIN;
use super::reference::Reference;
use super::wheels::gains;
use super::{Judgement, Misfit};

/// Standard deviations of the zero that a difference must exceed.
const SIGMAS: f64 = 4.0;
/// Part of the static load that payload, ground and friction of the springs explain.
const LOAD_PART: f64 = 0.35;

/// Mean over the rows without turning and braking.
fn steady_mean(column: &Column, rows: usize, reference: &Reference) -> Option<f64> {
    let values = column.smoothed(rows);
    let steady = |(row, value): (usize, &f64)| {
        (reference.is_steady(row) && value.is_finite()).then_some(*value)
    };
    let known: Vec<f64> = values.iter().enumerate().filter_map(steady).collect();
    (known.len() >= ROWS_MIN).then(|| known.iter().sum::<f64>() / known.len() as f64)
}

/// Loads of the springs.
pub fn deflections(
    columns: &Columns,
    vehicle: &Vehicle,
    calibration: &Resolved,
    reference: &Reference,
    judgement: &mut Judgement,
) {
    for wheel in Wheel::ALL {
        let ratio = motion_ratio(vehicle, wheel).ok().flatten();
        let (Some(strut), Some(ratio)) = (&vehicle.axle(wheel).strut, ratio) else {
            continue;
        };
        let Some(mean_m) = steady_mean(&columns.compression_m[wheel], columns.rows, reference)
        else {
            continue;
        };
        let stiffness = ratio * strut.stiffness_n_m;
        let (load_n, expected_n) = (stiffness * mean_m, vehicle.static_load_n(wheel));
        let sigma_n = stiffness * calibration.corners[wheel].deflection.offset_sigma;
        let corner = wheel.abbreviation();
        if load_n.abs() <= SIGMAS * sigma_n + LOAD_PART * expected_n {
            continue;
        }
        judgement.misfits.push(Misfit {
            subject: format!("spring deflection {corner}, load at rest"),
            found: format!(
                "{:.0} N ({:.1} mm from the design length), {expected_n:.0} N by the vehicle file",
                expected_n + load_n,
                1e3 * mean_m
            ),
            cause: "the zero, the gain or the unit of the potentiometer is wrong, or the vehicle carries a load \
                    that the vehicle file does not have"
                .to_owned(),
            remedy: format!(
                "run `atvrec calibrate zero`; name the load as payload; correct the unit of the role deflection.{corner}"
            ),
        });
    }
}

/// Loads of the members with strain gauges.
pub fn strains(
    columns: &Columns,
    vehicle: &Vehicle,
    calibration: &Resolved,
    reference: &Reference,
    judgement: &mut Judgement,
) {
    for wheel in Wheel::ALL {
        let Some((gain, offset)) = gains(vehicle, wheel) else {
            continue;
        };
        let expected = gain * Vector3::new(0.0, 0.0, vehicle.static_load_n(wheel)) + offset;
        let largest = expected.amax();
        let corner = wheel.abbreviation();
        for (channel, expected_n) in StrainChannel::ALL.into_iter().zip(expected.iter()) {
            let column = &columns.strain[wheel][channel.index()];
            let Some(mean_n) = steady_mean(column, columns.rows, reference) else {
                continue;
            };
            let sigma_n = calibration.corners[wheel].strain[channel.index()].offset_sigma;
            if (mean_n - expected_n).abs() <= SIGMAS * sigma_n + LOAD_PART * largest {
                continue;
            }
            let name = vehicle.channel_name(wheel, channel);
            judgement.misfits.push(Misfit {
                subject: format!("strain {corner} {name}, load at rest"),
                found: format!("{mean_n:.0} N, {expected_n:.0} N by the vehicle file"),
                cause: "the zero, the gain, the sign or the unit of the channel is wrong".to_owned(),
                remedy: format!("run `atvrec calibrate zero`, or correct the unit of the role strain.{corner}.{name}"),
            });
        }
    }
}
