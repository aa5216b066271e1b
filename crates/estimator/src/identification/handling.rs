//! How a vehicle handles, from a drive without any reference of sideslip.
//!
//! The parameters of [`crate::planar`] are those under which the filter predicts yaw rate and
//! lateral acceleration best: the sum of its squared innovations, each over the deviation that the
//! filter expects of it, is least (prediction-error method; Ljung, System Identification, 2nd
//! edition, section 7.2). Large innovations count less (Huber). What a drive does not tell stays
//! near the vehicle file, as if that were a measurement with [`PRIOR_SIGMA`].
//!
//! The delays of steer angle and lateral acceleration against the yaw rate are parameters too; a large
//! one is refused. Standard deviations are those of the sum of the scores of correlated rows
//! (`deviations.rs`), and no parameter leaves its physical range.

mod delays;
mod deviations;
mod range;
mod search;

use model::vehicle::Vehicle;
use nalgebra::{Matrix3, Vector3};
use sample::STANDARD_GRAVITY_M_S2;

use crate::Calibration;
use crate::finding::Refusal;
use crate::planar::{Handling, PlanarDoubt, PlanarInput, PlanarNoise, SHAPE_RANGE, SPEED_MIN_M_S};
use crate::tuning::PlanarTuning;
use search::Problem;

/// Number of parameters.
pub const PARAMETERS: usize = 13;
/// Names of the parameters, as in [`Handling`].
pub const NAMES: [&str; PARAMETERS] = [
    "front_stiffness_n_rad",
    "rear_stiffness_n_rad",
    "front_friction",
    "rear_friction",
    "front_shape",
    "rear_shape",
    "yaw_inertia_kg_m2",
    "roll_gain",
    "steer_gain",
    "drive_split_front",
    "brake_split_front",
    "load_transfer_height_m",
    "relaxation_length_m",
];
/// How well the vehicle file is taken to know each parameter before the drive: stiffnesses,
/// frictions, inertia, height and length as natural logarithms, the others as they are.
pub const PRIOR_SIGMA: [f64; PARAMETERS] = [
    1.0, 1.0, 0.15, 0.15, 0.4, 0.4, 0.15, 0.04, 0.1, 0.1, 0.08, 0.2, 0.4,
];
/// Whether a parameter is searched for as its logarithm.
const LOGARITHMIC: [bool; PARAMETERS] = [
    true, true, true, true, false, false, true, false, false, false, false, true, true,
];
/// Number of parameters that are searched for: those of [`NAMES`], then the delays of steer angle and
/// lateral acceleration against the yaw rate, s.
const SEARCHED: usize = PARAMETERS + 2;
/// Position of the delays.
const DELAY: usize = PARAMETERS;
/// Standard deviation of a delay before the drive, s.
const DELAY_SIGMA_S: f64 = 0.1;
/// Delay up to which none is assumed, s: roll and compliance delay the lateral acceleration too, and the
/// relaxation length contains that.
const DELAY_NONE_S: f64 = 0.015;
/// Largest delay that is corrected, s.
const DELAY_MAX_S: f64 = 0.08;
/// Parameters that are searched for, as they are searched for.
type Theta = [f64; SEARCHED];

/// Standard deviation of a parameter before the drive.
const fn prior_sigma(index: usize) -> f64 {
    if index < PARAMETERS {
        PRIOR_SIGMA[index]
    } else {
        DELAY_SIGMA_S
    }
}

/// Difference of a parameter from the vehicle file that is reported, in its standard deviations before the
/// drive.
const CONTRADICTION: f64 = 3.0;

/// Friction over the greatest lateral acceleration of the drive over gravity, at least: nobody stays
/// at the limit for long.
const FRICTION_OVER_PEAK: f64 = 1.1;

