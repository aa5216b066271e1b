//! Bias and axes of the hub accelerometers, from rest and from driving.
//!
//! With small turns (a, b, c) about x, y, z from the carrier's to the sensor's axes a sensor reads
//!
//! f_s = f + (a, b, c) x f + bias
//!
//! of the specific force f in the carrier's axes, which follows from the inertial unit, from the pose
//! of the upright by potentiometer and steering wheel, and from the lever arm. At rest f is gravity,
//! so that each bias shows with one of the turns about the level axes. Speeding up and braking tell b
//! by what f_z sees of f_x and c by what f_y sees of it; turns tell a by what f_z sees of f_y. The ground
//! is taken as even: in the mean over a window of 0.4 s a wheel does not accelerate along its normal,
//! which follows from the four potentiometers, while the body does.

use model::sensors::HubAcceleration;
use model::suspension::Corner;
use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use sample::{HubAccelerationSample, PerWheel, STANDARD_GRAVITY_M_S2, Wheel};

use super::HubCalibration;
use super::gnss::Vectors;
use super::imu::{ImuLog, ImuSignal, Lean, Leaning, windows};
use super::rest::{Signal, Stretch};
use crate::finding::{Excitation, Finding, Findings, Refusal, Span};
use crate::regression::{Fit, least_squares};
use crate::statistics::interval_95;

const WHAT: &str = "hub";
/// Length of the windows, s.
const WINDOW_S: f64 = 0.4;
/// Least rest, s.
const REST_NEEDED_S: f64 = 3.0;
/// Least change of the specific force (rms) that tells an axis, m/s^2.
const ACCELERATION_NEEDED_M_S2: f64 = 0.3;
/// Least part of gravity on the upward axis of a sensor that is not turned: 37 degrees off.
const UPWARD_LEAST: f64 = 0.8;
/// Most part of gravity on a level axis of a sensor without an upward one: a side slope of 30 degrees.
const LEVEL_MOST: f64 = 0.5;
/// A correction of this size ends the iteration, rad and m/s^2.
const ROUNDS: usize = 3;

/// A log with rest and driving.
#[derive(Clone, Copy, Debug)]
pub struct HubLog<'a> {
    /// The inertial unit, body axes, bias and misalignment taken off.
    pub imu: ImuSignal<'a>,
    /// Its position from the centre of gravity, m.
    pub imu_m: [f64; 3],
    /// Readings of each sensor in its own axes before calibration, m/s^2; `NaN` where there is none.
    pub hub: PerWheel<Vectors<'a>>,
    /// Compression of the struts from the design length, m.
    pub compression_m: PerWheel<Signal<'a>>,
    /// Steering wheel from straight ahead, rad; empty: straight ahead.
    pub steering_wheel_rad: Signal<'a>,
    /// Stretches of rest.
    pub rest: &'a [Stretch],
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct HubFound {
    /// Biases and turns with their deviations.
    pub findings: Findings,
    /// What goes into the file, for each wheel that has a sensor.
    pub calibration: PerWheel<Option<HubCalibration>>,
}

/// A sensor on which gravity does not show as it should.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.text())]
pub struct WrongAxes {
    /// Which sensor.
    pub wheel: Wheel,
    /// Axis with the largest mean, 0 to 2.
    pub axis: usize,
    /// Its mean, m/s^2.
    pub value_m_s2: f64,
}

impl WrongAxes {
    /// Judges a sensor by the mean of its readings, at rest or over seconds of driving; axes that
    /// are not measured are `None`.
    #[must_use]
    pub fn find(wheel: Wheel, mean_m_s2: [Option<f64>; 3]) -> Option<Self> {
        let [x, y, z] = mean_m_s2;
        let right = match z {
            Some(z) => z > UPWARD_LEAST * STANDARD_GRAVITY_M_S2,
            None => [x, y]
                .into_iter()
                .flatten()
                .all(|level| level.abs() < LEVEL_MOST * STANDARD_GRAVITY_M_S2),
        };
        let means = (0..3).filter_map(|axis| Some((axis, mean_m_s2[axis]?)));
        let (axis, value_m_s2) = means.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        (!right).then_some(Self {
            wheel,
            axis,
            value_m_s2,
        })
    }

