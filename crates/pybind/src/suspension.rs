//! Ride models and the double wishbone.

use model::road::{RoadClass, RoadProfile};
use model::suspension::{
    ChannelKind, Corner as Linkage, CornerMotion, CornerStatics, FullCar, HalfCar, MemberForces,
    Parity, QuarterCar, Ride as Linear, SuspensionError, TyreFrame, Wrench,
};
use model::vehicle::{Axle, Unsprung};
use nalgebra::{Complex, SMatrix, Vector3};
use numpy::ndarray::Array2;
use numpy::{Complex64, IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::input::{self, Doubles};
use crate::origin::{Origin, Reduced};
use crate::vehicle::Vehicle;
use crate::{batch, errors};

/// Calls something on a ride model of any kind.
macro_rules! each {
    ($ride:expr, $model:ident => $work:expr) => {
        match $ride {
            Kind::Quarter($model) => $work,
            Kind::Half($model) => $work,
            Kind::Full($model) => $work,
        }
    };
}

enum Kind {
    Quarter(Box<QuarterCar>),
    Half(Box<HalfCar>),
    Full(Box<FullCar>),
}

/// A linear ride model: x' = A x + B_0 u + B_1 u' with road heights u under its wheels and the
/// state [q', q], heights from static equilibrium (section 2.2 of the thesis).
#[pyclass(frozen, module = "atvrec")]
pub struct Ride {
    kind: Kind,
    origin: Origin,
}

#[pymethods]
impl Ride {
    /// Quarter car over one wheel (`fl`, `fr`, `rl`, `rr`): q = (z_s, z_u).
    #[staticmethod]
    fn quarter(vehicle: &Bound<'_, Vehicle>, wheel: &str) -> PyResult<Self> {
        let made = QuarterCar::of(&vehicle.get().inner, input::wheel(wheel)?);
        Ok(Self {
            kind: Kind::Quarter(Box::new(made.map_err(|e| suspension(&e))?)),
            origin: Origin::new(vehicle.py(), "quarter", (vehicle, wheel))?,
        })
    }

    /// Half car, longitudinal: q = (z_s, theta nose down, z_front, z_rear), both sides together.
    #[staticmethod]
    fn half(vehicle: &Bound<'_, Vehicle>) -> PyResult<Self> {
        let made = HalfCar::of(&vehicle.get().inner);
        Ok(Self {
            kind: Kind::Half(Box::new(made.map_err(|e| suspension(&e))?)),
            origin: Origin::new(vehicle.py(), "half", (vehicle,))?,
        })
    }

    /// Half car, lateral, over the axle of `wheel`: q = (z_s, phi right side down, z_left, z_right).
    #[staticmethod]
    fn half_lateral(vehicle: &Bound<'_, Vehicle>, wheel: &str) -> PyResult<Self> {
        let made = HalfCar::lateral_of(&vehicle.get().inner, input::wheel(wheel)?);
        Ok(Self {
            kind: Kind::Half(Box::new(made.map_err(|e| suspension(&e))?)),
            origin: Origin::new(vehicle.py(), "half_lateral", (vehicle, wheel))?,
        })
    }

    /// Full car: q = (z_s, phi, theta, z_fl, z_fr, z_rl, z_rr).
    #[staticmethod]
    fn full(vehicle: &Bound<'_, Vehicle>) -> PyResult<Self> {
        let made = FullCar::of(&vehicle.get().inner);
        Ok(Self {
            kind: Kind::Full(Box::new(made.map_err(|e| suspension(&e))?)),
            origin: Origin::new(vehicle.py(), "full", (vehicle,))?,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.origin.reduce::<Self>(py)
    }

    /// A, B_0 and B_1: arrays (n, n), (n, wheels), (n, wheels).
    #[allow(clippy::type_complexity)]
    fn system<'py>(
        &self,
        py: Python<'py>,
    ) -> (
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
    ) {
        each!(&self.kind, m => (
            matrix(py, &m.state),
            matrix(py, &m.road),
            matrix(py, &m.road_rate),
        ))
    }

    /// Poles, 1/s, by rising magnitude: complex array (n,).
    fn poles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<Complex64>> {
        each!(&self.kind, m => m.poles()).into_pyarray(py)
    }

    /// Response of the state to a unit sine of road height under one wheel (0 is the first), at
    /// frequencies in Hz: complex array (frequencies, n).
    fn response<'py>(
        &self,
        py: Python<'py>,
        wheel: usize,
        frequency_hz: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
        each!(&self.kind, m => response(py, m.as_ref(), wheel, &frequency_hz))
    }
}

fn response<'py, const D: usize, const N: usize, const W: usize>(
    py: Python<'py>,
    ride: &Linear<D, N, W>,
    wheel: usize,
    frequency_hz: &Doubles<'py>,
) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
    if wheel >= W {
        return Err(errors::argument(format!(
            "wheel = {wheel}: must be less than {W}, the number of wheels"
        )));
    }
    let frequencies = input::row_major(frequency_hz);
    let mut all = Array2::zeros((frequencies.len(), N));
    for (row, frequency) in frequencies.iter().enumerate() {
        input::finite("frequency_hz", *frequency, "Hz")?;
        let state = ride.response(wheel, *frequency).ok_or_else(|| {
            errors::argument(format!(
                "frequency_hz = {frequency} Hz: an undamped pole lies there; choose another"
            ))
        })?;
        for (column, value) in state.iter().enumerate() {
            all[(row, column)] = Complex::new(value.re, value.im);
        }
    }
    Ok(all.into_pyarray(py))
}

