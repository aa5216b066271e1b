//! Results of the estimator and states of the recorder.

use sample::{
    Axle, AxleGrip, Event, EventKind, ForceFrame, ForceSource, Health, InnovationKind, Innovations,
    LogTime, LossPlace, MessageCount, Motion, Parameters, PerWheel, Rollover, Severity,
    SourceHealth, SourceId, TyreForce, Wheel,
};

use super::{array, nan, narrow, some, timestamp, vector};
use crate::error::MessageError;
use crate::proto::{atvrec as pb, foxglove};
use crate::wheels::{axle, axle_number, entries, per_wheel, position, side, wheel};
use crate::{ClockFit, Ground, LogMessage, Transform, WheelGround};

pub(super) fn motion_to_proto(motion: &Motion) -> pb::Motion {
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
        wheels: entries(|wheel, axle, side| pb::WheelMotion {
            axle,
            side,
            steer_rad: motion.steer_rad[wheel],
            slip_angle_rad: motion.slip_angle_rad[wheel],
            longitudinal_slip: some(motion.longitudinal_slip[wheel]),
            longitudinal_slip_sigma: some(motion.longitudinal_slip_sigma[wheel]),
        }),
        bank_rad: motion.bank_rad,
        grade_rad: motion.grade_rad,
    }
}

pub(super) fn motion_from_proto(m: &pb::Motion) -> Motion {
    Motion {
        velocity_x_m_s: m.velocity_x_m_s,
        velocity_y_m_s: m.velocity_y_m_s,
        sideslip_rad: m.sideslip_rad,
        sideslip_sigma_rad: m.sideslip_sigma_rad,
        roll_rad: m.roll_rad,
        pitch_rad: m.pitch_rad,
        rate_rad_s: [m.roll_rate_rad_s, m.pitch_rate_rad_s, m.yaw_rate_rad_s],
        acceleration_m_s2: array(m.acceleration_m_s2),
        steer_rad: per_wheel(&m.wheels, f64::NAN, |entry| entry.steer_rad),
        slip_angle_rad: per_wheel(&m.wheels, f64::NAN, |entry| entry.slip_angle_rad),
        longitudinal_slip: per_wheel(&m.wheels, f64::NAN, |entry| nan(entry.longitudinal_slip)),
        longitudinal_slip_sigma: per_wheel(&m.wheels, f64::NAN, |entry| {
            nan(entry.longitudinal_slip_sigma)
        }),
        bank_rad: m.bank_rad,
        grade_rad: m.grade_rad,
    }
}

pub(super) fn forces_to_proto(frame: ForceFrame, forces: &PerWheel<TyreForce>) -> pb::TyreForces {
    let frame = match frame {
        ForceFrame::Contact => pb::ForceFrame::Contact,
        ForceFrame::WheelCarrier => pb::ForceFrame::WheelCarrier,
    };
    pb::TyreForces {
        frame: frame.into(),
        wheels: entries(|wheel, axle, side| force_to_proto(axle, side, &forces[wheel])),
    }
}

fn force_to_proto(axle: u32, side: String, force: &TyreForce) -> pb::TyreForce {
    let source = match force.source {
        ForceSource::None => pb::ForceSource::None,
        ForceSource::Deflection => pb::ForceSource::Deflection,
        ForceSource::Statics => pb::ForceSource::Statics,
        ForceSource::Fusion => pb::ForceSource::Fusion,
        ForceSource::Model => pb::ForceSource::Model,
        ForceSource::Inertial => pb::ForceSource::Inertial,
        ForceSource::ModelFound => pb::ForceSource::ModelFound,
    };
    let [x_n, y_n, z_n] = force.force_n;
    let [x_sigma_n, y_sigma_n, z_sigma_n] = force.sigma_n;
    let known = |values: [f64; 3]| values.map(some);
    let [moment_x_n_m, moment_y_n_m, moment_z_n_m] = known(force.moment_n_m);
    let [moment_x_sigma_n_m, moment_y_sigma_n_m, moment_z_sigma_n_m] =
        known(force.moment_sigma_n_m);
    pb::TyreForce {
        axle,
        side,
        x_n,
        y_n,
        z_n,
        x_sigma_n,
        y_sigma_n,
        z_sigma_n,
        moment_x_n_m,
        moment_y_n_m,
        moment_z_n_m,
        moment_x_sigma_n_m,
        moment_y_sigma_n_m,
        moment_z_sigma_n_m,
        source: source.into(),
    }
}

