//! Drawing of a vehicle's hard-points as SVG: the left corner of each axle, or a whole solid axle, from the rear
//! and from above, at bump, design and droop, and curves over the travel of the wheel. A mistyped coordinate
//! is seen. Beside it, the stresses along the members under a load.

mod gauges;
mod live_axle;

use std::fmt::Write;

use model::nalgebra::Vector3;
use model::suspension::{Corner, CornerPose, JouncePoint, SuspensionError};
use model::vehicle::Vehicle;
use sample::Wheel;

pub use gauges::{LoadedCorner, stresses};

const WIDTH: f64 = 1240.0;
/// Height of the drawing of one axle.
const ROW: f64 = 470.0;
const TOP: f64 = 50.0;
/// Height of a view.
const VIEW: f64 = 380.0;
const CURVE_POINTS: usize = 41;
const STYLE: &str = "text{font:14px sans-serif;fill:#111}.small{font-size:12px}.frame{fill:none;stroke:#999}\
    .design{stroke:#0050a0;stroke-width:2.5;fill:none}.bump{stroke:#b04000;stroke-width:1.2;fill:none}\
    .droop{stroke:#207020;stroke-width:1.2;fill:none;stroke-dasharray:5 3}.point{fill:#0050a0}";

/// Why there is no drawing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DrawingError {
    /// No axle has hard-points.
    #[error(
        "the vehicle file has no hard-points; add [front.wishbone], [front.macpherson] or [front.five_link], and \
         [front.strut], the same of the rear axle, or [rear.trailing_arm], [rear.live_axle] or [rear.leaf_axle]"
    )]
    NoPoints,
    /// A linkage does not reach its travel.
    #[error(
        "the linkage of the {axle} axle does not reach {place}: {source}; check the points of \
         [{axle}.{table}] and the lengths of [{axle}.strut]"
    )]
    Travel {
        /// `front` or `rear`.
        axle: &'static str,
        /// Table of the hard-points.
        table: &'static str,
        /// Where in the travel.
        place: &'static str,
        /// What the linkage says.
        source: SuspensionError,
    },
}

/// The drawing of a vehicle's linkages.
///
/// # Errors
/// Where no axle has hard-points, or a linkage does not reach its stops.
pub fn linkages(vehicle: &Vehicle) -> Result<String, DrawingError> {
    let mut rows = String::new();
    let mut count = 0.0;
    for (axle, wheel) in [("front", Wheel::FrontLeft), ("rear", Wheel::RearLeft)] {
        let drawn = match Corner::of(vehicle, wheel) {
            Ok(corner) => Drawn::of_corner(vehicle, &corner, axle)?,
            Err(_) if vehicle.axle(wheel).is_solid() => live_axle::drawn(vehicle, axle, wheel)?,
            Err(_) => None,
        };
        let Some(drawn) = drawn else {
            continue;
        };
        drawn.write(&mut rows, TOP + ROW * count);
        count += 1.0;
    }
    if count == 0.0 {
        return Err(DrawingError::NoPoints);
    }
    let height = TOP + ROW * count;
    let name = escaped(&vehicle.name);
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         height=\"{height}\"><style>{STYLE}</style><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\
         <text x=\"20\" y=\"30\" font-weight=\"bold\">{name}: left corners, solid axles whole; design solid, bump thin, droop \
         dashed</text>\n{rows}</svg>\n"
    ))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// What is drawn of one axle. Points are in the vehicle's axes.
