//! The linear bicycle model (section 2.1.1 of the thesis), in ISO 8855 signs.

mod steps;

pub(crate) use steps::{advance, check_state, check_steer, stepped};

use nalgebra::{Complex, Matrix2, Matrix4, Vector2, Vector4};

use crate::Error;
use crate::error::require;
use crate::vehicle::Vehicle;

/// The linear single-track model of a vehicle.
///
/// | symbol | field | unit |
/// |---|---|---|
/// | m | `mass_kg` | kg |
/// | I_z | `yaw_inertia_kg_m2` | kg m^2 |
/// | a, b | `front_axle_to_cg_m`, `cg_to_rear_axle_m` | m |
/// | C_f, C_r | `front_stiffness_n_rad`, `rear_stiffness_n_rad` | N/rad, of the whole AXLE |
///
/// The stiffnesses of figure 2.23 are an axle's, since m V r of equation 2.31 is the whole
/// vehicle's force; a tyre has half.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bicycle {
    /// Mass m, kg.
    pub mass_kg: f64,
    /// Yaw inertia I_z, kg m^2.
    pub yaw_inertia_kg_m2: f64,
    /// Front axle to centre of gravity a, m.
    pub front_axle_to_cg_m: f64,
    /// Centre of gravity to rear axle b, m.
    pub cg_to_rear_axle_m: f64,
    /// Cornering stiffness C_f of the front axle, N/rad.
    pub front_stiffness_n_rad: f64,
    /// Cornering stiffness C_r of the rear axle, N/rad.
    pub rear_stiffness_n_rad: f64,
}

/// x' = A x + B delta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSpace {
    /// System matrix A of x = (beta, r).
    pub a: Matrix2<f64>,
    /// Input matrix B for the steer angle.
    pub b: Vector2<f64>,
}

/// Steady answers to one radian of steer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyGains {
    /// r/delta, 1/s.
    pub yaw_rate_1_s: f64,
    /// beta/delta.
    pub sideslip: f64,
    /// a_y/delta, m/s^2 per rad.
    pub lateral_m_s2: f64,
    /// Curvature over steer, 1/m.
    pub curvature_1_m: f64,
}

/// Answers to a sine of steer, as complex gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrequencyResponse {
    /// beta/delta.
    pub sideslip: Complex<f64>,
    /// r/delta, 1/s.
    pub yaw_rate_1_s: Complex<f64>,
    /// a_y/delta, m/s^2 per rad.
    pub lateral_m_s2: Complex<f64>,
}

impl Bicycle {
    /// The bicycle of a vehicle: its tyres' stiffnesses at their reference loads, two to an axle.
    #[must_use]
    pub fn from_vehicle(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        Self {
            mass_kg: body.mass_kg,
            yaw_inertia_kg_m2: body.inertia_kg_m2[2],
            front_axle_to_cg_m: body.front_axle_to_cg_m,
            cg_to_rear_axle_m: body.cg_to_rear_axle_m,
            front_stiffness_n_rad: 2.0 * vehicle.front.tyre.cornering_stiffness_n_rad,
            rear_stiffness_n_rad: 2.0 * vehicle.rear.tyre.cornering_stiffness_n_rad,
        }
    }

    /// Wheelbase L = a + b, m.
    #[must_use]
    pub fn wheelbase_m(&self) -> f64 {
        self.front_axle_to_cg_m + self.cg_to_rear_axle_m
    }

    /// Derivatives of force and moment: (C_f + C_r, a C_f - b C_r, a^2 C_f + b^2 C_r).
    fn derivatives(&self) -> [f64; 3] {
        let (a, b) = (self.front_axle_to_cg_m, self.cg_to_rear_axle_m);
        let (front, rear) = (self.front_stiffness_n_rad, self.rear_stiffness_n_rad);
        [
            front + rear,
            a * front - b * rear,
            a * a * front + b * b * rear,
        ]
    }

    /// Equation 2.5: x = (beta, r), input the front steer angle.
    ///
    /// # Errors
    /// At V <= 0, where beta is not defined: use [`Bicycle::relaxed_system`] there.
    pub fn system(&self, speed_m_s: f64) -> Result<StateSpace, Error> {
        require(
            speed_m_s > 0.0,
            "speed_m_s",
            speed_m_s,
            "m/s",
            "greater than 0 (relaxed_system holds at rest)",
        )?;
        let [sum, moment, damping] = self.derivatives();
        let (m, inertia, v) = (self.mass_kg, self.yaw_inertia_kg_m2, speed_m_s);
        Ok(StateSpace {
            a: Matrix2::new(
                -sum / (m * v),
                -moment / (m * v * v) - 1.0,
                -moment / inertia,
                -damping / (inertia * v),
            ),
            b: Vector2::new(
                self.front_stiffness_n_rad / (m * v),
                self.front_axle_to_cg_m * self.front_stiffness_n_rad / inertia,
            ),
        })
    }