/// What is looked for, in messages.
const WHAT: &str = "handling";
/// Least time of driving that is looked at, s.
const DRIVEN_MIN_S: f64 = 60.0;
/// Longest interval between rows that counts as driven, s: rows of slower sensors are further apart than
/// those of the filter.
const INTERVAL_MAX_S: f64 = 0.25;
/// Peak lateral acceleration below which a drive tells nothing of tyres, m/s^2.
const PEAK_MIN_M_S2: f64 = 2.0;
/// Innovation, standard deviations, beyond which the cost grows linearly.
const HUBER: f64 = 3.0;
/// A prior weighs as much as this many rows: neighbouring innovations err alike.
const PRIOR_ROWS: f64 = 100.0;
/// Errors of the model by a tuning.
type DoubtOf = fn(&PlanarTuning) -> PlanarDoubt;
/// Process noise of the model in each round of the fit, and the number of iterations. With a large
/// process noise the filter follows the measurements from any initial parameters. With a small one the
/// parameters can be distinguished.
const ROUNDS: [(DoubtOf, usize); 3] = [
    (PlanarDoubt::file, 8),
    (PlanarDoubt::identified, 8),
    (PlanarDoubt::identified, 6),
];
/// Relative fall of the cost at which a round ends.
const AT_REST: f64 = 1e-5;
/// Longest step of an iteration, in deviations of the prior: far away the slopes tell little.
const STEP_MAX: f64 = 1.0;
/// Stiffnesses that are tried first, as multiples of the vehicle file's.
const STARTS: [f64; 3] = [0.5, 1.0, 2.0];
/// Cosine of two quantities over a drive, below which one of them has the wrong sign.
const CONTRADICTS: f64 = -0.3;
/// A vehicle spins where in this many rows the lateral velocity changes by more than this part of the
/// greatest speed, and so many m/s more, which bank and offsets may give.
const SPIN_ROWS: usize = 100;
const SPIN_PART: f64 = 0.5;
const SPIN_MIN_M_S: f64 = 1.0;
/// Rows that are left out before and behind those.
const SPIN_AROUND_ROWS: usize = 100;
/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// The parameters.
    pub handling: Handling,
    /// Their standard deviations, in their own units, in the order of [`NAMES`].
    pub sigma: [f64; PARAMETERS],
    /// Part of each parameter that the drive told: 0 where it stayed with the vehicle file, towards
    /// 1 where that did not matter.
    pub told: [f64; PARAMETERS],
    /// What the steering encoder reads too much, at the road wheels, rad.
    pub steer_offset_rad: f64,
    /// What the gyro reads too much, rad/s.
    pub yaw_rate_offset_rad_s: f64,
    /// What the accelerometer reads too much, m/s^2.
    pub lateral_offset_m_s2: f64,
    /// Root mean square of the innovations of yaw rate (rad/s) and lateral acceleration (m/s^2).
    pub innovation_rms: [f64; 2],
    /// Noise of both, from their second differences.
    pub noise: PlanarNoise,
    /// Delays of steer angle and lateral acceleration against the yaw rate, s.
    pub delay_s: [f64; 2],
    /// Whether the delay was corrected; a small one is not.
    pub corrected: [bool; 2],
    /// Their standard deviations, s.
    pub delay_sigma_s: [f64; 2],
    /// Time above 3 m/s with yaw rate and lateral acceleration, s.
    pub used_s: f64,
    /// Time that was left out because the vehicle spun, s.
    pub spun_s: f64,
    /// Parameters that differ from the vehicle file by more than it can be wrong, or are at an end of
    /// their range, and other remarks.
    pub notes: Vec<String>,
    /// Greatest lateral acceleration, a tenth of a second's mean, m/s^2.
    pub peak_m_s2: f64,
}

impl Identified {
    /// Puts what was found into a calibration; offsets add to those that were taken off already.
    pub fn put(&self, steering_ratio: f64, calibration: &mut Calibration) {
        calibration.handling = Some(self.handling);
        calibration.steer.offset_rad += steering_ratio * self.steer_offset_rad;
        let imu = &mut calibration.imu;
        imu.gyro_bias_rad_s[2] += self.yaw_rate_offset_rad_s;
        imu.accel_bias_m_s2[1] += self.lateral_offset_m_s2;
        imu.gyro_noise_rad_s = Some(self.noise.yaw_rate_rad_s);
        imu.accel_noise_m_s2 = Some(self.noise.acceleration_m_s2);
    }
}

