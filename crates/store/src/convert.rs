//! Between the types of `sample` and the messages of the log.

use prost::{Message, Name};
use sample::{
    Attitude, CornerSample, DeviceTime, Event, EventKind, FixQuality, ForceSource, GnssAttitude,
    GnssPosition, GnssVelocity, Health, ImuSample, LogTime, LossPlace, Measurement, Motion,
    NANOS_PER_SECOND, PerWheel, Sample, Severity, SourceHealth, SourceId, SteerSample,
    StrainChannel, TyreForce, Wheel, WheelSpeedSample,
};

use crate::error::MessageError;
use crate::proto::{atvrec as pb, foxglove};
use crate::{ClockFit, LogMessage, Pose, Record, Stage, Transform};

/// A message ready for its channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoded {
    /// Topic of the channel.
    pub topic: String,
    /// Name of its schema.
    pub schema: String,
    /// The source that the channel belongs to, where it belongs to one.
    pub source: Option<SourceId>,
    /// Log clock when it was recorded or computed.
    pub log_time: LogTime,
    /// Log clock when it was true.
    pub publish_time: LogTime,
    /// Contents, by the schema.
    pub data: Vec<u8>,
}

impl Encoded {
    pub(crate) fn new<M: Message + Name>(
        topic: String,
        log: LogTime,
        publish: LogTime,
        message: &M,
    ) -> Self {
        Self {
            topic,
            schema: M::full_name(),
            source: None,
            log_time: log,
            publish_time: publish,
            data: message.encode_to_vec(),
        }
    }
}

/// The messages of a record; those with run-time schemas (signals, controls) are not made here.
pub(crate) fn encode(record: &Record, name: &dyn Fn(SourceId) -> String) -> Vec<Encoded> {
    let source = match record {
        Record::Sample(sample) => Some(sample.source),
        Record::ClockFit(fit) => Some(fit.source),
        _ => None,
    };
    let mut messages = encode_record(record, name);
    for message in &mut messages {
        message.source = source;
    }
    messages
}

fn encode_record(record: &Record, name: &dyn Fn(SourceId) -> String) -> Vec<Encoded> {
    let one = |topic: String, time, message: &dyn Fn(String, LogTime) -> Encoded| {
        vec![message(topic, time)]
    };
    match record {
        Record::Sample(sample) => encode_sample(sample, &name(sample.source)),
        Record::Estimate(estimate) => vec![
            motion_message(Stage::Estimate, estimate.time, &estimate.motion),
            forces_message(Stage::Estimate, estimate.time, &estimate.measured),
            forces_message(Stage::Model, estimate.time, &estimate.expected),
        ],
        Record::Truth {
            time,
            motion,
            forces,
            pose,
        } => {
            let mut messages = vec![
                motion_message(Stage::Truth, *time, motion),
                forces_message(Stage::Truth, *time, forces),
            ];
            messages.extend(pose.as_ref().map(|pose| pose_message(*time, pose)));
            messages
        }
        Record::Motion {
            time,
            stage,
            motion,
        } => vec![motion_message(*stage, *time, motion)],
        Record::TyreForces {
            time,
            stage,
            forces,
        } => vec![forces_message(*stage, *time, forces)],
        Record::Pose { time, pose } => vec![pose_message(*time, pose)],
        Record::Event(event) => vec![Encoded::new(
            "/estimate/events".to_owned(),
            event.time,
            event.onset,
            &event_to_proto(event),
        )],
        Record::Health(health) => one("/health".to_owned(), health.time, &|topic, time| {
            Encoded::new(topic, time, time, &health_to_proto(health))
        }),
        Record::ClockFit(fit) => one(
            format!("/clock_fit/{}", name(fit.source)),
            fit.time,
            &|topic, time| Encoded::new(topic, time, time, &clock_fit_to_proto(fit)),
        ),
        Record::Mark { time, text } => one("/mark".to_owned(), *time, &|topic, time| {
            Encoded::new(topic, time, time, &pb::Mark { text: text.clone() })
        }),
        Record::Log(log) => one("/log".to_owned(), log.time, &|topic, time| {
            Encoded::new(topic, time, time, &log_to_proto(log))
        }),
        Record::Transform(transform) => one("/tf".to_owned(), transform.time, &|topic, time| {
            Encoded::new(topic, time, time, &transform_to_proto(transform))
        }),
    }
}

