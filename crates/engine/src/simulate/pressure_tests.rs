//! Tyres at two inflation pressures.

use estimator::identification::{Identified, Method, pressure, tyre};
use model::vehicle::Vehicle;
use sample::Wheel;
use sim::Options;
use store::Record;

use super::drives::{identified, of_prowler};
use super::*;
use crate::FileSource;
use crate::virtual_drive::{Course, Drive};

/// Changes of stiffness and friction of both axles.
const STIFFNESS_CHANGE: f64 = 0.45;
const FRICTION_CHANGE: f64 = -0.12;
const NOMINAL_PA: f64 = 50e3;

/// The built-in vehicle with a table of the pressure on both axles.
fn with(law: &str) -> FileSource {
    let mut text = Vehicle::builtin_text("prowler")
        .expect("built in")
        .to_owned();
    for axle in ["front", "rear"] {
        text.push_str(&format!(
            "\n[{axle}.tyre.pressure]\nnominal_pa = {NOMINAL_PA:?}\n{law}\n"
        ));
    }
    FileSource::Text(text)
}

/// Tyres that depend on their pressure.
fn with_law() -> FileSource {
    with(&format!(
        "vertical_stiffness_change = 0.7\ncornering_stiffness_change = {STIFFNESS_CHANGE}\n\
         slip_stiffness_change = 0.3\nfriction_change = {FRICTION_CHANGE}"
    ))
}

fn driven(manoeuvre: &str, pressure_pa: f64, seed: u64) -> VirtualDrive {
    VirtualDrive::new(&Drive {
        vehicle: with_law(),
        seed,
        options: Options {
            tyre_pressure_pa: Some([pressure_pa; 4]),
            ..Options::default()
        },
        ..of_prowler(manoeuvre, "thesis-10bit")
    })
    .expect("a drive")
}

/// Tyres that the estimates of a log give. The vehicle file of the log has the nominal pressure alone.
fn tyres(simulated: VirtualDrive) -> Identified {
    let unknown = VirtualDrive::new(&Drive {
        vehicle: with(""),
        ..of_prowler("slow-sine", "thesis-10bit")
    })
    .expect("a drive");
    let mut config = unknown.config().expect("a configuration");
    let given = config.estimator.as_mut().expect("an estimator");
    given.calibration = simulated.true_calibration.clone();
    let method = Method::Tyre(vec![tyre::Kind::Fiala]);
    identified(simulated, &config, &method)
}

/// The changes of two drives of a manoeuvre at two pressures: each interval contains the truth. Returns how many
/// changes were found.
fn assert_law(manoeuvre: &str, seed: u64) -> usize {
    let sets = [35e3, 70e3].map(|pressure_pa| tyres(driven(manoeuvre, pressure_pa, seed)));
    let [low, high] = &sets;
    let found = pressure::laws(&low.results, &high.results);
    let mut count = 0;
    for result in &found.results {
        let name = format!("{manoeuvre}, seed {seed}, {}", result.what);
        let pressures: Vec<f64> = result.beside[..3].iter().map(|(_, p, _)| *p).collect();
        assert_eq!(pressures, [35e3, 70e3, NOMINAL_PA], "{name}");
        for finding in &result.findings {
            let truth = match finding.name.as_str() {
                "friction_change" => FRICTION_CHANGE,
                _ => STIFFNESS_CHANGE,
            };
            let told = format!(
                "{name}: {} {:.3}, sigma {:.3}, for {truth}",
                finding.name, finding.value, finding.sigma
            );
            println!("{told}");
            let [least, most] = finding.interval.expect("an interval");
            assert!(least < truth && truth < most, "{told}");
            count += 1;
        }
        let axle = result.what.split(' ').next().unwrap_or_default();
        let fields = found.overrides.table();
        assert_eq!(
            fields[&format!("{axle}.tyre.pressure.nominal_pa")].as_float(),
            Some(NOMINAL_PA)
        );
        assert!(fields.contains_key(&format!("{axle}.tyre.cornering_stiffness_n_rad")));
    }
    count
}

#[test]
fn drives_at_two_pressures_give_the_law() {
    // Both axles' stiffness, and the friction of the front axle.
    assert!(assert_law("slow-sine", 11) >= 3);
}

#[test]
#[ignore = "eight pairs of drives: `make campaigns`"]
fn campaign_of_scored_seeds() {
    for seed in 1..=4 {
        assert_law("slow-sine", seed);
        assert_law("mixed-driving", seed);
    }
}

/// The forces of the model at the measured pressure: root mean square of the errors of F_y, N.
fn model_error(mut simulated: VirtualDrive, config: &Config) -> f64 {
    let settled = simulated.start().offset_seconds(3.0);
    let (mut truth, mut square, mut count) = (Vec::new(), 0.0, 0.0);
    simulate(&mut simulated, config, |entry| {
        match entry {
            Entry::Record(Record::Truth(known)) => truth.push(known),
            Entry::Record(Record::Estimate(found)) if found.time > settled => {
                let known = truth.iter().rev().find(|known| known.time == found.time);
                let contact = known.and_then(|known| known.contact.as_ref());
                for wheel in Wheel::ALL {
                    let truth_n = contact.expect("forces")[wheel].force_n[1];
                    square += (found.expected[wheel].force_n[1] - truth_n).powi(2);
                    count += 1.0;
                }
            }
            _ => {}
        }
        Ok::<_, Error>(())
    })
    .expect("a simulation");
    (square / count).sqrt()
}

#[test]
fn the_model_uses_the_tyres_at_the_measured_pressure() {
    let drive = || driven("slow-sine", 30e3, 11);
    let known = drive().config().expect("a configuration");
    let mut hidden = known.clone();
    let vehicle = &mut hidden.estimator.as_mut().expect("an estimator").vehicle;
    vehicle.front.tyre.pressure = None;
    vehicle.rear.tyre.pressure = None;
    let [known, hidden] = [&known, &hidden].map(|config| model_error(drive(), config));
    println!("known {known:.1} N, hidden {hidden:.1} N");
    assert!(known < 0.75 * hidden, "{known} {hidden}");
}

#[test]
fn pressures_that_cannot_be_simulated_are_refused() {
    let refused = |vehicle, pressure_pa, course| {
        let drive = Drive {
            vehicle,
            options: Options {
                tyre_pressure_pa: Some([50e3, 50e3, pressure_pa, 50e3]),
                ..Options::default()
            },
            course,
            ..of_prowler("slow-sine", "thesis-10bit")
        };
        let error = VirtualDrive::new(&drive).err().expect("refused");
        error.to_string()
    };
    let course = || Course::Manoeuvre("slow-sine".to_owned());
    // In kPa.
    let error = refused(with_law(), 50.0, course());
    assert!(
        error.contains("tyre_pressure_pa") && error.contains("50"),
        "{error}"
    );
    let error = refused(FileSource::Path("prowler".into()), 50e3, course());
    assert!(error.contains("[front.tyre.pressure]"), "{error}");
    let error = refused(with_law(), 50e3, Course::Truth("run.parquet".into()));
    assert!(error.contains("run.parquet"), "{error}");
}
