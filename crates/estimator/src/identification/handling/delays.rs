//! Delays of the sources of a drive against each other.

use std::borrow::Cow;

use super::{DELAY, DELAY_MAX_S, Theta, WHAT};
use crate::finding::Refusal;
use crate::planar::PlanarInput;

/// Delays of the steer angle that are tried first: step and largest one, s.
const COARSE_S: [f64; 2] = [0.05, 0.5];
/// Longest interval over which values are interpolated, s.
const INTERVAL_MAX_S: f64 = 0.25;

/// Fewest changes of a signal from which held values are recognised.
const CHANGES_MIN: usize = 50;

/// The rows with speed and steer angle between the values of a sensor that is slower than the rows: the
/// filter holds the last value, which is late by half the sensor's interval on average.
pub(super) fn between_values(inputs: &[PlanarInput]) -> Vec<PlanarInput> {
    let mut rows = inputs.to_vec();
    let times: Vec<f64> = inputs.iter().map(|row| row.time_s).collect();
    let filled = |value: fn(&PlanarInput) -> f64| -> Vec<f64> {
        let mut values: Vec<f64> = inputs.iter().map(value).collect();
        fill(&times, &mut values);
        values
    };
    let speed = filled(|row| row.speed_m_s);
    let steer = filled(|row| row.steer_rad);
    for (row, (speed, steer)) in rows.iter_mut().zip(speed.into_iter().zip(steer)) {
        (row.speed_m_s, row.steer_rad) = (speed, steer);
    }
    rows
}

/// Interpolates between the changes of a signal whose values are held.
fn fill(times_s: &[f64], values: &mut [f64]) {
    let differs = |row: &usize| values[*row].to_bits() != values[row - 1].to_bits();
    let changes: Vec<usize> = (1..values.len()).filter(differs).collect();
    let mut steps: Vec<usize> = changes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_unstable();
    if steps.len() < CHANGES_MIN || steps[steps.len() / 2] < 2 {
        return;
    }
    for pair in changes.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let span_s = times_s[to] - times_s[from];
        if span_s > INTERVAL_MAX_S {
            continue;
        }
        let (first, last) = (values[from], values[to]);
        for row in from..to {
            let part = (times_s[row] - times_s[from]) / span_s;
            values[row] = first + part * (last - first);
        }
    }
}

/// The rows with steer angle and lateral acceleration `delay_s` earlier, at the times at which they are
/// true.
pub(super) fn shifted(inputs: &[PlanarInput], delay_s: [f64; 2]) -> Cow<'_, [PlanarInput]> {
    if delay_s == [0.0; 2] {
        return Cow::Borrowed(inputs);
    }
    let mut rows = inputs.to_vec();
    let of = |value: fn(&PlanarInput) -> Option<f64>| -> Vec<(f64, f64)> {
        let known = inputs
            .iter()
            .filter_map(|row| Some((row.time_s, value(row)?)));
        known.collect()
    };
    let mut steer = Series::new(of(|row| Some(row.steer_rad)));
    let mut lateral = Series::new(of(|row| row.lateral_m_s2));
    for row in &mut rows {
        if let Some(value) = steer.at(row.time_s + delay_s[0]) {
            row.steer_rad = value;
        }
        if row.lateral_m_s2.is_some() {
            row.lateral_m_s2 = lateral.at(row.time_s + delay_s[1]).or(row.lateral_m_s2);
        }
    }
    Cow::Owned(rows)
}

/// Values over time, interpolated at rising times.
struct Series {
    values: Vec<(f64, f64)>,
    next: usize,
}

impl Series {
    const fn new(values: Vec<(f64, f64)>) -> Self {
        Self { values, next: 0 }
    }

