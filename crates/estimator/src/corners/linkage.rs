//! One corner's linkage: its pose from the strut's length and the rack, and the map between members and
//! tyre in that pose.

use model::suspension::{
    BodyMotion, ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, SuspensionError,
    TyreFrame, WheelPath,
};
use model::vehicle::{Strut, Tyre, Unsprung, Vehicle};
use nalgebra::Vector3;
use sample::{LogTime, PerWheel, Wheel};

use super::length::LengthFilter;
use super::travel::{OnPath, Travel};
use super::{CornerState, KnownLinkage};
use crate::calibration::matrix::contact_height_m;
use crate::calibration::{CornerChannels, HubSensor, SensitivityMatrix};
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
    /// A new reading of the potentiometer as a length, m.
    pub(super) read: Option<Reading>,
    /// Length and rate that the force filter expects, if it runs.
    pub(super) moved: Option<[f64; 2]>,
    /// Whether the unsprung parts move along the wheel's path, or as on flat ground.
    pub(super) on_path: bool,
    pub(super) hub: Option<HubSensor>,
    pub(super) pose: CornerPose,
    pub(super) known: KnownLinkage,
    /// The matrix of its channels.
    pub(super) matrix: Option<SensitivityMatrix>,
    pub(super) fallback_load_n: f64,
}

impl Linkage {
    /// The linkage of a wheel; `None` if the vehicle file lacks a strut, unsprung masses, or hard-points and motion
    /// ratio.
    pub(super) fn new(
        vehicle: &Vehicle,
        wheel: Wheel,
        channels: &PerWheel<CornerChannels>,
        tuning: &Tuning,
    ) -> Result<Option<Self>, SuspensionError> {
        let deflection_sigma_m = channels[Wheel::FrontLeft].deflection.noise_sigma;
        let matrix = channels[wheel].matrix;
        let axle = vehicle.axle(wheel);
        let (Some(strut), Some(unsprung)) = (&axle.strut, &axle.unsprung) else {
            return Ok(None);
        };
        let corner = match corner_of(vehicle, wheel, matrix.as_ref()) {
            Err(SuspensionError::Missing { .. }) => return Ok(None),
            found => found?,
        };
        let pose = corner.pose(corner.design_strut_length_m(), 0.0)?;
        Ok(Some(Self {
            tuning: tuning.corners,
            read: None,
            length: LengthFilter::new(corner.design_strut_length_m(), deflection_sigma_m, tuning),
            moved: None,
            on_path: false,
            hub: None,
            known: match (axle.is_solid(), corner.is_known()) {
                (true, _) => KnownLinkage::LiveAxle,
                (false, true) => KnownLinkage::Corner,
                (false, false) => KnownLinkage::None,
            },
            matrix,
            corner,
            strut: strut.clone(),
            unsprung: unsprung.clone(),
            radius_m: axle.tyre.unloaded_radius_m,
            tyre_stiffness_n_m: axle.tyre.vertical_stiffness_n_m.max(1.0),
            pose,
            fallback_load_n: vehicle.static_load_n(wheel),
        }))
    }

    /// The same linkage under a vehicle whose mass properties have changed.
    pub(super) fn load(&mut self, vehicle: &Vehicle, wheel: Wheel) -> Result<(), SuspensionError> {
        if self.known == KnownLinkage::Corner {
            self.corner = Corner::of(vehicle, wheel)?;
        } else if let Some(corner) = straight(vehicle, wheel, self.matrix.as_ref()) {
            self.corner = corner;
        }
        self.fallback_load_n = vehicle.static_load_n(wheel);
        Ok(())
    }

    /// The same linkage on another tyre.
    pub(super) fn load_tyre(&mut self, tyre: &Tyre) {
        self.radius_m = tyre.unloaded_radius_m;
        self.tyre_stiffness_n_m = tyre.vertical_stiffness_n_m.max(1.0);
    }

    /// Rate of the strut's length, m/s.
    pub(super) fn rate_m_s(&self) -> f64 {
        self.moved.unwrap_or_else(|| self.length.value())[1]
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
        self.read = None;
        if let Some(reading) = reading
            && !reading.taken
        {
            reading.taken = true;
            let length_m = self.corner.design_strut_length_m() - reading.value;
            self.length.update(now, reading.time, length_m);
            self.read = Some(Reading {
                value: length_m,
                ..*reading
            });
        }
        let rack = if self.corner.wheel.is_front() {
            rack_m
        } else {
            0.0
        };
        self.moved = belief.moved;
        let known = self.length.known(now).then(|| self.length.value());
        let [length_m, _] = (self.moved.or(known)).unwrap_or([self.pose.strut_length_m, 0.0]);
        // Length out of reach: the linkage keeps its pose.
        if let Ok(pose) = self.corner.pose(length_m, rack) {
            self.pose = pose;
        }
    }

    /// Places the linkage at another travel of its rack. A travel out of reach changes nothing.
    pub(super) fn move_rack(&mut self, rack_m: f64) {
        if let Ok(pose) = self.corner.pose(self.pose.strut_length_m, rack_m) {
            self.pose = pose;
        }
    }

    /// The force uses the measured spring length, the pose the hard-points: a hard-point error of 1
    /// mm must not become 65 N.
    pub(super) fn design_shift_m(&self) -> f64 {
        self.strut.design_length_m - self.corner.design_strut_length_m()
    }

