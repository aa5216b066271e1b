//! Measurement equations of a corner that is described by a matrix, see [`crate::calibration::matrix`].
//!
//! A channel of the matrix takes the place of a member of the linkage. It has the gains m of a wrench about
//! the contact point in the wheel-carrier frame, as a row of the linkage's statics:
//!
//! value = m (w - p g - p g_l l'')
//!
//! with the wrench w of the ground on the tyre, the wrench g that accelerates and carries the unsprung parts
//! (g_l for 1 m/s^2 of the strut), and the part p of them that is between gauges and road.

use model::suspension::CornerStatics;
use model::vehicle::Vehicle;
use nalgebra::{Matrix3, Vector3, Vector6};
use sample::{PerWheel, Wheel};

use super::forms::{Form, wrench_gains};
use super::layout::{FORCE, MOMENT, TORQUE};
use super::{Fusion, StepInput};
use crate::calibration::matrix::MatrixRow;
use crate::calibration::{CornerChannels, MatrixAxes, SensitivityMatrix};
use crate::corners::CornerState;

/// Part of the unsprung parts of each corner that is between gauges and road.
pub(super) fn outboard_parts(vehicle: &Vehicle, channels: &PerWheel<CornerChannels>) -> [f64; 4] {
    Wheel::ALL.map(|wheel| {
        let unsprung = vehicle.axle(wheel).unsprung.as_ref();
        let all_kg = unsprung.map(|unsprung| unsprung.total_mass_kg());
        let matrix = channels[wheel].matrix;
        let outboard_kg = matrix.and_then(|matrix| matrix.outboard_mass_kg);
        match (outboard_kg, all_kg) {
            (Some(outboard_kg), Some(all_kg)) if all_kg > 0.0 => outboard_kg / all_kg,
            _ => 1.0,
        }
    })
}

/// A matrix at one instant.
pub(super) struct MatrixNow<'a> {
    matrix: &'a SensitivityMatrix,
    /// Matrix axes from wheel-carrier axes.
    turn: Matrix3<f64>,
    /// Contact point from the wheel centre, wheel-carrier frame, m.
    arm_m: Vector3<f64>,
    /// Contact point from that of the matrix, matrix axes, m.
    shift_m: Vector3<f64>,
    /// Compression of the strut from that of the matrix, m.
    compression_m: f64,
    /// See [`outboard_parts`].
    part: f64,
}

impl<'a> MatrixNow<'a> {
    fn new(matrix: &'a SensitivityMatrix, corner: &CornerState, height_m: f64, part: f64) -> Self {
        let vehicle_from_carrier = super::carrier(corner);
        let arm = corner.frame.contact_m - corner.pose.wheel_centre_m;
        let arm_m = vehicle_from_carrier.transpose() * arm;
        let turn = match matrix.axes {
            MatrixAxes::Vehicle => vehicle_from_carrier,
            MatrixAxes::Wheel => Matrix3::identity(),
        };
        Self {
            matrix,
            shift_m: turn * arm_m + Vector3::z() * height_m,
            turn,
            arm_m,
            compression_m: corner.compression_m - matrix.compression_m,
            part,
        }
    }

    /// Gains of a channel on the wrench about the contact point, wheel-carrier frame. The matrix has F_x at
    /// the wheel centre.
    fn gains(&self, row: &MatrixRow) -> [f64; 6] {
        let gain = |i: usize| row.gains[i] + self.compression_m * row.change[i];
        let of_force = Vector3::from_fn(|i, _| gain(i));
        let of_moment = Vector3::from_fn(|i, _| gain(3 + i));
        // A force at the contact point has a moment about that of the matrix, but none about the spindle.
        let turning = Vector3::new(of_moment.x, 0.0, of_moment.z);
        let of_force = of_force + turning.cross(&self.shift_m);
        let (force, moment) = (self.turn.tr_mul(&of_force), self.turn.tr_mul(&of_moment));
        [
            force.x + moment.y * self.arm_m.z,
            force.y,
            force.z - moment.y * self.arm_m.x,
            moment.x,
            moment.y,
            moment.z,
        ]
    }

    /// Form of channel `i` without the strut's acceleration. `known_n_m`: the tyre's known moment.
    pub(super) fn form(
        &self,
        i: usize,
        statics: &CornerStatics,
        known_n_m: &Vector3<f64>,
        left: f64,
    ) -> Form {
        let Some(row) = &self.matrix.rows[i] else {
            return Form::default();
        };
        let m = self.gains(row);
        let carried = Vector6::from(m).dot(&statics.wrench_offset);
        Form {
            gains: wrench_gains(m, &self.arm_m, left),
            constant: m[3] * known_n_m.x + m[5] * known_n_m.z - self.part * carried,
        }
    }

    /// What 1 m/s^2 of the strut adds to channel `i`, N/(m/s^2). `members`: what it adds to the members of the
    /// linkage, or of what stands in its place.
    pub(super) fn per_acceleration(
        &self,
        i: usize,
        statics: &CornerStatics,
        members: &[f64; 6],
    ) -> f64 {
        self.matrix.rows[i].as_ref().map_or(0.0, |row| {
            let wrench = statics.wrench_from_members * Vector6::from(*members);
            self.part * Vector6::from(self.gains(row)).dot(&wrench)
        })
    }