/// Height of an ISO 8608 road at positions along the track, m: array like `position_m`.
///
/// `road_class` is `A` to `H`; the profile is a sum of sines from 91 m to 0.35 m of wavelength whose
/// phases come from the seed.
#[pyfunction]
#[pyo3(signature = (road_class, position_m, *, seed=0, sines=400))]
pub fn road_height_m<'py>(
    py: Python<'py>,
    road_class: &str,
    position_m: Doubles<'py>,
    seed: u64,
    sines: usize,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let class = RoadClass::by_letter(road_class)
        .ok_or_else(|| errors::argument(format!("road_class = {road_class:?}: must be A to H")))?;
    let profile =
        RoadProfile::new(class, 91.0, 0.35, sines, seed).map_err(|e| errors::model(&e))?;
    let positions = input::row_major(&position_m);
    let heights = py.detach(|| positions.iter().map(|p| profile.height_m(*p)).collect());
    batch::shaped(py, position_m.shape(), heights)
}

/// The linkage of one corner, from its hard-points.
#[pyclass(frozen, module = "atvrec")]
pub struct Corner {
    linkage: Linkage,
    axle: Axle,
    origin: Origin,
}

const CURVES: [&str; 6] = [
    "strut_length_m",
    "camber_rad",
    "toe_in_rad",
    "track_m",
    "roll_centre_height_m",
    "motion_ratio",
];

#[pymethods]
impl Corner {
    /// Names of the member forces, all in N, tension positive; the last is the strut's push.
    #[classattr]
    #[pyo3(name = "MEMBERS")]
    const MEMBERS: [&'static str; 6] = [
        "upper_front",
        "upper_rear",
        "lower_front",
        "lower_rear",
        "tie_rod",
        "strut",
    ];

    /// The corner of a wheel: `fl`, `fr`, `rl` or `rr`.
    #[new]
    fn new(vehicle: &Bound<'_, Vehicle>, wheel: &str) -> PyResult<Self> {
        let origin = Origin::new(vehicle.py(), "", (vehicle, wheel))?;
        let (vehicle, wheel) = (&vehicle.get().inner, input::wheel(wheel)?);
        let axle = vehicle.axle(wheel);
        Ok(Self {
            linkage: Linkage::of(vehicle, wheel).map_err(|e| suspension(&e))?,
            axle: axle.clone(),
            origin,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.origin.reduce::<Self>(py)
    }

    /// Kinematics against jounce (wheel centre above its design height, m) as a dict of arrays
    /// like `jounce_m`: `strut_length_m`, `camber_rad` (top outwards), `toe_in_rad`, `track_m`,
    /// `roll_centre_height_m`, `motion_ratio` (strut travel over wheel travel).
    #[pyo3(signature = (jounce_m, loaded_radius_m=None))]
    fn curves<'py>(
        &self,
        py: Python<'py>,
        jounce_m: Doubles<'py>,
        loaded_radius_m: Option<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let radius = loaded_radius_m.unwrap_or(self.axle.tyre.unloaded_radius_m);
        input::positive("loaded_radius_m", radius, "m")?;
        let jounces = input::row_major(&jounce_m);
        let mut rows = Vec::with_capacity(jounces.len() * CURVES.len());
        for jounce in jounces.iter() {
            let point = self.linkage.jounce_point(*jounce, radius);
            let point = point.map_err(|e| suspension(&e))?;
            rows.extend([
                point.strut_length_m,
                point.camber_rad,
                point.toe_in_rad,
                point.track_m,
                point.roll_centre_height_m,
                point.motion_ratio,
            ]);
        }
        let shape: Vec<usize> = jounce_m
            .shape()
            .iter()
            .copied()
            .chain([CURVES.len()])
            .collect();
        let all = batch::shaped(py, &shape, rows)?;
        batch::split(py, &all, &CURVES.map(|name| (name, 1)))
    }

    /// Member forces, N, that a contact-patch wrench (F_x, F_y, F_z, M_x, M_y, M_z; N and N m,
    /// contact frame) calls for at rest on level ground: array (..., 6), named by `MEMBERS`.
    #[pyo3(signature = (wrench, jounce_m=0.0, rack_m=0.0))]
    fn members<'py>(
        &self,
        py: Python<'py>,
        wrench: Doubles<'py>,
        jounce_m: f64,
        rack_m: f64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let names = ["F_x", "F_y", "F_z", "M_x", "M_y", "M_z"];
        let rows = input::rows("wrench", &wrench, &names)?;
        let statics = self.statics(jounce_m, rack_m)?;
        let forces = rows.chunks_exact(6).flat_map(|row| {
            let members = statics.members(&Wrench::from_vector(&six(row)));
            <[f64; 6]>::from(members.to_vector())
        });
        batch::shaped(py, wrench.shape(), forces.collect())
    }