struct Drawn {
    axle: &'static str,
    /// Points of the file in the design position.
    named: Vec<(&'static str, Vector3<f64>)>,
    /// Design, bump, droop.
    poses: [Pose; 3],
    curves: [Curve; 3],
    radius_m: f64,
    /// Origin of the points of the file, m.
    origin_m: Vector3<f64>,
    /// Left edge of the views, left of the middle plane, and their size, m.
    outer_m: f64,
    size_m: f64,
}

/// What is drawn of a pose.
struct Pose {
    lines: Vec<Vec<Vector3<f64>>>,
    /// Centre and spindle of each wheel.
    wheels: Vec<[Vector3<f64>; 2]>,
}

/// A quantity over the travel of the wheel, m.
struct Curve {
    name: &'static str,
    points: Vec<[f64; 2]>,
}

impl Drawn {
    fn of_corner(
        vehicle: &Vehicle,
        corner: &Corner,
        axle: &'static str,
    ) -> Result<Option<Self>, DrawingError> {
        let of_axle = vehicle.axle(corner.wheel);
        let Some(strut) = &of_axle.strut else {
            return Ok(None);
        };
        let table = of_axle.linkage_table().unwrap_or_default();
        let travel = |place| {
            move |source| DrawingError::Travel {
                axle,
                table,
                place,
                source,
            }
        };
        let pose = |length_m, place| corner.pose(length_m, 0.0).map_err(travel(place));
        let poses = [
            pose(strut.design_length_m, "the design position")?,
            pose(strut.bump_stop_length_m, "the bump stop")?,
            pose(strut.droop_stop_length_m, "the droop stop")?,
        ];
        let [design_m, bump_m, droop_m] = poses.each_ref().map(|pose| pose.wheel_centre_m.z);
        let radius_m = of_axle.tyre.unloaded_radius_m;
        let (from_m, to_m) = (droop_m - design_m, bump_m - design_m);
        let all = corner
            .jounce_curve(from_m, to_m, CURVE_POINTS, radius_m)
            .map_err(travel("a position between its stops"))?;
        let curve = |name, value: fn(&JouncePoint) -> f64| Curve {
            name,
            points: all.iter().map(|at| [at.jounce_m, value(at)]).collect(),
        };
        let origin_m = origin_m(vehicle, corner.wheel);
        let p = &corner.points;
        let outer_m = p.wheel_centre.y - origin_m.y + 0.15;
        Ok(Some(Self {
            axle,
            named: named(corner, table, &poses[0]),
            poses: poses.map(|pose| corner_pose(corner, table, &pose)),
            curves: [
                curve("camber, deg", |at| at.camber_rad.to_degrees()),
                curve("toe-in, deg", |at| at.toe_in_rad.to_degrees()),
                curve("motion ratio", |at| at.motion_ratio),
            ],
            radius_m,
            origin_m,
            outer_m,
            size_m: (outer_m + 0.05).max(p.strut_chassis.z + 0.1).max(1.0),
        }))
    }

    fn write(&self, out: &mut String, top: f64) {
        let views = [
            View {
                left: 20.0,
                name: "from the rear: y to the left, z up",
                up: 2,
                least_m: -0.05,
            },
            View {
                left: 430.0,
                name: "from above: y to the left, x up",
                up: 0,
                least_m: -0.5 * self.size_m,
            },
        ];
        label(out, [20.0, top + 18.0], "", &format!("{} axle", self.axle));
        for view in views {
            let _ = writeln!(
                out,
                "<rect class=\"frame\" x=\"{0}\" y=\"{1}\" width=\"{VIEW}\" height=\"{VIEW}\"/>\
                 <svg x=\"{0}\" y=\"{1}\" width=\"{VIEW}\" height=\"{VIEW}\">",
                view.left,
                top + 30.0
            );
            self.write_view(out, &view);
            out.push_str("</svg>\n");
            let below = [view.left + 6.0, top + VIEW + 48.0];
            label(out, below, "small", view.name);
        }
        for (number, curve) in self.curves.iter().enumerate() {
            let at = [880.0, top + 44.0 + 132.0 * number as f64];
            curve.write(out, at);
        }
        for (number, (name, point)) in self.named.iter().enumerate() {
            let [x, y, z] = (point - self.origin_m).into();
            let at = [1075.0, top + 42.0 + 34.0 * number as f64];
            label(out, at, "small", &format!("{} {name}", number + 1));
            let below = [at[0] + 16.0, at[1] + 14.0];
            label(out, below, "small", &format!("{x:.3}, {y:.3}, {z:.3}"));
        }
    }

