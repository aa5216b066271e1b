//! Tyre forces from member forces and back, with every term and with one left out.

use model::suspension::{
    BodyMotion, ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, MemberForces, Parity,
    TyreFrame, Wrench, ground_plane, inboard_excess_n, vertical_force_n,
};
use model::vehicle::{Axle, Vehicle};
use nalgebra::{Vector3, Vector6};
use sample::{PerWheel, Wheel};

use crate::run::{Run, vehicle};

const STRIDE: usize = 41;
/// Gravity of the simulator, m/s^2.
const GRAVITY_M_S2: f64 = 9.81;
/// A wheel under this load does not help to find the ground, N.
const FIRM_LOAD_N: f64 = 60.0;

/// One term of the statics that a method could neglect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LeftOut {
    Nothing,
    Inertia,
    Mass,
    ArmMass,
    Damper,
    Stops,
    TieRod,
    BodyAttitude,
    FrozenGeometry,
    ReadInboard,
}

fn wanted(name: &str) -> bool {
    const BODY: &[&str] = &[
        "fx_body", "fy_body", "fz_body", "p", "q", "r", "pdot", "qdot", "rdot", "rack",
    ];
    const CORNER: &[&str] = &[
        "spring_len",
        "shock_vel",
        "spring_F",
        "shock_F",
        "stop_F",
        "omega",
        "Tdrive",
        "UCA_tubeF_T",
        "UCA_tubeB_T",
        "LCA_tubeF_T",
        "LCA_tubeB_T",
        "tierod_T",
        "Fx",
        "Fy",
        "Fz",
        "Mx",
        "My",
        "Mz",
        "tyre_defl",
        "cp_x",
        "cp_y",
        "cp_z",
        "LCA_ball_Fx",
        "LCA_ball_Fy",
        "LCA_ball_Fz",
    ];
    BODY.contains(&name) || (name.len() > 3 && CORNER.contains(&&name[3..]))
}

fn axle(vehicle: &Vehicle, wheel: Wheel) -> &Axle {
    if wheel.is_front() {
        &vehicle.front
    } else {
        &vehicle.rear
    }
}

/// All corners of one row.
struct Instant<'a> {
    vehicle: &'a Vehicle,
    corners: &'a PerWheel<Corner>,
    run: &'a Run,
    row: usize,
    poses: PerWheel<CornerPose>,
    normal: Vector3<f64>,
    body: BodyMotion,
}

impl<'a> Instant<'a> {
    fn new(
        vehicle: &'a Vehicle,
        corners: &'a PerWheel<Corner>,
        run: &'a Run,
        row: usize,
        left_out: LeftOut,
    ) -> Option<Self> {
        let at = |wheel: Wheel, name: &str| run.get(&format!("{wheel}_{name}"), row);
        let poses = PerWheel::from_fn(|wheel| {
            let corner = &corners[wheel];
            let rack = if wheel.is_front() {
                run.get("rack", row)
            } else {
                0.0
            };
            let length = if left_out == LeftOut::FrozenGeometry {
                corner.design_strut_length_m()
            } else {
                at(wheel, "spring_len")
            };
            corner.pose(length, rack).expect("within reach")
        });
        let normal = if left_out == LeftOut::BodyAttitude {
            Vector3::z()
        } else {
            ground_plane(
                &poses,
                &PerWheel::from_fn(|wheel| axle(vehicle, wheel).tyre.unloaded_radius_m),
                &PerWheel::from_fn(|wheel| at(wheel, "tyre_defl")),
                &PerWheel::from_fn(|wheel| f64::from(u8::from(at(wheel, "Fz") > FIRM_LOAD_N))),
            )?
            .normal
        };
        Some(Self {
            vehicle,
            corners,
            run,
            row,
            poses,
            normal,
            body: BodyMotion {
                specific_force_m_s2: run.vector("f", "_body", row),
                reference_m: Vector3::new(0.0, 0.0, vehicle.body.cg_height_m),
                rate_rad_s: Vector3::new(run.get("p", row), run.get("q", row), run.get("r", row)),
                rate_dot_rad_s2: Vector3::new(
                    run.get("pdot", row),
                    run.get("qdot", row),
                    run.get("rdot", row),
                ),
            },
        })
    }

    fn at(&self, wheel: Wheel, name: &str) -> f64 {
        self.run.get(&format!("{wheel}_{name}"), self.row)
    }

    fn frame(&self, wheel: Wheel) -> TyreFrame {
        TyreFrame::new(
            &self.poses[wheel],
            self.normal,
            axle(self.vehicle, wheel).tyre.unloaded_radius_m,
            self.at(wheel, "tyre_defl"),
        )
    }

