//! Measurements.

use prost::Message as _;
use sample::{
    Attitude, CornerSample, Counts, DeviceTime, FixQuality, GnssAttitude, GnssPosition,
    GnssVelocity, GroundSpeedSample, HubAccelerationSample, ImuSample, LogTime, Measurement,
    Sample, SourceId, SteerSample, StrainChannel, Wheel, WheelSpeedSample,
};

use super::{Emitter, Topic, array, enu_array, narrow, timestamp, vector};
use crate::error::MessageError;
use crate::proto::{atvrec as pb, foxglove};
use crate::wheels::{WheelEntry, entries, per_wheel, position};

/// Passes the messages of a sample to `to`.
pub(super) fn emit_sample(
    sample: &Sample,
    name: &dyn Fn(SourceId) -> String,
    to: &mut Emitter<'_>,
) {
    let device_time = sample.device_time.map(device_time_to_proto);
    macro_rules! emit {
        ($topic:expr, $message:expr) => {
            to.emit($topic, sample.log_time, sample.valid_time, $message)
        };
    }
    match &sample.measurement {
        Measurement::Imu(imu) => {
            emit!(Topic::Source("/imu/", ""), &imu_to_proto(imu, device_time));
        }
        Measurement::GnssPosition(position) => {
            let own = position_to_proto(position, device_time);
            emit!(Topic::Source("/gnss/", "/position"), &own);
            // `LocationFix` cannot say that there is no solution.
            if position.quality.is_solved() {
                let fix = location_fix(position, name(sample.source), sample.valid_time);
                emit!(Topic::Source("/gnss/", "/fix"), &fix);
            }
        }
        Measurement::GnssVelocity(velocity) => {
            let message = velocity_to_proto(velocity, device_time);
            emit!(Topic::Source("/gnss/", "/velocity"), &message);
        }
        Measurement::GnssAttitude(attitude) => {
            let message = gnss_attitude_to_proto(attitude, device_time);
            emit!(Topic::Source("/gnss/", "/attitude"), &message);
        }
        Measurement::Attitude(attitude) => {
            let message = pb::Attitude {
                roll_rad: attitude.roll_rad,
                pitch_rad: attitude.pitch_rad,
                yaw_rad: attitude.yaw_rad,
                device_time,
            };
            emit!(Topic::Source("/imu/", "/attitude"), &message);
        }
        Measurement::Corner(corner) => {
            if corner.strain_counts.iter().any(Option::is_some) {
                emit!(Topic::Fixed("/strain"), &strain_of(corner, device_time));
            }
            if let Some(counts) = corner.deflection_counts {
                let message = deflection_of(corner.wheel, counts, device_time);
                emit!(Topic::Fixed("/deflection"), &message);
            }
        }
        Measurement::Steer(steer) => {
            let message = pb::Steer {
                steering_wheel_rad: steer.steering_wheel_rad,
                device_time,
            };
            emit!(Topic::Fixed("/steer"), &message);
        }
        Measurement::WheelSpeed(speed) => {
            let message = pb::WheelSpeed {
                wheels: speeds_to_proto(speed),
                device_time,
            };
            emit!(Topic::Fixed("/wheel_speed"), &message);
        }
        Measurement::GroundSpeed(speed) => {
            let message = pb::GroundSpeed {
                forward_m_s: speed.forward_m_s,
                leftward_m_s: speed.leftward_m_s,
                device_time,
            };
            emit!(Topic::Source("/ground_speed/", ""), &message);
        }
        Measurement::HubAcceleration(hub) => {
            emit!(
                Topic::Fixed("/hub_acceleration"),
                &hub_to_proto(hub, device_time)
            );
        }
        Measurement::Control(_) | Measurement::Signals(_) => {}
    }
}

