//! Estimates as text in `testdata/golden`, so that a change of a number is a difference that somebody
//! reviews. `make golden` writes the files again.

use std::fmt::Write;

use atvrec_estimator::{Calibration, Settings};
use model::sensors::Sensors;
use sample::{Estimate, Wheel};
use testkit::scoring::estimate;
use testkit::{assert_file, sensing, truth};

/// Excerpts, sensors files, and seeds of the noise, which are not among those for scoring.
const CASES: [(&str, &str, u64); 2] = [
    ("c_sine03", "thesis-10bit", 11),
    ("f_launch_brake", "full-bridge-16bit-bending", 12),
];
/// One estimate of this many is a line: five a second.
const EVERY: usize = 20;

#[test]
fn estimates_are_those_of_the_golden_files() {
    for (name, sensors_name, seed) in CASES {
        let vehicle = truth::vehicle();
        let sensors = Sensors::builtin(sensors_name).unwrap();
        let calibration = Calibration::nominal(&vehicle.name);
        let samples = truth::excerpt(name).samples(sensors_name, seed);
        let settings = Settings::default();
        let result = estimate(vehicle, &sensors, &calibration, settings, samples);
        let mut text = header();
        for estimate in result.estimates.iter().step_by(EVERY) {
            line(&mut text, estimate);
        }
        assert!(text.lines().count() > 50, "{name}: {text}");
        assert_file(&format!("testdata/golden/{name}.csv"), &text);
    }
}

fn header() -> String {
    let mut text = "time_s,speed_x_m_s,speed_y_m_s,sideslip_rad,roll_rad,pitch_rad,yaw_rate_rad_s,\
                    load_transfer_ratio"
        .to_owned();
    for wheel in Wheel::ALL {
        for axis in ["x", "y", "z"] {
            write!(text, ",{wheel}_f{axis}_n,{wheel}_f{axis}_sigma_n").unwrap();
        }
    }
    text.push('\n');
    text
}

/// Six decimals of motion and three of forces: a difference in the last bit, which the logarithm of
/// another C library makes in the noise, does not show.
fn line(text: &mut String, estimate: &Estimate) {
    let motion = &estimate.motion;
    write!(text, "{:.2}", estimate.time.seconds_since(sensing::START)).unwrap();
    for value in [
        motion.velocity_x_m_s,
        motion.velocity_y_m_s,
        motion.sideslip_rad,
        motion.roll_rad,
        motion.pitch_rad,
        motion.rate_rad_s[2],
        estimate.rollover.load_transfer_ratio,
    ] {
        write!(text, ",{value:.6}").unwrap();
    }
    for force in &estimate.measured.0 {
        for (value, sigma) in force.force_n.iter().zip(force.sigma_n) {
            write!(text, ",{value:.3},{sigma:.3}").unwrap();
        }
    }
    text.push('\n');
}
