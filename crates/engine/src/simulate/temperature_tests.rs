//! Drift of the strain channels with temperature: found, and corrected in the estimate.

use std::sync::Arc;

use estimator::calibration::{Recording, Resolved, Step, TemperatureCalibration};
use estimator::{Calibration, Estimator, Output};
use sample::{
    ControlSample, Counts, Estimate, LogTime, Measurement, Sample, Signal, StrainChannel, Wheel,
};
use store::Record;

use super::drives::of_prowler;
use super::*;
use crate::virtual_drive::Drive;

/// Change of the temperature, K, and of all zeros with it, counts.
const CHANGE_K: f64 = 30.0;
const DRIFT_COUNTS: f64 = 40.0;
/// Temperature at the begin, degrees Celsius.
const BEGIN_C: f64 = 12.0;
/// Wanted drift that is left, counts.
const LEFT_COUNTS: f64 = 3.0;
/// Drift of the gain that is injected, 1/K.
const GAIN_PER_K: f64 = 4e-4;

/// Time on the stands before the vehicle is lowered, s, and how often it is repeated.
const REST_S: f64 = 5.5;
const REPEATS: u32 = 8;

struct Recorded {
    config: Config,
    truth: Calibration,
    samples: Vec<Sample>,
    marks: Vec<(LogTime, String)>,
}

/// Samples of a drive; the sensors have 16 bits, so that 40 counts are 10 times the noise or less.
fn recorded(manoeuvre: &str, sensors: &str, duration_s: f64) -> Recorded {
    let mut simulated = VirtualDrive::new(&Drive {
        duration_s: Some(duration_s),
        ..of_prowler(manoeuvre, sensors)
    })
    .expect("a drive");
    let config = simulated.config().expect("a configuration");
    let (mut samples, mut marks) = (Vec::new(), Vec::new());
    simulate(&mut simulated, &config, |entry| {
        match entry {
            Entry::Record(Record::Sample(sample)) => samples.push(sample),
            Entry::Record(Record::Mark { time, text }) => marks.push((time, text)),
            _ => {}
        }
        Ok::<_, Error>(())
    })
    .expect("a simulation");
    Recorded {
        config,
        truth: simulated.true_calibration,
        samples,
        marks,
    }
}

/// A vehicle that stays on stands: the samples at rest, several times.
fn standing(sensors: &str) -> Recorded {
    let mut of = recorded("jackstand", sensors, REST_S);
    let once = of.samples.clone();
    for k in 1..REPEATS {
        let later = |time: LogTime| time.offset_seconds(f64::from(k) * REST_S);
        of.samples.extend(once.iter().map(|sample| Sample {
            log_time: later(sample.log_time),
            valid_time: later(sample.valid_time),
            ..sample.clone()
        }));
    }
    of
}

fn span(samples: &[Sample]) -> (LogTime, f64) {
    let first = samples[0].log_time;
    (
        first,
        samples[samples.len() - 1].log_time.seconds_since(first),
    )
}

fn temperature(sample: &Sample, temperature_c: f64) -> Sample {
    let signal = |wheel: Wheel| Signal {
        name: Arc::from(format!("bridge_temperature_{}", wheel.abbreviation())),
        value: temperature_c,
        unit: Arc::from("degC"),
    };
    Sample {
        device_time: None,
        measurement: Measurement::Control(ControlSample {
            values: Wheel::ALL.map(signal).to_vec(),
        }),
        ..sample.clone()
    }
}

/// The samples with a temperature that rises by `change_k`, and with zeros that rise by `drift_counts`.
fn heated(samples: &[Sample], change_k: f64, drift_counts: f64) -> Vec<Sample> {
    let (first, span_s) = span(samples);
    let mut heated = Vec::new();
    for sample in samples {
        let part = sample.log_time.seconds_since(first) / span_s;
        let mut sample = sample.clone();
        match &mut sample.measurement {
            Measurement::Corner(corner) => {
                for counts in corner.strain_counts.iter_mut().flatten() {
                    *counts =
                        Counts::Converter((counts.number() + drift_counts * part).round() as i32);
                }
            }
            Measurement::Steer(_) => heated.push(temperature(&sample, BEGIN_C + change_k * part)),
            _ => {}
        }
        heated.push(sample);
    }
    heated
}

fn recording(of: &Recorded, samples: &[Sample]) -> Recording {
    let settings = of.config.estimator.clone().expect("an estimator");
    let (start, _) = span(samples);
    let mut recording = Recording::new(
        "heated.mcap".to_owned(),
        settings.vehicle,
        settings.sensors,
        start,
    );
    for sample in samples {
        let source = &of.config.sources[usize::from(sample.source.0)].spec.name;
        recording.push(source, sample);
    }
    for (time, text) in &of.marks {
        recording.mark(*time, text.clone());
    }
    recording
}

