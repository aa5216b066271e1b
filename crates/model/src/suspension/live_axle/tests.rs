use nalgebra::Vector3;

use super::*;
use crate::suspension::linkage::Coordinates;
use crate::vehicle::LeafAxle;

fn axle() -> LinkedAxle {
    let vehicle = Vehicle::builtin("second-vehicle").expect("ships with the project");
    LinkedAxle::of(&vehicle).expect("a sound axle")
}

/// Lengths from the bump stops to the droop stops, in heave, roll and between.
fn lengths(axle: &LinkedAxle) -> Vec<[f64; 2]> {
    let [left, right] = axle.design_lengths_m();
    let steps = [-0.07, -0.03, 0.0, 0.04, 0.08];
    steps
        .into_iter()
        .flat_map(|l| steps.map(|r| [left + l, right + r]))
        .collect()
}

#[test]
fn springs_have_their_lengths_and_links_keep_theirs_but_for_self_stress() {
    let axle = axle();
    let mut bind_m = 0.0_f64;
    for lengths_m in lengths(&axle) {
        let pose = axle.pose(lengths_m).expect("within reach");
        for (spring, length_m) in axle.springs.iter().zip(lengths_m) {
            assert!((pose.line(spring).1 - length_m).abs() < 1e-11);
        }
        let elongations = SVector::<f64, LINKS>::from_fn(|i, _| {
            pose.line(&axle.links[i]).1 - axle.link_lengths_m[i]
        });
        let along = axle.self_stress * axle.self_stress.dot(&elongations);
        assert!((elongations - along).norm() < 1e-11, "{elongations}");
        assert!((axle.bind_m(&pose).abs() - along.norm()).abs() < 1e-11);
        bind_m = bind_m.max(along.norm());
    }
    // Roll binds the links of this axle.
    assert!((1e-4..5e-3).contains(&bind_m), "{bind_m} m");
}

/// Central differences of poses over 2e-6 m.
#[test]
fn derivatives_match_differences() {
    const STEP_M: f64 = 1e-5;
    let axle = axle();
    let point = axle.wheel_centres_m[0];
    let mut worst = [0.0_f64; 2];
    for [left, right] in lengths(&axle) {
        let at = |dl: f64, dr: f64| axle.pose([left + dl, right + dr]).expect("within reach");
        let pose = at(0.0, 0.0);
        let path = pose.path_of(point);
        for (first, [dl, dr]) in [[STEP_M, 0.0], [0.0, STEP_M]].into_iter().enumerate() {
            let (after, before) = (at(dl, dr), at(-dl, -dr));
            let slope = (after.point_m(point) - before.point_m(point)) / (2.0 * STEP_M);
            let turn = (after.vehicle_from_axle - before.vehicle_from_axle)
                * pose.vehicle_from_axle.transpose()
                / (2.0 * STEP_M);
            let turn = Vector3::new(turn[(2, 1)], turn[(0, 2)], turn[(1, 0)]);
            let unit = Coordinates {
                strut: f64::from(first == 0),
                rack: f64::from(first == 1),
            };
            worst[0] = worst[0].max((path.travel.rate(unit) - slope).amax());
            worst[0] = worst[0].max((path.rotation.rate(unit) - turn).amax());
            let of = |pose: &LiveAxlePose| {
                let path = pose.path_of(point);
                [
                    path.travel.by_strut,
                    path.travel.by_rack,
                    path.rotation.by_strut,
                    path.rotation.by_rack,
                ]
            };
            let (after, before) = (of(&after), of(&before));
            let bends: [Vector3<f64>; 4] =
                std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * STEP_M));
            // The derivatives of a rotation do not commute: half of their commutator is beside the mean.
            let half = path.rotation.by_strut.cross(&path.rotation.by_rack) * 0.5;
            let (p, w) = (&path.travel, &path.rotation);
            let exact = if first == 0 {
                [
                    p.by_strut_strut,
                    p.by_strut_rack,
                    w.by_strut_strut,
                    w.by_strut_rack + half,
                ]
            } else {
                [
                    p.by_strut_rack,
                    p.by_rack_rack,
                    w.by_strut_rack - half,
                    w.by_rack_rack,
                ]
            };
            for (exact, found) in exact.into_iter().zip(bends) {
                worst[1] = worst[1].max((exact - found).amax());
            }
        }
    }
    assert!(worst[0] < 1e-7, "first derivatives: {worst:?}");
    assert!(worst[1] < 1e-6, "second derivatives: {worst:?}");
}

