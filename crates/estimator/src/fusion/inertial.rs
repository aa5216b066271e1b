//! The balances of forces and moments, and the inertial unit that sees them.

use nalgebra::{Matrix3, Vector3};
use sample::{InnovationKind, STANDARD_GRAVITY_M_S2};

use crate::feedback::BodyMotionEstimate;
use crate::gaussian::within;

use super::covariance::{BALANCED, position};
use super::joint::{Joint, Rows};
use super::moments::KnownMoment;
use super::{ACCEL_BIAS, BODY_RATE, FORCE, Fusion, MOMENT_AXES, RATE, SIZE, StepInput, TORQUE};

/// Of the inertial unit: all forces, their rates and moments, as the states begin.
type InertialRows = Rows<TORQUE>;
/// Order in which the accelerometer's axes are taken in. Upward first: what carries a part of the
/// weight pushes along the other axes, too.
const UPWARD_FIRST: [usize; 3] = [2, 0, 1];
/// Where the forward one comes.
const FORWARD: usize = 1;
/// The gyro's first axis among the inertial unit's rows.
const GYRO: usize = 3;

/// The balance of moments at one instant: w' = jacobian (F, M) + constant.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    pub(super) jacobian: [[f64; BALANCED]; 3],
    pub(super) constant: [f64; 3],
    directions: [Matrix3<f64>; 4],
    /// The tyres' moments that go with the forces of the last step.
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
            // Rolling resistance: M_y = -c R F_z of a wheel that rolls forward, about the
            // contact point, where the load stands ahead of the wheel's centre.
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

    /// Specific force of the inertial unit and angular rate. With r from the centre of gravity to
    /// the unit, m f = sum R F + m (w' x r + w x (w x r)): the angular acceleration comes from the
    /// balance of moments, since a differentiated gyro would be three times noisier than the
    /// accelerometers. Where the upward axis contradicts the loads of wheels whose struts are known,
    /// the vehicle is held: then the other axes tell nothing, and the gyro alone tells how the body
    /// turns. Tells whether the unit agrees with the forces.
    pub(super) fn take_inertial(&mut self, input: &StepInput<'_>, balance: &Balance) -> bool {
        let t = self.tuning.balance;
        let gate_sigma = self.tuning.gate_sigma;
        let age = input.motion.inertial_age_s.max(0.0);
        let [gyro, accel] = input.imu_sigma;
        let mass = self.body.mass_kg;
        let u = input.motion.velocity_m_s.x;
        let drag = Vector3::new(self.body.drag * u * u.abs(), 0.0, 0.0);
        let swing = -input.imu_m.cross_matrix() * mass;
        let at_unit =
            input.motion.specific_force_m_s2 + input.motion.rate_dot_rad_s2.cross(&input.imu_m);
        let sum = at_unit * mass + drag - swing * Vector3::from(balance.constant);
        let doubt = if self.force_noise.open() {
            t.inflated_accel_m_s2
        } else {
            0.0
        };
        let variance = mass * mass * (accel * accel + doubt * doubt) + t.sum_sigma_n.powi(2);
        let posed = (input.corners.iter()).all(|corner| corner.strut_sigma_n.is_finite());
        let mut rows = InertialRows::new(std::array::from_fn(|i| i));
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            let mut gains = [0.0; TORQUE];
            for j in 0..BALANCED {
                let turning = (0..3).map(|k| swing[(axis, k)] * balance.jacobian[k][j]);
                let turning: f64 = turning.sum();
                if j < 12 {
                    let gain = turning + balance.directions[j / 3][(axis, j % 3)];
                    gains[FORCE + j] = gain;
                    gains[RATE + j] = -age * gain;
                } else {
                    gains[position(j)] = turning;
                }
            }
            rows.set(m, gains, (ACCEL_BIAS + axis, mass));
        }
        for axis in 0..3 {
            let mut gains = [0.0; TORQUE];
            for (j, gain) in balance.jacobian[axis].iter().enumerate() {
                gains[position(j)] = -age * gain;
            }
            rows.set(GYRO + axis, gains, (BODY_RATE + axis, 1.0));
        }
        let mut joint = self.covariance.project(&rows, &self.state);
        let mut agrees = true;
        for (m, axis) in UPWARD_FIRST.into_iter().enumerate() {
            self.accel_variance[axis] = (joint.variance(m) + variance) / (mass * mass);
            if !input.used.force[axis] {
                continue;
            }
            if axis == 0 && !self.settling() {
                self.inflate_on_push(&rows, &mut joint, sum[axis], variance);
            }
            if axis == 2 {
                let missing = sum[axis] - joint.value(m);
                self.held &= posed
                    && !self.rolling
                    && missing.abs() > t.held_part * mass * STANDARD_GRAVITY_M_S2;
            }
            let gate = if self.held { 0.0 } else { gate_sigma };
            let innovation = self.take(&mut joint, m, sum[axis], variance, gate);
            self.count(InnovationKind::Accelerometer, innovation, gate);
            agrees &= within(gate, innovation, 1.0);
            if axis == 2 && !agrees && posed && !self.rolling {
                self.held = true;
                for axis in 0..3 {
                    self.covariance
                        .add_noise(BODY_RATE + axis, self.tuning.body_rate_variance);
                }
                joint = self.covariance.project(&rows, &self.state);
                break;
            }
        }
        let mut lost = [0.0; 3];
        self.agreed = agrees && input.used.force == [true; 3];
        for axis in 0..3 {
            if !input.used.rate[axis] {
                self.agreed = false;
                continue;
            }
            // The reading itself: the motion's rate is already carried on to now.
            let read = input.motion.rate_rad_s[axis] - age * input.motion.rate_dot_rad_s2[axis];
            let value = read + age * balance.constant[axis];
            let innovation = self.take(&mut joint, GYRO + axis, value, gyro * gyro, gate_sigma);
            self.count(InnovationKind::Gyro, innovation, gate_sigma);
            let told = within(gate_sigma, innovation, 1.0);
            self.agreed &= told;
            self.gyro_rejections[axis] = if told {
                0
            } else {
                self.gyro_rejections[axis] + 1
            };
            if self.gyro_rejections[axis] >= t.gyro_rejections_max {
                lost[axis] = (value - joint.value(GYRO + axis)).powi(2);
            }
        }
        // A gyro that is not believed leaves the balance to itself: an error of the moments would
        // grow into any rate. The struts see how the body turns, but for the ground's own turning.
        for (axis, over_ground) in input.turn_over_ground.iter().flatten().enumerate() {
            if !input.used.rate[axis] {
                let value = over_ground + age * balance.constant[axis];
                let variance = t.over_ground_sigma_rad_s * t.over_ground_sigma_rad_s;
                self.take(&mut joint, GYRO + axis, value, variance, gate_sigma);
            }
        }
        self.covariance.apply(&rows, &joint, &mut self.state);
        for (axis, square) in lost
            .into_iter()
            .enumerate()
            .filter(|(_, square)| *square > 0.0)
        {
            self.covariance.add_noise(BODY_RATE + axis, square);
            self.gyro_rejections[axis] = 0;
        }
        agrees
    }

    /// Drive and brake come through all tyres at once, and the accelerometer feels them before the
    /// bridges' lag shows them: what of its innovation is more than noise is set free in the forward
    /// forces, a quarter of its variance in each, so that they follow at once and say how unsure
    /// they are, and in the rates of the loads that follow.
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
