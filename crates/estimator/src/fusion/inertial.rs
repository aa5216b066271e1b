//! Balances of forces and moments, and the inertial unit in them.

use nalgebra::{Matrix3, Vector3};
use sample::{InnovationKind, STANDARD_GRAVITY_M_S2};

use crate::corners::CornerState;
use crate::feedback::BodyMotionEstimate;
use crate::gaussian::within;

use super::forms::{CornerForms, Coupled, corner_states};
use super::joint::{Joint, Rows, TOGETHER};
use super::latency::Ageing;
use super::layout::{ACCEL_BIAS, BALANCED, BODY_RATE, FORCE, MOMENT, RATE};
use super::moments::KnownMoment;
use super::{Fusion, MOMENT_AXES, SIZE, StepInput, StepModel, carrier};

/// Rows of the inertial unit: all forces, their rates, moments, struts and torques, the first states.
type InertialRows = Rows<BALANCED>;
/// Order of the accelerometer's axes. Upward first: a stand or a jack that carries a part of the
/// weight also pushes along the other axes.
const UPWARD_FIRST: [usize; 3] = [2, 0, 1];
/// The gyro's first axis among the inertial unit's rows.
const GYRO: usize = 3;

/// A linear form of the balanced states.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sum {
    pub(super) gains: [f64; BALANCED],
    pub(super) constant: f64,
}

impl Sum {
    const ZERO: Self = Self {
        gains: [0.0; BALANCED],
        constant: 0.0,
    };

    pub(super) fn value(&self, state: &[f64; SIZE]) -> f64 {
        let terms = self.gains.iter().zip(state);
        terms.map(|(gain, x)| gain * x).sum::<f64>() + self.constant
    }

    fn add(&mut self, factor: f64, other: &Self) {
        for (gain, of_other) in self.gains.iter_mut().zip(other.gains) {
            *gain += factor * of_other;
        }
        self.constant += factor * other.constant;
    }
}

/// The balances of forces and moments at one instant. What accelerates the unsprung parts against the body
/// is taken off both.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    /// Angular acceleration of the body, body axes, rad/s^2.
    pub(super) turn: [Sum; 3],
    /// Force that accelerates the whole vehicle as one body with the frame, body axes, N.
    push: [Sum; 3],
}

impl Fusion {
    pub(super) fn balance(
        &self,
        input: &StepInput<'_>,
        known: &[KnownMoment; 4],
        forms: &[CornerForms; 4],
    ) -> Balance {
        let body = &self.body;
        let cg = Vector3::new(0.0, 0.0, body.cg_height_m);
        let [mut push, mut moment] = [[Sum::ZERO; 3]; 2];
        let mut momentum = Vector3::zeros();
        let mut momentum_dot = Vector3::zeros();
        let backward = input.motion.velocity_m_s.x.clamp(-1.0, 1.0);
        for (i, corner) in input.corners.iter().enumerate() {
            let axes = carrier(corner);
            let arm = corner.frame.contact_m - cg;
            let mut of_force = arm.cross_matrix() * axes;
            // Rolling resistance: M_y = -c R F_z of a wheel that rolls forward, about the contact
            // point; the load acts ahead of the wheel's centre.
            let rolling = axes.column(1) * (-body.rolling[i] * backward);
            let with_rolling = of_force.column(2) + rolling;
            of_force.set_column(2, &with_rolling);
            let spindle = corner.pose.spindle;
            let spinning = spindle * (body.spin_inertia[i] * corner.spin_rad_s);
            momentum += spinning;
            momentum_dot += spindle * (body.spin_inertia[i] * corner.spin_dot_rad_s2)
                + corner.turn_rad_s.cross(&spinning);
            let of_known = axes * known[i].moment_n_m;
            let [still, unit] = &corner.travel.wrench;
            let acceleration = &forms[i].acceleration;
            for axis in 0..3 {
                for k in 0..3 {
                    push[axis].gains[FORCE + 3 * i + k] += axes[(axis, k)];
                    moment[axis].gains[FORCE + 3 * i + k] += of_force[(axis, k)];
                }
                for (k, about) in MOMENT_AXES.into_iter().enumerate() {
                    moment[axis].gains[MOMENT + 2 * i + k] += axes[(axis, about)];
                }
                moment[axis].constant += of_known[axis];
                for (sum, row) in [(&mut push, axis), (&mut moment, 3 + axis)] {
                    sum[axis].constant -= still[row] + unit[row] * acceleration.constant;
                    let states = corner_states(i).into_iter().zip(acceleration.gains);
                    let of_other = forms[i].coupled.iter().flat_map(Coupled::terms);
                    for (state, gain) in states.chain(of_other) {
                        sum[axis].gains[state] -= unit[row] * gain;
                    }
                }
            }
        }
        let u = input.motion.velocity_m_s.x;
        push[0].constant -= body.drag * u * u.abs();
        let rate = input.motion.rate_rad_s;
        let gyroscopic = rate.cross(&(body.inertia * rate + momentum)) + momentum_dot;
        for axis in 0..3 {
            moment[axis].constant -= gyroscopic[axis];
        }
        let turn = std::array::from_fn(|axis| {
            let mut turn = Sum::ZERO;
            for (k, moment) in moment.iter().enumerate() {
                turn.add(body.inverse[(axis, k)], moment);
            }
            turn
        });
        Balance { turn, push }
    }

