//! Missing, faulty and imperfect: what the filter makes of less than everything, on truth runs.

use atvrec_estimator::{Calibration, Input, Settings};
use model::sensors::Sensors;
use sample::{Counts, Event, EventKind, Measurement, Sample, StrainChannel, Wheel};
use testkit::scoring::{self, Estimated, deviations, estimate, force_errors, motion_errors};
use testkit::sensing;
use testkit::truth::{self, RATE_HZ, Run};

const RUNS: [&str; 3] = ["b_circle", "c_sine03", "f_launch_brake"];

fn setting(ignore: &[Input]) -> Settings {
    Settings {
        ignore: ignore.to_vec(),
        ..Settings::default()
    }
}

/// The count of a channel whose zero has moved.
fn shifted(counts: Counts) -> Counts {
    Counts::Converter((counts.number() as i32 + 60).min(1022))
}

/// One case: what is ignored, what is done to each sample, and the largest errors F_x, F_y, F_z in
/// per cent and of sideslip in degrees.
struct Case {
    name: &'static str,
    ignore: &'static [Input],
    spoil: fn(f64, &mut Measurement),
    force_max: [f64; 3],
    sideslip_max: f64,
}

const CASES: [Case; 13] = [
    Case {
        name: "no heading",
        ignore: &[Input::GnssAttitude],
        spoil: |_, _| {},
        force_max: [1.4, 1.2, 1.1],
        sideslip_max: 0.6,
    },
    Case {
        name: "no GNSS velocity",
        ignore: &[Input::GnssVelocity],
        spoil: |_, _| {},
        force_max: [1.4, 1.2, 1.1],
        sideslip_max: 0.6,
    },
    Case {
        name: "no inertial unit",
        ignore: &[Input::Imu],
        spoil: |_, _| {},
        force_max: [2.4, 1.9, 4.2],
        sideslip_max: 3.0,
    },
    Case {
        name: "no strain",
        ignore: &[Input::Strain],
        spoil: |_, _| {},
        force_max: [15.0, 9.0, 2.5],
        sideslip_max: 0.2,
    },
    Case {
        name: "no deflection",
        ignore: &[Input::Deflection],
        spoil: |_, _| {},
        force_max: [2.5, 2.5, 4.0],
        sideslip_max: 0.2,
    },
    Case {
        name: "motion alone",
        ignore: &[Input::Strain, Input::Deflection],
        spoil: |_, _| {},
        force_max: [25.0, 14.0, 12.0],
        sideslip_max: 0.2,
    },
    Case {
        name: "front strain only",
        ignore: &[],
        spoil: |_, measurement| {
            if let Measurement::Corner(corner) = measurement
                && !corner.wheel.is_front()
            {
                corner.strain_counts = [None; StrainChannel::COUNT];
            }
        },
        force_max: [12.0, 10.0, 3.0],
        sideslip_max: 0.2,
    },
    Case {
        name: "no GNSS at all",
        ignore: &[Input::GnssVelocity, Input::GnssAttitude],
        spoil: |_, _| {},
        force_max: [1.8, 1.5, 0.9],
        sideslip_max: 0.6,
    },
    Case {
        name: "wild heading when slow",
        ignore: &[],
        spoil: |time_s, measurement| {
            if let Measurement::GnssAttitude(gnss) = measurement
                && time_s < WILD_S
            {
                gnss.yaw_rad = gnss.yaw_rad.map(|yaw| yaw + math::sin(700.0 * time_s));
            }
        },
        force_max: [1.3, 1.1, 0.9],
        sideslip_max: 0.2,
    },
    Case {
        name: "two dead gauges",
        ignore: &[],
        spoil: |_, measurement| {
            if let Measurement::Corner(corner) = measurement
                && corner.wheel == Wheel::FrontLeft
            {
                (corner.strain_counts[0], corner.strain_counts[3]) = (None, None);
            }
        },
        force_max: [2.0, 1.8, 1.2],
        sideslip_max: 0.2,
    },
    Case {
        name: "shifted channel",
        ignore: &[],
        spoil: |time_s, measurement| {
            if let Measurement::Corner(corner) = measurement
                && corner.wheel == Wheel::FrontLeft
                && time_s > FAULT_S
            {
                corner.strain_counts[2] = corner.strain_counts[2].map(shifted);
            }
        },
        force_max: [2.0, 1.6, 1.3],
        sideslip_max: 0.2,
    },
    Case {
        name: "frozen potentiometer",
        ignore: &[],
        spoil: |time_s, measurement| {
            if let Measurement::Corner(corner) = measurement
                && corner.wheel == Wheel::FrontLeft
                && time_s > FAULT_S
            {
                corner.deflection_counts = Some(520.into());
            }
        },
        force_max: [2.0, 2.0, 3.0],
        sideslip_max: 0.2,
    },
    Case {
        name: "shifted potentiometer",
        ignore: &[],
        spoil: |time_s, measurement| {
            if let Measurement::Corner(corner) = measurement
                && corner.wheel == Wheel::FrontLeft
                && time_s > FAULT_S
            {
                corner.deflection_counts = corner.deflection_counts.map(shifted);
            }
        },
        force_max: [6.0, 7.0, 10.0],
        sideslip_max: 0.2,
    },
];

