//! A calibration with every absent value filled in from the sensors file.

use model::sensors::Sensors;
use model::strain::largest_count;
use nalgebra::{Matrix3, Vector3};
use sample::{Counts, PerWheel, StrainChannel, Wheel};

use super::{
    Calibration, ChannelCalibration, SensitivityMatrix, SteerCalibration, TemperatureCalibration,
};
use crate::EstimatorError;
use crate::handling::Handling;

/// Everything that turns readings into values.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// Channels of each corner.
    pub corners: PerWheel<CornerChannels>,
    /// Drift of the strain channels with temperature; `None` for those without one.
    pub drift: PerWheel<[Option<TemperatureCalibration>; StrainChannel::COUNT]>,
    /// Hub accelerometers; none where the sensors file has none or the calibration calls one dead.
    pub hubs: PerWheel<Option<HubSensor>>,
    /// Speed over wheel speed, rolling freely, m, where it was measured.
    pub rolling_radius_m: PerWheel<Option<f64>>,
    /// Steering wheel, straight ahead, rad.
    pub steer_offset_rad: f64,
    /// Zero, rad, and gain of the sensors of the left and the right front wheel's angle.
    pub wheel_angles: [[f64; 2]; 2],
    /// Specific-force bias, sensor axes, m/s^2.
    pub accel_bias_m_s2: Vector3<f64>,
    /// Rate bias, sensor axes, rad/s.
    pub gyro_bias_rad_s: Vector3<f64>,
    /// Turns sensor into body axes.
    pub body_from_imu: Matrix3<f64>,
    /// Inertial unit from the centre of gravity, m.
    pub imu_m: Vector3<f64>,
    /// How far ahead of the centre of gravity the inertial unit of a vehicle without hard-points is,
    /// m: at it where the calibration does not tell. A sensors file tells of the rig that it is of.
    pub plain_imu_ahead_m: f64,
    /// Velocity antenna from the centre of gravity, m.
    pub velocity_antenna_m: Vector3<f64>,
    /// The attitude receiver's antenna, whose velocity it tells, from the centre of gravity, m.
    pub attitude_antenna_m: Vector3<f64>,
    /// Latency of GNSS velocity that the samples' valid time still holds, s.
    pub velocity_latency_s: f64,
    /// Latency of GNSS attitude that the samples' valid time still holds, s.
    pub attitude_latency_s: f64,
    /// Mounting of the attitude antennas (yaw, pitch, roll), rad.
    pub attitude_offset_rad: [f64; 3],
    /// Noise of the specific force as mounted, m/s^2, where that was found.
    pub accel_noise_m_s2: Option<f64>,
    /// Noise of the angular rate as mounted, rad/s, where that was found.
    pub gyro_noise_rad_s: Option<f64>,
    /// How the vehicle handles, where that was identified.
    pub handling: Option<Handling>,
}

/// Channels of one corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerChannels {
    /// Strain channels in the order of [`StrainChannel::ALL`]; axial in N, bending in N m.
    pub strain: [Channel; StrainChannel::COUNT],
    /// Compression of the strut from its design length, m.
    pub deflection: Channel,
    /// What the axial channels read of the forces on the wheel, in the place of a linkage's statics.
    pub matrix: Option<SensitivityMatrix>,
}

/// A hub accelerometer as calibrated: what a filter needs to use its readings. The reading of axis i
/// without its bias is row i of `sensor_from_carrier` times the specific force at the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HubSensor {
    /// Rotation of vectors from the upright's axes (those of the vehicle in the design position) into
    /// sensor axes.
    pub sensor_from_carrier: Matrix3<f64>,
    /// Bias, sensor axes, m/s^2.
    pub bias_m_s2: Vector3<f64>,
    /// Standard deviation of the bias, sensor axes, m/s^2.
    pub bias_sigma_m_s2: Vector3<f64>,
    /// Position from the wheel centre, carrier axes, m.
    pub position_m: Vector3<f64>,
    /// Standard deviation of one reading, converter's rounding included, m/s^2.
    pub noise_sigma_m_s2: f64,
    /// Corner frequency of the sensor's first-order filter, Hz.
    pub lag_hz: f64,
    /// Repeats of a reading after which an axis is frozen; `None` if its noise allows many.
    pub frozen_after: Option<u32>,
}

