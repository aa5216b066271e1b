//! What moves the linkages: struts, steering wheel, and sensors at the front wheels.

use model::steering::SteeringGear;
use model::vehicle::Vehicle;
use sample::{LogTime, PerWheel, Wheel};

use super::Corners;
use super::toe::RackStep;
use crate::EstimatorError;
use crate::calibration::{CornerChannels, wheel_key};
use crate::feedback::EstimatorFeedback;
use crate::inputs::Readings;

impl Corners {
    /// Moves the linkages by struts, steering wheel and sensors at the wheels. Returns rate and acceleration of the
    /// rack.
    pub(super) fn move_linkages(
        &mut self,
        now: LogTime,
        dt: f64,
        readings: &mut Readings,
        feedback: &EstimatorFeedback,
        steering_offset_rad: f64,
    ) -> [f64; 2] {
        let of_wheel = &self.tuning.steering_wheel;
        if let Some(reading) = readings.steering_wheel_rad {
            self.steering_wheel
                .follow(reading.value, of_wheel.angle_keep, dt);
            self.turning.follow(reading.value, of_wheel.rate_keep, dt);
        }
        let angle_rad = self.steering_wheel.angle_rad + steering_offset_rad;
        let rack = angle_rad * self.rack_m_rad;
        let rack_motion = self.turning.motion(self.rack_m_rad, of_wheel);
        for (i, linkage) in self.linkages.iter_mut().enumerate() {
            let compression = &mut readings.corners.0[i].compression_m;
            // The second coordinate of a linkage that is not known is its steer angle.
            let rack = match (i, &self.gear) {
                (0, Some(gear)) => gear.left.at(angle_rad),
                (1, Some(gear)) => gear.right.at(angle_rad),
                _ => rack,
            };
            linkage.measure(now, dt, rack, compression, feedback.struts[i]);
        }
        let front = RackStep {
            now,
            fresh_s: self.fresh_s,
            travel_m: rack,
            correction_m: steering_offset_rad * self.rack_m_rad,
            speed_m_s: rack_motion[0],
        };
        // An axle without hard-points has no rack: its wheels steer as its calibration says.
        let sides = if self.gear.is_none() { 2 } else { 0 };
        for (side, linkage) in self.linkages[..sides].iter_mut().enumerate() {
            let reading = &mut readings.wheel_angle_rad[side];
            let lateral_n = feedback.forces.0[side].force_n[1];
            (self.toe).turn(side, linkage, front, reading, lateral_n, of_wheel);
        }
        rack_motion
    }
}

/// Whether hard-points, a live axle or a matrix describe a wheel at least.
///
/// # Errors
/// A matrix of a wheel of a live axle.
pub(super) fn is_described(
    vehicle: &Vehicle,
    channels: &PerWheel<CornerChannels>,
) -> Result<bool, EstimatorError> {
    let has_matrix = |wheel: Wheel| channels[wheel].matrix.is_some();
    let is_live = |wheel: Wheel| vehicle.axle(wheel).is_solid();
    let mut wheels = Wheel::ALL.into_iter();
    if let Some(wheel) = wheels.find(|wheel| has_matrix(*wheel) && is_live(*wheel)) {
        let wheel = wheel_key(wheel);
        return Err(EstimatorError::MatrixOnLiveAxle { wheel });
    }
    Ok(Wheel::ALL
        .into_iter()
        .any(|wheel| vehicle.axle(wheel).has_hard_points() || is_live(wheel) || has_matrix(wheel)))
}

/// Steer angles of front wheels that have a matrix and no hard-points.
pub(super) fn gear(
    vehicle: &Vehicle,
    channels: &PerWheel<CornerChannels>,
) -> Result<Option<SteeringGear>, EstimatorError> {
    let has_matrix = channels[Wheel::FrontLeft].matrix.is_some();
    (has_matrix && !vehicle.front.has_hard_points())
        .then(|| SteeringGear::from_vehicle(vehicle).map_err(EstimatorError::from))
        .transpose()
}