#[test]
fn what_does_not_hold_the_axle_or_is_out_of_reach_is_an_error() {
    let axle = axle();
    let far = axle.pose([2.0, 0.27]).expect_err("out of reach");
    assert!(far.to_string().contains("spring length = 2 m"), "{far}");
    let mut vehicle = Vehicle::builtin("second-vehicle").expect("ships with the project");
    let live = vehicle.rear.live_axle.as_mut().expect("a live axle");
    live.panhard_axle_m = live.panhard_body_m;
    let coincide = LinkedAxle::of(&vehicle).expect_err("no line");
    assert!(coincide.to_string().contains("coincide"), "{coincide}");
    let live = vehicle.rear.live_axle.as_mut().expect("a live axle");
    // A Panhard rod along the axle's x does not hold it sideways.
    live.panhard_axle_m = [0.6, 0.0, 0.3];
    live.panhard_body_m = [-0.4, 0.0, 0.3];
    live.lower_link_body_m[1] = live.lower_link_axle_m[1];
    live.upper_link_body_m[1] = live.upper_link_axle_m[1];
    live.spring_body_m[1] = live.spring_axle_m[1];
    let loose = LinkedAxle::of(&vehicle).expect_err("free sideways");
    assert!(loose.to_string().contains("do not hold"), "{loose}");
}

/// The second vehicle with leaf springs at the rear: seats where the springs of its file stand.
fn on_leaves() -> Vehicle {
    let mut vehicle = Vehicle::builtin("second-vehicle").expect("ships with the project");
    let live = vehicle.rear.live_axle.take().expect("a live axle");
    let [x, y, z] = live.spring_axle_m;
    vehicle.rear.leaf_axle = Some(LeafAxle {
        wheel_centre_m: live.wheel_centre_m,
        seat_m: live.spring_axle_m,
        eye_body_m: [x + 0.6, y, z],
        radius_part: 0.75,
        spring_body_m: [x, y, live.spring_body_m[2]],
        damper_body_m: live.damper_body_m,
        damper_axle_m: live.damper_axle_m,
        cg_m: live.cg_m,
        inertia_kg_m2: live.inertia_kg_m2,
        final_drive_ratio: live.final_drive_ratio,
        section_y_m: live.section_y_m,
        end_mass_kg: live.end_mass_kg,
        end_cg_m: live.end_cg_m,
    });
    vehicle
}

/// Both seats in the same travel are on an arc of 0.45 m, the axle does not turn, and goes at most 0.5 mm sideways.
/// In roll, both seats have different places on their arcs, which steers the axle.
#[test]
fn seats_on_leaf_springs_follow_arcs() {
    let axle = LinkedAxle::of(&on_leaves()).expect("a sound axle");
    let [design_m, _] = axle.design_lengths_m();
    let seat = axle.springs[0].axle_m;
    let design = axle.pose([design_m; 2]).expect("within reach");
    for up_m in [-0.1, -0.04, 0.05, 0.1_f64] {
        // The spring's upper end does not move along: its length follows from the arc.
        let ahead_m = 0.45 - (0.45_f64.powi(2) - up_m * up_m).sqrt();
        let above_m = design_m - up_m;
        let pose = axle
            .pose([math::hypot(above_m, ahead_m); 2])
            .expect("within reach");
        let moved = pose.point_m(seat) - design.point_m(seat);
        assert!((moved.z - up_m).abs() < 1e-4, "{moved}");
        assert!((moved.x - ahead_m).abs() < 1e-4, "{moved}");
        assert!(moved.y.abs() < 5.1e-4, "{moved}");
        assert!((pose.vehicle_from_axle - Matrix3::identity()).amax() < 1e-4);
    }
    let pose = axle
        .pose([design_m - 0.08, design_m + 0.03])
        .expect("within reach");
    let ahead = |up_m: f64| 0.45 - (0.45_f64.powi(2) - up_m * up_m).sqrt();
    let steer = (ahead(0.08) - ahead(0.03)) / (2.0 * seat.y);
    let spindle = pose.spindle();
    assert!(
        (spindle.x - steer).abs() < 0.1 * steer.abs(),
        "{spindle} {steer}"
    );
}

