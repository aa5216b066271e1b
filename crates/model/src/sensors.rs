//! The sensors file: what is mounted where, and how good it is. The virtual vehicle makes its
//! bytes from it; the estimator takes noise, lag and geometry from it.

mod file;

#[cfg(test)]
pub(crate) use file::SECTIONS;
pub use file::SensorsErrors;

use sample::{Counts, Wheel};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::strain::{ChannelScale, full_scale, largest_count};
use crate::tolerances::SensorsTolerances;

/// All sensors of a vehicle. A table that the file does not have is of a device that is not fitted: it sends 0
/// messages a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensors {
    /// Name, for people.
    pub name: String,
    /// Strain bridges.
    #[serde(default, skip_serializing_if = "StrainChain::is_not_fitted")]
    pub strain: StrainChain,
    /// Spring potentiometers.
    #[serde(default, skip_serializing_if = "Potentiometers::is_not_fitted")]
    pub deflection: Potentiometers,
    /// Inertial unit.
    #[serde(default, skip_serializing_if = "Imu::is_not_fitted")]
    pub imu: Imu,
    /// Velocity receiver.
    #[serde(default, skip_serializing_if = "GnssVelocity::is_not_fitted")]
    pub gnss_velocity: GnssVelocity,
    /// Attitude receiver.
    #[serde(default, skip_serializing_if = "GnssAttitude::is_not_fitted")]
    pub gnss_attitude: GnssAttitude,
    /// Wheel-speed pick-ups.
    #[serde(default, skip_serializing_if = "WheelSpeed::is_not_fitted")]
    pub wheel_speed: WheelSpeed,
    /// Steering-wheel encoder, if that measures the steering wheel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steer: Option<Steer>,
    /// Potentiometers along the front tie rods, left and right, if these measure the steering wheel
    /// (thesis, section 5.2.5). A file has one of both tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steer_potentiometers: Option<Potentiometers>,
    /// Sensors of the angle of each front wheel's upright against the chassis, if there are some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wheel_angles: Option<WheelAngles>,
    /// Accelerometers on the uprights, where there are some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hub_acceleration: Option<HubAcceleration>,
    /// The bus that carries strain, deflection, wheel speeds, steering and hub accelerations.
    #[serde(default)]
    pub bus: Bus,
    /// How far the values above can be from the truth. With this table, the standard deviations of the forces contain
    /// it from the first second on; without it, once a drive shows that the values are not exact. The tolerance of the
    /// zeros is `strain.zero_error_counts`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerances: Option<SensorsTolerances>,
}

/// A device that the file does not have: its rate is 0, and its other values are those of common devices.
macro_rules! not_fitted {
    ($($device:ident { $($field:ident: $value:expr),* $(,)? })*) => {$(
        impl Default for $device {
            fn default() -> Self {
                Self { rate_hz: 0.0, $($field: $value),* }
            }
        }

        impl $device {
            /// Whether the vehicle does not have the device.
            #[must_use]
            pub fn is_not_fitted(&self) -> bool {
                self.rate_hz == 0.0
            }
        }
    )*};
}

not_fitted! {
    StrainChain {
        tube_outer_diameter_m: None,
        tube_wall_m: None,
        youngs_modulus_pa: None,
        poisson_ratio: None,
        gauge_factor: None,
        excitation_v: None,
        bridge: None,
        gain_resistor_ohm: None,
        n_per_count: None,
        n_per_mv_v: None,
        um_m_per_mv_v: None,
        amplifier: Amplifier::default(),
        bending: None,
        transducer: None,
        lag_hz: 20.0,
        adc_bits: 16,
        noise_counts: 1.0,
        zero_error_counts: 1.0,
    }
    Potentiometers {
        span_m: 1.0,
        adc_bits: 16,
        noise_counts: 1.0,
        zero_error_counts: 1.0,
        excitation_v: None,
    }
    Imu {
        position_m: [0.0; 3],
        misalignment_rad: [0.0; 3],
        accel_noise_m_s2: 0.03,
        gyro_noise_rad_s: 0.005,
        accel_bias_m_s2: 0.05,
        gyro_bias_rad_s: 0.005,
    }
    GnssVelocity {
        antenna_m: [0.0; 3],
        velocity_noise_m_s: 0.03,
        position_noise_m: 1.5,
        latency_s: 0.0,
        averaging_s: 0.0,
    }
    GnssAttitude {
        antenna_m: [0.0; 3],
        heading_noise_rad: 0.005,
        roll_pitch_noise_rad: 0.01,
        latency_s: 0.0,
    }
    WheelSpeed {
        noise_fraction: 0.005,
    }
}