    /// Standard deviation of channel `i`, N, with the wrench that passes the gauges: wheel-carrier frame, F_x at
    /// the wheel centre. `part`: error of each response beside its own standard deviation, as a part of it.
    fn sigma_n(&self, i: usize, wrench: &Vector6<f64>, part: f64) -> f64 {
        let Some(row) = &self.matrix.rows[i] else {
            return 0.0;
        };
        let force = self.turn * wrench.fixed_rows::<3>(0);
        let moment = self.turn * wrench.fixed_rows::<3>(3);
        let passing = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        let variance: f64 = (0..6)
            .map(|j| {
                let change = row.change_sigma[j] * self.compression_m;
                let model = part * row.gains[j];
                (row.sigma[j] * row.sigma[j] + change * change + model * model)
                    * (passing[j] * passing[j])
            })
            .sum();
        variance.sqrt()
    }
}

impl Fusion {
    /// The matrix of a wheel at the instant, if it has one.
    pub(super) fn matrix<'a>(&self, input: &StepInput<'a>, wheel: usize) -> Option<MatrixNow<'a>> {
        let matrix = input.channels.0[wheel].matrix.as_ref()?;
        let tyre = &self.body.tyres[wheel];
        let squeeze_m = self.body.static_load[wheel] / tyre.vertical_stiffness_n_m.max(1.0);
        let height_m = (matrix.contact_height_m).unwrap_or(tyre.unloaded_radius_m - squeeze_m);
        let part = self.outboard_parts[wheel];
        Some(MatrixNow::new(
            matrix,
            &input.corners[wheel],
            height_m,
            part,
        ))
    }

    /// Standard deviation of a matrix' channel, N: of the matrix, with the forces of the last step, and of what
    /// a matrix does not tell of a linkage.
    fn matrix_tolerance_n(
        &self,
        input: &StepInput<'_>,
        matrix: &MatrixNow<'_>,
        [wheel, i]: [usize; 2],
        known_n_m: &Vector3<f64>,
    ) -> f64 {
        let state = &self.state;
        let left = if Wheel::ALL[wheel].is_left() {
            1.0
        } else {
            -1.0
        };
        let torque = state[TORQUE + wheel / 2] + left * state[TORQUE + 2 + wheel / 2];
        let [x, y, z] = [0, 1, 2].map(|axis| state[FORCE + 3 * wheel + axis]);
        let [tipping, turning] = [0, 1].map(|k| state[MOMENT + 2 * wheel + k]);
        let ground = Vector6::new(
            x,
            y,
            z,
            tipping + known_n_m.x,
            torque,
            turning + known_n_m.z,
        );
        let mut carried = input.corners[wheel].statics.wrench_offset * matrix.part;
        // About the spindle, the inertia of a wheel that turns freely has no moment.
        carried[4] = 0.0;
        let passing = ground - carried;
        let t = self.tuning.members;
        // A linkage bends away from a linear change with the square of its travel.
        let bent = t.matrix_bend_part_m2 * matrix.compression_m * matrix.compression_m;
        let sigma_n = matrix.sigma_n(i, &passing, t.matrix_sigma_part + bent);
        math::hypot(sigma_n, t.member_sigma_n)
    }

    /// Variances of the axial channels by the errors of a matrix, N^2; zero without one. These errors agree with
    /// each other, so that innovations do not show them: they are not adapted.
    pub(super) fn matrix_variance(
        &self,
        input: &StepInput<'_>,
        wheel: usize,
        known_n_m: &Vector3<f64>,
    ) -> [f64; 5] {
        let Some(matrix) = self.matrix(input, wheel) else {
            return [0.0; 5];
        };
        std::array::from_fn(|i| {
            let sigma_n = self.matrix_tolerance_n(input, &matrix, [wheel, i], known_n_m);
            sigma_n * sigma_n
        })
    }

    /// Standard deviations of the forces of a wheel that the errors of its matrix keep from step to step, N:
    /// by weighted least squares of the channels of the step alone. Zero without a matrix.
    pub(super) fn matrix_sigma_n(
        &self,
        input: &StepInput<'_>,
        wheel: usize,
        known_n_m: &Vector3<f64>,
    ) -> [f64; 3] {
        let Some(matrix) = self.matrix(input, wheel) else {
            return [0.0; 3];
        };
        let mut information = Matrix3::zeros();
        for (i, row) in matrix.matrix.rows.iter().enumerate() {
            let Some(row) = row else { continue };
            let [x, y, z, ..] = matrix.gains(row);
            let gains = Vector3::new(x, y, z);
            let sigma_n = self.matrix_tolerance_n(input, &matrix, [wheel, i], known_n_m);
            information += gains * gains.transpose() / (sigma_n * sigma_n);
        }
        // The strut is a channel, too, whose own error is a state.
        let strut = input.corners[wheel].statics.members_from_wrench.row(5);
        let gains = Vector3::new(strut[0], strut[1], strut[2]);
        let start_n = self.tuning.strut_sigma_n;
        let square = self.carried_variance(&input.corners[wheel], wheel);
        if input.corners[wheel].strut_sigma_n.is_finite() {
            information += gains * gains.transpose() / (start_n * start_n + square);
        }
        let covariance = information.try_inverse();
        covariance.map_or([0.0; 3], |covariance| {
            std::array::from_fn(|axis| covariance[(axis, axis)].max(0.0).sqrt())
        })
    }
}
