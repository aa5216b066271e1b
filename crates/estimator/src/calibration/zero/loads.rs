//! What the vehicle file says of a corner at rest, hanging and on the ground.

use model::suspension::{
    ChannelKind, Corner, CornerMotion, CornerStatics, MemberForces, SuspensionError, TyreFrame,
    Wrench, ground_plane,
};
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, StrainChannel, Wheel};

use super::ZeroInput;
use crate::EstimatorError;

/// Loads that the model expects of a corner's channels.
pub(super) struct CornerLoads {
    /// Channels' values with the wheel hanging.
    pub(super) hanging: [f64; StrainChannel::COUNT],
    /// Channels' values on level ground.
    pub(super) standing: [f64; StrainChannel::COUNT],
    /// Compression from the design length, hanging and on the ground, m.
    pub(super) compression_m: [f64; 2],
}

impl CornerLoads {
    pub(super) fn new(input: &ZeroInput<'_>, wheel: Wheel) -> Result<Self, EstimatorError> {
        let told = |error: SuspensionError| EstimatorError::Suspension(error.to_string());
        let vehicle = input.vehicle;
        let axle = vehicle.axle(wheel);
        let corner = Corner::of(vehicle, wheel).map_err(told)?;
        let rack = |steering_wheel_rad: f64| {
            if wheel.is_front() {
                vehicle.steering.rack_m_rad.unwrap_or(0.0) * steering_wheel_rad
            } else {
                0.0
            }
        };
        let gravity = Vector3::from(input.specific_force_m_s2);
        let hanging = corner
            .hanging(axle, rack(input.steering_wheel_rad[0]), gravity)
            .map_err(told)?;
        let arm_m = input
            .sensors
            .strain
            .bending_moment_per_ball_normal_m()
            .unwrap_or(0.0);
        let standing =
            standing(vehicle, &corner, rack(input.steering_wheel_rad[1])).map_err(told)?;
        let design_m = axle.strut.as_ref().map_or_else(
            || corner.design_strut_length_m(),
            |strut| strut.design_length_m,
        );
        Ok(Self {
            hanging: values(&hanging.members, hanging.ball_normal_n * arm_m),
            standing: values(&standing.0, standing.1 * arm_m),
            compression_m: [
                design_m - hanging.pose.strut_length_m,
                design_m - standing.2,
            ],
        })
    }
}

/// How the body stands on its springs on level ground, by the vehicle file: roll (right side down)
/// and pitch (nose down) from the axes of the hard-points, rad.
///
/// # Errors
/// A vehicle without linkage.
pub fn rest_roll_pitch_rad(vehicle: &Vehicle) -> Result<[f64; 2], EstimatorError> {
    let told = |error: SuspensionError| EstimatorError::Suspension(error.to_string());
    let mut poses = Vec::new();
    for wheel in Wheel::ALL {
        let corner = Corner::of(vehicle, wheel).map_err(told)?;
        let length_m = standing(vehicle, &corner, 0.0).map_err(told)?.2;
        poses.push(corner.pose(length_m, 0.0).map_err(told)?);
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

/// Members, ball-normal force and strut length of a corner on level ground under its static load.
fn standing(
    vehicle: &Vehicle,
    corner: &Corner,
    rack_m: f64,
) -> Result<(MemberForces, f64, f64), SuspensionError> {
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
            return Ok((members, statics.ball_normal_n(&members), length_m));
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