/// The CAN bus of the sensors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bus {
    /// Name of the source in a configuration.
    pub name: String,
    /// Bit rate, bit/s.
    pub bit_rate: u32,
}

impl Default for Bus {
    /// Sensors files without the table `bus` mean this one.
    fn default() -> Self {
        Self {
            name: "can0".to_owned(),
            bit_rate: 500_000,
        }
    }
}

/// How the gauges of a channel are wired.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bridge {
    /// One active gauge: axial plus bending.
    Quarter,
    /// Two gauges in opposite arms: axial.
    HalfAxial,
    /// Two gauges in adjacent arms: bending.
    HalfBending,
    /// One axial and one transverse gauge in adjacent arms.
    HalfPoisson,
    /// Two axial and two transverse gauges.
    FullPoisson,
    /// Four gauges, bending.
    FullBending,
}

/// The chain from a member's force to counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrainChain {
    /// Messages a second.
    pub rate_hz: f64,
    /// Tube outer diameter, m. A chain that is given by its calibration needs it for strain in um/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tube_outer_diameter_m: Option<f64>,
    /// Tube wall thickness, m. A chain that is given by its calibration needs it for strain in um/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tube_wall_m: Option<f64>,
    /// Young's modulus, Pa. A chain that is given by its calibration needs it for strain in um/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub youngs_modulus_pa: Option<f64>,
    /// Poisson's ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poisson_ratio: Option<f64>,
    /// Gauge factor GF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gauge_factor: Option<f64>,
    /// Bridge excitation V_ex and converter span, V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excitation_v: Option<f64>,
    /// Axial channels: wiring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bridge: Option<Bridge>,
    /// Axial channels: gain resistor R_G of the amplifier, ohm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_resistor_ohm: Option<f64>,
    /// Axial channels, in the place of gauges and amplifier: force of one count, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_per_count: Option<f64>,
    /// Axial channels, in the place of gauges and amplifier: force for 1 mV/V of bridge output, N. A
    /// count of the chain is then 0.001 mV/V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_per_mv_v: Option<f64>,
    /// Axial channels, in the place of gauges and amplifier: strain of the member for 1 mV/V of bridge
    /// output, um/m. A count of the chain is then 0.001 mV/V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub um_m_per_mv_v: Option<f64>,
    /// Instrumentation amplifier of all channels.
    #[serde(default)]
    pub amplifier: Amplifier,
    /// Bending bridge on each lower tube, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bending: Option<BendingBridge>,
    /// Wheel-force transducers in the place of gauges on the suspension, where there are some: the channels
    /// `force_x`, `force_y` and `force_z` of each wheel are the forces on it, in the unit of `n_per_count`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transducer: Option<Transducer>,
    /// First-order lag of the output filter, Hz.
    pub lag_hz: f64,
    /// Converter resolution, bits over `excitation_v`. The middle of the range is the count at no load.
    #[serde(default = "sixteen")]
    pub adc_bits: u8,
    /// Standard deviation of the converter's noise, counts.
    pub noise_counts: f64,
    /// Largest offset left after the jackstand zero, counts (uniform within plus and minus).
    pub zero_error_counts: f64,
}

const fn sixteen() -> u8 {
    16
}

/// Wheel-force transducers that are alike, one in each wheel. They give the forces of the wheel's outer part
/// on the hub in the axes of the wheel carrier: x forward, y along the spindle to the left, z up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transducer {
    /// Mass between the sensing elements and the road (tyre, rim, and the outer part of the transducer), kg.
    pub outboard_mass_kg: f64,
    /// Standard deviation of the gain and of the part of the other two forces that a channel shows, parts of
    /// the force.
    pub sigma_part: f64,
}