    /// What is wrong, and the remedy.
    fn text(&self) -> String {
        let value = self.value_m_s2;
        let axis = HubAccelerationSample::AXES[self.axis];
        let corner = self.wheel.abbreviation();
        if value.abs() < LEVEL_MOST * STANDARD_GRAVITY_M_S2 {
            return format!(
                "no axis shows gravity, the largest mean is {value:.1} \
                 m/s^2 on {axis}; check hub_acceleration.range_m_s2 and adc_bits of the sensors file"
            );
        }
        format!(
            "gravity shows as {value:.1} m/s^2 on {axis} instead of \
             +9.8 m/s^2 on z; mount the sensor with its z axis up, or correct the roles \
             hub_acceleration.{corner} of the source"
        )
    }
}

/// Finds biases and turns of all sensors.
///
/// # Errors
/// No readings, too little rest, no straight acceleration, or a sensor that is mounted turned.
pub fn hub(
    vehicle: &Vehicle,
    sensors: &HubAcceleration,
    logs: &[HubLog<'_>],
) -> Result<HubFound, Refusal> {
    let mut found = HubFound {
        findings: Findings {
            what: "hub accelerometers".to_owned(),
            ..Findings::default()
        },
        calibration: PerWheel::default(),
    };
    let is_known = |wheel: &Wheel| {
        let values = logs.iter().flat_map(|log| log.hub[*wheel].value);
        values.flatten().any(|value| value.is_finite())
    };
    let refused =
        |wheel: Wheel| move |r: Refusal| r.of(&format!("{WHAT} {}", wheel.abbreviation()));
    for wheel in Wheel::ALL.into_iter().filter(is_known) {
        check_rest(wheel, logs).map_err(refused(wheel))?;
    }
    for wheel in Wheel::ALL.into_iter().filter(is_known) {
        let sensor = Sensor::new(vehicle, sensors, wheel, logs);
        let fitted = sensor.fit().map_err(refused(wheel))?;
        found.calibration[wheel] = Some(fitted.describe(&sensor, &mut found.findings));
    }
    if found.findings.findings.is_empty() {
        return Err(Refusal::Missing {
            what: WHAT.to_owned(),
            channel: "hub acceleration".to_owned(),
            help: "record it in the same log, and give the sensors file [hub_acceleration]"
                .to_owned(),
        });
    }
    Ok(found)
}

/// Refuses too little rest, and a sensor that is mounted turned.
fn check_rest(wheel: Wheel, logs: &[HubLog<'_>]) -> Result<(), Refusal> {
    let (mut rested_s, mut mean) = (0.0, Mean::default());
    for log in logs {
        for stretch in log.rest {
            let within = mean.add(&log.hub[wheel], stretch.from_s, stretch.to_s);
            rested_s += if within {
                stretch.to_s - stretch.from_s
            } else {
                0.0
            };
        }
    }
    if rested_s < REST_NEEDED_S {
        return Err(Refusal::TooShort {
            what: String::new(),
            found_s: rested_s,
            needed_s: REST_NEEDED_S,
            help: "let the vehicle stand still for 10 s before it drives".to_owned(),
        });
    }
    match WrongAxes::find(wheel, mean.values()) {
        None => Ok(()),
        Some(wrong) => Err(Refusal::Value {
            what: String::new(),
            name: format!(
                "mean of {} at rest",
                HubAccelerationSample::AXES[wrong.axis]
            ),
            value: wrong.value_m_s2,
            expected: format!("gravity on z ({wrong})"),
        }),
    }
}

/// Mean of readings, each axis by itself.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: [f64; 3],
    count: [f64; 3],
}

impl Mean {
    /// Adds the readings between two times; whether there were any.
    fn add(&mut self, readings: &Vectors<'_>, from_s: f64, to_s: f64) -> bool {
        let first = readings.time_s.partition_point(|&t| t < from_s);
        let last = readings.time_s.partition_point(|&t| t <= to_s);
        for reading in &readings.value[first..last.max(first)] {
            for (axis, value) in reading.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                self.sum[axis] += value;
                self.count[axis] += 1.0;
            }
        }
        last > first
    }

    fn values(&self) -> [Option<f64>; 3] {
        std::array::from_fn(|i| (self.count[i] > 0.0).then(|| self.sum[i] / self.count[i]))
    }
}

/// A window: specific force in carrier axes, and what the sensor's axes read.
struct Window {
    force: Vector3<f64>,
    read: [Option<f64>; 3],
}

