//! Payloads that are put on the vehicle or taken off it.

use model::vehicle::Loaded;
use sample::{PerWheel, Wheel};

use super::Estimator;
use crate::EstimatorError;
use crate::inertial_forces::InertialForces;
use crate::planar::Planar;

/// Beginning of a mark that switches a payload: `payload NAME on`, `payload NAME off`.
const MARK: &str = "payload ";

impl Estimator {
    /// Puts a payload of the vehicle file on the vehicle, or takes it off: mass, centre of gravity and
    /// inertia change at once, what the filters know stays. A payload that is already so changes
    /// nothing.
    ///
    /// # Errors
    /// A name that the vehicle file does not have, or a payload with which a wheel lifts at rest.
    pub fn set_payload(&mut self, name: &str, on: bool) -> Result<(), EstimatorError> {
        let mut names = self.payload.clone();
        names.retain(|known| known != name);
        if on {
            names.push(name.to_owned());
            // The order of the names must not depend on the order of the marks.
            names.sort();
        }
        // An unknown name is an error in both directions.
        self.unloaded.loaded(&[name])?;
        if names == self.payload {
            return Ok(());
        }
        self.put_on(names)
    }

    /// Puts these payloads on the vehicle, and takes all others off it.
    pub(super) fn put_on(&mut self, names: Vec<String>) -> Result<(), EstimatorError> {
        let Loaded {
            vehicle,
            cg_shift_m,
        } = self.pressures.applied(&self.unloaded).loaded(&names)?;
        if let Some(corners) = &mut self.corners {
            corners.load(&vehicle)?;
        }
        if let Some(fusion) = &mut self.fusion {
            fusion.load(&vehicle);
        }
        self.calibration = self.unloaded_calibration.with_cg_moved(cg_shift_m);
        let c = &self.calibration;
        self.motion
            .place(c.imu_m, [c.velocity_antenna_m, c.attitude_antenna_m]);
        if self.planar.is_some() {
            let mut planar = Planar::new(&vehicle, &self.sensors, c, &self.settings.tuning)?;
            if self.traced {
                planar.switch_trace_on();
            }
            self.planar = Some(planar);
        }
        let sigma = self.sensors.imu.gyro_noise_rad_s;
        let tuning = &self.settings.tuning.inertial_forces;
        self.inertial_forces = InertialForces::new(&vehicle, &self.calibration, sigma, tuning);
        self.expected.load(&vehicle);
        if let Some(road) = &mut self.road {
            road.load(&vehicle);
        }
        if let Some(limits) = &mut self.limits {
            limits.load(&vehicle);
        }
        let static_n = PerWheel::from_fn(|wheel: Wheel| vehicle.static_load_n(wheel));
        self.lift.load(static_n, &self.settings.tuning.lift);
        self.vehicle = vehicle;
        self.payload = names;
        Ok(())
    }

    /// Does what a mark says of a payload; other marks say nothing of one.
    ///
    /// # Errors
    /// The errors of [`Self::set_payload`].
    pub fn mark(&mut self, text: &str) -> Result<(), EstimatorError> {
        match payload_of_mark(text) {
            Some((name, on)) => self.set_payload(name, on),
            None => Ok(()),
        }
    }
}

/// Name of the payload in a mark, and whether it is put on.
fn payload_of_mark(text: &str) -> Option<(&str, bool)> {
    let (name, to) = text.trim().strip_prefix(MARK)?.trim().rsplit_once(' ')?;
    match to {
        "on" => Some((name.trim(), true)),
        "off" => Some((name.trim(), false)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_payloads_are_told_from_others() {
        assert_eq!(payload_of_mark("payload driver on"), Some(("driver", true)));
        assert_eq!(
            payload_of_mark(" payload two sacks off "),
            Some(("two sacks", false))
        );
        for other in [
            "payload",
            "payload on",
            "payload driver",
            "a payload x on",
            "",
        ] {
            assert_eq!(payload_of_mark(other), None, "{other}");
        }
    }
}
