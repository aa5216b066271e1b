//! Random faults on rough ground: the rules of level ground hold, most of the faults that last are found, and
//! few devices without a fault are excluded meanwhile.

use std::collections::BTreeMap;

use super::{Ground, Outcome, campaign, judge_all};
use crate::fault::{Channel, Fault, Kind};
use testkit::truth;

/// Drives of the bounded campaign and of the whole one.
const BOUNDED: u64 = 6;
const WHOLE: u64 = 1000;
const ROUGH: Ground = Ground {
    runs: &[
        "r1_iso_c_a",
        "r2_iso_e_a",
        "r3_rocks_a",
        "r5_crossaxle_a",
        "r8_trail_a",
    ],
    run: truth::rough_run,
    drive_s: 20.0,
    faults_s: [3.0, 13.0],
    recovered_s: 17.0,
    // The load without hub accelerometers is 8.4 % of its peak on class E without any fault.
    late: [15.0, 1.0],
    in_carrier: true,
};
/// A fault is to be found within this time, s, if it lasts as long.
const FOUND_S: f64 = 5.0;
/// Least part of the lasting faults that are found in this time. A steering wheel that is frozen on a
/// straight way is right.
const FOUND_MIN: f64 = 0.85;
/// Most exclusions of devices without a fault, as a part of the drives, all of which have faults.
const HEALTHY_MAX: f64 = 0.08;
/// An exclusion belongs to a fault until this time after its end, s.
const AFTER_FAULT_S: f64 = 2.0;

#[test]
fn a_few_drives_with_random_faults_on_rough_ground_do_not_diverge() {
    let Some(outcomes) = campaign(&ROUGH, &Vec::from_iter(0..BOUNDED)) else {
        return;
    };
    judge_all(&outcomes);
    judge_exclusions(&outcomes);
}

/// Drives with a potentiometer that leaps by more than a strut moves in a step: taken for a strut on its stop, it
/// gave loads of 42 kN, and the other potentiometer of the axle was excluded.
#[test]
fn potentiometers_that_leap_are_survived() {
    let Some(outcomes) = campaign(&ROUGH, &[939, 959]) else {
        return;
    };
    assert!(outcomes.iter().all(|outcome| !outcome.late));
    judge_all(&outcomes);
}

/// A strain channel that leaps while the configuration is still weighed: taken for a gain that was wrong from the
/// beginning, of another channel of the corner, it gave a load of 34 kN.
#[test]
fn a_fault_that_begins_is_no_mistake_of_the_configuration() {
    let Some(outcomes) = campaign(&ROUGH, &[132]) else {
        return;
    };
    judge_all(&outcomes);
    let is_blamed = |(_, name): &&(f64, String)| name.starts_with("FL lower_rear");
    assert!(
        outcomes[0]
            .excluded
            .iter()
            .any(|excluded| is_blamed(&excluded))
    );
}

/// Spikes of one wheel speed, taken for a wrong unit, made the wheels nine times as quick and gave a force of 848 kN; the
/// swapped velocities of a receiver gave another unit of its attitude.
#[test]
fn a_faulty_speed_is_no_wrong_unit() {
    let Some(outcomes) = campaign(&ROUGH, &[334, 436, 447, 531]) else {
        return;
    };
    judge_all(&outcomes);
    assert!(outcomes.iter().all(|outcome| !outcome.late));
}

/// Steering wheels and angles of the receiver that are frozen or dead while they are right: only their missing noise
/// shows it.
#[test]
fn sensors_without_their_noise_are_found() {
    let Some(outcomes) = campaign(&ROUGH, &[221, 243, 320, 631]) else {
        return;
    };
    for outcome in &outcomes {
        let is_silent = |fault: &&Fault| {
            let of = matches!(fault.channel, Channel::SteeringWheel | Channel::Angle(_));
            of && matches!(fault.kind, Kind::Frozen | Kind::Dead) && is_lasting(fault)
        };
        let silent = outcome.faults.iter().filter(is_silent);
        assert!(silent.clone().count() > 0, "drive {}", outcome.seed);
        for fault in silent {
            assert!(
                is_found(fault, outcome),
                "drive {}: {fault:?}",
                outcome.seed
            );
        }
    }
    judge_all(&outcomes);
}

#[test]
#[ignore = "a campaign of minutes: `make campaigns`"]
fn a_thousand_drives_with_random_faults_on_rough_ground_do_not_diverge() {
    let Some(outcomes) = campaign(&ROUGH, &Vec::from_iter(0..WHOLE)) else {
        return;
    };
    judge_exclusions(&outcomes);
    judge_all(&outcomes);
}

