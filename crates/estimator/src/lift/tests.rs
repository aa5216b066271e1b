//! Warnings and lifts of made loads.

use super::*;

/// Static load of each wheel, N.
const STATIC_N: f64 = 1500.0;
/// Standard deviation of the loads, as a part of the static load: that of 10-bit sensors on level ground.
const SIGMA: f64 = 0.01;
const DT_S: f64 = 0.01;
/// Loads as parts of the static load, of the front left wheel, of the rear left wheel and of the others.
type Loads = [f64; 3];

/// The events, with their times, of loads over `[0, end_s)`.
fn events(end_s: f64, rough: bool, loads: impl Fn(f64) -> Loads) -> Vec<(f64, EventKind)> {
    noisy_events(SIGMA, end_s, rough, loads)
}

/// The same with a standard deviation of the loads, as a part of the static load.
fn noisy_events(
    sigma: f64,
    end_s: f64,
    rough: bool,
    loads: impl Fn(f64) -> Loads,
) -> Vec<(f64, EventKind)> {
    let static_n = PerWheel([STATIC_N; 4]);
    let mut detector = LiftDetector::new(static_n, &LiftTuning::default());
    let mut random = math::Random::new(11);
    let start = LogTime(1_000_000_000);
    let mut found = Vec::new();
    let steps = (end_s / DT_S) as u32;
    for k in 0..steps {
        let at_s = f64::from(k) * DT_S;
        let [front, rear, others] = loads(at_s);
        let forces = PerWheel([front, others, rear, others].map(|part| TyreForce {
            force_n: [0.0, 0.0, STATIC_N * (part + sigma * random.normal())],
            sigma_n: [STATIC_N * sigma; 3],
            ..TyreForce::default()
        }));
        let input = LiftInput {
            now: start.offset_seconds(at_s),
            dt: DT_S,
            judged: true,
            rough,
            forces: &forces,
            lagged: None,
            lag_s: 0.0,
        };
        detector.step(&input, &mut |event| found.push((at_s, event.kind)));
    }
    found
}

fn warnings(found: &[(f64, EventKind)]) -> Vec<(f64, EventKind)> {
    let is_warning = |kind: &EventKind| {
        matches!(
            kind,
            EventKind::LiftWarning(..) | EventKind::TwoWheelLiftWarning(..)
        )
    };
    let found = found.iter().filter(|(_, kind)| is_warning(kind));
    found.cloned().collect()
}

/// A load that falls from 1 at `from_s` and takes `fall_s` from a quarter to 2 %.
fn falling(at_s: f64, from_s: f64, fall_s: f64) -> f64 {
    (1.0 - 0.23 / fall_s * (at_s - from_s).max(0.0)).clamp(0.0, 1.0)
}

/// When that load is 2 %, s.
fn lift_s(from_s: f64, fall_s: f64) -> f64 {
    from_s + 0.98 * fall_s / 0.23
}

#[test]
fn lifts_that_take_longer_than_three_tenths_of_a_second_are_warned_of_in_time() {
    for fall_s in [0.35, 0.5, 1.0, 2.0, 5.0] {
        let lift_s = lift_s(2.0, fall_s);
        let found = events(lift_s + 1.0, false, |t| [falling(t, 2.0, fall_s), 1.0, 1.0]);
        let [(warned_s, EventKind::LiftWarning(Wheel::FrontLeft, told_s))] = warnings(&found)[..]
        else {
            panic!("{fall_s} s: {found:?}");
        };
        let lead_s = lift_s - warned_s;
        let due_s = (0.7 * fall_s).min(1.0);
        assert!((due_s..fall_s).contains(&lead_s), "{fall_s} s: {lead_s}");
        // The time that the warning tells.
        assert!((told_s - lead_s).abs() < 0.5 * lead_s, "{told_s} {lead_s}");
        let is_lift = |(_, kind): &(f64, EventKind)| *kind == EventKind::Lift(Wheel::FrontLeft);
        assert!(found.iter().any(is_lift), "{found:?}");
    }
}

