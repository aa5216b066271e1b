//! Times at which a wheel or a side is off the ground, from the loads of the truth.

/// A wheel is off the ground while the load in the contact frame is below this part of its static load.
const LIFTED: f64 = 0.02;
/// A wheel is off the ground for at least this time, s.
const LIFT_MIN_S: f64 = 0.1;
/// Part of the static load from which the fall of the load is measured.
const FALL_FROM: f64 = 0.25;

/// A time off the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Flight {
    pub begin_s: f64,
    pub end_s: f64,
    /// How long the load took from a quarter of the static load, s; `None`: it did not reach a quarter since
    /// the lift before.
    pub fall_s: Option<f64>,
}

impl Flight {
    /// Whether it is long enough for a lift.
    pub fn is_lift(&self) -> bool {
        self.end_s - self.begin_s >= LIFT_MIN_S - 1e-9
    }
}

/// Finds the times at which a wheel or side is off the ground.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Flights {
    /// Whether the wheel was on the ground since the start. What begins in the air does not count.
    was_down: bool,
    /// The flight so far.
    flight: Option<Flight>,
    /// When the load was last a quarter of the static load, since the last lift.
    loaded_s: Option<f64>,
    /// Time of the last load.
    last_s: f64,
}

impl Flights {
    /// Takes the next load, as a part of the static load. Returns a flight that ends.
    pub fn push(&mut self, at_s: f64, part: f64) -> Option<Flight> {
        self.last_s = at_s;
        if part.is_nan() {
            return None;
        }
        if part >= LIFTED {
            self.was_down = true;
            let ended = self.finish();
            if part >= FALL_FROM {
                self.loaded_s = Some(at_s);
            }
            return ended;
        }
        if self.was_down {
            self.flight.get_or_insert(Flight {
                begin_s: at_s,
                end_s: at_s,
                fall_s: self.loaded_s.map(|loaded_s| at_s - loaded_s),
            });
        }
        None
    }

    /// Ends a flight at the last load.
    pub fn finish(&mut self) -> Option<Flight> {
        let mut flight = self.flight.take()?;
        flight.end_s = self.last_s;
        if flight.is_lift() {
            self.loaded_s = None;
        }
        Some(flight)
    }
}
