//! Roll centres from hard-points, as functions of jounce.

use model::suspension::Corner;
use model::vehicle::Vehicle;
use sample::Wheel;

use super::drive::series;
use crate::finding::{Figure, Finding, Findings, Refusal, Span};

const WHAT: &str = "roll centre";
/// Jounce that is looked at, m.
const JOUNCE_M: f64 = 0.06;
const POINTS: usize = 25;

/// The kinematic roll centre's height above ground of both axles, in the design position and over
/// jounce, from the vehicle file's hard-points.
///
/// Findings: `roll_centre_height_front`, `roll_centre_height_rear` (m). Beside: what the file says
/// for models without hard-points, the slope over jounce (m/m), the motion ratio.
///
/// # Errors
/// A vehicle file without hard-points, or with some that do not assemble.
pub fn identify(vehicle: &Vehicle) -> Result<Findings, Refusal> {
    let mut found = Findings {
        what: WHAT.to_owned(),
        ..Findings::default()
    };
    let mut curves = Vec::new();
    let axles = [
        ("front", Wheel::FrontLeft, &vehicle.front),
        ("rear", Wheel::RearLeft, &vehicle.rear),
    ];
    for (name, wheel, axle) in axles {
        let missing = |help: String| Refusal::Missing {
            what: WHAT.to_owned(),
            channel: format!("{name} hard-points that assemble"),
            help,
        };
        let corner = Corner::of(vehicle, wheel).map_err(|error| missing(error.to_string()))?;
        let radius_m = corner
            .pose_at_jounce(0.0, 0.0)
            .map(|pose| pose.wheel_centre_m.z)
            .map_err(|error| missing(error.to_string()))?;
        // Travel ends where the linkage does.
        let points: Vec<_> = (0..POINTS)
            .map(|k| JOUNCE_M * (2.0 * k as f64 / (POINTS - 1) as f64 - 1.0))
            .filter_map(|jounce| corner.jounce_point(jounce, radius_m).ok())
            .collect();
        let at = corner
            .jounce_point(0.0, radius_m)
            .map_err(|error| missing(error.to_string()))?;
        found.findings.push(Finding {
            name: format!("roll_centre_height_{name}"),
            value: at.roll_centre_height_m,
            unit: "m".to_owned(),
            sigma: f64::NAN,
            interval: None,
            condition: f64::NAN,
            excitation: None,
            whiteness: None,
            span: Span::default(),
        });
        let mut add = |what: &str, value: f64, unit: &str| {
            found
                .beside
                .push((format!("{what}_{name}"), value, unit.to_owned()));
        };
        add(
            "vehicle_file_roll_centre_height",
            axle.roll_centre_height_m,
            "m",
        );
        if let (Some(first), Some(last)) = (points.first(), points.last()) {
            let rise = last.roll_centre_height_m - first.roll_centre_height_m;
            add(
                "roll_centre_rise_over_jounce",
                rise / (last.jounce_m - first.jounce_m),
                "m/m",
            );
        }
        add("motion_ratio", at.motion_ratio, "-");
        curves.push(series(
            name,
            true,
            points.iter().map(|point| point.jounce_m).collect(),
            points
                .iter()
                .map(|point| point.roll_centre_height_m)
                .collect(),
        ));
    }
    found.figures = vec![Figure {
        title: "Roll centre's height over jounce".to_owned(),
        x_label: "jounce (m)".to_owned(),
        y_label: "height above ground (m)".to_owned(),
        series: curves,
    }];
    Ok(found)
}

/// The vehicle with its linkages' roll centres, about which a body on its springs rolls, in the
/// place of the file's; as it is without hard-points.
#[must_use]
pub fn of_linkage(vehicle: &Vehicle) -> Vehicle {
    let mut vehicle = vehicle.clone();
    if let Ok(found) = identify(&vehicle) {
        let height_m = |axle: &str| found.value(&format!("roll_centre_height_{axle}"))[0];
        vehicle.front.roll_centre_height_m = height_m("front");
        vehicle.rear.roll_centre_height_m = height_m("rear");
    }
    vehicle
}
