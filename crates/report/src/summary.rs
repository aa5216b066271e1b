//! The top of a report: what was driven, a verdict in words, and tables in numbers.

mod json;
mod verdict;

use model::vehicle::Vehicle;
use sample::{EventKind, LossPlace};

use crate::drive::Drive;
use crate::figures::WHEELS;
use crate::frame::Frame;
use crate::options::{Options, Quantity};
use crate::reference::distance_m;
use crate::score::vehicle_of;

pub use verdict::{many, spans as fault_spans};

/// Values of one axis of a wheel, in the units of the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    pub least: f64,
    pub greatest: f64,
    pub rms: f64,
    /// 95th percentile of the absolute value.
    pub percentile_95: f64,
    /// Median of the stated standard deviation.
    pub sigma: Option<f64>,
}

/// One row of the table of wheels.
#[derive(Clone, Debug)]
pub struct WheelRow {
    pub name: &'static str,
    /// F_x, F_y, F_z.
    pub axes: [Option<Axis>; 3],
    /// Largest part of the load that is a force along the ground.
    pub utilisation: Option<f64>,
    pub lifts: usize,
}

/// A row of the table of the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleRow {
    /// Key of the numbers.
    pub key: &'static str,
    pub name: &'static str,
    pub value: f64,
    pub unit: &'static str,
}

/// The top of a report.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    pub vehicle: Option<String>,
    /// Name and mass of each payload of the vehicle file.
    pub payload: Vec<String>,
    pub distance_m: f64,
    pub force_unit: &'static str,
    pub verdict: Vec<String>,
    pub wheels: Vec<WheelRow>,
    pub vehicle_rows: Vec<VehicleRow>,
    /// Part of the windows of innovations within their bounds, and their number.
    pub consistent: Option<(f64, usize)>,
    /// Items that were lost, by place.
    pub lost: [u64; LossPlace::ALL.len()],
    /// Gaps of the estimates, s.
    pub gaps_s: Vec<[f64; 2]>,
}

/// A wheel with less load has no utilisation, N.
const LOAD_MIN_N: f32 = 200.0;

impl Summary {
    /// The summary of a drive.
    pub fn of(drive: &Drive, options: &Options) -> Self {
        let vehicle = vehicle_of(&drive.attachments);
        let mut summary = Self {
            payload: vehicle.as_ref().map(payload).unwrap_or_default(),
            vehicle: vehicle.map(|vehicle| vehicle.name),
            force_unit: options.units.of(Quantity::Force).1,
            distance_m: distance_m(&drive.motion)
                .last()
                .copied()
                .unwrap_or_default(),
            consistent: drive.learnt.consistent(),
            gaps_s: drive.motion.gaps(),
            ..Self::default()
        };
        if let Some(health) = &drive.health {
            for source in &health.sources {
                for (sum, lost) in summary.lost.iter_mut().zip(source.lost) {
                    *sum += lost;
                }
            }
        }
        summary.wheels = wheel_rows(drive, options);
        summary.vehicle_rows = vehicle_rows(drive, options);
        summary.verdict = verdict::of(drive, &summary);
        summary
    }
}

fn payload(vehicle: &Vehicle) -> Vec<String> {
    let payloads = vehicle.payload.iter();
    payloads
        .map(|payload| format!("{} {:.0} kg", payload.name, payload.mass_kg))
        .collect()
}

fn wheel_rows(drive: &Drive, options: &Options) -> Vec<WheelRow> {
    let (factor, _) = options.units.of(Quantity::Force);
    let lifts = |name: &str| {
        let is_of = |event: &&sample::Event| match event.kind {
            EventKind::Lift(wheel) => wheel.abbreviation().eq_ignore_ascii_case(name),
            _ => false,
        };
        drive.events.iter().filter(is_of).count()
    };
    let rows = WHEELS.into_iter().map(|(wheel, name)| {
        let axes = ["x", "y", "z"].map(|axis| {
            let values = drive.forces.get(&format!("{wheel}.{axis}_n"))?;
            let sigma = drive.forces.get(&format!("{wheel}.{axis}_sigma_n"));
            let range = drive.forces.range(&format!("{wheel}.{axis}_n"))?;
            axis_of(values, range, sigma, factor)
        });
        WheelRow {
            name,
            axes,
            utilisation: utilisation(&drive.forces, wheel),
            lifts: lifts(wheel),
        }
    });
    let has_any = |row: &WheelRow| row.axes.iter().any(Option::is_some) || row.lifts > 0;
    rows.filter(has_any).collect()
}

