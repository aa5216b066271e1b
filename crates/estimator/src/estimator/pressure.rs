//! Tyres at their measured inflation pressure.

use model::vehicle::{Vehicle, pressures_of_axles};
use sample::{LogTime, PerWheel, Wheel};

use super::Estimator;
use crate::tuning::PressureTuning;

/// Low-passed inflation pressures of the tyres.
#[derive(Clone, Debug)]
pub(super) struct TyrePressures {
    tuning: PressureTuning,
    /// Time and low-passed pressure of each wheel, Pa.
    mean: PerWheel<Option<(LogTime, f64)>>,
    /// Pressures of the parameters in use, Pa; `NaN` for the tyres of the vehicle file.
    used_pa: PerWheel<f64>,
}

impl TyrePressures {
    /// No pressure known yet.
    pub(super) fn new(tuning: &PressureTuning) -> Self {
        Self {
            tuning: *tuning,
            mean: PerWheel::default(),
            used_pa: PerWheel([f64::NAN; 4]),
        }
    }

    /// Takes pressures, Pa; values that no tyre has are ignored.
    pub(super) fn push(&mut self, time: LogTime, pressures_pa: &[f64; 4]) {
        let t = &self.tuning;
        for wheel in Wheel::ALL {
            let pressure_pa = pressures_pa[wheel.index()];
            if !(0.0..t.most_pa).contains(&pressure_pa) {
                continue;
            }
            let mean = &mut self.mean[wheel];
            let low_passed = mean.map_or(pressure_pa, |(before, mean_pa)| {
                let part = 1.0 - math::exp(-time.seconds_since(before).max(0.0) / t.time_s);
                mean_pa + part * (pressure_pa - mean_pa)
            });
            *mean = Some((time, low_passed));
        }
    }

    /// The vehicle on tyres at the pressures in use.
    pub(super) fn applied(&self, vehicle: &Vehicle) -> Vehicle {
        vehicle.at_pressures(&self.used_pa)
    }

    /// Takes the present pressures into use if those of an axle have changed; whether they have.
    fn change(&mut self) -> bool {
        let present_pa = PerWheel::from_fn(|wheel| self.mean[wheel].map_or(f64::NAN, |(_, p)| p));
        let [present, used] = [&present_pa, &self.used_pa].map(pressures_of_axles);
        let has_changed = present.iter().zip(&used).any(|(present, used)| {
            let apart = (present - used).abs() > self.tuning.change * used.abs();
            present.is_finite() && (used.is_nan() || apart)
        });
        if has_changed {
            self.used_pa = present_pa;
        }
        has_changed
    }
}

impl Estimator {
    /// Replaces the tyres by those at the measured pressures, at the first pressure and after each change of it.
    pub(super) fn follow_pressure(&mut self) {
        if !self.unloaded.depends_on_pressure() || !self.pressures.change() {
            return;
        }
        let [front, rear] = {
            let inflated = self.pressures.applied(&self.unloaded);
            [inflated.front.tyre, inflated.rear.tyre]
        };
        self.vehicle.front.tyre = front;
        self.vehicle.rear.tyre = rear;
        let vehicle = &self.vehicle;
        if let Some(corners) = &mut self.corners {
            corners.load_tyres(vehicle);
        }
        if let Some(fusion) = &mut self.fusion {
            fusion.load(vehicle);
        }
        if let Some(planar) = &mut self.planar {
            planar.load_tyres(vehicle, &self.calibration);
        }
        if let Some(road) = &mut self.road {
            road.load(vehicle);
        }
        if let Some(limits) = &mut self.limits {
            limits.load_tyres(vehicle);
        }
        self.inertial_forces.load_tyres(vehicle, &self.calibration);
        self.expected.load(vehicle);
        self.grip.load(vehicle);
        self.terrain.load(vehicle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> LogTime {
        LogTime(0).offset_seconds(seconds)
    }

    #[test]
    fn the_first_pressure_is_used_at_once_and_later_ones_slowly() {
        let tuning = PressureTuning::default();
        let mut pressures = TyrePressures::new(&tuning);
        assert!(!pressures.change());
        // A sensor without a value and one that is not connected.
        pressures.push(at(0.0), &[50e3, f64::NAN, 1e9, -1.0]);
        assert!(pressures.change() && !pressures.change());
        assert_eq!(pressures.used_pa[Wheel::FrontLeft], 50e3);
        assert!(pressures.used_pa[Wheel::RearLeft].is_nan());
        // One wrong value changes nothing; a lasting loss of a fifth arrives.
        pressures.push(at(0.1), &[40e3, f64::NAN, f64::NAN, f64::NAN]);
        assert!(!pressures.change());
        for second in 1..300 {
            pressures.push(at(f64::from(second)), &[40e3, f64::NAN, f64::NAN, f64::NAN]);
            pressures.change();
        }
        let used_pa = pressures.used_pa[Wheel::FrontLeft];
        assert!((used_pa / 40e3 - 1.0).abs() <= tuning.change, "{used_pa}");
    }
}
