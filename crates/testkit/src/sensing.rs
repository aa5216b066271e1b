//! The thesis's sensors on a truth run: lag, bias, noise, quantisation and latency, seeded.
//!
//! `sim` makes the same sensors' bytes. This module is independent of it, so that an error of the
//! virtual sensors does not cancel in a test of the estimator, and it needs no decoder.

use estimator::Calibration;
use estimator::calibration::{Channel, Resolved};
use model::sensors::Sensors;
use model::strain::Lag;
use model::suspension::Corner;
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sample::{
    CornerSample, Counts, FixQuality, GnssAttitude, GnssVelocity, ImuSample, LogTime, Measurement,
    PerWheel, Sample, SourceId, SteerSample, StrainChannel, Wheel, WheelSpeedSample,
};

use crate::truth::{RATE_HZ, Run};

/// Log time of a run's first row.
pub const START: LogTime = LogTime(1_000_000_000_000);

struct Source<'a> {
    run: &'a Run,
    rng: ChaCha8Rng,
    samples: Vec<Sample>,
}

impl Source<'_> {
    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }

    fn sign(&mut self) -> f64 {
        if self.rng.random_bool(0.5) { 1.0 } else { -1.0 }
    }

    fn counts(&mut self, channel: &Channel, bits: u8, zero: f64, noise: f64, value: f64) -> i32 {
        let ideal = channel.offset_counts + zero + value / channel.gain + noise * self.normal();
        ideal.round().clamp(0.0, math::exp2(f64::from(bits)) - 1.0) as i32
    }

    fn push(&mut self, arrived_s: f64, valid_s: f64, measurement: Measurement) {
        let source = match measurement {
            Measurement::GnssVelocity(_) => 1,
            Measurement::GnssAttitude(_) => 2,
            _ => 0,
        };
        self.samples.push(Sample {
            source: SourceId(source),
            log_time: START.offset_seconds(arrived_s),
            valid_time: START.offset_seconds(valid_s),
            device_time: None,
            measurement,
        });
    }
}

/// All samples of a run in the order of their arrival.
pub fn samples(run: &Run, vehicle: &Vehicle, sensors: &Sensors, seed: u64) -> Vec<Sample> {
    let mut source = Source {
        run,
        rng: ChaCha8Rng::seed_from_u64(seed),
        samples: Vec::new(),
    };
    corners(&mut source, vehicle, sensors);
    imu(&mut source, sensors);
    gnss(&mut source, sensors);
    controls(&mut source, sensors);
    source.samples.sort_by_key(|sample| sample.log_time);
    source.samples
}

