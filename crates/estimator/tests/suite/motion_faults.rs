//! Faults of the sensors of motion, on truth runs: each is named, what it says is left out, so that
//! forces and motion stay as good as without it, and it is used again when it is good.

use atvrec_estimator::{Calibration, Input, Settings};
use model::sensors::Sensors;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sample::{EventKind, FixQuality, GnssVelocity, Measurement, Sample, Wheel};
use testkit::scoring::{Estimated, estimate, force_errors, motion_errors};
use testkit::sensing;
use testkit::truth::{self, RATE_HZ, Run};

use crate::RUNS;
use crate::fault::{self, Channel, Fault, Kind};

/// When faults begin and end, s: before `d_sine_mu` comes to the slippery ground.
const FAULT_S: f64 = 8.0;
const HEALED_S: f64 = 12.0;
/// How soon a fault must be named, and its end, s.
const NAMED_WITHIN_S: f64 = 1.0;
/// The same of a channel that is right, but has lost its noise.
const SILENT_WITHIN_S: f64 = 2.5;
const RECOVERED_WITHIN_S: f64 = 1.0;
/// How much a fault may add to the forces' errors, per cent, and to those of sideslip, roll and
/// pitch, degrees.
const FORCE_MORE: f64 = 0.35;
const ANGLE_MORE_DEG: f64 = 0.25;

/// Channels of one device that fail together, the name in the event, and the runs on which what hangs is right,
/// because nothing changes: only its missing noise names it.
struct Case {
    channels: &'static [(Channel, Kind)],
    name: &'static str,
    right: &'static [&'static str],
}

const fn case(channels: &'static [(Channel, Kind)], name: &'static str) -> Case {
    Case {
        channels,
        name,
        right: &[],
    }
}

const HEADING: Channel = Channel::Angle(0);
const WHEEL: Channel = Channel::WheelSpeed(Wheel::FrontLeft);
const VELOCITY_HANGS: Case = case(
    &[
        (Channel::Velocity(0), Kind::Frozen),
        (Channel::Velocity(1), Kind::Frozen),
        (Channel::Velocity(2), Kind::Frozen),
    ],
    "GNSS velocity",
);
const VELOCITY_OFF: Case = case(
    &[(Channel::Velocity(0), Kind::Shifted(0.05))],
    "GNSS velocity",
);
const CASES: [Case; 16] = [
    VELOCITY_HANGS,
    VELOCITY_OFF,
    Case {
        channels: &[(HEADING, Kind::Frozen)],
        name: "GNSS attitude",
        right: &["f_launch_brake"],
    },
    case(&[(HEADING, Kind::Shifted(0.1))], "GNSS attitude"),
    case(
        &[(Channel::SpecificForce(0), Kind::Shifted(0.375))],
        "inertial unit forward acceleration",
    ),
    case(
        &[(Channel::SpecificForce(1), Kind::Saturated(false))],
        "inertial unit leftward acceleration",
    ),
    case(
        &[(Channel::SpecificForce(1), Kind::Shifted(0.05))],
        "inertial unit leftward acceleration",
    ),
    case(
        &[(Channel::SpecificForce(2), Kind::Dead)],
        "inertial unit upward acceleration",
    ),
    case(
        &[(Channel::SpecificForce(1), Kind::Frozen)],
        "inertial unit leftward acceleration",
    ),
    case(
        &[(Channel::Rate(2), Kind::Frozen)],
        "inertial unit yaw rate",
    ),
    case(
        &[(Channel::Rate(0), Kind::Saturated(true))],
        "inertial unit roll rate",
    ),
    case(
        &[(Channel::Rate(2), Kind::Shifted(0.5))],
        "inertial unit yaw rate",
    ),
    Case {
        channels: &[(Channel::SteeringWheel, Kind::Frozen)],
        name: "steering wheel",
        right: &["b_circle", "f_launch_brake"],
    },
    Case {
        channels: &[(Channel::SteeringWheel, Kind::Dead)],
        name: "steering wheel",
        right: &["f_launch_brake"],
    },
    case(
        &[(Channel::SteeringWheel, Kind::Shifted(0.25))],
        "steering wheel",
    ),
    case(&[(WHEEL, Kind::Dead)], "FL wheel speed"),
];

