use nalgebra::SVector;

use crate::Scalar;

/// Number of states.
pub const STATES: usize = 32;

/// Number of inputs.
pub const INPUTS: usize = 30;

/// State of the 14-degree-of-freedom model. Wheels in the order of [`sample::Wheel::ALL`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T> {
    /// Place of the sprung part's centre of gravity: east, north, height above ground, m.
    pub position_m: [T; 3],
    /// Roll phi, pitch theta, yaw psi against the ground, rad (yaw, then pitch, then roll).
    pub attitude_rad: [T; 3],
    /// Velocity (u, v, w) of the sprung part's centre of gravity, body axes, m/s.
    pub velocity_m_s: [T; 3],
    /// Body rates (p, q, r), rad/s.
    pub rate_rad_s: [T; 3],
    /// Jounce s of each wheel from the design position, m, upward positive.
    pub jounce_m: [T; 4],
    /// Jounce rates, m/s.
    pub jounce_rate_m_s: [T; 4],
    /// Spin of each wheel about its spindle, rad/s.
    pub wheel_speed_rad_s: [T; 4],
    /// Relaxed tangents of the slip angles; they rest where the relaxation length is zero.
    pub slip_tangent: [T; 4],
    /// Relaxed longitudinal slips; they rest where the relaxation length is zero.
    pub slip_ratio: [T; 4],
}

impl<T: Scalar> State<T> {
    /// All numbers zero: the body's centre of gravity on the ground, which no vehicle's is. See
    /// [`super::at_rest`].
    #[must_use]
    pub fn zero() -> Self {
        Self::from_array([T::from(0.0); STATES])
    }

    /// The numbers in order of the fields.
    #[inline(always)]
    #[must_use]
    pub fn to_array(&self) -> [T; STATES] {
        let [x, y, z] = self.position_m;
        let [roll, pitch, yaw] = self.attitude_rad;
        let [u, v, w] = self.velocity_m_s;
        let [p, q, r] = self.rate_rad_s;
        let [j0, j1, j2, j3] = self.jounce_m;
        let [d0, d1, d2, d3] = self.jounce_rate_m_s;
        let [w0, w1, w2, w3] = self.wheel_speed_rad_s;
        let [s0, s1, s2, s3] = self.slip_tangent;
        let [k0, k1, k2, k3] = self.slip_ratio;
        [
            x, y, z, roll, pitch, yaw, u, v, w, p, q, r, j0, j1, j2, j3, d0, d1, d2, d3, w0, w1,
            w2, w3, s0, s1, s2, s3, k0, k1, k2, k3,
        ]
    }

    /// The state from numbers in order of the fields.
    #[inline(always)]
    #[must_use]
    pub fn from_array(x: [T; STATES]) -> Self {
        let three = |k: usize| [x[k], x[k + 1], x[k + 2]];
        let four = |k: usize| [x[k], x[k + 1], x[k + 2], x[k + 3]];
        Self {
            position_m: three(0),
            attitude_rad: three(3),
            velocity_m_s: three(6),
            rate_rad_s: three(9),
            jounce_m: four(12),
            jounce_rate_m_s: four(16),
            wheel_speed_rad_s: four(20),
            slip_tangent: four(24),
            slip_ratio: four(28),
        }
    }

    /// The numbers as a vector.
    #[must_use]
    pub fn to_vector(&self) -> SVector<T, STATES> {
        SVector::from(self.to_array())
    }

    /// The state from a vector.
    #[must_use]
    pub fn from_vector(vector: &SVector<T, STATES>) -> Self {
        Self::from_array(std::array::from_fn(|index| vector[index]))
    }
}

