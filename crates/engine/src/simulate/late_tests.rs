//! Late bytes: jitter and stalls between a virtual vehicle and the engine, judged by the truth.

use std::collections::BTreeMap;
use std::path::PathBuf;

use sample::{EventKind, ForceFrame, LogTime, PerWheel, TyreForce, Wheel};
use sim::{Output, Port};
use store::{Record, Stage};

use super::drives::of_prowler;
use super::*;
use crate::FileSource;
use crate::virtual_drive::{Course, Drive};

/// What is between the devices and the recorder.
#[derive(Clone, Copy, Debug)]
enum Delay {
    /// Nothing.
    None,
    /// What a port sends within 10 ms is late by a random time up to this, s, and arrives behind what it
    /// sent before.
    Jitter(&'static [Port], f64),
    /// Each port stalls by itself: on average every `every_s`, for 20 ms to `longest_s`.
    Overload { every_s: f64, longest_s: f64 },
    /// Every `every_s`, for the first time after it, nothing of these ports arrives for `for_s`.
    Stall {
        ports: &'static [Port],
        every_s: f64,
        for_s: f64,
    },
}

/// Clock of the frames.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stamps {
    None,
    /// Of the kernel, to the nanosecond.
    Kernel,
    /// Of an SLCAN adapter, to the millisecond below.
    Adapter,
}

const ALL: &[Port] = &Port::ALL;

/// What a drive gave.
struct Outcome {
    /// 100 RMS / max(peak, static load) of F_x, F_y, F_z, worst wheel: causal and lagged.
    errors: [[f64; 3]; 2],
    faults: Vec<String>,
    /// Messages that were late, and that were too late.
    late: [u64; 2],
}

fn drive(truth: Option<&str>, sensors: &str, seed: u64, seconds: f64) -> Drive {
    let course = match truth {
        Some(path) => Course::Truth(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)),
        None => Course::Manoeuvre("mixed-driving".to_owned()),
    };
    Drive {
        course,
        seed,
        duration_s: Some(seconds),
        ..of_prowler("mixed-driving", sensors)
    }
}

/// What arrives at the recorder: time, s, source and data.
type Arrivals = Vec<(f64, SourceId, Payload)>;

fn arrivals(
    simulated: &mut VirtualDrive,
    config: &Config,
    delay: Delay,
    stamps: Stamps,
) -> Arrivals {
    let (start, duration_s) = (simulated.start(), simulated.duration_s());
    let ticks = 0..(duration_s * 10.0) as usize;
    let mut arrivals: Arrivals = ticks
        .map(|tick| (tick as f64 * 0.1, SourceId::HOST, Payload::Tick))
        .collect();
    let mut late = Late {
        delay,
        random: math::Random::new(7),
        cycles: BTreeMap::new(),
        stalls: BTreeMap::new(),
        last: BTreeMap::new(),
    };
    for emission in simulated.vehicle.by_ref() {
        let sent_s = emission.time_s;
        if sent_s > duration_s {
            break;
        }
        let mut sources = config.sources.iter();
        let Some(source) = sources.find(|source| source.spec.name == emission.port.name()) else {
            continue;
        };
        let payload = match emission.output {
            Output::Bytes(bytes) => Payload::Bytes(bytes),
            Output::Can(mut frame) => {
                let sent = start.offset_seconds(sent_s);
                match stamps {
                    Stamps::None => {}
                    Stamps::Kernel => frame.kernel_ns = Some(sent.0.cast_signed()),
                    Stamps::Adapter => {
                        frame.hardware_ns = Some((sent_s * 1e3).floor() as i64 * 1_000_000);
                    }
                }
                Payload::Can(vec![frame])
            }
        };
        arrivals.push((
            late.arrival_s(emission.port, sent_s),
            source.spec.id,
            payload,
        ));
    }
    arrivals.sort_by(|a, b| a.0.total_cmp(&b.0));
    arrivals
}

