//! Whether the points of a corner fit its axle, and whether its linkage reaches its travel.

use sample::Wheel;

use super::{Contradiction, triangle};
use crate::suspension::{Corner, LinkedAxle, SuspensionError};
use crate::vehicle::{Axle, FiveLink, LiveAxle, Macpherson, Strut, TrailingArm, Vehicle};

/// Largest distance of a strut's mount from the line between the joints of its link, m.
const OFF_LINE_M: f64 = 0.005;

/// Whether the hard-points of an axle fit it.
pub(super) fn points(name: &str, axle: &Axle, found: &mut Vec<Contradiction>) {
    if let Some(corner) = &axle.wishbone {
        left_hand(
            &format!("{name}.wishbone"),
            &[
                ("wheel_centre_m", corner.wheel_centre_m),
                ("upper_ball_m", corner.upper_ball_m),
                ("lower_ball_m", corner.lower_ball_m),
            ],
            found,
        );
    }
    if let Some(corner) = &axle.macpherson {
        macpherson(name, axle, corner, found);
    }
    if let Some(corner) = &axle.five_link {
        five_link(name, axle, corner, found);
    }
    if let Some(corner) = &axle.trailing_arm {
        trailing_arm(name, axle, corner, found);
    }
    one_linkage(name, axle, found);
    if let Some(live) = &axle.live_axle {
        let points = [
            ("wheel_centre_m", live.wheel_centre_m),
            ("lower_link_axle_m", live.lower_link_axle_m),
            ("upper_link_axle_m", live.upper_link_axle_m),
            ("spring_axle_m", live.spring_axle_m),
            ("damper_axle_m", live.damper_axle_m),
        ];
        solid_axle((name, "live_axle"), axle, live, &points, found);
    }
    if let Some(leaf) = &axle.leaf_axle {
        let points = [
            ("wheel_centre_m", leaf.wheel_centre_m),
            ("seat_m", leaf.seat_m),
            ("eye_body_m", leaf.eye_body_m),
            ("damper_axle_m", leaf.damper_axle_m),
        ];
        solid_axle((name, "leaf_axle"), axle, &leaf.on_links(), &points, found);
        if leaf.spring_body_m[2] <= leaf.seat_m[2] {
            found.push((
                format!("{name}.leaf_axle.spring_body_m"),
                leaf.spring_body_m[2].to_string(),
                format!("is not above seat_m ({})", leaf.seat_m[2]),
                "give a point of the body above the seat: the length of the spring is the distance between them"
                    .into(),
            ));
        }
    }
}

/// Tables that describe the same corner.
fn one_linkage(name: &str, axle: &Axle, found: &mut Vec<Contradiction>) {
    let mut tables = axle.linkage_tables();
    let first = tables.next();
    for other in tables {
        found.push((
            format!("{name}.{other}"),
            String::new(),
            format!(
                "and [{name}.{}] describe the same corner",
                first.unwrap_or_default()
            ),
            "keep the table of the linkage that the axle has".into(),
        ));
    }
}

fn five_link(name: &str, axle: &Axle, corner: &FiveLink, found: &mut Vec<Contradiction>) {
    let table = format!("{name}.five_link");
    left_hand(
        &table,
        &[
            ("wheel_centre_m", corner.wheel_centre_m),
            ("upper_front_outer_m", corner.upper_front_outer_m),
            ("upper_rear_outer_m", corner.upper_rear_outer_m),
            ("lower_front_outer_m", corner.lower_front_outer_m),
            ("lower_rear_outer_m", corner.lower_rear_outer_m),
            ("tie_rod_outer_m", corner.tie_rod_outer_m),
            ("strut_mount_m", corner.strut_mount_m),
        ],
        found,
    );
    strut_above(
        &table,
        ("strut_mount_m", corner.strut_mount_m),
        corner.strut_chassis_m,
        found,
    );
    if let Some(link) = corner.strut_on.link() {
        let [inner, outer] = corner.links_m()[link].map(nalgebra::Vector3::from);
        let along = outer - inner;
        let from_inner = nalgebra::Vector3::from(corner.strut_mount_m) - inner;
        let part = from_inner.dot(&along) / along.norm_squared();
        let off_m = (from_inner - along * part).norm();
        if off_m > OFF_LINE_M || !(part > 0.0 && part < 1.0) {
            found.push((
                format!("{table}.strut_mount_m"),
                format!("{:?}", corner.strut_mount_m),
                format!(
                    "is {:.1} mm off the line between the joints of the link that strut_on names, at {part:.2} of its \
                     length from the body",
                    1e3 * off_m
                ),
                "give a point between both joints, at most 5 mm off their line".into(),
            ));
        }
    }
    let centres = axle.unsprung.as_ref().map_or([false; 2], |unsprung| {
        [
            unsprung.upper_arm_cg_m.is_some(),
            unsprung.lower_arm_cg_m.is_some(),
        ]
    });
    let fields = ["upper_arm_cg_m", "lower_arm_cg_m"];
    for (field, _) in fields.iter().zip(centres).filter(|(_, given)| *given) {
        found.push((
            format!("{name}.unsprung.{field}"),
            String::new(),
            "but the centre of gravity of each of the five links is its middle".into(),
            "leave the field out".into(),
        ));
    }
}

