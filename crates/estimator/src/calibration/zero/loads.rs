//! What the vehicle file says of a corner at rest, hanging and on the ground.

use model::suspension::{
    ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, LinkedAxle, MemberForces,
    SuspensionError, TyreFrame, Wrench, ground_plane,
};
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};

use super::ZeroInput;
use crate::EstimatorError;
use crate::calibration::load_rig::RigLoad;
use crate::calibration::{CornerChannels, Resolved, SensitivityMatrix};
use crate::corners::{axle_channels, corner_of};
use crate::statics::AXIAL;

/// Error of what a matrix says of a hanging wheel, as a part of the static load: the loads of a rig compress the
/// strut, and the equation is linear.
const MATRIX_SIGMA: f64 = 0.012;

/// Loads that the model expects of a corner's channels.
pub(super) struct CornerLoads {
    /// Channels' values with the wheel hanging.
    pub(super) hanging: [f64; StrainChannel::COUNT],
    /// Channels' values on level ground.
    pub(super) standing: [f64; StrainChannel::COUNT],
    /// Standard deviation of the hanging values beyond that of the weights.
    pub(super) sigma: [f64; StrainChannel::COUNT],
    /// Compression from the design length, hanging and on the ground, m.
    pub(super) compression_m: [f64; 2],
}

impl CornerLoads {
    pub(super) fn new(
        input: &ZeroInput<'_>,
        resolved: &Resolved,
        wheel: Wheel,
    ) -> Result<Self, EstimatorError> {
        let vehicle = input.vehicle;
        let channels = &resolved.corners[wheel];
        check_is_known(vehicle, channels, wheel)?;
        let rack = |steering_wheel_rad: f64| {
            if wheel.is_front() {
                vehicle.steering.rack_m_rad.unwrap_or(0.0) * steering_wheel_rad
            } else {
                0.0
            }
        };
        let [hanging_rack_m, standing_rack_m] = input.steering_wheel_rad.map(rack);
        let arm_m = input.sensors.strain.bending_moment_per_ball_normal_m();
        let stance = Stance {
            vehicle,
            wheel,
            matrix: channels.matrix.as_ref(),
            moment_per_ball_normal_m: arm_m.unwrap_or(0.0),
        };
        let gravity = Vector3::from(input.specific_force_m_s2);
        let told = |error: SuspensionError| EstimatorError::Suspension(error.to_string());
        let hanging = (stance.at_rest(false, hanging_rack_m, gravity)).map_err(told)?;
        let level = Vector3::z() * STANDARD_GRAVITY_M_S2;
        let standing = (stance.at_rest(true, standing_rack_m, level)).map_err(told)?;
        Ok(Self {
            hanging: hanging.channels,
            standing: standing.channels,
            sigma: stance.sigma(input.weight_sigma),
            compression_m: [hanging.compression_m, standing.compression_m],
        })
    }
}

/// Refuses a corner with strain channels of which nothing tells what they measure.
fn check_is_known(
    vehicle: &Vehicle,
    channels: &CornerChannels,
    wheel: Wheel,
) -> Result<(), EstimatorError> {
    let axle = vehicle.axle(wheel);
    let is_known = axle.has_hard_points() || axle.is_solid() || channels.matrix.is_some();
    if is_known || channels.strain.iter().all(|channel| channel.dead) {
        return Ok(());
    }
    Err(EstimatorError::Suspension(format!(
        "the vehicle file has no hard-points of the {wheel} corner, so that nothing tells what its strain channels \
         read while the wheel hangs; do `calibrate load-rig` first, or add the hard-points"
    )))
}

/// How the body stands on its springs on level ground, by the vehicle file: roll (right side down)
/// and pitch (nose down) from the axes of the hard-points, rad. Zero where an axle has neither hard-points nor
/// struts: the axes of such a body are those in which it stands.
///
/// # Errors
/// Hard-points that are degenerate, springs that do not carry the vehicle.
pub fn rest_roll_pitch_rad(vehicle: &Vehicle) -> Result<[f64; 2], EstimatorError> {
    let told = |error: SuspensionError| EstimatorError::Suspension(error.to_string());
    let mut poses = Vec::new();
    for wheel in Wheel::ALL {
        let stance = Stance {
            vehicle,
            wheel,
            matrix: None,
            moment_per_ball_normal_m: 0.0,
        };
        let level = Vector3::z() * STANDARD_GRAVITY_M_S2;
        match stance.at_rest(true, 0.0, level) {
            Err(SuspensionError::Missing { .. }) => return Ok([0.0; 2]),
            rest => poses.push(rest.map_err(told)?.pose),
        }
    }
    let tyre = |wheel: Wheel| &vehicle.axle(wheel).tyre;
    let plane = ground_plane(
        &PerWheel::from_fn(|wheel| poses[wheel.index()]),
        &PerWheel::from_fn(|wheel| tyre(wheel).unloaded_radius_m),
        &PerWheel::from_fn(|wheel| {
            vehicle.static_load_n(wheel) / tyre(wheel).vertical_stiffness_n_m
        }),
        &PerWheel([1.0; 4]),
    );
    Ok(plane.map_or([0.0; 2], |plane| plane.body_roll_pitch_rad()))
}

/// A wheel of a vehicle at rest.
struct Stance<'a> {
    vehicle: &'a Vehicle,
    wheel: Wheel,
    matrix: Option<&'a SensitivityMatrix>,
    moment_per_ball_normal_m: f64,
}

/// Where a wheel is at rest, and what its strain channels measure.
struct AtRest {
    pose: CornerPose,
    channels: [f64; StrainChannel::COUNT],
    /// From the design length, m.
    compression_m: f64,
}