/// A device: a fault of one of its channels may make another of its channels the one that contradicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Device {
    Corner(usize),
    InertialUnit,
    Receiver,
    SteeringWheel,
    WheelSpeeds,
}

impl Device {
    fn of(channel: Channel) -> Self {
        match channel {
            Channel::Strain(wheel, _) | Channel::Potentiometer(wheel) => {
                Self::Corner(wheel.index())
            }
            Channel::SpecificForce(_) | Channel::Rate(_) => Self::InertialUnit,
            Channel::Velocity(_) | Channel::Angle(_) => Self::Receiver,
            Channel::SteeringWheel => Self::SteeringWheel,
            Channel::WheelSpeed(_) => Self::WheelSpeeds,
        }
    }

    /// Of the name in an event.
    fn named(name: &str) -> Self {
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        if has(&["steering"]) {
            Self::SteeringWheel
        } else if has(&["speed"]) {
            Self::WheelSpeeds
        } else if has(&["GNSS", "gnss", "heading", "attitude", "velocity"]) {
            Self::Receiver
        } else if let Some(wheel) = ["FL", "FR", "RL", "RR"]
            .iter()
            .position(|wheel| name.starts_with(wheel))
        {
            Self::Corner(wheel)
        } else {
            Self::InertialUnit
        }
    }
}

/// Whether an exclusion is of a device with a fault at its time.
fn is_of(fault: &Fault, at_s: f64, name: &str) -> bool {
    let span_s = fault.span_s.start..fault.span_s.end + AFTER_FAULT_S;
    Device::of(fault.channel) == Device::named(name) && span_s.contains(&at_s)
}

/// A channel that stays wrong by more than rough ground can hide. What is delayed or exchanged for a
/// neighbour may agree with the others, and readings that are missing are no reason for an exclusion.
fn is_lasting(fault: &Fault) -> bool {
    let certain = match fault.kind {
        Kind::Frozen | Kind::Dead | Kind::Saturated(_) => true,
        Kind::Shifted(part) => part.abs() > 0.1,
        _ => false,
    };
    certain && fault.span_s.end - fault.span_s.start >= FOUND_S
}

/// Whether an exclusion of its device came in time.
fn is_found(fault: &Fault, outcome: &Outcome) -> bool {
    let begin_s = fault.span_s.start;
    let in_time = begin_s..begin_s + FOUND_S;
    let mut excluded = outcome.excluded.iter();
    excluded.any(|(at_s, name)| in_time.contains(at_s) && is_of(fault, *at_s, name))
}

fn judge_exclusions(outcomes: &[Outcome]) {
    let mut healthy = Vec::new();
    // Found and all, by channel and kind.
    let mut kinds: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    let mut all = [0; 2];
    for outcome in outcomes {
        for (at_s, name) in &outcome.excluded {
            if !outcome.faults.iter().any(|fault| is_of(fault, *at_s, name)) {
                healthy.push(format!("{name} at {at_s:.1} s"));
            }
        }
        for fault in outcome.faults.iter().filter(|fault| is_lasting(fault)) {
            let found = is_found(fault, outcome);
            if !found {
                eprintln!(
                    "not found, drive {}: {fault:.1?} of {:.1?}",
                    outcome.seed, outcome.faults
                );
            }
            let text = format!("{:?} {:?}", fault.channel, fault.kind);
            let key = text.split(['(', ' ']).next().unwrap_or_default().to_owned();
            let kind = format!("{:?}", fault.kind);
            let kind = kind.split('(').next().unwrap_or_default();
            for counts in [kinds.entry(format!("{key} {kind}")).or_default(), &mut all] {
                counts[0] += usize::from(found);
                counts[1] += 1;
            }
        }
    }
    let [found, lasting] = all;
    eprintln!(
        "{} drives on rough ground: {found} of {lasting} lasting faults found within {FOUND_S} s; {} \
         exclusions of devices without a fault: {healthy:?}",
        outcomes.len(),
        healthy.len(),
    );
    for (kind, [found, lasting]) in &kinds {
        eprintln!("    {kind}: {found} of {lasting}");
    }
    assert!(
        found as f64 >= FOUND_MIN * lasting as f64,
        "{found} of {lasting}"
    );
    assert!(
        healthy.len() as f64 <= HEALTHY_MAX * outcomes.len() as f64,
        "{healthy:?}"
    );
}
