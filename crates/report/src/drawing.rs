//! Drawing of a vehicle's hard-points as SVG: the left corner of each axle from the rear and from above, at
//! bump, design and droop, and the curves of camber, toe and motion ratio. A mistyped coordinate is seen.

use std::fmt::Write;

use model::nalgebra::Vector3;
use model::suspension::{Corner, CornerPose, HardPoints, JouncePoint, SuspensionError};
use model::vehicle::Vehicle;
use sample::Wheel;

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
        "the vehicle file has no hard-points; add [front.wishbone] or [front.macpherson], and [front.strut], or the same \
         of the rear axle"
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
        let Ok(corner) = Corner::of(vehicle, wheel) else {
            continue;
        };
        let Some(drawn) = Drawn::new(vehicle, &corner, axle)? else {
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
         <text x=\"20\" y=\"30\" font-weight=\"bold\">{name}: left corners; design solid, bump thin, droop \
         dashed</text>\n{rows}</svg>\n"
    ))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// What is drawn of one axle.
struct Drawn<'a> {
    axle: &'static str,
    points: &'a HardPoints,
    is_strut: bool,
    /// Design, bump, droop.
    poses: [CornerPose; 3],
    curve: Vec<JouncePoint>,
    radius_m: f64,
    /// Axle ahead of the centre of gravity, m.
    ahead_m: f64,
    /// Middle plane left of the origin, m.
    middle_m: f64,
}

