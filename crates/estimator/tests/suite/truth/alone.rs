//! What deflection alone, the vehicle model alone and the thesis's own method say of the forces.

use atvrec_estimator::calibration::Resolved;
use atvrec_estimator::{Calibration, Method, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Measurement, PerWheel, Sample};
use testkit::scoring::{Estimated, estimate};

/// The forces that the four-wheel model expects from steer and speed.
pub fn model(result: &Estimated) -> Estimated {
    let mut estimates = result.estimates.clone();
    for estimate in &mut estimates {
        estimate.measured = estimate.expected;
    }
    Estimated {
        estimates,
        ..Estimated::default()
    }
}

/// F_z = static load + k lever (compression from the design length): the thesis's equations 2.25 to
/// 2.27 with the lever the right way round. F_x and F_y are unknown.
pub fn deflection(
    vehicle: &Vehicle,
    sensors: &Sensors,
    samples: &[Sample],
    result: &Estimated,
) -> Estimated {
    let resolved = Resolved::new(sensors, &Calibration::nominal(&vehicle.name)).unwrap();
    let mut load_n = PerWheel([f64::NAN; 4]);
    let mut samples = samples.iter().peekable();
    let mut estimates = result.estimates.clone();
    for estimate in &mut estimates {
        while let Some(sample) = samples.next_if(|sample| sample.valid_time <= estimate.time) {
            let Measurement::Corner(corner) = &sample.measurement else {
                continue;
            };
            let axle = vehicle.axle(corner.wheel);
            let strut = axle.strut.as_ref().unwrap();
            let pot = &resolved.corners[corner.wheel].deflection;
            if let Some(compression_m) = corner.deflection_counts.and_then(|c| pot.value(c)) {
                let rate_n_m = strut.stiffness_n_m * strut.motion_ratio.unwrap();
                load_n[corner.wheel] =
                    vehicle.static_load_n(corner.wheel) + rate_n_m * compression_m;
            }
        }
        for (force, load) in estimate.measured.0.iter_mut().zip(load_n.0) {
            force.force_n = [f64::NAN, f64::NAN, load];
        }
    }
    Estimated {
        estimates,
        ..Estimated::default()
    }
}

/// Each corner by itself from its strain and its spring, as the thesis has it: the spring's stiffness
/// times its deflection is all that the strut carries (section 3.1). Ours takes the damper in.
pub fn thesis(vehicle: &Vehicle, sensors: &Sensors, samples: &[Sample]) -> Estimated {
    let mut springs = vehicle.clone();
    for axle in [&mut springs.front, &mut springs.rear] {
        axle.strut.as_mut().unwrap().damping_n_s_m = 0.0;
    }
    let settings = Settings {
        method: Method::Thesis,
        ..Settings::default()
    };
    let calibration = Calibration::nominal(&vehicle.name);
    estimate(&springs, sensors, &calibration, settings, samples)
}
