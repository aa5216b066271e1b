//! Balances of forces and moments, and the inertial unit in them.

use nalgebra::{Matrix3, Vector3};
use sample::{InnovationKind, STANDARD_GRAVITY_M_S2};

use crate::feedback::BodyMotionEstimate;
use crate::gaussian::within;

use super::covariance::{BALANCED, position};
use super::joint::{Joint, Rows};
use super::moments::KnownMoment;
use super::{ACCEL_BIAS, BODY_RATE, FORCE, Fusion, MOMENT_AXES, RATE, SIZE, StepInput, TORQUE};

/// Rows of the inertial unit: all forces, their rates and moments, the first states.
type InertialRows = Rows<TORQUE>;
/// Order of the accelerometer's axes. Upward first: a stand or a jack that carries a part of the
/// weight also pushes along the other axes.
const UPWARD_FIRST: [usize; 3] = [2, 0, 1];
/// Position of the forward axis in that order.
const FORWARD: usize = 1;
/// The gyro's first axis among the inertial unit's rows.
const GYRO: usize = 3;

/// The balance of moments at one instant: w' = jacobian (F, M) + constant.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    pub(super) jacobian: [[f64; BALANCED]; 3],
    pub(super) constant: [f64; 3],
    directions: [Matrix3<f64>; 4],
    /// The tyres' moments that belong to the forces of the last step.
    pub(super) known: [KnownMoment; 4],
}

impl Balance {
    pub(super) fn turn_rate(&self, axis: usize, state: &[f64; SIZE]) -> f64 {
        let gains = self.jacobian[axis].iter().enumerate();
        let sum: f64 = gains.map(|(j, gain)| gain * state[position(j)]).sum();
        sum + self.constant[axis]
    }
}

impl Fusion {
    pub(super) fn balance(&self, input: &StepInput<'_>) -> Balance {
        let body = &self.body;
        let cg = Vector3::new(0.0, 0.0, body.cg_height_m);
        let mut jacobian = [[0.0; BALANCED]; 3];
        let mut of_known = Vector3::zeros();
        let mut momentum = Vector3::zeros();
        let mut momentum_dot = Vector3::zeros();
        let mut directions = [Matrix3::zeros(); 4];
        let known = std::array::from_fn(|wheel| {
            self.known_moment(wheel, &input.corners[wheel], input.motion.velocity_m_s.x)
        });
        let backward = input.motion.velocity_m_s.x.clamp(-1.0, 1.0);
        for (i, corner) in input.corners.iter().enumerate() {
            let turn = corner.frame.vehicle_from_tyre;
            let arm = corner.frame.contact_m - cg;
            let mut of_force = body.inverse * arm.cross_matrix() * turn;
            let of_moment = body.inverse * turn;
            // Rolling resistance: M_y = -c R F_z of a wheel that rolls forward, about the contact
            // point; the load acts ahead of the wheel's centre.
            let rolling = of_moment.column(1) * (-body.rolling[i] * backward);
            let with_rolling = of_force.column(2) + rolling;
            of_force.set_column(2, &with_rolling);
            for axis in 0..3 {
                for k in 0..3 {
                    jacobian[axis][3 * i + k] = of_force[(axis, k)];
                }
                for (k, about) in MOMENT_AXES.into_iter().enumerate() {
                    jacobian[axis][12 + 2 * i + k] = of_moment[(axis, about)];
                }
            }
            let spindle = corner.pose.spindle;
            let spinning = spindle * (body.spin_inertia[i] * corner.spin_rad_s);
            momentum += spinning;
            momentum_dot += spindle * (body.spin_inertia[i] * corner.spin_dot_rad_s2)
                + corner.turn_rad_s.cross(&spinning);
            of_known += of_moment * known[i].moment_n_m;
            directions[i] = turn;
        }
        let rate = input.motion.rate_rad_s;
        let constant = of_known
            - (body.inverse * (rate.cross(&(body.inertia * rate + momentum)) + momentum_dot));
        Balance {
            jacobian,
            constant: constant.into(),
            directions,
            known,
        }
    }

    /// Takes specific force and angular rate of the inertial unit. Returns whether the accelerometers
    /// agree with the forces.
    ///
    /// With r from the centre of gravity to the unit, m f = sum R F + m (w' x r + w x (w x r)). The
    /// angular acceleration w' comes from the balance of moments: a differentiated gyro would be three
    /// times noisier than the accelerometers. If the upward axis contradicts the loads of wheels whose
    /// struts are measured, the vehicle is held by something else. Then the other accelerometers are
    /// not used, and only the gyros measure the angular rate.
    pub(super) fn take_inertial(&mut self, input: &StepInput<'_>, balance: &Balance) -> bool {
        let rows = self.inertial_rows(input, balance);
        let mut joint = self.covariance.project(&rows, &self.state);
        let agrees = self.take_accelerometers(input, balance, &rows, &mut joint);
        self.agreed = agrees && input.used.force == [true; 3];
        let wrong_rate = self.take_gyros(input, balance, &mut joint);
        self.take_rate_over_ground(input, balance, &mut joint);
        self.covariance.apply(&rows, &joint, &mut self.state);
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
    fn lever_kg_m(&self, input: &StepInput<'_>) -> Matrix3<f64> {
        -input.imu_m.cross_matrix() * self.body.mass_kg
    }

    /// Measurement rows of accelerometers, in the order of [`UPWARD_FIRST`], and gyros.
    fn inertial_rows(&self, input: &StepInput<'_>, balance: &Balance) -> InertialRows {
        let age = input.motion.inertial_age_s.max(0.0);
        let lever = self.lever_kg_m(input);
        let mut rows = InertialRows::new(std::array::from_fn(|i| i));
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            let mut gains = [0.0; TORQUE];
            for j in 0..BALANCED {
                let turning = (0..3).map(|k| lever[(axis, k)] * balance.jacobian[k][j]);
                let turning: f64 = turning.sum();
                if j < 12 {
                    let gain = turning + balance.directions[j / 3][(axis, j % 3)];
                    gains[FORCE + j] = gain;
                    gains[RATE + j] = -age * gain;
                } else {
                    gains[position(j)] = turning;
                }
            }
            rows.set(m, gains, (ACCEL_BIAS + axis, self.body.mass_kg));
        }
        for axis in 0..3 {
            let mut gains = [0.0; TORQUE];
            for (j, gain) in balance.jacobian[axis].iter().enumerate() {
                gains[position(j)] = -age * gain;
            }
            rows.set(GYRO + axis, gains, (BODY_RATE + axis, 1.0));
        }
        rows
    }

