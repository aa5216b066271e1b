//! Steer angle of each front wheel beside the one that rack and linkage give: as a sensor at the wheel measures it,
//! otherwise by the toe compliance and the play of the vehicle file or of the calibration (thesis, section 5.2.5).

use model::steering::Toe;
use sample::LogTime;

use super::linkage::Linkage;
use crate::inputs::Reading;
use crate::tuning::SteeringWheelTuning;

/// A step, with the rack as the steering wheel gives it.
#[derive(Clone, Copy, Debug)]
pub(super) struct RackStep {
    /// Instant.
    pub(super) now: LogTime,
    /// Largest age of a reading, s.
    pub(super) fresh_s: f64,
    /// Travel, m, left positive.
    pub(super) travel_m: f64,
    /// The part of the travel by which the estimator corrects the zero of the steering wheel, m.
    pub(super) correction_m: f64,
    /// Speed, m/s.
    pub(super) speed_m_s: f64,
}

/// Differences of the front wheels, left and right.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ToeFilter {
    toe: Toe,
    /// Steer angle beside that of rack and linkage, rad, left positive.
    angle_rad: [f64; 2],
}

impl ToeFilter {
    pub(super) fn new(toe: Toe) -> Self {
        Self {
            toe,
            ..Self::default()
        }
    }

    /// Turns a front wheel (0 left, 1 right), whose linkage stands as the rack gives it, by its difference.
    ///
    /// The zero of the steering wheel, which the estimator corrects, is that of both front wheels: a sensor at the wheel
    /// replaces the kinematics, and the correction is kept.
    pub(super) fn turn(
        &mut self,
        side: usize,
        linkage: &mut Linkage,
        rack: RackStep,
        reading: &mut Option<Reading>,
        lateral_n: f64,
        tuning: &SteeringWheelTuning,
    ) {
        if reading.is_none() && self.toe.is_rigid() {
            return;
        }
        let per_rack = linkage.corner.rates(&linkage.pose).rack.rotation.z;
        let steer_rad = linkage.pose.steer_rad();
        let measured = reading
            .as_mut()
            .filter(|reading| rack.now.seconds_since(reading.time) <= rack.fresh_s)
            .and_then(|reading| {
                let age_s = rack.now.seconds_since(reading.time);
                let beside_m = rack.correction_m + rack.speed_m_s * age_s;
                let difference = reading.value - (steer_rad - per_rack * beside_m);
                let is_new = !std::mem::replace(&mut reading.taken, true);
                (difference.abs() <= tuning.toe_max_rad).then_some((difference, is_new))
            });
        let force_n = if lateral_n.is_finite() {
            lateral_n
        } else {
            0.0
        };
        let (target, is_new) =
            measured.unwrap_or_else(|| (self.toe.angle_rad(side, force_n), true));
        let angle = &mut self.angle_rad[side];
        if is_new {
            *angle += (1.0 - tuning.toe_keep) * (target - *angle);
        }
        if per_rack.abs() > f64::EPSILON {
            linkage.move_rack(rack.travel_m + *angle / per_rack);
        }
    }
}