impl HubSensor {
    /// Readings of the axes without their biases, sensor axes, m/s^2.
    #[must_use]
    pub fn unbiased(&self, reading_m_s2: [Option<f64>; 3]) -> [Option<f64>; 3] {
        std::array::from_fn(|axis| {
            let value = reading_m_s2[axis]? - self.bias_m_s2[axis];
            value.is_finite().then_some(value)
        })
    }
}

/// One converter channel: value = gain (counts - offset).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel {
    /// Counts at zero.
    pub offset_counts: f64,
    /// Standard deviation of the offset, in the channel's value.
    pub offset_sigma: f64,
    /// Value of one count.
    pub gain: f64,
    /// Standard deviation of one reading, converter's rounding included, in the channel's value.
    pub noise_sigma: f64,
    /// Largest count that the converter gives; a reading at 0 or there is saturated.
    pub counts_max: f64,
    /// Bits of the converter.
    pub adc_bits: u8,
    /// How often in a row the same count is a fault: the converter's noise moves its counts even at
    /// rest. None where it has too little of it.
    pub frozen_after: Option<u32>,
    /// Not fitted, or called dead.
    pub dead: bool,
}

impl Channel {
    /// The value of a reading; `None` for a dead channel or a saturated converter.
    #[must_use]
    pub fn value(&self, counts: impl Into<Counts>) -> Option<f64> {
        let counts = counts.into();
        let number = counts.number();
        let is_within = match counts {
            Counts::Converter(_) => number > 0.0 && number < self.counts_max,
            Counts::Equivalent { .. } => number.is_finite(),
        };
        (!self.dead && is_within).then_some(self.gain * (number - self.offset_counts))
    }

    /// How often in a row this reading is a fault. A value with steps that are larger than the noise
    /// repeats without a fault.
    #[must_use]
    pub fn frozen_after(&self, counts: Counts) -> Option<u32> {
        let step = match counts {
            Counts::Converter(_) => 1.0,
            Counts::Equivalent { step, .. } => f64::from(step).max(1.0),
        };
        let noise = self.noise_sigma / self.gain.abs();
        let repeats = self.frozen_after?;
        (step <= 1.0 || noise >= 0.5 * step).then(|| (f64::from(repeats) * step) as u32)
    }
}

impl Resolved {
    /// Fills `calibration` in from `sensors`.
    ///
    /// # Errors
    /// When a value cannot be used, such as a gain of zero.
    pub fn new(sensors: &Sensors, calibration: &Calibration) -> Result<Self, EstimatorError> {
        let mut corners = Vec::with_capacity(Wheel::ALL.len());
        for wheel in Wheel::ALL {
            corners.push(corner(sensors, calibration, wheel)?);
        }
        let imu = &calibration.imu;
        let turn = imu.misalignment_rad.unwrap_or(sensors.imu.misalignment_rad);
        let imu_from_body = nalgebra::Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
        let velocity = &calibration.gnss_velocity;
        Ok(Self {
            corners: PerWheel(std::array::from_fn(|i| corners[i])),
            drift: drifts(calibration)?,
            hubs: hubs(sensors, calibration)?,
            rolling_radius_m: rolling_radii(calibration)?,
            steer_offset_rad: finite("steer.offset_rad", calibration.steer.offset_rad)?,
            wheel_angles: wheel_angles(&calibration.steer)?,
            accel_bias_m_s2: finite3("imu.accel_bias_m_s2", imu.accel_bias_m_s2)?,
            gyro_bias_rad_s: finite3("imu.gyro_bias_rad_s", imu.gyro_bias_rad_s)?,
            body_from_imu: imu_from_body.inverse().into_inner(),
            imu_m: finite3(
                "imu.position_m",
                imu.position_m.unwrap_or(sensors.imu.position_m),
            )?,
            plain_imu_ahead_m: imu.position_m.map_or(0.0, |place| place[0]),
            velocity_antenna_m: finite3(
                "gnss_velocity.antenna_m",
                velocity
                    .antenna_m
                    .unwrap_or(sensors.gnss_velocity.antenna_m),
            )?,
            attitude_antenna_m: finite3(
                "gnss_attitude.antenna_m",
                calibration
                    .gnss_attitude
                    .antenna_m
                    .unwrap_or(sensors.gnss_attitude.antenna_m),
            )?,
            velocity_latency_s: finite(
                "gnss_velocity.latency_s",
                velocity.latency_s.unwrap_or(0.0),
            )?,
            attitude_latency_s: finite(
                "gnss_attitude.latency_s",
                calibration.gnss_attitude.latency_s.unwrap_or(0.0),
            )?,
            attitude_offset_rad: finite3(
                "gnss_attitude.attitude_offset_rad",
                calibration.gnss_attitude.attitude_offset_rad,
            )?
            .into(),
            accel_noise_m_s2: optional("imu.accel_noise_m_s2", imu.accel_noise_m_s2)?,
            gyro_noise_rad_s: optional("imu.gyro_noise_rad_s", imu.gyro_noise_rad_s)?,
            handling: plausible(calibration.handling)?,
        })
    }
}