    /// Takes specific force and angular rate of the inertial unit. Returns whether the accelerometers
    /// agree with the forces.
    ///
    /// With r from the centre of gravity to the unit, m f = sum R F + m (w' x r + w x (w x r)). The
    /// angular acceleration w' comes from the balance of moments: a differentiated gyro would be three
    /// times noisier than the accelerometers. If the upward axis contradicts the loads of wheels whose
    /// struts are measured, the vehicle is held by something else. Then the other accelerometers are
    /// not used, and only the gyros measure the angular rate. `has_agreed`: whether the unit agreed with the
    /// balances in the step before.
    pub(super) fn take_inertial(
        &mut self,
        input: &StepInput<'_>,
        model: &StepModel,
        has_agreed: bool,
    ) -> bool {
        let balance = &model.balance;
        let rows = self.inertial_rows(input, balance);
        let [force_ageing, turn_ageing] = self.inertial_ageing(input, model);
        let mut joint = self.covariance.project(&rows, &self.state);
        if has_agreed && self.widen_for_push(input, balance, &joint) {
            joint = self.covariance.project(&rows, &self.state);
        }
        let agrees = self.take_accelerometers(input, balance, &rows, &mut joint, &force_ageing);
        self.agreed = agrees && input.used.force == [true; 3];
        let wrong_rate = self.take_gyros(input, balance, &mut joint, &turn_ageing);
        self.take_rate_over_ground(input, balance, &mut joint);
        self.covariance.apply(&rows, &joint, &mut self.state);
        if !self.settling() {
            let mut ageing = [None; TOGETHER];
            for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
                ageing[m] = force_ageing[axis];
                ageing[GYRO + axis] = turn_ageing[axis].filter(|_| input.used.rate[axis]);
            }
            self.latencies
                .take(&rows.view(), &joint, &self.covariance, &ageing);
        }
        for (axis, square) in wrong_rate
            .into_iter()
            .enumerate()
            .filter(|(_, square)| *square > 0.0)
        {
            self.covariance.add_noise(BODY_RATE + axis, square);
            self.gyro_rejections[axis] = 0;
        }
        agrees
    }

    /// m times the matrix of w' x r.
    pub(super) fn lever_kg_m(&self, input: &StepInput<'_>) -> Matrix3<f64> {
        -input.imu_m.cross_matrix() * self.body.mass_kg
    }

    /// The form of the accelerometer's axis: m f = sum F + m w' x r.
    pub(super) fn accelerometer(
        &self,
        input: &StepInput<'_>,
        balance: &Balance,
        axis: usize,
    ) -> Sum {
        let lever = self.lever_kg_m(input);
        let mut sum = balance.push[axis];
        for (k, turn) in balance.turn.iter().enumerate() {
            sum.add(lever[(axis, k)], turn);
        }
        sum
    }

    /// Measurement rows of accelerometers, in the order of [`UPWARD_FIRST`], and gyros.
    fn inertial_rows(&self, input: &StepInput<'_>, balance: &Balance) -> InertialRows {
        let age = input.motion.inertial_age_s.max(0.0);
        let mut rows = InertialRows::new(std::array::from_fn(|i| i));
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            let mut gains = self.accelerometer(input, balance, axis).gains;
            for j in 0..RATE - FORCE {
                gains[RATE + j] -= age * gains[FORCE + j];
            }
            rows.set(m, gains, (ACCEL_BIAS + axis, self.body.mass_kg));
        }
        for axis in 0..3 {
            let gains = balance.turn[axis].gains.map(|gain| -age * gain);
            rows.set(GYRO + axis, gains, (BODY_RATE + axis, 1.0));
        }
        rows
    }

    /// m times the specific force at the inertial unit without w x (w x r), less what no state has, N.
    pub(super) fn measured_sum_n(&self, input: &StepInput<'_>, balance: &Balance) -> Vector3<f64> {
        let at_unit =
            input.motion.specific_force_m_s2 + input.motion.rate_dot_rad_s2.cross(&input.imu_m);
        at_unit * self.body.mass_kg
            - Vector3::from_fn(|axis, _| self.accelerometer(input, balance, axis).constant)
    }

    /// Takes the accelerometers; returns whether all that are used agree with the forces.
    fn take_accelerometers(
        &mut self,
        input: &StepInput<'_>,
        balance: &Balance,
        rows: &InertialRows,
        joint: &mut Joint,
        ageing: &[Option<Ageing>; 3],
    ) -> bool {
        let t = self.tuning.balance;
        let mass = self.body.mass_kg;
        let sum = self.measured_sum_n(input, balance);
        let variance = self.sum_variance(input);
        let is_posed = |corner: &CornerState| corner.strut_sigma_n.is_finite();
        let posed = input.corners.iter().all(is_posed);
        let unposed = !input.corners.iter().any(is_posed);
        let mut agrees = true;
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            let variance = variance + self.latencies.variance(ageing[axis]);
            self.accel_variance[axis] = (joint.variance(m) + variance) / (mass * mass);
            if !input.used.force[axis] {
                continue;
            }
            if axis == 2 {
                let missing = sum[axis] - joint.value(m);
                self.held &= posed
                    && !self.rolling
                    && missing.abs() > t.held_part * mass * STANDARD_GRAVITY_M_S2;
            }
            let gate = match (self.held, unposed) {
                (true, _) => 0.0,
                (false, false) => self.tuning.gate_sigma,
                // Without potentiometers the accelerometers know more of the forces than the strain.
                (false, true) => f64::INFINITY,
            };
            let innovation = self.take(joint, m, sum[axis], variance, gate);
            self.count(InnovationKind::Accelerometer, innovation, gate);
            agrees &= within(gate, innovation, 1.0);
            if axis == 2 && !agrees && posed && !self.rolling {
                self.hold();
                *joint = self.covariance.project(rows, &self.state);
                break;
            }
        }
        agrees
    }

    /// Variance of the measured sum of all forces, N^2: accelerometer, model and road.
    fn sum_variance(&self, input: &StepInput<'_>) -> f64 {
        let [_, accel] = input.imu_sigma;
        let of_unit = self.body.mass_kg * accel;
        let rough = self.tuning.force_noise.road_sum;
        of_unit * of_unit
            + self.tuning.balance.sum_sigma_n.powi(2)
            + rough * rough * self.force_noise.mean_road()
    }

    /// A force of all tyres along or across the vehicle that begins or ends within a step, as when brakes bring it
    /// to a stop, is beyond the gate of an accelerometer, which would be left out where it knows most. Its
    /// innovation widens the forces of all tyres first. A larger innovation is a jump of the sensor. Returns whether
    /// it did.
    fn widen_for_push(&mut self, input: &StepInput<'_>, balance: &Balance, joint: &Joint) -> bool {
        let t = self.tuning.balance;
        if self.settling() || self.held {
            return false;
        }
        let sum = self.measured_sum_n(input, balance);
        let variance = self.sum_variance(input);
        let gate = self.tuning.gate_sigma;
        let most_n = t.push_max_m_s2 * self.body.mass_kg;
        let mut widened = false;
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate().skip(1) {
            let push_n = sum[axis] - joint.value(m);
            let is_push =
                push_n.abs() < most_n && !within(gate, push_n, joint.variance(m) + variance);
            if input.used.force[axis] && is_push {
                widened = true;
                for wheel in 0..4 {
                    for (state, part) in [axis, 2].into_iter().zip(t.push_parts) {
                        let sigma_n = part * push_n;
                        self.covariance
                            .add_noise(FORCE + 3 * wheel + state, sigma_n * sigma_n);
                    }
                }
            }
        }
        widened
    }

    /// The vehicle is held: the balance of moments does not give the angular rate.
    fn hold(&mut self) {
        self.held = true;
        for axis in 0..3 {
            self.covariance
                .add_noise(BODY_RATE + axis, self.tuning.body_rate_variance);
        }
    }

    /// Takes the gyros that are used. Returns the squared difference from each gyro that has
    /// contradicted the balance of moments for too long, (rad/s)^2, else zero.
    fn take_gyros(
        &mut self,
        input: &StepInput<'_>,
        balance: &Balance,
        joint: &mut Joint,
        ageing: &[Option<Ageing>; 3],
    ) -> [f64; 3] {
        let gate_sigma = self.tuning.gate_sigma;
        let age = input.motion.inertial_age_s.max(0.0);
        let [gyro, _] = input.imu_sigma;
        let mut wrong_rate = [0.0; 3];
        for axis in 0..3 {
            if !input.used.rate[axis] {
                self.agreed = false;
                continue;
            }
            // The reading itself: the motion's rate is extrapolated to the present.
            let read = input.motion.rate_rad_s[axis] - age * input.motion.rate_dot_rad_s2[axis];
            let value = read + age * balance.turn[axis].constant;
            let variance = gyro * gyro + self.latencies.variance(ageing[axis]);
            let innovation = self.take(joint, GYRO + axis, value, variance, gate_sigma);
            self.count(InnovationKind::Gyro, innovation, gate_sigma);
            let agrees = within(gate_sigma, innovation, 1.0);
            self.agreed &= agrees;
            self.gyro_rejections[axis] = if agrees {
                0
            } else {
                self.gyro_rejections[axis] + 1
            };
            if self.gyro_rejections[axis] >= self.tuning.balance.gyro_rejections_max {
                wrong_rate[axis] = (value - joint.value(GYRO + axis)).powi(2);
            }
        }
        wrong_rate
    }

    /// Takes roll and pitch rate over ground from the struts for gyros that are not used. Without them
    /// an error of the balance of moments would integrate into any rate.
    fn take_rate_over_ground(
        &mut self,
        input: &StepInput<'_>,
        balance: &Balance,
        joint: &mut Joint,
    ) {
        let t = self.tuning.balance;
        let age = input.motion.inertial_age_s.max(0.0);
        for (axis, over_ground) in input.turn_over_ground.iter().flatten().enumerate() {
            if !input.used.rate[axis] {
                let value = over_ground + age * balance.turn[axis].constant;
                let variance = t.over_ground_sigma_rad_s * t.over_ground_sigma_rad_s;
                self.take(joint, GYRO + axis, value, variance, self.tuning.gate_sigma);
            }
        }
    }

    /// Acceleration of the body by the balances.
    pub(super) fn body_motion_ahead(&self, balance: &Balance) -> BodyMotionEstimate {
        let value = |sum: &Sum| sum.value(&self.state);
        BodyMotionEstimate {
            specific_force_m_s2: Vector3::from(balance.push.each_ref().map(value))
                / self.body.mass_kg,
            rate_dot_rad_s2: Vector3::from(balance.turn.each_ref().map(value)),
        }
    }
}
