//! The controllers' lines, read back by the project's decoder.

use atvrec_sim::{Emission, Manoeuvre, Options, Port, VirtualVehicle};
use sample::Measurement;

use crate::support::{bytes_of, sensors, vehicle};

/// Values of a controller's lines in order, 50 a second from time zero.
fn values(emissions: &[Emission], port: Port) -> Vec<f64> {
    let format = port.line_format().expect("a controller");
    let mut decoder = wire::line::Decoder::new(format).expect("a working format");
    let mut values = Vec::new();
    decoder.push(&bytes_of(emissions, port), |item| {
        for measurement in item.measurements.iter() {
            let Measurement::Control(control) = measurement else {
                panic!("{measurement:?}");
            };
            values.push(control.values[0].value);
        }
    });
    assert_eq!(decoder.statistics().malformed, 0);
    values
}

fn drive(manoeuvre: Manoeuvre) -> (VirtualVehicle, Vec<Emission>) {
    let vehicle = vehicle();
    let motion = manoeuvre.drive(&vehicle).expect("a motion");
    let mut driven = VirtualVehicle::new(motion, &vehicle, &sensors(), &Options::default(), 1)
        .expect("it drives");
    let emissions = driven.by_ref().collect();
    (driven, emissions)
}

#[test]
fn the_steering_controller_counts_the_steering_wheel() {
    let (driven, emissions) = drive(Manoeuvre::StepSteer);
    let angles_rad = values(&emissions, Port::Steering);
    assert_eq!(angles_rad.len(), 14 * 50 + 1);
    let half_count_rad = std::f64::consts::PI / 4000.0;
    for (row, angle_rad) in angles_rad.iter().enumerate() {
        let truth_rad = driven.truth_at(row as f64 / 50.0).steering_wheel_rad;
        assert!(
            (angle_rad - truth_rad).abs() <= half_count_rad + 1e-9,
            "row {row}"
        );
    }
    assert!(angles_rad.iter().any(|angle_rad| *angle_rad > 1.5));
}

#[test]
fn throttle_and_brake_follow_the_drive() {
    let (_, emissions) = drive(Manoeuvre::LaunchBrake);
    let (throttle, brake_rad) = (
        values(&emissions, Port::Throttle),
        values(&emissions, Port::Brake),
    );
    // 3 m/s^2 of the 0.5 g of an open throttle at 4 s, 0.5 g of the brake's 1 g at 9.5 s.
    let (launch, braking) = (4 * 50, 9 * 50 + 25);
    assert!(
        (throttle[launch] - 0.62).abs() < 0.05,
        "{}",
        throttle[launch]
    );
    assert_eq!(brake_rad[launch], 0.0);
    assert_eq!(throttle[braking], 0.0);
    let half_travel_rad = 0.5 * std::f64::consts::PI;
    assert!(
        (brake_rad[braking] - half_travel_rad).abs() < 0.2,
        "{}",
        brake_rad[braking]
    );
    assert_eq!(
        (throttle[10], brake_rad[10]),
        (0.0, 0.0),
        "at rest before the launch"
    );
}
