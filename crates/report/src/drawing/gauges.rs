//! Stress along the members of a corner under a load, with the places of the gauges, as SVG.

use std::fmt::Write;

use model::suspension::{Gauge, GaugeTable, MemberBeam};
use model::vehicle::Vehicle;
use sample::{StrainChannel, Wheel};

use super::{STYLE, escaped, label, polyline};

/// Width and height of a panel, and the distance of panels.
const PANEL: [f64; 2] = [215.0, 150.0];
const STEP: [f64; 2] = [240.0, 240.0];
const TOP: f64 = 70.0;
const LEFT: f64 = 20.0;
/// Points of a line.
const POINTS: usize = 41;
/// Pa in a MPa.
const MEGA: f64 = 1e6;

/// A load and its stresses.
pub struct LoadedCorner<'a> {
    /// The wheel.
    pub wheel: Wheel,
    /// Force of the ground on the tyre, contact frame, N.
    pub force_n: [f64; 3],
    /// Members and bridges.
    pub table: &'a GaugeTable,
}

/// The stresses of each load, a row each. Solid: axial stress; thin: with the bending of the upper outer fibre;
/// dashed: with that of the lower one. A circle is a gauge, a vertical line the mount of the strut.
#[must_use]
pub fn stresses(vehicle: &Vehicle, loads: &[LoadedCorner<'_>]) -> String {
    let mut rows = String::new();
    for (number, load) in loads.iter().enumerate() {
        write_row(&mut rows, vehicle, load, TOP + STEP[1] * number as f64);
    }
    let width = LEFT + STEP[0] * 5.0;
    let height = TOP + STEP[1] * loads.len() as f64;
    let name = escaped(&vehicle.name);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\"><style>{STYLE}</style><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\
         <text x=\"20\" y=\"28\" font-weight=\"bold\">{name}: stress along the members; solid axial, thin and dashed \
         with bending of the upper and lower outer fibre, circle gauge, vertical line strut</text>\n{rows}</svg>\n"
    )
}

fn write_row(out: &mut String, vehicle: &Vehicle, load: &LoadedCorner<'_>, top: f64) {
    let [x, y, z] = load.force_n;
    let title = format!("{}: F_x {x:.0} N, F_y {y:.0} N, F_z {z:.0} N", load.wheel);
    label(out, [LEFT, top - 22.0], "", &title);
    let largest_pa = load
        .table
        .beams
        .iter()
        .flat_map(|beam| curve(load.table, beam))
        .flat_map(|(_, [axial, upper, lower])| [axial, upper, lower])
        .fold(1e5, |largest: f64, stress| largest.max(stress.abs()));
    for (number, beam) in load.table.beams.iter().enumerate() {
        let left = LEFT + STEP[0] * number as f64;
        write_panel(out, load.table, beam, [left, top], largest_pa);
        let name = vehicle.channel_name(load.wheel, beam.channel);
        label(
            out,
            [left, top - 6.0],
            "small",
            &format!("{name}, ±{:.0} MPa", largest_pa / MEGA),
        );
        let below = format!("0 to {:.0} mm from the outer joint", 1e3 * beam.length_m);
        label(out, [left, top + PANEL[1] + 14.0], "small", &below);
    }
}

/// Axial stress, and stress of the upper and of the lower fibre, at distances from the outer joint, Pa.
fn curve(table: &GaugeTable, beam: &MemberBeam) -> Vec<(f64, [f64; 3])> {
    (0..POINTS)
        .map(|k| {
            let distance_m = beam.length_m * k as f64 / (POINTS - 1) as f64;
            let axial = beam.tension_n(distance_m) / table.section.area_m2();
            let bending = beam.moment_n_m(distance_m) / table.section.section_modulus_m3();
            // An upward force on the outer joint presses the upper fibre.
            (distance_m, [axial, axial - bending, axial + bending])
        })
        .collect()
}

fn write_panel(
    out: &mut String,
    table: &GaugeTable,
    beam: &MemberBeam,
    [left, top]: [f64; 2],
    largest_pa: f64,
) {
    let place = |distance_m: f64, stress_pa: f64| {
        [
            left + PANEL[0] * distance_m / beam.length_m,
            top + 0.5 * PANEL[1] * (1.0 - stress_pa / largest_pa),
        ]
    };
    let _ = writeln!(
        out,
        "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/>",
        PANEL[0], PANEL[1]
    );
    polyline(out, "frame", &[place(0.0, 0.0), place(beam.length_m, 0.0)]);
    if let Some(mount_m) = beam.mount_m {
        polyline(
            out,
            "frame",
            &[place(mount_m, -largest_pa), place(mount_m, largest_pa)],
        );
    }
    let points = curve(table, beam);
    for (k, class) in ["design", "bump", "droop"].into_iter().enumerate() {
        let places: Vec<[f64; 2]> = points
            .iter()
            .map(|(at, stress)| place(*at, stress[k]))
            .collect();
        polyline(out, class, &places);
    }
    for gauge in table.gauges.iter().filter(|gauge| is_on(gauge, beam)) {
        let [x, y] = place(gauge.distance_m, gauge.axial_stress_pa);
        let _ = writeln!(
            out,
            "<circle class=\"point\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\"/>"
        );
    }
}

/// Whether a bridge is on a member.
fn is_on(gauge: &Gauge, beam: &MemberBeam) -> bool {
    let member = match gauge.channel {
        StrainChannel::LowerFrontBending => StrainChannel::LowerFront,
        StrainChannel::LowerRearBending => StrainChannel::LowerRear,
        channel => channel,
    };
    member == beam.channel
}

#[cfg(test)]
mod tests {
    use model::sensors::Sensors;
    use model::suspension::{GaugeLoad, gauges};

    use super::*;

    #[test]
    fn each_load_has_a_row_with_its_members_and_gauges() {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let sensors = Sensors::builtin("full-bridge-16bit-bending").unwrap();
        let load = GaugeLoad {
            wheel: Wheel::FrontLeft,
            force_n: [0.0, 800.0, 1327.0],
            compression_m: 0.0,
            axial_distance_m: None,
        };
        let table = gauges(&vehicle, &sensors, &load).unwrap();
        let row = || LoadedCorner {
            wheel: load.wheel,
            force_n: load.force_n,
            table: &table,
        };
        let drawing = stresses(&vehicle, &[row(), row()]);
        assert!(!drawing.contains("NaN"));
        assert_eq!(drawing.matches("<circle").count(), 2 * 7);
        assert_eq!(drawing.matches("class=\"bump\"").count(), 2 * 5);
        assert_eq!(
            drawing
                .matches("FL: F_x 0 N, F_y 800 N, F_z 1327 N")
                .count(),
            2
        );
    }
}
