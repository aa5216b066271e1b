use nalgebra::{SVector, Vector3};

use super::Parameters;

/// Number of states.
pub const STATES: usize = 40;

/// State of the vehicle. Wheels in the order of [`sample::Wheel::ALL`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Place of the sprung part's centre of gravity, earth axes, m.
    pub position_m: Vector3<f64>,
    /// Roll, pitch, yaw against the earth, rad (yaw, then pitch, then roll).
    pub attitude_rad: Vector3<f64>,
    /// Velocity of the sprung part's centre of gravity, body axes, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Body rates, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Strut lengths, m.
    pub strut_m: [f64; 4],
    /// Strut rates, m/s.
    pub strut_rate_m_s: [f64; 4],
    /// Rack travel of each corner's tie rod, m; on a straight path the steer angle, rad.
    pub rack: [f64; 4],
    /// Its rate, m/s or rad/s.
    pub rack_rate: [f64; 4],
    /// Rate of each wheel about its spindle against the earth, rad/s.
    pub wheel_speed_rad_s: [f64; 4],
    /// Relaxed tangents of the slip angles; they rest where the relaxation length is zero.
    pub slip_tangent: [f64; 4],
    /// Relaxed longitudinal slips; they rest where the relaxation length is zero.
    pub slip_ratio: [f64; 4],
}

impl State {
    /// The numbers in order of the fields.
    #[must_use]
    pub fn to_vector(&self) -> SVector<f64, STATES> {
        let mut all = SVector::<f64, STATES>::zeros();
        let body = [
            self.position_m,
            self.attitude_rad,
            self.velocity_m_s,
            self.rate_rad_s,
        ];
        for (index, three) in body.iter().enumerate() {
            all.fixed_rows_mut::<3>(3 * index).copy_from(three);
        }
        let corners = [
            self.strut_m,
            self.strut_rate_m_s,
            self.rack,
            self.rack_rate,
            self.wheel_speed_rad_s,
            self.slip_tangent,
            self.slip_ratio,
        ];
        all.as_mut_slice()[12..].copy_from_slice(corners.as_flattened());
        all
    }

    /// The state from numbers in order of the fields.
    #[must_use]
    pub fn from_vector(all: &SVector<f64, STATES>) -> Self {
        let three = |first: usize| Vector3::new(all[first], all[first + 1], all[first + 2]);
        let four = |first: usize| [all[first], all[first + 1], all[first + 2], all[first + 3]];
        Self {
            position_m: three(0),
            attitude_rad: three(3),
            velocity_m_s: three(6),
            rate_rad_s: three(9),
            strut_m: four(12),
            strut_rate_m_s: four(16),
            rack: four(20),
            rack_rate: four(24),
            wheel_speed_rad_s: four(28),
            slip_tangent: four(32),
            slip_ratio: four(36),
        }
    }

    /// The same state with a forward speed, all wheels rolling without slip.
    #[must_use]
    pub fn rolling(mut self, speed_m_s: f64, parameters: &Parameters) -> Self {
        self.velocity_m_s = Vector3::new(speed_m_s, 0.0, 0.0);
        self.wheel_speed_rad_s =
            std::array::from_fn(|i| speed_m_s / parameters.corners[i].rolling_radius_m);
        self
    }
}

/// What acts on the vehicle besides the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Acceleration of each rack travel or steer angle, m/s^2 or rad/s^2.
    pub rack_acceleration: [f64; 4],
    /// Drive torque on each wheel, N m; negative drives backwards.
    pub drive_n_m: [f64; 4],
    /// Brake torque that each wheel's brake can hold, N m, never negative.
    pub brake_n_m: [f64; 4],
    /// Force on the body at [`Inputs::hitch_m`], vehicle axes, N.
    pub hitch_force_n: Vector3<f64>,
    /// Where that force acts, vehicle axes (origin on the design ground below the whole vehicle's
    /// centre of gravity), m.
    pub hitch_m: Vector3<f64>,
}