fn motion_message(stage: Stage, time: LogTime, motion: &Motion) -> Encoded {
    let topic = format!("/{}/motion", stage.name());
    Encoded::new(topic, time, time, &motion_to_proto(motion))
}

fn forces_message(stage: Stage, time: LogTime, forces: &PerWheel<TyreForce>) -> Encoded {
    let topic = format!("/{}/tyre_forces", stage.name());
    Encoded::new(topic, time, time, &forces_to_proto(forces))
}

fn pose_message(time: LogTime, pose: &Pose) -> Encoded {
    let [east, north, up] = pose.position_enu_m;
    let message = pb::Pose {
        position_m: Some(pb::VectorEnu { east, north, up }),
        yaw_rad: pose.yaw_rad,
        pitch_rad: pose.pitch_rad,
        roll_rad: pose.roll_rad,
    };
    Encoded::new("/truth/pose".to_owned(), time, time, &message)
}

fn encode_sample(sample: &Sample, name: &str) -> Vec<Encoded> {
    let device_time = sample.device_time.map(device_time_to_proto);
    let topic = |topic: String| (topic, sample.log_time, sample.valid_time);
    macro_rules! message {
        ($topic:expr, $message:expr) => {{
            let (topic, log, valid) = topic($topic);
            Encoded::new(topic, log, valid, $message)
        }};
    }
    match &sample.measurement {
        Measurement::Imu(imu) => vec![message!(
            format!("/imu/{name}"),
            &imu_to_proto(imu, device_time)
        )],
        Measurement::GnssPosition(position) => vec![
            message!(
                format!("/gnss/{name}/position"),
                &position_to_proto(position, device_time)
            ),
            message!(
                format!("/gnss/{name}/fix"),
                &location_fix(position, name, sample.valid_time)
            ),
        ],
        Measurement::GnssVelocity(velocity) => vec![message!(
            format!("/gnss/{name}/velocity"),
            &velocity_to_proto(velocity, device_time)
        )],
        Measurement::GnssAttitude(attitude) => vec![message!(
            format!("/gnss/{name}/attitude"),
            &gnss_attitude_to_proto(attitude, device_time)
        )],
        Measurement::Attitude(attitude) => vec![message!(
            format!("/imu/{name}/attitude"),
            &pb::Attitude {
                roll_rad: attitude.roll_rad,
                pitch_rad: attitude.pitch_rad,
                yaw_rad: attitude.yaw_rad,
                device_time,
            }
        )],
        Measurement::Corner(corner) => {
            let strain = corner.strain_counts.iter().any(Option::is_some);
            let strain =
                strain.then(|| message!("/strain".to_owned(), &strain_of(corner, device_time)));
            let deflection = corner.deflection_counts.map(|counts| {
                message!(
                    "/deflection".to_owned(),
                    &deflection_of(corner.wheel, counts, device_time)
                )
            });
            strain.into_iter().chain(deflection).collect()
        }
        Measurement::Steer(steer) => vec![message!(
            "/steer".to_owned(),
            &pb::Steer {
                hand_wheel_rad: steer.hand_wheel_rad,
                device_time,
            }
        )],
        Measurement::WheelSpeed(speed) => {
            let [fl_rad_s, fr_rad_s, rl_rad_s, rr_rad_s] = speed.angular_speed_rad_s.0;
            vec![message!(
                "/wheel_speed".to_owned(),
                &pb::WheelSpeed {
                    fl_rad_s,
                    fr_rad_s,
                    rl_rad_s,
                    rr_rad_s,
                    device_time,
                }
            )]
        }
        Measurement::Control(_) | Measurement::Signals(_) => Vec::new(),
    }
}