/// One sensor with its data.
struct Sensor<'a> {
    wheel: Wheel,
    spec: &'a HubAcceleration,
    windows: Vec<Window>,
    measured: [bool; 3],
    span: Span,
    /// Change of the carrier's specific force along x and y, rms, m/s^2.
    excitation: [f64; 2],
}

impl<'a> Sensor<'a> {
    fn new(
        vehicle: &Vehicle,
        spec: &'a HubAcceleration,
        wheel: Wheel,
        logs: &[HubLog<'_>],
    ) -> Self {
        let carrier = Carrier::new(vehicle, spec, wheel);
        let mut sensor = Self {
            wheel,
            spec,
            windows: Vec::new(),
            measured: [false; 3],
            span: Span::default(),
            excitation: [0.0; 2],
        };
        for log in logs {
            let of_imu = ImuLog {
                imu: log.imu,
                ..ImuLog::default()
            };
            for rows in windows::windows(&of_imu, WINDOW_S) {
                let (from_s, to_s) = (log.imu.time_s[rows.start], log.imu.time_s[rows.end - 1]);
                let mut mean = Mean::default();
                mean.add(&log.hub[wheel], from_s, to_s);
                let read = mean.values();
                let Some(force) = carrier.force(log, rows) else {
                    continue;
                };
                if read.iter().any(Option::is_some) {
                    windows::extend(&mut sensor.span, from_s, to_s, 1);
                    sensor.windows.push(Window { force, read });
                }
            }
        }
        sensor.measured =
            std::array::from_fn(|axis| sensor.windows.iter().any(|w| w.read[axis].is_some()));
        let count = sensor.windows.len().max(1) as f64;
        sensor.excitation = std::array::from_fn(|axis| {
            let along = || sensor.windows.iter().map(|window| window.force[axis]);
            let mean = along().sum::<f64>() / count;
            (along().map(|f| (f - mean).powi(2)).sum::<f64>() / count).sqrt()
        });
        sensor
    }

    /// Which of a, b, c and the three biases the data tell. A turn that the data do not tell is taken
    /// as zero, so that its part of gravity counts as bias.
    fn told(&self) -> [bool; 6] {
        let [x, y, z] = self.measured;
        let turning = self.excitation[1] >= ACCELERATION_NEEDED_M_S2;
        [z && turning, z, y || (x && turning), x, y, z]
    }

    fn fit(&self) -> Result<Fitted, Refusal> {
        if self.excitation[0] < ACCELERATION_NEEDED_M_S2 {
            return Err(Refusal::NotExcited {
                what: String::new(),
                quantity: "acceleration along the vehicle (rms)".to_owned(),
                found: self.excitation[0],
                needed: ACCELERATION_NEEDED_M_S2,
                unit: "m/s^2".to_owned(),
                help: "speed up and brake firmly on a straight".to_owned(),
            });
        }
        let told = self.told();
        let columns: Vec<usize> = (0..6).filter(|column| told[*column]).collect();
        let mut values = [0.0; 6];
        let mut round = 0;
        loop {
            let [a, b, c, bias @ ..] = values;
            let turn = Rotation3::from_euler_angles(a, b, c);
            let mut rows = Vec::new();
            for window in &self.windows {
                let expected = turn * window.force + Vector3::from(bias);
                for axis in 0..3 {
                    if let Some(read) = window.read[axis] {
                        rows.push((window.slopes(axis), read - expected[axis]));
                    }
                }
            }
            let design = DMatrix::from_fn(rows.len(), columns.len(), |i, j| rows[i].0[columns[j]]);
            let response = DVector::from_fn(rows.len(), |i, _| rows[i].1);
            let fit = least_squares(&design, &response)?;
            for (column, step) in columns.iter().zip(&fit.coefficients) {
                values[*column] += step;
            }
            round += 1;
            if round == ROUNDS {
                return Ok(Fitted {
                    values,
                    columns,
                    fit,
                });
            }
        }
    }
}

impl Window {
    /// Derivatives of an axis's reading by a, b, c and the three biases: (a, b, c) x f + bias.
    fn slopes(&self, axis: usize) -> [f64; 6] {
        let f = self.force;
        let mut slopes = match axis {
            0 => [0.0, f.z, -f.y, 0.0, 0.0, 0.0],
            1 => [-f.z, 0.0, f.x, 0.0, 0.0, 0.0],
            _ => [f.y, -f.x, 0.0, 0.0, 0.0, 0.0],
        };
        slopes[3 + axis] = 1.0;
        slopes
    }
}

/// Turns and biases of one sensor.
struct Fitted {
    values: [f64; 6],
    /// Which of them the data told.
    columns: Vec<usize>,
    fit: Fit,
}

impl Fitted {
    fn describe(&self, sensor: &Sensor<'_>, findings: &mut Findings) -> HubCalibration {
        let corner = sensor.wheel.abbreviation();
        let untold_rad = sensor.spec.misalignment_rad / 3.0_f64.sqrt();
        let mut sigma = [0.0; 6];
        for (position, &column) in self.columns.iter().enumerate() {
            // A turn that is not told moves the bias of the level axis that gravity would show on.
            let doubt = match column {
                3 if !self.columns.contains(&1) => STANDARD_GRAVITY_M_S2 * untold_rad,
                4 if !self.columns.contains(&0) => STANDARD_GRAVITY_M_S2 * untold_rad,
                _ => 0.0,
            };
            sigma[column] = math::hypot(self.fit.sigma(position), doubt);
            let axis = HubAccelerationSample::AXES[column % 3];
            let (name, unit) = match column {
                0..3 => (format!("{corner} misalignment about {axis}"), "rad"),
                _ => (format!("{corner} bias {axis}"), "m/s^2"),
            };
            findings.findings.push(Finding {
                name,
                value: self.values[column],
                unit: unit.to_owned(),
                sigma: sigma[column],
                interval: Some(interval_95(self.values[column], sigma[column])),
                condition: self.fit.condition,
                excitation: Some(Excitation {
                    rms: self.fit.excitation[position],
                    unit: if column < 3 { "m/s^2" } else { "-" }.to_owned(),
                }),
                whiteness: Some(self.fit.whiteness),
                span: sensor.span,
            });
        }
        for column in (0..3).filter(|column| !self.columns.contains(column)) {
            let axis = HubAccelerationSample::AXES[column];
            findings.notes.push(format!(
                "{corner} misalignment about {axis} does not follow from these axes and this drive and is \
                 taken as 0"
            ));
        }
        let [a, b, c, bias @ ..] = self.values;
        HubCalibration {
            bias_m_s2: Some(bias),
            bias_sigma_m_s2: Some([sigma[3], sigma[4], sigma[5]]),
            misalignment_rad: Some([a, b, c]),
            dead: false,
        }
    }
}

/// Where a sensor stands.
struct Carrier {
    corner: Option<Corner>,
    lean: Option<Lean>,
    wheel: Wheel,
    design_length_m: f64,
    rack_m_rad: f64,
    ratio: f64,
    cg_height_m: f64,
    /// Wheel centre of a vehicle without hard-points, from the centre of gravity, m.
    design_m: Vector3<f64>,
    /// Sensor from the wheel centre, carrier axes, m.
    place_m: Vector3<f64>,
}

impl Carrier {
    fn new(vehicle: &Vehicle, spec: &HubAcceleration, wheel: Wheel) -> Self {
        let axle = vehicle.axle(wheel);
        let [ahead_m, left_m] = vehicle.wheel_place_m(wheel);
        let cg_height_m = vehicle.body.cg_height_m;
        let height_m = axle.tyre.unloaded_radius_m - cg_height_m;
        let steered = f64::from(u8::from(wheel.is_front()));
        Self {
            corner: Corner::of(vehicle, wheel).ok(),
            lean: Lean::of(vehicle),
            wheel,
            design_length_m: axle.strut.as_ref().map_or(0.0, |s| s.design_length_m),
            rack_m_rad: steered * vehicle.steering.rack_m_rad.unwrap_or(0.0),
            ratio: steered / vehicle.steering.ratio,
            cg_height_m,
            design_m: Vector3::new(ahead_m, left_m, height_m),
            place_m: spec.position_of_m(wheel).into(),
        }
    }

