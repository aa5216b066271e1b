//! Uncertain latencies of GNSS values.

use nalgebra::Vector3;
use sample::STANDARD_GRAVITY_M_S2;

use super::MotionFilter;
use super::history::Pose;

impl MotionFilter {
    /// Sets the standard deviation of the latency of the next value, s.
    pub fn set_latency_sigma_s(&mut self, sigma_s: f64) {
        self.latency_sigma_s = sigma_s;
    }

    /// Standard deviations of a velocity, m/s, with what the body accelerates within an uncertain latency.
    pub(super) fn late_velocity_sigma(&self, pose: &Pose, sigma: [f64; 3]) -> [f64; 3] {
        let gravity = Vector3::z() * STANDARD_GRAVITY_M_S2;
        let acceleration = pose.earth_from_body * (self.force - self.accel_bias) - gravity;
        self.late(sigma, &acceleration)
    }

    /// Standard deviations of yaw, pitch and roll, rad, with what the body turns within an uncertain latency.
    pub(super) fn late_angle_sigma(&self, pose: &Pose, sigma: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = pose.rate_rad_s.into();
        self.late(sigma, &Vector3::new(z, y, x))
    }

    fn late(&self, sigma: [f64; 3], rate: &Vector3<f64>) -> [f64; 3] {
        if self.latency_sigma_s == 0.0 {
            return sigma;
        }
        std::array::from_fn(|axis| math::hypot(sigma[axis], rate[axis] * self.latency_sigma_s))
    }
}
