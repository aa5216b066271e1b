//! Simple methods to compare the estimator with, on the same samples.
//!
//! - *Deflection alone*: F_z = static load + i (F_s(l, l') - F_s(l_0, 0)) with the force F_s of spring,
//!   damper and stops at the strut length l, the motion ratio i (metres of strut for one of wheel) and
//!   the design length l_0. The accelerations of the unsprung masses are left out. F_x and F_y are
//!   unknown.
//! - *Statics*: the thesis's link forces through the statics of each corner (`method = "thesis"`),
//!   without the inertia of the unsprung masses.
//! - *Vehicle model*: [`Estimate::expected`], from steer angle and motion alone.

use model::sensors::Sensors;
use model::vehicle::{Strut, Vehicle};
use sample::{
    Counts, Estimate, ForceSource, LogTime, Measurement, PerWheel, Sample, TyreForce, Wheel,
};

use crate::calibration::{Channel, Resolved};
use crate::{Calibration, Estimator, EstimatorError, Method, Output, Settings};

/// Time constant of the strut rate: the rate is the difference from a first-order lag over its time
/// constant. At 10 bit, a shorter one makes the damper force noisier than it is wrong, s.
const RATE_TIME_S: f64 = 0.03;

/// Estimates of the simple methods.
#[derive(Clone, Debug, Default)]
pub struct Simple {
    /// Deflection alone.
    pub deflection: Vec<Estimate>,
    /// Statics of each corner.
    pub statics: Vec<Estimate>,
    /// The vehicle model alone.
    pub model: Vec<Estimate>,
}

impl Simple {
    /// The methods by name.
    #[must_use]
    pub fn by_name(self) -> [(&'static str, Vec<Estimate>); 3] {
        [
            ("deflection", self.deflection),
            ("statics", self.statics),
            ("model", self.model),
        ]
    }
}

/// Runs the simple methods over samples in the order of their log time.
///
/// # Errors
/// If the estimator refuses the vehicle, the sensors or the calibration.
pub fn simple_methods(
    vehicle: &Vehicle,
    sensors: &Sensors,
    calibration: &Calibration,
    samples: impl Iterator<Item = Sample>,
) -> Result<Simple, EstimatorError> {
    let settings = Settings {
        method: Method::Thesis,
        ..Settings::default()
    };
    let estimator = Estimator::new(vehicle, sensors, calibration, settings)?;
    let mut estimator = estimator.without_unsprung_inertia();
    let resolved = Resolved::new(sensors, calibration)?;
    let mut corners = PerWheel::from_fn(|wheel| {
        DeflectionAlone::new(vehicle, wheel, resolved.corners[wheel].deflection)
    });
    let mut all = Simple::default();
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| {
            let Output::Estimate(estimate) = output else {
                return;
            };
            let loads = PerWheel::from_fn(|wheel| of_load(corners[wheel].load_n));
            all.deflection.push(with_forces(&estimate, loads));
            all.model.push(with_forces(&estimate, estimate.expected));
            all.statics.push(estimate);
        });
        if let Measurement::Corner(corner) = &sample.measurement
            && let Some(counts) = corner.deflection_counts
        {
            corners[corner.wheel].take(sample.valid_time, counts);
        }
        estimator.push(&sample);
    }
    Ok(all)
}

fn of_load(load_n: f64) -> TyreForce {
    TyreForce {
        force_n: [f64::NAN, f64::NAN, load_n],
        source: ForceSource::Deflection,
        ..TyreForce::default()
    }
}

/// The estimate with other forces, which are of the contact frame.
fn with_forces(estimate: &Estimate, forces: PerWheel<TyreForce>) -> Estimate {
    Estimate {
        carrier: PerWheel::default(),
        measured: forces,
        ..estimate.clone()
    }
}

/// One corner's load by its deflection alone.
struct DeflectionAlone {
    strut: Option<(Strut, f64)>,
    channel: Channel,
    static_load_n: f64,
    lagged_m: Option<(LogTime, f64)>,
    load_n: f64,
}

impl DeflectionAlone {
    fn new(vehicle: &Vehicle, wheel: Wheel, channel: Channel) -> Self {
        let strut = vehicle.axle(wheel).strut.as_ref();
        Self {
            strut: strut.and_then(|strut| Some((strut.clone(), strut.motion_ratio?))),
            channel,
            static_load_n: vehicle.static_load_n(wheel),
            lagged_m: None,
            load_n: f64::NAN,
        }
    }

    fn take(&mut self, time: LogTime, counts: Counts) {
        let (Some((strut, ratio)), Some(compression_m)) = (&self.strut, self.channel.value(counts))
        else {
            return;
        };
        let length_m = strut.design_length_m - compression_m;
        let (before, lagged_m) = self.lagged_m.unwrap_or((time, length_m));
        let part = (time.seconds_since(before) / RATE_TIME_S).clamp(0.0, 1.0);
        let lagged_m = lagged_m + part * (length_m - lagged_m);
        self.lagged_m = Some((time, lagged_m));
        let rate_m_s = (length_m - lagged_m) / RATE_TIME_S;
        let force_n = |length_m, rate_m_s| strut.force(length_m, rate_m_s).total_n();
        let more_n = force_n(length_m, rate_m_s) - force_n(strut.design_length_m, 0.0);
        self.load_n = self.static_load_n + ratio * more_n;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strut that stands carries the spring's force, one that is being compressed the damper's, too.
    #[test]
    fn the_load_is_that_of_spring_and_damper() {
        let vehicle = Vehicle::builtin("prowler").expect("a built-in vehicle");
        let channel = Channel {
            offset_counts: 500.0,
            offset_sigma: 0.0,
            gain: 1e-4,
            noise_sigma: 1e-4,
            counts_max: 1023.0,
            adc_bits: 10,
            frozen_after: None,
            dead: false,
        };
        let mut corner = DeflectionAlone::new(&vehicle, Wheel::FrontLeft, channel);
        let strut = vehicle.front.strut.clone().expect("a strut");
        let ratio = strut.motion_ratio.expect("a motion ratio");
        let at = |k: u32| LogTime(0).offset_seconds(f64::from(k) * 0.01);
        for k in 0..50 {
            corner.take(at(k), 600.into());
        }
        let spring_n = vehicle.static_load_n(Wheel::FrontLeft) + ratio * strut.stiffness_n_m * 0.01;
        assert!((corner.load_n - spring_n).abs() < 1.0, "{}", corner.load_n);
        // A tenth of a metre a second.
        for k in 0..15_u8 {
            corner.take(at(50 + u32::from(k)), (600 + 10 * i32::from(k)).into());
        }
        let moved_n = ratio * (strut.stiffness_n_m * 0.014 + strut.damping_n_s_m * 0.1);
        let more_n = corner.load_n - spring_n;
        assert!((more_n / moved_n - 1.0).abs() < 0.1, "{more_n} {moved_n}");
    }
}