pub(super) fn forces_from_proto(message: &pb::TyreForces) -> (ForceFrame, PerWheel<TyreForce>) {
    let known = |values: [Option<f64>; 3]| values.map(nan);
    let forces = per_wheel(&message.wheels, TyreForce::default(), |f| TyreForce {
        force_n: [f.x_n, f.y_n, f.z_n],
        sigma_n: [f.x_sigma_n, f.y_sigma_n, f.z_sigma_n],
        moment_n_m: known([f.moment_x_n_m, f.moment_y_n_m, f.moment_z_n_m]),
        moment_sigma_n_m: known([
            f.moment_x_sigma_n_m,
            f.moment_y_sigma_n_m,
            f.moment_z_sigma_n_m,
        ]),
        source: force_source(f.source),
    });
    (force_frame(message.frame), forces)
}

pub(super) fn force_frame(number: i32) -> ForceFrame {
    match pb::ForceFrame::try_from(number).unwrap_or_default() {
        pb::ForceFrame::Unspecified | pb::ForceFrame::Contact => ForceFrame::Contact,
        pb::ForceFrame::WheelCarrier => ForceFrame::WheelCarrier,
    }
}

pub(super) fn force_source(number: i32) -> ForceSource {
    match pb::ForceSource::try_from(number).unwrap_or_default() {
        pb::ForceSource::None => ForceSource::None,
        pb::ForceSource::Deflection => ForceSource::Deflection,
        pb::ForceSource::Statics => ForceSource::Statics,
        pb::ForceSource::Fusion => ForceSource::Fusion,
        pb::ForceSource::Model => ForceSource::Model,
        pb::ForceSource::Inertial => ForceSource::Inertial,
        pb::ForceSource::ModelFound => ForceSource::ModelFound,
    }
}

pub(super) fn ground_to_proto(ground: &Ground) -> pb::Ground {
    pb::Ground {
        wheels: entries(|wheel, axle, side| {
            let found = &ground.wheels[wheel];
            pb::WheelGround {
                axle,
                side,
                normal: Some(vector(found.normal_body)),
                spindle: Some(vector(found.spindle_body)),
                centre_acceleration_m_s2: found.centre_acceleration_m_s2.map(vector),
                unsprung_inertia_n: found.unsprung_inertia_n.map(vector),
                ground_height_m: found.ground_height_m,
                strut_length_m: found.strut_length_m,
            }
        }),
        road_class: ground.road_class.clone(),
    }
}

pub(super) fn ground_from_proto(message: pb::Ground) -> Ground {
    let vector = |v: Option<pb::Vector3>| v.map(|v| [v.x, v.y, v.z]);
    let known = |v| vector(v).unwrap_or([f64::NAN; 3]);
    Ground {
        wheels: per_wheel(&message.wheels, WheelGround::default(), |w| WheelGround {
            normal_body: known(w.normal),
            spindle_body: known(w.spindle),
            centre_acceleration_m_s2: vector(w.centre_acceleration_m_s2),
            unsprung_inertia_n: vector(w.unsprung_inertia_n),
            ground_height_m: w.ground_height_m,
            strut_length_m: w.strut_length_m,
        }),
        road_class: message.road_class,
    }
}

pub(super) fn rollover_to_proto(rollover: &Rollover) -> pb::Rollover {
    let axles = Axle::ALL.into_iter().zip(rollover.axle_load_transfer_ratio);
    let [left_s, right_s] = rollover.time_to_two_wheel_lift_s;
    pb::Rollover {
        load_transfer_ratio: rollover.load_transfer_ratio,
        load_transfer_ratio_sigma: rollover.load_transfer_ratio_sigma,
        axles: axles
            .map(|(axle, load_transfer_ratio)| pb::AxleLoadTransfer {
                axle: axle_number(axle),
                load_transfer_ratio,
            })
            .collect(),
        wheels: entries(|wheel, axle, side| pb::WheelLiftTime {
            axle,
            side,
            time_to_lift_s: rollover.time_to_lift_s[wheel],
        }),
        time_to_left_lift_s: left_s,
        time_to_right_lift_s: right_s,
    }
}

