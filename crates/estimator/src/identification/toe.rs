//! Toe compliance and play of the front wheels (section 5.2.5 of the thesis), from a drive with sensors of the wheels'
//! steer angles.
//!
//! Rack and linkage give the steer angle of a wheel without forces. The measured angle differs from it by
//!
//! d = -c F_y - p s/2 + d_0, s = clamp(F_y/F_p, -1, 1)
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | d | measured steer angle less that of rack and linkage, left positive | rad |
//! | c | toe compliance | rad/N |
//! | F_y | lateral force of the tyre, left positive | N |
//! | p | play, from one contact to the other | rad |
//! | F_p | force that crosses half of the play, [`TOE_PLAY_FORCE_N`] | N |
//! | d_0 | zero of the sensor and of the steering wheel | rad |
//!
//! Both terms follow the force, so that the play needs forces of different size to both sides. Forces below 150 N are
//! not used: the low-pass mixes both contacts there.

use model::steering::{Lash, SteeringGear, TOE_PLAY_FORCE_N};
use model::suspension::Corner;
use model::vehicle::Vehicle;
use sample::Wheel;

use super::both_wheels::{self, Named, Task};
use super::drive::series;
use crate::EstimatorError;
use crate::calibration::{Recording, Resolved};
use crate::finding::{Figure, Findings, Refusal};
use crate::steering_column::SteeringColumn;

const TASK: Task = Task {
    what: "toe compliance",
    advice: "drive turns to both sides, gentle ones and up to half of the grip, such as a slow sine whose amplitude \
             grows",
    data_min_s: 5.0,
};
/// Smallest lateral force that is used, N.
const FORCE_MIN_N: f64 = 150.0;
/// Least standard deviation of the lateral force over the load.
const EXCITATION_MIN: f64 = 0.1;
/// Longest gap between two readings over which a line is drawn, s.
const GAP_S: f64 = 0.2;
/// Names of the sides, left first.
const SIDES: [&str; 2] = ["left", "right"];

/// Difference and force of one wheel, `NaN` where unknown; columns of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    /// Measured steer angle less that of rack and linkage, rad.
    pub difference_rad: Vec<f64>,
    /// Force across the wheel, N.
    pub lateral_n: Vec<f64>,
    /// Load, N.
    pub load_n: Vec<f64>,
}

/// Finds toe compliance and play of one front wheel (0 left, 1 right).
///
/// Findings: `toe_compliance_left` (rad/N), `toe_play_left` (rad), `toe_offset_left` (rad), or of the right wheel.
///
/// # Errors
/// Columns that differ in length, too little data, forces that do not change or act to one side only.
pub fn identify(data: &Data, side: usize, dt_s: f64, seed: u64) -> Result<Findings, Refusal> {
    let rows = usable(data, dt_s)?;
    let fit = rows.fit(0, |&[_, force_n, _]| {
        [
            -force_n,
            -0.5 * (force_n / TOE_PLAY_FORCE_N).clamp(-1.0, 1.0),
        ]
    })?;
    let [compliance, play] = [
        ["toe_compliance_left", "toe_compliance_right"],
        ["toe_play_left", "toe_play_right"],
    ]
    .map(|names| names[side]);
    let named = [(compliance, "rad/N"), (play, "rad")].map(|(name, unit)| Named {
        name,
        unit,
        excitation: Some((fit.excitation[0], "N")),
    });
    let offset = ["toe_offset_left", "toe_offset_right"][side];
    let covariance = fit.covariance.clone();
    let mut found = rows.findings(
        &fit,
        seed,
        named,
        ([offset; 2], "rad"),
        <[f64]>::to_vec,
        &covariance,
    );
    found.what = format!("toe compliance of the {} front wheel", SIDES[side]);
    let angle = |value: f64, factor: f64| (value * factor).to_degrees();
    found.beside = vec![
        (
            "compliance".to_owned(),
            angle(fit.coefficients[0], 1e3),
            "deg/kN".to_owned(),
        ),
        (
            "play".to_owned(),
            angle(fit.coefficients[1], 1.0),
            "deg".to_owned(),
        ),
    ];
    found.figures = vec![figure(&rows, side, [0, 1, 2].map(|k| fit.coefficients[k]))];
    Ok(found)
}

/// Difference of the steer angle, lateral force and load of one wheel.
type Rows = both_wheels::Rows<3>;

/// The rows of a drive that excites both.
fn usable(data: &Data, dt_s: f64) -> Result<Rows, Refusal> {
    let names = ["steer angle's difference", "lateral force", "load"];
    let columns: [&[f64]; 3] = [&data.difference_rad, &data.lateral_n, &data.load_n];
    let rows = Rows::usable(TASK, dt_s, names, [columns, [&[]; 3]], |row| {
        row[1].abs() > FORCE_MIN_N
    })?;
    rows.excited(1, "lateral force", EXCITATION_MIN)?;
    let forces = rows.column(1);
    let to_left = forces.iter().filter(|force| **force > 0.0).count() as f64;
    let fewer = to_left.min(forces.len() as f64 - to_left) / forces.len() as f64;
    if fewer < 0.1 {
        return Err(Refusal::NotExcited {
            what: TASK.what.to_owned(),
            quantity: "the part of the drive with a lateral force to the less used side".to_owned(),
            found: fewer,
            needed: 0.1,
            unit: "-".to_owned(),
            help: TASK.advice.to_owned(),
        });
    }
    Ok(rows)
}