    fn at(&mut self, time_s: f64) -> Option<f64> {
        while self
            .values
            .get(self.next)
            .is_some_and(|(at_s, _)| *at_s <= time_s)
        {
            self.next += 1;
        }
        let (from_s, from) = *self.values.get(self.next.checked_sub(1)?)?;
        let (to_s, to) = *self.values.get(self.next)?;
        let within = to_s - from_s <= INTERVAL_MAX_S;
        within.then(|| from + (to - from) * (time_s - from_s) / (to_s - from_s))
    }
}

/// The start with the delay of the steer angle at which the filter predicts best.
pub(super) fn coarse(mut theta: Theta, cost: impl Fn(&Theta) -> f64) -> Theta {
    let [step_s, most_s] = COARSE_S;
    let steps = (most_s / step_s).round() as i32;
    let mut best = (f64::INFINITY, 0.0);
    for step in -steps..=steps {
        let delay_s = f64::from(step) * step_s;
        theta[DELAY] = delay_s;
        let found = cost(&theta);
        if found < best.0 {
            best = (found, delay_s);
        }
    }
    theta[DELAY] = best.1;
    theta
}

/// Refuses delays that are larger than what is corrected.
pub(super) fn refuse_large(delay_s: [f64; 2]) -> Result<(), Refusal> {
    refuse(0, delay_s[0], DELAY_MAX_S)?;
    refuse(1, delay_s[1], DELAY_MAX_S)
}

fn refuse(which: usize, delay_s: f64, most_s: f64) -> Result<(), Refusal> {
    if delay_s.abs() <= most_s + 1e-9 {
        return Ok(());
    }
    let name = ["steer angle", "lateral acceleration"][which];
    let help = if delay_s > 0.0 {
        format!("its source is late: set latency_s = {delay_s:.2} for it")
    } else {
        format!(
            "it is early, so that the yaw rate is late: set latency_s = {:.2} for the source of the yaw \
             rate",
            -delay_s
        )
    };
    Err(Refusal::Value {
        what: WHAT.to_owned(),
        name: format!("delay of the {name} against the yaw rate in s"),
        value: delay_s,
        expected: format!("{DELAY_MAX_S} at most; {help}, in the source or in the column map"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planar::LastInertial;

    #[test]
    fn held_values_are_interpolated() {
        let rows: Vec<PlanarInput> = (0..1000)
            .map(|row| PlanarInput {
                time_s: f64::from(row) * 0.01,
                speed_m_s: math::sin(f64::from(row) * 0.01),
                acceleration_m_s2: 0.0,
                steer_rad: math::sin(f64::from(row / 5 * 5) * 0.01),
                yaw_rate_rad_s: None,
                lateral_m_s2: None,
                inertial: LastInertial::default(),
            })
            .collect();
        let filled = between_values(&rows);
        for row in &filled[10..990] {
            assert!(
                (row.steer_rad - math::sin(row.time_s)).abs() < 1e-3,
                "{row:?}"
            );
            assert_eq!(row.speed_m_s, math::sin(row.time_s));
        }
    }

    #[test]
    fn a_shift_and_its_inverse_give_the_rows_back() {
        let rows: Vec<PlanarInput> = (0..500)
            .map(|row| {
                let time_s = f64::from(row) * 0.01;
                PlanarInput {
                    time_s,
                    speed_m_s: 10.0,
                    acceleration_m_s2: 0.0,
                    steer_rad: math::sin(time_s),
                    yaw_rate_rad_s: Some(0.1),
                    lateral_m_s2: (row % 2 == 0).then(|| math::cos(time_s)),
                    inertial: LastInertial::default(),
                }
            })
            .collect();
        let there = shifted(&rows, [0.034, -0.021]);
        for row in &there[10..480] {
            assert!((row.steer_rad - math::sin(row.time_s + 0.034)).abs() < 1e-4);
            if let Some(lateral) = row.lateral_m_s2 {
                assert!((lateral - math::cos(row.time_s - 0.021)).abs() < 1e-4);
            }
        }
        assert!(matches!(shifted(&rows, [0.0; 2]), Cow::Borrowed(_)));
    }
}