pub(super) fn rollover_from_proto(r: &pb::Rollover) -> Rollover {
    Rollover {
        load_transfer_ratio: r.load_transfer_ratio,
        load_transfer_ratio_sigma: r.load_transfer_ratio_sigma,
        axle_load_transfer_ratio: Axle::ALL.map(|axle| {
            let mut entries = r.axles.iter();
            let entry = entries.find(|entry| entry.axle == axle_number(axle));
            entry.map_or(f64::NAN, |entry| entry.load_transfer_ratio)
        }),
        time_to_lift_s: per_wheel(&r.wheels, f64::NAN, |entry| entry.time_to_lift_s),
        time_to_two_wheel_lift_s: [r.time_to_left_lift_s, r.time_to_right_lift_s],
    }
}

pub(super) fn parameters_to_proto(parameters: &Parameters) -> pb::Parameters {
    pb::Parameters {
        accel_bias_m_s2: Some(vector(parameters.accel_bias_m_s2)),
        accel_bias_sigma_m_s2: Some(vector(parameters.accel_bias_sigma_m_s2)),
        gyro_bias_rad_s: Some(vector(parameters.gyro_bias_rad_s)),
        gyro_bias_sigma_rad_s: Some(vector(parameters.gyro_bias_sigma_rad_s)),
        steer_offset_rad: parameters.steer_offset_rad,
        steer_offset_sigma_rad: parameters.steer_offset_sigma_rad,
        axles: vec![
            grip_to_proto(Axle::Front, &parameters.front),
            grip_to_proto(Axle::Rear, &parameters.rear),
        ],
        innovations: Some(innovations_to_proto(&parameters.innovations)),
    }
}

pub(super) fn parameters_from_proto(time: LogTime, p: pb::Parameters) -> Parameters {
    Parameters {
        time,
        accel_bias_m_s2: array(p.accel_bias_m_s2),
        accel_bias_sigma_m_s2: array(p.accel_bias_sigma_m_s2),
        gyro_bias_rad_s: array(p.gyro_bias_rad_s),
        gyro_bias_sigma_rad_s: array(p.gyro_bias_sigma_rad_s),
        steer_offset_rad: p.steer_offset_rad,
        steer_offset_sigma_rad: p.steer_offset_sigma_rad,
        front: grip_from_proto(Axle::Front, &p.axles),
        rear: grip_from_proto(Axle::Rear, &p.axles),
        innovations: innovations_from_proto(p.innovations),
    }
}

fn innovations_to_proto(all: &[Innovations; InnovationKind::COUNT]) -> pb::Innovations {
    let of = |kind: InnovationKind| {
        let found = all[kind.index()];
        (found != Innovations::default()).then_some(pb::InnovationStatistic {
            count: found.count,
            mean_square: found.mean_square,
            rejected: found.rejected,
        })
    };
    pb::Innovations {
        strain: of(InnovationKind::Strain),
        bending: of(InnovationKind::Bending),
        strut: of(InnovationKind::Strut),
        accelerometer: of(InnovationKind::Accelerometer),
        gyro: of(InnovationKind::Gyro),
        gnss_velocity: of(InnovationKind::GnssVelocity),
        gnss_attitude: of(InnovationKind::GnssAttitude),
        wheel_speed: of(InnovationKind::WheelSpeed),
    }
}

fn innovations_from_proto(all: Option<pb::Innovations>) -> [Innovations; InnovationKind::COUNT] {
    let all = all.unwrap_or_default();
    InnovationKind::ALL.map(|kind| {
        let found = match kind {
            InnovationKind::Strain => all.strain,
            InnovationKind::Bending => all.bending,
            InnovationKind::Strut => all.strut,
            InnovationKind::Accelerometer => all.accelerometer,
            InnovationKind::Gyro => all.gyro,
            InnovationKind::GnssVelocity => all.gnss_velocity,
            InnovationKind::GnssAttitude => all.gnss_attitude,
            InnovationKind::WheelSpeed => all.wheel_speed,
        };
        found.map_or_else(Innovations::default, |found| Innovations {
            count: found.count,
            mean_square: found.mean_square,
            rejected: found.rejected,
        })
    })
}