/// An instrumentation amplifier whose gain one resistor sets: G = G_0 + R_0/R_G.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Amplifier {
    /// Gain G_0 without a gain resistor.
    pub base_gain: f64,
    /// Resistance R_0 of the data sheet's gain equation, ohm.
    pub gain_ohm: f64,
}

impl Default for Amplifier {
    /// The amplifier of the thesis, equation 3.5: G = 5 + 80 kOhm/R_G. Sensors files without the
    /// table `strain.amplifier` mean it.
    fn default() -> Self {
        Self {
            base_gain: 5.0,
            gain_ohm: 80_000.0,
        }
    }
}

/// A bending bridge on a lower tube.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BendingBridge {
    /// Wiring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bridge: Option<Bridge>,
    /// Gain resistor R_G, ohm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_resistor_ohm: Option<f64>,
    /// In the place of gauges and amplifier: bending moment of one count, N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_m_per_count: Option<f64>,
    /// In the place of gauges and amplifier: bending moment for 1 mV/V of bridge output, N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_m_per_mv_v: Option<f64>,
    /// In the place of gauges and amplifier: bending strain for 1 mV/V of bridge output, um/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub um_m_per_mv_v: Option<f64>,
    /// Distance inboard of the ball joint, m.
    pub distance_from_ball_joint_m: f64,
}

/// Linear potentiometers that are alike. The middle of the converter's range is the design length of a
/// spring, or the tie rods straight ahead; the counts rise as the spring is compressed, or as the
/// steering turns to the left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Potentiometers {
    /// Messages a second.
    pub rate_hz: f64,
    /// Travel that the converter spans, m.
    pub span_m: f64,
    /// Resolution, bits.
    pub adc_bits: u8,
    /// Standard deviation of noise, counts.
    pub noise_counts: f64,
    /// Largest offset left after the zero was found, counts.
    pub zero_error_counts: f64,
    /// Voltage over the whole range, V; a signal in V needs it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excitation_v: Option<f64>,
}

impl Potentiometers {
    /// The chain from travel to counts.
    #[must_use]
    pub fn scale(&self) -> ChannelScale {
        let counts = full_scale(self.adc_bits);
        ChannelScale {
            zero_counts: counts / 2.0,
            counts_per_unit: counts / self.span_m,
            largest_count: largest_count(counts),
        }
    }

    /// Counts of 1 V of a potentiometer.
    ///
    /// # Errors
    /// When the sensors file does not have the voltage over the range.
    pub fn counts_per_volt(&self) -> Result<f64, Error> {
        let excitation_v = self.excitation_v.ok_or(Error::MissingField {
            field: "excitation_v of these potentiometers",
        })?;
        Ok(full_scale(self.adc_bits) / excitation_v)
    }

    /// Travel of a reading from the middle of the range, m; `None` where the converter is at an end of
    /// its range.
    #[must_use]
    pub fn travel_m(&self, counts: impl Into<Counts>) -> Option<f64> {
        let scale = self.scale();
        let counts = counts.into();
        let number = counts.number();
        let is_within = match counts {
            Counts::Converter(_) => number > 0.0 && number < scale.largest_count,
            Counts::Equivalent { .. } => true,
        };
        is_within.then(|| (number - scale.zero_counts) / scale.counts_per_unit)
    }
}

/// Inertial unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Imu {
    /// Messages a second.
    pub rate_hz: f64,
    /// Position from the centre of gravity, body axes, m.
    pub position_m: [f64; 3],
    /// Misalignment: small rotations about x, y, z from body to sensor axes, rad.
    pub misalignment_rad: [f64; 3],
    /// Standard deviation of specific force, m/s^2.
    pub accel_noise_m_s2: f64,
    /// Standard deviation of angular rate, rad/s.
    pub gyro_noise_rad_s: f64,
    /// Size of each axis's specific-force bias, m/s^2 (sign drawn by the seed).
    pub accel_bias_m_s2: f64,
    /// Size of each axis's rate bias, rad/s (sign drawn by the seed).
    pub gyro_bias_rad_s: f64,
}

/// Receiver of position and velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssVelocity {
    /// Messages a second.
    pub rate_hz: f64,
    /// Antenna position from the centre of gravity, body axes, m.
    pub antenna_m: [f64; 3],
    /// Standard deviation of each velocity component, m/s.
    pub velocity_noise_m_s: f64,
    /// Standard deviation of each position component, m.
    pub position_noise_m: f64,
    /// How late the velocity is against its time tag, s.
    pub latency_s: f64,
    /// Interval that the velocity is averaged over, s.
    pub averaging_s: f64,
}

