//! The calibration file: what a workshop found of each channel of one vehicle.
//!
//! A file may leave anything out; what is absent is nominal, that is as the sensors file says. A
//! converter's nominal zero is mid-scale; strain counts rise with tension, deflection counts with
//! compression from the design length.

pub mod cg_height;
pub mod gnss;
pub mod hub;
pub mod imu;
pub mod load_rig;
pub mod matrix;
pub mod member;
pub mod range;
mod recording;
mod recording_error;
mod resolved;
pub mod rest;
pub mod steer;
mod step;
pub mod temperature;
pub mod weight;
pub mod wheel_radius;
pub mod zero;

use std::collections::BTreeMap;

use model::vehicle::Vehicle;
use sample::{StrainChannel, Wheel};
use serde::{Deserialize, Serialize};

use crate::EstimatorError;
use crate::handling::Handling;

pub use matrix::{MatrixAxes, MatrixCalibration, Sensitivity, SensitivityMatrix, StrutSensitivity};
pub use recording::{Column, ImuColumns, Recording, Vectors};
pub use recording_error::{ReadingProblem, RecordingError};
pub(crate) use resolved::wheel_key;
pub use resolved::{Channel, CornerChannels, HubSensor, Resolved};
pub use step::{Calibrated, Step};
pub use temperature::TemperatureCalibration;

/// A calibration file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Name of the vehicle that it is for; another vehicle's is refused.
    pub vehicle: String,
    /// When, where and how it was made, for people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Strain and deflection channels.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub corner: BTreeMap<Wheel, CornerCalibration>,
    /// Steering wheel.
    #[serde(default)]
    pub steer: SteerCalibration,
    /// Inertial unit.
    #[serde(default)]
    pub imu: ImuCalibration,
    /// Velocity receiver.
    #[serde(default)]
    pub gnss_velocity: GnssCalibration,
    /// Attitude receiver.
    #[serde(default)]
    pub gnss_attitude: GnssCalibration,
    /// How the vehicle handles, where a drive has told it (see
    /// [`crate::identification::handling`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handling: Option<Handling>,
}

/// Channels of one corner.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CornerCalibration {
    /// Strain channels.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub strain: BTreeMap<StrainChannel, ChannelCalibration>,
    /// Spring potentiometer; its gain is in m of compression per count, its offset the counts at
    /// the design length.
    #[serde(default)]
    pub deflection: ChannelCalibration,
    /// Speed over wheel speed, rolling freely, m; absent: from the tyre's radius and stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rolling_radius_m: Option<f64>,
    /// Coil; absent: the vehicle file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spring: Option<SpringCalibration>,
    /// Hub accelerometer.
    #[serde(default, skip_serializing_if = "HubCalibration::is_nominal")]
    pub hub_acceleration: HubCalibration,
    /// The corner without geometry: what the strain channels read of the forces on the wheel. It takes the
    /// place of the linkage's statics and of the channels' gains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<MatrixCalibration>,
}

/// A hub accelerometer: f_sensor = S f_carrier + bias, with the turn S from the carrier's to the
/// sensor's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HubCalibration {
    /// Bias of each axis, sensor axes, m/s^2; absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias_m_s2: Option<[f64; 3]>,
    /// Standard deviation of the bias, m/s^2; absent: that of the sensors file's `bias_m_s2`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias_sigma_m_s2: Option<[f64; 3]>,
    /// Turns about x, then y, then z from the carrier's to the sensor's axes, rad; absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub misalignment_rad: Option<[f64; 3]>,
    /// The sensor is not to be used.
    #[serde(default)]
    pub dead: bool,
}

impl HubCalibration {
    /// Whether nothing is known of the sensor.
    #[must_use]
    pub fn is_nominal(&self) -> bool {
        *self == Self::default()
    }
}

/// A coil as it is mounted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpringCalibration {
    /// Force at the design length, N.
    pub preload_n: f64,
    /// Rate, N/m.
    pub rate_n_m: f64,
    /// Friction that holds the strut back on either way, N.
    #[serde(default)]
    pub friction_n: f64,
}

/// One converter channel: value = gain (counts - offset).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelCalibration {
    /// Counts at zero force (axial), zero moment (bending), design length (deflection).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_counts: Option<f64>,
    /// Standard deviation of the offset, counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_sigma_counts: Option<f64>,
    /// Value of one count: N of tension (axial), N m (bending), m (deflection). Negative where
    /// the bridge or the potentiometer is wired the other way round.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_per_count: Option<f64>,
    /// The channel is not to be used.
    #[serde(default)]
    pub dead: bool,
    /// Drift of a strain channel with the temperature of its bridge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<TemperatureCalibration>,
}