fn trailing_arm(name: &str, axle: &Axle, corner: &TrailingArm, found: &mut Vec<Contradiction>) {
    let table = format!("{name}.trailing_arm");
    if name == "front" {
        found.push((
            table.clone(),
            String::new(),
            "is an arm whose wheel is not steered, for which the front axle has no model".into(),
            "leave the table out: the front axle is then one without a linkage".into(),
        ));
    }
    left_hand(
        &table,
        &[
            ("wheel_centre_m", corner.wheel_centre_m),
            ("outer_bushing_m", corner.outer_bushing_m),
            ("strut_arm_m", corner.strut_arm_m),
        ],
        found,
    );
    strut_above(
        &table,
        ("strut_arm_m", corner.strut_arm_m),
        corner.strut_chassis_m,
        found,
    );
    let [[_, outer_y, _], [_, inner_y, _]] = [corner.outer_bushing_m, corner.inner_bushing_m];
    if outer_y <= inner_y {
        found.push((
            format!("{table}.outer_bushing_m"),
            outer_y.to_string(),
            format!("is not farther from the middle plane than inner_bushing_m ({inner_y})"),
            "swap both points".into(),
        ));
    }
    let arm_kg = axle.unsprung.as_ref().map_or(0.0, |u| u.upper_arm_mass_kg);
    if arm_kg > 0.0 {
        found.push((
            format!("{name}.unsprung.upper_arm_mass_kg"),
            arm_kg.to_string(),
            "but a trailing arm has no upper arm".into(),
            "write 0.0; the arm is lower_arm_mass_kg".into(),
        ));
    }
}

/// Whether the end of the strut at the body is above the other.
fn strut_above(
    table: &str,
    (field, [_, _, low_m]): (&str, [f64; 3]),
    [_, _, chassis_m]: [f64; 3],
    found: &mut Vec<Contradiction>,
) {
    if chassis_m <= low_m {
        found.push((
            format!("{table}.strut_chassis_m"),
            chassis_m.to_string(),
            format!("is not above {field} ({low_m})"),
            "the end at the chassis is the upper one".into(),
        ));
    }
}

fn left_hand(table: &str, points: &[(&str, [f64; 3])], found: &mut Vec<Contradiction>) {
    for (point, [_, y, _]) in points {
        if *y <= 0.0 {
            found.push((
                format!("{table}.{point}"),
                y.to_string(),
                "lies on the right-hand side".into(),
                "give the left corner's points: y is positive to the left".into(),
            ));
        }
    }
}

fn macpherson(name: &str, axle: &Axle, corner: &Macpherson, found: &mut Vec<Contradiction>) {
    let table = format!("{name}.macpherson");
    left_hand(
        &table,
        &[
            ("wheel_centre_m", corner.wheel_centre_m),
            ("lower_ball_m", corner.lower_ball_m),
            ("strut_top_m", corner.strut_top_m),
        ],
        found,
    );
    if corner.strut_top_m[2] <= corner.strut_low_m[2] {
        found.push((
            format!("{table}.strut_top_m"),
            corner.strut_top_m[2].to_string(),
            format!("is not above strut_low_m ({})", corner.strut_low_m[2]),
            "the top is the ball joint at the body".into(),
        ));
    }
    let arm_kg = axle.unsprung.as_ref().map_or(0.0, |u| u.upper_arm_mass_kg);
    if arm_kg > 0.0 {
        found.push((
            format!("{name}.unsprung.upper_arm_mass_kg"),
            arm_kg.to_string(),
            "but a MacPherson strut has no upper arm".into(),
            "write 0.0; the strut's tube belongs to upright_mass_kg".into(),
        ));
    }
}

