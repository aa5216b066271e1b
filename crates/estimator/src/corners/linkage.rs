//! One corner's linkage: its pose from the strut's length and the rack, and the map between members and
//! tyre in that pose.

use model::suspension::{
    BodyMotion, ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, SuspensionError,
    TyreFrame,
};
use model::vehicle::{Strut, Unsprung, Vehicle};
use nalgebra::Vector3;
use sample::{LogTime, Wheel};

use super::length::LengthFilter;
use super::{CornerState, StrutReading};
use crate::feedback::StrutEstimate;
use crate::inputs::Reading;
use crate::tuning::{CornerTuning, Tuning};

/// Linkage of a corner with its strut and the filter of the strut's length.
#[derive(Clone, Debug)]
pub(super) struct Linkage {
    pub(super) tuning: CornerTuning,
    pub(super) corner: Corner,
    pub(super) strut: Strut,
    pub(super) unsprung: Unsprung,
    pub(super) radius_m: f64,
    pub(super) tyre_stiffness_n_m: f64,
    pub(super) length: LengthFilter,
    pub(super) stands_at_m: f64,
    pub(super) pose: CornerPose,
    pub(super) fallback_load_n: f64,
}

impl Linkage {
    /// The linkage of a wheel; `None` if the vehicle file lacks hard-points, a strut or unsprung masses.
    pub(super) fn new(
        vehicle: &Vehicle,
        wheel: Wheel,
        deflection_sigma_m: f64,
        tuning: &Tuning,
    ) -> Result<Option<Self>, SuspensionError> {
        let axle = vehicle.axle(wheel);
        let (Some(strut), Some(unsprung), true) =
            (&axle.strut, &axle.unsprung, axle.wishbone.is_some())
        else {
            return Ok(None);
        };
        let corner = Corner::of(vehicle, wheel)?;
        let pose = corner.pose(corner.design_strut_length_m(), 0.0)?;
        Ok(Some(Self {
            tuning: tuning.corners,
            length: LengthFilter::new(corner.design_strut_length_m(), deflection_sigma_m, tuning),
            stands_at_m: corner.design_strut_length_m(),
            corner,
            strut: strut.clone(),
            unsprung: unsprung.clone(),
            radius_m: axle.tyre.unloaded_radius_m,
            tyre_stiffness_n_m: axle.tyre.vertical_stiffness_n_m.max(1.0),
            pose,
            fallback_load_n: vehicle.static_load_n(wheel),
        }))
    }

    /// Takes a reading of the potentiometer and places the linkage at `now`, `dt` after the last call.
    pub(super) fn measure(
        &mut self,
        now: LogTime,
        dt: f64,
        rack_m: f64,
        reading: &mut Option<Reading>,
        belief: StrutEstimate,
    ) {
        self.length.predict(dt);
        self.length.jolt(belief.jolt_m_s2);
        if let Some(reading) = reading
            && !reading.taken
        {
            reading.taken = true;
            let design = self.corner.design_strut_length_m();
            self.length
                .update(now, reading.time, design - reading.value);
        }
        let rack = if self.corner.wheel.is_front() {
            rack_m
        } else {
            0.0
        };
        if self.length.known(now) {
            self.stands_at_m = self.length.value()[0] + belief.longer_m;
        } else if let Some(force) = belief.force_n.filter(|force| force.is_finite()) {
            self.stands_at_m += self.step_to_force(force);
        }
        // Length out of reach: the linkage keeps its pose.
        if let Ok(pose) = self.corner.pose(self.stands_at_m, rack) {
            self.pose = pose;
        }
    }

    /// Without a potentiometer the spring force determines the length. Part of the way to it, m:
    /// the damper's share of the force is unknown.
    fn step_to_force(&self, force_n: f64) -> f64 {
        let length = self.stands_at_m + self.design_shift_m();
        let surplus = self.strut.force(length, 0.0).total_n() - force_n;
        let step = self.tuning.forced_part * surplus / self.strut.stiffness_at(length);
        let most = self.tuning.forced_step_max_m;
        step.clamp(-most, most)
    }

    /// The force uses the measured spring length, the pose the hard-points: a hard-point error of 1
    /// mm must not become 65 N.
    fn design_shift_m(&self) -> f64 {
        self.strut.design_length_m - self.corner.design_strut_length_m()
    }

    /// The corner in the present pose. `rack`: its rate and acceleration; `rolling`: spin and its rate, gravity along the normal.
    pub(super) fn state(
        &self,
        normal: Vector3<f64>,
        body: &BodyMotion,
        rack: [f64; 2],
        rolling: [f64; 3],
        load_n: f64,
    ) -> Result<CornerState, SuspensionError> {
        let [spin, spin_dot, gravity] = rolling;
        let [length, rate] = self.length.value();
        let length = length + self.design_shift_m();
        let pose = &self.pose;
        let frame = TyreFrame::new(
            pose,
            normal,
            self.radius_m,
            load_n / self.tyre_stiffness_n_m,
        );
        let mut motion = CornerMotion::on_body(&self.corner, pose, body, rate, rack);
        if load_n > self.tuning.contact_n {
            motion = motion.on_ground(&self.corner, pose, normal, gravity);
        }
        motion.spin_rad_s = spin;
        motion.spin_dot_rad_s2 = spin_dot;
        let statics = CornerStatics::new(
            &self.corner,
            pose,
            &frame,
            &self.unsprung,
            &motion,
            ChannelKind::Strut,
        )?;
        let stiffness = self.strut.stiffness_at(length);
        let damping = self.strut.damping_n_s_m;
        let strut_n = self.strut.force(length, rate).total_n();
        let strut_read = self.length.reading().map(|read| {
            let spring = stiffness * stiffness * read.variance;
            let damper = self.tuning.rate_correlation * damping * damping * read.rate_variance;
            let variance = spring + damper + self.tuning.reading_sigma_n.powi(2);
            StrutReading {
                force_n: strut_n - stiffness * read.longer_m,
                sigma_n: variance.sqrt(),
            }
        });
        Ok(CornerState {
            pose: *pose,
            frame,
            statics,
            strut_stiffness_n_m: stiffness,
            strut_jumped: self.length.jumped(),
            strut_n,
            strut_read,
            strut_sigma_n: self
                .length
                .force_variance(stiffness, damping)
                .map_or(f64::INFINITY, |variance| {
                    (variance + self.tuning.strut_sigma_n.powi(2)).sqrt()
                }),
            spin_rad_s: spin,
            spin_dot_rad_s2: spin_dot,
            travel_m_s: motion.wheel_travel_m_s,
            turn_rad_s: motion.upright_rate_rad_s - body.rate_rad_s,
        })
    }
}
