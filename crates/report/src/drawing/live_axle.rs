//! Drawing of a solid axle: links and Panhard rod or leaf springs, springs and dampers of both sides.

use model::nalgebra::Vector3;
use model::suspension::{AxleLine, LinkedAxle, LiveAxlePose, SuspensionError};
use model::vehicle::{LeafAxle, Strut, Vehicle};
use sample::Wheel;

use super::{CURVE_POINTS, Curve, DrawingError, Drawn, Pose, origin_m};

/// Halvings of the interval in which the droop stop is searched.
const HALVINGS: usize = 50;
/// Longest way of the springs to the droop stop, m.
const DROOP_MAX_M: f64 = 0.5;

/// What is drawn of a live axle; `None` without spring and damper.
pub(super) fn drawn(
    vehicle: &Vehicle,
    axle: &'static str,
    wheel: Wheel,
) -> Result<Option<Drawn>, DrawingError> {
    let of_axle = vehicle.axle(wheel);
    let Some(strut) = &of_axle.strut else {
        return Ok(None);
    };
    let travel = |place| {
        move |source| DrawingError::Travel {
            axle,
            table: if of_axle.leaf_axle.is_some() {
                "leaf_axle"
            } else {
                "live_axle"
            },
            place,
            source,
        }
    };
    let linked = LinkedAxle::of(vehicle).map_err(travel("the design position"))?;
    let leaves = (of_axle.leaf_axle.as_ref()).map(|leaf| leaves(&linked, leaf));
    let guides = leaves
        .as_ref()
        .map_or(&linked.links[..], |leaves| &leaves[..]);
    let both = |length_m, place| linked.pose([length_m; 2]).map_err(travel(place));
    let [design_m, _] = linked.design_lengths_m();
    let stops_m = [strut.bump_stop_length_m, droop_length_m(&linked, strut)];
    let poses = [
        both(design_m, "the design position")?,
        both(stops_m[0], "the bump stop")?,
        both(stops_m[1], "the droop stop")?,
    ];
    let curves = curves(&linked, stops_m).map_err(travel("a position between its stops"))?;
    let origin_m = origin_m(vehicle, wheel);
    let outer_m = linked.wheel_centres_m[0].y + 0.15;
    Ok(Some(Drawn {
        axle,
        named: named(&linked, leaves.as_ref(), &poses[0]),
        poses: poses.each_ref().map(|pose| lines(&linked, guides, pose)),
        curves,
        radius_m: of_axle.tyre.unloaded_radius_m,
        origin_m,
        outer_m,
        size_m: 2.0 * outer_m,
    }))
}

/// Length of both springs at which the dampers are at the droop stop, m.
fn droop_length_m(linked: &LinkedAxle, strut: &Strut) -> f64 {
    let [design_m, _] = linked.design_lengths_m();
    let is_free = |length_m: f64| {
        let damper = |pose: LiveAxlePose| pose.line(&linked.dampers[0]).1;
        let length = linked.pose([length_m; 2]).map(damper);
        length.is_ok_and(|length_m| length_m < strut.droop_stop_length_m)
    };
    let (mut free_m, mut stopped_m) = (design_m, design_m + DROOP_MAX_M);
    for _ in 0..HALVINGS {
        let middle_m = 0.5 * (free_m + stopped_m);
        if is_free(middle_m) {
            free_m = middle_m;
        } else {
            stopped_m = middle_m;
        }
    }
    free_m
}

/// Both leaf springs from the seat to the fixed eye, in the place of the links to the centre of the arc.
fn leaves(linked: &LinkedAxle, leaf: &LeafAxle) -> [AxleLine; 2] {
    [0, 1].map(|side| {
        let link = linked.links[side];
        let seat_m = linked.origin_m + link.axle_m;
        AxleLine {
            body_m: seat_m + (link.body_m - seat_m) / leaf.radius_part,
            ..link
        }
    })
}

