//! `docs/filter-spec.md` says what the code does.

use atvrec_estimator::Tuning;
use atvrec_estimator::specification::{Sensitivity, markdown};

const SENSITIVITIES: &str = include_str!("../../../../docs/filter-sensitivity.csv");

#[test]
fn the_filter_specification_is_current() {
    let page = markdown(&Sensitivity::from_csv(SENSITIVITIES).unwrap()).unwrap();
    testkit::assert_file("docs/filter-spec.md", &page);
}

#[test]
fn a_tuning_goes_through_a_file_and_back() {
    let tuning = Tuning::default().with("motion.gate_sigma", 0, 6.5).unwrap();
    let text = toml::to_string(&tuning).unwrap();
    assert_eq!(toml::from_str::<Tuning>(&text).unwrap(), tuning);
    let part: Tuning = toml::from_str("[motion]\ngate_sigma = 6.5").unwrap();
    assert_eq!(part, tuning);
    assert!(toml::from_str::<Tuning>("[motion]\ngate_sgma = 6.5").is_err());
}

#[test]
fn values_that_no_parameter_can_have_are_refused() {
    let with = |name, value| Tuning::default().with(name, 0, value);
    assert!(with("motion.gate_sigma", -1.0).is_err());
    assert!(with("motion.gate_sigma", f64::NAN).is_err());
    assert!(with("lift.steps", 1.5).is_err());
    assert!(with("lift.no_such_number", 1.0).is_err());
    assert!(with("lift.steps", 7.0).is_ok());
}