fn axis_of(
    values: &[f32],
    [least, greatest]: [f32; 2],
    sigma: Option<&[f32]>,
    factor: f64,
) -> Option<Axis> {
    let mut sizes: Vec<f32> = Vec::new();
    let mut squares = 0.0;
    for value in values.iter().copied().filter(|value| value.is_finite()) {
        squares += f64::from(value) * f64::from(value);
        sizes.push(value.abs());
    }
    let percentile_95 = quantile(&mut sizes, 0.95)?;
    let mut sigmas: Vec<f32> = sigma.unwrap_or_default().to_vec();
    sigmas.retain(|value| value.is_finite());
    Some(Axis {
        least: f64::from(least) * factor,
        greatest: f64::from(greatest) * factor,
        rms: (squares / sizes.len() as f64).sqrt() * factor,
        percentile_95: percentile_95 * factor,
        sigma: quantile(&mut sigmas, 0.5).map(|sigma| sigma * factor),
    })
}

/// A quantile; the values are put in another order.
fn quantile(values: &mut [f32], part: f64) -> Option<f64> {
    let rank = (part * values.len() as f64).ceil() as usize;
    if values.is_empty() {
        return None;
    }
    let rank = rank.clamp(1, values.len()) - 1;
    Some(f64::from(
        *values.select_nth_unstable_by(rank, f32::total_cmp).1,
    ))
}

/// Largest 99.9 % quantile of the force along the ground over the load: single wild samples are left
/// out.
fn utilisation(forces: &Frame, wheel: &str) -> Option<f64> {
    let [x, y, z] = ["x", "y", "z"].map(|axis| forces.get(&format!("{wheel}.{axis}_n")));
    let (x, y, z) = (x?, y?, z?);
    let rows = 0..z.len();
    let parts = rows
        .filter(|row| z[*row] > LOAD_MIN_N)
        .map(|row| math::hypot(f64::from(x[row]), f64::from(y[row])) as f32 / z[row]);
    let mut parts: Vec<f32> = parts.filter(|part| part.is_finite()).collect();
    quantile(&mut parts, 0.999)
}

/// How one value of a column is found from two of them.
type Pick = fn(f64, f64) -> f64;

fn vehicle_rows(drive: &Drive, options: &Options) -> Vec<VehicleRow> {
    use Quantity::{Acceleration, Angle, Number, Speed};
    let size: Pick = |a, b| a.abs().max(b.abs());
    let lateral = "acceleration_m_s2.y";
    let forward = "acceleration_m_s2.x";
    let of_motion: [(&'static str, &'static str, &str, Quantity, Pick); 5] = [
        (
            "speed_max",
            "greatest speed",
            "velocity_x_m_s",
            Speed,
            f64::max,
        ),
        (
            "lateral_acceleration_max",
            "greatest lateral acceleration",
            lateral,
            Acceleration,
            size,
        ),
        (
            "forward_acceleration_max",
            "greatest forward acceleration",
            forward,
            Acceleration,
            f64::max,
        ),
        (
            "forward_acceleration_min",
            "greatest braking",
            forward,
            Acceleration,
            f64::min,
        ),
        ("roll_max", "greatest roll angle", "roll_rad", Angle, size),
    ];
    let row = |frame: &Frame, key, name, column: &str, quantity, pick: Pick| {
        let (factor, unit) = options.units.of(quantity);
        let [least, greatest] = frame.range(column)?.map(f64::from);
        let value = pick(least, greatest) * factor;
        Some(VehicleRow {
            key,
            name,
            value,
            unit,
        })
    };
    let (key, name) = ("load_transfer_ratio_max", "greatest load-transfer ratio");
    let ratio = row(
        &drive.rollover,
        key,
        name,
        "load_transfer_ratio",
        Number,
        size,
    );
    let of_motion = of_motion
        .into_iter()
        .filter_map(|(key, name, column, quantity, pick)| {
            row(&drive.motion, key, name, column, quantity, pick)
        });
    of_motion.chain(ratio).collect()
}
