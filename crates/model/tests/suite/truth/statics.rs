//! Tyre forces from member forces and back, with every term and with one left out.

use atvrec_model::suspension::{ChannelKind, Corner, Parity, vertical_force_n};
use atvrec_model::vehicle::Vehicle;
use nalgebra::{SMatrix, Vector3, Vector6};
use sample::{PerWheel, Wheel};

use super::instant::{Instant, LeftOut, axle, set_up};
use super::run::Run;

/// Root mean square of a wheel's six errors (N, N m) and, over the larger of static load and peak
/// force, the worst wheel's in per cent of F_x, F_y, F_z.
struct Closure {
    rms: [[f64; 6]; 4],
    worst_percent: [f64; 3],
}

fn closure(vehicle: &Vehicle, corners: &PerWheel<Corner>, run: &Run, left_out: LeftOut) -> Closure {
    let mut sum = [[0.0; 6]; 4];
    let mut count = 0.0;
    let mut peak = PerWheel::from_fn(|wheel| [axle(vehicle, wheel).tyre.reference_load_n; 3]);
    for row in 0..run.rows {
        let Some(instant) = Instant::new(vehicle, corners, run, row, left_out) else {
            continue;
        };
        count += 1.0;
        for wheel in Wheel::ALL {
            let found = instant
                .statics(wheel, ChannelKind::Strut, left_out)
                .wrench(&instant.members(wheel, left_out))
                .to_vector();
            let truth = instant.truth(wheel).to_vector();
            for axis in 0..6 {
                sum[wheel.index()][axis] += (found[axis] - truth[axis]).powi(2);
            }
            for axis in 0..3 {
                peak[wheel][axis] = peak[wheel][axis].max(truth[axis].abs());
            }
        }
    }
    let rms = sum.map(|wheel| wheel.map(|s: f64| (s / count).sqrt()));
    let worst_percent = std::array::from_fn(|axis| {
        Wheel::ALL
            .map(|w| 100.0 * rms[w.index()][axis] / peak[w][axis])
            .into_iter()
            .fold(0.0, f64::max)
    });
    Closure { rms, worst_percent }
}

#[test]
fn all_terms_close() {
    // Worst wheel's F_x, F_y, F_z in per cent.
    for (name, limits) in [
        ("c_sine03", [0.06, 0.06, 0.06]),
        ("b_circle", [0.06, 0.08, 0.06]),
        ("f_launch_brake", [0.1, 0.14, 0.1]),
        ("d_sine_mu", [0.06, 0.06, 0.06]),
        ("h_jack", [0.1, 0.1, 0.1]),
    ] {
        let Some((vehicle, corners, run)) = set_up(name) else {
            return;
        };
        let found = closure(vehicle, &corners, &run, LeftOut::Nothing);
        println!(
            "{name}: {:.3?} %, rms {:.2?}",
            found.worst_percent, found.rms
        );
        for (axis, limit) in limits.into_iter().enumerate() {
            assert!(
                found.worst_percent[axis] < limit,
                "{name}, axis {axis}: {:?}",
                found.worst_percent
            );
        }
    }
}

/// What each neglect costs on three runs, worst wheel's F_x, F_y, F_z in per cent: the figures of
/// an independent evaluation of the same runs.
const COST_PERCENT: &[(LeftOut, [[f64; 3]; 3])] = &[
    (
        LeftOut::Inertia,
        [[0.4, 2.7, 0.02], [1.0, 5.0, 0.14], [4.5, 0.1, 0.1]],
    ),
    (
        LeftOut::Mass,
        [[0.4, 2.7, 12.5], [1.0, 5.4, 17.2], [4.4, 0.3, 10.1]],
    ),
    (
        LeftOut::ArmMass,
        [[0.05, 0.22, 1.2], [0.07, 0.4, 1.7], [0.1, 0.3, 1.0]],
    ),
    (
        LeftOut::Damper,
        [[0.04, 0.33, 1.7], [0.05, 0.05, 0.09], [0.1, 0.4, 1.7]],
    ),
    (
        LeftOut::Stops,
        [[0.0, 0.0, 0.1], [0.3, 2.1, 6.9], [0.0, 0.1, 0.0]],
    ),
    (
        LeftOut::TieRod,
        [[0.8, 10.7, 1.0], [3.5, 14.1, 2.4], [0.4, 31.8, 3.6]],
    ),
    (
        LeftOut::BodyAttitude,
        [[0.6, 5.6, 1.1], [4.2, 14.0, 5.3], [7.5, 0.1, 2.3]],
    ),
    (
        LeftOut::ReadInboard,
        [[2.2, 41.0, 4.6], [4.1, 41.0, 7.0], [0.6, 39.0, 4.8]],
    ),
];
/// Both evaluations differ in which rows they take: an eighth, and 0.12 of a per cent.
const COST_TOLERANCE: (f64, f64) = (0.13, 0.12);