/// Largest mean square of the normalised errors of F_x, F_y or F_z, unless a potentiometer misleads
/// until it is named.
const SQUARE_MAX: f64 = 7.0;
/// How long headings are wild, s.
const WILD_S: f64 = 3.0;
/// When faults begin, s.
const FAULT_S: f64 = 8.0;
/// How soon they must be named, s.
const NAMED_WITHIN_S: f64 = 1.2;

#[test]
fn every_subset_gives_forces_and_faults_are_named() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    for name in RUNS {
        let Some(run) = truth::run(name) else { return };
        let samples = run.samples("thesis-10bit", 1);
        for case in &CASES {
            let mut samples: Vec<Sample> = samples.to_vec();
            for sample in &mut samples {
                let time_s = sample.log_time.seconds_since(sensing::START);
                (case.spoil)(time_s, &mut sample.measurement);
            }
            let settings = setting(case.ignore);
            let result = estimate(vehicle, &sensors, &calibration, settings, &samples);
            let force = force_errors(run, vehicle, &result);
            let motion = motion_errors(run, &result);
            let sigma = result.estimates[1200].measured[Wheel::FrontLeft].sigma_n;
            let held = deviations(run, &result);
            let (square, inside, surprise) = (held.axes, held.all.inside, held.surprise);
            eprintln!(
                "{name:15} {:20} {force:.2?} % {motion:.3?} deg, sigma {sigma:.0?} N, NEES \
                 {square:.1?}, {inside:.2} inside, surprise {surprise:.1?}",
                case.name
            );
            for (error, most) in force.iter().zip(case.force_max) {
                assert!(*error <= most, "{name} {}", case.name);
            }
            assert!(motion[0] <= case.sideslip_max, "{name} {}", case.name);
            if !case.name.ends_with("potentiometer") {
                assert!(square.iter().all(|s| *s < SQUARE_MAX), "{square:?}");
            }
            let lift = |event: &Event| matches!(event.kind, EventKind::Lift(_));
            assert!(
                name == "b_circle" || !result.events.iter().any(lift),
                "{name} {}",
                case.name
            );
            let named = result.events.iter().find_map(|event| match &event.kind {
                EventKind::SensorFault(name) => {
                    Some((event.time.seconds_since(sensing::START), name.as_str()))
                }
                _ => None,
            });
            let expected = match case.name {
                "shifted channel" => Some("FL lower_front"),
                "frozen potentiometer" | "shifted potentiometer" => Some("FL deflection"),
                _ => None,
            };
            assert_eq!(
                named.map(|(_, name)| name),
                expected,
                "{name} {}",
                case.name
            );
            if let Some((time_s, _)) = named {
                assert!(time_s - FAULT_S <= NAMED_WITHIN_S, "{time_s}");
            }
        }
    }
}