    /// The low-speed form without a singularity (figure 2.3 of the thesis shows the one of
    /// equation 2.5): x = (v, r, alpha_f, alpha_r) with tyres that relax over sigma,
    /// sigma alpha_f' + V alpha_f = v + a r - V delta, sigma alpha_r' + V alpha_r = v - b r.
    /// Holds at any V >= 0 and tends to equation 2.5 for sigma -> 0.
    ///
    /// # Errors
    /// At V < 0 or sigma <= 0.
    pub fn relaxed_system(
        &self,
        speed_m_s: f64,
        relaxation_m: f64,
    ) -> Result<(Matrix4<f64>, Vector4<f64>), Error> {
        require(
            speed_m_s >= 0.0,
            "speed_m_s",
            speed_m_s,
            "m/s",
            "0 or greater",
        )?;
        require(
            relaxation_m > 0.0,
            "relaxation_m",
            relaxation_m,
            "m",
            "greater than 0",
        )?;
        let (m, inertia, v, sigma) = (
            self.mass_kg,
            self.yaw_inertia_kg_m2,
            speed_m_s,
            relaxation_m,
        );
        let (a, b) = (self.front_axle_to_cg_m, self.cg_to_rear_axle_m);
        let (front, rear) = (self.front_stiffness_n_rad, self.rear_stiffness_n_rad);
        #[rustfmt::skip]
        let system = Matrix4::new(
            0.0, -v, -front / m, -rear / m,
            0.0, 0.0, -a * front / inertia, b * rear / inertia,
            1.0 / sigma, a / sigma, -v / sigma, 0.0,
            1.0 / sigma, -b / sigma, 0.0, -v / sigma,
        );
        Ok((system, Vector4::new(0.0, 0.0, -v / sigma, 0.0)))
    }

    /// Eigenvalues of equation 2.5, 1/s.
    ///
    /// # Errors
    /// At V <= 0.
    pub fn eigenvalues(&self, speed_m_s: f64) -> Result<[Complex<f64>; 2], Error> {
        let a = self.system(speed_m_s)?.a;
        let (half, determinant) = (0.5 * a.trace(), a.determinant());
        let square = half * half - determinant;
        Ok(if square >= 0.0 {
            // The larger first, the other from the product: no cancellation.
            let first = half + half.signum() * square.sqrt();
            let second = if first == 0.0 {
                0.0
            } else {
                determinant / first
            };
            [Complex::new(first, 0.0), Complex::new(second, 0.0)]
        } else {
            let imaginary = (-square).sqrt();
            [
                Complex::new(half, imaginary),
                Complex::new(half, -imaginary),
            ]
        })
    }

    /// Undamped natural frequency, rad/s, and damping ratio of the yaw mode; none where the
    /// vehicle is unstable.
    ///
    /// # Errors
    /// At V <= 0.
    pub fn yaw_mode(&self, speed_m_s: f64) -> Result<Option<[f64; 2]>, Error> {
        let a = self.system(speed_m_s)?.a;
        let determinant = a.determinant();
        Ok((determinant > 0.0).then(|| {
            let frequency = determinant.sqrt();
            [frequency, -0.5 * a.trace() / frequency]
        }))
    }

    /// Understeer gradient K_us = m (b C_r - a C_f)/(L C_f C_r), rad/(m/s^2).
    #[must_use]
    pub fn understeer_gradient_rad_m_s2(&self) -> f64 {
        let [_, moment, _] = self.derivatives();
        -self.mass_kg * moment
            / (self.wheelbase_m() * self.front_stiffness_n_rad * self.rear_stiffness_n_rad)
    }

    /// Speed of the greatest yaw gain, sqrt(L/K_us), m/s; none where the vehicle oversteers.
    #[must_use]
    pub fn characteristic_speed_m_s(&self) -> Option<f64> {
        let gradient = self.understeer_gradient_rad_m_s2();
        (gradient > 0.0).then(|| (self.wheelbase_m() / gradient).sqrt())
    }

    /// Speed at which the vehicle becomes unstable, sqrt(-L/K_us), m/s; none where it
    /// understeers.
    #[must_use]
    pub fn critical_speed_m_s(&self) -> Option<f64> {
        let gradient = self.understeer_gradient_rad_m_s2();
        (gradient < 0.0).then(|| (-self.wheelbase_m() / gradient).sqrt())
    }

