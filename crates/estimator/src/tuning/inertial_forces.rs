//! Tyre forces of a vehicle without linkages.

use super::tuning;

tuning! {
    /// Tyre forces of a vehicle without linkages, from its inertial unit (`inertial_forces.rs`).
    InertialForcesTuning {
        /// Time without a reading of a strain channel, a potentiometer or a hub accelerometer after which these forces
        /// replace those of the force filter.
        silent_s: f64 = 1.0, "s";
        /// Random walk of the yaw moment of the lateral forces, as a part of weight times wheelbase.
        yaw_moment_walk: f64 = 0.08, "1/√s";
        /// The same of the moments that turn the vehicle in roll and pitch beside those of its springs, as a part of weight times track, and of weight
        /// times wheelbase.
        tilt_moment_walk: f64 = 0.05, "1/√s";
        /// Standard deviation of these moments, as a part of them.
        tilt_moment_part: f64 = 1.2, "1";
        /// Standard deviation of the yaw rate, beside that of the sensors file.
        yaw_rate_sigma_rad_s: f64 = 0.002, "rad/s";
        /// Speed backwards from which a backward force drives and a forward force brakes.
        backward_m_s: f64 = 0.3, "m/s";
        /// Excess of an identified roll gain over 1 below which it tells nothing of the roll stiffness.
        roll_gain_min: f64 = 0.005, "1";
        /// Pneumatic trail at small slip angles, as a part of the radius of the tyre.
        trail_part: f64 = 0.09, "1";
        /// Time of the derivative of a wheel's speed, which gives the torque that spins it up.
        spin_time_s: f64 = 0.05, "s";
        /// Time of the mean of the upward acceleration, against which its unrest is measured, and of the unrest.
        unrest_time_s: f64 = 0.5, "s";
        /// Standard deviation of the specific force: sensor, and vibration of its mount.
        force_sigma_m_s2: f64 = 0.08, "m/s²";
        /// Standard deviation of the specific force by the tilt of the body, as a part of it.
        tilt_part: f64 = 0.015, "1";
        /// Standard deviation of the mass, as a part of it.
        mass_part: f64 = 0.01, "1";
        /// Standard deviation of the height of the centre of gravity, as a part of it: stated by the vehicle file,
        /// and guessed.
        height_part: [f64; 2] = [0.04, 0.15], "1";
        /// Standard deviation of the front axle's share of the roll moment: roll stiffness of the vehicle file, and
        /// guessed.
        roll_share: [f64; 2] = [0.05, 0.1], "1";
        /// Standard deviation of a wheel's share of the lateral force of its axle.
        lateral_share: f64 = 0.04, "1";
        /// Standard deviation of a lateral force by toe-in, camber and an axle that a differential locks, as a part of
        /// the static load.
        lateral_constant: f64 = 0.05, "1";
        /// The same by a steer angle whose part by Ackermann's geometry is unknown, for each rad.
        lateral_steered: f64 = 0.4, "1/rad";
        /// Standard deviation of a longitudinal force by rolling resistance, toe-in and a differential, as a part of the
        /// static load.
        longitudinal_constant: f64 = 0.04, "1";
        /// Camber against the ground, as a part of the roll angle, for the wheel-carrier frame: 1 where wheels lean with
        /// the body, 0 on a solid axle.
        camber_part: f64 = 0.6, "1";
        /// Standard deviation of this part.
        camber_part_sigma: f64 = 0.35, "1";
        /// Standard deviation of the camber at rest.
        camber_sigma_rad: f64 = 0.01, "rad";
        /// Standard deviation of the front axle's share of drive and brake force.
        drive_share: f64 = 0.1, "1";
        /// Standard deviation of a wheel's share of the longitudinal force of its axle.
        side_share: f64 = 0.05, "1";
        /// Standard deviation of a wheel torque, as a part of it, and a constant part as a part of the static load
        /// times the radius.
        torque_part: [f64; 2] = [0.03, 0.01], "1";
        /// Yaw moment of longitudinal forces that are not measured, as a part of the static load of the axle with
        /// the larger track times this track.
        unknown_moment_part: f64 = 0.006, "1";
        /// Standard deviation of a load by unrest of the body, times the mass on the wheel.
        unrest_gain: f64 = 1.5, "1";
        /// Standard deviation of a load without a measured upward acceleration, as a part of the static load.
        upward_unknown_part: f64 = 0.03, "1";
    }
}