/// When a fault that heals ends, s, and how soon its channel must be used again, s.
const HEALED_S: f64 = 14.0;
const RECOVERED_WITHIN_S: f64 = 5.0;
/// How much the worst error of a force may stand above that without the fault once the channel is
/// back, N.
const RECOVERED_N: f64 = 2.0;

/// RMS errors of all twelve forces after a fault that has healed, N.
fn late_errors(run: &Run, result: &Estimated) -> [f64; 12] {
    std::array::from_fn(|i| {
        let (wheel, axis) = (Wheel::ALL[i / 3], i % 3);
        let name = format!("{}_{}", wheel.abbreviation(), ["Fx", "Fy", "Fz"][axis]);
        let truth = run.column(&name);
        let first = ((HEALED_S + RECOVERED_WITHIN_S) * RATE_HZ) as usize;
        scoring::rms(result.estimates.iter().filter_map(|estimate| {
            let row = scoring::row(estimate);
            (row > first && row < truth.len())
                .then(|| estimate.measured[wheel].force_n[axis] - truth[row])
        }))
    })
}

/// A shift by 60 counts of one strain channel or of one potentiometer that goes as it came.
#[test]
fn a_channel_that_comes_back_good_is_used_again_and_said_so() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let good = run.samples("thesis-10bit", 1);
    let settings = Settings::default();
    let clean = estimate(vehicle, &sensors, &calibration, settings.clone(), good);
    let clean = late_errors(run, &clean);
    for channel in [Some(StrainChannel::LowerFront), None] {
        let mut samples = good.to_vec();
        for sample in &mut samples {
            let time_s = sample.log_time.seconds_since(sensing::START);
            if let Measurement::Corner(corner) = &mut sample.measurement
                && corner.wheel == Wheel::FrontLeft
                && (FAULT_S..HEALED_S).contains(&time_s)
            {
                let counts = match channel {
                    Some(channel) => &mut corner.strain_counts[channel.index()],
                    None => &mut corner.deflection_counts,
                };
                *counts = counts.map(shifted);
            }
        }
        let result = estimate(vehicle, &sensors, &calibration, settings.clone(), &samples);
        let spoilt = late_errors(run, &result);
        let told: Vec<(f64, &EventKind)> = result
            .events
            .iter()
            .map(|event| (event.time.seconds_since(sensing::START), &event.kind))
            .collect();
        let wheel = Wheel::FrontLeft;
        let name = format!(
            "{wheel} {}",
            channel.map_or("deflection", StrainChannel::name)
        );
        eprintln!("{name}: {told:.2?}; {clean:.1?} {spoilt:.1?} N");
        let [(_, fault), (recovered_s, recovery)] = told[..] else {
            panic!("{told:?}");
        };
        assert_eq!(*fault, EventKind::SensorFault(name.clone()));
        assert_eq!(*recovery, EventKind::SensorRecovered(name));
        let after_s = recovered_s - HEALED_S;
        assert!((0.0..RECOVERED_WITHIN_S).contains(&after_s), "{after_s}");
        for (clean, spoilt) in clean.iter().zip(spoilt) {
            assert!(spoilt < clean + RECOVERED_N, "{clean} {spoilt}");
        }
    }
}