impl Resolved {
    /// Steer angles of the front wheels from what their sensors read, rad, left and right.
    #[must_use]
    pub fn wheel_angles_rad(&self, read_rad: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|side| {
            let [zero_rad, gain] = self.wheel_angles[side];
            gain * (read_rad[side] - zero_rad)
        })
    }

    /// Positions from a centre of gravity that has moved by `shift_m`, vehicle axes, m.
    #[must_use]
    pub fn with_cg_moved(&self, shift_m: Vector3<f64>) -> Self {
        Self {
            imu_m: self.imu_m - shift_m,
            plain_imu_ahead_m: self.plain_imu_ahead_m - shift_m.x,
            velocity_antenna_m: self.velocity_antenna_m - shift_m,
            attitude_antenna_m: self.attitude_antenna_m - shift_m,
            ..self.clone()
        }
    }
}

fn hubs(
    sensors: &Sensors,
    calibration: &Calibration,
) -> Result<PerWheel<Option<HubSensor>>, EstimatorError> {
    let mut hubs = PerWheel::default();
    let Some(hub) = &sensors.hub_acceleration else {
        return Ok(hubs);
    };
    for wheel in Wheel::ALL {
        let given = calibration.corner.get(&wheel);
        let given = given.map(|c| c.hub_acceleration).unwrap_or_default();
        let name = |field| format!("corner.{}.hub_acceleration.{field}", wheel_key(wheel));
        let turn = finite3(
            &name("misalignment_rad"),
            given.misalignment_rad.unwrap_or_default(),
        )?;
        let bias = finite3(&name("bias_m_s2"), given.bias_m_s2.unwrap_or_default())?;
        // Uniform within plus and minus.
        let drawn = hub.bias_m_s2 / 3.0_f64.sqrt();
        let sigma = given.bias_sigma_m_s2.unwrap_or([drawn; 3]);
        let rounding = 1.0 / hub.scale().counts_per_unit / 12.0_f64.sqrt();
        let turned = nalgebra::Rotation3::from_euler_angles(turn.x, turn.y, turn.z);
        hubs[wheel] = (!given.dead).then_some(HubSensor {
            sensor_from_carrier: turned.into_inner(),
            bias_m_s2: bias,
            bias_sigma_m_s2: finite3(&name("bias_sigma_m_s2"), sigma)?,
            position_m: hub.position_of_m(wheel).into(),
            noise_sigma_m_s2: math::hypot(hub.noise_m_s2, rounding),
            lag_hz: hub.lag_hz,
            frozen_after: frozen_after(hub.noise_m_s2 * hub.scale().counts_per_unit),
        });
    }
    Ok(hubs)
}

fn drifts(
    calibration: &Calibration,
) -> Result<PerWheel<[Option<TemperatureCalibration>; StrainChannel::COUNT]>, EstimatorError> {
    let mut drifts: PerWheel<[Option<TemperatureCalibration>; StrainChannel::COUNT]> =
        PerWheel::default();
    for (wheel, corner) in &calibration.corner {
        for (channel, given) in &corner.strain {
            let Some(drift) = given.temperature.filter(|drift| !drift.is_none()) else {
                continue;
            };
            let name = format!(
                "corner.{}.strain.{}.temperature",
                wheel_key(*wheel),
                channel.name()
            );
            for (field, value) in [
                ("reference_c", drift.reference_c),
                ("offset_counts_per_k", drift.offset_counts_per_k),
                ("offset_sigma_counts_per_k", drift.offset_sigma_counts_per_k),
                ("offset_counts_per_k2", drift.offset_counts_per_k2),
                ("gain_per_k", drift.gain_per_k),
                ("gain_sigma_per_k", drift.gain_sigma_per_k),
            ] {
                finite(&format!("{name}.{field}"), value)?;
            }
            // A bridge of foil gauges changes by parts of a thousand in a kelvin.
            if drift.gain_per_k.abs() > 5e-3 {
                return Err(EstimatorError::Value {
                    name: format!("{name}.gain_per_k"),
                    value: drift.gain_per_k,
                    expected: "a part of at most 0.005 per kelvin",
                });
            }
            drifts[*wheel][channel.index()] = Some(drift);
        }
    }
    Ok(drifts)
}