#[test]
fn a_drift_of_40_counts_over_30_kelvins_is_found_to_3_counts() {
    for sensors in ["thesis-10bit", "full-bridge-16bit-bending"] {
        let of = standing(sensors);
        let heated = heated(&of.samples, CHANGE_K, DRIFT_COUNTS);
        let found = Step::Temperature
            .calibrate(&[recording(&of, &heated)], &of.truth)
            .expect("a calibration");
        let settings = of.config.estimator.clone().expect("an estimator");
        let resolved = Resolved::new(&settings.sensors, &found.calibration).expect("a calibration");
        let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
        for wheel in Wheel::ALL {
            for (channel, drift) in resolved.corners[wheel]
                .strain
                .iter()
                .zip(resolved.drift[wheel])
            {
                let Some(drift) = drift else { continue };
                let hot = drift.applied(channel, Some((BEGIN_C + CHANGE_K, 0.0)));
                let cold = drift.applied(channel, Some((BEGIN_C, 0.0)));
                let left = DRIFT_COUNTS - (hot.offset_counts - cold.offset_counts);
                worst = worst.max(left.abs());
                let error = drift.offset_counts_per_k - DRIFT_COUNTS / CHANGE_K;
                squares += (error / drift.offset_sigma_counts_per_k).powi(2);
                count += 1.0;
            }
        }
        println!(
            "{sensors}: left {worst:.3} counts in {count} channels, NEES {:.2}",
            squares / count
        );
        assert!(
            count >= 20.0 && worst < LEFT_COUNTS,
            "{sensors}: {worst} counts left in {count} channels"
        );
        assert!(squares / count < 4.0, "{sensors}: {}", squares / count);
        // The same file without the step leaves the whole drift.
        assert!(
            Resolved::new(&settings.sensors, &of.truth)
                .expect("a calibration")
                .drift
                .0
                .iter()
                .flatten()
                .all(Option::is_none)
        );
        let text = found.calibration.to_toml().expect("a text");
        assert_eq!(
            Calibration::from_toml(&text).expect("a calibration"),
            found.calibration
        );
    }
}

#[test]
fn the_drift_of_the_gain_is_found_from_known_loads() {
    use estimator::calibration::temperature::{Window, drift};
    let mut windows = Vec::new();
    for k in 0..200_u32 {
        let change_k = CHANGE_K * f64::from(k) / 199.0;
        let force_counts = if (k / 20) % 2 == 0 { 0.0 } else { 900.0 };
        let noise = 0.3 * f64::from((k * 7919) % 13) / 13.0;
        windows.push(Window {
            time_s: f64::from(k),
            temperature_c: BEGIN_C + change_k,
            counts: 500.0 + change_k + force_counts * 1.02 * (1.0 + GAIN_PER_K * change_k) + noise,
            force_counts,
        });
    }
    let mut findings = Default::default();
    let found = drift(
        Wheel::FrontLeft,
        StrainChannel::LowerFront,
        &windows,
        BEGIN_C,
        &mut findings,
    );
    let found = found.expect("a fit").expect("enough windows");
    assert!((found.gain_per_k - GAIN_PER_K).abs() < 2e-5, "{found:?}");
    assert!(
        found.gain_sigma_per_k < 2e-5 && found.offset_counts_per_k2 == 0.0,
        "{found:?}"
    );
    assert!((found.offset_counts_per_k - 1.0).abs() < 0.01, "{found:?}");
    // A curved drift is seen as such.
    const CURVED: f64 = 0.02;
    for window in &mut windows {
        window.counts += CURVED * (window.temperature_c - BEGIN_C).powi(2);
    }
    let curved = drift(
        Wheel::FrontLeft,
        StrainChannel::LowerFront,
        &windows,
        BEGIN_C,
        &mut findings,
    );
    let curved = curved.expect("a fit").expect("enough windows");
    assert!(
        (curved.offset_counts_per_k2 - CURVED).abs() < 1e-3,
        "{curved:?}"
    );
}