pub(super) fn device_time_to_proto(time: DeviceTime) -> pb::DeviceTime {
    use pb::device_time::Kind;
    let kind = match time {
        DeviceTime::Gps {
            week,
            time_of_week_s,
        } => Kind::Gps(pb::GpsTime {
            week: week.map(u32::from),
            time_of_week_s,
        }),
        DeviceTime::UtcTimeOfDay(seconds) => Kind::UtcTimeOfDayS(seconds),
        DeviceTime::Counter { value, modulus } => Kind::Counter(pb::Counter { value, modulus }),
        DeviceTime::AdapterNanos(nanos) => Kind::AdapterNs(nanos),
    };
    pb::DeviceTime { kind: Some(kind) }
}

pub(super) fn device_time_from_proto(
    time: Option<pb::DeviceTime>,
) -> Result<Option<DeviceTime>, MessageError> {
    use pb::device_time::Kind;
    let Some(kind) = time.and_then(|time| time.kind) else {
        return Ok(None);
    };
    Ok(Some(match kind {
        Kind::Gps(gps) => DeviceTime::Gps {
            week: gps.week.map(|week| narrow("week", week)).transpose()?,
            time_of_week_s: gps.time_of_week_s,
        },
        Kind::UtcTimeOfDayS(seconds) => DeviceTime::UtcTimeOfDay(seconds),
        Kind::Counter(counter) => DeviceTime::Counter {
            value: counter.value,
            modulus: counter.modulus,
        },
        Kind::AdapterNs(nanos) => DeviceTime::AdapterNanos(nanos),
    }))
}

pub(super) fn enu(v: [f64; 3]) -> pb::VectorEnu {
    let [east, north, up] = v;
    pb::VectorEnu { east, north, up }
}

pub(super) fn imu_to_proto(imu: &ImuSample, device_time: Option<pb::DeviceTime>) -> pb::Imu {
    pb::Imu {
        specific_force_m_s2: Some(vector(imu.specific_force_m_s2)),
        angular_rate_rad_s: Some(vector(imu.angular_rate_rad_s)),
        temperature_c: imu.temperature_c,
        interval_s: imu.interval_s,
        status: imu.status.into(),
        valid: imu.valid,
        device_time,
    }
}

pub(super) fn quality_to_proto(quality: FixQuality) -> i32 {
    let quality = match quality {
        FixQuality::None => pb::FixQuality::None,
        FixQuality::Single => pb::FixQuality::Single,
        FixQuality::Differential => pb::FixQuality::Differential,
        FixQuality::Float => pb::FixQuality::Float,
        FixQuality::Fixed => pb::FixQuality::Fixed,
        FixQuality::DeadReckoning => pb::FixQuality::DeadReckoning,
    };
    quality.into()
}

pub(super) fn quality_from_proto(quality: i32) -> FixQuality {
    match pb::FixQuality::try_from(quality).unwrap_or_default() {
        pb::FixQuality::None => FixQuality::None,
        pb::FixQuality::Single => FixQuality::Single,
        pb::FixQuality::Differential => FixQuality::Differential,
        pb::FixQuality::Float => FixQuality::Float,
        pb::FixQuality::Fixed => FixQuality::Fixed,
        pb::FixQuality::DeadReckoning => FixQuality::DeadReckoning,
    }
}

pub(super) fn position_to_proto(
    position: &GnssPosition,
    device_time: Option<pb::DeviceTime>,
) -> pb::GnssPosition {
    pb::GnssPosition {
        quality: quality_to_proto(position.quality),
        latitude_rad: position.latitude_rad,
        longitude_rad: position.longitude_rad,
        height_m: position.height_m,
        sigma_m: position.sigma_enu_m.map(enu),
        satellites: position.satellites.map(u32::from),
        device_time,
    }
}