impl State<f64> {
    /// The same state with a forward speed over ground, all wheels rolling without slip.
    #[must_use]
    pub fn rolling(mut self, speed_m_s: f64, parameters: &super::Parameters) -> Self {
        let (sin, cos) = math::sin_cos(self.attitude_rad[1]);
        self.velocity_m_s = [speed_m_s * cos, 0.0, speed_m_s * sin];
        for (wheel, corner) in self.wheel_speed_rad_s.iter_mut().zip(&parameters.corners) {
            *wheel = speed_m_s / corner.rolling_radius_m;
        }
        self
    }
}

crate::checks::checked!(
    State, "state",
    position_m: "m" FINITE,
    attitude_rad: "rad" FINITE,
    velocity_m_s: "m/s" FINITE,
    rate_rad_s: "rad/s" FINITE,
    jounce_m: "m" FINITE,
    jounce_rate_m_s: "m/s" FINITE,
    wheel_speed_rad_s: "rad/s" FINITE,
    slip_tangent: "" FINITE,
    slip_ratio: "" FINITE
);

/// What acts on the vehicle from outside and from the driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs<T> {
    /// Steer angle of each road wheel against the body, rad, left positive.
    pub steer_rad: [T; 4],
    /// Drive torque on each wheel, N m, reacted by the body.
    pub drive_n_m: [T; 4],
    /// Brake torque that each wheel's brake can hold, N m, never negative.
    pub brake_n_m: [T; 4],
    /// Height of the ground under each wheel, m.
    pub road_m: [T; 4],
    /// Its rate as the wheel meets it, m/s.
    pub road_rate_m_s: [T; 4],
    /// Road bank as the vehicle sees it, rad: right side down positive.
    pub bank_rad: T,
    /// Road grade as the vehicle sees it, rad: nose down positive.
    pub grade_rad: T,
    /// Factor on each tyre's friction coefficient.
    pub friction_scale: [T; 4],
    /// Factor on each tyre's slip stiffnesses.
    pub stiffness_scale: [T; 4],
}

impl<T: Scalar> Inputs<T> {
    /// No steer, no torque, on flat and level ground of the file's friction.
    #[must_use]
    pub fn coasting() -> Self {
        let zero = [T::from(0.0); 4];
        Self {
            steer_rad: zero,
            drive_n_m: zero,
            brake_n_m: zero,
            road_m: zero,
            road_rate_m_s: zero,
            bank_rad: T::from(0.0),
            grade_rad: T::from(0.0),
            friction_scale: [T::from(1.0); 4],
            stiffness_scale: [T::from(1.0); 4],
        }
    }

    /// Both front wheels turned alike, otherwise coasting.
    #[must_use]
    pub fn steered(front_rad: T) -> Self {
        let mut inputs = Self::coasting();
        inputs.steer_rad[0] = front_rad;
        inputs.steer_rad[1] = front_rad;
        inputs
    }
}

crate::checks::checked_inputs!(road_m: "m" FINITE, road_rate_m_s: "m/s" FINITE);

impl Inputs<f64> {
    /// The numbers in order of the fields.
    #[must_use]
    pub fn to_array(&self) -> [f64; INPUTS] {
        let mut all = [0.0; INPUTS];
        let lists = [
            self.steer_rad,
            self.drive_n_m,
            self.brake_n_m,
            self.road_m,
            self.road_rate_m_s,
        ];
        all[..20].copy_from_slice(lists.as_flattened());
        all[20] = self.bank_rad;
        all[21] = self.grade_rad;
        let lists = [self.friction_scale, self.stiffness_scale];
        all[22..].copy_from_slice(lists.as_flattened());
        all
    }

    /// Inputs from numbers in order of the fields.
    #[must_use]
    pub fn from_array(x: &[f64; INPUTS]) -> Self {
        let four = |first: usize| [x[first], x[first + 1], x[first + 2], x[first + 3]];
        Self {
            steer_rad: four(0),
            drive_n_m: four(4),
            brake_n_m: four(8),
            road_m: four(12),
            road_rate_m_s: four(16),
            bank_rad: x[20],
            grade_rad: x[21],
            friction_scale: four(22),
            stiffness_scale: four(26),
        }
    }
}