fn grip_to_proto(axle: Axle, grip: &AxleGrip) -> pb::AxleGrip {
    pb::AxleGrip {
        axle: axle_number(axle),
        stiffness_factor: grip.stiffness_factor,
        stiffness_factor_sigma: grip.stiffness_factor_sigma,
        friction: grip.friction,
        friction_sigma: grip.friction_sigma,
        friction_min: grip.friction_min,
        utilisation: grip.utilisation,
        utilisation_sigma: grip.utilisation_sigma,
    }
}

fn grip_from_proto(axle: Axle, all: &[pb::AxleGrip]) -> AxleGrip {
    let found = all.iter().find(|grip| grip.axle == axle_number(axle));
    let grip = found.copied().unwrap_or_default();
    AxleGrip {
        stiffness_factor: grip.stiffness_factor,
        stiffness_factor_sigma: grip.stiffness_factor_sigma,
        friction: grip.friction,
        friction_sigma: grip.friction_sigma,
        friction_min: grip.friction_min,
        utilisation: grip.utilisation,
        utilisation_sigma: grip.utilisation_sigma,
    }
}

pub(super) fn event_to_proto(event: &Event) -> pb::Event {
    use pb::event::Kind;
    let kind = match &event.kind {
        EventKind::LiftWarning(wheel, lead_time_s) => {
            let (axle, side) = position(*wheel);
            Kind::LiftWarning(pb::LiftWarning {
                axle,
                side,
                lead_time_s: *lead_time_s,
            })
        }
        EventKind::Lift(wheel) => Kind::Lift(wheel_position(*wheel)),
        EventKind::Touchdown(wheel) => Kind::Touchdown(wheel_position(*wheel)),
        EventKind::TwoWheelLiftWarning(side, lead_time_s) => {
            Kind::TwoWheelLiftWarning(pb::TwoWheelLiftWarning {
                side: side.name().to_owned(),
                lead_time_s: *lead_time_s,
            })
        }
        EventKind::TwoWheelLift(side) => Kind::TwoWheelLift(pb::TwoWheelLift {
            side: side.name().to_owned(),
        }),
        EventKind::SurfaceChange(axle, ratio) => Kind::SurfaceChange(pb::SurfaceChange {
            axle: axle_number(*axle),
            lateral_force_ratio: *ratio,
        }),
        EventKind::SensorFault(name) => Kind::SensorFault(name.clone()),
        EventKind::SensorRecovered(name) => Kind::SensorRecovered(name.clone()),
        EventKind::Mistake(name) => Kind::Mistake(name.clone()),
        EventKind::InexactParameters(factor) => Kind::InexactParameters(*factor),
        EventKind::FilterReset => Kind::FilterReset(pb::FilterReset {}),
        EventKind::FilterRecovered => Kind::FilterRecovered(pb::FilterRecovered {}),
    };
    pb::Event {
        onset_ns: event.onset.0,
        probability: event.probability,
        text: event.text.clone(),
        kind: Some(kind),
        load_transfer_ratio: event.load_transfer_ratio,
    }
}

fn wheel_position(wheel: Wheel) -> pb::WheelPosition {
    let (axle, side) = position(wheel);
    pb::WheelPosition { axle, side }
}

