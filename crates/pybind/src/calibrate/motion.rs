//! Inertial unit, receivers and wheels of a moving vehicle.

use estimator::calibration::Calibration;
use estimator::calibration::gnss::{GnssInput, Vectors, gnss, sigma_of};
use estimator::calibration::hub::{HubLog, hub};
use estimator::calibration::imu::{ImuLog, ImuSignal, Lean, Leaning, imu};
use estimator::calibration::rest::{Signal, Stretch, stretches};
use estimator::calibration::wheel_radius::{RadiusInput, wheel_radius};
use estimator::calibration::zero::rest_roll_pitch_rad;
use pyo3::prelude::*;
use sample::PerWheel;

use super::{Found, with_table};
use crate::errors;
use crate::findings::{column, dict, estimator, refusal, same_length, vectors};
use crate::input::Doubles;
use crate::sensors::Sensors;
use crate::vehicle::Vehicle;

/// An inertial unit's readings, as a dict.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Inertial<'py> {
    time_s: Doubles<'py>,
    force_m_s2: Doubles<'py>,
    rate_rad_s: Doubles<'py>,
}

/// The same as columns.
struct Columns {
    time_s: Vec<f64>,
    force_m_s2: Vec<[f64; 3]>,
    rate_rad_s: Vec<[f64; 3]>,
}

impl Columns {
    fn of(argument: &str, unit: &Inertial<'_>) -> PyResult<Self> {
        let columns = Self {
            time_s: column(&format!("{argument}.time_s"), Some(&unit.time_s))?,
            force_m_s2: vectors(&format!("{argument}.force_m_s2"), &unit.force_m_s2)?,
            rate_rad_s: vectors(&format!("{argument}.rate_rad_s"), &unit.rate_rad_s)?,
        };
        same_length(&[
            ("time_s", columns.time_s.len()),
            ("force_m_s2", columns.force_m_s2.len()),
            ("rate_rad_s", columns.rate_rad_s.len()),
        ])?;
        Ok(columns)
    }

    fn signal(&self) -> ImuSignal<'_> {
        ImuSignal {
            time_s: &self.time_s,
            force_m_s2: &self.force_m_s2,
            rate_rad_s: &self.rate_rad_s,
        }
    }
}

/// A log for the inertial unit's calibration, as a dict.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct InertialLog<'py> {
    imu: Inertial<'py>,
    speed_time_s: Doubles<'py>,
    speed_m_s: Doubles<'py>,
    compression_time_s: Doubles<'py>,
    compression_m: Doubles<'py>,
    #[pyo3(default)]
    steering_wheel_time_s: Option<Doubles<'py>>,
    #[pyo3(default)]
    steering_wheel_rad: Option<Doubles<'py>>,
}

/// The same as columns.
struct LogColumns {
    imu: Columns,
    speed: [Vec<f64>; 2],
    compression_s: Vec<f64>,
    compression_m: Vec<[f64; 4]>,
    steering_wheel: [Vec<f64>; 2],
    lean_rad: [Vec<f64>; 2],
    turning_rad_s: Vec<f64>,
    rest: Vec<Stretch>,
}

impl LogColumns {
    fn of(vehicle: &Vehicle, log: &InertialLog<'_>, imu_m: [f64; 3]) -> PyResult<Self> {
        let mut columns = Self {
            imu: Columns::of("imu", &log.imu)?,
            speed: [
                column("speed_time_s", Some(&log.speed_time_s))?,
                column("speed_m_s", Some(&log.speed_m_s))?,
            ],
            compression_s: column("compression_time_s", Some(&log.compression_time_s))?,
            compression_m: vectors("compression_m", &log.compression_m)?,
            steering_wheel: [
                column("steering_wheel_time_s", log.steering_wheel_time_s.as_ref())?,
                column("steering_wheel_rad", log.steering_wheel_rad.as_ref())?,
            ],
            lean_rad: [Vec::new(), Vec::new()],
            turning_rad_s: Vec::new(),
            rest: Vec::new(),
        };
        let radius_m = vehicle.inner.front.tyre.unloaded_radius_m;
        columns.turning_rad_s = columns.speed[1].iter().map(|v| v / radius_m).collect();
        same_length(&[
            ("speed_time_s", columns.speed[0].len()),
            ("speed_m_s", columns.speed[1].len()),
        ])?;
        same_length(&[
            ("compression_time_s", columns.compression_s.len()),
            ("compression_m", columns.compression_m.len()),
        ])?;
        same_length(&[
            ("steering_wheel_time_s", columns.steering_wheel[0].len()),
            ("steering_wheel_rad", columns.steering_wheel[1].len()),
        ])?;
        let lean = Lean::of(&vehicle.inner).ok_or_else(|| {
            errors::vehicle(format!("{}: has no motion ratio", vehicle.inner.name))
        })?;
        let unknown = [f64::NAN; 2];
        for (time_s, compression_m) in columns.compression_s.iter().zip(&columns.compression_m) {
            let angles = lean.roll_pitch_rad(&Leaning {
                compression_m: PerWheel(*compression_m),
                force_m_s2: columns.imu.signal().force_near(*time_s, imu_m),
                steering_wheel_rad: columns.steering_wheel_near(*time_s),
            });
            for (column, angle) in columns.lean_rad.iter_mut().zip(angles.unwrap_or(unknown)) {
                column.push(angle);
            }
        }
        columns.rest = columns.stretches();
        Ok(columns)
    }

