//! A run with every kind of arrival and record.

use atvrec_store::{
    Attachment, ClockFit, ClockState, DynamicMessage, Ground, InjectedFault, LogMessage, Pose,
    Record, Session, SignalSchema, Source, SourceKind, Stage, Transform, UtcOffset, WheelGround,
};
use math::Random;
use sample::{
    Arrival, Attitude, Axle, AxleGrip, CanFlags, CanFrame, ControlSample, CornerSample, Counts,
    DeviceTime, Estimate, Event, EventKind, FixQuality, ForceFrame, ForceSource, GnssAttitude,
    GnssPosition, GnssVelocity, GroundSpeedSample, Health, ImuSample, InnovationKind, Innovations,
    Limit, LimitedBy, Limits, LimitsUnknown, LogTime, LossPlace, Measurement, Motion, Notice,
    Parameters, Payload, PerWheel, Road, RoadPlane, RoadRoughness, Rollover, Sample, Severity,
    Side, Signal, SignalFrame, SourceHealth, SourceId, SteerSample, Terrain, TerrainClass,
    TyreForce, Wheel, WheelSpeedSample,
};

/// Log clock at the start of the run.
pub const START: LogTime = LogTime(1_790_000_000_000_000_000);

/// A session with a CAN bus, two serial ports and the recorder itself.
pub fn session() -> Session {
    let source = |id, name: &str, kind| Source {
        id: SourceId(id),
        name: name.to_owned(),
        kind,
    };
    Session {
        injected_faults: Some(vec![InjectedFault {
            sensor: "FL lower_front".to_owned(),
            from_s: 1.5,
            to_s: 3.0,
        }]),
        origin: None,
        run_id: "test-run".to_owned(),
        started: START,
        version: "0.1.0".to_owned(),
        git_hash: "0123abc".to_owned(),
        boot_id: "boot".to_owned(),
        host: "host".to_owned(),
        run_number: None,
        clock: ClockState::Unknown,
        silence_ns: 1_000_000_000,
        sources: vec![
            source(0, "recorder", SourceKind::Recorder),
            source(1, "can0", SourceKind::Can),
            source(2, "crossbow", SourceKind::Serial),
            source(3, "novatel", SourceKind::Serial),
        ],
        dynamic: vec![DynamicMessage::can(
            "can0",
            "StrainFL",
            0x100,
            ["upper_front", "upper_rear"]
                .map(|name| SignalSchema {
                    name: name.to_owned(),
                    unit: "count".to_owned(),
                    labels: Vec::new(),
                })
                .into(),
        )],
        attachments: vec![Attachment {
            name: "atvrec.toml".to_owned(),
            media_type: "application/toml".to_owned(),
            data: b"[storage]\n".to_vec(),
        }],
    }
}

/// The `count` first arrivals of a run, of all kinds.
pub fn arrivals(seed: u64, count: u64) -> Vec<Arrival> {
    let mut random = Random::new(seed);
    let mut log_time = START;
    (0..count)
        .map(|sequence| {
            log_time = log_time + (random.below(3_000_000) as i64);
            let (source, payload) = payload(&mut random, log_time);
            Arrival {
                sequence,
                source: SourceId(source),
                log_time,
                realtime_ns: log_time.0 as i64 + 77_000 + random.below(300) as i64,
                payload,
            }
        })
        .collect()
}

fn payload(random: &mut Random, log_time: LogTime) -> (u16, Payload) {
    match random.below(20) {
        0 => (0, Payload::Tick),
        1 => (2, Payload::Notice(notice(random))),
        2..=5 => {
            let length = random.below(90);
            let bytes = (0..length).map(|_| random.bits() as u8).collect();
            (2, Payload::Bytes(bytes))
        }
        6..=7 => (3, Payload::Bytes(b"#BESTPOSA,COM1,0".to_vec())),
        _ => {
            let count = random.below(4);
            let frames = (0..count).map(|_| frame(random, log_time)).collect();
            (1, Payload::Can(frames))
        }
    }
}