    fn write_view(&self, out: &mut String, view: &View) {
        let scale = VIEW / self.size_m;
        let place = |point: &Vector3<f64>| {
            let local = point - self.origin_m;
            let across = scale * (self.outer_m - local.y);
            [across, VIEW - scale * (local[view.up] - view.least_m)]
        };
        let mut line = |class: &str, points: &[Vector3<f64>]| {
            let places: Vec<[f64; 2]> = points.iter().map(place).collect();
            polyline(out, class, &places);
        };
        if view.up == 2 {
            let side = Vector3::new(0.0, 3.0, 0.0);
            line("frame", &[self.origin_m - side, self.origin_m + side]);
        }
        for (pose, class) in self.poses.iter().zip(["design", "bump", "droop"]) {
            for points in &pose.lines {
                line(class, points);
            }
            for [centre, spindle] in &pose.wheels {
                // The plane of the wheel, as a line of the tyre's diameter.
                let axis = if view.up == 2 {
                    Vector3::z()
                } else {
                    Vector3::x()
                };
                let along = (axis - spindle * spindle.dot(&axis)).normalize() * self.radius_m;
                line(class, &[centre - along, centre + along]);
            }
        }
        for (number, (_, point)) in self.named.iter().enumerate() {
            let [x, y] = place(point);
            let _ = writeln!(
                out,
                "<circle class=\"point\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/>"
            );
            label(out, [x + 4.0, y - 4.0], "small", &(number + 1).to_string());
        }
    }
}

/// Origin of the points of an axle's tables, m.
fn origin_m(vehicle: &Vehicle, wheel: Wheel) -> Vector3<f64> {
    let ahead_m = if wheel.is_front() {
        vehicle.body.front_axle_to_cg_m
    } else {
        -vehicle.body.cg_to_rear_axle_m
    };
    Vector3::new(ahead_m, -vehicle.body.cg_y_m, 0.0)
}

/// Points of the file in the design position.
fn named(corner: &Corner, table: &str, design: &CornerPose) -> Vec<(&'static str, Vector3<f64>)> {
    let p = &corner.points;
    if let Some(ends) = corner.link_ends_m(design) {
        let names = [
            ["upper_front_inner_m", "upper_front_outer_m"],
            ["upper_rear_inner_m", "upper_rear_outer_m"],
            ["lower_front_inner_m", "lower_front_outer_m"],
            ["lower_rear_inner_m", "lower_rear_outer_m"],
            ["tie_rod_inner_m", "tie_rod_outer_m"],
        ];
        let ends = names.as_flattened().iter().zip(ends.as_flattened());
        let others = [
            ("wheel_centre_m", p.wheel_centre),
            ("strut_chassis_m", p.strut_chassis),
            ("strut_mount_m", p.strut_arm),
        ];
        return (ends.map(|(name, point)| (*name, *point)))
            .chain(others)
            .collect();
    }
    match table {
        "trailing_arm" => vec![
            ("wheel_centre_m", p.wheel_centre),
            ("outer_bushing_m", p.lower_front),
            ("inner_bushing_m", p.lower_rear),
            ("strut_chassis_m", p.strut_chassis),
            ("strut_arm_m", p.strut_arm),
        ],
        "macpherson" => vec![
            ("wheel_centre_m", p.wheel_centre),
            ("lower_front_m", p.lower_front),
            ("lower_rear_m", p.lower_rear),
            ("lower_ball_m", p.lower_ball),
            ("strut_top_m", p.strut_chassis),
            ("strut_low_m", p.strut_arm),
            ("tie_rod_inner_m", p.tie_rod_inner),
            ("tie_rod_outer_m", p.tie_rod_outer),
        ],
        _ => vec![
            ("wheel_centre_m", p.wheel_centre),
            ("upper_front_m", p.upper_front),
            ("upper_rear_m", p.upper_rear),
            ("upper_ball_m", p.upper_ball),
            ("lower_front_m", p.lower_front),
            ("lower_rear_m", p.lower_rear),
            ("lower_ball_m", p.lower_ball),
            ("strut_chassis_m", p.strut_chassis),
            ("strut_arm_m", p.strut_arm),
            ("tie_rod_inner_m", p.tie_rod_inner),
            ("tie_rod_outer_m", p.tie_rod_outer),
        ],
    }
}

fn corner_pose(corner: &Corner, table: &str, pose: &CornerPose) -> Pose {
    let p = &corner.points;
    let strut = vec![p.strut_chassis, pose.strut_arm_m];
    let arm = |upper_m: Vector3<f64>| {
        vec![
            vec![p.upper_front, pose.upper_ball_m, p.upper_rear],
            vec![p.lower_front, pose.lower_ball_m, p.lower_rear],
            vec![upper_m, pose.lower_ball_m, pose.tie_rod_outer_m],
            strut.clone(),
            vec![pose.tie_rod_inner_m, pose.tie_rod_outer_m],
        ]
    };
    let lines = if let Some(ends) = corner.link_ends_m(pose) {
        let upright = [0, 1, 4, 3, 2, 0].map(|k: usize| ends[k][1]);
        let links = ends.map(|link| link.to_vec());
        links.into_iter().chain([upright.to_vec(), strut]).collect()
    } else {
        match table {
            "trailing_arm" => vec![
                vec![
                    p.lower_front,
                    pose.wheel_centre_m,
                    p.lower_rear,
                    p.lower_front,
                ],
                strut,
            ],
            "macpherson" => arm(pose.strut_arm_m),
            _ => arm(pose.upper_ball_m),
        }
    };
    Pose {
        lines,
        wheels: vec![[pose.wheel_centre_m, pose.spindle]],
    }
}

impl Curve {
    fn write(&self, out: &mut String, [left, top]: [f64; 2]) {
        const SIZE: [f64; 2] = [175.0, 80.0];
        let range = |k: usize| {
            let all = self.points.iter().map(|point| point[k]);
            let (least, most) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| {
                (a.min(value), b.max(value))
            });
            // A constant is drawn as a level line in the middle.
            let margin = (1e-3 - 0.5 * (most - least)).max(0.0);
            [least - margin, most + margin]
        };
        let [[from_m, to_m], [least, most]] = [range(0), range(1)];
        let places = self.points.iter().map(|[jounce_m, value]| {
            let across = (jounce_m - from_m) / (to_m - from_m);
            let up = (value - least) / (most - least);
            [left + SIZE[0] * across, top + SIZE[1] * (1.0 - up)]
        });
        let places: Vec<[f64; 2]> = places.collect();
        let _ = writeln!(
            out,
            "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/>",
            SIZE[0], SIZE[1]
        );
        polyline(out, "design", &places);
        let text = format!("{}: {least:.2} to {most:.2}", self.name);
        label(out, [left, top - 6.0], "small", &text);
        let travel = format!("wheel travel {:.0} to {:.0} mm", 1e3 * from_m, 1e3 * to_m);
        label(out, [left, top + SIZE[1] + 14.0], "small", &travel);
    }
}