/// The prior of the tyres' stiffness may be wrong by a third, and the steering wheel's zero by two
/// degrees at the road wheels: forces, slip angles and the change of surface stay right.
#[test]
fn a_wrong_tyre_file_and_a_wrong_steering_wheel_are_survived() {
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let truth = truth::vehicle();
    let Some(run) = truth::run("d_sine_mu") else {
        return;
    };
    let samples = run.samples("thesis-10bit", 1);
    let offset_rad = 2.0_f64.to_radians() * truth.steering.ratio;
    for (factor, offset_rad) in [(0.7, 0.0), (1.3, 0.0), (1.0, offset_rad)] {
        let mut vehicle = truth.clone();
        for axle in [&mut vehicle.front, &mut vehicle.rear] {
            axle.tyre.cornering_stiffness_n_rad *= factor;
        }
        let mut samples: Vec<Sample> = samples.to_vec();
        for sample in &mut samples {
            if let Measurement::Steer(steer) = &mut sample.measurement {
                steer.steering_wheel_rad -= offset_rad;
            }
        }
        let calibration = Calibration::nominal(&vehicle.name);
        let settings = Settings::default();
        let result = estimate(&vehicle, &sensors, &calibration, settings, &samples);
        let force = force_errors(run, truth, &result);
        let last = result.estimates.len() - 1;
        let first = &result.estimates[150];
        let first_deg = (first.motion.steer_rad[Wheel::FrontLeft]
            - run.column("FL_steer")[scoring::row(first)])
        .to_degrees();
        let steer_deg: f64 = result.estimates[last / 2..]
            .iter()
            .map(|estimate| {
                let row = scoring::row(estimate).min(run.rows - 1);
                (estimate.motion.steer_rad[Wheel::FrontLeft] - run.column("FL_steer")[row])
                    .to_degrees()
            })
            .sum::<f64>()
            / (last - last / 2 + 1) as f64;
        eprintln!(
            "stiffness x {factor}, steering wheel {offset_rad:.2} rad: {force:.2?} %, steer off by {first_deg:.2} deg, later {steer_deg:.3}"
        );
        for event in &result.events {
            eprintln!(
                "    {:.2} s {}",
                event.time.seconds_since(sensing::START),
                event.text
            );
        }
        assert!(
            force[0] <= 1.6 && force[1] <= 1.6 && force[2] <= 1.5,
            "{force:?}"
        );
        assert!(steer_deg.abs() <= 0.5, "{steer_deg}");
        let change = result.events.iter().find_map(|event| {
            matches!(event.kind, EventKind::SurfaceChange(..))
                .then(|| event.time.seconds_since(sensing::START))
        });
        assert!((24.0..25.0).contains(&change.unwrap()), "{change:?}");
    }
}

/// How late corners' samples may come at most to be of use, s, and the errors (F_x, F_y, F_z, per
/// cent) of those that do and without the others.
const LATE_MAX_S: f64 = 0.1;
const LATE_MAX: [f64; 3] = [1.5, 2.5, 1.5];
const TOO_LATE_MAX: [f64; 3] = [2.6, 3.0, 2.7];

/// Strain and deflection that arrive late tell the force of their own time; too late, nothing.
#[test]
fn late_corners_tell_their_own_time() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let on_time = run.samples("thesis-10bit", 1);
    for late_s in [0.02, 0.05, 0.08, 0.12, 0.9] {
        let mut samples = on_time.to_vec();
        for sample in &mut samples {
            if matches!(sample.measurement, Measurement::Corner(_)) {
                sample.log_time = sample.log_time.offset_seconds(late_s);
            }
        }
        samples.sort_by_key(|sample| sample.log_time);
        let mut result = estimate(vehicle, &sensors, &calibration, setting(&[]), &samples);
        // Readings that are late contradict the vehicle file.
        (result.events).retain(|event| !matches!(event.kind, EventKind::InexactParameters(_)));
        let force = force_errors(run, vehicle, &result);
        eprintln!("{late_s:.2} s late: {force:.2?} %");
        let most = if late_s < LATE_MAX_S {
            LATE_MAX
        } else {
            TOO_LATE_MAX
        };
        for (error, most) in force.iter().zip(most) {
            assert!(*error <= most, "{late_s} s late: {force:?}");
        }
        assert!(result.events.is_empty(), "{:?}", result.events);
    }
}