pub(super) fn location_fix(
    position: &GnssPosition,
    name: String,
    time: LogTime,
) -> foxglove::LocationFix {
    use foxglove::location_fix::PositionCovarianceType as Covariance;
    let covariance = position.sigma_enu_m.map(|[east, north, up]| {
        let (e, n, u) = (east * east, north * north, up * up);
        vec![e, 0.0, 0.0, 0.0, n, 0.0, 0.0, 0.0, u]
    });
    let kind = if covariance.is_some() {
        Covariance::DiagonalKnown
    } else {
        Covariance::Unknown
    };
    foxglove::LocationFix {
        timestamp: Some(timestamp(time)),
        frame_id: name,
        latitude: position.latitude_rad.to_degrees(),
        longitude: position.longitude_rad.to_degrees(),
        altitude: position.height_m,
        position_covariance: covariance.unwrap_or_default(),
        position_covariance_type: kind.into(),
    }
}

pub(super) fn velocity_to_proto(
    velocity: &GnssVelocity,
    device_time: Option<pb::DeviceTime>,
) -> pb::GnssVelocity {
    pb::GnssVelocity {
        quality: quality_to_proto(velocity.quality),
        velocity_m_s: Some(enu(velocity.velocity_enu_m_s)),
        sigma_m_s: velocity.sigma_enu_m_s.map(enu),
        latency_s: velocity.latency_s,
        device_time,
    }
}

pub(super) fn gnss_attitude_to_proto(
    attitude: &GnssAttitude,
    device_time: Option<pb::DeviceTime>,
) -> pb::GnssAttitude {
    pb::GnssAttitude {
        quality: quality_to_proto(attitude.quality),
        yaw_rad: attitude.yaw_rad,
        pitch_rad: attitude.pitch_rad,
        roll_rad: attitude.roll_rad,
        sigma_rad: attitude
            .sigma_rad
            .map(|[yaw, pitch, roll]| pb::Angles { yaw, pitch, roll }),
        device_time,
    }
}

pub(super) fn strain_of(corner: &CornerSample, device_time: Option<pb::DeviceTime>) -> pb::Strain {
    let (axle, side) = position(corner.wheel);
    let members = StrainChannel::ALL.into_iter().zip(corner.strain_counts);
    let members = members.filter_map(|(channel, counts)| {
        let (raw_counts, equivalent_counts, step_counts) = counts_to_proto(counts?);
        Some(pb::StrainMember {
            name: channel.name().to_owned(),
            strain: None,
            raw_counts,
            valid: true,
            equivalent_counts,
            step_counts,
        })
    });
    pb::Strain {
        wheels: vec![pb::WheelStrain {
            axle,
            side,
            members: members.collect(),
        }],
        device_time,
    }
}

/// The counts of the first corner of the message; `None` if all of its wheels are of further axles.
fn strain_from_proto(message: &pb::Strain) -> Result<Option<CornerSample>, MessageError> {
    let Some((wheel, entry)) = first(&message.wheels)? else {
        return Ok(None);
    };
    let mut strain_counts = [None; StrainChannel::COUNT];
    for member in entry.members.iter().filter(|member| member.valid) {
        if let Some(channel) = StrainChannel::from_name(&member.name) {
            strain_counts[channel.index()] = counts_from_proto(
                member.raw_counts,
                member.equivalent_counts,
                member.step_counts,
            );
        }
    }
    Ok(Some(CornerSample {
        wheel,
        strain_counts,
        deflection_counts: None,
    }))
}

fn first<E: WheelEntry>(entries: &[E]) -> Result<Option<(Wheel, &E)>, MessageError> {
    if entries.is_empty() {
        return Err(MessageError::Absent("a wheel"));
    }
    Ok(entries.iter().find_map(|e| Some((e.wheel()?, e))))
}

pub(super) fn deflection_of(
    wheel: Wheel,
    counts: Counts,
    device_time: Option<pb::DeviceTime>,
) -> pb::Deflection {
    let (axle, side) = position(wheel);
    let (raw_counts, equivalent_counts, step_counts) = counts_to_proto(counts);
    pb::Deflection {
        wheels: vec![pb::WheelDeflection {
            axle,
            side,
            deflection_m: None,
            raw_counts,
            valid: true,
            equivalent_counts,
            step_counts,
        }],
        device_time,
    }
}