#[test]
fn a_fault_is_named_left_out_and_over_when_it_is_over() {
    let Some(drives) = Drive::all() else {
        return;
    };
    for drive in &drives {
        let name = drive.name;
        let (force_good, motion_good, told) = drive.judge(drive.good);
        assert!(told.is_empty(), "{name} {told:?}");
        for case in &CASES {
            let (force, motion, told) = drive.judge(&spoil(drive.good, case.channels));
            let what = format!("{name} {:?}", case.channels);
            eprintln!("{what}: {force:.2?} % {motion:.3?} deg {told:.2?}");
            for (spoilt, good) in force.iter().zip(force_good) {
                assert!(*spoilt <= good + FORCE_MORE, "{what} {force:?}");
            }
            for (spoilt, good) in motion.iter().zip(motion_good) {
                assert!(*spoilt <= good + ANGLE_MORE_DEG, "{what} {motion:?}");
            }
            let within_s = if case.right.contains(&name) {
                SILENT_WITHIN_S
            } else {
                NAMED_WITHIN_S
            };
            // An accelerometer is good again when it has agreed for half a second, of a vehicle that
            // moves: this one stops before.
            if name == "f_launch_brake" && case.name.ends_with("acceleration") {
                assert!(
                    told.len() == 1 && told[0].0 - FAULT_S <= NAMED_WITHIN_S,
                    "{what} {told:?}"
                );
                continue;
            }
            let [(fault_s, fault), (recovered_s, recovery)] = &told[..] else {
                panic!("{what} {told:?}");
            };
            assert_eq!(*fault, EventKind::SensorFault(case.name.to_owned()));
            assert_eq!(*recovery, EventKind::SensorRecovered(case.name.to_owned()));
            assert!(fault_s - FAULT_S <= within_s, "{what} {fault_s}");
            assert!(
                recovered_s - HEALED_S <= RECOVERED_WITHIN_S,
                "{what} {recovered_s}"
            );
        }
    }
}

/// What a unit that calls itself bad for four seconds may cost, per cent and degrees: as much as one
/// that is missing (`subsets.rs`).
const BAD_FORCE_MAX: f64 = 1.0;
const BAD_ANGLE_MORE_DEG: f64 = 0.5;

#[test]
fn a_unit_that_calls_itself_bad_is_named_and_not_used() {
    let Some(drives) = Drive::all() else {
        return;
    };
    for drive in &drives {
        let (_, motion_good, _) = drive.judge(drive.good);
        let begin = drive.good[0].valid_time;
        let mut samples = drive.good.to_vec();
        for sample in &mut samples {
            let since_s = sample.valid_time.seconds_since(begin);
            if let Measurement::Imu(imu) = &mut sample.measurement
                && (FAULT_S..HEALED_S).contains(&since_s)
            {
                imu.valid = false;
                imu.specific_force_m_s2 = [50.0; 3];
                imu.angular_rate_rad_s = [3.0; 3];
            }
        }
        let (force, motion, told) = drive.judge(&samples);
        let what = format!("{} {force:.2?} % {motion:.3?} deg {told:.2?}", drive.name);
        eprintln!("{what}");
        assert!(force.iter().all(|error| *error < BAD_FORCE_MAX), "{what}");
        for (spoilt, good) in motion.iter().zip(motion_good) {
            assert!(*spoilt <= good + BAD_ANGLE_MORE_DEG, "{what}");
        }
        let name = "inertial unit".to_owned();
        let [(fault_s, fault), (recovered_s, recovery)] = &told[..] else {
            panic!("{what}");
        };
        assert_eq!(*fault, EventKind::SensorFault(name.clone()));
        assert_eq!(*recovery, EventKind::SensorRecovered(name));
        assert!((0.15..0.3).contains(&(fault_s - FAULT_S)), "{what}");
        assert!((0.0..0.1).contains(&(recovered_s - HEALED_S)), "{what}");
    }
}