/// Steering wheel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SteerCalibration {
    /// What the encoder, or the potentiometers along the tie rods as an angle of the steering wheel,
    /// read with the wheels straight ahead, rad.
    #[serde(default)]
    pub offset_rad: f64,
    /// Play, rad, from one contact to the other.
    #[serde(default)]
    pub lash_rad: f64,
    /// Points of the steering wheel from the middle and the left front wheel's angle, rad; empty: the
    /// vehicle file's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_map_rad: Vec<[f64; 2]>,
    /// The same of the right front wheel.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub right_map_rad: Vec<[f64; 2]>,
    /// What the sensors of the left and the right front wheel read with this wheel straight ahead, rad.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub wheel_angle_offset_rad: [f64; 2],
    /// Angle of the wheel for one radian that its sensor reads beyond that; absent: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wheel_angle_gain: Option<[f64; 2]>,
    /// Toe compliance of the left and the right front wheel, rad/N; absent: the vehicle file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toe_compliance_rad_n: Option<[f64; 2]>,
    /// Play of the left and the right front wheel behind the rack, rad; absent: the vehicle file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toe_play_rad: Option<[f64; 2]>,
}

fn is_zero(values: &[f64; 2]) -> bool {
    *values == [0.0; 2]
}

/// Inertial unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuCalibration {
    /// Specific-force bias, sensor axes, m/s^2.
    #[serde(default)]
    pub accel_bias_m_s2: [f64; 3],
    /// Rate bias, sensor axes, rad/s.
    #[serde(default)]
    pub gyro_bias_rad_s: [f64; 3],
    /// Small rotations about x, y, z from body to sensor axes, rad; absent: the sensors file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub misalignment_rad: Option<[f64; 3]>,
    /// Position from the centre of gravity, body axes, m; absent: the sensors file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Standard deviation of a reading of specific force as mounted, vibration included, m/s^2;
    /// absent: the sensors file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel_noise_m_s2: Option<f64>,
    /// The same of the angular rate, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro_noise_rad_s: Option<f64>,
}

/// A GNSS receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssCalibration {
    /// Antenna from the centre of gravity, body axes, m; absent: the sensors file's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub antenna_m: Option<[f64; 3]>,
    /// Latency that the samples' valid time still holds, s; absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency_s: Option<f64>,
    /// Yaw, pitch and roll that the antennas' mounting adds, rad.
    #[serde(default)]
    pub attitude_offset_rad: [f64; 3],
}

impl Calibration {
    /// The nominal calibration of the vehicle with this name.
    #[must_use]
    pub fn nominal(vehicle: &str) -> Self {
        Self {
            vehicle: vehicle.to_owned(),
            ..Self::default()
        }
    }

    /// The vehicle with what was found of its springs and its steering: of an axle's two coils the
    /// mean, of the steering the maps and the play.
    #[must_use]
    pub fn applied(&self, vehicle: &Vehicle) -> Vehicle {
        let mut found = vehicle.clone();
        let axles = [
            (&mut found.front, [Wheel::FrontLeft, Wheel::FrontRight]),
            (&mut found.rear, [Wheel::RearLeft, Wheel::RearRight]),
        ];
        for (axle, wheels) in axles {
            let springs = wheels.map(|wheel| self.corner.get(&wheel).and_then(|c| c.spring));
            if let (Some(strut), [Some(left), Some(right)]) = (&mut axle.strut, springs) {
                strut.stiffness_n_m = 0.5 * (left.rate_n_m + right.rate_n_m);
                let preload_n = 0.5 * (left.preload_n + right.preload_n);
                strut.free_length_m = strut.design_length_m + preload_n / strut.stiffness_n_m;
            }
        }
        if !self.steer.left_map_rad.is_empty() && !self.steer.right_map_rad.is_empty() {
            found
                .steering
                .left_map_rad
                .clone_from(&self.steer.left_map_rad);
            found
                .steering
                .right_map_rad
                .clone_from(&self.steer.right_map_rad);
            found.steering.lash_rad = self.steer.lash_rad;
        }
        let steering = &mut found.steering;
        let toe = &self.steer;
        steering.toe_compliance_rad_n =
            (toe.toe_compliance_rad_n).unwrap_or(steering.toe_compliance_rad_n);
        steering.toe_play_rad = toe.toe_play_rad.unwrap_or(steering.toe_play_rad);
        found
    }

    /// Reads a calibration file's text.
    ///
    /// # Errors
    /// When the text is not TOML or has a field that does not exist; the error has line and column.
    pub fn from_toml(text: &str) -> Result<Self, EstimatorError> {
        sample::boundary::guarded(|| toml::from_str(text))
            .map_err(EstimatorError::Parse)?
            .map_err(|error| EstimatorError::Parse(error.to_string()))
    }

    /// The file's text.
    ///
    /// # Errors
    /// When a value cannot be written as TOML, or is not finite, so that no reader would take it.
    pub fn to_toml(&self) -> Result<String, EstimatorError> {
        let failed = |error: toml::ser::Error| EstimatorError::Parse(error.to_string());
        let table = toml::Table::try_from(self).map_err(failed)?;
        all_finite("", &toml::Value::Table(table))?;
        toml::to_string(self).map_err(failed)
    }
}