fn wheel_angles(steer: &SteerCalibration) -> Result<[[f64; 2]; 2], EstimatorError> {
    let zeros = steer.wheel_angle_offset_rad;
    let gains = steer.wheel_angle_gain.unwrap_or([1.0; 2]);
    for (zero, gain) in zeros.into_iter().zip(gains) {
        finite("steer.wheel_angle_offset_rad", zero)?;
        // A sensor on a linkage beside the wheel turns by another angle than the wheel.
        if !(0.05..=20.0).contains(&gain.abs()) {
            return Err(EstimatorError::Value {
                name: "steer.wheel_angle_gain".to_owned(),
                value: gain,
                expected: "0.05 to 20, with either sign",
            });
        }
    }
    for (name, values, most) in [
        (
            "steer.toe_compliance_rad_n",
            steer.toe_compliance_rad_n,
            1e-3,
        ),
        ("steer.toe_play_rad", steer.toe_play_rad, 0.5),
    ] {
        let mut given = values.into_iter().flatten();
        if let Some(value) = given.find(|value| !value.is_finite() || value.abs() > most) {
            return Err(EstimatorError::Value {
                name: name.to_owned(),
                value,
                expected: "what a steering gear can have: at most 0.001 rad/N and 0.5 rad",
            });
        }
    }
    Ok([0, 1].map(|side| [zeros[side], gains[side]]))
}

fn rolling_radii(calibration: &Calibration) -> Result<PerWheel<Option<f64>>, EstimatorError> {
    let mut radii = PerWheel::default();
    for (wheel, corner) in &calibration.corner {
        if let Some(radius_m) = corner.rolling_radius_m {
            if !(0.05..3.0).contains(&radius_m) {
                return Err(EstimatorError::Value {
                    name: format!("corner.{}.rolling_radius_m", wheel_key(*wheel)),
                    value: radius_m,
                    expected: "a wheel's radius in metres",
                });
            }
            radii[*wheel] = Some(radius_m);
        }
    }
    Ok(radii)
}

fn plausible(handling: Option<Handling>) -> Result<Option<Handling>, EstimatorError> {
    match handling.and_then(|handling| handling.implausible()) {
        Some((name, value)) => Err(EstimatorError::Value {
            name: format!("handling.{name}"),
            value,
            expected: "what a vehicle can have",
        }),
        None => Ok(handling),
    }
}

fn full_scale(adc_bits: u8) -> f64 {
    math::exp2(f64::from(adc_bits.min(32)))
}

/// How often in a row a count may come again where noise has this standard deviation, counts. Were
/// it but half of what the sensors file says, that would be once in ten thousand times by chance.
fn frozen_after(noise: f64) -> Option<u32> {
    (noise >= 0.5).then(|| (100.0 / noise).max(30.0) as u32)
}

/// A converter's noise with its rounding, counts.
fn noise_counts(noise: f64) -> f64 {
    (noise * noise + 1.0 / 12.0).sqrt()
}

