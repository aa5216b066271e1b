//! Samples for the estimator from dicts of arrays.

use numpy::{AllowTypeChange, PyArrayLikeDyn};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use sample::{
    ControlSample, CornerSample, Counts, FixQuality, GnssAttitude, GnssVelocity, GroundSpeedSample,
    HubAccelerationSample, ImuSample, LogTime, Measurement, PerWheel, Sample, Signal, SourceId,
    SteerSample, StrainChannel, Wheel, WheelSpeedSample,
};

use crate::errors;
use crate::findings::{column, vectors};
use crate::input::{self, Doubles};

/// Qualities of GNSS solutions by name.
const QUALITIES: [(&str, FixQuality); 6] = [
    ("none", FixQuality::None),
    ("single", FixQuality::Single),
    ("differential", FixQuality::Differential),
    ("float", FixQuality::Float),
    ("fixed", FixQuality::Fixed),
    ("dead_reckoning", FixQuality::DeadReckoning),
];

/// Sources of samples for which the caller gives none: a device for each kind.
const VELOCITY_SOURCE: u16 = 1;
const ATTITUDE_SOURCE: u16 = 2;

/// All samples of a dict of kinds, ordered by log time; samples of the same log time keep the order
/// of the kinds in the dict and of the rows in a kind.
pub fn read(samples: &Bound<'_, PyDict>) -> PyResult<Vec<Sample>> {
    let mut all = Vec::new();
    for (kind, rows) in samples {
        let kind: String = kind.extract()?;
        let rows = rows.cast_into::<PyDict>().map_err(|_| {
            errors::argument(format!(
                "samples[{kind:?}]: must be a dict of arrays by name"
            ))
        })?;
        let rows = Rows { kind: &kind, rows };
        match kind.as_str() {
            "imu" => rows.imu(&mut all)?,
            "gnss_velocity" => rows.gnss_velocity(&mut all)?,
            "gnss_attitude" => rows.gnss_attitude(&mut all)?,
            "corner" => rows.corner(&mut all)?,
            "steer" => rows.steer(&mut all)?,
            "wheel_speed" => rows.wheel_speed(&mut all)?,
            "ground_speed" => rows.ground_speed(&mut all)?,
            "hub_acceleration" => rows.hub_acceleration(&mut all)?,
            "control" => rows.control(&mut all)?,
            other => {
                return Err(errors::argument(format!(
                    "samples[{other:?}]: no such kind of samples; there are imu, gnss_velocity, \
                     gnss_attitude, corner, steer, wheel_speed, ground_speed, hub_acceleration, control"
                )));
            }
        }
    }
    all.sort_by_key(|sample| sample.log_time);
    Ok(all)
}

/// Samples of one kind.
struct Rows<'a, 'py> {
    kind: &'a str,
    rows: Bound<'py, PyDict>,
}