fn solid_axle(
    (name, table): (&str, &str),
    axle: &Axle,
    live: &LiveAxle,
    points: &[(&str, [f64; 3])],
    found: &mut Vec<Contradiction>,
) {
    let both = axle.live_axle.is_some() && table == "leaf_axle";
    let other = both.then_some("live_axle").or(axle.linkage_table());
    let table = format!("{name}.{table}");
    if name == "front" {
        found.push((
            table.clone(),
            String::new(),
            "is a solid axle that is steered, for which there is no model".into(),
            "leave the table out: the front axle is then one without a linkage".into(),
        ));
    }
    if let Some(other) = other {
        found.push((
            table.clone(),
            String::new(),
            format!("and [{name}.{other}] describe the same axle"),
            "keep the table of the linkage that the axle has".into(),
        ));
    }
    left_hand(&table, points, found);
    triangle(&table, live.inertia_kg_m2, found);
    let arms_kg = axle.unsprung.as_ref().map_or(0.0, |unsprung| {
        unsprung.upper_arm_mass_kg + unsprung.lower_arm_mass_kg
    });
    if arms_kg > 0.0 {
        found.push((
            format!("{name}.unsprung.lower_arm_mass_kg"),
            arms_kg.to_string(),
            "with that of the upper arm, but a solid axle has no arms".into(),
            "write 0.0 for both; half of the axle without its wheels is upright_mass_kg".into(),
        ));
    }
    let [_, half_track_m, _] = live.wheel_centre_m;
    if let Some(y_m) = live.section_y_m.filter(|y_m| *y_m >= half_track_m) {
        found.push((
            format!("{table}.section_y_m"),
            y_m.to_string(),
            format!("lies outboard of the wheel centre ({half_track_m})"),
            "give the distance of the gauges on the tube from the middle plane".into(),
        ));
    }
    let of_section = [
        ("end_mass_kg", live.end_mass_kg.is_some()),
        ("end_cg_m", live.end_cg_m.is_some()),
    ];
    for (field, _) in of_section.iter().filter(|(_, given)| *given) {
        if live.section_y_m.is_none() {
            found.push((
                format!("{table}.{field}"),
                String::new(),
                "is of the part outboard of section_y_m, which is missing".into(),
                "add section_y_m, or leave this field out".into(),
            ));
        }
    }
}

/// Whether the linkage of an axle can be built and reaches the stops of its strut.
pub(super) fn travel(vehicle: &Vehicle, name: &'static str, found: &mut Vec<Contradiction>) {
    let wheel = if name == "front" {
        Wheel::FrontLeft
    } else {
        Wheel::RearLeft
    };
    let axle = vehicle.axle(wheel);
    let (table, ends) = if let Some(table) = axle.linkage_table() {
        (table, corner_ends(vehicle, wheel, axle.strut.as_ref()))
    } else if axle.live_axle.is_some() && name == "rear" {
        ("live_axle", axle_ends(vehicle, axle.strut.as_ref()))
    } else {
        return;
    };
    let remedy = format!("check the points of [{name}.{table}] and the lengths of [{name}.strut]");
    match ends {
        Ok(unreached) => found.extend(unreached.into_iter().map(|(field, value, error)| {
            (
                format!("{name}.strut.{field}"),
                value.to_string(),
                format!("is a length that the linkage does not reach: {error}"),
                remedy.clone(),
            )
        })),
        Err(error) => found.push((
            format!("{name}.{table}"),
            String::new(),
            error.to_string(),
            remedy,
        )),
    }
}

/// Lengths of a strut that are not reached: field, value, reason.
type Unreached = Vec<(&'static str, f64, SuspensionError)>;

fn corner_ends(
    vehicle: &Vehicle,
    wheel: Wheel,
    strut: Option<&Strut>,
) -> Result<Unreached, SuspensionError> {
    let corner = Corner::of(vehicle, wheel)?;
    Ok(unreached(strut, |travel_m| {
        let length_m = corner.design_strut_length_m() + travel_m;
        corner.pose(length_m, 0.0).map(|_| ())
    }))
}

/// The droop stop of a live axle is in its dampers.
fn axle_ends(vehicle: &Vehicle, strut: Option<&Strut>) -> Result<Unreached, SuspensionError> {
    let axle = LinkedAxle::of(vehicle)?;
    let mut found = unreached(strut, |travel_m| {
        let lengths_m = axle.design_lengths_m().map(|length_m| length_m + travel_m);
        axle.pose(lengths_m).map(|_| ())
    });
    found.retain(|(field, ..)| *field == "bump_stop_length_m");
    Ok(found)
}

fn unreached(
    strut: Option<&Strut>,
    reach: impl Fn(f64) -> Result<(), SuspensionError>,
) -> Unreached {
    let Some(strut) = strut else {
        return Vec::new();
    };
    let ends = [
        ("bump_stop_length_m", strut.bump_stop_length_m),
        ("droop_stop_length_m", strut.droop_stop_length_m),
    ];
    let failed = ends.into_iter().filter_map(|(field, length_m)| {
        let error = reach(length_m - strut.design_length_m).err()?;
        Some((field, length_m, error))
    });
    failed.collect()
}