impl<'a> Drawn<'a> {
    fn new(
        vehicle: &Vehicle,
        corner: &'a Corner,
        axle: &'static str,
    ) -> Result<Option<Self>, DrawingError> {
        let of_axle = vehicle.axle(corner.wheel);
        let Some(strut) = &of_axle.strut else {
            return Ok(None);
        };
        let travel = |place| {
            move |source| DrawingError::Travel {
                axle,
                table: if of_axle.wishbone.is_some() {
                    "wishbone"
                } else {
                    "macpherson"
                },
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
        let curve = corner
            .jounce_curve(from_m, to_m, CURVE_POINTS, radius_m)
            .map_err(travel("a position between its stops"))?;
        let is_front = corner.wheel.is_front();
        Ok(Some(Self {
            axle,
            points: &corner.points,
            is_strut: of_axle.wishbone.is_none(),
            poses,
            curve,
            radius_m,
            ahead_m: if is_front {
                vehicle.body.front_axle_to_cg_m
            } else {
                -vehicle.body.cg_to_rear_axle_m
            },
            middle_m: -vehicle.body.cg_y_m,
        }))
    }

    fn write(&self, out: &mut String, top: f64) {
        let outer_m = self.points.wheel_centre.y - self.middle_m + 0.15;
        let size_m = (outer_m + 0.05)
            .max(self.points.strut_chassis.z + 0.1)
            .max(1.0);
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
                least_m: -0.5 * size_m,
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
            self.write_view(out, &view, outer_m, VIEW / size_m);
            out.push_str("</svg>\n");
            let below = [view.left + 6.0, top + VIEW + 48.0];
            label(out, below, "small", view.name);
        }
        let quantities: [(&str, OfJounce); 3] = [
            ("camber, deg", |at| at.camber_rad.to_degrees()),
            ("toe-in, deg", |at| at.toe_in_rad.to_degrees()),
            ("motion ratio", |at| at.motion_ratio),
        ];
        for (number, (name, value)) in quantities.into_iter().enumerate() {
            let at = [880.0, top + 44.0 + 132.0 * number as f64];
            self.write_curve(out, at, name, value);
        }
        for (number, (name, point)) in self.named().into_iter().enumerate() {
            let [x, y, z] = (point - self.origin()).into();
            let at = [1075.0, top + 42.0 + 34.0 * number as f64];
            label(out, at, "small", &format!("{} {name}", number + 1));
            let below = [at[0] + 16.0, at[1] + 14.0];
            label(out, below, "small", &format!("{x:.3}, {y:.3}, {z:.3}"));
        }
    }

    /// The origin of the points of the file, vehicle axes.
    fn origin(&self) -> Vector3<f64> {
        Vector3::new(self.ahead_m, self.middle_m, 0.0)
    }

    /// Points of the file in the design position.
    fn named(&self) -> Vec<(&'static str, Vector3<f64>)> {
        let p = self.points;
        if self.is_strut {
            return vec![
                ("wheel_centre_m", p.wheel_centre),
                ("lower_front_m", p.lower_front),
                ("lower_rear_m", p.lower_rear),
                ("lower_ball_m", p.lower_ball),
                ("strut_top_m", p.strut_chassis),
                ("strut_low_m", p.strut_arm),
                ("tie_rod_inner_m", p.tie_rod_inner),
                ("tie_rod_outer_m", p.tie_rod_outer),
            ];
        }
        vec![
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
        ]
    }

    fn write_view(&self, out: &mut String, view: &View, outer_m: f64, scale: f64) {
        let place = |point: Vector3<f64>| {
            let local = point - self.origin();
            let across = scale * (outer_m - local.y);
            [across, VIEW - scale * (local[view.up] - view.least_m)]
        };
        let mut line = |class: &str, points: &[Vector3<f64>]| {
            let places: Vec<[f64; 2]> = points.iter().map(|point| place(*point)).collect();
            polyline(out, class, &places);
        };
        if view.up == 2 {
            let side = Vector3::new(0.0, 3.0, 0.0);
            line("frame", &[self.origin() - side, self.origin() + side]);
        }
        let p = self.points;
        for (pose, class) in self.poses.iter().zip(["design", "bump", "droop"]) {
            let upper_m = if self.is_strut {
                pose.strut_arm_m
            } else {
                pose.upper_ball_m
            };
            let upright = [upper_m, pose.lower_ball_m, pose.tie_rod_outer_m];
            line(class, &[p.upper_front, pose.upper_ball_m, p.upper_rear]);
            line(class, &[p.lower_front, pose.lower_ball_m, p.lower_rear]);
            line(class, &upright);
            line(class, &[p.strut_chassis, pose.strut_arm_m]);
            line(class, &[pose.tie_rod_inner_m, pose.tie_rod_outer_m]);
            line(class, &self.tread(pose, view.up));
        }
        for (number, (_, point)) in self.named().into_iter().enumerate() {
            let [x, y] = place(point);
            let _ = writeln!(
                out,
                "<circle class=\"point\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/>"
            );
            label(out, [x + 4.0, y - 4.0], "small", &(number + 1).to_string());
        }
    }

    /// The plane of the wheel, as a line of the tyre's diameter through the wheel centre.
    fn tread(&self, pose: &CornerPose, up: usize) -> [Vector3<f64>; 2] {
        let axis = if up == 2 { Vector3::z() } else { Vector3::x() };
        let along = (axis - pose.spindle * pose.spindle.dot(&axis)).normalize() * self.radius_m;
        [pose.wheel_centre_m - along, pose.wheel_centre_m + along]
    }

    /// A quantity over the travel of the wheel.
    fn write_curve(&self, out: &mut String, [left, top]: [f64; 2], name: &str, value: OfJounce) {
        const SIZE: [f64; 2] = [175.0, 80.0];
        let range = |values: &dyn Fn(&JouncePoint) -> f64| {
            let all = self.curve.iter().map(values);
            let (least, most) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| {
                (a.min(value), b.max(value))
            });
            // A constant is drawn as a level line in the middle.
            let margin = (1e-3 - 0.5 * (most - least)).max(0.0);
            [least - margin, most + margin]
        };
        let [from_m, to_m] = range(&|at| at.jounce_m);
        let [least, most] = range(&value);
        let places = self.curve.iter().map(|at| {
            let across = (at.jounce_m - from_m) / (to_m - from_m);
            let up = (value(at) - least) / (most - least);
            [left + SIZE[0] * across, top + SIZE[1] * (1.0 - up)]
        });
        let places: Vec<[f64; 2]> = places.collect();
        let _ = writeln!(
            out,
            "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/>",
            SIZE[0], SIZE[1]
        );
        polyline(out, "design", &places);
        let text = format!("{name}: {least:.2} to {most:.2}");
        label(out, [left, top - 6.0], "small", &text);
        let travel = format!("wheel travel {:.0} to {:.0} mm", 1e3 * from_m, 1e3 * to_m);
        label(out, [left, top + SIZE[1] + 14.0], "small", &travel);
    }
}

/// A quantity over the travel of a wheel.
type OfJounce = fn(&JouncePoint) -> f64;

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
            drawing.contains("&lt;b&gt;&amp;: left corners"),
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