/// One view of a corner; the left of the vehicle is on the left.
struct View {
    /// Place on the drawing.
    left: f64,
    name: &'static str,
    /// Axis that points up.
    up: usize,
    /// Its value at the lower edge, m.
    least_m: f64,
}

fn polyline(out: &mut String, class: &str, places: &[[f64; 2]]) {
    let _ = write!(out, "<polyline class=\"{class}\" points=\"");
    for [x, y] in places {
        let _ = write!(out, "{x:.1},{y:.1} ");
    }
    out.push_str("\"/>\n");
}

fn label(out: &mut String, [x, y]: [f64; 2], class: &str, text: &str) {
    let text = escaped(text);
    let _ = writeln!(
        out,
        "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{text}</text>"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_axles_are_drawn_with_all_points_and_a_name_is_escaped() {
        let mut vehicle = Vehicle::builtin("prowler").unwrap();
        vehicle.name = "<b>&".to_owned();
        let drawing = linkages(&vehicle).unwrap();
        assert!(
            drawing.contains("&lt;b&gt;&amp;: left corners, "),
            "{drawing}"
        );
        assert!(!drawing.contains("NaN"));
        assert_eq!(drawing.matches("<circle").count(), 2 * 2 * 11);
        // The lower ball joint of the front axle in the view from the rear.
        assert!(drawing.contains("7 lower_ball_m"));
        assert!(drawing.contains("0.006, 0.470, 0.225"));
    }

    #[test]
    fn a_strut_is_drawn_with_the_names_of_its_points() {
        let text = include_str!("../../../testdata/vehicle-with-struts.toml");
        let vehicle = Vehicle::from_toml(text, "vehicle-with-struts.toml").unwrap();
        let drawing = linkages(&vehicle).unwrap();
        assert!(!drawing.contains("NaN"));
        assert_eq!(drawing.matches("<circle").count(), 2 * 2 * 8);
        assert!(drawing.contains("5 strut_top_m") && !drawing.contains("upper_ball_m"));
    }

    #[test]
    fn links_and_trailing_arms_are_drawn_with_the_names_of_their_points() {
        let text = include_str!("../../../testdata/vehicle-with-links.toml");
        let vehicle = Vehicle::from_toml(text, "vehicle-with-links.toml").unwrap();
        let drawing = linkages(&vehicle).unwrap();
        assert!(!drawing.contains("NaN"));
        assert_eq!(drawing.matches("<circle").count(), 2 * 2 * 13);
        assert!(
            drawing.contains("8 lower_rear_outer_m") && drawing.contains("0.010, 0.690, 0.220")
        );
        let text = include_str!("../../../testdata/vehicle-with-trailing-arms.toml");
        let vehicle = Vehicle::from_toml(text, "vehicle-with-trailing-arms.toml").unwrap();
        let drawing = linkages(&vehicle).unwrap();
        assert!(!drawing.contains("NaN"));
        assert_eq!(drawing.matches("<circle").count(), 2 * (8 + 5));
        assert!(drawing.contains("3 inner_bushing_m") && drawing.contains("0.280, 0.220, 0.350"));
    }

    #[test]
    fn a_live_axle_is_drawn_whole_with_its_stops_and_curves() {
        let vehicle = Vehicle::builtin("second-vehicle").unwrap();
        let drawing = linkages(&vehicle).unwrap();
        assert!(!drawing.contains("NaN"));
        assert_eq!(drawing.matches("<circle").count(), 2 * (8 + 11));
        assert!(drawing.contains("7 panhard_axle_m") && drawing.contains("-0.150, -0.510, 0.392"));
        // 97.7 mm to the droop stop of the dampers without the pitch of the axle, 70 mm to the bump stop.
        let rear = live_axle::drawn(&vehicle, "rear", Wheel::RearLeft)
            .unwrap()
            .unwrap();
        let travel = &rear.curves[1].points;
        let ends_mm = [travel[0], travel[CURVE_POINTS - 1]].map(|[jounce_m, _]| 1e3 * jounce_m);
        assert!(
            (ends_mm[0] + 97.7).abs() < 6.0 && (ends_mm[1] - 70.0).abs() < 2.0,
            "{ends_mm:?}"
        );
        // The Panhard rod moves the axle sideways by the change of its projection.
        let rod_m = Vector3::new(0.0, 1.0, 0.044);
        let expected_mm = |z_m: f64| {
            let up = rod_m.z + z_m;
            1e3 * ((rod_m.norm_squared() - up * up).sqrt() - rod_m.y)
        };
        for [jounce_m, shift_mm] in &rear.curves[1].points {
            assert!(
                (shift_mm.abs() - expected_mm(-jounce_m).abs()).abs() < 0.3,
                "{jounce_m} {shift_mm}"
            );
        }
    }

    #[test]
    fn a_linkage_without_points_or_without_reach_is_refused_by_name() {
        let mut vehicle = Vehicle::builtin("prowler").unwrap();
        vehicle.front.strut.as_mut().unwrap().bump_stop_length_m = 0.02;
        let error = linkages(&vehicle).unwrap_err().to_string();
        assert!(
            error.contains("front axle does not reach the bump stop")
                && error.contains("[front.wishbone]"),
            "{error}"
        );
        (vehicle.front.wishbone, vehicle.rear.wishbone) = (None, None);
        assert!(matches!(linkages(&vehicle), Err(DrawingError::NoPoints)));
    }
}