fn device_time_to_proto(time: DeviceTime) -> pb::DeviceTime {
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

fn device_time_from_proto(
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

/// `value` as a narrower type.
pub(crate) fn narrow<T, N>(field: &'static str, value: T) -> Result<N, MessageError>
where
    T: Copy + Into<i128>,
    N: TryFrom<T>,
{
    N::try_from(value).map_err(|_| MessageError::Range {
        field,
        value: value.into(),
    })
}

fn vector(v: [f64; 3]) -> pb::Vector3 {
    let [x, y, z] = v;
    pb::Vector3 { x, y, z }
}

fn array(v: Option<pb::Vector3>) -> [f64; 3] {
    let v = v.unwrap_or_default();
    [v.x, v.y, v.z]
}

fn enu(v: [f64; 3]) -> pb::VectorEnu {
    let [east, north, up] = v;
    pb::VectorEnu { east, north, up }
}

fn enu_array(v: pb::VectorEnu) -> [f64; 3] {
    [v.east, v.north, v.up]
}

fn imu_to_proto(imu: &ImuSample, device_time: Option<pb::DeviceTime>) -> pb::Imu {
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

fn quality_to_proto(quality: FixQuality) -> i32 {
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

fn quality_from_proto(quality: i32) -> FixQuality {
    match pb::FixQuality::try_from(quality).unwrap_or_default() {
        pb::FixQuality::None => FixQuality::None,
        pb::FixQuality::Single => FixQuality::Single,
        pb::FixQuality::Differential => FixQuality::Differential,
        pb::FixQuality::Float => FixQuality::Float,
        pb::FixQuality::Fixed => FixQuality::Fixed,
        pb::FixQuality::DeadReckoning => FixQuality::DeadReckoning,
    }
}

fn position_to_proto(
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

fn location_fix(position: &GnssPosition, name: &str, time: LogTime) -> foxglove::LocationFix {
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
        frame_id: name.to_owned(),
        latitude: position.latitude_rad.to_degrees(),
        longitude: position.longitude_rad.to_degrees(),
        altitude: position.height_m,
        position_covariance: covariance.unwrap_or_default(),
        position_covariance_type: kind.into(),
    }
}

fn timestamp(time: LogTime) -> prost_types::Timestamp {
    let second = NANOS_PER_SECOND as u64;
    prost_types::Timestamp {
        seconds: (time.0 / second) as i64,
        nanos: (time.0 % second) as i32,
    }
}

fn velocity_to_proto(
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

fn gnss_attitude_to_proto(
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

fn strain_of(corner: &CornerSample, device_time: Option<pb::DeviceTime>) -> pb::Strain {
    let count = |channel: StrainChannel| corner.strain_counts[channel.index()].map(u32::from);
    let counts = Some(pb::StrainCorner {
        upper_front_counts: count(StrainChannel::UpperFront),
        upper_rear_counts: count(StrainChannel::UpperRear),
        lower_front_counts: count(StrainChannel::LowerFront),
        lower_rear_counts: count(StrainChannel::LowerRear),
        tie_rod_counts: count(StrainChannel::TieRod),
        lower_front_bending_counts: count(StrainChannel::LowerFrontBending),
        lower_rear_bending_counts: count(StrainChannel::LowerRearBending),
    });
    let mut strain = pb::Strain {
        device_time,
        ..pb::Strain::default()
    };
    match corner.wheel {
        Wheel::FrontLeft => strain.fl = counts,
        Wheel::FrontRight => strain.fr = counts,
        Wheel::RearLeft => strain.rl = counts,
        Wheel::RearRight => strain.rr = counts,
    }
    strain
}

fn strain_from_proto(message: &pb::Strain) -> Result<CornerSample, MessageError> {
    let corners = [message.fl, message.fr, message.rl, message.rr];
    let (wheel, counts) = Wheel::ALL
        .into_iter()
        .zip(corners)
        .find_map(|(wheel, counts)| Some((wheel, counts?)))
        .ok_or(MessageError::Absent("a corner"))?;
    let columns = [
        counts.upper_front_counts,
        counts.upper_rear_counts,
        counts.lower_front_counts,
        counts.lower_rear_counts,
        counts.tie_rod_counts,
        counts.lower_front_bending_counts,
        counts.lower_rear_bending_counts,
    ];
    let mut strain_counts = [None; StrainChannel::COUNT];
    for (to, from) in strain_counts.iter_mut().zip(columns) {
        *to = from.map(|counts| narrow("counts", counts)).transpose()?;
    }
    Ok(CornerSample {
        wheel,
        strain_counts,
        deflection_counts: None,
    })
}

fn deflection_of(wheel: Wheel, counts: u16, device_time: Option<pb::DeviceTime>) -> pb::Deflection {
    let mut each = [None; 4];
    each[wheel.index()] = Some(u32::from(counts));
    let [fl_counts, fr_counts, rl_counts, rr_counts] = each;
    pb::Deflection {
        fl_counts,
        fr_counts,
        rl_counts,
        rr_counts,
        device_time,
    }
}

fn deflection_from_proto(message: &pb::Deflection) -> Result<CornerSample, MessageError> {
    let each = [
        message.fl_counts,
        message.fr_counts,
        message.rl_counts,
        message.rr_counts,
    ];
    let (wheel, counts) = Wheel::ALL
        .into_iter()
        .zip(each)
        .find_map(|(wheel, counts)| Some((wheel, counts?)))
        .ok_or(MessageError::Absent("a wheel"))?;
    Ok(CornerSample {
        wheel,
        strain_counts: [None; StrainChannel::COUNT],
        deflection_counts: Some(narrow("counts", counts)?),
    })
}

fn wheels(values: PerWheel<f64>) -> pb::Wheels {
    let [fl, fr, rl, rr] = values.0;
    pb::Wheels { fl, fr, rl, rr }
}

fn per_wheel(wheels: Option<pb::Wheels>) -> PerWheel<f64> {
    let w = wheels.unwrap_or_default();
    PerWheel([w.fl, w.fr, w.rl, w.rr])
}

fn motion_to_proto(motion: &Motion) -> pb::Motion {
    let [roll_rate_rad_s, pitch_rate_rad_s, yaw_rate_rad_s] = motion.rate_rad_s;
    pb::Motion {
        velocity_x_m_s: motion.velocity_x_m_s,
        velocity_y_m_s: motion.velocity_y_m_s,
        sideslip_rad: motion.sideslip_rad,
        sideslip_sigma_rad: motion.sideslip_sigma_rad,
        roll_rad: motion.roll_rad,
        pitch_rad: motion.pitch_rad,
        roll_rate_rad_s,
        pitch_rate_rad_s,
        yaw_rate_rad_s,
        acceleration_m_s2: Some(vector(motion.acceleration_m_s2)),
        steer_rad: Some(wheels(motion.steer_rad)),
        slip_angle_rad: Some(wheels(motion.slip_angle_rad)),
        bank_rad: motion.bank_rad,
        grade_rad: motion.grade_rad,
    }
}

fn motion_from_proto(m: &pb::Motion) -> Motion {
    Motion {
        velocity_x_m_s: m.velocity_x_m_s,
        velocity_y_m_s: m.velocity_y_m_s,
        sideslip_rad: m.sideslip_rad,
        sideslip_sigma_rad: m.sideslip_sigma_rad,
        roll_rad: m.roll_rad,
        pitch_rad: m.pitch_rad,
        rate_rad_s: [m.roll_rate_rad_s, m.pitch_rate_rad_s, m.yaw_rate_rad_s],
        acceleration_m_s2: array(m.acceleration_m_s2),
        steer_rad: per_wheel(m.steer_rad),
        slip_angle_rad: per_wheel(m.slip_angle_rad),
        bank_rad: m.bank_rad,
        grade_rad: m.grade_rad,
    }
}

fn forces_to_proto(forces: &PerWheel<TyreForce>) -> pb::TyreForces {
    let [fl, fr, rl, rr] = forces.0.map(|force| Some(force_to_proto(&force)));
    pb::TyreForces { fl, fr, rl, rr }
}

fn force_to_proto(force: &TyreForce) -> pb::TyreForce {
    let source = match force.source {
        ForceSource::None => pb::ForceSource::None,
        ForceSource::Deflection => pb::ForceSource::Deflection,
        ForceSource::Statics => pb::ForceSource::Statics,
        ForceSource::Fusion => pb::ForceSource::Fusion,
        ForceSource::Model => pb::ForceSource::Model,
    };
    let [x_n, y_n, z_n] = force.force_n;
    let [x_sigma_n, y_sigma_n, z_sigma_n] = force.sigma_n;
    pb::TyreForce {
        x_n,
        y_n,
        z_n,
        x_sigma_n,
        y_sigma_n,
        z_sigma_n,
        source: source.into(),
    }
}

fn force_from_proto(f: Option<pb::TyreForce>) -> TyreForce {
    let Some(f) = f else {
        return TyreForce::default();
    };
    TyreForce {
        force_n: [f.x_n, f.y_n, f.z_n],
        sigma_n: [f.x_sigma_n, f.y_sigma_n, f.z_sigma_n],
        source: match pb::ForceSource::try_from(f.source).unwrap_or_default() {
            pb::ForceSource::None => ForceSource::None,
            pb::ForceSource::Deflection => ForceSource::Deflection,
            pb::ForceSource::Statics => ForceSource::Statics,
            pb::ForceSource::Fusion => ForceSource::Fusion,
            pb::ForceSource::Model => ForceSource::Model,
        },
    }
}

fn wheel_to_proto(wheel: Wheel) -> i32 {
    let wheel = match wheel {
        Wheel::FrontLeft => pb::Wheel::Fl,
        Wheel::FrontRight => pb::Wheel::Fr,
        Wheel::RearLeft => pb::Wheel::Rl,
        Wheel::RearRight => pb::Wheel::Rr,
    };
    wheel.into()
}

fn wheel_from_proto(wheel: i32) -> Result<Wheel, MessageError> {
    match pb::Wheel::try_from(wheel) {
        Ok(pb::Wheel::Fl) => Ok(Wheel::FrontLeft),
        Ok(pb::Wheel::Fr) => Ok(Wheel::FrontRight),
        Ok(pb::Wheel::Rl) => Ok(Wheel::RearLeft),
        Ok(pb::Wheel::Rr) => Ok(Wheel::RearRight),
        Ok(pb::Wheel::Unspecified) | Err(_) => Err(MessageError::Range {
            field: "wheel",
            value: wheel.into(),
        }),
    }
}

fn event_to_proto(event: &Event) -> pb::Event {
    use pb::event::Kind;
    let kind = match &event.kind {
        EventKind::LiftWarning(wheel, lead_time_s) => Kind::LiftWarning(pb::LiftWarning {
            wheel: wheel_to_proto(*wheel),
            lead_time_s: *lead_time_s,
        }),
        EventKind::Lift(wheel) => Kind::Lift(wheel_to_proto(*wheel)),
        EventKind::Touchdown(wheel) => Kind::Touchdown(wheel_to_proto(*wheel)),
        EventKind::TwoWheelLift(left) => Kind::TwoWheelLiftLeft(*left),
        EventKind::SurfaceChange(ratio) => Kind::SurfaceChangeRatio(*ratio),
        EventKind::SensorFault(name) => Kind::SensorFault(name.clone()),
        EventKind::SensorRecovered(name) => Kind::SensorRecovered(name.clone()),
        EventKind::FilterReset => Kind::FilterReset(pb::FilterReset {}),
    };
    pb::Event {
        onset_ns: event.onset.0,
        probability: event.probability,
        text: event.text.clone(),
        kind: Some(kind),
    }
}

fn event_from_proto(time: LogTime, event: pb::Event) -> Result<Event, MessageError> {
    use pb::event::Kind;
    let kind = match event.kind.ok_or(MessageError::Absent("kind"))? {
        Kind::LiftWarning(warning) => {
            EventKind::LiftWarning(wheel_from_proto(warning.wheel)?, warning.lead_time_s)
        }
        Kind::Lift(wheel) => EventKind::Lift(wheel_from_proto(wheel)?),
        Kind::Touchdown(wheel) => EventKind::Touchdown(wheel_from_proto(wheel)?),
        Kind::TwoWheelLiftLeft(left) => EventKind::TwoWheelLift(left),
        Kind::SurfaceChangeRatio(ratio) => EventKind::SurfaceChange(ratio),
        Kind::SensorFault(name) => EventKind::SensorFault(name),
        Kind::SensorRecovered(name) => EventKind::SensorRecovered(name),
        Kind::FilterReset(_) => EventKind::FilterReset,
    };
    Ok(Event {
        time,
        onset: LogTime(event.onset_ns),
        kind,
        probability: event.probability,
        text: event.text,
    })
}

fn health_to_proto(health: &Health) -> pb::Health {
    let sources = health.sources.iter().map(|s| {
        let lost =
            |place: LossPlace| s.lost[LossPlace::ALL.iter().position(|p| *p == place).unwrap_or(0)];
        pb::SourceHealth {
            source: s.source.0.into(),
            name: s.name.clone(),
            open: s.open,
            silent: s.silent,
            bytes: s.bytes,
            messages: s.messages,
            checksum_errors: s.checksum_errors,
            skipped_bytes: s.skipped_bytes,
            gaps: s.gaps,
            malformed: s.malformed,
            reopened: s.reopened,
            lost_in_device: lost(LossPlace::Device),
            lost_in_kernel: lost(LossPlace::Kernel),
            lost_in_queue: lost(LossPlace::Queue),
            lost_on_disk: lost(LossPlace::Disk),
        }
    });
    pb::Health {
        sources: sources.collect(),
    }
}

fn health_from_proto(time: LogTime, health: pb::Health) -> Result<Health, MessageError> {
    let sources = health.sources.into_iter().map(|s| {
        let lost = LossPlace::ALL.map(|place| match place {
            LossPlace::Device => s.lost_in_device,
            LossPlace::Kernel => s.lost_in_kernel,
            LossPlace::Queue => s.lost_in_queue,
            LossPlace::Disk => s.lost_on_disk,
        });
        Ok(SourceHealth {
            source: SourceId(narrow("source", s.source)?),
            name: s.name,
            open: s.open,
            silent: s.silent,
            bytes: s.bytes,
            messages: s.messages,
            checksum_errors: s.checksum_errors,
            skipped_bytes: s.skipped_bytes,
            gaps: s.gaps,
            malformed: s.malformed,
            reopened: s.reopened,
            lost,
        })
    });
    Ok(Health {
        time,
        sources: sources.collect::<Result<_, MessageError>>()?,
    })
}

fn clock_fit_to_proto(fit: &ClockFit) -> pb::ClockFit {
    pb::ClockFit {
        offset_s: fit.offset_s,
        drift_ppm: fit.drift_ppm,
        residual_sigma_s: fit.residual_sigma_s,
        count: fit.count,
        steps: fit.steps,
    }
}

fn log_to_proto(log: &LogMessage) -> foxglove::Log {
    let level = match log.severity {
        Severity::Info => foxglove::log::Level::Info,
        Severity::Warning => foxglove::log::Level::Warning,
        Severity::Error => foxglove::log::Level::Error,
    };
    foxglove::Log {
        timestamp: Some(timestamp(log.time)),
        level: level.into(),
        message: log.text.clone(),
        name: log.name.clone(),
        file: String::new(),
        line: 0,
    }
}

fn transform_to_proto(transform: &Transform) -> foxglove::FrameTransforms {
    let [x, y, z] = transform.translation_m;
    let translation = foxglove::Vector3 { x, y, z };
    let [x, y, z, w] = transform.rotation_xyzw;
    let rotation = foxglove::Quaternion { x, y, z, w };
    foxglove::FrameTransforms {
        transforms: vec![foxglove::FrameTransform {
            timestamp: Some(timestamp(transform.time)),
            parent_frame_id: transform.parent.clone(),
            child_frame_id: transform.child.clone(),
            translation: Some(translation),
            rotation: Some(rotation),
        }],
    }
}

/// What a message's channel says about it.
pub(crate) struct Envelope<'a> {
    pub topic: &'a str,
    pub schema: &'a str,
    /// The source that the channel belongs to.
    pub source: SourceId,
    pub log_time: LogTime,
    pub publish_time: LogTime,
}

/// The record of a message; `None` for schemas that are derived (`foxglove.LocationFix`), raw or
/// foreign.
pub(crate) fn decode(envelope: &Envelope<'_>, data: &[u8]) -> Result<Option<Record>, MessageError> {
    let time = envelope.log_time;
    if let Some((measurement, device_time)) = decode_measurement(envelope.schema, data)? {
        return Ok(Some(Record::Sample(Sample {
            source: envelope.source,
            log_time: time,
            valid_time: envelope.publish_time,
            device_time,
            measurement,
        })));
    }
    let stage = Stage::from_topic(envelope.topic).unwrap_or(Stage::Estimate);
    Ok(Some(match envelope.schema {
        "atvrec.Motion" => Record::Motion {
            time,
            stage,
            motion: motion_from_proto(&pb::Motion::decode(data)?),
        },
        "atvrec.TyreForces" => {
            let f = pb::TyreForces::decode(data)?;
            let forces = PerWheel([f.fl, f.fr, f.rl, f.rr].map(force_from_proto));
            Record::TyreForces {
                time,
                stage,
                forces,
            }
        }
        "atvrec.Pose" => {
            let pose = pb::Pose::decode(data)?;
            let pose = Pose {
                position_enu_m: enu_array(pose.position_m.unwrap_or_default()),
                yaw_rad: pose.yaw_rad,
                pitch_rad: pose.pitch_rad,
                roll_rad: pose.roll_rad,
            };
            Record::Pose { time, pose }
        }
        "atvrec.Event" => Record::Event(event_from_proto(time, pb::Event::decode(data)?)?),
        "atvrec.Health" => Record::Health(health_from_proto(time, pb::Health::decode(data)?)?),
        "atvrec.ClockFit" => {
            let fit = pb::ClockFit::decode(data)?;
            Record::ClockFit(ClockFit {
                source: envelope.source,
                time,
                offset_s: fit.offset_s,
                drift_ppm: fit.drift_ppm,
                residual_sigma_s: fit.residual_sigma_s,
                count: fit.count,
                steps: fit.steps,
            })
        }
        "atvrec.Mark" => Record::Mark {
            time,
            text: pb::Mark::decode(data)?.text,
        },
        "foxglove.Log" => Record::Log(log_from_proto(time, foxglove::Log::decode(data)?)),
        "foxglove.FrameTransforms" => Record::Transform(transform_from_proto(
            time,
            foxglove::FrameTransforms::decode(data)?,
        )?),
        _ => return Ok(None),
    }))
}

fn log_from_proto(time: LogTime, log: foxglove::Log) -> LogMessage {
    use foxglove::log::Level;
    LogMessage {
        time,
        severity: match Level::try_from(log.level).unwrap_or_default() {
            Level::Unknown | Level::Debug | Level::Info => Severity::Info,
            Level::Warning => Severity::Warning,
            Level::Error | Level::Fatal => Severity::Error,
        },
        name: log.name,
        text: log.message,
    }
}

fn transform_from_proto(
    time: LogTime,
    message: foxglove::FrameTransforms,
) -> Result<Transform, MessageError> {
    let transform = message
        .transforms
        .into_iter()
        .next()
        .ok_or(MessageError::Absent("a transform"))?;
    let t = transform.translation.unwrap_or_default();
    let r = transform.rotation.unwrap_or_default();
    Ok(Transform {
        time,
        parent: transform.parent_frame_id,
        child: transform.child_frame_id,
        translation_m: [t.x, t.y, t.z],
        rotation_xyzw: [r.x, r.y, r.z, r.w],
    })
}

type Measured = Option<(Measurement, Option<DeviceTime>)>;

fn decode_measurement(schema: &str, data: &[u8]) -> Result<Measured, MessageError> {
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
            (Measurement::Corner(strain_from_proto(&m)?), m.device_time)
        }
        "atvrec.Deflection" => {
            let m = pb::Deflection::decode(data)?;
            let corner = deflection_from_proto(&m)?;
            (Measurement::Corner(corner), m.device_time)
        }
        "atvrec.Steer" => {
            let m = pb::Steer::decode(data)?;
            let hand_wheel_rad = m.hand_wheel_rad;
            (
                Measurement::Steer(SteerSample { hand_wheel_rad }),
                m.device_time,
            )
        }
        "atvrec.WheelSpeed" => {
            let m = pb::WheelSpeed::decode(data)?;
            let each = PerWheel([m.fl_rad_s, m.fr_rad_s, m.rl_rad_s, m.rr_rad_s]);
            let speed = WheelSpeedSample {
                angular_speed_rad_s: each,
            };
            (Measurement::WheelSpeed(speed), m.device_time)
        }
        _ => return Ok(None),
    };
    Ok(Some((measurement, device_time_from_proto(device_time)?)))
}