impl Stance<'_> {
    /// Standard deviation of the channels of a hanging wheel beyond that of the weights in proportion.
    fn sigma(&self, weight_sigma: f64) -> [f64; StrainChannel::COUNT] {
        let axle = self.vehicle.axle(self.wheel);
        let axial_n = if axle.is_solid() {
            // The links share what they carry by their stiffnesses, which the file does not tell: a quarter of the weight
            // is what one of four has.
            0.25 * weight_sigma * axle.unsprung_mass_kg() * STANDARD_GRAVITY_M_S2
        } else if self.matrix.is_some() {
            MATRIX_SIGMA * self.vehicle.static_load_n(self.wheel)
        } else {
            0.0
        };
        let mut sigma = [0.0; StrainChannel::COUNT];
        sigma[..AXIAL.len()].fill(axial_n);
        sigma
    }

    /// Hanging, or under the static load of the vehicle file.
    fn at_rest(
        &self,
        is_loaded: bool,
        rack_m: f64,
        specific_force_m_s2: Vector3<f64>,
    ) -> Result<AtRest, SuspensionError> {
        let (vehicle, wheel) = (self.vehicle, self.wheel);
        let axle = vehicle.axle(wheel);
        let corner = corner_of(vehicle, wheel, self.matrix)?;
        if axle.is_solid() {
            let load_n = [Wheel::RearLeft, Wheel::RearRight]
                .map(|wheel| f64::from(is_loaded) * vehicle.static_load_n(wheel));
            let side = usize::from(!wheel.is_left());
            let linked = LinkedAxle::of(vehicle)?;
            let rest = linked.at_rest(axle, load_n, specific_force_m_s2)?;
            let design = corner.pose(corner.design_strut_length_m(), 0.0)?;
            return Ok(AtRest {
                pose: CornerPose {
                    wheel_centre_m: rest.pose.point_m(linked.wheel_centres_m[side]),
                    spindle: rest.pose.spindle(),
                    ..design
                },
                channels: axle_channels(&rest, side),
                compression_m: linked.design_lengths_m()[side] - rest.pose.lengths_m[side],
            });
        }
        // A corner without hard-points has the angle of its wheel in the place of the rack.
        let rack_m = if corner.is_known() { rack_m } else { 0.0 };
        let (members, ball_normal_n, pose) = if is_loaded {
            standing(vehicle, &corner, rack_m)?
        } else {
            let hanging = corner.hanging(axle, rack_m, specific_force_m_s2)?;
            (hanging.members, hanging.ball_normal_n, hanging.pose)
        };
        let design_m = axle.strut.as_ref().map_or_else(
            || corner.design_strut_length_m(),
            |strut| strut.design_length_m,
        );
        let compression_m = design_m - pose.strut_length_m;
        let load = RigLoad {
            wheel,
            force_n: [
                0.0,
                0.0,
                f64::from(is_loaded) * vehicle.static_load_n(wheel),
            ],
            at_m: [0.0; 3],
            compression_m,
            steering_wheel_rad: 0.0,
            counts: Default::default(),
        };
        Ok(AtRest {
            channels: match self.matrix {
                Some(matrix) => std::array::from_fn(|i| matrix.response_n(i, vehicle, &load)),
                None => values(&members, ball_normal_n * self.moment_per_ball_normal_m),
            },
            pose,
            compression_m,
        })
    }
}

/// Members, ball-normal force and pose of a corner on level ground under its static load.
fn standing(
    vehicle: &Vehicle,
    corner: &Corner,
    rack_m: f64,
) -> Result<(MemberForces, f64, CornerPose), SuspensionError> {
    let wheel = corner.wheel;
    let axle = vehicle.axle(wheel);
    let load_n = vehicle.static_load_n(wheel);
    let (Some(strut), Some(unsprung)) = (&axle.strut, &axle.unsprung) else {
        return Err(SuspensionError::Missing {
            axle: if wheel.is_front() { "front" } else { "rear" },
            table: "strut",
        });
    };
    let motion = CornerMotion::at_rest(Vector3::z() * STANDARD_GRAVITY_M_S2);
    let wrench = Wrench {
        force_n: Vector3::z() * load_n,
        ..Wrench::default()
    };
    let mut length_m = corner.design_strut_length_m();
    for _ in 0..60 {
        let pose = corner.pose(length_m, rack_m)?;
        let compression_m = load_n / axle.tyre.vertical_stiffness_n_m;
        let radius_m = axle.tyre.unloaded_radius_m;
        let frame = TyreFrame::new(&pose, Vector3::z(), radius_m, compression_m);
        let statics =
            CornerStatics::new(corner, &pose, &frame, unsprung, &motion, ChannelKind::Strut)?;
        let members = statics.members(&wrench);
        let missing_n = members.sixth_n - strut.force(length_m, 0.0).total_n();
        let step_m = (-missing_n / strut.stiffness_at(length_m)).clamp(-0.01, 0.01);
        if step_m.abs() < 1e-7 {
            return Ok((members, statics.ball_normal_n(&members), pose));
        }
        length_m += step_m;
    }
    Err(SuspensionError::OutOfReach {
        what: "strut length on the ground",
        value: length_m,
        unit: "m",
    })
}

fn values(members: &MemberForces, moment_n_m: f64) -> [f64; StrainChannel::COUNT] {
    [
        members.upper_front_n,
        members.upper_rear_n,
        members.lower_front_n,
        members.lower_rear_n,
        members.tie_rod_n,
        moment_n_m,
        moment_n_m,
    ]
}
