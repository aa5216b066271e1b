//! Figures of the suspension, the road and the sources.

use super::curves::{Curves, Spec};
use super::{Candidate, WHEELS, panel, timed};
use crate::drive::TYRE_PRESSURE;
use crate::frame::GAP_S;
use crate::options::Quantity;
use crate::plot::{Data, Figure, Kind, Pen, Trace};

/// Bins of the histogram of velocities.
const BINS: usize = 80;
const NO_POTENTIOMETER: &str = "no potentiometer is connected (/deflection)";
const TOO_LONG: &str = "the report has more than an hour and leaves samples out; use --from and --to for an \
     hour of the drive";
/// Samples of a segment of a spectrum.
const SEGMENT: usize = 256;

/// All figures.
pub fn all(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    suspension(curves, all);
    road(curves, all);
    tyre_pressure(curves, all);
    rates(curves, all);
}

fn suspension(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let drive = curves.drive;
    let mut panels = Vec::new();
    let (factor, metres) = curves.options.units.of(Quantity::Length);
    let is_there = |column: &str| {
        WHEELS.iter().any(|(wheel, _)| {
            let frame = drive.travel.get(&format!("{wheel}.{column}"));
            frame.is_some_and(|frame| !frame.is_empty())
        })
    };
    let (column, quantity, factor, unit) = match ["deflection_m", "raw_counts"].map(is_there) {
        [true, _] => ("deflection_m", Quantity::Length, factor, metres),
        [_, true] => ("raw_counts", Quantity::Number, 1.0, "counts"),
        _ => ("equivalent_counts", Quantity::Number, 1.0, "counts"),
    };
    let mut velocity = panel("part of the time (%)", None);
    let mut spectrum = panel(format!("log10 of ({unit})²/Hz"), None);
    for (index, (wheel, name)) in WHEELS.into_iter().enumerate() {
        let column = format!("{wheel}.{column}");
        let Some(frame) = drive.travel.get(&column) else {
            continue;
        };
        let times = &frame.time_s;
        let mut values = frame.get(&column).unwrap_or_default().to_vec();
        for value in &mut values {
            *value = (f64::from(*value) * factor) as f32;
        }
        let pen = Pen::Other(index);
        let trace = |(x, y): (Vec<f64>, Vec<f64>)| Trace {
            name: name.to_owned(),
            pen,
            data: Data::Own { x, y },
        };
        if !drive.thinning.is_on() {
            velocity
                .traces
                .extend(velocities(times, &values).map(trace));
            spectrum.traces.extend(power(times, &values).map(trace));
        }
        let travel = curves.curve(frame, Spec::new("travel", &column, quantity));
        let mut one = panel(format!("travel ({unit})"), travel);
        one.heading = name.to_owned();
        panels.push(one);
    }
    let caption = "Readings of the potentiometers: the deflection from the length at rest, compression \
                   positive, or counts if the log has no calibration.";
    let travel = timed("travel", "Suspension travel", caption, panels);
    let velocity = Figure {
        id: "travel-velocity".into(),
        title: "Velocity of the suspension".into(),
        caption: "How often each velocity of the struts occurs.".into(),
        panels: vec![velocity],
        x_label: format!("velocity ({unit}/s)").into(),
        kind: Kind::Plain,
    };
    let spectrum = Figure {
        id: "travel-spectrum".into(),
        title: "Spectrum of the suspension".into(),
        caption: "Power spectral density of the deflection, averaged over segments.".into(),
        panels: vec![spectrum],
        x_label: "frequency (Hz)".into(),
        kind: Kind::Plain,
    };
    let reason = match drive.thinning.is_on() && !drive.travel.is_empty() {
        true => TOO_LONG,
        false => NO_POTENTIOMETER,
    };
    all.push((travel, NO_POTENTIOMETER));
    all.extend([velocity, spectrum].map(|figure| (figure, reason)));
}