    /// Static margin (b C_r - a C_f)/(L (C_f + C_r)), part of the wheelbase; positive where the
    /// neutral steer point lies behind the centre of gravity.
    #[must_use]
    pub fn static_margin(&self) -> f64 {
        let [sum, moment, _] = self.derivatives();
        -moment / (self.wheelbase_m() * sum)
    }

    /// Steady gains at a speed; at V = 0 those of rolling without slip.
    ///
    /// # Errors
    /// At V < 0, and at the critical speed of an oversteering vehicle, where they are infinite.
    pub fn steady_gains(&self, speed_m_s: f64) -> Result<SteadyGains, Error> {
        require(
            speed_m_s >= 0.0,
            "speed_m_s",
            speed_m_s,
            "m/s",
            "0 or greater",
        )?;
        let (v, length) = (speed_m_s, self.wheelbase_m());
        let stretch = length + self.understeer_gradient_rad_m_s2() * v * v;
        require(
            stretch != 0.0,
            "speed_m_s",
            speed_m_s,
            "m/s",
            "different from the critical speed",
        )?;
        let drift =
            self.front_axle_to_cg_m * self.mass_kg * v * v / (length * self.rear_stiffness_n_rad);
        Ok(SteadyGains {
            yaw_rate_1_s: v / stretch,
            sideslip: (self.cg_to_rear_axle_m - drift) / stretch,
            lateral_m_s2: v * v / stretch,
            curvature_1_m: 1.0 / stretch,
        })
    }