/// Error of the sum of some tyres' forces along an axis, per cent of the larger of peak and static load, and the
/// mean square of the largest tyre's error over its standard deviation.
fn sum_error(run: &Run, result: &Estimated, wheels: &[Wheel], axis: usize) -> [f64; 2] {
    let vehicle = truth::vehicle();
    let truths: Vec<&[f64]> = (wheels.iter())
        .map(|w| {
            run.column(&format!(
                "{}_{}",
                w.abbreviation(),
                ["Fx", "Fy", "Fz"][axis]
            ))
        })
        .collect();
    let mut peak: f64 = wheels.iter().map(|w| vehicle.static_load_n(*w)).sum();
    let (mut square, mut count) = (0.0, 0.0);
    let mut squares = vec![0.0; wheels.len()];
    for estimate in &result.estimates {
        let row = scoring::row(estimate);
        if !(600..run.rows).contains(&row) {
            continue;
        }
        count += 1.0;
        let mut error = 0.0;
        for ((wheel, truth), square) in wheels.iter().zip(&truths).zip(&mut squares) {
            let force = &estimate.measured[*wheel];
            let own = force.force_n[axis] - truth[row];
            error += own;
            *square += (own / force.sigma_n[axis]).powi(2);
        }
        square += error * error;
        peak = peak.max(truths.iter().map(|truth| truth[row]).sum::<f64>().abs());
    }
    let largest = squares.into_iter().fold(0.0, f64::max);
    [100.0 * f64::sqrt(square / count) / peak, largest / count]
}

/// The forces of an axle with strain gauges do not need the linkage of the other axle, and those of the other
/// axle have standard deviations that hold.
#[test]
fn an_axle_with_gauges_has_forces_whatever_the_other_axle_has() {
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&truth::vehicle().name);
    let front = [Wheel::FrontLeft, Wheel::FrontRight];
    let rear = [Wheel::RearLeft, Wheel::RearRight];
    for (gauged, other) in [(front, rear), (rear, front)] {
        let mut vehicle = truth::vehicle().clone();
        let axle = match other[0].is_front() {
            true => &mut vehicle.front,
            false => &mut vehicle.rear,
        };
        axle.wishbone = None;
        axle.strut.as_mut().unwrap().motion_ratio = Some(0.4);
        for name in RUNS {
            let run = truth::excerpt(name);
            let samples = run.samples("thesis-10bit", 11);
            let mut one_axle = samples.to_vec();
            for sample in &mut one_axle {
                if let Measurement::Corner(corner) = &mut sample.measurement
                    && other.contains(&corner.wheel)
                {
                    corner.strain_counts = [None; StrainChannel::COUNT];
                }
            }
            let settings = Settings::default;
            let known = truth::vehicle();
            let whole = estimate(known, &sensors, &calibration, settings(), &one_axle);
            // The strain of the other axle is still sent: without its linkage, nobody can use it.
            let half = estimate(&vehicle, &sensors, &calibration, settings(), samples);
            for axis in 0..3 {
                for wheel in gauged {
                    let [with, without] =
                        [&whole, &half].map(|result| sum_error(run, result, &[wheel], axis)[0]);
                    println!("{name} {wheel}, axis {axis}: {with:.2} and {without:.2} %");
                    assert!(
                        without < 1.6 * with,
                        "{name} {wheel} {axis}: {with} {without}"
                    );
                }
                let [error, squares] = sum_error(run, &half, &other, axis);
                println!("{name} {other:?}, axis {axis}: {error:.2} %, mean square {squares:.2}");
                let largest = if name == "b_circle" {
                    [5.0, 3.0, 5.5]
                } else {
                    [3.5, 2.0, 1.0]
                };
                assert!(error < largest[axis], "{name} {axis}: {error}");
                assert!(squares < 4.0, "{name} {axis}: {squares}");
            }
        }
    }
}
