//! Strain channels at the temperature of their bridges.

use sample::{LogTime, PerWheel, StrainChannel, Wheel};

use super::Estimator;
use super::events::temperature_event;
use crate::Output;
use crate::calibration::temperature::OLD_S;

/// Last temperatures of the bridges.
#[derive(Clone, Debug, Default)]
pub(super) struct BridgeTemperatures {
    last: PerWheel<Option<(LogTime, f64)>>,
    /// Wheels whose temperature is reported as old.
    reported: PerWheel<bool>,
    begin: Option<LogTime>,
}

impl BridgeTemperatures {
    pub fn push(&mut self, time: LogTime, temperatures_c: &[f64; 4]) {
        for wheel in Wheel::ALL {
            let temperature_c = temperatures_c[wheel.index()];
            // Outside the range of bonded gauges, a sensor is not connected.
            if (-80.0..250.0).contains(&temperature_c) {
                self.last[wheel] = Some((time, temperature_c));
            }
        }
    }
}

impl Estimator {
    /// Corrects the strain channels whose drift is calibrated, and reports temperatures that do not arrive.
    pub(super) fn correct_drift(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        let begin = *self.temperatures.begin.get_or_insert(now);
        for wheel in Wheel::ALL {
            let drifts = self.calibration.drift[wheel];
            if drifts.iter().all(Option::is_none) {
                continue;
            }
            let reading = self.temperatures.last[wheel];
            let age_s = |time: LogTime| now.seconds_since(time).max(0.0);
            for index in 0..StrainChannel::COUNT {
                if let Some(drift) = drifts[index] {
                    let nominal = &self.unloaded_calibration.corners[wheel].strain[index];
                    let reading = reading.map(|(time, temperature_c)| (temperature_c, age_s(time)));
                    self.calibration.corners[wheel].strain[index] = drift.applied(nominal, reading);
                }
            }
            let is_old = age_s(reading.map_or(begin, |(time, _)| time)) > OLD_S;
            if is_old != self.temperatures.reported[wheel] {
                self.temperatures.reported[wheel] = is_old;
                out(Output::Event(temperature_event(
                    now,
                    wheel,
                    is_old,
                    reading.map(|r| r.1),
                )));
            }
        }
    }
}
