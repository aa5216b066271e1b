use nalgebra::SVector;

use crate::Scalar;

/// Number of states.
pub const STATES: usize = 19;

/// Number of inputs.
pub const INPUTS: usize = 22;

/// State of the four-wheel model. Wheels in the order of [`sample::Wheel::ALL`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T> {
    /// Longitudinal velocity u of the centre of gravity, body axes, m/s.
    pub longitudinal_m_s: T,
    /// Lateral velocity v of the centre of gravity, body axes, m/s.
    pub lateral_m_s: T,
    /// Yaw rate r, rad/s.
    pub yaw_rate_rad_s: T,
    /// Roll angle phi against the road, rad.
    pub roll_rad: T,
    /// Roll rate phi', rad/s.
    pub roll_rate_rad_s: T,
    /// Pitch angle theta against the road, rad.
    pub pitch_rad: T,
    /// Pitch rate theta', rad/s.
    pub pitch_rate_rad_s: T,
    /// Relaxed tangents of the slip angles; they rest where a tyre's relaxation length is zero.
    pub slip_tangent: [T; 4],
    /// Relaxed longitudinal slips; they rest where a tyre's relaxation length is zero.
    pub slip_ratio: [T; 4],
    /// Spin of the wheels omega, rad/s.
    pub wheel_speed_rad_s: [T; 4],
}

impl<T: Scalar> State<T> {
    /// All of it at rest.
    #[must_use]
    pub fn at_rest() -> Self {
        Self::from_array([T::from(0.0); STATES])
    }

    /// Rolling straight ahead, wheels without slip.
    #[must_use]
    pub fn rolling(speed_m_s: f64, parameters: &super::Parameters) -> Self {
        let mut state = Self::at_rest();
        state.longitudinal_m_s = T::from(speed_m_s);
        for (index, wheel) in state.wheel_speed_rad_s.iter_mut().enumerate() {
            *wheel = T::from(speed_m_s / parameters.axle(index).rolling_radius_m);
        }
        state
    }

    /// The numbers in order of the fields.
    #[inline(always)]
    #[must_use]
    pub fn to_array(&self) -> [T; STATES] {
        let [s0, s1, s2, s3] = self.slip_tangent;
        let [k0, k1, k2, k3] = self.slip_ratio;
        let [w0, w1, w2, w3] = self.wheel_speed_rad_s;
        [
            self.longitudinal_m_s,
            self.lateral_m_s,
            self.yaw_rate_rad_s,
            self.roll_rad,
            self.roll_rate_rad_s,
            self.pitch_rad,
            self.pitch_rate_rad_s,
            s0,
            s1,
            s2,
            s3,
            k0,
            k1,
            k2,
            k3,
            w0,
            w1,
            w2,
            w3,
        ]
    }

    /// The state from numbers in order of the fields.
    #[inline(always)]
    #[must_use]
    pub fn from_array(x: [T; STATES]) -> Self {
        Self {
            longitudinal_m_s: x[0],
            lateral_m_s: x[1],
            yaw_rate_rad_s: x[2],
            roll_rad: x[3],
            roll_rate_rad_s: x[4],
            pitch_rad: x[5],
            pitch_rate_rad_s: x[6],
            slip_tangent: [x[7], x[8], x[9], x[10]],
            slip_ratio: [x[11], x[12], x[13], x[14]],
            wheel_speed_rad_s: [x[15], x[16], x[17], x[18]],
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

    /// This state plus `scale` times a rate.
    #[inline]
    #[must_use]
    pub fn advanced(&self, rate: &Self, scale: f64) -> Self {
        let (a, b) = (self.to_array(), rate.to_array());
        Self::from_array(std::array::from_fn(|index| a[index] + b[index] * scale))
    }

    /// Sideslip angle beta = atan2(v, u), rad; zero at rest.
    #[must_use]
    pub fn sideslip_rad(&self) -> T {
        if self.longitudinal_m_s == 0.0 && self.lateral_m_s == 0.0 {
            T::from(0.0)
        } else {
            self.lateral_m_s.arctangent_over(self.longitudinal_m_s)
        }
    }
}

crate::checks::checked!(
    State, "state",
    longitudinal_m_s: "m/s" FINITE,
    lateral_m_s: "m/s" FINITE,
    yaw_rate_rad_s: "rad/s" FINITE,
    roll_rad: "rad" FINITE,
    roll_rate_rad_s: "rad/s" FINITE,
    pitch_rad: "rad" FINITE,
    pitch_rate_rad_s: "rad/s" FINITE,
    slip_tangent: "" FINITE,
    slip_ratio: "" FINITE,
    wheel_speed_rad_s: "rad/s" FINITE
);

/// What acts on the vehicle from outside and from the driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs<T> {
    /// Steer angle of each road wheel delta_i, rad, left positive.
    pub steer_rad: [T; 4],
    /// Drive torque on each wheel, N m.
    pub drive_n_m: [T; 4],
    /// Brake torque that each wheel's brake can hold, N m, never negative.
    pub brake_n_m: [T; 4],
    /// Road bank, rad: right side down positive, so that gravity pulls right.
    pub bank_rad: T,
    /// Road grade, rad: nose down positive, so that gravity pulls forward.
    pub grade_rad: T,
    /// Factor on each tyre's friction coefficient.
    pub friction_scale: [T; 4],
    /// Factor on each tyre's slip stiffnesses.
    pub stiffness_scale: [T; 4],
}

impl<T: Scalar> Inputs<T> {
    /// No steer, no torque, on level road of the file's friction.
    #[must_use]
    pub fn coasting() -> Self {
        let zero = [T::from(0.0); 4];
        Self {
            steer_rad: zero,
            drive_n_m: zero,
            brake_n_m: zero,
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

crate::checks::checked_inputs!();

impl Inputs<f64> {
    /// The numbers in order of the fields.
    #[must_use]
    pub fn to_array(&self) -> [f64; INPUTS] {
        let mut all = [0.0; INPUTS];
        let lists = [self.steer_rad, self.drive_n_m, self.brake_n_m];
        all[..12].copy_from_slice(lists.as_flattened());
        all[12] = self.bank_rad;
        all[13] = self.grade_rad;
        let lists = [self.friction_scale, self.stiffness_scale];
        all[14..].copy_from_slice(lists.as_flattened());
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
            bank_rad: x[12],
            grade_rad: x[13],
            friction_scale: four(14),
            stiffness_scale: four(18),
        }
    }
}

/// Place and heading over ground, east-north axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// East, m.
    pub east_m: f64,
    /// North, m.
    pub north_m: f64,
    /// Yaw angle from east, left positive, rad.
    pub yaw_rad: f64,
}

impl Pose {
    /// The pose after a step from one state to another, by the trapezium of both.
    #[must_use]
    pub fn advanced(&self, from: &State<f64>, to: &State<f64>, step_s: f64) -> Self {
        let half = 0.5 * step_s;
        let yaw_rad = self.yaw_rad + half * (from.yaw_rate_rad_s + to.yaw_rate_rad_s);
        let velocity = |state: &State<f64>, yaw: f64| {
            let (sin, cos) = math::sin_cos(yaw);
            let (u, v) = (state.longitudinal_m_s, state.lateral_m_s);
            [u * cos - v * sin, u * sin + v * cos]
        };
        let (before, after) = (velocity(from, self.yaw_rad), velocity(to, yaw_rad));
        Self {
            east_m: self.east_m + half * (before[0] + after[0]),
            north_m: self.north_m + half * (before[1] + after[1]),
            yaw_rad,
        }
    }
}