fn corner(
    sensors: &Sensors,
    calibration: &Calibration,
    wheel: Wheel,
) -> Result<CornerChannels, EstimatorError> {
    let given = calibration.corner.get(&wheel);
    let chain = &sensors.strain;
    let scale = |error: model::Error| EstimatorError::Sensors(error.to_string());
    // A chain wired for bending on its axial channels tells no force.
    let axial_gain = chain
        .axial_scale()
        .ok()
        .map(|scale| 1.0 / scale.counts_per_unit);
    let bending_gain = chain
        .bending_scale()
        .map_err(scale)?
        .map(|scale| 1.0 / scale.counts_per_unit);
    let mut strain = [None; StrainChannel::COUNT];
    let given_matrix = given.and_then(|corner| corner.matrix.as_ref());
    let matrix = SensitivityMatrix::of(wheel, given_matrix, chain.transducer.as_ref())?;
    for channel in StrainChannel::ALL {
        let bending = matches!(
            channel,
            StrainChannel::LowerFrontBending | StrainChannel::LowerRearBending
        );
        let mut nominal_gain = if bending { bending_gain } else { axial_gain };
        if let Some(given) = given_matrix {
            nominal_gain = given.gain_per_count(channel);
        } else if let Some(matrix) = &matrix {
            let row = matrix.rows.get(channel.index()).copied().flatten();
            nominal_gain = nominal_gain.filter(|_| row.is_some());
        }
        let name = format!("corner.{}.strain.{}", wheel_key(wheel), channel.name());
        let of_channel = given.and_then(|c| c.strain.get(&channel)).copied();
        if given_matrix.is_some() {
            refuse_gain(&name, of_channel)?;
        }
        strain[channel.index()] = Some(resolve(
            &name,
            of_channel,
            nominal_gain,
            chain.adc_bits,
            chain.noise_counts,
            chain.zero_error_counts,
        )?);
    }
    let pot = &sensors.deflection;
    let deflection = resolve(
        &format!("corner.{}.deflection", wheel_key(wheel)),
        given.map(|c| c.deflection),
        (!pot.is_not_fitted()).then(|| pot.span_m / full_scale(pot.adc_bits)),
        pot.adc_bits,
        pot.noise_counts,
        pot.zero_error_counts,
    )?;
    let dead = Channel {
        dead: true,
        ..deflection
    };
    let strain = strain.map(|channel| channel.unwrap_or(dead));
    if let Some(matrix) = &matrix {
        matrix.conditioned(wheel, std::array::from_fn(|i| !strain[i].dead))?;
    }
    Ok(CornerChannels {
        strain,
        deflection,
        matrix,
    })
}

/// Refuses a gain beside a matrix.
fn refuse_gain(name: &str, given: Option<ChannelCalibration>) -> Result<(), EstimatorError> {
    match given.and_then(|channel| channel.gain_per_count) {
        None => Ok(()),
        Some(value) => Err(EstimatorError::Value {
            name: format!("{name}.gain_per_count"),
            value,
            expected: "no gain beside the matrix of the corner, which contains it; remove one of both",
        }),
    }
}

fn resolve(
    name: &str,
    given: Option<ChannelCalibration>,
    nominal_gain: Option<f64>,
    adc_bits: u8,
    noise: f64,
    zero_error: f64,
) -> Result<Channel, EstimatorError> {
    let given = given.unwrap_or_default();
    let full_scale = full_scale(adc_bits);
    let gain = given.gain_per_count.or(nominal_gain);
    let dead = given.dead || gain.is_none();
    let gain = finite(&format!("{name}.gain_per_count"), gain.unwrap_or(1.0))?;
    if gain == 0.0 {
        return Err(EstimatorError::Value {
            name: format!("{name}.gain_per_count"),
            value: gain,
            expected: "a number other than zero; call the channel dead if it reads nothing",
        });
    }
    // Uniform within plus and minus the zero error.
    let zero_sigma = given
        .offset_sigma_counts
        .unwrap_or(zero_error / 3.0_f64.sqrt());
    Ok(Channel {
        offset_counts: finite(
            &format!("{name}.offset_counts"),
            given.offset_counts.unwrap_or(full_scale / 2.0),
        )?,
        offset_sigma: gain.abs() * finite(&format!("{name}.offset_sigma_counts"), zero_sigma)?,
        gain,
        noise_sigma: gain.abs() * noise_counts(noise),
        frozen_after: frozen_after(noise),
        // The largest value of a 16-bit field means that there is no count.
        counts_max: largest_count(full_scale),
        adc_bits,
        dead,
    })
}

pub(crate) fn wheel_key(wheel: Wheel) -> &'static str {
    match wheel {
        Wheel::FrontLeft => "front_left",
        Wheel::FrontRight => "front_right",
        Wheel::RearLeft => "rear_left",
        Wheel::RearRight => "rear_right",
    }
}

fn optional(name: &str, value: Option<f64>) -> Result<Option<f64>, EstimatorError> {
    value.map(|value| finite(name, value)).transpose()
}

fn finite(name: &str, value: f64) -> Result<f64, EstimatorError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(EstimatorError::Value {
            name: name.to_owned(),
            value,
            expected: "a finite number",
        })
    }
}

fn finite3(name: &str, values: [f64; 3]) -> Result<Vector3<f64>, EstimatorError> {
    for value in values {
        finite(name, value)?;
    }
    Ok(values.into())
}