/// Receiver of attitude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GnssAttitude {
    /// Messages a second.
    pub rate_hz: f64,
    /// Main antenna's position from the centre of gravity, body axes, m.
    pub antenna_m: [f64; 3],
    /// Standard deviation of heading, rad.
    pub heading_noise_rad: f64,
    /// Standard deviation of roll and of pitch, rad.
    pub roll_pitch_noise_rad: f64,
    /// How late the attitude is against its time tag, s.
    pub latency_s: f64,
}

/// Wheel speeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelSpeed {
    /// Messages a second.
    pub rate_hz: f64,
    /// Standard deviation, part of the value.
    pub noise_fraction: f64,
}

/// Steering wheel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steer {
    /// Messages a second.
    pub rate_hz: f64,
    /// Standard deviation, rad.
    pub noise_rad: f64,
}

/// Sensors of the steer angle of both front wheels: the angle of the upright against the chassis, left
/// positive (thesis, section 5.2.5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelAngles {
    /// Messages a second.
    pub rate_hz: f64,
    /// Standard deviation, rad.
    pub noise_rad: f64,
    /// Largest error of each sensor's zero before a calibration, rad (uniform within plus and minus).
    pub zero_error_rad: f64,
    /// Largest error of each sensor's gain before a calibration, part of it (uniform within plus and
    /// minus).
    pub gain_error_fraction: f64,
}

/// Accelerometers on the uprights (wheel carriers), one at each wheel.
///
/// The nominal axes are those of the wheel carrier in the design position: y along the spindle to the
/// left, x forward, z up, on both sides of the vehicle. A converter's mid-scale is 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HubAcceleration {
    /// Messages a second.
    pub rate_hz: f64,
    /// The axes that are measured: x, y, z.
    pub axes: Vec<HubAxis>,
    /// Largest specific force that the converter spans, each direction, m/s^2.
    pub range_m_s2: f64,
    /// Resolution, bits over twice the range.
    pub adc_bits: u8,
    /// Corner frequency of the first-order output filter, Hz.
    pub lag_hz: f64,
    /// Standard deviation of one reading's noise, m/s^2.
    pub noise_m_s2: f64,
    /// Largest bias of each axis, m/s^2 (uniform within plus and minus).
    pub bias_m_s2: f64,
    /// Largest turn of the sensor about each axis of the carrier, rad (uniform within plus and
    /// minus).
    pub misalignment_rad: f64,
    /// Position from the wheel centre, carrier axes, left side, m; the right side is its mirror image.
    pub position_m: [f64; 3],
}

/// An axis of a hub accelerometer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HubAxis {
    /// Forward.
    X,
    /// Along the spindle, to the left.
    Y,
    /// Up.
    Z,
}

impl HubAcceleration {
    /// Whether an axis (0 to 2) is measured.
    #[must_use]
    pub fn measures(&self, axis: usize) -> bool {
        self.axes.iter().any(|measured| *measured as usize == axis)
    }

    /// The chain from specific force to counts, the same for all axes.
    #[must_use]
    pub fn scale(&self) -> ChannelScale {
        let counts = math::exp2(f64::from(self.adc_bits.min(16)));
        ChannelScale {
            zero_counts: counts / 2.0,
            counts_per_unit: counts / (2.0 * self.range_m_s2),
            largest_count: largest_count(counts),
        }
    }

    /// Specific force of a count, m/s^2; `None` where the converter is at an end of its range.
    #[must_use]
    pub fn specific_force_m_s2(&self, count: i32) -> Option<f64> {
        let scale = self.scale();
        (count > 0 && f64::from(count) < scale.largest_count)
            .then(|| (f64::from(count) - scale.zero_counts) / scale.counts_per_unit)
    }

    /// Position of the sensor of a wheel from the wheel centre, carrier axes, m.
    #[must_use]
    pub fn position_of_m(&self, wheel: Wheel) -> [f64; 3] {
        let [x, y, z] = self.position_m;
        [x, wheel.side() * y, z]
    }
}