#[test]
fn each_term_matters() {
    for (index, name) in ["c_sine03", "b_circle", "f_launch_brake"]
        .into_iter()
        .enumerate()
    {
        let Some((vehicle, corners, run)) = set_up(name) else {
            return;
        };
        for &(left_out, cost) in COST_PERCENT {
            let found = closure(vehicle, &corners, &run, left_out).worst_percent;
            println!("{name} without {left_out:?}: {found:.2?} %");
            for axis in 0..3 {
                let expected = cost[index][axis];
                assert!(
                    (found[axis] - expected).abs() < COST_TOLERANCE.0 * expected + COST_TOLERANCE.1,
                    "{name} without {left_out:?}: {found:.3?} %, expected {:?}",
                    cost[index]
                );
            }
        }
    }
}

/// Forces of the five links and the strut from the tyre's wrench: what a virtual strain gauge
/// feels. The truth's own balance holds to 0.25 N rms; moments over 0.1 m arms amplify that.
const MEMBER_TOLERANCE_N: f64 = 12.0;
/// On a sine steer without hanging wheels. The rack's rate and acceleration are worth 7 N.
const SINE_TOLERANCE_N: f64 = 1.5;

#[test]
fn members_follow_from_the_wrench() {
    for name in ["c_sine03", "b_circle", "f_launch_brake"] {
        let Some((vehicle, corners, run)) = set_up(name) else {
            return;
        };
        let mut sum = [[0.0; 6]; 4];
        for row in 0..run.rows {
            let Some(instant) = Instant::new(vehicle, &corners, &run, row, LeftOut::Nothing) else {
                continue;
            };
            for wheel in Wheel::ALL {
                let statics = instant.statics(wheel, ChannelKind::Strut, LeftOut::Nothing);
                let found = statics.members(&instant.truth(wheel)).to_vector();
                let truth = instant.members(wheel, LeftOut::Nothing).to_vector();
                for channel in 0..6 {
                    sum[wheel.index()][channel] += (found[channel] - truth[channel]).powi(2);
                }
            }
        }
        let rms = sum.map(|wheel| wheel.map(|s: f64| (s / run.rows as f64).sqrt()));
        println!("{name}: member forces rms {rms:.2?} N");
        let most = match name {
            "c_sine03" => SINE_TOLERANCE_N,
            _ => MEMBER_TOLERANCE_N,
        };
        assert!(rms.as_flattened().iter().all(|r| *r < most));
    }
}

/// Half the peak of the ball-normal force is 1 to 2.5 kN: a thousandth of it.
const BALL_NORMAL_TOLERANCE_N: f64 = 2.0;

#[test]
fn ball_normal_force_replaces_the_strut() {
    for name in ["c_sine03", "b_circle", "f_launch_brake"] {
        let Some((vehicle, corners, run)) = set_up(name) else {
            return;
        };
        let (mut worst, mut sum, mut count) = (0.0_f64, Vector3::<f64>::zeros(), 0.0);
        for row in 0..run.rows {
            let Some(instant) = Instant::new(vehicle, &corners, &run, row, LeftOut::Nothing) else {
                continue;
            };
            for wheel in Wheel::ALL {
                let strut = instant.statics(wheel, ChannelKind::Strut, LeftOut::Nothing);
                let ball = run.vector(&format!("{wheel}_LCA_ball_F"), "", row);
                let normal = ball.dot(&strut.lower_normal);
                let mut members = instant.members(wheel, LeftOut::Nothing);
                worst = worst.max((strut.ball_normal_n(&members) - normal).abs());
                members.sixth_n = normal;
                let direct = instant.statics(wheel, ChannelKind::BallNormal, LeftOut::Nothing);
                let miss = direct.wrench(&members).force_n - instant.truth(wheel).force_n;
                sum += miss.component_mul(&miss);
                count += 1.0;
            }
        }
        let rms = (sum / count).map(f64::sqrt);
        println!("{name}: ball-normal off by {worst:.2} N at most; tyre force rms {rms:.2?} N");
        assert!(rms.max() < BALL_NORMAL_TOLERANCE_N, "{rms:?}");
        assert!(worst < 15.0, "{worst}");
    }
}

/// A tyre whose load is spread evenly: millimetres under the simulator's single contact point.
const CONTACT_TOLERANCE_M: f64 = 1.0e-3;

#[test]
fn contact_points_match() {
    let Some((vehicle, corners, run)) = set_up("c_sine03") else {
        return;
    };
    let mut worst = 0.0_f64;
    for row in 0..run.rows {
        let instant =
            Instant::new(vehicle, &corners, &run, row, LeftOut::Nothing).expect("on its wheels");
        for wheel in Wheel::ALL {
            let truth = run.vector(&format!("{wheel}_cp_"), "", row);
            worst = worst.max((instant.frame(wheel).contact_m - truth).norm());
        }
    }
    println!("contact point off by {worst:.2e} m at most");
    assert!(worst < CONTACT_TOLERANCE_M);
}

/// Spring deflection alone, equation 2.27 set right, per cent of F_z on three runs.
const SPRING_ALONE_PERCENT: [f64; 3] = [3.6, 7.2, 3.6];