/// The counts of the first corner of the message; `None` if all of its wheels are of further axles.
fn deflection_from_proto(message: &pb::Deflection) -> Result<Option<CornerSample>, MessageError> {
    let found = first(&message.wheels)?;
    Ok(found.map(|(wheel, entry)| CornerSample {
        wheel,
        strain_counts: [None; StrainChannel::COUNT],
        deflection_counts: counts_from_proto(
            entry.raw_counts,
            entry.equivalent_counts,
            entry.step_counts,
        )
        .filter(|_| entry.valid),
    }))
}

/// Counts as sent, or counts of another unit with those of one step of it.
fn counts_to_proto(counts: Counts) -> (Option<i32>, Option<f64>, Option<f32>) {
    match counts {
        Counts::Converter(counts) => (Some(counts), None, None),
        Counts::Equivalent { counts, step } => (None, Some(counts), (step > 0.0).then_some(step)),
    }
}

fn counts_from_proto(
    raw: Option<i32>,
    equivalent: Option<f64>,
    step: Option<f32>,
) -> Option<Counts> {
    let equivalent = equivalent.map(|counts| Counts::Equivalent {
        counts,
        step: step.unwrap_or(0.0),
    });
    raw.map(Counts::Converter).or(equivalent)
}

fn hub_to_proto(
    hub: &HubAccelerationSample,
    device_time: Option<pb::DeviceTime>,
) -> pb::HubAcceleration {
    let (axle, side) = position(hub.wheel);
    let axis = |i: usize| {
        let (force, raw_counts) = (hub.specific_force_m_s2[i], hub.counts[i]);
        (force.is_some() || raw_counts.is_some()).then_some(pb::HubAxis {
            specific_force_m_s2: force,
            raw_counts,
            valid: force.is_some(),
        })
    };
    pb::HubAcceleration {
        wheels: vec![pb::WheelHubAcceleration {
            axle,
            side,
            x: axis(0),
            y: axis(1),
            z: axis(2),
        }],
        device_time,
    }
}

/// The first wheel of the message; `None` if all of its wheels are of further axles.
fn hub_from_proto(
    message: &pb::HubAcceleration,
) -> Result<Option<HubAccelerationSample>, MessageError> {
    let found = first(&message.wheels)?;
    Ok(found.map(|(wheel, entry)| {
        let axes = [&entry.x, &entry.y, &entry.z].map(Option::as_ref);
        HubAccelerationSample {
            wheel,
            specific_force_m_s2: axes
                .map(|axis| axis.and_then(|a| a.specific_force_m_s2.filter(|_| a.valid))),
            counts: axes.map(|axis| axis.and_then(|a| a.raw_counts)),
        }
    }))
}

fn speeds_to_proto(speed: &WheelSpeedSample) -> Vec<pb::WheelAngularSpeed> {
    let speeds = entries(|wheel, axle, side| {
        Some(pb::WheelAngularSpeed {
            axle,
            side,
            angular_speed_rad_s: speed.angular_speed_rad_s[wheel]?,
            valid: true,
        })
    });
    speeds.into_iter().flatten().collect()
}

fn speeds_from_proto(message: &pb::WheelSpeed) -> WheelSpeedSample {
    let speed = |entry: &pb::WheelAngularSpeed| entry.valid.then_some(entry.angular_speed_rad_s);
    WheelSpeedSample {
        angular_speed_rad_s: per_wheel(&message.wheels, None, speed),
    }
}

pub(super) type Measured = Option<(Measurement, Option<DeviceTime>)>;

