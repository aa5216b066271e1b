//! Quarter car: one wheel and the part of the body above it (section 2.2.1 of the thesis).

use nalgebra::{SMatrix, SVector};
use sample::Wheel;

use super::ride::{Assembly, Ride, RideCorner};
use super::{Corner, SuspensionError};
use crate::vehicle::Vehicle;

/// Quarter car; degrees of freedom z_s and z_u, state [z_s', z_u', z_s, z_u].
pub type QuarterCar = Ride<2, 4, 1>;

impl QuarterCar {
    /// The model of a sprung mass m_s on one corner:
    ///
    /// m_s z_s'' = b_s (z_u' - z_s') + k_s (z_u - z_s)
    ///
    /// m_u z_u'' = -(those) + b_t (u' - z_u') + k_t (u - z_u)
    ///
    /// (equations 2.16-2.21, see [`Ride`] for what is misprinted there).
    ///
    /// # Errors
    /// When a value is not finite, a mass not positive, or a stiffness or damping negative.
    pub fn new(sprung_mass_kg: f64, corner: RideCorner) -> Result<Self, SuspensionError> {
        Self::assemble(&Assembly {
            body_mass: SVector::from([sprung_mass_kg, 0.0]),
            lift: SMatrix::from([[1.0], [0.0]]),
            corners: [corner],
            bars: [None; 2],
        })
    }

    /// The quarter of a vehicle above one wheel.
    ///
    /// # Errors
    /// When the axle's hard-points are degenerate.
    pub fn of(vehicle: &Vehicle, wheel: Wheel) -> Result<Self, SuspensionError> {
        let [front, rear] = sprung_masses_kg(vehicle);
        let mass = if wheel.is_front() { front } else { rear };
        Self::new(0.5 * mass, RideCorner::of(vehicle, wheel)?)
    }
}

impl RideCorner {
    /// One corner of a vehicle in the design position: wheel rate and damping through the motion
    /// ratio of hard-points, or the strut's given one, or else from the axle's roll values.
    ///
    /// # Errors
    /// When the axle has no unsprung masses, or degenerate hard-points.
    pub fn of(vehicle: &Vehicle, wheel: Wheel) -> Result<Self, SuspensionError> {
        let axle = vehicle.axle(wheel);
        let unsprung = axle.unsprung.as_ref().ok_or(SuspensionError::Missing {
            axle: if wheel.is_front() { "front" } else { "rear" },
            table: "unsprung",
        })?;
        let ratio = motion_ratio(vehicle, wheel)?;
        let (stiffness_n_m, damping_n_s_m) = match (ratio, &axle.strut) {
            (Some(ratio), Some(strut)) => (
                wheel_rate_n_m(strut.stiffness_n_m, ratio),
                wheel_rate_n_m(strut.damping_n_s_m, ratio),
            ),
            _ => (axle.wheel_rate_n_m(), axle.wheel_damping_n_s_m()),
        };
        Ok(Self {
            unsprung_mass_kg: unsprung.total_mass_kg(),
            stiffness_n_m,
            damping_n_s_m,
            tyre_stiffness_n_m: axle.tyre.vertical_stiffness_n_m,
            tyre_damping_n_s_m: axle.tyre.vertical_damping_n_s_m,
        })
    }
}

/// Strut travel for one metre of wheel travel in the design position: by hard-points, else as the strut has it;
/// `None` if the vehicle file tells neither.
///
/// # Errors
/// When the hard-points are degenerate.
pub fn motion_ratio(vehicle: &Vehicle, wheel: Wheel) -> Result<Option<f64>, SuspensionError> {
    let axle = vehicle.axle(wheel);
    match (axle.has_hard_points(), &axle.strut) {
        (true, Some(_)) => {
            let corner = Corner::of(vehicle, wheel)?;
            let pose = corner.pose_at_jounce(0.0, 0.0)?;
            Ok(Some(corner.rates(&pose).motion_ratio()))
        }
        (false, Some(strut)) => Ok(strut.motion_ratio),
        _ => Ok(None),
    }
}