pub(super) fn event_from_proto(time: LogTime, event: pb::Event) -> Result<Event, MessageError> {
    use pb::event::Kind;
    let kind = match event.kind.ok_or(MessageError::Absent("kind"))? {
        Kind::LiftWarning(warning) => {
            EventKind::LiftWarning(wheel(warning.axle, &warning.side)?, warning.lead_time_s)
        }
        Kind::Lift(of) => EventKind::Lift(wheel(of.axle, &of.side)?),
        Kind::Touchdown(of) => EventKind::Touchdown(wheel(of.axle, &of.side)?),
        Kind::TwoWheelLiftWarning(warning) => {
            EventKind::TwoWheelLiftWarning(side(&warning.side)?, warning.lead_time_s)
        }
        Kind::TwoWheelLift(lift) => EventKind::TwoWheelLift(side(&lift.side)?),
        Kind::SurfaceChange(change) => {
            let axle = axle(change.axle).ok_or(MessageError::Range {
                field: "axle",
                value: change.axle.into(),
            })?;
            EventKind::SurfaceChange(axle, change.lateral_force_ratio)
        }
        Kind::SensorFault(name) => EventKind::SensorFault(name),
        Kind::SensorRecovered(name) => EventKind::SensorRecovered(name),
        Kind::Mistake(name) => EventKind::Mistake(name),
        Kind::InexactParameters(factor) => EventKind::InexactParameters(factor),
        Kind::FilterReset(_) => EventKind::FilterReset,
        Kind::FilterRecovered(_) => EventKind::FilterRecovered,
    };
    Ok(Event {
        time,
        onset: LogTime(event.onset_ns),
        kind,
        probability: event.probability,
        load_transfer_ratio: event.load_transfer_ratio,
        text: event.text,
    })
}

pub(super) fn health_to_proto(health: &Health) -> pb::Health {
    let sources = health.sources.iter().map(|s| {
        let lost =
            |place: LossPlace| s.lost[LossPlace::ALL.iter().position(|p| *p == place).unwrap_or(0)];
        let counts = s.undecoded.iter().map(|known| pb::MessageCount {
            name: known.name.clone(),
            count: known.count,
        });
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
            undecoded: counts.collect(),
            late: s.late,
            too_late: s.too_late,
        }
    });
    pb::Health {
        sources: sources.collect(),
        faulty_sensors: health.faulty_sensors.clone(),
    }
}

pub(super) fn health_from_proto(time: LogTime, health: pb::Health) -> Result<Health, MessageError> {
    let sources = health.sources.into_iter().map(|s| {
        let lost = LossPlace::ALL.map(|place| match place {
            LossPlace::Device => s.lost_in_device,
            LossPlace::Kernel => s.lost_in_kernel,
            LossPlace::Queue => s.lost_in_queue,
            LossPlace::Disk => s.lost_on_disk,
        });
        let counts = s.undecoded.into_iter().map(|known| MessageCount {
            name: known.name,
            count: known.count,
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
            undecoded: counts.collect(),
            lost,
            late: s.late,
            too_late: s.too_late,
        })
    });
    Ok(Health {
        time,
        sources: sources.collect::<Result<_, MessageError>>()?,
        faulty_sensors: health.faulty_sensors,
    })
}

pub(super) fn clock_fit_to_proto(fit: &ClockFit) -> pb::ClockFit {
    pb::ClockFit {
        offset_s: fit.offset_s,
        drift_ppm: fit.drift_ppm,
        residual_sigma_s: fit.residual_sigma_s,
        count: fit.count,
        steps: fit.steps,
    }
}

pub(super) fn log_to_proto(log: &LogMessage) -> foxglove::Log {
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

pub(super) fn transforms_to_proto(
    time: LogTime,
    transforms: &[Transform],
) -> foxglove::FrameTransforms {
    let transforms = transforms.iter().map(|transform| {
        let [x, y, z] = transform.translation_m;
        let translation = foxglove::Vector3 { x, y, z };
        let [x, y, z, w] = transform.rotation_xyzw;
        let rotation = foxglove::Quaternion { x, y, z, w };
        foxglove::FrameTransform {
            timestamp: Some(timestamp(time)),
            parent_frame_id: transform.parent.clone(),
            child_frame_id: transform.child.clone(),
            translation: Some(translation),
            rotation: Some(rotation),
        }
    });
    foxglove::FrameTransforms {
        transforms: transforms.collect(),
    }
}

pub(super) fn log_from_proto(time: LogTime, log: foxglove::Log) -> LogMessage {
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

pub(super) fn transforms_from_proto(message: foxglove::FrameTransforms) -> Vec<Transform> {
    let transforms = message.transforms.into_iter().map(|transform| {
        let t = transform.translation.unwrap_or_default();
        let r = transform.rotation.unwrap_or_default();
        Transform {
            parent: transform.parent_frame_id,
            child: transform.child_frame_id,
            translation_m: [t.x, t.y, t.z],
            rotation_xyzw: [r.x, r.y, r.z, r.w],
        }
    });
    transforms.collect()
}