fn corners(source: &mut Source<'_>, vehicle: &Vehicle, sensors: &Sensors) {
    let resolved = Resolved::new(sensors, &Calibration::nominal(&vehicle.name))
        .expect("the nominal calibration fits the sensors");
    let run = source.run;
    let settled = |force| Lag::settled(sensors.strain.lag_hz, force);
    for wheel in Wheel::ALL {
        let w = wheel.abbreviation();
        let names = [
            "UCA_tubeF_T",
            "UCA_tubeB_T",
            "LCA_tubeF_T",
            "LCA_tubeB_T",
            "tierod_T",
        ];
        let channels = &resolved.corners[wheel];
        let zero = sensors.strain.zero_error_counts;
        let offsets: Vec<f64> = names
            .iter()
            .map(|_| source.rng.random_range(-zero..=zero))
            .collect();
        let zero = sensors.deflection.zero_error_counts;
        let pot_offset = source.rng.random_range(-zero..=zero);
        let strut = if wheel.is_front() {
            &vehicle.front.strut
        } else {
            &vehicle.rear.strut
        };
        let design_m = strut
            .as_ref()
            .expect("the vehicle has struts")
            .design_length_m;
        let forces: Vec<&[f64]> = names
            .iter()
            .map(|name| run.column(&format!("{w}_{name}")))
            .collect();
        let normal_n = ball_normal(run, vehicle, wheel);
        let bending = [5, 6].map(|i: usize| (i, source.rng.random_range(-zero..=zero)));
        let arm = sensors
            .strain
            .bending
            .as_ref()
            .map(|bridge| 0.5 * bridge.distance_from_ball_joint_m);
        let mut lagged_normal = settled(normal_n[0]);
        let length = run.column(&format!("{w}_spring_len"));
        let mut lagged: Vec<Lag> = forces.iter().map(|force| settled(force[0])).collect();
        for row in 0..run.rows {
            let step_s = if row == 0 { 0.0 } else { 1.0 / RATE_HZ };
            for (lag, force) in lagged.iter_mut().zip(&forces) {
                lag.advance(step_s, force[row]);
            }
            lagged_normal.advance(step_s, normal_n[row]);
            if row % 2 != 0 {
                continue;
            }
            let mut strain_counts = [None; StrainChannel::COUNT];
            for (i, offset) in offsets.iter().enumerate() {
                let noise = sensors.strain.noise_counts;
                let bits = sensors.strain.adc_bits;
                strain_counts[i] = Some(source.counts(
                    &channels.strain[i],
                    bits,
                    *offset,
                    noise,
                    lagged[i].output(),
                ));
            }
            if let Some(arm) = arm {
                for (i, offset) in bending {
                    strain_counts[i] = Some(source.counts(
                        &channels.strain[i],
                        sensors.strain.adc_bits,
                        offset,
                        sensors.strain.noise_counts,
                        arm * lagged_normal.output(),
                    ));
                }
            }
            let compression = design_m - length[row];
            let deflection_counts = Some(source.counts(
                &channels.deflection,
                sensors.deflection.adc_bits,
                pot_offset,
                sensors.deflection.noise_counts,
                compression,
            ));
            let time_s = row as f64 / RATE_HZ;
            source.push(
                time_s + 0.000_4,
                time_s,
                Measurement::Corner(CornerSample {
                    wheel,
                    strain_counts: strain_counts.map(|counts| counts.map(Counts::Converter)),
                    deflection_counts: deflection_counts.map(Counts::Converter),
                }),
            );
        }
    }
}

/// Force of the upright on the lower arm along the arm's upward normal, N.
fn ball_normal(run: &Run, vehicle: &Vehicle, wheel: Wheel) -> Vec<f64> {
    let w = wheel.abbreviation();
    if let Some(told) = run.columns.get(&format!("{w}_ball_normal")) {
        return told.clone();
    }
    let points = Corner::of(vehicle, wheel)
        .expect("the vehicle has hard points")
        .points;
    let vector = |name: &str, axis: &str| run.column(&format!("{w}_{name}{axis}"));
    let ball = ["_x", "_y", "_z"].map(|axis| vector("lbj", axis));
    let force = ["x", "y", "z"].map(|axis| vector("LCA_ball_F", axis));
    (0..run.rows)
        .map(|row| {
            let ball = Vector3::from(ball.map(|column| column[row]));
            let across = (points.lower_front - ball).cross(&(points.lower_rear - ball));
            let up = across.normalize() * across.z.signum();
            up.dot(&Vector3::from(force.map(|column| column[row])))
        })
        .collect()
}

fn imu(source: &mut Source<'_>, sensors: &Sensors) {
    let run = source.run;
    let imu = &sensors.imu;
    let accel_bias = Vector3::from_fn(|_, _| source.sign() * imu.accel_bias_m_s2);
    let gyro_bias = Vector3::from_fn(|_, _| source.sign() * imu.gyro_bias_rad_s);
    let arm = Vector3::from(imu.position_m);
    for row in (0..run.rows).step_by(2) {
        let rate = Vector3::from(run.vector(["p", "q", "r"], row));
        let rate_dot = Vector3::from(run.vector(["pdot", "qdot", "rdot"], row));
        let noise = Vector3::from_fn(|_, _| source.normal() * imu.accel_noise_m_s2);
        let force = Vector3::from(run.vector(["fx_body", "fy_body", "fz_body"], row))
            + rate_dot.cross(&arm)
            + rate.cross(&rate.cross(&arm))
            + accel_bias
            + noise;
        let noise = Vector3::from_fn(|_, _| source.normal() * imu.gyro_noise_rad_s);
        let rate = rate + gyro_bias + noise;
        let time_s = row as f64 / RATE_HZ;
        source.push(
            time_s + 0.001,
            time_s,
            Measurement::Imu(ImuSample {
                specific_force_m_s2: force.into(),
                angular_rate_rad_s: rate.into(),
                valid: true,
                ..ImuSample::default()
            }),
        );
    }
}