/// The seats carry braking and its moment by a couple, and side forces at their height.
#[test]
fn leaf_springs_carry_what_the_wheels_bring() {
    let vehicle = on_leaves();
    let axle = LinkedAxle::of(&vehicle).expect("a sound axle");
    // Springs push.
    let mut lines = -axle.gradients(&axle.design());
    lines.fixed_columns_mut::<2>(LINKS).neg_mut();
    let inverse = lines.pseudo_inverse(1e-9).expect("a matrix");
    let members = inverse * Vector6::new(1000.0, -300.0, 0.0, 0.0, 0.0, 0.0);
    let height_m = axle.springs[0].axle_m.z;
    // Side force at the wheel centres: the springs take its moment about the seats.
    let apart_m = 2.0 * axle.springs[0].axle_m.y;
    assert!(
        (members[5] - members[6] - 2.0 * 300.0 * height_m / apart_m).abs() < 1e-6,
        "{members}"
    );
    assert!((members[4].abs() - 300.0).abs() < 1e-6, "{members}");
    // Links push backwards as much as the brakes do; lower and upper ones share the moment.
    let along: f64 = members.fixed_rows::<4>(0).sum();
    assert!((along.abs() - 1000.0).abs() < 1e-6, "{members}");
    let upper: f64 = members[2] + members[3];
    assert!(
        (upper.abs() - 1000.0 * height_m / 0.2).abs() < 1e-6,
        "{members}"
    );
}

/// Lengths and forces of the springs, and the forces of the links, of the standing vehicle in the simulator that made
/// the truth runs (its `vehicle.json`, `static`). The vehicle leans to the driver's side.
#[test]
fn the_axle_stands_as_in_an_independent_simulator() {
    const ROLL_RAD: f64 = -0.018_62;
    let vehicle = Vehicle::builtin("second-vehicle").expect("ships with the project");
    let axle = LinkedAxle::of(&vehicle).expect("a sound axle");
    let level = Vector3::new(0.0, math::sin(ROLL_RAD), math::cos(ROLL_RAD)) * 9.81;
    let rest = (axle.at_rest(&vehicle.rear, [4061.9, 3740.2], level)).expect("springs carry it");
    let [left_m, right_m] = rest.pose.lengths_m;
    assert!((left_m - 0.26764).abs() < 0.0005, "{left_m} m");
    assert!((right_m - 0.28381).abs() < 0.0005, "{right_m} m");
    let [left_n, right_n] = rest.members.springs_n;
    assert!((left_n - 3472.8).abs() < 15.0, "{left_n} N");
    assert!((right_n - 2971.5).abs() < 15.0, "{right_n} N");
    assert_eq!(rest.members.dampers_n, [0.0; 2]);
    let expected_n = [218.2, -124.8, -118.8, 309.8, 120.3];
    for (found_n, expected_n) in rest.members.links_n.into_iter().zip(expected_n) {
        assert!((found_n - expected_n).abs() < 30.0, "{rest:?}");
    }
}

#[test]
fn a_hanging_axle_is_held_by_its_droop_stops() {
    let vehicle = Vehicle::builtin("second-vehicle").expect("ships with the project");
    let axle = LinkedAxle::of(&vehicle).expect("a sound axle");
    let level = Vector3::z() * 9.81;
    let rest = (axle.at_rest(&vehicle.rear, [0.0; 2], level)).expect("stops hold it");
    let unsprung = vehicle.rear.unsprung.as_ref().expect("has masses");
    // All members together carry the weight.
    let pull_n = |line: &AxleLine, tension_n: f64| rest.pose.line(line).0.z * tension_n;
    let links = axle.links.iter().zip(rest.members.links_n);
    let springs = axle.springs.iter().zip(rest.members.springs_n);
    let dampers = axle.dampers.iter().zip(rest.members.dampers_n);
    let pushing = springs.chain(dampers).map(|(line, push_n)| (line, -push_n));
    let carried_n: f64 = links
        .chain(pushing)
        .map(|(line, tension_n)| pull_n(line, tension_n))
        .sum();
    let weight_n = 2.0 * unsprung.total_mass_kg() * 9.81;
    assert!(
        (carried_n - weight_n).abs() < 1e-3,
        "{carried_n} of {weight_n} N"
    );
    assert!(
        rest.members
            .dampers_n
            .iter()
            .all(|force_n| *force_n < -100.0)
    );
}