fn notice(random: &mut Random) -> Notice {
    match random.below(5) {
        0 => Notice::Opened("/dev/ttyUSB0 at 38400".to_owned()),
        1 => Notice::Closed("unplugged".to_owned()),
        2 => Notice::Lost {
            place: LossPlace::ALL[random.below(4) as usize],
            count: 3,
        },
        3 => Notice::Mark("gravel".to_owned()),
        _ => Notice::EstimatorSkipped {
            first_sequence: 7,
            count: 2,
        },
    }
}

fn frame(random: &mut Random, log_time: LogTime) -> CanFrame {
    let flags = CanFlags::from_bits(random.below(128) as u8 & !2);
    let flags = CanFlags {
        remote: !flags.fd && random.below(10) == 0,
        ..flags
    };
    let length = random.below(if flags.fd { 65 } else { 9 }) as usize;
    let data: Vec<u8> = (0..length)
        .map(|_| if flags.remote { 0 } else { random.bits() as u8 })
        .collect();
    let mut frame =
        CanFrame::new(0x100 + random.below(6) as u32, flags, &data).expect("the length fits");
    if frame.len == 8 && !flags.fd && random.below(4) == 0 {
        frame.len8_dlc = 9 + random.below(7) as u8;
    }
    frame.kernel_ns = (random.below(5) > 0).then(|| log_time.0 as i64 - 20_000);
    frame.hardware_ns = (random.below(5) == 0).then(|| random.below(1 << 40) as i64);
    frame
}

fn sample(source: u16, time: LogTime, measurement: Measurement) -> Record {
    Record::Sample(Sample {
        source: SourceId(source),
        log_time: time,
        valid_time: time + -5_000_000,
        device_time: None,
        measurement,
    })
}

fn with_device_time(record: Record, device_time: DeviceTime) -> Record {
    match record {
        Record::Sample(sample) => Record::Sample(Sample {
            device_time: Some(device_time),
            ..sample
        }),
        other => other,
    }
}

/// One record of every kind that is read back as it was written.
pub fn records(time: LogTime) -> Vec<Record> {
    let mut records = measurements(time);
    records.extend(events(time));
    records.extend([
        Record::Motion {
            time,
            stage: Stage::Estimate,
            motion: Box::new(motion()),
        },
        Record::TyreForces {
            time,
            stage: Stage::Model,
            frame: ForceFrame::WheelCarrier,
            forces: Box::new(forces(1.5)),
        },
        Record::Friction {
            time,
            coefficient: PerWheel([0.9, 0.8, 0.7, 0.6]),
        },
        Record::Ground {
            time,
            ground: Box::new(Ground {
                wheels: PerWheel::from_fn(|wheel| WheelGround {
                    normal_body: [0.01, 0.02, 0.99],
                    spindle_body: [0.03, 0.98, 0.04],
                    centre_acceleration_m_s2: wheel.is_front().then_some([1.0, 2.0, 3.0]),
                    unsprung_inertia_n: wheel.is_left().then_some([4.0, 5.0, 6.0]),
                    ground_height_m: Some(0.25),
                    strut_length_m: wheel.is_front().then_some(0.35),
                }),
                road_class: Some("C".to_owned()),
            }),
        },
        Record::Pose {
            time,
            pose: Pose {
                position_enu_m: [1.0, 2.0, 3.0],
                yaw_rad: 0.1,
                pitch_rad: 0.2,
                roll_rad: 0.3,
            },
        },
        Record::Road {
            stage: Stage::Estimate,
            road: Box::new(road(time)),
        },
        Record::Limits(Box::new(limits(time))),
        Record::Terrain(Terrain {
            time,
            class: TerrainClass::Gravel,
            probability: [0.1, 0.6, 0.15, 0.05, 0.1],
            rolling_resistance: 0.03,
            rolling_resistance_sigma: 0.01,
        }),
        Record::Parameters(Box::new(parameters(time))),
        Record::Health(health(time)),
        Record::ClockFit(ClockFit {
            source: SourceId(3),
            time,
            offset_s: -0.25,
            drift_ppm: 1.5,
            residual_sigma_s: 0.001,
            count: 40,
            steps: 1,
        }),
        Record::UtcOffset(UtcOffset {
            time,
            offset_ns: -86_400_000_000_123,
            sigma_s: 0.1,
            source: SourceId(3),
            leap_seconds: Some(18),
        }),
        Record::Mark {
            time,
            text: "gravel".to_owned(),
        },
        Record::Log(LogMessage {
            time,
            severity: Severity::Warning,
            name: "novatel".to_owned(),
            text: "silent for 1 s".to_owned(),
        }),
        Record::Transforms {
            time,
            transforms: vec![
                Transform {
                    parent: "earth".to_owned(),
                    child: "vehicle".to_owned(),
                    translation_m: [1.0, -2.0, 0.5],
                    rotation_xyzw: [0.0, 0.0, 0.6, 0.8],
                },
                Transform {
                    parent: "vehicle".to_owned(),
                    child: "wheel_fl".to_owned(),
                    translation_m: [1.0, 0.5, -0.25],
                    rotation_xyzw: [0.0, 0.0, 0.0, 1.0],
                },
            ],
        },
    ]);
    records
}