pub(super) fn decode_measurement(schema: &str, data: &[u8]) -> Result<Measured, MessageError> {
    let (measurement, device_time) = match schema {
        "atvrec.Imu" => {
            let m = pb::Imu::decode(data)?;
            let imu = ImuSample {
                specific_force_m_s2: array(m.specific_force_m_s2),
                angular_rate_rad_s: array(m.angular_rate_rad_s),
                temperature_c: m.temperature_c,
                interval_s: m.interval_s,
                status: narrow("status", m.status)?,
                valid: m.valid,
            };
            (Measurement::Imu(imu), m.device_time)
        }
        "atvrec.GnssPosition" => {
            let m = pb::GnssPosition::decode(data)?;
            let satellites = m.satellites.map(|n| narrow("satellites", n)).transpose()?;
            let position = GnssPosition {
                quality: quality_from_proto(m.quality),
                latitude_rad: m.latitude_rad,
                longitude_rad: m.longitude_rad,
                height_m: m.height_m,
                sigma_enu_m: m.sigma_m.map(enu_array),
                satellites,
            };
            (Measurement::GnssPosition(position), m.device_time)
        }
        "atvrec.GnssVelocity" => {
            let m = pb::GnssVelocity::decode(data)?;
            let velocity = GnssVelocity {
                quality: quality_from_proto(m.quality),
                velocity_enu_m_s: enu_array(m.velocity_m_s.unwrap_or_default()),
                sigma_enu_m_s: m.sigma_m_s.map(enu_array),
                latency_s: m.latency_s,
            };
            (Measurement::GnssVelocity(velocity), m.device_time)
        }
        "atvrec.GnssAttitude" => {
            let m = pb::GnssAttitude::decode(data)?;
            let attitude = GnssAttitude {
                quality: quality_from_proto(m.quality),
                yaw_rad: m.yaw_rad,
                pitch_rad: m.pitch_rad,
                roll_rad: m.roll_rad,
                sigma_rad: m.sigma_rad.map(|s| [s.yaw, s.pitch, s.roll]),
            };
            (Measurement::GnssAttitude(attitude), m.device_time)
        }
        "atvrec.Attitude" => {
            let m = pb::Attitude::decode(data)?;
            let attitude = Attitude {
                roll_rad: m.roll_rad,
                pitch_rad: m.pitch_rad,
                yaw_rad: m.yaw_rad,
            };
            (Measurement::Attitude(attitude), m.device_time)
        }
        "atvrec.Strain" => {
            let m = pb::Strain::decode(data)?;
            let Some(corner) = strain_from_proto(&m)? else {
                return Ok(None);
            };
            (Measurement::Corner(corner), m.device_time)
        }
        "atvrec.Deflection" => {
            let m = pb::Deflection::decode(data)?;
            let Some(corner) = deflection_from_proto(&m)? else {
                return Ok(None);
            };
            (Measurement::Corner(corner), m.device_time)
        }
        "atvrec.HubAcceleration" => {
            let m = pb::HubAcceleration::decode(data)?;
            let Some(hub) = hub_from_proto(&m)? else {
                return Ok(None);
            };
            (Measurement::HubAcceleration(hub), m.device_time)
        }
        "atvrec.Steer" => {
            let m = pb::Steer::decode(data)?;
            let steer = SteerSample {
                steering_wheel_rad: m.steering_wheel_rad,
            };
            (Measurement::Steer(steer), m.device_time)
        }
        "atvrec.WheelSpeed" => {
            let m = pb::WheelSpeed::decode(data)?;
            (
                Measurement::WheelSpeed(speeds_from_proto(&m)),
                m.device_time,
            )
        }
        "atvrec.GroundSpeed" => {
            let m = pb::GroundSpeed::decode(data)?;
            let speed = GroundSpeedSample {
                forward_m_s: m.forward_m_s,
                leftward_m_s: m.leftward_m_s,
            };
            (Measurement::GroundSpeed(speed), m.device_time)
        }
        _ => return Ok(None),
    };
    Ok(Some((measurement, device_time_from_proto(device_time)?)))
}
