//! The inertial unit: Crossbow 440, S1 packets.

use model::sensors::Sensors;
use nalgebra::{Rotation3, Vector3};

use crate::can_bus::period_if_fitted_s;
use crate::emission::{Emission, Output, Port};
use crate::faults::{ImuFault, ImuFaultKind};
use crate::random::Noise;
use crate::serial_line::SerialLine;
use crate::{InertialUnit, Motion, Options, SimError, TruthState, encode};

/// The unit, its errors and its line.
pub(crate) struct Imu {
    position_m: Vector3<f64>,
    sensor_from_body: Rotation3<f64>,
    accel_bias_m_s2: [f64; 3],
    gyro_bias_rad_s: [f64; 3],
    accel_noise_m_s2: f64,
    gyro_noise_rad_s: f64,
    noise: Noise,
    noise_line: Noise,
    faults: Vec<ImuFault>,
    noise_fault: Noise,
    frozen: [f64; 6],
    line: SerialLine,
    period_s: f64,
    nominal_period_s: f64,
    device: InertialUnit,
    count: u64,
    end_s: f64,
}

impl Imu {
    pub(crate) fn new(
        motion: &Motion,
        sensors: &Sensors,
        options: &Options,
        seed: u64,
    ) -> Result<Self, SimError> {
        let imu = &sensors.imu;
        let mut noise = Noise::new(seed, "imu");
        let accel_bias_m_s2 = std::array::from_fn(|_| noise.sign() * imu.accel_bias_m_s2);
        let gyro_bias_rad_s = std::array::from_fn(|_| noise.sign() * imu.gyro_bias_rad_s);
        Ok(Self {
            position_m: imu.position_m.into(),
            sensor_from_body: sensor_from_body(imu.misalignment_rad),
            accel_bias_m_s2,
            gyro_bias_rad_s,
            accel_noise_m_s2: imu.accel_noise_m_s2,
            gyro_noise_rad_s: imu.gyro_noise_rad_s,
            noise,
            noise_line: Noise::new(seed, "imu line"),
            faults: options.faults.imu.clone(),
            noise_fault: Noise::new(seed, "imu faults"),
            frozen: [0.0; 6],
            line: SerialLine::new(options.imu_baud),
            period_s: period_if_fitted_s("imu.rate_hz", imu.rate_hz)?
                / (1.0 + options.imu_clock_ppm * 1e-6),
            nominal_period_s: 1.0 / imu.rate_hz,
            device: options.inertial_unit,
            count: 0,
            end_s: motion.duration_s(),
        })
    }

    /// The biases drawn for this run: specific force (m/s^2) and rate (rad/s), sensor axes.
    pub(crate) fn biases(&self) -> ([f64; 3], [f64; 3]) {
        (self.accel_bias_m_s2, self.gyro_bias_rad_s)
    }

    /// The next packet; none at the end.
    pub(crate) fn produce(&mut self, motion: &Motion) -> Option<Emission> {
        let time_s = self.count as f64 * self.period_s;
        // Not a number for a unit that is not fitted.
        if time_s.is_nan() || time_s > self.end_s {
            return None;
        }
        let state = motion.at(time_s);
        let force = self.sensor_from_body * specific_force_at(&state, &self.position_m)
            + Vector3::from(self.accel_bias_m_s2)
            + Vector3::from(self.noise.normal3(self.accel_noise_m_s2));
        let rate = self.sensor_from_body * Vector3::from(state.rate_rad_s)
            + Vector3::from(self.gyro_bias_rad_s)
            + Vector3::from(self.noise.normal3(self.gyro_noise_rad_s));
        let (force, rate) = self.with_faults(time_s, force.into(), rate.into());
        let bytes = match self.device {
            InertialUnit::Crossbow440 => encode::crossbow_s1(force, rate, self.count as u16),
            InertialUnit::Vectornav => {
                // The unit counts in its own clock.
                let since_start_s = self.count as f64 * self.nominal_period_s;
                encode::vectornav_binary(force, rate, since_start_s)
            }
            InertialUnit::VectornavAscii => encode::vectornav_ascii(force, rate),
        };
        self.count += 1;
        // The unit samples, filters and starts to send within some tens of microseconds.
        let ready_s = time_s + self.noise_line.delay(30e-6);
        Some(Emission {
            time_s: self.line.send(ready_s, bytes.len()),
            port: Port::Imu,
            output: Output::Bytes(bytes),
        })
    }
}

impl Imu {
    /// What the axes give with the faults that hold now.
    fn with_faults(
        &mut self,
        time_s: f64,
        [fx, fy, fz]: [f64; 3],
        [p, q, r]: [f64; 3],
    ) -> ([f64; 3], [f64; 3]) {
        let mut values = [fx, fy, fz, p, q, r];
        for fault in &self.faults {
            let Some(value) = values.get_mut(fault.axis) else {
                continue;
            };
            if !(fault.from_s..fault.to_s).contains(&time_s) {
                continue;
            }
            match fault.kind {
                ImuFaultKind::Frozen => *value = self.frozen[fault.axis],
                ImuFaultKind::Inverted => *value = -*value,
                ImuFaultKind::Bias { size } => *value += size,
                ImuFaultKind::Spikes { size, probability } => {
                    let (hit, sign) = (self.noise_fault.unit(), self.noise_fault.sign());
                    if hit < probability {
                        *value += sign * size;
                    }
                }
            }
        }
        self.frozen = values;
        let [fx, fy, fz, p, q, r] = values;
        ([fx, fy, fz], [p, q, r])
    }
}

/// Specific force at a point `r` from the centre of gravity: f + w' x r + w x (w x r), body axes.
pub(crate) fn specific_force_at(state: &TruthState, r: &Vector3<f64>) -> Vector3<f64> {
    let rate = Vector3::from(state.rate_rad_s);
    Vector3::from(state.specific_force_m_s2)
        + Vector3::from(state.rate_derivative_rad_s2).cross(r)
        + rate.cross(&rate.cross(r))
}

/// The rotation of vectors from body into sensor axes: by the angles `[a, b, c]` about x, then y,
/// then z.
pub(crate) fn sensor_from_body([a, b, c]: [f64; 3]) -> Rotation3<f64> {
    Rotation3::from_euler_angles(a, b, c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lever_arm_on_a_turntable() {
        // 2 rad/s about z, speeding up by 3 rad/s^2, at 0.5 m forward: centripetal 2 m/s^2
        // backward, tangential 1.5 m/s^2 to the left.
        let state = TruthState {
            rate_rad_s: [0.0, 0.0, 2.0],
            rate_derivative_rad_s2: [0.0, 0.0, 3.0],
            specific_force_m_s2: [0.0, 0.0, 9.81],
            ..TruthState::default()
        };
        let force = specific_force_at(&state, &Vector3::new(0.5, 0.0, 0.0));
        for (found, expected) in force.iter().zip([-2.0, 1.5, 9.81]) {
            assert!((found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn misalignment_turns_vectors_from_body_to_sensor() {
        let seen = sensor_from_body([0.0, 0.0, 0.1]) * Vector3::x();
        for (found, expected) in seen
            .iter()
            .zip([math::cos(0.1_f64), math::sin(0.1_f64), 0.0])
        {
            assert!((found - expected).abs() < 1e-12);
        }
    }
}