fn parameters(time: LogTime) -> Parameters {
    Parameters {
        time,
        accel_bias_m_s2: [0.05, -0.04, 0.03],
        accel_bias_sigma_m_s2: [0.01, 0.02, 0.005],
        gyro_bias_rad_s: [0.005, -0.004, 0.003],
        gyro_bias_sigma_rad_s: [1e-4, 2e-4, 3e-4],
        steer_offset_rad: -0.01,
        steer_offset_sigma_rad: 0.002,
        front: AxleGrip {
            stiffness_factor: 0.8,
            stiffness_factor_sigma: 0.1,
            friction: Some(0.85),
            friction_sigma: Some(0.05),
            friction_min: 0.6,
            utilisation: 0.7,
            utilisation_sigma: 0.04,
        },
        rear: AxleGrip {
            stiffness_factor: 1.1,
            friction_min: 0.1,
            ..AxleGrip::default()
        },
        innovations: InnovationKind::ALL.map(|kind| Innovations {
            count: 100 * kind.index() as u32,
            mean_square: 0.1 * kind.index() as f64,
            rejected: 7 - kind.index() as u32,
        }),
    }
}

fn measurements(time: LogTime) -> Vec<Record> {
    let signal = |name: &str, value, unit: &str| Signal {
        name: name.into(),
        value,
        unit: unit.into(),
    };
    let corner = |strain, deflection| CornerSample {
        wheel: Wheel::RearLeft,
        strain_counts: strain,
        deflection_counts: deflection,
    };
    vec![
        with_device_time(
            sample(
                2,
                time,
                Measurement::Imu(ImuSample {
                    specific_force_m_s2: [0.1, -0.2, 9.8],
                    angular_rate_rad_s: [0.01, 0.02, -0.03],
                    temperature_c: Some(31.5),
                    interval_s: 0.01,
                    status: 0xfffe,
                    valid: true,
                }),
            ),
            DeviceTime::Counter {
                value: 65_535,
                modulus: 65_536,
            },
        ),
        with_device_time(
            sample(
                3,
                time,
                Measurement::GnssPosition(GnssPosition {
                    quality: FixQuality::Fixed,
                    latitude_rad: 0.653,
                    longitude_rad: -2.131,
                    height_m: 12.25,
                    sigma_enu_m: Some([0.01, 0.02, 0.03]),
                    satellites: Some(9),
                }),
            ),
            DeviceTime::Gps {
                week: Some(2400),
                time_of_week_s: 345_600.05,
            },
        ),
        with_device_time(
            sample(
                3,
                time,
                Measurement::GnssVelocity(GnssVelocity {
                    quality: FixQuality::Float,
                    velocity_enu_m_s: [1.0, -2.0, 0.1],
                    sigma_enu_m_s: None,
                    latency_s: Some(0.0),
                }),
            ),
            DeviceTime::UtcTimeOfDay(4321.5),
        ),
        with_device_time(
            sample(
                3,
                time,
                Measurement::GnssAttitude(GnssAttitude {
                    quality: FixQuality::DeadReckoning,
                    yaw_rad: Some(0.5),
                    pitch_rad: None,
                    roll_rad: Some(-0.1),
                    sigma_rad: Some([0.1, 0.2, 0.3]),
                }),
            ),
            DeviceTime::AdapterNanos(-5),
        ),
        sample(
            2,
            time,
            Measurement::Attitude(Attitude {
                roll_rad: 0.1,
                pitch_rad: 0.2,
                yaw_rad: 0.3,
            }),
        ),
        sample(
            1,
            time,
            Measurement::Corner(corner(
                [
                    Some(0.into()),
                    None,
                    Some(1023.into()),
                    Some(i32::MIN.into()),
                    Some(Counts::Equivalent {
                        counts: -32_768.25,
                        step: 0.5,
                    }),
                    Some(i32::MAX.into()),
                    None,
                ],
                None,
            )),
        ),
        sample(
            1,
            time,
            Measurement::Corner(corner([None; 7], Some(512.into()))),
        ),
        sample(
            1,
            time,
            Measurement::Corner(corner(
                [None; 7],
                Some(Counts::Equivalent {
                    counts: 511.75,
                    step: 0.0,
                }),
            )),
        ),
        sample(
            1,
            time,
            Measurement::Steer(SteerSample {
                steering_wheel_rad: -0.7,
            }),
        ),
        sample(
            1,
            time,
            Measurement::WheelSpeed(WheelSpeedSample {
                angular_speed_rad_s: PerWheel([Some(1.0), Some(0.0), None, Some(-2.0)]),
            }),
        ),
        sample(
            2,
            time,
            Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s: 12.5,
                leftward_m_s: Some(-0.25),
            }),
        ),
        sample(
            3,
            time,
            Measurement::Control(ControlSample {
                values: vec![signal("throttle", 0.25, "1"), signal("brake", 0.0, "Pa")],
            }),
        ),
        sample(
            1,
            time,
            Measurement::Signals(SignalFrame {
                message: "StrainFL".into(),
                id: 0x100,
                signals: vec![signal("upper_rear", 511.0, "count")],
            }),
        ),
    ]
}

