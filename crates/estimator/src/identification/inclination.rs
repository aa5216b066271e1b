//! Inclination of the wheels to the normal of the ground during a drive, from forces, steer angles and roll.
//!
//! gamma = phi - phi_g + gamma_l(l, z)
//!
//! with the roll angle phi of the body, the bank phi_g of the ground, and the inclination gamma_l of the wheel in the
//! body by the hard-points at the length l of the strut and the travel z of the rack. l is that of the spring under
//! the force that the statics of the linkage ask for; dampers are left out, so that it holds for slow changes. z is
//! that of the estimated steer angle. A wheel of a solid axle has the inclination of the axle, which follows from
//! the difference of both tyres' deflections. A wheel without hard-points leans as the body.

use model::suspension::{ChannelKind, Corner, CornerStatics, SuspensionError, Wrench};
use model::vehicle::{Axle, Vehicle};
use nalgebra::Vector3;
use sample::{PerWheel, Wheel};

/// Steps of the search for length and travel; each brings them nearer by a factor of ten or more.
const STEPS: usize = 4;
/// Change of the travel of the rack for its derivative, m.
const RACK_STEP_M: f64 = 1e-3;

/// What a row tells of a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WheelRow {
    /// Forces along the wheel, across it and upwards, N.
    pub(super) force_n: [f64; 3],
    /// Steer angle, rad.
    pub(super) steer_rad: f64,
}

/// Inclination of each wheel by the vehicle file.
pub(super) struct Inclinations<'v> {
    vehicle: &'v Vehicle,
    corners: PerWheel<Option<Corner>>,
}

impl<'v> Inclinations<'v> {
    pub(super) fn new(vehicle: &'v Vehicle) -> Self {
        let corner = |wheel: Wheel| {
            let has_points = vehicle.axle(wheel).has_hard_points();
            has_points
                .then(|| Corner::of(vehicle, wheel).ok())
                .flatten()
        };
        Self {
            vehicle,
            corners: PerWheel::from_fn(corner),
        }
    }

    /// Inclination of the wheels of one axle (left, right), rad; `NaN` where the forces are unknown or the linkage
    /// does not reach. `lean_rad` is the roll of the body over the ground.
    pub(super) fn of_axle(
        &self,
        wheels: [Wheel; 2],
        rows: [WheelRow; 2],
        lean_rad: f64,
    ) -> [f64; 2] {
        let axle = self.vehicle.axle(wheels[0]);
        if axle.is_solid() {
            let [left, right] = rows.map(|row| row.force_n[2] / axle.tyre.vertical_stiffness_n_m);
            return [(right - left) / axle.track_m; 2];
        }
        let mut both = [lean_rad; 2];
        for (of, (wheel, row)) in both.iter_mut().zip(wheels.into_iter().zip(rows)) {
            if let Some(corner) = &self.corners[wheel] {
                *of += in_body(corner, axle, &row).unwrap_or(f64::NAN);
            }
        }
        both
    }
}

/// Inclination of a wheel in the body, rad.
fn in_body(corner: &Corner, axle: &Axle, row: &WheelRow) -> Result<f64, SuspensionError> {
    let Some(strut) = &axle.strut else {
        return Err(SuspensionError::Missing {
            axle: "",
            table: "strut",
        });
    };
    let mut length_m = corner.design_strut_length_m();
    let mut rack_m = 0.0;
    for _ in 0..STEPS {
        let pose = corner.pose(length_m, rack_m)?;
        let load_n = row.force_n[2];
        let statics = CornerStatics::standing(
            corner,
            &pose,
            axle,
            Vector3::z(),
            load_n,
            ChannelKind::Strut,
        )?;
        let members = statics.members(&Wrench {
            force_n: row.force_n.into(),
            ..Wrench::default()
        });
        let found_m = strut.free_length_m - members.sixth_n / strut.stiffness_n_m;
        length_m = found_m.clamp(strut.bump_stop_length_m, strut.droop_stop_length_m);
        if corner.wheel.is_front() && row.steer_rad.is_finite() {
            let ahead = corner.pose(length_m, rack_m + RACK_STEP_M)?.steer_rad();
            let here = corner.pose(length_m, rack_m)?.steer_rad();
            rack_m += (row.steer_rad - here) * RACK_STEP_M / (ahead - here);
        }
    }
    Ok(corner.pose(length_m, rack_m)?.inclination_rad())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standing straight ahead, the wheels have the inclination of the design position. A steered wheel leans by
    /// caster and king-pin inclination; here it is the pose whose steer angle is the one asked for.
    #[test]
    fn a_standing_vehicle_has_its_design_inclination_and_caster_inclines_steered_wheels() {
        let vehicle = Vehicle::builtin("prowler").unwrap();
        let inclinations = Inclinations::new(&vehicle);
        let wheels = [Wheel::FrontLeft, Wheel::FrontRight];
        let at = |steer_rad: f64, lean_rad: f64| {
            let row = |wheel| WheelRow {
                force_n: [0.0, 0.0, vehicle.static_load_n(wheel)],
                steer_rad,
            };
            inclinations.of_axle(wheels, wheels.map(row), lean_rad)
        };
        let [left, right] = at(0.0, 0.0);
        assert!(
            left.abs() < 2e-3 && (left + right).abs() < 1e-9,
            "{left} {right}"
        );
        // Caster of 0.018/0.17: a wheel that steers to the left by 0.3 rad leans by about 0.1 x 0.3 to the left.
        let [left, right] = at(0.3, 0.0);
        let mean = 0.5 * (left + right);
        assert!((-0.04..-0.02).contains(&mean), "{left} {right}");
        let leaning = at(0.3, 0.05);
        assert!((leaning[0] - left - 0.05).abs() < 1e-12, "{leaning:?}");
    }

    #[test]
    fn a_wheel_without_forces_is_unknown_and_a_solid_axle_leans_by_its_tyres() {
        let vehicle = Vehicle::builtin("second-vehicle").unwrap();
        let inclinations = Inclinations::new(&vehicle);
        let row = |load_n| WheelRow {
            force_n: [0.0, 0.0, load_n],
            steer_rad: 0.0,
        };
        let rear = [Wheel::RearLeft, Wheel::RearRight];
        let [left, right] = inclinations.of_axle(rear, [row(3000.0), row(5000.0)], 0.1);
        // 2000 N over 225 kN/m over a track of 1.46 m.
        assert!((left - 0.006_088).abs() < 1e-4 && left == right, "{left}");
        let front = [Wheel::FrontLeft, Wheel::FrontRight];
        let [left, right] = inclinations.of_axle(front, [row(f64::NAN), row(3800.0)], 0.0);
        assert!(left.is_nan() && right.is_finite(), "{left} {right}");
    }
}