/// Histogram of the velocity: middle of the bins, and per cent.
fn velocities(times: &[f64], values: &[f32]) -> Option<(Vec<f64>, Vec<f64>)> {
    let velocities = || {
        let steps = times.windows(2).zip(values.windows(2));
        steps.filter_map(|(time, value)| {
            let step_s = time[1] - time[0];
            let velocity = f64::from(value[1] - value[0]) / step_s;
            (step_s > 0.0 && step_s < GAP_S && velocity.is_finite()).then_some(velocity)
        })
    };
    let mut sizes: Vec<f64> = velocities().map(f64::abs).collect();
    let rank = sizes.len().checked_sub(1)? * 999 / 1000;
    let most = *sizes.select_nth_unstable_by(rank, f64::total_cmp).1;
    if most <= 0.0 {
        return None;
    }
    let mut counts = [0_usize; BINS];
    for velocity in velocities() {
        let bin = (velocity / most + 1.0) * 0.5 * BINS as f64;
        counts[(bin.max(0.0) as usize).min(BINS - 1)] += 1;
    }
    let middle = |bin: usize| ((bin as f64 + 0.5) / BINS as f64 * 2.0 - 1.0) * most;
    let part = |count: &usize| *count as f64 / sizes.len() as f64 * 100.0;
    Some((
        (0..BINS).map(middle).collect(),
        counts.iter().map(part).collect(),
    ))
}

/// Power spectral density by Welch's method with a Hann window: frequency, and log10 of the density.
fn power(times: &[f64], values: &[f32]) -> Option<(Vec<f64>, Vec<f64>)> {
    let (first, last) = (times.first()?, times.last()?);
    let interval_s = (last - first) / times.len().checked_sub(1)?.max(1) as f64;
    let turn = std::f64::consts::TAU / SEGMENT as f64;
    let waves: Vec<[f64; 2]> = (0..SEGMENT)
        .map(|k| [math::cos(turn * k as f64), math::sin(turn * k as f64)])
        .collect();
    let half = SEGMENT / 2;
    let mut density = vec![0.0; half];
    let mut segments = 0;
    for segment in values.chunks_exact(SEGMENT) {
        if segment.iter().any(|value| !value.is_finite()) {
            continue;
        }
        let mean = segment.iter().map(|v| f64::from(*v)).sum::<f64>() / SEGMENT as f64;
        let windowed: Vec<f64> = (segment.iter().enumerate())
            .map(|(k, value)| (f64::from(*value) - mean) * 0.5 * (1.0 - waves[k][0]))
            .collect();
        segments += 1;
        for (order, sum) in density.iter_mut().enumerate() {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (k, value) in windowed.iter().enumerate() {
                let [cos, sin] = waves[k * order % SEGMENT];
                real += value * cos;
                imaginary += value * sin;
            }
            *sum += real * real + imaginary * imaginary;
        }
    }
    if segments == 0 || interval_s <= 0.0 {
        return None;
    }
    // The mean square of a Hann window is 3/8; both signs of a frequency count.
    let scale = 2.0 * interval_s / (SEGMENT as f64 * 0.375 * f64::from(segments));
    let frequencies = (1..half).map(|order| order as f64 / (SEGMENT as f64 * interval_s));
    let powers = density[1..]
        .iter()
        .map(|sum| math::log10((sum * scale).max(1e-30)));
    Some((frequencies.collect(), powers.collect()))
}

fn road(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let ground = &curves.drive.ground;
    let unit = curves.unit(Quantity::Length);
    let mut one = panel(format!("height ({unit})"), None);
    for (index, (wheel, name)) in WHEELS.into_iter().enumerate() {
        let column = format!("{wheel}.ground_height_m");
        let spec = Spec::new(name, &column, Quantity::Length).pen(Pen::Other(index));
        one.traces.extend(curves.curve(ground, spec));
    }
    let caption = "Height of the ground under each wheel in the truth of the simulation.";
    all.push((
        timed("road", "Road height", caption, vec![one]),
        "the log has no height of the road (/truth/ground of a simulation on rough ground)",
    ));
}

