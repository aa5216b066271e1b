//! What the estimates are drawn beside: the truth of the log, or another run.

use std::sync::Arc;

use store::Reader;

use crate::drive::Drive;
use crate::frame::Frame;
use crate::options::Options;
use crate::plot::Pen;
use crate::{Error, Progress};

/// Longest step of the distance, s: a gap of the estimates adds no distance.
const STEP_MAX_S: f64 = 0.5;

/// Motion and forces of the truth or of another run, on the time grids of the drive.
pub struct Reference {
    /// Name in the figures.
    pub name: &'static str,
    /// How it is drawn.
    pub pen: Pen,
    /// Motion on the grid of the estimated motion.
    pub motion: Frame,
    /// Forces on the grid of the estimated forces.
    pub forces: Frame,
}

impl Reference {
    /// The other run if one is given, else the truth if the log has one; the truth moves out of the drive.
    pub fn choose(
        drive: &mut Drive,
        options: &Options,
        progress: &mut Progress<'_>,
    ) -> Result<Option<Self>, Error> {
        if options.against.is_empty() {
            let is_there = !drive.truth_motion.is_empty() || !drive.truth_forces.is_empty();
            return Ok(is_there.then_some(Self {
                name: "truth",
                pen: Pen::Truth,
                motion: std::mem::take(&mut drive.truth_motion),
                forces: std::mem::take(&mut drive.truth_forces),
            }));
        }
        let reader = Reader::open(&options.against)?;
        let own = Options {
            smoothed: options.smoothed,
            ..Options::default()
        };
        let other = Drive::read(&reader, &own, progress)?;
        if other.motion.is_empty() {
            return Err(Error::NoReference);
        }
        let (motion, forces) = if options.by_distance {
            by_distance(drive, other)
        } else {
            (
                other.motion.on(&drive.motion.time_s),
                other.forces.on(&drive.forces.time_s),
            )
        };
        Ok(Some(Self {
            name: "other run",
            pen: Pen::Truth,
            motion,
            forces,
        }))
    }
}

/// The other run at the distance that this one has at each instant.
fn by_distance(drive: &Drive, mut other: Drive) -> (Frame, Frame) {
    let own_m = distance_m(&drive.motion);
    let other_m = distance_m(&other.motion);
    // The instant of the other run at which it has the distance of each instant of this run.
    let instants = |grid: &[f64]| -> Vec<f64> {
        let at = |time: &f64| {
            let here_m = interpolate(&drive.motion.time_s, &own_m, *time);
            interpolate(&other_m, &other.motion.time_s, here_m)
        };
        grid.iter().map(at).collect()
    };
    let times = [&drive.motion.time_s, &drive.forces.time_s].map(|grid| Arc::new(instants(grid)));
    let mut motion = std::mem::take(&mut other.motion).on(&times[0]);
    let mut forces = std::mem::take(&mut other.forces).on(&times[1]);
    motion.time_s.clone_from(&drive.motion.time_s);
    forces.time_s.clone_from(&drive.forces.time_s);
    (motion, forces)
}

/// Distance along the path at each instant, m; it rises.
pub fn distance_m(motion: &Frame) -> Vec<f64> {
    let forward = motion.get("velocity_x_m_s");
    let step_max_s = motion.thinning().gap_s(STEP_MAX_S);
    let mut sum_m = 0.0;
    let mut before_s = motion.time_s.first().copied().unwrap_or_default();
    let step = |(index, time): (usize, &f64)| {
        let speed = forward.map_or(0.0, |speed| f64::from(speed[index]));
        let speed = if speed.is_finite() { speed.abs() } else { 0.0 };
        sum_m += speed * (time - before_s).clamp(0.0, step_max_s);
        before_s = *time;
        sum_m
    };
    motion.time_s.iter().enumerate().map(step).collect()
}

/// `y` at `at` by straight lines over rising `x`; the ends beyond them.
pub fn interpolate(x: &[f64], y: &[f64], at: f64) -> f64 {
    let next = x.partition_point(|value| *value <= at);
    let Some(index) = next.checked_sub(1) else {
        return y.first().copied().unwrap_or_default();
    };
    match (x.get(next), y.get(next)) {
        (Some(after), Some(value)) => {
            let part = (at - x[index]) / (after - x[index]);
            y[index] + part * (value - y[index])
        }
        _ => y[index],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_counts_no_gap() {
        let mut motion = Frame::at(vec![0.0, 1.0, 1.1, 1.2, 100.0]);
        motion.set("velocity_x_m_s", vec![10.0, 10.0, 10.0, f32::NAN, -10.0]);
        let found: Vec<String> = distance_m(&motion)
            .iter()
            .map(|d| format!("{d:.1}"))
            .collect();
        assert_eq!(found, ["0.0", "5.0", "6.0", "6.0", "11.0"]);
        assert_eq!(interpolate(&[0.0, 2.0], &[1.0, 5.0], 0.5), 2.0);
        assert_eq!(interpolate(&[0.0, 2.0], &[1.0, 5.0], 3.0), 5.0);
    }
}