fn events(time: LogTime) -> Vec<Record> {
    let kinds = [
        EventKind::LiftWarning(Wheel::FrontRight, 0.4),
        EventKind::Lift(Wheel::FrontLeft),
        EventKind::Touchdown(Wheel::RearRight),
        EventKind::TwoWheelLiftWarning(Side::Right, 1.5),
        EventKind::TwoWheelLift(Side::Left),
        EventKind::TwoWheelLift(Side::Right),
        EventKind::SurfaceChange(Axle::Front, 0.6),
        EventKind::SurfaceChange(Axle::Rear, 0.7),
        EventKind::SensorFault("crossbow".to_owned()),
        EventKind::SensorRecovered("crossbow".to_owned()),
        EventKind::Mistake("front left upper_front: gain".to_owned()),
        EventKind::InexactParameters(0.75),
        EventKind::FilterReset,
        EventKind::FilterRecovered,
    ];
    let event = |(index, kind)| {
        Record::Event(Event {
            time,
            onset: time + 400_000_000,
            kind,
            probability: (index % 2 == 0).then_some(0.75),
            load_transfer_ratio: (index % 3 == 0).then_some(-0.25),
            text: format!("event {index}"),
        })
    };
    kinds.into_iter().enumerate().map(event).collect()
}

/// A motion in which every member differs.
pub fn motion() -> Motion {
    Motion {
        velocity_x_m_s: 5.0,
        velocity_y_m_s: -0.3,
        sideslip_rad: -0.06,
        sideslip_sigma_rad: 0.01,
        roll_rad: 0.02,
        pitch_rad: -0.01,
        rate_rad_s: [0.1, 0.2, 0.3],
        acceleration_m_s2: [0.4, 0.5, 0.6],
        steer_rad: PerWheel([0.11, 0.12, 0.0, 0.0]),
        slip_angle_rad: PerWheel([0.01, 0.02, 0.03, 0.04]),
        longitudinal_slip: PerWheel([0.05, -0.06, 0.0, 0.08]),
        longitudinal_slip_sigma: PerWheel([0.005, 0.006, 0.007, 0.008]),
        bank_rad: 0.05,
        grade_rad: 0.07,
    }
}