/// The inflation pressures, if sensors have measured them.
fn tyre_pressure(curves: &Curves<'_>, all: &mut Vec<Candidate>) {
    let drive = curves.drive;
    let mut one = panel("pressure (kPa)", None);
    for frame in drive.sensors.values() {
        for (index, (wheel, name)) in WHEELS.into_iter().enumerate() {
            let column = format!("{TYRE_PRESSURE}{}", wheel.to_uppercase());
            let Some(values) = frame.get(&column) else {
                continue;
            };
            let (x, y) = kilopascals(&frame.time_s, values);
            if !x.is_empty() {
                one.traces.push(Trace {
                    name: name.to_owned(),
                    pen: Pen::Other(index),
                    data: Data::Own { x, y },
                });
            }
        }
    }
    if !one.traces.is_empty() {
        let caption = "Inflation pressures of the tyres above that of the air.";
        let figure = timed("tyre-pressure", "Tyre pressure", caption, vec![one]);
        all.push((figure, "no pressure of a tyre is recorded"));
    }
}

/// Times and pressures, kPa, of the samples that have a pressure, Pa. A sensor sends each second or less often, which is
/// no gap.
fn kilopascals(time_s: &[f64], pressures_pa: &[f32]) -> (Vec<f64>, Vec<f64>) {
    let samples = time_s.iter().zip(pressures_pa);
    let known = samples.filter(|(_, pressure_pa)| pressure_pa.is_finite());
    known
        .map(|(time_s, pressure_pa)| (*time_s, 1e-3 * f64::from(*pressure_pa)))
        .unzip()
}

fn rates(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let drive = curves.drive;
    let mut counts = panel("samples/s", None);
    let mut latencies = panel("greatest latency (ms)", None);
    for (index, (topic, rates)) in drive.rates.iter().enumerate() {
        let x = rates.time_s();
        let spec = Spec::new(topic, "", Quantity::Number).pen(Pen::Other(index));
        counts
            .traces
            .extend(curves.of_values(&x, rates.per_second(), None, spec));
        latencies
            .traces
            .extend(curves.of_values(&x, rates.latency_ms(), None, spec));
    }
    let caption = "Samples of each topic in each second, and the time from the instant that a sample \
                   is for to its arrival.";
    all.push((
        timed(
            "sources-rates",
            "Rates and latencies",
            caption,
            vec![counts, latencies],
        ),
        "the log has no decoded samples of a sensor",
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressures_are_drawn_in_kilopascals_where_they_are_known() {
        let (time_s, kpa) = kilopascals(&[0.0, 0.5, 1.0], &[35e3, f32::NAN, 34.5e3]);
        assert_eq!((time_s, kpa), (vec![0.0, 1.0], vec![35.0, 34.5]));
    }

    #[test]
    fn the_spectrum_of_a_sine_has_its_power_at_its_frequency() {
        let time_s: Vec<f64> = (0..2560).map(|k| f64::from(k) * 0.01).collect();
        let wave = |t: &f64| (0.02 * math::sin(std::f64::consts::TAU * 12.5 * t)) as f32;
        let values: Vec<f32> = time_s.iter().map(wave).collect();
        let (x, y) = power(&time_s, &values).unwrap();
        let top = (0..y.len()).max_by(|a, b| y[*a].total_cmp(&y[*b])).unwrap();
        assert!((x[top] - 12.5).abs() < 0.2, "{}", x[top]);
        // Half the square of the amplitude.
        let df = x[1] - x[0];
        let sum: f64 = y.iter().map(|p| math::powf(10.0, *p) * df).sum();
        assert!((sum - 0.0002).abs() < 0.00001, "{sum}");
        let (_, part) = velocities(&time_s, &values).unwrap();
        assert!((part.iter().sum::<f64>() - 100.0).abs() < 1e-9);
    }
}
