use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Estimate, Event, LogTime, Motion, PerWheel, Sample};

use crate::calibration::Resolved;
use crate::{Calibration, EstimatorError, Settings};

/// Spacing of the instants that estimates are given for, ns.
pub const GRID_NANOS: u64 = 10_000_000;

/// A jump of the log clock, ns, that is not bridged: estimates start anew after it.
const GAP_MAX_NANOS: u64 = 10_000_000_000;

/// What the estimator hands out.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "handed out on the stack, so that a step allocates nothing"
)]
pub enum Output {
    /// The estimate of one instant of the grid.
    Estimate(Estimate),
    /// Something that it declares.
    Event(Event),
}

/// Forces and motion of one vehicle from its samples.
///
/// For each arrival, first call [`advance`](Self::advance) with its log time, then
/// [`push`](Self::push) each sample that was decoded from it. Ticks advance time too, so that
/// estimates go on when sensors fall silent.
#[derive(Clone, Debug)]
pub struct Estimator {
    calibration: Resolved,
    settings: Settings,
    next_grid: Option<LogTime>,
}

impl Estimator {
    /// An estimator that has seen nothing.
    ///
    /// # Errors
    /// When the calibration is another vehicle's, or a value cannot be used.
    pub fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        calibration: &Calibration,
        settings: Settings,
    ) -> Result<Self, EstimatorError> {
        if calibration.vehicle != vehicle.name {
            return Err(EstimatorError::OtherVehicle {
                expected: vehicle.name.clone(),
                found: calibration.vehicle.clone(),
            });
        }
        Ok(Self {
            calibration: Resolved::new(sensors, calibration)?,
            settings,
            next_grid: None,
        })
    }

    /// Moves time to `now` and hands out the estimate of every grid instant up to it. Instants
    /// are multiples of [`GRID_NANOS`] on the log clock, the first at or after the first call's
    /// time.
    pub fn advance(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        let mut grid = match self.next_grid {
            Some(grid) if now.0.saturating_sub(grid.0) <= GAP_MAX_NANOS => grid,
            _ => LogTime(now.0.div_ceil(GRID_NANOS) * GRID_NANOS),
        };
        while grid <= now {
            out(Output::Estimate(self.step(grid)));
            grid = LogTime(grid.0 + GRID_NANOS);
        }
        self.next_grid = Some(grid);
    }

    /// Takes one sample in. Samples that do not concern the estimator are ignored.
    pub fn push(&mut self, sample: &Sample) {
        let _ = (sample, &self.calibration, &self.settings);
    }

    fn step(&mut self, time: LogTime) -> Estimate {
        Estimate {
            time,
            motion: Motion::default(),
            measured: PerWheel::default(),
            expected: PerWheel::default(),
        }
    }
}