/// A jump, rad/s or m/s^2, that is too small for the balances of forces and moments to tell.
struct Jump {
    channel: Channel,
    by: f64,
    name: &'static str,
}

const fn jump(channel: Channel, by: f64, name: &'static str) -> Jump {
    Jump { channel, by, name }
}

/// How soon a bias that jumps must be named, and its being known again, s.
const JUMP_NAMED_WITHIN_S: f64 = 1.6;
const JUMP_KNOWN_WITHIN_S: f64 = 3.5;
/// How much a jump there and one back may add to the motion's errors, degrees: before they were looked
/// for, 0.05 rad/s of yaw rate added 1.9 degrees of sideslip, and 0.2 rad/s 6.3.
const JUMP_MORE_DEG: f64 = 0.6;
const JUMPS: [Jump; 9] = [
    jump(Channel::Rate(0), 0.05, "inertial unit roll rate bias"),
    jump(Channel::Rate(1), 0.05, "inertial unit pitch rate bias"),
    jump(Channel::Rate(2), 0.05, "inertial unit yaw rate bias"),
    jump(Channel::Rate(0), -0.1, "inertial unit roll rate bias"),
    jump(Channel::Rate(1), -0.1, "inertial unit pitch rate bias"),
    jump(Channel::Rate(2), 0.2, "inertial unit yaw rate bias"),
    jump(
        Channel::SpecificForce(0),
        0.5,
        "inertial unit forward acceleration bias",
    ),
    jump(
        Channel::SpecificForce(1),
        -0.7,
        "inertial unit leftward acceleration bias",
    ),
    jump(
        Channel::SpecificForce(2),
        1.0,
        "inertial unit upward acceleration bias",
    ),
];

#[test]
fn a_bias_that_jumps_is_named_and_learnt() {
    let Some(drives) = Drive::all() else {
        return;
    };
    for drive in &drives {
        let (_, motion_good, _) = drive.judge(drive.good);
        for jump in &JUMPS {
            let what = format!("{} {} by {}", drive.name, jump.name, jump.by);
            let (_, motion, told) = drive.judge(&jumping(drive.good, jump.channel, jump.by));
            eprintln!("{what}: {motion_good:.3?} {motion:.3?} deg {told:.2?}");
            for (spoilt, good) in motion.iter().zip(motion_good) {
                assert!(*spoilt <= good + JUMP_MORE_DEG, "{what} {motion:?}");
            }
            let faulty = EventKind::SensorFault(jump.name.to_owned());
            let known = EventKind::SensorRecovered(jump.name.to_owned());
            for (since, kind, within_s) in [
                (FAULT_S, &faulty, JUMP_NAMED_WITHIN_S),
                (FAULT_S, &known, JUMP_KNOWN_WITHIN_S),
                (HEALED_S, &faulty, JUMP_NAMED_WITHIN_S),
            ] {
                let soon = since..since + within_s;
                let is_it = |(s, told): &(f64, EventKind)| soon.contains(s) && told == kind;
                assert!(told.iter().any(is_it), "{what} {kind:?} {told:.2?}");
            }
            // Until the jump is found the heading drifts, which may look like another surface.
            let other = |(_, kind): &&(f64, EventKind)| {
                !matches!(kind, EventKind::SurfaceChange(..)) && *kind != faulty && *kind != known
            };
            assert_eq!(told.iter().find(other), None, "{what} {told:.2?}");
        }
    }
}

/// Jumps of each rate, rad/s, and of each specific force, m/s^2.
const RATES: [f64; 8] = [0.01, 0.02, 0.05, 0.1, 0.15, -0.15, 0.2, 0.3];
const FORCES: [f64; 6] = [0.1, 0.3, 0.7, 1.0, 1.4, 2.0];