    /// The steering wheel next to an instant, rad; straight ahead where it is not told.
    fn steering_wheel_near(&self, time_s: f64) -> f64 {
        let [times, angles] = &self.steering_wheel;
        let next = times.partition_point(|&known_s| known_s < time_s);
        let last = angles.len().saturating_sub(1);
        angles.get(next.min(last)).copied().unwrap_or_default()
    }

    /// The stretches of rest.
    fn stretches(&self) -> Vec<Stretch> {
        let of = |rows: &[[f64; 3]], i: usize| rows.iter().map(|row| row[i]).collect();
        let rates: [Vec<f64>; 3] = std::array::from_fn(|i| of(&self.imu.rate_rad_s, i));
        let pots: [Vec<f64>; 4] =
            std::array::from_fn(|i| self.compression_m.iter().map(|row| row[i]).collect());
        let rates = rates.iter().map(|rate| Signal {
            time_s: &self.imu.time_s,
            value: rate,
        });
        let pots = pots.iter().map(|pot| Signal {
            time_s: &self.compression_s,
            value: pot,
        });
        let steady: Vec<Signal<'_>> = pots.chain(rates).collect();
        let turning = Signal {
            time_s: &self.speed[0],
            value: &self.turning_rad_s,
        };
        stretches(&steady, &[turning])
    }

    fn log(&self) -> ImuLog<'_> {
        let lean = |value| Signal {
            time_s: &self.compression_s,
            value,
        };
        ImuLog {
            imu: self.imu.signal(),
            speed_m_s: Signal {
                time_s: &self.speed[0],
                value: &self.speed[1],
            },
            lean_rad: [lean(&self.lean_rad[0]), lean(&self.lean_rad[1])],
            rest: &self.rest,
        }
    }
}

/// Biases and mounting of the inertial unit, at `imu_m` from the vehicle file's origin, m: rests on
/// one floor in two headings, and a drive.
#[pyfunction]
#[pyo3(signature = (vehicle, logs, *, imu_m=[0.0; 3]))]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_imu<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    logs: Vec<InertialLog<'py>>,
    imu_m: [f64; 3],
) -> Found<'py> {
    let columns = logs.iter().map(|log| LogColumns::of(vehicle, log, imu_m));
    let columns = columns.collect::<PyResult<Vec<_>>>()?;
    let logs: Vec<ImuLog<'_>> = columns.iter().map(LogColumns::log).collect();
    let standing = rest_roll_pitch_rad(&vehicle.inner).map_err(|e| estimator(&e))?;
    let nominal = Calibration::nominal(&vehicle.inner.name);
    let found = py
        .detach(|| imu(&logs, standing, &nominal))
        .map_err(|e| refusal(&e))?;
    with_table(py, dict(py, &found.findings)?, &found.calibration)
}