    /// Mean specific force at the sensor over rows of the inertial unit, carrier axes, m/s^2.
    fn force(&self, log: &HubLog<'_>, rows: std::ops::Range<usize>) -> Option<Vector3<f64>> {
        let imu = &log.imu;
        let mean = |values: &[[f64; 3]], rows: std::ops::Range<usize>| {
            let count = rows.len() as f64;
            values[rows]
                .iter()
                .map(|v| Vector3::from(*v))
                .sum::<Vector3<f64>>()
                / count
        };
        let (from_s, to_s) = (imu.time_s[rows.start], imu.time_s[rows.end - 1]);
        let ends = windows::END_READINGS;
        let start = mean(imu.rate_rad_s, rows.start..rows.start + ends);
        let end = mean(imu.rate_rad_s, rows.end - ends..rows.end);
        let rate_dot = (end - start) / (to_s - from_s);
        let rate = mean(imu.rate_rad_s, rows.clone());
        let steering_wheel = log.steering_wheel_rad.mean(from_s, to_s).unwrap_or(0.0);
        let (axes, centre_m) = match &self.corner {
            Some(corner) => {
                let compression_m = log.compression_m[self.wheel].mean(from_s, to_s)?;
                let length_m = self.design_length_m - compression_m;
                let pose = corner
                    .pose(length_m, self.rack_m_rad * steering_wheel)
                    .ok()?;
                let up_m = Vector3::new(0.0, 0.0, self.cg_height_m);
                (pose.vehicle_from_upright, pose.wheel_centre_m - up_m)
            }
            None => {
                let steer_rad = steering_wheel * self.ratio;
                let turn = Rotation3::from_euler_angles(0.0, 0.0, steer_rad);
                (turn.into_inner(), self.design_m)
            }
        };
        let arm = centre_m + axes * self.place_m - Vector3::from(log.imu_m);
        let turned = |arm: Vector3<f64>| rate_dot.cross(&arm) + rate.cross(&rate.cross(&arm));
        let of_imu = mean(imu.force_m_s2, rows);
        let at_cg = of_imu - turned(log.imu_m.into());
        let mut force = of_imu + turned(arm);
        if let Some(normal) = self.ground_normal(log, from_s, to_s, at_cg, steering_wheel) {
            force += normal * (STANDARD_GRAVITY_M_S2 - force.dot(&normal));
        }
        let carrier: Matrix3<f64> = axes.transpose();
        let force = carrier * force;
        force.iter().all(|f| f.is_finite()).then_some(force)
    }
}

impl Carrier {
    /// Normal of even ground in body axes, by the springs.
    fn ground_normal(
        &self,
        log: &HubLog<'_>,
        from_s: f64,
        to_s: f64,
        force: Vector3<f64>,
        steering_wheel_rad: f64,
    ) -> Option<Vector3<f64>> {
        let compression = |wheel: Wheel| log.compression_m[wheel].mean(from_s, to_s);
        let [Some(fl), Some(fr), Some(rl), Some(rr)] = Wheel::ALL.map(compression) else {
            return None;
        };
        let [roll_rad, pitch_rad] = self.lean.as_ref()?.roll_pitch_rad(&Leaning {
            compression_m: PerWheel([fl, fr, rl, rr]),
            force_m_s2: [force.x, force.y],
            steering_wheel_rad,
        })?;
        let ground_from_body = Rotation3::from_euler_angles(roll_rad, pitch_rad, 0.0);
        Some(ground_from_body.inverse() * Vector3::z())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_sensor_is_named_with_axis_value_and_remedy() {
        let find = |mean| WrongAxes::find(Wheel::FrontRight, mean);
        assert_eq!(find([Some(0.4), Some(-0.3), Some(9.7)]), None);
        assert_eq!(find([Some(0.4), None, None]), None);
        assert_eq!(find([None; 3]), None);
        let turned = find([Some(0.2), Some(-9.75), Some(0.3)]).unwrap();
        assert_eq!((turned.axis, turned.value_m_s2), (1, -9.75));
        let text = turned.to_string();
        for part in ["-9.8 m/s^2 on y", "z axis up", "hub_acceleration.FR"] {
            assert!(text.contains(part), "{text}");
        }
        let upside_down = find([Some(0.2), Some(0.1), Some(-9.8)]).unwrap();
        assert!(upside_down.to_string().contains("-9.8 m/s^2 on z"));
        assert!(find([Some(9.8), None, None]).is_some());
        let wrong_scale = find([Some(0.1), Some(0.0), Some(1.2)]).unwrap();
        assert!(wrong_scale.to_string().contains("range_m_s2"));
    }
}