#[test]
fn logs_without_temperature_change_or_rest_are_refused() {
    let of = standing("thesis-10bit");
    let refused = |of: &Recorded, samples: &[Sample]| {
        let error = Step::Temperature.calibrate(&[recording(of, samples)], &of.truth);
        error.expect_err("a refusal").to_string()
    };
    let none = refused(&of, &of.samples);
    assert!(
        none.contains("no bridge temperature (role bridge_temperature.FL"),
        "{none}"
    );
    let small = refused(&of, &heated(&of.samples, 5.0, 6.0));
    assert!(
        small.contains("change of the bridge temperature") && small.contains("at least 8 K"),
        "{small}"
    );
    let lowered = recorded("jackstand", "thesis-10bit", 14.0);
    let lowers = refused(&lowered, &heated(&lowered.samples, CHANGE_K, 0.0));
    assert!(
        lowers.contains("the vehicle moves: change of a spring deflection"),
        "{lowers}"
    );
    let drive = recorded("slow-sine", "thesis-10bit", 10.0);
    let moving = refused(&drive, &heated(&drive.samples, CHANGE_K, 0.0));
    assert!(
        moving.contains("the vehicle moves: wheel speed"),
        "{moving}"
    );
}

/// Estimates of samples, and the texts of the events about temperatures.
fn estimates(
    of: &Recorded,
    calibration: &Calibration,
    samples: &[Sample],
) -> (Vec<Estimate>, Vec<String>) {
    let settings = of.config.estimator.clone().expect("an estimator");
    let mut estimator = Estimator::new(
        &settings.vehicle,
        &settings.sensors,
        calibration,
        settings.settings,
    )
    .expect("an estimator");
    let (mut estimates, mut events) = (Vec::new(), Vec::new());
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Estimate(estimate) => estimates.push(estimate),
            Output::Event(event) if event.text.contains("temperature") => events.push(event.text),
            _ => {}
        });
        estimator.push(sample);
    }
    (estimates, events)
}

/// Root mean square of the differences of all contact forces after 5 s, N.
fn difference_n(a: &[Estimate], b: &[Estimate]) -> f64 {
    let forces = |estimate: &Estimate| estimate.measured.0.map(|force| force.force_n);
    let pairs = a.iter().zip(b).skip(500);
    let squares: Vec<f64> = pairs
        .flat_map(|(a, b)| {
            let (a, b) = (forces(a), forces(b));
            (0..12).map(move |k| (a[k / 3][k % 3] - b[k / 3][k % 3]).powi(2))
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn with_drift(of: &Recorded) -> Calibration {
    let mut calibration = of.truth.clone();
    for corner in calibration.corner.values_mut() {
        for channel in corner.strain.values_mut() {
            channel.temperature = Some(TemperatureCalibration {
                reference_c: BEGIN_C,
                offset_counts_per_k: DRIFT_COUNTS / CHANGE_K,
                offset_sigma_counts_per_k: 0.01,
                ..TemperatureCalibration::default()
            });
        }
    }
    calibration
}

/// A drive with a drift of 40 counts: with the correction, the forces are those of a drive without a drift.
#[test]
fn the_estimate_corrects_the_drift_and_reports_a_temperature_that_does_not_arrive() {
    let of = recorded("mixed-driving", "thesis-10bit", 40.0);
    let clean = estimates(&of, &of.truth, &of.samples).0;
    let hot = heated(&of.samples, CHANGE_K, DRIFT_COUNTS);
    let (corrected, no_events) = estimates(&of, &with_drift(&of), &hot);
    let uncorrected = estimates(&of, &of.truth, &hot).0;
    let (left_n, whole_n) = (
        difference_n(&corrected, &clean),
        difference_n(&uncorrected, &clean),
    );
    println!("with the correction {left_n:.2} N, without it {whole_n:.2} N");
    assert!(no_events.is_empty(), "{no_events:?}");
    assert!(
        left_n < 0.25 * whole_n,
        "{left_n} N with the correction, {whole_n} N without"
    );
    // Without a temperature, the estimate goes on, with a larger standard deviation, and says so.
    let is_reading = |sample: &&Sample| !matches!(sample.measurement, Measurement::Control(_));
    let silent: Vec<Sample> = hot.iter().filter(is_reading).cloned().collect();
    let (wide, events) = estimates(&of, &with_drift(&of), &silent);
    assert_eq!(events.len(), 4, "{events:?}");
    assert!(
        events[0].contains("reference temperature of the calibration is used"),
        "{events:?}"
    );
    let sigma = |all: &[Estimate]| all[all.len() - 1].measured[Wheel::FrontLeft].sigma_n[2];
    assert!(
        sigma(&wide) > sigma(&corrected),
        "{} {}",
        sigma(&wide),
        sigma(&corrected)
    );
    // A calibration without a drift ignores the temperature: the bits are the same.
    let with_readings = heated(&of.samples, CHANGE_K, 0.0);
    let same = estimates(&of, &of.truth, &with_readings).0;
    assert!(difference_n(&same, &clean) == 0.0);
}