    /// Frequency response to the steer angle at an angular frequency.
    ///
    /// # Errors
    /// At V <= 0 or a negative frequency.
    pub fn frequency_response(
        &self,
        speed_m_s: f64,
        frequency_rad_s: f64,
    ) -> Result<FrequencyResponse, Error> {
        require(
            frequency_rad_s >= 0.0,
            "frequency_rad_s",
            frequency_rad_s,
            "rad/s",
            "0 or greater",
        )?;
        let StateSpace { a, b } = self.system(speed_m_s)?;
        let s = Complex::new(0.0, frequency_rad_s);
        // (s I - A)^-1 B by Cramer's rule.
        let determinant = s * s - s * a.trace() + a.determinant();
        let sideslip = ((s - a[(1, 1)]) * b[0] + b[1] * a[(0, 1)]) / determinant;
        let yaw_rate = ((s - a[(0, 0)]) * b[1] + b[0] * a[(1, 0)]) / determinant;
        Ok(FrequencyResponse {
            sideslip,
            yaw_rate_1_s: yaw_rate,
            lateral_m_s2: (s * sideslip + yaw_rate) * speed_m_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The notes' check values: m = 644, a = 0.839, b = 0.6081, I_z = 1279.
    fn noted(front: f64, rear: f64) -> Bicycle {
        Bicycle {
            mass_kg: 644.0,
            yaw_inertia_kg_m2: 1279.0,
            front_axle_to_cg_m: 0.839,
            cg_to_rear_axle_m: 0.6081,
            front_stiffness_n_rad: front,
            rear_stiffness_n_rad: rear,
        }
    }

    #[track_caller]
    fn near(value: f64, expected: f64, last_digit: f64) {
        assert!(
            (value - expected).abs() <= 0.501 * last_digit,
            "{value} against {expected}"
        );
    }

    #[test]
    fn road_tyres_meet_the_check_values_to_their_printed_digits() {
        let bicycle = Bicycle::from_vehicle(&Vehicle::builtin("prowler-table-2.3").unwrap());
        assert_eq!(bicycle, noted(5975.0, 17_076.0));
        near(bicycle.understeer_gradient_rad_m_s2(), 0.023_426_6, 1e-7);
        near(
            bicycle.understeer_gradient_rad_m_s2().to_degrees() * 9.81,
            13.167,
            1e-3,
        );
        near(bicycle.characteristic_speed_m_s().unwrap(), 7.859_49, 1e-5);
        assert_eq!(bicycle.critical_speed_m_s(), None);
        near(bicycle.static_margin(), 0.161_01, 1e-5);
        for (speed, gain) in [
            (2.0, 1.298_022),
            (5.0, 2.459_703),
            (8.0, 2.715_175),
            (15.0, 2.232_778),
        ] {
            near(
                bicycle.steady_gains(speed).unwrap().yaw_rate_1_s,
                gain,
                1e-6,
            );
        }
        near(
            bicycle.steady_gains(5.0).unwrap().sideslip,
            0.030_233_6,
            1e-7,
        );
        near(
            bicycle.steady_gains(8.0).unwrap().sideslip,
            -0.268_566_1,
            1e-7,
        );
        let [fast, slow] = bicycle.eigenvalues(5.0).unwrap();
        near(fast.re, -6.593_133, 1e-6);
        near(slow.re, -2.210_658, 1e-6);
        let [up, _] = bicycle.eigenvalues(10.0).unwrap();
        near(up.re, -2.200_948, 1e-6);
        near(up.im, 1.396_097, 1e-6);
    }

    #[test]
    fn off_road_tyres_meet_the_check_values_to_their_printed_digits() {
        let bicycle = noted(3124.0, 13_886.0);
        near(bicycle.understeer_gradient_rad_m_s2(), 0.059_737_8, 1e-7);
        near(
            bicycle.understeer_gradient_rad_m_s2().to_degrees() * 9.81,
            33.577,
            1e-3,
        );
        near(bicycle.characteristic_speed_m_s().unwrap(), 4.921_81, 1e-5);
        near(bicycle.static_margin(), 0.236_56, 1e-5);
        for (speed, gain) in [
            (2.0, 1.186_204),
            (5.0, 1.700_366),
            (8.0, 1.517_935),
            (15.0, 1.007_516),
        ] {
            near(
                bicycle.steady_gains(speed).unwrap().yaw_rate_1_s,
                gain,
                1e-6,
            );
        }
        near(
            bicycle.steady_gains(5.0).unwrap().sideslip,
            -0.021_805_9,
            1e-7,
        );
        near(
            bicycle.steady_gains(8.0).unwrap().sideslip,
            -0.211_142_1,
            1e-7,
        );
        let [fast, slow] = bicycle.eigenvalues(5.0).unwrap();
        near(fast.re, -4.385_201, 1e-6);
        near(slow.re, -2.044_224, 1e-6);
        let [up, _] = bicycle.eigenvalues(10.0).unwrap();
        near(up.re, -1.607_356, 1e-6);
        near(up.im, 1.752_739, 1e-6);
    }

    #[test]
    fn the_frequency_response_starts_at_the_steady_gains() {
        let bicycle = noted(5975.0, 17_076.0);
        let steady = bicycle.steady_gains(6.0).unwrap();
        let response = bicycle.frequency_response(6.0, 0.0).unwrap();
        near(response.yaw_rate_1_s.re, steady.yaw_rate_1_s, 1e-12);
        near(response.sideslip.re, steady.sideslip, 1e-12);
        near(response.lateral_m_s2.re, steady.lateral_m_s2, 1e-11);
    }

    #[test]
    fn the_relaxed_form_holds_at_rest_and_tends_to_equation_2_5() {
        let bicycle = noted(5975.0, 17_076.0);
        let (rest, input) = bicycle.relaxed_system(0.0, 0.3).unwrap();
        assert!(rest.iter().all(|value| value.is_finite()) && input.amax() == 0.0);
        assert!(bicycle.system(0.0).is_err());
        let (stiff, input) = bicycle.relaxed_system(5.0, 1e-6).unwrap();
        let steady = -stiff.lu().solve(&input).unwrap();
        let gains = bicycle.steady_gains(5.0).unwrap();
        near(steady[0] / 5.0, gains.sideslip, 1e-9);
        near(steady[1], gains.yaw_rate_1_s, 1e-9);
        let slow = stiff.complex_eigenvalues();
        for expected in [-6.593_133, -2.210_658] {
            let best = slow
                .iter()
                .map(|s| (s.re - expected).abs())
                .fold(f64::MAX, f64::min);
            assert!(best < 1e-3, "{slow}");
        }
    }

    #[test]
    fn an_oversteering_vehicle_has_a_critical_speed_where_it_turns_unstable() {
        let bicycle = noted(20_000.0, 9_000.0);
        let critical = bicycle.critical_speed_m_s().unwrap();
        let real = |speed| bicycle.eigenvalues(speed).unwrap().map(|s| s.re);
        assert!(real(0.99 * critical).iter().all(|re| *re < 0.0));
        assert!(real(1.01 * critical).iter().any(|re| *re > 0.0));
        assert!(bicycle.yaw_mode(1.01 * critical).unwrap().is_none());
    }

    #[test]
    fn non_finite_input_is_named() {
        let message = noted(1.0, 1.0).system(f64::NAN).unwrap_err().to_string();
        assert!(message.contains("speed_m_s = NaN m/s"), "{message}");
    }
}