/// Motion ratio of a strut that stands upright on an arm, `pivot_to_strut_m` from its pivot and
/// `strut_to_ball_m` from the ball joint: a/(a + b), the inverse of the 2.3 of section 2.2.4.
///
/// The thesis multiplies by a/(a + b) inverted (2.26, 2.27: F_z = 2.3 k_s dl). By virtual work
/// F_z dz = k_s dl dl, so that F_z = k_s dl a/(a + b), and per wheel travel the spring counts with
/// the ratio squared: see [`wheel_rate_n_m`].
#[must_use]
pub fn lever_motion_ratio(pivot_to_strut_m: f64, strut_to_ball_m: f64) -> f64 {
    pivot_to_strut_m / (pivot_to_strut_m + strut_to_ball_m)
}

/// Stiffness (or damping) at the wheel of one along the strut: k r^2.
#[must_use]
pub fn wheel_rate_n_m(strut_rate_n_m: f64, motion_ratio: f64) -> f64 {
    strut_rate_n_m * motion_ratio * motion_ratio
}

/// Vertical tyre force from the spring's compression alone: F_z = F_z0 + k r dl (equation 2.27
/// with the lever the right way up), dl from the position in which the load is F_z0.
///
/// Inclined arms jack: in a turn this is off by 4 to 9 % rms of the peak load on truth runs, and by
/// 23 % at F_y = 1155 N on 1911 N. The linkage's statics have no such error.
#[must_use]
pub fn vertical_force_n(
    static_force_n: f64,
    stiffness_n_m: f64,
    motion_ratio: f64,
    compression_m: f64,
) -> f64 {
    static_force_n + stiffness_n_m * motion_ratio * compression_m
}

/// The sprung mass's share of the front and of the rear axle, kg.
pub(super) fn sprung_masses_kg(vehicle: &Vehicle) -> [f64; 2] {
    let sprung = vehicle.sprung();
    let to_rear = vehicle.body.cg_to_rear_axle_m + sprung.cg_m[0];
    let front = sprung.mass_kg * to_rear / vehicle.wheelbase_m();
    [front, sprung.mass_kg - front]
}

#[cfg(test)]
mod tests {
    use super::super::ride::frequency_and_damping;
    use super::*;

    /// Thesis: a = 5 in, b = 6.5 in, 65 kN/m, a quarter of 644 kg.
    #[test]
    fn wheel_rate_through_the_lever() {
        let ratio = lever_motion_ratio(5.0, 6.5);
        assert!((1.0 / ratio - 2.3).abs() < 1e-12);
        // F_z over spring travel, where 2.3 * 65,000 = 149,500 is printed.
        assert!((65_000.0 * ratio - 28_260.9).abs() < 0.1);
        let rate = wheel_rate_n_m(65_000.0, ratio);
        assert!((rate - 12_287.0).abs() < 0.5);
        let bounce = (rate / 161.0).sqrt() / std::f64::consts::TAU;
        assert!((bounce - 1.39).abs() < 0.005);
        // Equation 2.30 with wheel rates: both axles' roll stiffness and the pitch stiffness.
        let roll = [1.143_f64, 1.092].map(|track_m| 0.5 * rate * track_m.powi(2));
        assert!((roll[0] - 8026.0).abs() < 1.0 && (roll[1] - 7326.0).abs() < 1.0);
        assert!((roll[0] + roll[1] - 15_352.0).abs() < 1.0);
        let pitch = 2.0 * rate * (0.839_f64.powi(2) + 0.6081_f64.powi(2));
        assert!((pitch - 26_386.0).abs() < 2.0);
        // What is printed takes springs for wheel rates, and 1.44 m for the pitch stiffness.
        assert!((0.5_f64 * 65_000.0 * 1.44_f64.powi(2) - 67_392.0).abs() < 0.5);
    }

