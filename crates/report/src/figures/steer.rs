//! Steer angles of the front wheels.

use model::steering::{SteeringGear, Toe, ackermann};
use model::vehicle::Vehicle;

use super::curves::{Curves, Spec};
use super::{Candidate, panel, timed};
use crate::drive::Drive;
use crate::options::Quantity;
use crate::plot::{Panel, Pen, Trace};
use crate::score::vehicle_of;

const WHEELS: [(&str, &str); 2] = [
    ("road wheel FL", "fl.steer_rad"),
    ("road wheel FR", "fr.steer_rad"),
];
const STEERING_WHEEL: &str = "steering_wheel_rad";

/// The steer angles; if sensors at the wheels measure them, also their difference and what they differ from the
/// steering gear.
pub fn all(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let drive = curves.drive;
    let mut traces: Vec<Trace> = Vec::new();
    for (index, (name, column)) in WHEELS.into_iter().enumerate() {
        let spec = Spec::new(name, column, Quantity::Angle).pen(Pen::Other(index + 1));
        traces.extend(curves.curve(&drive.motion, spec));
    }
    let steering = drive.sensors.values().filter_map(|frame| {
        let tenth = frame.get(STEERING_WHEEL)?.iter();
        let tenth = tenth.map(|angle| angle.to_degrees() / 10.0).collect();
        Some((frame, tenth))
    });
    for (frame, tenth) in steering.collect::<Vec<(_, Vec<f32>)>>() {
        let spec = Spec::new("steering wheel / 10", "", Quantity::Angle).pen(Pen::Other(0));
        traces.extend(curves.of_values(&frame.time_s, tenth, None, spec));
    }
    let mut panels = vec![panel("angle (deg)", traces)];
    let mut caption =
        "Steering wheel, and both front wheels by the steering map or the linkage.".to_owned();
    if let Some(vehicle) = vehicle_of(&drive.attachments).filter(|_| has_wheel_angles(drive)) {
        panels.extend(beside(curves, &vehicle));
        caption = format!(
            "Steering wheel, and both front wheels by their sensors; left wheel less right wheel, beside Ackermann's \
             geometry for the same mean; each wheel less the angle that steering wheel and rack give at the design \
             height, which contains the steer of the springs' travel.{}",
            toe(&vehicle)
        );
    }
    let mut figure = timed("steer", "Steer angle", "", panels);
    figure.caption = caption.into();
    all.push((
        figure,
        "the log has no steering wheel and no estimated steer angles",
    ));
}

/// Whether sensors at the front wheels measured their angles.
fn has_wheel_angles(drive: &Drive) -> bool {
    let mut sensors = drive.sensors.values();
    sensors.any(|frame| {
        let mut names = sample::ControlSample::WHEEL_ANGLE.iter();
        names.any(|name| frame.get(name).is_some())
    })
}

/// Compliance and play of the vehicle file, in words; empty for rigid links.
fn toe(vehicle: &Vehicle) -> String {
    let toe = Toe::of(vehicle);
    if toe.is_rigid() {
        return String::new();
    }
    let [left, right] = toe.compliance_rad_n.map(|c| (1e3 * c).to_degrees());
    let [play_left, play_right] = toe.play_rad.map(f64::to_degrees);
    format!(
        " The vehicle file has a toe compliance of {left:.2} (left) and {right:.2} deg/kN (right) and a play of \
         {play_left:.2} and {play_right:.2} deg."
    )
}

fn beside(curves: &mut Curves<'_>, vehicle: &Vehicle) -> Vec<Panel> {
    let drive = curves.drive;
    let Some([left, right]) = angles(drive) else {
        return Vec::new();
    };
    let time_s = &drive.motion.time_s;
    let pairs = || {
        left.iter()
            .zip(right)
            .map(|(left, right)| [f64::from(*left), f64::from(*right)])
    };
    let measured = pairs().map(|[left, right]| degrees(left - right)).collect();
    let by_geometry = pairs().map(|[left, right]| {
        let mean = 0.5 * (left + right);
        let [left, right] = ackermann(mean, vehicle.wheelbase_m(), vehicle.front.track_m);
        degrees(left - right)
    });
    let by_geometry = by_geometry.collect();
    let spec = |name, pen| Spec::new(name, "", Quantity::Angle).pen(pen);
    let differences = [
        curves.of_values(
            time_s,
            measured,
            None,
            spec("left less right", Pen::Measured),
        ),
        curves.of_values(time_s, by_geometry, None, spec("Ackermann", Pen::Other(0))),
    ];
    let mut panels = vec![panel(
        "left less right (deg)",
        differences.into_iter().flatten(),
    )];
    let gear = SteeringGear::from_vehicle(vehicle).ok();
    let steering_wheel = drive
        .sensors
        .values()
        .find(|frame| frame.get(STEERING_WHEEL).is_some());
    if let (Some(gear), Some(frame)) = (gear, steering_wheel) {
        let read = frame.get(STEERING_WHEEL).unwrap_or_default();
        let held: Vec<f64> = held(&frame.time_s, read, time_s);
        let mut traces = Vec::new();
        for (side, wheel) in [left, right].into_iter().enumerate() {
            let rest = wheel.iter().zip(&held).map(|(angle, steering_wheel)| {
                degrees(f64::from(*angle) - gear.road_wheels(*steering_wheel, 0.0)[side])
            });
            let spec = spec(WHEELS[side].0, Pen::Other(side + 1));
            traces.extend(curves.of_values(time_s, rest.collect(), None, spec));
        }
        panels.push(panel("beside the rack (deg)", traces));
    }
    panels
}

fn angles(drive: &Drive) -> Option<[&[f32]; 2]> {
    let [left, right] = WHEELS.map(|(_, column)| drive.motion.get(column));
    Some([left?, right?])
}

fn degrees(angle_rad: f64) -> f32 {
    angle_rad.to_degrees() as f32
}

/// The last value at each instant; `NaN` before the first.
fn held(time_s: &[f64], values: &[f32], at_s: &[f64]) -> Vec<f64> {
    let last = |at_s: &f64| {
        let after = time_s.partition_point(|known_s| known_s <= at_s);
        let before = after.checked_sub(1).and_then(|row| values.get(row));
        before.map_or(f64::NAN, |value| f64::from(*value))
    };
    at_s.iter().map(last).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_held_until_the_next() {
        let held = held(&[1.0, 2.0], &[5.0, 7.0], &[0.5, 1.0, 1.9, 2.5]);
        assert!(held[0].is_nan());
        assert_eq!(held[1..], [5.0, 5.0, 7.0]);
    }

    #[test]
    fn compliance_and_play_are_told_in_degrees() {
        let mut vehicle = Vehicle::builtin("prowler").unwrap();
        assert_eq!(toe(&vehicle), "");
        vehicle.steering.toe_compliance_rad_n = [1.75e-5, 0.0];
        vehicle.steering.toe_play_rad = [0.0, 0.0087];
        let text = toe(&vehicle);
        assert!(text.contains("1.00 (left) and 0.00 deg/kN") && text.contains("0.00 and 0.50 deg"));
    }
}
