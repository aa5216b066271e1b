//! Sensors of the front wheels' angles on a vehicle whose steering links yield.

use estimator::Calibration;
use estimator::calibration::{Recording, Step};
use estimator::identification::Method;
use model::sensors::Sensors;
use model::steering::Toe;
use sample::Wheel;
use sim::Options;
use store::Record;

use super::drives::{identified, of_prowler};
use super::*;
use crate::FileSource;
use crate::virtual_drive::Drive;

/// 1 and 1.4 degrees for 1 kN, and 0.5 degrees of play on the left.
const TOE: Toe = Toe {
    compliance_rad_n: [1.75e-5, 2.44e-5],
    play_rad: [0.0087, 0.0],
};

/// A drive with the compliance, with or without sensors at the wheels that have a zero and a gain.
fn of_yielding(
    manoeuvre: &str,
    gain_error_fraction: Option<f64>,
    toe: Option<Toe>,
    seed: u64,
) -> VirtualDrive {
    let mut sensors = Sensors::builtin_text("thesis-10bit")
        .expect("built in")
        .to_owned();
    if let Some(gain) = gain_error_fraction {
        sensors.push_str(&format!(
            "\n[wheel_angles]\nrate_hz = 100.0\nnoise_rad = 0.0005\nzero_error_rad = 0.02\n\
             gain_error_fraction = {gain}\n"
        ));
    }
    VirtualDrive::new(&Drive {
        sensors: FileSource::Text(sensors),
        options: Options {
            toe,
            ..Options::default()
        },
        seed,
        ..of_prowler(manoeuvre, "thesis-10bit")
    })
    .expect("a drive")
}

/// Root mean squares of the errors of a front wheel: steer angle and slip angle, rad, and lateral force, N.
fn errors(mut simulated: VirtualDrive, calibration: Calibration) -> [f64; 3] {
    let mut config = simulated.config().expect("a configuration");
    config.estimator.as_mut().expect("an estimator").calibration = calibration;
    let settled = simulated.start().offset_seconds(3.0);
    let (mut truth, mut squares, mut count) = (Vec::new(), [0.0; 3], 0.0);
    simulate(&mut simulated, &config, |entry| {
        match entry {
            Entry::Record(Record::Truth(known)) => truth.push(known),
            Entry::Record(Record::Estimate(found)) if found.time > settled => {
                let known = truth.iter().rev().find(|known| known.time == found.time);
                let known = known.expect("the truth of each estimate");
                let contact = known.contact.as_ref().expect("forces");
                for wheel in [Wheel::FrontLeft, Wheel::FrontRight] {
                    let (ours, truth) = (&found.motion, &known.motion);
                    let all = [
                        ours.steer_rad[wheel] - truth.steer_rad[wheel],
                        ours.slip_angle_rad[wheel] - truth.slip_angle_rad[wheel],
                        found.measured[wheel].force_n[1] - contact[wheel].force_n[1],
                    ];
                    for (square, error) in squares.iter_mut().zip(all) {
                        *square += error * error;
                    }
                    count += 1.0;
                }
            }
            _ => {}
        }
        Ok::<_, Error>(())
    })
    .expect("a simulation");
    squares.map(|square| (square / count).sqrt())
}

/// Of a compliance that the estimator does not know, sensors at the wheels leave a small part of the error of the steer
/// angle. The compliance of the calibration does nearly as well without sensors.
fn assert_that_sensors_replace_a_hidden_compliance(seed: u64) {
    let hidden = |drive: &VirtualDrive| {
        let mut calibration = drive.true_calibration.clone();
        calibration.steer.toe_compliance_rad_n = None;
        calibration.steer.toe_play_rad = None;
        calibration
    };
    let blind = of_yielding("slow-sine", None, Some(TOE), seed);
    let known = blind.true_calibration.clone();
    let without = hidden(&blind);
    let blind = errors(blind, without);
    let known = errors(of_yielding("slow-sine", None, Some(TOE), seed), known);
    let seen = of_yielding("slow-sine", Some(0.05), Some(TOE), seed);
    let calibration = hidden(&seen);
    let seen = errors(seen, calibration);
    let all = format!("seed {seed}: hidden {blind:?}, known {known:?}, measured {seen:?}");
    println!("{all}");
    assert!(
        seen[0] < 0.2 * blind[0] && known[0] < 0.2 * blind[0],
        "{all}"
    );
    // Measured: 0.79 of the error without sensors.
    assert!(
        seen[1] < 0.85 * blind[1] && known[1] < 0.85 * blind[1],
        "{all}"
    );
    // The strain measures the forces, whatever the angles are.
    assert!(
        seen[2] < 1.05 * blind[2] && known[2] < 1.05 * blind[2],
        "{all}"
    );
}