/// Finds how the vehicle handles.
///
/// `inputs` are rows of 10 ms by rising time; `imu_ahead_m` is the inertial unit's distance ahead of
/// the centre of gravity.
///
/// # Errors
/// A drive that is too short or too gentle; a wrong sign; parameters that no vehicle has.
pub fn identify(
    inputs: &[PlanarInput],
    vehicle: &Vehicle,
    imu_ahead_m: f64,
) -> Result<Identified, Refusal> {
    signs_agree(inputs)?;
    let all_s = driven_s(inputs.iter());
    let inputs = &without_spins(&delays::between_values(inputs));
    let spun_s = (all_s - driven_s(inputs.iter())).max(0.0);
    let fast = inputs.iter().filter(|row| {
        row.speed_m_s > SPEED_MIN_M_S && row.yaw_rate_rad_s.is_some() && row.lateral_m_s2.is_some()
    });
    let used_s = driven_s(fast);
    if used_s < DRIVEN_MIN_S {
        return Err(Refusal::TooShort {
            what: WHAT.to_owned(),
            found_s: used_s,
            needed_s: DRIVEN_MIN_S,
            help: "rows need speed above 3 m/s, steer, yaw rate and lateral acceleration; give a \
                   longer drive, or look at the column map"
                .to_owned(),
        });
    }
    let peak_m_s2 = peak(inputs);
    if peak_m_s2 < PEAK_MIN_M_S2 {
        return Err(Refusal::NotExcited {
            what: WHAT.to_owned(),
            quantity: "peak of the lateral acceleration".to_owned(),
            found: peak_m_s2,
            needed: PEAK_MIN_M_S2,
            unit: "m/s^2".to_owned(),
            help: "drive tighter or faster bends".to_owned(),
        });
    }
    let problem = Problem {
        inputs,
        no_delay: [false; 2],
        vehicle,
        imu_ahead_m,
        noise: noise(inputs),
        prior: to_theta(&before_the_drive(vehicle, peak_m_s2)),
    };
    let noise = problem.noise;
    let fit = problem.fit()?;
    let handling = from_theta(&fit.theta);
    if let Some((name, value)) = handling.implausible() {
        return Err(Refusal::Value {
            what: WHAT.to_owned(),
            name: name.to_owned(),
            value,
            expected: "what a vehicle can have; look at signs and units of the column map, and at \
                       mass and axle distances of the vehicle file"
                .to_owned(),
        });
    }
    let [steer, gyro, accel] = fit.run.offsets;
    Ok(Identified {
        handling,
        sigma: std::array::from_fn(|j| fit.deviations.sigma[j]),
        told: std::array::from_fn(|j| fit.deviations.told[j]),
        steer_offset_rad: -steer / handling.steer_gain,
        yaw_rate_offset_rad_s: gyro,
        lateral_offset_m_s2: accel,
        innovation_rms: [0, 1].map(|i| rms(fit.run.residuals.iter().skip(i).step_by(2))),
        noise,
        delay_s: fit.delay_s,
        delay_sigma_s: fit.delay_sigma_s,
        corrected: fit.corrected,
        used_s,
        spun_s,
        notes: notes(&fit.theta, &fit.prior),
        peak_m_s2,
    })
}

/// Time that rows cover, s.
fn driven_s<'r>(rows: impl Iterator<Item = &'r PlanarInput>) -> f64 {
    let mut before_s: Option<f64> = None;
    let mut driven_s = 0.0;
    for row in rows {
        let step_s = before_s.map_or(0.0, |before_s| row.time_s - before_s);
        if (0.0..=INTERVAL_MAX_S).contains(&step_s) {
            driven_s += step_s;
        }
        before_s = Some(row.time_s);
    }
    driven_s
}

/// Parameters that contradict the vehicle file, and those at an end of their range.
fn notes(theta: &Theta, prior: &Theta) -> Vec<String> {
    let (found, file) = (values(&from_theta(theta)), values(&from_theta(prior)));
    let mut notes = Vec::new();
    for (j, name) in NAMES.into_iter().enumerate() {
        let apart = (theta[j] - prior[j]) / PRIOR_SIGMA[j];
        if apart.abs() > CONTRADICTION {
            notes.push(format!(
                "{name}: the drive gives {:.4}, the vehicle file {:.4}, which is {:.1} standard \
                 deviations of the file away; correct the vehicle file, or check the units and mass",
                found[j],
                file[j],
                apart.abs()
            ));
        }
        if range::is_at_end(j, theta[j]) && apart != 0.0 {
            notes.push(format!(
                "{name}: {:.4} is an end of its physical range, so that its sigma is no measure of \
                 its error; the drive does not tell it",
                found[j]
            ));
        }
    }
    notes
}

/// Steer, speed times yaw rate and lateral acceleration go together: one that goes against both
/// others has the wrong sign.
fn signs_agree(inputs: &[PlanarInput]) -> Result<(), Refusal> {
    let mut squares = Matrix3::zeros();
    for row in inputs {
        if let (Some(rate), Some(lateral)) = (row.yaw_rate_rad_s, row.lateral_m_s2) {
            let three = Vector3::new(row.steer_rad, row.speed_m_s * rate, lateral);
            squares += three * three.transpose();
        }
    }
    let contradict = |i: usize, j: usize| {
        squares[(i, j)] < CONTRADICTS * (squares[(i, i)] * squares[(j, j)]).sqrt()
    };
    for (i, name) in ["steer angle", "yaw rate", "lateral acceleration"]
        .into_iter()
        .enumerate()
    {
        if contradict(i, (i + 1) % 3) && contradict(i, (i + 2) % 3) {
            return Err(Refusal::Value {
                what: WHAT.to_owned(),
                name: format!("sign of the {name}"),
                value: -1.0,
                expected: "what goes with the other two of steer angle, yaw rate and lateral \
                           acceleration, all positive to the left; turn it with scale = -1 in the \
                           column map"
                    .to_owned(),
            });
        }
    }
    Ok(())
}