/// What is between the ports and the recorder.
struct Late {
    delay: Delay,
    random: math::Random,
    /// Number of the last 10 ms of each port, and their delay, s.
    cycles: BTreeMap<Port, (u64, f64)>,
    /// Begin and end of the present or next stall of each port, s.
    stalls: BTreeMap<Port, [f64; 2]>,
    /// Last arrival of each port, s.
    last: BTreeMap<Port, f64>,
}

impl Late {
    fn arrival_s(&mut self, port: Port, sent_s: f64) -> f64 {
        let arrived_s = match self.delay {
            Delay::Jitter(ports, most_s) if ports.contains(&port) => {
                let cycle = (sent_s * 100.0) as u64;
                let known = self.cycles.entry(port).or_insert((u64::MAX, 0.0));
                if known.0 != cycle {
                    *known = (cycle, self.random.between(0.0, most_s));
                }
                sent_s + known.1
            }
            Delay::Overload { every_s, longest_s } => {
                let random = &mut self.random;
                let mut after = |end_s: f64| {
                    let begin_s = end_s + random.between(0.0, 2.0 * every_s);
                    [begin_s, begin_s + random.between(0.02, longest_s)]
                };
                let stall = self.stalls.entry(port).or_insert_with(|| after(2.0));
                while stall[1] < sent_s {
                    *stall = after(stall[1]);
                }
                if stall[0] <= sent_s { stall[1] } else { sent_s }
            }
            Delay::Stall {
                ports,
                every_s,
                for_s,
            } if ports.contains(&port) && sent_s % every_s < for_s && sent_s >= every_s => {
                sent_s - sent_s % every_s + for_s
            }
            _ => sent_s,
        };
        let behind = self.last.entry(port).or_insert(0.0);
        *behind = behind.max(arrived_s);
        *behind
    }
}

fn run(drive: &Drive, delay: Delay, stamps: Stamps) -> Outcome {
    let mut simulated = VirtualDrive::new(drive).expect("a drive");
    let config = simulated.config().expect("a configuration");
    let arrivals = arrivals(&mut simulated, &config, delay, stamps);
    estimate(&simulated, &config, arrivals)
}

fn estimate(simulated: &VirtualDrive, config: &Config, arrivals: Arrivals) -> Outcome {
    let start = simulated.start();
    let mut feed = Feed::new(config).expect("an engine");
    let mut found = [BTreeMap::new(), BTreeMap::new()];
    let (mut faults, mut late) = (Vec::new(), [0, 0]);
    let mut sink = |entry| {
        match entry {
            Entry::Record(Record::Estimate(estimate)) => {
                found[0].insert(estimate.time, estimate.carrier);
            }
            Entry::Record(Record::TyreForces {
                time,
                stage: Stage::Lagged,
                frame: ForceFrame::WheelCarrier,
                forces,
            }) => {
                found[1].insert(time, *forces);
            }
            Entry::Record(Record::Event(event)) => {
                if let EventKind::SensorFault(name) = event.kind {
                    faults.push(format!("{name} at {:.2}", event.time.seconds_since(start)));
                }
            }
            Entry::Record(Record::Health(health)) => {
                let sources = &health.sources;
                late = [
                    sources.iter().map(|source| source.late).sum(),
                    sources.iter().map(|source| source.too_late).sum(),
                ];
            }
            _ => {}
        }
        Ok::<_, Error>(())
    };
    for (time_s, source, payload) in arrivals {
        feed.push(source, start.offset_seconds(time_s), payload, &mut sink)
            .expect("an engine");
    }
    let errors = found.map(|found| errors(simulated, start, &found));
    Outcome {
        errors,
        faults,
        late,
    }
}