/// Zero and gain of the sensors from turn plates that are read to 0.1 degrees.
fn assert_turn_plates(seed: u64) {
    let mut simulated = of_yielding("turn-plates", Some(0.05), None, seed);
    let config = simulated.config().expect("a configuration");
    let given = config.estimator.clone().expect("an estimator");
    let start = simulated.start();
    let mut recording = Recording::new("plates".to_owned(), given.vehicle, given.sensors, start);
    let marks = simulated.vehicle.motion().marks().to_vec();
    for (time_s, text) in marks {
        recording.mark(start.offset_seconds(time_s), text);
    }
    simulate(&mut simulated, &config, |entry| {
        if let Entry::Record(Record::Sample(sample)) = entry {
            let source = &config.sources[usize::from(sample.source.0)].spec.name;
            recording.push(source, &sample);
        }
        Ok::<_, Error>(())
    })
    .expect("a simulation");
    let step = Step::Steer {
        plate_sigma_rad: 0.1_f64.to_radians(),
    };
    let known = Calibration::nominal("prowler");
    let found = step.calibrate(&[recording], &known).expect("a calibration");
    let truth = &simulated.true_calibration.steer;
    let (found, findings) = (&found.calibration.steer, &found.findings[0]);
    let gains = found.wheel_angle_gain.expect("sensors").into_iter();
    for (gain, truth) in gains.zip(truth.wheel_angle_gain.expect("sensors")) {
        println!("seed {seed}: gain {gain} for {truth}");
        assert!((gain / truth - 1.0).abs() < 0.003, "{gain} for {truth}");
    }
    let zeros = found.wheel_angle_offset_rad.into_iter();
    for (zero, truth) in zeros.zip(truth.wheel_angle_offset_rad) {
        println!("seed {seed}: zero {zero} for {truth}");
        assert!((zero - truth).abs() < 0.001, "{zero} for {truth}");
    }
    assert_eq!(findings.findings.len(), 6);
}

/// Compliance and play of a drive, by the estimates of its log.
fn assert_toe(seed: u64) {
    let simulated = of_yielding("mixed-driving", Some(0.0), Some(TOE), seed);
    let config = simulated.config().expect("a configuration");
    let found = identified(simulated, &config, &Method::Toe);
    let mut said = String::new();
    for (side, name) in ["left", "right"].into_iter().enumerate() {
        let result = &found.results[side];
        let compliance = result.value(&format!("toe_compliance_{name}"));
        let play = result.value(&format!("toe_play_{name}"));
        said += &format!("{name}: {compliance:?} rad/N, {play:?} rad; ");
    }
    println!("seed {seed}: {said}");
    for (side, name) in ["left", "right"].into_iter().enumerate() {
        let result = &found.results[side];
        let [compliance, _] = result.value(&format!("toe_compliance_{name}"));
        let part = compliance / TOE.compliance_rad_n[side];
        assert!((part - 1.0).abs() < 0.1, "{part}: {said}");
        let [play, _] = result.value(&format!("toe_play_{name}"));
        assert!((play - TOE.play_rad[side]).abs() < 0.0015, "{said}");
    }
}

#[test]
fn measured_wheel_angles_and_known_compliance_replace_a_hidden_compliance() {
    assert_that_sensors_replace_a_hidden_compliance(11);
}

#[test]
fn turn_plates_give_zero_and_gain_of_the_sensors_at_the_wheels() {
    assert_turn_plates(11);
}

#[test]
fn a_drive_gives_toe_compliance_and_play() {
    assert_toe(11);
}

#[test]
#[ignore = "the seeds that are scored: `make campaigns`"]
fn campaign_of_scored_seeds() {
    for seed in 1..=4 {
        assert_that_sensors_replace_a_hidden_compliance(seed);
        assert_turn_plates(seed);
        assert_toe(seed);
    }
}

/// A motion of a file has its own steer angles, and no gear is as soft as 1 rad/N.
#[test]
fn compliance_that_cannot_be_is_refused() {
    let refused = |options, course| {
        let drive = Drive {
            options,
            course,
            ..of_prowler("slow-sine", "thesis-10bit")
        };
        VirtualDrive::new(&drive)
            .err()
            .expect("refused")
            .to_string()
    };
    let soft = Options {
        toe: Some(Toe {
            compliance_rad_n: [0.0, 1.0],
            ..Toe::default()
        }),
        ..Options::default()
    };
    let course = crate::Course::Manoeuvre("slow-sine".to_owned());
    let error = refused(soft.clone(), course);
    assert!(
        error.contains("toe.compliance_rad_n") && error.contains('1'),
        "{error}"
    );
    let error = refused(soft, crate::Course::Truth("run.parquet".into()));
    assert!(error.contains("run.parquet"), "{error}");
}