/// What the table of jumps in `docs/estimator.md` tells: how much each adds to the worst drive's errors.
#[test]
#[ignore = "168 drives: `make campaigns`"]
fn jumps_of_many_sizes_restart_no_filter_and_blame_no_receiver() {
    let Some(drives) = Drive::all() else {
        return;
    };
    let good: Vec<_> = drives.iter().map(|drive| drive.judge(drive.good)).collect();
    let mut surfaces = 0;
    let channels = (0..3).flat_map(|axis| {
        let rates = RATES.map(|by| (Channel::Rate(axis), by));
        let forces = FORCES.map(|by| (Channel::SpecificForce(axis), by));
        rates.into_iter().chain(forces)
    });
    for (channel, by) in channels {
        let mut more = [0.0_f64; 6];
        for (drive, (force_good, motion_good, _)) in drives.iter().zip(&good) {
            let (force, motion, told) = drive.judge(&jumping(drive.good, channel, by));
            let (now, before) = (
                motion.iter().chain(&force),
                motion_good.iter().chain(force_good),
            );
            for (more, (now, before)) in more.iter_mut().zip(now.zip(before)) {
                *more = more.max(now - before);
            }
            for (_, kind) in &told {
                surfaces += usize::from(matches!(kind, EventKind::SurfaceChange(..)));
                let wrong = match kind {
                    EventKind::FilterReset => true,
                    EventKind::SensorFault(name) => name.starts_with("GNSS"),
                    _ => false,
                };
                assert!(!wrong, "{} {channel:?} by {by}: {told:.2?}", drive.name);
            }
        }
        eprintln!("{channel:?} by {by}: sideslip, roll, pitch, F_x, F_y, F_z more {more:.2?}");
    }
    eprintln!("{surfaces} changes of surface");
}

/// A truth run through the thesis's sensors.
struct Drive {
    name: &'static str,
    run: &'static Run,
    good: &'static [Sample],
}

impl Drive {
    /// The four; `None` without the truth runs.
    fn all() -> Option<[Self; 4]> {
        let drive = |name| {
            let run = truth::run(name)?;
            let good = run.samples("thesis-10bit", 1);
            Some(Self { name, run, good })
        };
        let [a, b, c, d] = RUNS.map(drive);
        Some([a?, b?, c?, d?])
    }

    /// Errors of forces, per cent, and of motion, degrees, and what was told.
    fn judge(&self, samples: &[Sample]) -> ([f64; 3], [f64; 3], Vec<(f64, EventKind)>) {
        let vehicle = truth::vehicle();
        let sensors = Sensors::builtin("thesis-10bit").unwrap();
        let calibration = Calibration::nominal(&vehicle.name);
        let settings = Settings::default();
        let result = estimate(vehicle, &sensors, &calibration, settings, samples);
        let force = force_errors(self.run, vehicle, &result);
        (force, motion_errors(self.run, &result), told(&result))
    }
}

/// The samples with a channel off by so much for as long as faults last.
fn jumping(good: &[Sample], channel: Channel, by: f64) -> Vec<Sample> {
    spoil(good, &[(channel, Kind::Shifted(by / channel.range()))])
}

/// Without strain nothing confirms the inertial unit, and a receiver that contradicts it for long
/// is adopted; but not one that hangs.
#[test]
fn a_value_that_hangs_is_not_adopted_though_nothing_contradicts_it() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let good = run.samples("thesis-10bit", 1);
    for (case, resets) in [(&VELOCITY_HANGS, 0), (&VELOCITY_OFF, 2)] {
        let settings = Settings {
            ignore: vec![Input::Strain],
            ..Settings::default()
        };
        let samples = spoil(good, case.channels);
        let result = estimate(vehicle, &sensors, &calibration, settings, &samples);
        let told = told(&result);
        eprintln!("{told:?}");
        assert_eq!(told.len(), resets, "{told:?}");
        assert!(told.iter().all(|(_, kind)| *kind == EventKind::FilterReset));
    }
}