/// Place and latency of a receiver's antenna, latency and mounting of the attitude: the inertial
/// unit in body axes, bias and misalignment taken off, velocity east, north, up, m/s, (n, 3), yaw,
/// pitch and roll, rad, (m, 3).
#[pyfunction]
#[pyo3(signature = (
    sensors, imu, velocity_time_s, velocity_m_s, attitude_time_s, attitude_rad, *,
    antenna_m=None, imu_m=None,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_gnss<'py>(
    py: Python<'py>,
    sensors: &Sensors,
    imu: Inertial<'py>,
    velocity_time_s: Doubles<'py>,
    velocity_m_s: Doubles<'py>,
    attitude_time_s: Doubles<'py>,
    attitude_rad: Doubles<'py>,
    antenna_m: Option<[f64; 3]>,
    imu_m: Option<[f64; 3]>,
) -> Found<'py> {
    let sensors = &sensors.inner;
    let imu = Columns::of("imu", &imu)?;
    let velocity_s = column("velocity_time_s", Some(&velocity_time_s))?;
    let velocity = vectors::<3>("velocity_m_s", &velocity_m_s)?;
    let attitude_s = column("attitude_time_s", Some(&attitude_time_s))?;
    let attitude = vectors::<3>("attitude_rad", &attitude_rad)?;
    same_length(&[
        ("velocity_time_s", velocity_s.len()),
        ("velocity_m_s", velocity.len()),
    ])?;
    same_length(&[
        ("attitude_time_s", attitude_s.len()),
        ("attitude_rad", attitude.len()),
    ])?;
    let input = GnssInput {
        receiver: "gnss",
        imu: imu.signal(),
        velocity: Vectors {
            time_s: &velocity_s,
            value: &velocity,
        },
        attitude: Vectors {
            time_s: &attitude_s,
            value: &attitude,
        },
        sigma: sigma_of(sensors),
        averaging_s: sensors.gnss_velocity.averaging_s,
        imu_sigma: [sensors.imu.accel_noise_m_s2, sensors.imu.gyro_noise_rad_s],
        imu_m: imu_m.unwrap_or(sensors.imu.position_m),
        antenna_m: antenna_m.unwrap_or(sensors.gnss_velocity.antenna_m),
    };
    let found = py.detach(|| gnss(&input)).map_err(|e| refusal(&e))?;
    let told = with_table(py, dict(py, &found.findings)?, &found.velocity)?;
    told.set_item("attitude", super::table(py, &found.attitude)?)?;
    Ok(told)
}

/// Rolling radii from straight, even driving: an antenna's velocity east, north, up, m/s, (n, 3),
/// the inertial unit in body axes, wheel speeds, rad/s, (k, 4).
#[pyfunction]
#[pyo3(signature = (
    velocity_time_s, velocity_m_s, imu, wheel_time_s, wheel_rad_s, *, latency_s=0.0,
))]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_wheel_radius<'py>(
    py: Python<'py>,
    velocity_time_s: Doubles<'py>,
    velocity_m_s: Doubles<'py>,
    imu: Inertial<'py>,
    wheel_time_s: Doubles<'py>,
    wheel_rad_s: Doubles<'py>,
    latency_s: f64,
) -> Found<'py> {
    let velocity_s = column("velocity_time_s", Some(&velocity_time_s))?;
    let velocity = vectors::<3>("velocity_m_s", &velocity_m_s)?;
    let imu = Columns::of("imu", &imu)?;
    let wheel_s = column("wheel_time_s", Some(&wheel_time_s))?;
    let wheels = vectors::<4>("wheel_rad_s", &wheel_rad_s)?;
    same_length(&[
        ("velocity_time_s", velocity_s.len()),
        ("velocity_m_s", velocity.len()),
    ])?;
    same_length(&[
        ("wheel_time_s", wheel_s.len()),
        ("wheel_rad_s", wheels.len()),
    ])?;
    let turning =
        [0, 1, 2, 3].map(|wheel| -> Vec<f64> { wheels.iter().map(|row| row[wheel]).collect() });
    let found = wheel_radius(&RadiusInput {
        velocity: Vectors {
            time_s: &velocity_s,
            value: &velocity,
        },
        latency_s,
        imu: imu.signal(),
        wheels_rad_s: turning.each_ref().map(|value| Signal {
            time_s: &wheel_s,
            value,
        }),
    });
    dict(py, &found.map_err(|e| refusal(&e))?.findings)
}

/// A log for the hub accelerometers' calibration, as a dict.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct HubAccelerationLog<'py> {
    imu: Inertial<'py>,
    hub_time_s: Doubles<'py>,
    hub_m_s2: [Doubles<'py>; 4],
    compression_time_s: Doubles<'py>,
    compression_m: Doubles<'py>,
    wheel_time_s: Doubles<'py>,
    wheel_rad_s: Doubles<'py>,
    #[pyo3(default)]
    steering_wheel_time_s: Option<Doubles<'py>>,
    #[pyo3(default)]
    steering_wheel_rad: Option<Doubles<'py>>,
}

/// The same as columns.
struct HubColumns {
    imu: Columns,
    hub_s: Vec<f64>,
    hub: [Vec<[f64; 3]>; 4],
    compression_s: Vec<f64>,
    compression: [Vec<f64>; 4],
    steering_wheel: [Vec<f64>; 2],
    rest: Vec<Stretch>,
}

