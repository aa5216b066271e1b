//! Tolerances that the files state, as standard deviations of the parameters.

use model::sensors::Sensors;
use model::suspension::{ChannelKind, Corner, CornerStatics, SuspensionError};
use model::vehicle::Vehicle;
use nalgebra::{SMatrix, Vector3};
use sample::Wheel;

use crate::fusion::relations::CHANNELS;
use crate::statics::AXIAL;
use crate::tuning::MistakeTuning;

/// What the files state. Without a statement, the tuning has the tolerance.
#[derive(Clone, Debug, Default)]
pub struct Stated {
    /// Whether the vehicle file or the sensors file has a table of tolerances.
    pub is_any: bool,
    /// What the hard-points make.
    pub(super) shape: Option<Shape>,
    /// Standard deviation of the force of each strut, N.
    pub preload_n: Option<[f64; 4]>,
}

/// What errors of the hard-points of all corners make.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// Standard deviation of the part of F_x, F_y and F_z that each member carries beyond the model.
    pub(super) members: [[f64; 3]; CHANNELS],
    /// For each wheel and each coordinate, with its standard deviation: parts of F_x, F_y and F_z that the axial
    /// members and the strut carry beyond the model.
    pub(super) coordinates: [Vec<Carried>; 4],
}

/// Parts of F_x, F_y and F_z that the axial members and the strut of a corner carry beyond the model.
pub(super) type Carried = [[f64; 3]; AXIAL.len() + 1];

impl Stated {
    /// Tolerances of the hard-points and of the free lengths.
    pub(crate) fn of(vehicle: &Vehicle, sensors: &Sensors) -> Self {
        let stated = vehicle.tolerances.unwrap_or_default();
        Self {
            is_any: vehicle.tolerances.is_some() || sensors.tolerances.is_some(),
            shape: stated
                .hard_points_m
                .map(|bound_m| shape(vehicle, uniform(bound_m))),
            preload_n: stated.free_length_m.map(|bound_m| {
                Wheel::ALL.map(|wheel| {
                    let strut = vehicle.axle(wheel).strut.as_ref();
                    strut.map_or(0.0, |strut| uniform(bound_m) * strut.stiffness_n_m)
                })
            }),
        }
    }
}

/// Standard deviation of an error that is equally likely within a bound of either sign.
fn uniform(bound: f64) -> f64 {
    bound / 3.0_f64.sqrt()
}

/// The tuning with the other tolerances that the files state.
pub(crate) fn stated_tuning(
    tuning: &MistakeTuning,
    vehicle: &Vehicle,
    sensors: &Sensors,
) -> MistakeTuning {
    let mut t = *tuning;
    let exact = t.care_exact;
    let put = |sigma: &mut f64, bound: Option<f64>| {
        if let Some(bound) = bound {
            *sigma = uniform(bound).max(exact * *sigma);
        }
    };
    if let Some(stated) = &vehicle.tolerances {
        put(&mut t.rate_tolerance, stated.stiffness_fraction);
        put(&mut t.damping_error, stated.damping_fraction);
        put(&mut t.mass_tolerance, stated.mass_fraction);
        put(&mut t.cg_tolerance_m, stated.cg_m);
        t.height_tolerance_m = t.height_tolerance_m.max(t.cg_tolerance_m);
    }
    if let Some(stated) = &sensors.tolerances {
        put(&mut t.gain_tolerance, stated.gain_fraction);
        put(&mut t.tilt_tolerance_rad, stated.imu_direction_rad);
        put(&mut t.lever_tolerance_m, stated.imu_position_m);
        put(&mut t.scale_tolerance, stated.accel_scale_fraction);
    }
    t
}

/// What independent errors of all coordinates of the hard-points with a standard deviation make: in the design
/// position, standing. Axles without hard-points have none.
fn shape(vehicle: &Vehicle, sigma_m: f64) -> Shape {
    let mut members = [[0.0; 3]; CHANNELS];
    let coordinates = Wheel::ALL.map(|wheel| slopes(vehicle, wheel, sigma_m).unwrap_or_default());
    for (wheel, carried) in coordinates.iter().enumerate() {
        for (i, member) in (0..AXIAL.len()).map(|i| (i, AXIAL.len() * wheel + i)) {
            members[member] = std::array::from_fn(|axis| {
                let squares = carried.iter().map(|carried| carried[i][axis].powi(2));
                squares.sum::<f64>().sqrt()
            });
        }
    }
    Shape {
        members,
        coordinates,
    }
}

/// What each coordinate of a corner makes, if it is off by a standard deviation.
fn slopes(vehicle: &Vehicle, wheel: Wheel, sigma_m: f64) -> Result<Vec<Carried>, SuspensionError> {
    let mut moved = vehicle.clone();
    // Small against the lengths, large against their resolution.
    let step_m = 1e-5;
    let count = axle(&mut moved, wheel).hard_points_mut().len();
    let coordinates = (0..count).flat_map(|point| (0..3).map(move |axis| (point, axis)));
    let slope = |(point, coordinate): (usize, usize)| {
        let mut with = |shift_m: f64| {
            axle(&mut moved, wheel).hard_points_mut()[point][coordinate] += shift_m;
            force_gains(&moved, wheel)
        };
        let ahead = with(step_m)?;
        let behind = with(-2.0 * step_m)?;
        with(step_m)?;
        let change = (ahead - behind) * (sigma_m / (2.0 * step_m));
        Ok(std::array::from_fn(|i| {
            std::array::from_fn(|axis| change[(i, axis)])
        }))
    };
    coordinates.map(slope).collect()
}