/// The rows in which the vehicle goes where it points, more or less. Tyres that slide all ways say
/// nothing of handling, and the rows after a spin are those of a vehicle whose motion is unknown;
/// the filter takes what is left out for a gap.
fn without_spins(inputs: &[PlanarInput]) -> Vec<PlanarInput> {
    let mut across_m_s = vec![0.0];
    for pair in inputs.windows(2) {
        let [row, next] = [&pair[0], &pair[1]];
        let before = across_m_s[across_m_s.len() - 1];
        let turned = row.yaw_rate_rad_s.unwrap_or(0.0) * row.speed_m_s;
        let dt_s = (next.time_s - row.time_s).clamp(0.0, 0.1);
        across_m_s.push(before + dt_s * (row.lateral_m_s2.unwrap_or(turned) - turned));
    }
    let mut spins = vec![false; inputs.len()];
    for end in SPIN_ROWS..inputs.len() {
        let begin = end - SPIN_ROWS;
        let rows = &inputs[begin..end];
        let speed = rows.iter().map(|row| row.speed_m_s).fold(0.0, f64::max);
        let gained = (across_m_s[end] - across_m_s[begin]).abs();
        if gained > SPIN_PART * speed + SPIN_MIN_M_S {
            let after = inputs.len().min(end + SPIN_AROUND_ROWS);
            spins[begin.saturating_sub(SPIN_AROUND_ROWS)..after].fill(true);
        }
    }
    let kept = inputs.iter().zip(spins).filter(|(_, spins)| !spins);
    kept.map(|(row, _)| *row).collect()
}

/// What is thought of the vehicle before its drive is looked at.
fn before_the_drive(vehicle: &Vehicle, peak_m_s2: f64) -> Handling {
    let told = Handling::of_vehicle(vehicle);
    let least = FRICTION_OVER_PEAK * peak_m_s2 / STANDARD_GRAVITY_M_S2;
    Handling {
        front_friction: told.front_friction.max(least),
        rear_friction: told.rear_friction.max(least),
        ..told
    }
}

/// Values in the order of [`NAMES`].
#[must_use]
pub fn values(h: &Handling) -> [f64; PARAMETERS] {
    [
        h.front_stiffness_n_rad,
        h.rear_stiffness_n_rad,
        h.front_friction,
        h.rear_friction,
        h.front_shape,
        h.rear_shape,
        h.yaw_inertia_kg_m2,
        h.roll_gain,
        h.steer_gain,
        h.drive_split_front,
        h.brake_split_front,
        h.load_transfer_height_m,
        h.relaxation_length_m,
    ]
}

fn to_theta(h: &Handling) -> Theta {
    let values = values(h);
    std::array::from_fn(|j| {
        if j >= PARAMETERS {
            0.0
        } else if LOGARITHMIC[j] {
            math::ln(values[j])
        } else {
            values[j]
        }
    })
}

fn from_theta(theta: &Theta) -> Handling {
    let at = |j: usize| {
        if LOGARITHMIC[j] {
            math::exp(theta[j])
        } else {
            theta[j]
        }
    };
    let shape = |j: usize| at(j).clamp(SHAPE_RANGE[0], SHAPE_RANGE[1]);
    Handling {
        front_stiffness_n_rad: at(0),
        rear_stiffness_n_rad: at(1),
        front_friction: at(2),
        rear_friction: at(3),
        front_shape: shape(4),
        rear_shape: shape(5),
        yaw_inertia_kg_m2: at(6),
        roll_gain: at(7),
        steer_gain: at(8),
        drive_split_front: at(9),
        brake_split_front: at(10),
        load_transfer_height_m: at(11),
        relaxation_length_m: at(12),
    }
}

/// Noise of yaw rate and lateral acceleration: of white noise, second differences have six times
/// its variance; the median leaves manoeuvres out.
fn noise(inputs: &[PlanarInput]) -> PlanarNoise {
    let of = |pick: fn(&PlanarInput) -> Option<f64>| {
        let mut sizes: Vec<f64> = inputs
            .windows(3)
            .filter_map(|w| Some((pick(&w[0])? - 2.0 * pick(&w[1])? + pick(&w[2])?).abs()))
            .collect();
        sizes.sort_by(f64::total_cmp);
        let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        median / 0.6745 / 6.0_f64.sqrt()
    };
    PlanarNoise {
        yaw_rate_rad_s: of(|row| row.yaw_rate_rad_s),
        acceleration_m_s2: of(|row| row.lateral_m_s2),
    }
}

fn peak(inputs: &[PlanarInput]) -> f64 {
    let values: Vec<f64> = inputs.iter().filter_map(|row| row.lateral_m_s2).collect();
    let means = values
        .chunks(10)
        .map(|c| c.iter().sum::<f64>() / c.len() as f64);
    means.fold(0.0, |peak: f64, mean| peak.max(mean.abs()))
}

fn rms<'v>(values: impl Iterator<Item = &'v f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}