    fn motion(&self, wheel: Wheel, left_out: LeftOut) -> CornerMotion {
        let (corner, pose) = (&self.corners[wheel], &self.poses[wheel]);
        if left_out == LeftOut::Inertia {
            return CornerMotion {
                axle_torque_n_m: self.at(wheel, "Tdrive"),
                ..CornerMotion::at_rest(self.normal * GRAVITY_M_S2)
            };
        }
        let rate = self.at(wheel, "shock_vel");
        let mut motion = CornerMotion::on_body(corner, pose, &self.body, rate, 0.0);
        if self.at(wheel, "Fz") > FIRM_LOAD_N {
            motion = motion.on_ground(corner, pose, self.normal, GRAVITY_M_S2);
        }
        let name = format!("{wheel}_omega");
        motion.spin_rad_s = self.at(wheel, "omega");
        motion.spin_dot_rad_s2 = self.run.slope(&name, self.row);
        motion.axle_torque_n_m = self.at(wheel, "Tdrive");
        motion
    }

    fn statics(&self, wheel: Wheel, sixth: ChannelKind, left_out: LeftOut) -> CornerStatics {
        let mut unsprung = axle(self.vehicle, wheel).unsprung.clone().expect("masses");
        if matches!(left_out, LeftOut::Mass | LeftOut::ArmMass) {
            unsprung.upper_arm_mass_kg = 0.0;
            unsprung.lower_arm_mass_kg = 0.0;
        }
        if left_out == LeftOut::Mass {
            unsprung.wheel_mass_kg = 0.0;
            unsprung.upright_mass_kg = 0.0;
        }
        CornerStatics::new(
            &self.corners[wheel],
            &self.poses[wheel],
            &self.frame(wheel),
            &unsprung,
            &self.motion(wheel, left_out),
            sixth,
        )
        .expect("a sound linkage")
    }

    fn members(&self, wheel: Wheel, left_out: LeftOut) -> MemberForces {
        let strut = axle(self.vehicle, wheel).strut.as_ref().expect("a strut");
        let mut force = strut.force(self.at(wheel, "spring_len"), self.at(wheel, "shock_vel"));
        match left_out {
            LeftOut::Damper => force.damper_n = 0.0,
            LeftOut::Stops => force.stop_n = 0.0,
            _ => {}
        }
        let excess = if left_out == LeftOut::ReadInboard {
            inboard_excess_n(
                &self.corners[wheel],
                &self.poses[wheel],
                axle(self.vehicle, wheel).unsprung.as_ref().expect("masses"),
                &self.motion(wheel, left_out),
                force.total_n(),
            )
        } else {
            [0.0; 2]
        };
        MemberForces {
            upper_front_n: self.at(wheel, "UCA_tubeF_T"),
            upper_rear_n: self.at(wheel, "UCA_tubeB_T"),
            lower_front_n: self.at(wheel, "LCA_tubeF_T") + excess[0],
            lower_rear_n: self.at(wheel, "LCA_tubeB_T") + excess[1],
            tie_rod_n: if left_out == LeftOut::TieRod {
                0.0
            } else {
                self.at(wheel, "tierod_T")
            },
            sixth_n: force.total_n(),
        }
    }

    fn truth(&self, wheel: Wheel) -> Wrench {
        Wrench {
            force_n: self.run.vector(&format!("{wheel}_F"), "", self.row),
            moment_n_m: self.run.vector(&format!("{wheel}_M"), "", self.row),
        }
    }
}

fn set_up(name: &str) -> Option<(Vehicle, PerWheel<Corner>, Run)> {
    let vehicle = vehicle()?;
    let corners = PerWheel::from_fn(|wheel| Corner::of(&vehicle, wheel).expect("hard-points"));
    Some((vehicle, corners, Run::open(name, STRIDE, wanted)?))
}

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
        let found = closure(&vehicle, &corners, &run, LeftOut::Nothing);
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
            let found = closure(&vehicle, &corners, &run, left_out).worst_percent;
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

#[test]
fn members_follow_from_the_wrench() {
    for name in ["c_sine03", "b_circle", "f_launch_brake"] {
        let Some((vehicle, corners, run)) = set_up(name) else {
            return;
        };
        let mut sum = [[0.0; 6]; 4];
        for row in 0..run.rows {
            let Some(instant) = Instant::new(&vehicle, &corners, &run, row, LeftOut::Nothing)
            else {
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
        assert!(rms.as_flattened().iter().all(|r| *r < MEMBER_TOLERANCE_N));
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
            let Some(instant) = Instant::new(&vehicle, &corners, &run, row, LeftOut::Nothing)
            else {
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
            Instant::new(&vehicle, &corners, &run, row, LeftOut::Nothing).expect("on its wheels");
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
            let axle = axle(&vehicle, wheel);
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
    let instant = Instant::new(&vehicle, &corners, &run, 0, LeftOut::Nothing).expect("stands");
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