#[test]
fn spring_alone_misreads_turns() {
    for (index, name) in ["c_sine03", "b_circle", "f_launch_brake"]
        .into_iter()
        .enumerate()
    {
        let Some((vehicle, corners, run)) = set_up(name) else {
            return;
        };
        let mut worst = 0.0_f64;
        for wheel in Wheel::ALL {
            let axle = axle(vehicle, wheel);
            let strut = axle.strut.as_ref().expect("a strut");
            let ratio = strut.motion_ratio.expect("from the hard-points");
            assert!(corners[wheel].wheel == wheel);
            let (mut sum, mut peak) = (0.0, axle.tyre.reference_load_n);
            for row in 0..run.rows {
                let at = |column: &str| run.get(&format!("{wheel}_{column}"), row);
                let found = vertical_force_n(
                    axle.tyre.reference_load_n,
                    strut.stiffness_n_m,
                    ratio,
                    strut.design_length_m - at("spring_len"),
                );
                sum += (found - at("Fz")).powi(2);
                peak = peak.max(at("Fz"));
            }
            worst = worst.max(100.0 * (sum / run.rows as f64).sqrt() / peak);
        }
        println!("{name}: spring alone {worst:.2} % of F_z");
        let expected = SPRING_ALONE_PERCENT[index];
        assert!(
            (worst - expected).abs() < 0.35 * expected,
            "{worst} {expected}"
        );
    }
}

/// Largest over smallest gain of the map, moments scaled by this length (of the order of the
/// wheel's radius), and what 50 N of noise on each channel makes of the tyre's force.
const MOMENT_SCALE_M: f64 = 0.3;

#[test]
fn the_geometry_is_well_conditioned() {
    let Some((vehicle, corners, run)) = set_up("c_sine03") else {
        return;
    };
    let instant = Instant::new(vehicle, &corners, &run, 0, LeftOut::Nothing).expect("stands");
    for wheel in Wheel::ALL {
        let statics = instant.statics(wheel, ChannelKind::Strut, LeftOut::Nothing);
        let mut map = statics.wrench_from_members;
        for row in 3..6 {
            map.row_mut(row).scale_mut(1.0 / MOMENT_SCALE_M);
        }
        let gains = map.singular_values();
        assert!(gains.max() / gains.min() < 20.0, "{wheel}: {gains}");
        let members = statics.members(&instant.truth(wheel)).to_vector();
        let sigma = |parity: [f64; 3]| {
            let parity = Parity {
                sigma_n_m: parity,
                rolling_radius_m: 0.0,
            };
            let found = statics
                .wrench_with_parity(&members, &Vector6::repeat(50.0), &parity)
                .expect("six channels");
            Vector3::from_fn(|i, _| found.covariance[(i, i)].sqrt())
        };
        let raw = sigma([f64::INFINITY; 3]);
        let with_roll = sigma([1e-3, f64::INFINITY, f64::INFINITY]);
        let with_all = sigma([1e-3; 3]);
        println!(
            "{wheel}: 50 N make {raw:.1?}, M_x known {with_roll:.1?}, all known {with_all:.1?}"
        );
        assert!(
            raw.y > 80.0 && with_roll.y < 0.4 * raw.y,
            "M_x and F_y are one reading"
        );
        assert!(
            raw.x > 40.0 && with_all.x < 0.4 * raw.x,
            "M_y, M_z tell of F_x"
        );
    }
}

/// The lower arm's own inertia beyond its specific force is what is left.
const INBOARD_TOLERANCE_N: f64 = 1.0;

/// Inboard of the strut's mount the legs carry the hinge's reaction, which the runs tell.
#[test]
fn inboard_tension_is_the_hinge_reaction() {
    let Some((vehicle, corners, run)) = set_up("b_circle") else {
        return;
    };
    let (mut sum, mut excess_sum, mut count) = (0.0, 0.0, 0.0);
    for row in 0..run.rows {
        let Some(instant) = Instant::new(vehicle, &corners, &run, row, LeftOut::Nothing) else {
            continue;
        };
        for wheel in Wheel::ALL {
            let (pose, points) = (&instant.poses[wheel], &corners[wheel].points);
            let legs = SMatrix::<f64, 3, 2>::from_columns(&[
                (pose.lower_ball_m - points.lower_front).normalize(),
                (pose.lower_ball_m - points.lower_rear).normalize(),
            ]);
            let hinge = run.vector(&format!("{wheel}_LCA_hinge_F"), "", row);
            let inverse = legs.pseudo_inverse(1e-9).expect("two legs");
            let truth = -(inverse * hinge);
            let inboard = instant.members(wheel, LeftOut::ReadInboard);
            let outboard = instant.members(wheel, LeftOut::Nothing);
            let found = [inboard.lower_front_n, inboard.lower_rear_n];
            for leg in 0..2 {
                sum += (found[leg] - truth[leg]).powi(2);
                count += 1.0;
            }
            excess_sum += (inboard.lower_front_n - outboard.lower_front_n).powi(2);
        }
    }
    let (rms, excess) = ((sum / count).sqrt(), (2.0 * excess_sum / count).sqrt());
    println!("inboard tension off by {rms:.2} N rms, of an excess of {excess:.0} N rms");
    assert!(rms < INBOARD_TOLERANCE_N, "{rms}");
    assert!((200.0..500.0).contains(&excess), "{excess}");
}