/// Earth from body axes by yaw, pitch, roll.
fn earth_from_body(run: &Run, row: usize) -> nalgebra::Rotation3<f64> {
    let [roll, pitch, yaw] = run.vector(["roll", "pitch", "yaw"], row);
    nalgebra::Rotation3::from_euler_angles(roll, pitch, yaw)
}

/// Velocity of an antenna over the earth, east, north and up, m/s.
#[must_use]
pub fn antenna_velocity(run: &Run, row: usize, arm: Vector3<f64>) -> Vector3<f64> {
    let rate = Vector3::from(run.vector(["p", "q", "r"], row));
    let body = Vector3::from(run.vector(["vx_body", "vy_body", "vz_body"], row));
    earth_from_body(run, row) * (body + rate.cross(&arm))
}

fn gnss(source: &mut Source<'_>, sensors: &Sensors) {
    let run = source.run;
    let g = &sensors.gnss_velocity;
    let step = (RATE_HZ / g.rate_hz) as usize;
    let half = (g.averaging_s * RATE_HZ / 2.0) as usize;
    let lag = (g.latency_s * RATE_HZ) as usize;
    let arm = Vector3::from(g.antenna_m);
    for row in ((step + half + lag)..run.rows).step_by(step) {
        let centre = row - lag;
        let mut sum = Vector3::zeros();
        for part in centre - half..=centre + half {
            let end = part == centre - half || part == centre + half;
            sum += antenna_velocity(run, part, arm) * if end { 0.5 } else { 1.0 };
        }
        let noise = Vector3::from_fn(|_, _| source.normal() * g.velocity_noise_m_s);
        source.push(
            row as f64 / RATE_HZ + 0.002,
            centre as f64 / RATE_HZ,
            Measurement::GnssVelocity(GnssVelocity {
                quality: FixQuality::Fixed,
                velocity_enu_m_s: (sum / (2 * half) as f64 + noise).into(),
                sigma_enu_m_s: None,
                latency_s: None,
            }),
        );
    }
    let a = &sensors.gnss_attitude;
    let step = (RATE_HZ / a.rate_hz) as usize;
    let lag = (a.latency_s * RATE_HZ) as usize;
    for row in ((step + lag)..run.rows).step_by(step) {
        let valid = row - lag;
        let [roll, pitch, yaw] = run.vector(["roll", "pitch", "yaw"], valid);
        let measurement = Measurement::GnssAttitude(GnssAttitude {
            quality: FixQuality::Fixed,
            yaw_rad: Some(yaw + source.normal() * a.heading_noise_rad),
            pitch_rad: Some(pitch + source.normal() * a.roll_pitch_noise_rad),
            roll_rad: Some(roll + source.normal() * a.roll_pitch_noise_rad),
            sigma_rad: None,
        });
        source.push(
            row as f64 / RATE_HZ + 0.002_5,
            valid as f64 / RATE_HZ,
            measurement,
        );
    }
}

fn controls(source: &mut Source<'_>, sensors: &Sensors) {
    let run = source.run;
    let steer_sigma_rad = sensors
        .steer
        .as_ref()
        .map_or(0.0, |encoder| encoder.noise_rad);
    for row in (0..run.rows).step_by(2) {
        let time_s = row as f64 / RATE_HZ;
        let steering_wheel_rad = run.column("handwheel")[row] + source.normal() * steer_sigma_rad;
        source.push(
            time_s + 0.000_5,
            time_s,
            Measurement::Steer(SteerSample { steering_wheel_rad }),
        );
        let angular_speed_rad_s = PerWheel::from_fn(|wheel| {
            let omega = run.column(&format!("{}_omega", wheel.abbreviation()))[row];
            Some(omega * (1.0 + sensors.wheel_speed.noise_fraction * source.normal()))
        });
        source.push(
            time_s + 0.000_6,
            time_s,
            Measurement::WheelSpeed(WheelSpeedSample {
                angular_speed_rad_s,
            }),
        );
    }
}