fn errors(
    simulated: &VirtualDrive,
    start: LogTime,
    found: &BTreeMap<LogTime, PerWheel<TyreForce>>,
) -> [f64; 3] {
    let mut squares = [[0.0; 3]; 4];
    let mut peaks = [[1000.0_f64; 3]; 4];
    let mut count = 0.0;
    for (time, forces) in found {
        let time_s = time.seconds_since(start);
        if !(3.0..simulated.duration_s() - 0.5).contains(&time_s) {
            continue;
        }
        let Record::Truth(instant) = simulated.truth(time_s) else {
            continue;
        };
        let Some(truth) = instant.carrier else {
            continue;
        };
        count += 1.0;
        for wheel in Wheel::ALL {
            for axis in 0..3 {
                let truth = truth[wheel].force_n[axis];
                let error = forces[wheel].force_n[axis] - truth;
                squares[wheel.index()][axis] += error * error;
                let peak = &mut peaks[wheel.index()][axis];
                *peak = peak.max(truth.abs());
            }
        }
    }
    std::array::from_fn(|axis| {
        (0..4)
            .map(|wheel| 100.0 * (squares[wheel][axis] / count).sqrt() / peaks[wheel][axis])
            .fold(0.0, f64::max)
    })
}

fn stall(ports: &'static [Port], for_s: f64) -> Delay {
    Delay::Stall {
        ports,
        every_s: 2.0,
        for_s,
    }
}

/// The estimates are as if the messages of GNSS that are later than 100 ms had been lost.
#[test]
fn messages_of_gnss_that_are_later_are_not_used() {
    let level = drive(None, "thesis-10bit", 11, 14.0);
    let arrivals_with = |delay| {
        let mut simulated = VirtualDrive::new(&level).expect("a drive");
        let config = simulated.config().expect("a configuration");
        let arrivals = arrivals(&mut simulated, &config, delay, Stamps::Kernel);
        (simulated, config, arrivals)
    };
    let (_, _, prompt) = arrivals_with(Delay::None);
    let (simulated, config, late) = arrivals_with(stall(&[Port::Novatel], 0.273));
    // The order within a source stays.
    let mut due: BTreeMap<SourceId, std::collections::VecDeque<f64>> = BTreeMap::new();
    for (time_s, source, _) in &prompt {
        due.entry(*source).or_default().push_back(*time_s);
    }
    let mut is_in_time = |(time_s, source, _): &(f64, SourceId, Payload)| {
        let due_s = due.get_mut(source).and_then(|due| due.pop_front());
        time_s - due_s.expect("the same arrivals") <= 0.1
    };
    let lost: Arrivals = late
        .iter()
        .filter(|arrival| is_in_time(arrival))
        .cloned()
        .collect();
    let late = estimate(&simulated, &config, late);
    let lost = estimate(&simulated, &config, lost);
    println!("{:?} {:?}", late.late, late.errors);
    assert!(late.late[1] > 20, "{:?}", late.late);
    assert_eq!(late.errors, lost.errors);
    assert_ne!(late.errors, estimate(&simulated, &config, prompt).errors);
}

/// Runs a drive with some seeds of the sensors' noise.
fn run_all(drive: &Drive, seeds: &[u64], delay: Delay, stamps: Stamps) -> Outcome {
    let mut outcome = Outcome {
        errors: [[0.0; 3]; 2],
        faults: Vec::new(),
        late: [0; 2],
    };
    for &seed in seeds {
        let drive = Drive {
            seed,
            ..drive.clone()
        };
        let found = run(&drive, delay, stamps);
        for (sum, error) in outcome.errors.iter_mut().zip(found.errors) {
            for (sum, error) in sum.iter_mut().zip(error) {
                *sum = (*sum * *sum + error * error / seeds.len() as f64).sqrt();
            }
        }
        outcome.faults.extend(found.faults);
        for (sum, late) in outcome.late.iter_mut().zip(found.late) {
            *sum += late;
        }
    }
    outcome
}

/// Runs a drive with each delay and prints by how much the errors are larger. Those of the lagged forces
/// may be larger by `most_percent`.
fn assert_lagged(
    drive: &Drive,
    seeds: &[u64],
    stamps: Stamps,
    delays: &[Delay],
    most_percent: f64,
) {
    let without = run_all(drive, seeds, Delay::None, stamps);
    for delay in delays {
        let with = run_all(drive, seeds, *delay, stamps);
        let larger = [0, 1].map(|output| {
            [0, 1, 2].map(|axis| {
                100.0 * (with.errors[output][axis] / without.errors[output][axis] - 1.0)
            })
        });
        println!(
            "{stamps:?}, {delay:?}: causal {:.2?} %, {:+.1?} % larger; lagged {:.2?} %, {:+.1?} % larger; \
             late {:?}",
            with.errors[0], larger[0], with.errors[1], larger[1], with.late
        );
        let worst = larger[1].into_iter().fold(0.0, f64::max);
        assert!(worst <= most_percent, "{delay:?}: {worst} % larger");
        assert!(with.late[0] > 0 && with.late[1] == 0, "{:?}", with.late);
        assert_eq!(with.faults, without.faults, "late data is no fault");
    }
}