impl HubColumns {
    fn of(log: &HubAccelerationLog<'_>) -> PyResult<Self> {
        let imu = Columns::of("imu", &log.imu)?;
        let hub_s = column("hub_time_s", Some(&log.hub_time_s))?;
        let mut hub: [Vec<[f64; 3]>; 4] = Default::default();
        for (rows, readings) in hub.iter_mut().zip(&log.hub_m_s2) {
            *rows = vectors("hub_m_s2", readings)?;
            same_length(&[("hub_time_s", hub_s.len()), ("hub_m_s2", rows.len())])?;
        }
        let compression_s = column("compression_time_s", Some(&log.compression_time_s))?;
        let compression = vectors::<4>("compression_m", &log.compression_m)?;
        let wheel_s = column("wheel_time_s", Some(&log.wheel_time_s))?;
        let wheels = vectors::<4>("wheel_rad_s", &log.wheel_rad_s)?;
        let steering_wheel = [
            column("steering_wheel_time_s", log.steering_wheel_time_s.as_ref())?,
            column("steering_wheel_rad", log.steering_wheel_rad.as_ref())?,
        ];
        same_length(&[
            ("compression_time_s", compression_s.len()),
            ("compression_m", compression.len()),
        ])?;
        same_length(&[
            ("wheel_time_s", wheel_s.len()),
            ("wheel_rad_s", wheels.len()),
        ])?;
        same_length(&[
            ("steering_wheel_time_s", steering_wheel[0].len()),
            ("steering_wheel_rad", steering_wheel[1].len()),
        ])?;
        let each = |rows: &[[f64; 4]]| -> [Vec<f64>; 4] {
            std::array::from_fn(|i| rows.iter().map(|row| row[i]).collect())
        };
        let compression = each(&compression);
        let rates: [Vec<f64>; 3] =
            std::array::from_fn(|i| imu.rate_rad_s.iter().map(|rate| rate[i]).collect());
        let signal = |time_s, value| Signal { time_s, value };
        let steady: Vec<Signal<'_>> = (compression.iter().map(|c| signal(&compression_s, c)))
            .chain(rates.iter().map(|rate| signal(&imu.time_s, rate)))
            .collect();
        let turning = each(&wheels);
        let turning: Vec<_> = turning
            .iter()
            .map(|value| signal(&wheel_s, value))
            .collect();
        let rest = stretches(&steady, &turning);
        Ok(Self {
            imu,
            hub_s,
            hub,
            compression_s,
            compression,
            steering_wheel,
            rest,
        })
    }

    fn log(&self, imu_m: [f64; 3]) -> HubLog<'_> {
        HubLog {
            imu: self.imu.signal(),
            imu_m,
            hub: PerWheel(self.hub.each_ref().map(|value| Vectors {
                time_s: &self.hub_s,
                value,
            })),
            compression_m: PerWheel(self.compression.each_ref().map(|value| Signal {
                time_s: &self.compression_s,
                value,
            })),
            steering_wheel_rad: Signal {
                time_s: &self.steering_wheel[0],
                value: &self.steering_wheel[1],
            },
            rest: &self.rest,
        }
    }
}

/// Biases and axes of the hub accelerometers from rest and driving: the inertial unit in body axes,
/// bias and misalignment taken off.
#[pyfunction]
#[pyo3(signature = (vehicle, sensors, logs, *, imu_m=None))]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_hub<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    sensors: &Sensors,
    logs: Vec<HubAccelerationLog<'py>>,
    imu_m: Option<[f64; 3]>,
) -> Found<'py> {
    let spec = sensors.inner.hub_acceleration.as_ref().ok_or_else(|| {
        errors::argument("sensors: the file has no table [hub_acceleration]; add it")
    })?;
    let imu_m = imu_m.unwrap_or(sensors.inner.imu.position_m);
    let columns = logs.iter().map(HubColumns::of);
    let columns = columns.collect::<PyResult<Vec<_>>>()?;
    let logs: Vec<HubLog<'_>> = columns.iter().map(|c| c.log(imu_m)).collect();
    let found = py
        .detach(|| hub(&vehicle.inner, spec, &logs))
        .map_err(|e| refusal(&e))?;
    let tables: std::collections::BTreeMap<_, _> = sample::Wheel::ALL
        .into_iter()
        .filter_map(|wheel| Some((wheel, found.calibration[wheel]?)))
        .collect();
    with_table(py, dict(py, &found.findings)?, &tables)
}