    /// Sum of all tyre forces by the accelerometers, N, body axes.
    fn measured_sum_n(&self, input: &StepInput<'_>, balance: &Balance) -> Vector3<f64> {
        let u = input.motion.velocity_m_s.x;
        let drag = Vector3::new(self.body.drag * u * u.abs(), 0.0, 0.0);
        let at_unit =
            input.motion.specific_force_m_s2 + input.motion.rate_dot_rad_s2.cross(&input.imu_m);
        at_unit * self.body.mass_kg + drag
            - self.lever_kg_m(input) * Vector3::from(balance.constant)
    }

    /// Takes the accelerometers; returns whether all that are used agree with the forces.
    fn take_accelerometers(
        &mut self,
        input: &StepInput<'_>,
        balance: &Balance,
        rows: &InertialRows,
        joint: &mut Joint,
    ) -> bool {
        let t = self.tuning.balance;
        let mass = self.body.mass_kg;
        let [_, accel] = input.imu_sigma;
        let sum = self.measured_sum_n(input, balance);
        let inflated = if self.force_noise.open() {
            t.inflated_accel_m_s2
        } else {
            0.0
        };
        let variance = mass * mass * (accel * accel + inflated * inflated) + t.sum_sigma_n.powi(2);
        let posed = (input.corners.iter()).all(|corner| corner.strut_sigma_n.is_finite());
        let mut agrees = true;
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            self.accel_variance[axis] = (joint.variance(m) + variance) / (mass * mass);
            if !input.used.force[axis] {
                continue;
            }
            if axis == 0 && !self.settling() {
                self.inflate_on_push(rows, joint, sum[axis], variance);
            }
            if axis == 2 {
                let missing = sum[axis] - joint.value(m);
                self.held &= posed
                    && !self.rolling
                    && missing.abs() > t.held_part * mass * STANDARD_GRAVITY_M_S2;
            }
            let gate = if self.held {
                0.0
            } else {
                self.tuning.gate_sigma
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
            let value = read + age * balance.constant[axis];
            let innovation = self.take(joint, GYRO + axis, value, gyro * gyro, gate_sigma);
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
                let value = over_ground + age * balance.constant[axis];
                let variance = t.over_ground_sigma_rad_s * t.over_ground_sigma_rad_s;
                self.take(joint, GYRO + axis, value, variance, self.tuning.gate_sigma);
            }
        }
    }

    /// A sudden drive or brake force acts through all tyres at once, and the accelerometer shows it
    /// before the bridges' lag does. The part of its squared innovation beyond the threshold is
    /// added to the variance of the forward forces, a quarter to each, and to the rates of the
    /// loads.
    fn inflate_on_push(
        &mut self,
        rows: &InertialRows,
        joint: &mut Joint,
        value: f64,
        variance: f64,
    ) {
        let t = self.tuning.balance;
        let total = joint.variance(FORWARD) + variance;
        let innovation = value - joint.value(FORWARD);
        let square = innovation * innovation;
        self.pushed = (t.push_square * total..t.push_max_square * total).contains(&square);
        if self.pushed {
            self.covariance.apply(rows, joint, &mut self.state);
            let surplus = square / t.push_square - total;
            for wheel in 0..4 {
                let (forward, load_rate) = (FORCE + 3 * wheel, RATE + 3 * wheel + 2);
                self.covariance.add_noise(forward, 0.25 * surplus);
                self.covariance
                    .add_noise(load_rate, t.push_load_rate * t.push_load_rate * surplus);
            }
            *joint = self.covariance.project(rows, &self.state);
        }
    }

    pub(super) fn body_motion_ahead(
        &self,
        input: &StepInput<'_>,
        balance: &Balance,
    ) -> BodyMotionEstimate {
        let ahead = |j: usize| self.state[FORCE + j] + input.dt * self.state[RATE + j];
        let mut sum = Vector3::zeros();
        for (i, direction) in balance.directions.iter().enumerate() {
            sum += direction * Vector3::from_fn(|k, _| ahead(3 * i + k));
        }
        let u = input.motion.velocity_m_s.x;
        sum.x -= self.body.drag * u * u.abs();
        let turn = Vector3::from_fn(|axis, _| balance.turn_rate(axis, &self.state));
        BodyMotionEstimate {
            specific_force_m_s2: sum / self.body.mass_kg,
            rate_dot_rad_s2: turn,
        }
    }
}