const TRAIL: Option<&str> = Some("../../testdata/truth/r8_trail_a.parquet");

/// Channels with other rates than the estimates: the readings of a step are averaged, and the noise of the mean
/// is smaller. A CAN bus of 1 Mbit/s carries the eight messages of the corners at 500 Hz, not at 1 kHz.
#[test]
fn channels_with_a_higher_rate_reduce_the_errors() {
    let text = include_str!("../../../model/sensors/thesis-10bit.toml");
    let directory = tempfile::tempdir().expect("a directory");
    let at_rate = |rate_hz: f64| {
        let path = directory.path().join(format!("strain-{rate_hz}.toml"));
        let text = text
            .replacen("rate_hz = 100.0", &format!("rate_hz = {rate_hz:.1}"), 1)
            .replace("bit_rate = 500000", "bit_rate = 1000000");
        std::fs::write(&path, text).expect("a sensors file");
        let sensors = path.to_str().expect("a path");
        let outcome = run(
            &drive(TRAIL, sensors, 11, 20.0),
            Delay::None,
            Stamps::Kernel,
        );
        println!("{rate_hz} Hz: {:.2?}", outcome.errors);
        assert_eq!(outcome.faults, Vec::<String>::new());
        outcome.errors[1]
    };
    let [slow, quick] = [100.0, 500.0].map(at_rate);
    for (axis, most) in [0.93, 0.9, 1.08].into_iter().enumerate() {
        assert!(quick[axis] < most * slow[axis], "{slow:?} {quick:?}");
    }
}

/// Forces of a vehicle of `testdata` with the channels of its members: largest errors on a level road and on a rough
/// one.
fn assert_forces(file: &str, largest: [[f64; 3]; 2]) {
    let vehicle = format!("{}/../../testdata/{file}", env!("CARGO_MANIFEST_DIR"));
    let drives = [("slow-sine", 20.0), ("rough-road", 15.0)];
    for ((manoeuvre, seconds), largest) in drives.into_iter().zip(largest) {
        let drive = Drive {
            vehicle: FileSource::Path(vehicle.clone().into()),
            duration_s: Some(seconds),
            ..of_prowler(manoeuvre, "thesis-10bit")
        };
        let outcome = run(&drive, Delay::None, Stamps::Kernel);
        println!("{file}, {manoeuvre}: {:.2?}", outcome.errors);
        assert_eq!(outcome.faults, Vec::<String>::new());
        for axis in 0..3 {
            assert!(
                outcome.errors[1][axis] < largest[axis],
                "{:?}",
                outcome.errors
            );
        }
    }
}

/// MacPherson struts in the place of double wishbones: their bending and axial bridges give the forces.
#[test]
fn a_vehicle_with_struts_has_forces() {
    assert_forces(
        "vehicle-with-struts.toml",
        [[1.35, 1.25, 0.2], [4.0, 2.3, 2.3]],
    );
}

/// Five links at both axles: the axial bridges of the links give the forces.
#[test]
fn a_vehicle_on_five_links_has_forces() {
    assert_forces(
        "vehicle-with-links.toml",
        [[1.1, 0.8, 0.2], [4.5, 2.6, 2.7]],
    );
}

/// Semi-trailing arms at the rear: the forces in their bushings are measured.
#[test]
fn a_vehicle_on_trailing_arms_has_forces() {
    assert_forces(
        "vehicle-with-trailing-arms.toml",
        [[1.4, 0.9, 0.25], [5.3, 2.5, 2.8]],
    );
}