    /// What the strut of the vehicle file pushes too much by the loads of the matrix, N.
    pub(super) fn strut_offset_n(&self) -> f64 {
        let strut = self.matrix.and_then(|matrix| matrix.strut);
        strut.map_or(0.0, |strut| strut.offset_n)
    }

    /// Standard deviations of the parts of F_x, F_y, F_z that the strut carries, if no hard-points tell them.
    fn strut_part_sigma(&self, compression_m: f64) -> [f64; 3] {
        let Some(matrix) = self.matrix.filter(|_| !self.corner.is_known()) else {
            return [0.0; 3];
        };
        let Some(strut) = &matrix.strut else {
            return [0.0, 0.0, self.tuning.unknown_strut_part];
        };
        let more_m = compression_m - matrix.compression_m;
        std::array::from_fn(|axis| {
            math::hypot(
                strut.part_sigma[axis],
                more_m * strut.change_per_m_sigma[axis],
            )
        })
    }

    /// Standard deviations of heading and inclination of the wheel against the body, rad.
    fn unknown_rad(&self) -> [f64; 2] {
        let turns = self.matrix.and_then(|matrix| matrix.strut).is_some();
        let [heading, inclination] = self.tuning.unknown_rad;
        match (self.known, turns) {
            (KnownLinkage::None, false) => [heading, inclination],
            // The loads tell how the wheel turns with the strut, but not how it stands in the design position.
            (KnownLinkage::None, true) => [heading, self.tuning.unknown_design_rad],
            _ => [0.0; 2],
        }
    }

    /// Standard deviation of the strut's force near a length and a rate, N; infinite while no deflection is measured.
    fn strut_sigma_n(&self, stiffness_n_m: f64, damping_n_s_m: f64) -> f64 {
        self.length
            .force_variance(stiffness_n_m, damping_n_s_m)
            .map_or(f64::INFINITY, |variance| {
                (variance + self.tuning.strut_sigma_n.powi(2)).sqrt()
            })
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
        let [length, rate] = self.moved.unwrap_or_else(|| self.length.value());
        let pose = &self.pose;
        let frame = TyreFrame::new(
            pose,
            normal,
            self.radius_m,
            load_n / self.tyre_stiffness_n_m,
        );
        let OnPath {
            motion,
            statics,
            travel,
        } = if self.on_path {
            self.on_path(body, &frame, [rate, rack[0], rack[1]], spin)?
        } else {
            let mut motion = CornerMotion::on_body(&self.corner, pose, body, rate, rack);
            if load_n > self.tuning.contact_n[0] {
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
            OnPath {
                motion,
                statics,
                travel: Travel::default(),
            }
        };
        let length = length + self.design_shift_m();
        let damping = self.strut.damping_at(rate);
        let compression_m = self.corner.design_strut_length_m() - pose.strut_length_m;
        Ok(CornerState {
            pose: *pose,
            frame,
            statics,
            travel,
            compression_m,
            strut_part_sigma: self.strut_part_sigma(compression_m),
            matrix_axes: self.matrix.map(|matrix| matrix.axes),
            unknown_rad: self.unknown_rad(),
            length_read: self.read,
            strut_n: self.strut.force(length, rate).total_n() - self.strut_offset_n(),
            strut_sigma_n: self.strut_sigma_n(self.strut.stiffness_at(length), damping),
            spin_rad_s: spin,
            spin_dot_rad_s2: spin_dot,
            travel_m_s: motion.wheel_travel_m_s,
            turn_rad_s: motion.upright_rate_rad_s - body.rate_rad_s,
            linkage: self.known,
        })
    }
}

/// The corner of a wheel by its hard-points; without them by the strut of its matrix, or by its motion ratio.
///
/// # Errors
/// When the vehicle file has neither hard-points nor a motion ratio, or hard-points that are degenerate.
pub fn corner_of(
    vehicle: &Vehicle,
    wheel: Wheel,
    matrix: Option<&SensitivityMatrix>,
) -> Result<Corner, SuspensionError> {
    if vehicle.axle(wheel).has_hard_points() {
        return Corner::of(vehicle, wheel);
    }
    straight(vehicle, wheel, matrix).ok_or(SuspensionError::Missing {
        axle: if wheel.is_front() { "front" } else { "rear" },
        table: "strut.motion_ratio",
    })
}

/// The corner of an axle without hard-points. The wheel moves as the strut's row of the matrix tells, else as the
/// vehicle file does. By virtual work, the strut's force for a force on the wheel is the movement of the point of
/// application for a shorter strut, and that for a moment is the turn of the upright.
fn straight(vehicle: &Vehicle, wheel: Wheel, matrix: Option<&SensitivityMatrix>) -> Option<Corner> {
    let Some((matrix, strut)) = matrix.and_then(|matrix| Some((matrix, matrix.strut?))) else {
        return Corner::straight(vehicle, wheel);
    };
    let [part, change, turn] = [strut.part, strut.change_per_m, strut.per_m].map(Vector3::from);
    let height_m = (matrix.contact_height_m).unwrap_or_else(|| contact_height_m(vehicle, wheel));
    // F_y acts at the contact point, and F_x at the wheel centre.
    let turning = Vector3::from(strut.moment_change_per_m);
    let at_centre = Vector3::y() * ((turn.x - turning.x * matrix.compression_m) * height_m);
    let path = WheelPath {
        travel: change * matrix.compression_m - part + at_centre,
        bend: change - Vector3::y() * (turning.x * height_m),
        turn: turning * matrix.compression_m - turn,
        turn_bend: turning,
    };
    Corner::along(vehicle, wheel, path)
}