/// The difference against the force, with what was found.
fn figure(rows: &Rows, side: usize, [c, p, zero]: [f64; 3]) -> Figure {
    let forces = rows.column(1);
    let most_n = forces
        .iter()
        .fold(0.0_f64, |most, force| most.max(force.abs()));
    let line = [-most_n, -TOE_PLAY_FORCE_N, TOE_PLAY_FORCE_N, most_n];
    let on_line = line.map(|force| zero - c * force - 0.5 * p * force.signum());
    Figure {
        title: format!(
            "Measured steer angle less that of rack and linkage, {} wheel",
            SIDES[side]
        ),
        x_label: "lateral force (N)".to_owned(),
        y_label: "difference (deg)".to_owned(),
        series: vec![
            series("measured", false, forces, degrees(&rows.column(0))),
            series(
                "compliance and play",
                true,
                line.to_vec(),
                degrees(&on_line),
            ),
        ],
    }
}

fn degrees(angles_rad: &[f64]) -> Vec<f64> {
    angles_rad.iter().map(|angle| angle.to_degrees()).collect()
}

/// Measured steer angles of both front wheels less those of rack and linkage, rad, at instants `times_s` from the start
/// of the recording; `NaN` where a reading is missing, and everywhere for a wheel without sensor. Without
/// potentiometers the linkage stands as in the design position.
///
/// # Errors
/// Hard-points that do not assemble, steering maps that are not monotone.
pub fn differences_rad(
    recording: &Recording,
    vehicle: &Vehicle,
    calibration: &Resolved,
    times_s: &[f64],
) -> Result<[Vec<f64>; 2], EstimatorError> {
    let mut steering_wheel = recording.steering_wheel_rad(calibration);
    let kinematics = Kinematics::new(vehicle)?;
    let mut column = SteeringColumn::new(vehicle)?;
    let mut lash = Lash::default();
    let lash_rad = vehicle.steering.lash_rad;
    steering_wheel.map(|angle| match kinematics {
        Kinematics::Linkages(..) => column.follow(angle),
        Kinematics::Gear(_) => lash.follow(angle, lash_rad),
    });
    let compression_m = recording.compression_m(calibration);
    let angles = recording.wheel_angles_rad(calibration);
    Ok(std::array::from_fn(|side| {
        let compression_m = &compression_m.0[side];
        let at = |time_s: &f64| {
            let travel = if compression_m.is_known() {
                compression_m.at(*time_s, GAP_S)
            } else {
                Some(0.0)
            };
            let steer = steering_wheel.at(*time_s, GAP_S)?;
            Some(angles[side].at(*time_s, GAP_S)? - kinematics.steer_rad(side, steer, travel?)?)
        };
        times_s
            .iter()
            .map(|time_s| at(time_s).unwrap_or(f64::NAN))
            .collect()
    }))
}

/// How rack and linkage turn the front wheels.
enum Kinematics {
    /// With hard-points, and the travel of the rack for one radian, m.
    Linkages(Box<[Corner; 2]>, f64),
    /// By maps or by a ratio.
    Gear(SteeringGear),
}

impl Kinematics {
    fn new(vehicle: &Vehicle) -> Result<Self, EstimatorError> {
        let rack = vehicle.steering.rack_m_rad;
        let Some(rack_m_rad) = rack.filter(|_| vehicle.front.has_hard_points()) else {
            return Ok(Self::Gear(SteeringGear::from_vehicle(vehicle)?));
        };
        let corner = |wheel| {
            Corner::of(vehicle, wheel)
                .map_err(|error| EstimatorError::Suspension(error.to_string()))
        };
        let corners = [corner(Wheel::FrontLeft)?, corner(Wheel::FrontRight)?];
        Ok(Self::Linkages(Box::new(corners), rack_m_rad))
    }

    /// Steer angle of a front wheel, rad; `None` out of the linkage's reach.
    fn steer_rad(&self, side: usize, steering_wheel_rad: f64, compression_m: f64) -> Option<f64> {
        match self {
            Self::Linkages(corners, rack_m_rad) => {
                let corner = &corners[side];
                let length_m = corner.design_strut_length_m() - compression_m;
                let pose = corner
                    .pose(length_m, rack_m_rad * steering_wheel_rad)
                    .ok()?;
                Some(pose.steer_rad())
            }
            Self::Gear(gear) => Some(gear.road_wheels(steering_wheel_rad, 0.0)[side]),
        }
    }
}

#[cfg(test)]
mod tests;
