//! How far values of the vehicle file and of the sensors file can be from the truth.
//!
//! Each tolerance is the bound of an error of either sign that is equally likely within it. 0 means that the value is
//! exact.

use serde::{Deserialize, Serialize};

use crate::file::rules::Kind::Number;
use crate::file::rules::Range::NonNegative;
use crate::file::rules::{Rule, may};
use crate::vehicle::Axle;

/// Largest error of a position that a file may state, m: beyond it, the value was not measured.
const PLACE_MAX_M: f64 = 0.05;
/// Largest relative error that a file may state.
const FRACTION_MAX: f64 = 0.5;

/// Tolerances of the vehicle file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleTolerances {
    /// Each coordinate of each hard-point, m. Without it: each member carries 1 % more or less of each force of its
    /// tyre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hard_points_m: Option<f64>,
    /// Stiffness of each spring, as a part of it. Without it: 0.017.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness_fraction: Option<f64>,
    /// Free length of each spring, m. Without it: the force of each strut is known to 1.7 % of the mean load of the
    /// wheels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_length_m: Option<f64>,
    /// Damping of each damper, as a part of it. Without it: 0.26.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_fraction: Option<f64>,
    /// Mass of the whole vehicle, as a part of it. Without it: 0.017.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_fraction: Option<f64>,
    /// Each coordinate of the centre of gravity, m. Without it: 0.017.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cg_m: Option<f64>,
}

/// Tolerances of the sensors file. That of the zeros is `strain.zero_error_counts`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorsTolerances {
    /// Gain of each strain channel with gauge factor, section and modulus, as a part of it. Without it: 0.017.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_fraction: Option<f64>,
    /// Direction of the inertial unit about each axis, rad. Without it: 0.0087.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imu_direction_rad: Option<f64>,
    /// Each coordinate of the inertial unit, m. Without it: 0.035.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imu_position_m: Option<f64>,
    /// Scale of the accelerometers, as a part of it. Without it: 0.0052.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel_scale_fraction: Option<f64>,
}

pub(crate) const OF_VEHICLE: &[Rule] = &[
    may("hard_points_m", Number(NonNegative(PLACE_MAX_M))),
    may("stiffness_fraction", Number(NonNegative(FRACTION_MAX))),
    may("free_length_m", Number(NonNegative(PLACE_MAX_M))),
    may("damping_fraction", Number(NonNegative(FRACTION_MAX))),
    may("mass_fraction", Number(NonNegative(FRACTION_MAX))),
    may("cg_m", Number(NonNegative(0.5))),
];

pub(crate) const OF_SENSORS: &[Rule] = &[
    may("gain_fraction", Number(NonNegative(FRACTION_MAX))),
    may("imu_direction_rad", Number(NonNegative(0.5))),
    may("imu_position_m", Number(NonNegative(0.5))),
    may("accel_scale_fraction", Number(NonNegative(FRACTION_MAX))),
];

impl Axle {
    /// The hard-points of a corner, m; none of a live axle or of an axle without hard-points.
    pub fn hard_points_mut(&mut self) -> Vec<&mut [f64; 3]> {
        if let Some(w) = &mut self.wishbone {
            return vec![
                &mut w.wheel_centre_m,
                &mut w.upper_front_m,
                &mut w.upper_rear_m,
                &mut w.upper_ball_m,
                &mut w.lower_front_m,
                &mut w.lower_rear_m,
                &mut w.lower_ball_m,
                &mut w.strut_chassis_m,
                &mut w.strut_arm_m,
                &mut w.tie_rod_inner_m,
                &mut w.tie_rod_outer_m,
            ];
        }
        if let Some(links) = &mut self.five_link {
            return links.points_mut();
        }
        if let Some(arm) = &mut self.trailing_arm {
            return arm.points_mut();
        }
        let Some(m) = &mut self.macpherson else {
            return Vec::new();
        };
        vec![
            &mut m.wheel_centre_m,
            &mut m.lower_front_m,
            &mut m.lower_rear_m,
            &mut m.lower_ball_m,
            &mut m.strut_top_m,
            &mut m.strut_low_m,
            &mut m.tie_rod_inner_m,
            &mut m.tie_rod_outer_m,
        ]
    }
}

#[cfg(test)]
mod tests {
    use crate::sensors::Sensors;
    use crate::vehicle::Vehicle;

    fn vehicle(table: &str) -> Result<Vehicle, String> {
        let text = Vehicle::builtin_text("prowler").unwrap();
        let text = format!("{text}\n[tolerances]\n{table}\n");
        Vehicle::from_toml(&text, "v.toml").map_err(|error| error.to_string())
    }

    fn sensors(table: &str) -> Result<Sensors, String> {
        let text = Sensors::builtin_text("thesis-10bit").unwrap();
        let text = format!("{text}\n[tolerances]\n{table}\n");
        Sensors::from_toml(&text, "s.toml").map_err(|error| error.to_string())
    }

    #[test]
    fn tolerances_are_optional_and_survive_writing() {
        assert_eq!(Vehicle::builtin("prowler").unwrap().tolerances, None);
        let read = vehicle("hard_points_m = 0.001\nmass_fraction = 0").unwrap();
        let stated = read.tolerances.unwrap();
        assert_eq!(stated.hard_points_m, Some(0.001));
        assert_eq!(stated.mass_fraction, Some(0.0));
        assert_eq!(stated.cg_m, None);
        let written = read.to_toml().unwrap();
        assert_eq!(Vehicle::from_toml(&written, "w.toml").unwrap(), read);
        let loaded = read.loaded(&[] as &[&str]).unwrap();
        assert_eq!(loaded.vehicle.tolerances, read.tolerances);
        let read = sensors("gain_fraction = 0.01").unwrap();
        let written = toml::to_string(&read).unwrap();
        assert_eq!(Sensors::from_toml(&written, "w.toml").unwrap(), read);
    }

    #[test]
    fn implausible_tolerances_are_errors_with_field_value_and_remedy() {
        let unit = "in the unit that the field's name ends with";
        for (field, value, message) in [
            ("hard_points_m", "1.0", "is more than 0.05"),
            ("hard_points_m", "-0.001", "must not be negative"),
            ("mass_fraction", "10", "is more than 0.5"),
            ("free_length_m", "0.3", "is more than 0.05"),
            ("stiffness_fraction", "nan", "is not a finite number"),
        ] {
            let error = vehicle(&format!("{field} = {value}")).unwrap_err();
            for part in ["tolerances.", field, value, message, unit] {
                assert!(error.contains(part), "{part}: {error}");
            }
        }
        let error = sensors("gain_fraction = 1.0").unwrap_err();
        for part in ["tolerances.gain_fraction", "1.0", "is more than 0.5", unit] {
            assert!(error.contains(part), "{part}: {error}");
        }
        let error = vehicle("hard_points_mm = 1.0").unwrap_err();
        assert!(error.contains("did you mean hard_points_m?"), "{error}");
    }

    #[test]
    fn an_axle_has_all_its_hard_points() {
        let mut vehicle = Vehicle::builtin("prowler").unwrap();
        assert_eq!(vehicle.front.hard_points_mut().len(), 11);
        vehicle.front.wishbone = None;
        assert_eq!(vehicle.front.hard_points_mut().len(), 0);
        let mut second = Vehicle::builtin("second-vehicle").unwrap();
        assert_eq!(second.front.hard_points_mut().len(), 8);
        assert_eq!(second.rear.hard_points_mut().len(), 0);
    }
}