/// Limits in which every member differs.
pub fn limits(time: LogTime) -> Limits {
    let limit = |value: f64| Limit {
        value,
        at_least: value - 0.01,
    };
    Limits {
        time,
        unknown: Some(LimitsUnknown::Grip),
        grip_used: 0.24,
        limited_by: LimitedBy::FrontGrip,
        lateral_m_s2: limit(2.1),
        speed_m_s: limit(9.2),
        curve_radius_m: 20.0,
        curve_speed_m_s: limit(11.3),
        side_slope_rad: limit(0.54),
        grade_rad: limit(0.45),
    }
}

/// A road in which every member differs.
pub fn road(time: LogTime) -> Road {
    Road {
        time,
        unknown: None,
        height_m: PerWheel([0.01, 0.02, 0.03, -0.04]),
        height_sigma_m: PerWheel([0.001, 0.002, 0.003, 0.004]),
        plane: RoadPlane {
            bank_rad: 0.11,
            bank_sigma_rad: 0.011,
            grade_rad: -0.12,
            grade_sigma_rad: 0.012,
            warp_m: 0.13,
            warp_sigma_m: 0.013,
        },
        roughness: Some(RoadRoughness {
            gd_n0_m3: 300e-6,
            bounds_m3: [200e-6, 400e-6],
            waviness: 2.1,
            distance_m: 150.0,
        }),
        iri_m_km: [8.0, 9.0],
    }
}

/// Forces in which every member differs.
pub fn forces(scale: f64) -> PerWheel<TyreForce> {
    PerWheel::from_fn(|wheel| TyreForce {
        force_n: [1.0, 2.0, 3.0].map(|n| n * scale + wheel.index() as f64 * 100.0),
        sigma_n: [4.0, 5.0, 6.0],
        moment_n_m: [7.0, 8.0, 9.0],
        moment_sigma_n_m: [0.7, 0.8, 0.9],
        source: [
            ForceSource::Deflection,
            ForceSource::Statics,
            ForceSource::Fusion,
            ForceSource::Model,
        ][wheel.index()],
    })
}

/// An estimate at an instant.
pub fn estimate(time: LogTime) -> Estimate {
    Estimate {
        time,
        motion: motion(),
        carrier: forces(3.0),
        measured: forces(1.0),
        expected: forces(2.0),
        rollover: Rollover {
            load_transfer_ratio: 0.5,
            load_transfer_ratio_sigma: 0.01,
            axle_load_transfer_ratio: [0.75, 0.25],
            time_to_lift_s: PerWheel([0.0, f64::INFINITY, 2.0, 3.0]),
            time_to_two_wheel_lift_s: [1.5, f64::INFINITY],
        },
    }
}

fn health(time: LogTime) -> Health {
    Health {
        time,
        sources: vec![SourceHealth {
            source: SourceId(2),
            name: "crossbow".to_owned(),
            open: true,
            silent: false,
            bytes: 1,
            messages: 2,
            checksum_errors: 3,
            skipped_bytes: 4,
            gaps: 5,
            malformed: 6,
            reopened: 7,
            lost: [8, 9, 10, 11],
            undecoded: vec![sample::MessageCount {
                name: "GSV".to_owned(),
                count: 12,
            }],
            late: 5,
            too_late: 6,
        }],
        faulty_sensors: vec!["FL deflection".to_owned(), "steering wheel".to_owned()],
    }
}