/// In a rollover the front wheel is up long before the rear wheel of its side.
#[test]
fn the_second_wheel_and_the_side_are_warned_of_in_time() {
    let [first_s, second_s] = [lift_s(2.0, 2.0), lift_s(12.0, 1.0)];
    let found = events(18.0, false, |t| {
        [falling(t, 2.0, 2.0), falling(t, 12.0, 1.0), 1.3]
    });
    let leads: Vec<_> = warnings(&found)
        .into_iter()
        .map(|(at_s, kind)| match kind {
            EventKind::LiftWarning(wheel, _) => (Some(wheel), at_s),
            _ => (None, at_s),
        })
        .collect();
    let lead_s = |of: Option<Wheel>, lift_s: f64| {
        let [(_, at_s)] = leads
            .iter()
            .filter(|found| found.0 == of)
            .collect::<Vec<_>>()[..]
        else {
            panic!("{leads:?}");
        };
        lift_s - at_s
    };
    assert!(
        (1.0..2.5).contains(&lead_s(Some(Wheel::FrontLeft), first_s)),
        "{leads:?}"
    );
    assert!(
        (0.7..2.0).contains(&lead_s(Some(Wheel::RearLeft), second_s)),
        "{leads:?}"
    );
    assert!((0.7..2.0).contains(&lead_s(None, second_s)), "{leads:?}");
}

/// A side that hangs in balance is warned of although its load does not fall.
#[test]
fn a_steady_light_load_is_warned_of_once() {
    let found = events(20.0, false, |t| {
        let part = (1.0 - 0.2 * (t - 2.0).max(0.0)).max(0.15);
        [0.5, part, 1.3]
    });
    let found = warnings(&found);
    assert_eq!(found.len(), 1, "{found:?}");
    let found = events(20.0, false, |t| {
        let part = (1.0 - 0.2 * (t - 2.0).max(0.0)).max(0.25);
        [0.5, part, 1.3]
    });
    assert_eq!(warnings(&found), []);
}

/// The load of a sine turns before the lift. A load that turns above 15 % of the static load must not be
/// warned of, unless it stays near a fifth for tenths of a second; one that turns at 10 % may be, once in each
/// period. The curvature of a quick sine is seen through the noise of 16-bit sensors.
#[test]
fn a_sine_whose_load_turns_is_not_warned_of() {
    for (sigma, hz, least, most) in [
        (SIGMA, 0.2, 0.25, 0),
        (SIGMA, 0.3, 0.22, 0),
        (0.002, 0.7, 0.18, 0),
        (SIGMA, 0.2, 0.10, 12),
        (SIGMA, 0.3, 0.10, 12),
        (SIGMA, 0.7, 0.10, 12),
    ] {
        let mean = 0.5 * (1.0 + least);
        let found = noisy_events(sigma, 2.0 + 12.0 / hz, false, |t| {
            let phase = std::f64::consts::TAU * hz * (t - 2.0).max(0.0);
            let part = mean + (1.0 - mean) * math::cos(phase);
            [part, part.max(0.5), 1.0]
        });
        let found = warnings(&found);
        assert!(found.len() <= most, "{hz} Hz, {least}: {found:?}");
    }
}

/// On rough ground the loads swing about their mean within tenths of a second.
#[test]
fn rough_ground_is_not_warned_of() {
    let found = events(60.0, true, |t| {
        let swing = |hz: f64, by: f64| by * math::sin(std::f64::consts::TAU * hz * t);
        let front = (0.9 + swing(2.1, 0.6) + swing(9.7, 0.5)).max(0.0);
        let rear = (0.9 + swing(2.7, 0.6) + swing(11.3, 0.5)).max(0.0);
        [front, rear, 1.0]
    });
    assert_eq!(warnings(&found), []);
}