impl<'py> Rows<'_, 'py> {
    fn imu(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&["specific_force_m_s2", "angular_rate_rad_s", "valid"])?;
        let force = self.vectors::<3>("specific_force_m_s2")?;
        let rate = self.vectors::<3>("angular_rate_rad_s")?;
        let valid = self.optional_column("valid")?;
        self.fill(all, 0, |row| {
            Ok(Measurement::Imu(ImuSample {
                specific_force_m_s2: self.row("specific_force_m_s2", &force, row)?,
                angular_rate_rad_s: self.row("angular_rate_rad_s", &rate, row)?,
                valid: match &valid {
                    Some(valid) => self.row("valid", valid, row)? != 0.0,
                    None => true,
                },
                ..ImuSample::default()
            }))
        })
    }

    fn gnss_velocity(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&["velocity_enu_m_s", "sigma_enu_m_s", "quality", "source"])?;
        let velocity = self.vectors::<3>("velocity_enu_m_s")?;
        let sigma = self.optional_vectors::<3>("sigma_enu_m_s")?;
        let quality = self.qualities()?;
        self.fill(all, VELOCITY_SOURCE, |row| {
            Ok(Measurement::GnssVelocity(GnssVelocity {
                quality: self.quality(&quality, row)?,
                velocity_enu_m_s: self.row("velocity_enu_m_s", &velocity, row)?,
                sigma_enu_m_s: self.known_row("sigma_enu_m_s", sigma.as_ref(), row)?,
                latency_s: None,
            }))
        })
    }

    fn gnss_attitude(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        let names = ["yaw_rad", "pitch_rad", "roll_rad"];
        self.check_names(&[&names[..], &["sigma_rad", "quality", "source"]].concat())?;
        let mut angles = [const { None }; 3];
        for (angle, name) in angles.iter_mut().zip(names) {
            *angle = self.optional_column(name)?;
        }
        let sigma = self.optional_vectors::<3>("sigma_rad")?;
        let quality = self.qualities()?;
        let angle = |which: usize, row| match &angles[which] {
            Some(angle) => self.row(names[which], angle, row).map(known),
            None => Ok(None),
        };
        self.fill(all, ATTITUDE_SOURCE, |row| {
            Ok(Measurement::GnssAttitude(GnssAttitude {
                quality: self.quality(&quality, row)?,
                yaw_rad: angle(0, row)?,
                pitch_rad: angle(1, row)?,
                roll_rad: angle(2, row)?,
                sigma_rad: self.known_row("sigma_rad", sigma.as_ref(), row)?,
            }))
        })
    }

    fn corner(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&[
            "wheel",
            "strain_counts",
            "strain_step_counts",
            "deflection_counts",
            "deflection_step_counts",
        ])?;
        let wheels = self.texts("wheel")?;
        let strain = self.optional_vectors::<{ StrainChannel::COUNT }>("strain_counts")?;
        let strain_steps =
            self.optional_vectors::<{ StrainChannel::COUNT }>("strain_step_counts")?;
        let deflection = self.optional_column("deflection_counts")?;
        let deflection_steps = self.optional_column("deflection_step_counts")?;
        self.fill(all, 0, |row| {
            let wheel = input::wheel(self.text("wheel", &wheels, row)?)?;
            let mut strain_counts = [None; StrainChannel::COUNT];
            if let Some(strain) = &strain {
                let values: [f64; StrainChannel::COUNT] = self.row("strain_counts", strain, row)?;
                let steps = match &strain_steps {
                    Some(steps) => self.row("strain_step_counts", steps, row)?,
                    None => [f64::NAN; StrainChannel::COUNT],
                };
                for ((counts, value), step) in strain_counts.iter_mut().zip(values).zip(steps) {
                    *counts = self.counts("strain_counts", value, step, row)?;
                }
            }
            let deflection_counts = match &deflection {
                Some(deflection) => {
                    let value = self.row("deflection_counts", deflection, row)?;
                    let step = match &deflection_steps {
                        Some(steps) => self.row("deflection_step_counts", steps, row)?,
                        None => f64::NAN,
                    };
                    self.counts("deflection_counts", value, step, row)?
                }
                None => None,
            };
            Ok(Measurement::Corner(CornerSample {
                wheel,
                strain_counts,
                deflection_counts,
            }))
        })
    }

    fn steer(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&["steering_wheel_rad"])?;
        let angle = self.column("steering_wheel_rad")?;
        self.fill(all, 0, |row| {
            let steering_wheel_rad = self.row("steering_wheel_rad", &angle, row)?;
            Ok(Measurement::Steer(SteerSample { steering_wheel_rad }))
        })
    }

    fn wheel_speed(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&["angular_speed_rad_s"])?;
        let speed = self.vectors::<4>("angular_speed_rad_s")?;
        self.fill(all, 0, |row| {
            let speed: [f64; 4] = self.row("angular_speed_rad_s", &speed, row)?;
            Ok(Measurement::WheelSpeed(WheelSpeedSample {
                angular_speed_rad_s: PerWheel(speed.map(known)),
            }))
        })
    }

    fn ground_speed(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&["forward_m_s", "leftward_m_s"])?;
        let forward = self.column("forward_m_s")?;
        let leftward = self.optional_column("leftward_m_s")?;
        self.fill(all, 0, |row| {
            Ok(Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s: self.row("forward_m_s", &forward, row)?,
                leftward_m_s: match &leftward {
                    Some(leftward) => known(self.row("leftward_m_s", leftward, row)?),
                    None => None,
                },
            }))
        })
    }

    fn hub_acceleration(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&["wheel", "specific_force_m_s2"])?;
        let wheels = self.texts("wheel")?;
        let force = self.vectors::<3>("specific_force_m_s2")?;
        self.fill(all, 0, |row| {
            let wheel = input::wheel(self.text("wheel", &wheels, row)?)?;
            let force: [f64; 3] = self.row("specific_force_m_s2", &force, row)?;
            Ok(Measurement::HubAcceleration(HubAccelerationSample {
                specific_force_m_s2: force.map(known),
                ..HubAccelerationSample::empty(wheel)
            }))
        })
    }

    /// Forces, torques and temperatures with the names that the roles of a log give them.
    fn control(&self, all: &mut Vec<Sample>) -> PyResult<()> {
        self.check_names(&[
            "hitch_force_n",
            "drive_torque_n_m",
            "brake_torque_n_m",
            "bridge_temperature_c",
            "tyre_pressure_pa",
        ])?;
        let hitch = self.optional_vectors::<3>("hitch_force_n")?;
        let kinds = [
            ("drive_torque_n_m", "drive_torque", "N m"),
            ("brake_torque_n_m", "brake_torque", "N m"),
            ("bridge_temperature_c", "bridge_temperature", "degC"),
            ("tyre_pressure_pa", "tyre_pressure", "Pa"),
        ];
        let mut of_wheels = Vec::new();
        for (argument, name, unit) in kinds {
            if let Some(rows) = self.optional_vectors::<4>(argument)? {
                let names = Wheel::ALL.map(|wheel| format!("{name}_{}", wheel.abbreviation()));
                of_wheels.push((argument, names, unit, rows));
            }
        }
        self.fill(all, 0, |row| {
            let mut values = Vec::new();
            let mut add = |name: &str, unit: &str, value: f64| {
                if value.is_finite() {
                    let (name, unit) = (name.into(), unit.into());
                    values.push(Signal { name, value, unit });
                }
            };
            if let Some(hitch) = &hitch {
                let force_n: [f64; 3] = self.row("hitch_force_n", hitch, row)?;
                for (name, value) in ControlSample::HITCH_FORCE.into_iter().zip(force_n) {
                    add(name, "N", value);
                }
            }
            for (argument, names, unit, rows) in &of_wheels {
                let of_row: [f64; 4] = self.row(argument, rows, row)?;
                for (name, value) in names.iter().zip(of_row) {
                    add(name, unit, value);
                }
            }
            Ok(Measurement::Control(ControlSample { values }))
        })
    }

    /// Appends one sample for each instant.
    fn fill(
        &self,
        all: &mut Vec<Sample>,
        source: u16,
        measurement: impl Fn(usize) -> PyResult<Measurement>,
    ) -> PyResult<()> {
        let log_times = self.times("log_time_ns")?;
        let valid_times = match self.rows.contains("valid_time_ns")? {
            true => self.times("valid_time_ns")?,
            false => log_times.clone(),
        };
        let sources = match self.rows.get_item("source")? {
            Some(_) => self.numbers("source")?,
            None => vec![source],
        };
        for (row, log_time) in log_times.iter().enumerate() {
            all.push(Sample {
                source: SourceId(match sources[..] {
                    [one] => one,
                    _ => self.row("source", &sources, row)?,
                }),
                log_time: *log_time,
                valid_time: self.row("valid_time_ns", &valid_times, row)?,
                device_time: None,
                measurement: measurement(row)?,
            });
        }
        Ok(())
    }

    /// A number of a source for each row, or one for all.
    fn numbers(&self, name: &str) -> PyResult<Vec<u16>> {
        let array: PyArrayLikeDyn<'_, i64, AllowTypeChange> = self.extract(name)?;
        let array = array.as_array();
        let numbers = array.iter().map(|number| u16::try_from(*number));
        let numbers: Result<Vec<_>, _> = numbers.collect();
        numbers.map_err(|_| {
            errors::argument(format!(
                "{}: must be numbers from 0 to 65535",
                self.name(name)
            ))
        })
    }

    fn times(&self, name: &str) -> PyResult<Vec<LogTime>> {
        let array: PyArrayLikeDyn<'_, i64, AllowTypeChange> = self.extract(name)?;
        let negative = array.as_array().iter().find(|time| **time < 0).copied();
        if let Some(time) = negative {
            return Err(errors::argument(format!(
                "{} = {time} ns: times are nanoseconds of the log clock from 0 on",
                self.name(name)
            )));
        }
        let times = array
            .as_array()
            .iter()
            .map(|time| LogTime(time.cast_unsigned()))
            .collect();
        Ok(times)
    }

    fn column(&self, name: &str) -> PyResult<Vec<f64>> {
        column(&self.name(name), Some(&self.extract(name)?))
    }

    fn optional_column(&self, name: &str) -> PyResult<Option<Vec<f64>>> {
        self.rows
            .contains(name)?
            .then(|| self.column(name))
            .transpose()
    }

    fn vectors<const N: usize>(&self, name: &str) -> PyResult<Vec<[f64; N]>> {
        let array: Doubles<'_> = self.extract(name)?;
        vectors(&self.name(name), &array)
    }

    fn optional_vectors<const N: usize>(&self, name: &str) -> PyResult<Option<Vec<[f64; N]>>> {
        self.rows
            .contains(name)?
            .then(|| self.vectors(name))
            .transpose()
    }

    /// A text for each row, or one for all.
    fn texts(&self, name: &str) -> PyResult<Vec<String>> {
        let value = self.item(name)?;
        if let Ok(text) = value.cast::<PyString>() {
            return Ok(vec![text.extract()?]);
        }
        let texts = value
            .try_iter()
            .and_then(|items| items.map(|item| item?.extract()).collect());
        texts.map_err(|_| errors::argument(format!("{}: must be a list of texts", self.name(name))))
    }

    fn text<'a>(&self, name: &str, texts: &'a [String], row: usize) -> PyResult<&'a str> {
        match texts {
            [one] => Ok(one),
            texts => texts
                .get(row)
                .map(String::as_str)
                .ok_or_else(|| self.short(name, texts.len())),
        }
    }

    /// The qualities of a receiver's solutions; measured ones have fixed ambiguities by default.
    fn qualities(&self) -> PyResult<Vec<String>> {
        match self.rows.contains("quality")? {
            true => self.texts("quality"),
            false => Ok(vec!["fixed".to_owned()]),
        }
    }

    fn quality(&self, names: &[String], row: usize) -> PyResult<FixQuality> {
        let name = self.text("quality", names, row)?;
        let found = QUALITIES.iter().find(|(known, _)| *known == name);
        found.map(|(_, quality)| *quality).ok_or_else(|| {
            errors::argument(format!(
                "{} = {name:?}: must be none, single, differential, float, fixed or dead_reckoning",
                self.name("quality")
            ))
        })
    }

    /// Counts of a converter; with a `step`, those of a value that was sent in another unit.
    fn counts(&self, name: &str, value: f64, step: f64, row: usize) -> PyResult<Option<Counts>> {
        if value.is_nan() {
            return Ok(None);
        }
        if step >= 0.0 && value.is_finite() {
            let (counts, step) = (value, step as f32);
            return Ok(Some(Counts::Equivalent { counts, step }));
        }
        let range = f64::from(i32::MIN)..=f64::from(i32::MAX);
        if value.fract() == 0.0 && range.contains(&value) {
            return Ok(Some(Counts::Converter(value as i32)));
        }
        Err(errors::argument(format!(
            "{} in row {row} is {value}: counts are whole numbers of 32 bits, or NaN where there is \
             none; values that were sent in another unit have a step",
            self.name(name)
        )))
    }

    fn row<T: Copy>(&self, name: &str, rows: &[T], row: usize) -> PyResult<T> {
        rows.get(row)
            .copied()
            .ok_or_else(|| self.short(name, rows.len()))
    }

    /// A row whose first number is known.
    fn known_row(
        &self,
        name: &str,
        rows: Option<&Vec<[f64; 3]>>,
        row: usize,
    ) -> PyResult<Option<[f64; 3]>> {
        let Some(rows) = rows else {
            return Ok(None);
        };
        let values = self.row(name, rows, row)?;
        Ok((!values[0].is_nan()).then_some(values))
    }

    fn short(&self, name: &str, length: usize) -> PyErr {
        errors::argument(format!(
            "{} has {length} rows, fewer than {}: there must be one for each sample",
            self.name(name),
            self.name("log_time_ns")
        ))
    }

    fn check_names(&self, names: &[&str]) -> PyResult<()> {
        for key in self.rows.keys() {
            let key: String = key.extract()?;
            let known = ["log_time_ns", "valid_time_ns"];
            if !known.iter().chain(names).any(|name| *name == key) {
                return Err(errors::argument(format!(
                    "{}: no such array; there are {}, {}",
                    self.name(&key),
                    known.join(", "),
                    names.join(", ")
                )));
            }
        }
        Ok(())
    }

    fn item(&self, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let missing = || errors::argument(format!("{}: missing", self.name(name)));
        self.rows.get_item(name)?.ok_or_else(missing)
    }

    fn extract<T>(&self, name: &str) -> PyResult<T>
    where
        T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
    {
        self.item(name)?.extract().map_err(|_| {
            errors::argument(format!("{}: must be an array of numbers", self.name(name)))
        })
    }

    /// The array's name in messages.
    fn name(&self, name: &str) -> String {
        format!("samples[{:?}][{name:?}]", self.kind)
    }
}

/// A number that is there.
fn known(value: f64) -> Option<f64> {
    (!value.is_nan()).then_some(value)
}
