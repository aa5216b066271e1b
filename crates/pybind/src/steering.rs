//! Steering: from the steering wheel to the road wheels.

use model::steering::{self, Lash, SteeringGear};
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::input::{self, Doubles};
use crate::origin::{Origin, Reduced};
use crate::vehicle::Vehicle;
use crate::{batch, errors};

/// Steering gear of a vehicle: calibrated maps, or the rack with its hard-points, or the ratio with
/// its part of Ackermann's geometry; with roll steer and play.
#[pyclass(frozen, module = "atvrec")]
pub struct Steering {
    inner: SteeringGear,
    origin: Origin,
}

#[pymethods]
impl Steering {
    /// The gear of a vehicle.
    #[new]
    fn new(vehicle: &Bound<'_, Vehicle>) -> PyResult<Self> {
        let gear = SteeringGear::from_vehicle(&vehicle.get().inner);
        Ok(Self {
            inner: gear.map_err(|e| errors::model(&e))?,
            origin: Origin::new(vehicle.py(), "", (vehicle,))?,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.origin.reduce::<Self>(py)
    }

    /// Free play at the steering wheel, rad, from one contact to the other.
    #[getter]
    fn lash_rad(&self) -> f64 {
        self.inner.lash_rad
    }

    /// Steer angles of the four road wheels, rad, left positive, for steering-wheel angles over time:
    /// array (..., 4). With `play` the gear follows the steering wheel only after crossing its play,
    /// along the array's order and from straight ahead.
    #[pyo3(signature = (steering_wheel_rad, roll_rad=0.0, *, play=false))]
    fn road_wheels<'py>(
        &self,
        py: Python<'py>,
        steering_wheel_rad: Doubles<'py>,
        roll_rad: f64,
        play: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        input::finite("roll_rad", roll_rad, "rad")?;
        let lash_rad = if play { self.inner.lash_rad } else { 0.0 };
        let mut lash = Lash::default();
        let mut angles = Vec::with_capacity(4 * steering_wheel_rad.len());
        for hand in input::row_major(&steering_wheel_rad).iter() {
            let hand = input::finite("steering_wheel_rad", *hand, "rad")?;
            let followed = lash.follow(hand, lash_rad);
            angles.extend(self.inner.road_wheels(followed, roll_rad));
        }
        let shape: Vec<usize> = steering_wheel_rad
            .shape()
            .iter()
            .copied()
            .chain([4])
            .collect();
        batch::shaped(py, &shape, angles)
    }

    /// The steering-wheel angle, rad, that gives a mean front steer angle.
    fn steering_wheel_rad(&self, mean_steer_rad: f64) -> PyResult<f64> {
        input::finite("mean_steer_rad", mean_steer_rad, "rad")?;
        Ok(self.inner.steering_wheel_rad(mean_steer_rad))
    }
}

/// Angles (left, right), rad, of front wheels whose normals meet on the rear axle's line, for a mean
/// angle.
#[pyfunction]
pub fn ackermann_rad(mean_rad: f64, wheelbase_m: f64, track_m: f64) -> PyResult<(f64, f64)> {
    input::finite("mean_rad", mean_rad, "rad")?;
    input::positive("wheelbase_m", wheelbase_m, "m")?;
    input::finite("track_m", track_m, "m")?;
    Ok(steering::ackermann(mean_rad, wheelbase_m, track_m).into())
}