/// An attitude receiver that tells velocity, too, has an antenna of its own; where it contradicts the
/// other receiver and the inertial unit it is left out, also where nothing else confirms them.
#[test]
fn of_two_receivers_the_wrong_one_is_left_out() {
    let vehicle = truth::vehicle();
    let mut sensors = Sensors::builtin("thesis-10bit").unwrap();
    sensors.gnss_attitude.antenna_m = [0.8, 0.4, 0.9];
    let calibration = Calibration::nominal(&vehicle.name);
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let of_one = sensing::samples(run, vehicle, &sensors, 1);
    let judged = |samples: &[Sample], ignore: &[Input]| {
        let settings = Settings {
            ignore: ignore.to_vec(),
            ..Settings::default()
        };
        let result = estimate(vehicle, &sensors, &calibration, settings, samples);
        (motion_errors(run, &result), told(&result))
    };
    for ignore in [&[][..], &[Input::Strain]] {
        let (with_one, _) = judged(&of_one, ignore);
        for off_m_s in [0.0, 3.0] {
            let (motion, told) = judged(&with_second(run, &sensors, &of_one, off_m_s), ignore);
            eprintln!("{ignore:?} {off_m_s} m/s off: {with_one:.3?} {motion:.3?} {told:.2?}");
            for (two, one) in motion.iter().zip(with_one) {
                assert!(*two <= one + ANGLE_MORE_DEG, "{motion:?} {with_one:?}");
            }
            let name = "GNSS velocity of the attitude receiver".to_owned();
            let kinds: Vec<&EventKind> = told.iter().map(|(_, kind)| kind).collect();
            match kinds[..] {
                [] => assert!(off_m_s == 0.0 || !ignore.is_empty(), "{told:?}"),
                [fault, recovery] => {
                    assert!(off_m_s > 0.0);
                    assert_eq!(*fault, EventKind::SensorFault(name.clone()));
                    assert_eq!(*recovery, EventKind::SensorRecovered(name));
                }
                _ => panic!("{told:?}"),
            }
        }
    }
}

/// The samples with the velocity of the attitude receiver's antenna beside each attitude, which is
/// off for as long as faults last.
fn with_second(run: &Run, sensors: &Sensors, samples: &[Sample], off_m_s: f64) -> Vec<Sample> {
    let arm = sensors.gnss_attitude.antenna_m.into();
    let velocity = |sample: &Sample| {
        let valid_s = sample.valid_time.seconds_since(sensing::START);
        let row = (valid_s * RATE_HZ).round() as usize;
        let mut velocity = sensing::antenna_velocity(run, row, arm);
        if (FAULT_S..HEALED_S).contains(&valid_s) {
            velocity.x += off_m_s;
        }
        Sample {
            measurement: Measurement::GnssVelocity(GnssVelocity {
                quality: FixQuality::Fixed,
                velocity_enu_m_s: velocity.into(),
                ..GnssVelocity::default()
            }),
            ..sample.clone()
        }
    };
    let mut all = Vec::with_capacity(samples.len());
    for sample in samples {
        if matches!(sample.measurement, Measurement::GnssAttitude(_)) {
            all.push(velocity(sample));
        }
        all.push(sample.clone());
    }
    all
}

/// The samples with the channels spoilt.
fn spoil(good: &[Sample], channels: &[(Channel, Kind)]) -> Vec<Sample> {
    let faults = channels.iter().map(|(channel, kind)| Fault {
        channel: *channel,
        kind: *kind,
        span_s: FAULT_S..HEALED_S,
    });
    let faults: Vec<Fault> = faults.collect();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    fault::spoil(good.to_vec(), &faults, &mut rng)
}

/// What the estimator said of sensors and of itself, and of the ground before that changed.
fn told(result: &Estimated) -> Vec<(f64, EventKind)> {
    let told = result.events.iter().filter(|event| match event.kind {
        EventKind::SensorFault(_) | EventKind::SensorRecovered(_) | EventKind::FilterReset => true,
        EventKind::SurfaceChange(..) => event.time < sensing::START.offset_seconds(2.0 * HEALED_S),
        _ => false,
    });
    told.map(|event| (event.time.seconds_since(sensing::START), event.kind.clone()))
        .collect()
}
