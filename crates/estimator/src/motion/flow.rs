//! Transition of the error state by the inertial equations.

use nalgebra::{Matrix3, SMatrix};

use super::{ACCEL_BIAS, ATTITUDE, GYRO_BIAS, STATES, VELOCITY};

/// A step of the inertial equations: the blocks of F - I that are not zero.
#[derive(Clone, Debug, Default)]
pub struct Flow {
    /// Velocity by accelerometer bias, and attitude by gyro bias.
    pub of_bias: Matrix3<f64>,
    /// Velocity by attitude.
    pub of_attitude: Matrix3<f64>,
}

impl Flow {
    /// F times a matrix.
    pub fn times<const N: usize>(
        &self,
        mut matrix: SMatrix<f64, STATES, N>,
    ) -> SMatrix<f64, STATES, N> {
        let velocity = self.of_attitude * matrix.fixed_rows::<3>(ATTITUDE)
            + self.of_bias * matrix.fixed_rows::<3>(ACCEL_BIAS);
        let attitude = self.of_bias * matrix.fixed_rows::<3>(GYRO_BIAS);
        for (first, rows) in [(VELOCITY, velocity), (ATTITUDE, attitude)] {
            let mut place = matrix.fixed_rows_mut::<3>(first);
            place += rows;
        }
        matrix
    }
}

/// Steps of the inertial equations, one after another.
#[derive(Clone, Debug, Default)]
pub struct Passed {
    flow: Flow,
    /// Velocity by gyro bias, by way of attitude.
    of_gyro_bias: Matrix3<f64>,
}

impl Passed {
    /// Appends a step.
    pub fn step(&mut self, flow: &Flow) {
        self.of_gyro_bias += flow.of_attitude * self.flow.of_bias;
        self.flow.of_bias += flow.of_bias;
        self.flow.of_attitude += flow.of_attitude;
    }

    /// F of all of them times a matrix.
    pub fn times<const N: usize>(
        &self,
        errors: SMatrix<f64, STATES, N>,
    ) -> SMatrix<f64, STATES, N> {
        let velocity = self.of_gyro_bias * errors.fixed_rows::<3>(GYRO_BIAS);
        let mut errors = self.flow.times(errors);
        let mut place = errors.fixed_rows_mut::<3>(VELOCITY);
        place += velocity;
        errors
    }
}