/// Points of the file in the design position: those of the left side, and the Panhard rod.
fn named(
    linked: &LinkedAxle,
    leaves: Option<&[AxleLine; 2]>,
    design: &LiveAxlePose,
) -> Vec<(&'static str, Vector3<f64>)> {
    let ends = |line: &AxleLine| [line.body_m, design.point_m(line.axle_m)];
    let [lower, _, upper, _, panhard] = linked.links.each_ref().map(ends);
    let [spring, damper] = [&linked.springs[0], &linked.dampers[0]].map(ends);
    let wheel = ("wheel_centre_m", design.point_m(linked.wheel_centres_m[0]));
    if let Some([eye, seat]) = leaves.map(|[left, _]| ends(left)) {
        return vec![
            wheel,
            ("eye_body_m", eye),
            ("seat_m", seat),
            ("spring_body_m", spring[0]),
            ("damper_body_m", damper[0]),
            ("damper_axle_m", damper[1]),
        ];
    }
    vec![
        wheel,
        ("lower_link_body_m", lower[0]),
        ("lower_link_axle_m", lower[1]),
        ("upper_link_body_m", upper[0]),
        ("upper_link_axle_m", upper[1]),
        ("panhard_body_m", panhard[0]),
        ("panhard_axle_m", panhard[1]),
        ("spring_body_m", spring[0]),
        ("spring_axle_m", spring[1]),
        ("damper_body_m", damper[0]),
        ("damper_axle_m", damper[1]),
    ]
}

fn lines(linked: &LinkedAxle, guides: &[AxleLine], pose: &LiveAxlePose) -> Pose {
    let all = (guides.iter())
        .chain(&linked.springs)
        .chain(&linked.dampers);
    let ends = |line: &AxleLine| vec![line.body_m, pose.point_m(line.axle_m)];
    let centres = linked.wheel_centres_m.map(|centre| pose.point_m(centre));
    Pose {
        lines: all.map(ends).chain([centres.to_vec()]).collect(),
        wheels: centres
            .iter()
            .map(|centre| [*centre, pose.spindle()])
            .collect(),
    }
}

/// Lateral shift of the axle and motion ratio with both wheels in the same travel, and steer of the axle with
/// the wheels in opposite travel, over the travel of the left wheel.
fn curves(linked: &LinkedAxle, [bump_m, droop_m]: [f64; 2]) -> Result<[Curve; 3], SuspensionError> {
    let [design_m, _] = linked.design_lengths_m();
    let design = linked.pose([design_m; 2])?;
    let jounce_m = |pose: &LiveAxlePose| {
        let centre = linked.wheel_centres_m[0];
        pose.point_m(centre).z - design.point_m(centre).z
    };
    let least_m = (design_m - bump_m).min(droop_m - design_m).max(0.0);
    let [mut steer, mut shift, mut ratio] = [Vec::new(), Vec::new(), Vec::new()];
    for k in 0..CURVE_POINTS {
        let part = k as f64 / (CURVE_POINTS - 1) as f64;
        let pose = linked.pose([droop_m + part * (bump_m - droop_m); 2])?;
        let at_m = jounce_m(&pose);
        shift.push([at_m, 1e3 * (pose.path.point_m.y - design.path.point_m.y)]);
        // Both springs change by the same length.
        let travel = &pose.path_of(linked.wheel_centres_m[0]).travel;
        ratio.push([at_m, -1.0 / (travel.by_strut.z + travel.by_rack.z)]);
        let change_m = least_m * (1.0 - 2.0 * part);
        let rolled = linked.pose([design_m + change_m, design_m - change_m])?;
        let axis = rolled.spindle();
        steer.push([jounce_m(&rolled), math::atan2(-axis.x, axis.y).to_degrees()]);
    }
    Ok([
        Curve {
            name: "steer in roll, deg",
            points: steer,
        },
        Curve {
            name: "lateral shift, mm",
            points: shift,
        },
        Curve {
            name: "motion ratio",
            points: ratio,
        },
    ])
}