    /// The contact-patch wrench (N and N m, contact frame) that all six member forces tell of at
    /// rest on level ground: array (..., 6).
    #[pyo3(signature = (members, jounce_m=0.0, rack_m=0.0))]
    fn wrench<'py>(
        &self,
        py: Python<'py>,
        members: Doubles<'py>,
        jounce_m: f64,
        rack_m: f64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let rows = input::rows("members", &members, &Self::MEMBERS)?;
        let statics = self.statics(jounce_m, rack_m)?;
        let wrenches = rows.chunks_exact(6).flat_map(|row| {
            let wrench = statics.wrench(&MemberForces::from_vector(&six(row)));
            <[f64; 6]>::from(wrench.to_vector())
        });
        batch::shaped(py, members.shape(), wrenches.collect())
    }

    /// Least squares of the six member forces and what is known of the moments beforehand
    /// (M_x, M_y + c R F_z and M_z are zero within `moment_sigma_n_m`): a tuple of the wrench (6,)
    /// and its covariance (6, 6), N and N m.
    ///
    /// `member_sigma_n` is the deviation of each member force, N; infinite for a dead channel.
    /// `rolling_m` is the rolling resistance coefficient times the radius. The moments' default
    /// deviations are those of a free-rolling wheel; make that of M_y infinite on a driven one.
    /// Raises ArgumentError where what is left does not determine the wrench.
    #[pyo3(signature = (
        members, member_sigma_n, *, moment_sigma_n_m=[40.0, 6.0, 15.0], rolling_m=0.0,
        jounce_m=0.0, rack_m=0.0
    ))]
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn wrench_with_parity<'py>(
        &self,
        py: Python<'py>,
        members: [f64; 6],
        member_sigma_n: [f64; 6],
        moment_sigma_n_m: [f64; 3],
        rolling_m: f64,
        jounce_m: f64,
        rack_m: f64,
    ) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArray2<f64>>)> {
        for sigma in member_sigma_n.iter().chain(&moment_sigma_n_m) {
            if sigma.is_nan() || *sigma <= 0.0 {
                return Err(errors::argument(format!(
                    "a deviation is {sigma}: must be greater than 0, infinite where nothing is known"
                )));
            }
        }
        input::finite("rolling_m", rolling_m, "m")?;
        let statics = self.statics(jounce_m, rack_m)?;
        let parity = Parity {
            sigma_n_m: moment_sigma_n_m,
            rolling_radius_m: rolling_m,
        };
        let found = statics
            .wrench_with_parity(&members.into(), &member_sigma_n.into(), &parity)
            .ok_or_else(|| {
                errors::argument("the live channels and moments do not determine the wrench")
            })?;
        let wrench = <[f64; 6]>::from(found.wrench.to_vector());
        Ok((
            batch::vector(py, wrench.to_vec())?,
            matrix(py, &found.covariance),
        ))
    }
}

impl Corner {
    fn statics(&self, jounce_m: f64, rack_m: f64) -> PyResult<CornerStatics> {
        let unsprung: &Unsprung = self.axle.unsprung.as_ref().ok_or_else(|| {
            errors::vehicle("the axle has no unsprung masses; add the table to the file".into())
        })?;
        let made = self
            .linkage
            .pose_at_jounce(jounce_m, rack_m)
            .and_then(|pose| {
                let radius = self.axle.tyre.unloaded_radius_m;
                let frame = TyreFrame::new(&pose, Vector3::z(), radius, 0.0);
                let gravity = Vector3::z() * sample::STANDARD_GRAVITY_M_S2;
                let motion = CornerMotion::at_rest(gravity);
                let sixth = ChannelKind::Strut;
                CornerStatics::new(&self.linkage, &pose, &frame, unsprung, &motion, sixth)
            });
        made.map_err(|e| suspension(&e))
    }
}

fn six(row: &[f64]) -> nalgebra::Vector6<f64> {
    nalgebra::Vector6::from_iterator(row.iter().copied())
}

fn matrix<'py, const R: usize, const C: usize>(
    py: Python<'py>,
    matrix: &SMatrix<f64, R, C>,
) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn((R, C), |(r, c)| matrix[(r, c)]).into_pyarray(py)
}

fn suspension(error: &SuspensionError) -> PyErr {
    match error {
        SuspensionError::Missing { .. } | SuspensionError::Degenerate { .. } => {
            errors::vehicle(error.to_string())
        }
        _ => errors::argument(error.to_string()),
    }
}