fn axle(vehicle: &mut Vehicle, wheel: Wheel) -> &mut model::vehicle::Axle {
    if wheel.is_front() {
        &mut vehicle.front
    } else {
        &mut vehicle.rear
    }
}

/// Gains of the members' forces on the tyre's force.
fn force_gains(vehicle: &Vehicle, wheel: Wheel) -> Result<SMatrix<f64, 6, 3>, SuspensionError> {
    let corner = Corner::of(vehicle, wheel)?;
    let pose = corner.pose(corner.design_strut_length_m(), 0.0)?;
    let statics = CornerStatics::standing(
        &corner,
        &pose,
        vehicle.axle(wheel),
        Vector3::z(),
        vehicle.static_load_n(wheel),
        ChannelKind::Strut,
    )?;
    Ok(statics.force_gains())
}

#[cfg(test)]
mod tests {
    use model::{SensorsTolerances, VehicleTolerances};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn prowler() -> Vehicle {
        Vehicle::builtin("prowler").unwrap()
    }

    /// What random errors of the hard-points within the tolerance do to the gains has the standard deviation that is
    /// stated for it.
    #[test]
    fn tolerances_of_hard_points_are_what_random_errors_do() {
        let bound_m = 0.001;
        const DRAWS: u32 = 400;
        let vehicle = prowler();
        let expected = shape(&vehicle, uniform(bound_m)).members;
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        for wheel in [Wheel::FrontLeft, Wheel::RearLeft] {
            let nominal = force_gains(&vehicle, wheel).unwrap();
            let mut squares = SMatrix::<f64, 6, 3>::zeros();
            for _ in 0..DRAWS {
                let mut moved = vehicle.clone();
                for point in axle(&mut moved, wheel).hard_points_mut() {
                    for x in point {
                        *x += rng.random_range(-bound_m..bound_m);
                    }
                }
                let error = force_gains(&moved, wheel).unwrap() - nominal;
                squares += error.component_mul(&error) / f64::from(DRAWS);
            }
            for i in 0..AXIAL.len() {
                for axis in 0..3 {
                    let stated = expected[AXIAL.len() * wheel.index() + i][axis];
                    let drawn = squares[(i, axis)].sqrt();
                    eprintln!("{wheel} {i} {axis}: {stated:.4} {drawn:.4}");
                    // 400 draws know a standard deviation to 3.5 %.
                    assert!((drawn / stated - 1.0).abs() < 0.15, "{stated} {drawn}");
                }
            }
        }
        // The other side is the mirror image.
        for axis in 0..3 {
            let [left, right] = [expected[0][axis], expected[AXIAL.len()][axis]];
            assert!((left / right - 1.0).abs() < 1e-3, "{left} {right}");
        }
    }

    /// The values that the reference names for a file without a statement are those of the tuning.
    #[test]
    fn the_documented_defaults_are_those_of_the_tuning() {
        let t = MistakeTuning::default();
        let mut vehicle = prowler();
        let mut sensors = Sensors::builtin("thesis-10bit").unwrap();
        let unstated = stated_tuning(&t, &vehicle, &sensors);
        assert_eq!(unstated, t);
        vehicle.tolerances = Some(VehicleTolerances {
            stiffness_fraction: Some(0.017),
            damping_fraction: Some(0.26),
            mass_fraction: Some(0.017),
            cg_m: Some(0.017),
            ..VehicleTolerances::default()
        });
        sensors.tolerances = Some(SensorsTolerances {
            gain_fraction: Some(0.017),
            imu_direction_rad: Some(0.0087),
            imu_position_m: Some(0.035),
            accel_scale_fraction: Some(0.0052),
        });
        let stated = stated_tuning(&t, &vehicle, &sensors);
        for (own, documented) in [
            (t.rate_tolerance, stated.rate_tolerance),
            (t.damping_error, stated.damping_error),
            (t.mass_tolerance, stated.mass_tolerance),
            (t.cg_tolerance_m, stated.cg_tolerance_m),
            (t.gain_tolerance, stated.gain_tolerance),
            (t.tilt_tolerance_rad, stated.tilt_tolerance_rad),
            (t.lever_tolerance_m, stated.lever_tolerance_m),
            (t.scale_tolerance, stated.scale_tolerance),
        ] {
            // The reference has two digits.
            assert!((documented / own - 1.0).abs() < 0.025, "{own} {documented}");
        }
        assert_eq!(stated.height_tolerance_m, t.height_tolerance_m);
    }

    #[test]
    fn a_tolerance_of_zero_is_that_of_an_exact_value() {
        let t = MistakeTuning::default();
        let mut vehicle = prowler();
        vehicle.tolerances = Some(VehicleTolerances {
            mass_fraction: Some(0.0),
            ..VehicleTolerances::default()
        });
        let sensors = Sensors::builtin("thesis-10bit").unwrap();
        let stated = stated_tuning(&t, &vehicle, &sensors);
        assert_eq!(stated.mass_tolerance, t.care_exact * t.mass_tolerance);
        assert_eq!(stated.cg_tolerance_m, t.cg_tolerance_m);
        let stated = Stated::of(&vehicle, &sensors);
        assert!(stated.is_any && stated.shape.is_none() && stated.preload_n.is_none());
    }
}