/// Refuses a value that is not finite in what is to be written.
pub(crate) fn all_finite(name: &str, value: &toml::Value) -> Result<(), EstimatorError> {
    let below = |key: &str| match name {
        "" => key.to_owned(),
        _ => format!("{name}.{key}"),
    };
    match value {
        toml::Value::Float(number) if !number.is_finite() => Err(EstimatorError::Value {
            name: name.to_owned(),
            value: *number,
            expected: "a finite number; nothing was written",
        }),
        toml::Value::Table(table) => table
            .iter()
            .try_for_each(|(key, value)| all_finite(&below(key), value)),
        toml::Value::Array(items) => items.iter().try_for_each(|item| all_finite(name, item)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use model::sensors::Sensors;

    use super::*;
    use crate::{Estimator, Settings};

    fn sensors() -> Sensors {
        Sensors::builtin("thesis-10bit").unwrap()
    }

    #[test]
    fn one_count_of_the_thesis_chain_is_27_newtons() {
        let resolved = Resolved::new(&sensors(), &Calibration::nominal("x")).unwrap();
        let channel = &resolved.corners[Wheel::RearLeft].strain[0];
        assert!((channel.gain - 27.0).abs() < 0.2, "{}", channel.gain);
        assert_eq!(channel.value(512), Some(0.0));
        assert_eq!(channel.value(0), None, "saturated low");
        assert_eq!(channel.value(1023), None, "saturated high");
        assert!(
            resolved.corners[Wheel::RearLeft].strain[5].dead,
            "no bending bridge"
        );
    }

    /// The largest value of a field of 16 bits is "no count", so the largest count of a converter of 16 bits is
    /// one less.
    #[test]
    fn a_saturated_converter_of_sixteen_bits_measures_nothing() {
        let sensors = Sensors::builtin("full-bridge-16bit").unwrap();
        let resolved = Resolved::new(&sensors, &Calibration::nominal("x")).unwrap();
        let channel = &resolved.corners[Wheel::FrontRight].strain[0];
        assert!(channel.value(65_533).is_some());
        assert_eq!(channel.value(65_534), None, "saturated high");
        assert_eq!(channel.value(0), None, "saturated low");
    }

    #[test]
    fn channels_of_other_suspensions_have_two_names() {
        let text = |name: &str| {
            format!("vehicle = \"x\"\n[corner.front_left.strain.{name}]\noffset_counts = 500.5")
        };
        for (strut, name) in [
            ("strut_side_x", "upper_front"),
            ("strut_side_y", "upper_rear"),
            ("inner_bushing_z", "lower_rear"),
            ("panhard_rod", "tie_rod"),
            ("tube_bending_z", "lower_rear_bending"),
        ] {
            let read = |name| Calibration::from_toml(&text(name)).unwrap();
            assert_eq!(read(strut), read(name));
            assert_eq!(
                StrainChannel::from_name(strut),
                StrainChannel::from_name(name)
            );
        }
    }

    #[test]
    fn a_file_overrides_what_it_names_and_survives_a_round_trip() {
        let text = r#"
            vehicle = "x"
            [corner.front_left.strain.tie_rod]
            dead = true
            [corner.front_left.strain.upper_front]
            offset_counts = 500.5
            gain_per_count = -30.0
            [corner.front_left.deflection]
            offset_counts = 480.0
        "#;
        let calibration = Calibration::from_toml(text).unwrap();
        let again = Calibration::from_toml(&calibration.to_toml().unwrap()).unwrap();
        assert_eq!(calibration, again);
        let resolved = Resolved::new(&sensors(), &calibration).unwrap();
        let corner = &resolved.corners[Wheel::FrontLeft];
        assert_eq!(
            corner.strain[StrainChannel::TieRod.index()].value(600),
            None
        );
        assert_eq!(corner.strain[0].value(501), Some(-15.0));
        assert_eq!(corner.deflection.value(480), Some(0.0));
    }

    #[test]
    fn a_value_that_no_reader_takes_is_not_written() {
        let mut calibration = Calibration::nominal("x");
        calibration.gnss_velocity.latency_s = Some(f64::NAN);
        let error = calibration.to_toml().unwrap_err().to_string();
        assert!(error.contains("gnss_velocity.latency_s = NaN"), "{error}");
    }

    #[test]
    fn mistakes_are_named() {
        let unknown = Calibration::from_toml("vehicle = \"x\"\ngian = 1.0").unwrap_err();
        assert!(unknown.to_string().contains("gian"), "{unknown}");
        let text = "vehicle = \"x\"\n[corner.rear_right.deflection]\ngain_per_count = 0.0";
        let zero = Resolved::new(&sensors(), &Calibration::from_toml(text).unwrap()).unwrap_err();
        assert!(
            zero.to_string()
                .contains("corner.rear_right.deflection.gain_per_count"),
            "{zero}"
        );
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let other = Calibration::nominal("another vehicle");
        let refused = Estimator::new(&vehicle, &sensors(), &other, Settings::default());
        let text = refused.err().map(|error| error.to_string()).unwrap();
        assert!(
            text.contains("another vehicle") && text.contains(&vehicle.name),
            "{text}"
        );
    }
}
