//! What the estimator reports once a second of sensors, tyres and innovations.

use estimator::consistency::chi_squared_bounds;
use sample::{AxleGrip, InnovationKind, Parameters};

/// The reports of a drive, as far as the page shows them.
#[derive(Clone, Debug, Default)]
pub struct Learnt {
    /// The last report.
    pub last: Option<Box<Parameters>>,
    /// The reports that are drawn.
    pub drawn: Vec<Drawn>,
    /// Number of statistics of innovations whose mean is within the 95 % bounds of chi-square, and of all.
    consistent: [usize; 2],
}

/// What is drawn of a report.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Seconds since the start of the drive.
    pub time_s: f64,
    /// Grip of the front and of the rear axle.
    pub grip: [Grip; 2],
    /// Mean normalised innovation squared by [`InnovationKind::index`]; NaN without an innovation.
    pub innovations: [f32; InnovationKind::COUNT],
}

/// Grip of an axle.
#[derive(Clone, Copy, Debug)]
pub struct Grip {
    /// Factor on the vehicle file's cornering stiffness.
    pub stiffness_factor: f32,
    /// Friction coefficient; NaN if it is unknown.
    pub friction: f32,
    /// Lower bound of an unknown friction coefficient; NaN if it is known.
    pub friction_min: f32,
}

impl Grip {
    fn of(axle: &AxleGrip) -> Self {
        let friction_min = axle.friction.map_or(axle.friction_min, |_| f64::NAN);
        Self {
            stiffness_factor: axle.stiffness_factor as f32,
            friction: axle.friction.unwrap_or(f64::NAN) as f32,
            friction_min: friction_min as f32,
        }
    }
}

impl Learnt {
    /// Takes a report. It is drawn if it is at least `apart_s` after the last one that is.
    pub fn take(&mut self, report: Parameters, time_s: f64, apart_s: f64) {
        let innovations = InnovationKind::ALL.map(|kind| {
            let found = report.innovations[kind.index()];
            if found.count == 0 {
                return f32::NAN;
            }
            let [low, high] = chi_squared_bounds(f64::from(found.count));
            let is_inside = (low..=high).contains(&found.mean_square);
            self.consistent[0] += usize::from(is_inside);
            self.consistent[1] += 1;
            found.mean_square as f32
        });
        let last = self.drawn.last();
        if last.is_none_or(|last| time_s >= last.time_s + apart_s) {
            self.drawn.push(Drawn {
                time_s,
                grip: [&report.front, &report.rear].map(Grip::of),
                innovations,
            });
        }
        self.last = Some(Box::new(report));
    }

    /// Part of the statistics of innovations whose mean is within the 95 % bounds, and their number.
    pub fn consistent(&self) -> Option<(f64, usize)> {
        let [inside, all] = self.consistent;
        (all > 0).then(|| (inside as f64 / all as f64, all))
    }
}