    const CORNER: RideCorner = RideCorner {
        unsprung_mass_kg: 26.0,
        stiffness_n_m: 12_287.0,
        damping_n_s_m: 660.0,
        tyre_stiffness_n_m: 120_000.0,
        tyre_damping_n_s_m: 600.0,
    };

    #[test]
    fn matrix_is_the_corrected_one() {
        let (m_s, c) = (135.0, CORNER);
        let model = QuarterCar::new(m_s, c).expect("in range");
        let m_u = c.unsprung_mass_kg;
        let expected = SMatrix::<f64, 4, 4>::new(
            -c.damping_n_s_m / m_s,
            c.damping_n_s_m / m_s,
            -c.stiffness_n_m / m_s,
            c.stiffness_n_m / m_s,
            c.damping_n_s_m / m_u,
            -(c.damping_n_s_m + c.tyre_damping_n_s_m) / m_u,
            c.stiffness_n_m / m_u,
            -(c.stiffness_n_m + c.tyre_stiffness_n_m) / m_u,
            1.0,
            0.0,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
            0.0,
        );
        assert!((model.state - expected).amax() < 1e-9);
        assert!((model.road[1] - c.tyre_stiffness_n_m / m_u).abs() < 1e-9);
        assert!((model.road_rate[1] - c.tyre_damping_n_s_m / m_u).abs() < 1e-9);
    }

    #[test]
    fn two_modes_and_a_response_that_follows_slow_roads() {
        let model = QuarterCar::new(135.0, CORNER).expect("in range");
        let poles = model.poles();
        assert!(poles.iter().all(|pole| pole.re < 0.0));
        let [body, _] = frequency_and_damping(poles[0]);
        let [hop, _] = frequency_and_damping(poles[3]);
        assert!((1.3..1.7).contains(&body), "{body}");
        assert!((10.0..13.0).contains(&hop), "{hop}");
        let slow = model.response(0, 0.001).expect("no pole there");
        assert!((slow[2].re - 1.0).abs() < 1e-4 && (slow[3].re - 1.0).abs() < 1e-4);
        let fast = model.response(0, 200.0).expect("no pole there");
        assert!(fast[2].norm() < 1e-3);
        // Velocity is j w times position.
        let at = model.response(0, 2.0).expect("no pole there");
        let w = std::f64::consts::TAU * 2.0;
        assert!((at[0] - at[2] * nalgebra::Complex::new(0.0, w)).norm() < 1e-9);
    }

    #[test]
    fn wheel_acceleration_is_invariant_of_the_suspension() {
        // m_s z_s'' + m_u z_u'' = tyre force alone, so that at the tyre's own frequency
        // sqrt(k_t/m_u) (b_t = 0) body motion does not depend on the spring and damper.
        let hop =
            (CORNER.tyre_stiffness_n_m / CORNER.unsprung_mass_kg).sqrt() / std::f64::consts::TAU;
        let body = |stiffness, damping| {
            let corner = RideCorner {
                stiffness_n_m: stiffness,
                damping_n_s_m: damping,
                tyre_damping_n_s_m: 0.0,
                ..CORNER
            };
            let at = QuarterCar::new(135.0, corner)
                .expect("in range")
                .response(0, hop)
                .expect("damped");
            at[2].norm()
        };
        assert!((body(12_000.0, 600.0) / body(25_000.0, 1500.0) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn bad_values_are_named() {
        let error = QuarterCar::new(f64::NAN, CORNER).expect_err("not a number");
        assert!(error.to_string().contains("NaN"), "{error}");
        let light = RideCorner {
            unsprung_mass_kg: 0.0,
            ..CORNER
        };
        let error = QuarterCar::new(135.0, light).expect_err("no wheel");
        assert_eq!(
            error.to_string(),
            "unsprung mass = 0 kg is not valid; expected above 0"
        );
        let soft = RideCorner {
            stiffness_n_m: -1.0,
            ..CORNER
        };
        assert!(QuarterCar::new(135.0, soft).is_err());
    }
}