/// Errors of the lagged forces with data that is late by at most 15 ms may be 1 % larger, and 4 % with the stamps of an
/// adapter, which are whole milliseconds.
#[test]
fn lagged_forces_are_as_good_if_data_is_late_by_15_ms() {
    let delays = [Delay::Jitter(ALL, 0.015), stall(ALL, 0.015)];
    for (stamps, most_percent) in [(Stamps::Kernel, 1.0), (Stamps::Adapter, 4.0)] {
        let rough = drive(TRAIL, "full-bridge-16bit", 11, 20.0);
        assert_lagged(&rough, &[11, 12, 13, 14], stamps, &delays, most_percent);
        let level = drive(None, "thesis-10bit", 11, 20.0);
        assert_lagged(&level, &[11], stamps, &delays, most_percent);
    }
}

/// Before the rate of the steering wheel's line is known, its late readings come with one time.
#[test]
fn stalls_from_the_start_are_no_fault() {
    let turning = Drive {
        course: Course::Manoeuvre("slow-sine".to_owned()),
        ..drive(None, "thesis-10bit", 3, 20.0)
    };
    for (every_s, for_s) in [(0.6, 0.053), (0.1, 0.06), (0.33, 0.19)] {
        let delay = Delay::Stall {
            ports: ALL,
            every_s,
            for_s,
        };
        let found = run(&turning, delay, Stamps::Adapter);
        println!("{delay:?}: {:.2?} {:?}", found.errors, found.late);
        assert_eq!(found.faults, Vec::<String>::new(), "{delay:?}");
    }
}

/// On an overloaded machine, the programs of the ports stall by themselves. Messages that are later than
/// 100 ms are missing, and make no sensor faulty.
#[test]
fn messages_that_are_missing_for_lateness_are_no_fault() {
    for (every_s, longest_s) in [(2.0, 0.25), (1.0, 0.3)] {
        for seed in [11, 12] {
            let delay = Delay::Overload { every_s, longest_s };
            let level = drive(None, "thesis-10bit", seed, 60.0);
            let found = run(&level, delay, Stamps::Kernel);
            println!("{delay:?} {seed}: {:.2?} {:?}", found.errors, found.late);
            assert_eq!(found.faults, Vec::<String>::new(), "{delay:?}, seed {seed}");
            assert!(found.late[1] > 1000, "{:?}", found.late);
        }
    }
}

/// With data that is late by up to 100 ms, they may be 10 % larger. The gaps of 36 and 53 ms are those
/// that once gave a false fault.
#[test]
fn lagged_forces_are_nearly_as_good_if_data_is_late_by_100_ms() {
    let delays = [
        stall(ALL, 0.036),
        stall(ALL, 0.053),
        stall(&[Port::Can0], 0.0995),
        stall(ALL, 0.0995),
    ];
    for stamps in [Stamps::Kernel, Stamps::Adapter, Stamps::None] {
        let rough = drive(TRAIL, "full-bridge-16bit", 11, 20.0);
        assert_lagged(&rough, &[11], stamps, &delays, 10.0);
    }
}

/// A stall of the whole computer is no fault, however long. Data of a single bus is not used if it is later
/// than 100 ms.
#[test]
fn data_that_is_later_is_counted_and_not_used() {
    let rough = drive(TRAIL, "full-bridge-16bit", 11, 20.0);
    assert_lagged(&rough, &[11], Stamps::Kernel, &[stall(ALL, 0.25)], 10.0);
    let level = drive(None, "thesis-10bit", 11, 14.0);
    assert_lagged(&level, &[11], Stamps::Adapter, &[stall(ALL, 0.25)], 10.0);
    let found = run(&level, stall(&[Port::Can0], 0.15), Stamps::Kernel);
    println!("{:.2?} {:?}", found.errors, found.late);
    assert!(found.late[1] > 100, "{:?}", found.late);
    assert_eq!(found.faults, Vec::<String>::new());
    assert!(
        found.errors[1].iter().all(|error| *error < 2.0),
        "{:?}",
        found.errors
    );
}
