//! All four corners at one row of a truth run, with any one term of the statics left out.

use atvrec_model::suspension::{
    BodyMotion, ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, MemberForces,
    TyreFrame, Wrench, ground_plane, inboard_excess_n,
};
use atvrec_model::vehicle::{Axle, Vehicle};
use nalgebra::Vector3;
use sample::{PerWheel, Wheel};
use testkit::truth::vehicle;

use super::run::Run;

pub const STRIDE: usize = 41;
/// Gravity of the simulator, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.81;
/// A wheel under this load does not help to find the ground, N.
pub const FIRM_LOAD_N: f64 = 60.0;

/// One term of the statics that a method could neglect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOut {
    Nothing,
    Inertia,
    Mass,
    ArmMass,
    Damper,
    Stops,
    TieRod,
    BodyAttitude,
    FrozenGeometry,
    ReadInboard,
}

pub fn axle(vehicle: &Vehicle, wheel: Wheel) -> &Axle {
    if wheel.is_front() {
        &vehicle.front
    } else {
        &vehicle.rear
    }
}

/// All corners of one row.
pub struct Instant<'a> {
    vehicle: &'a Vehicle,
    corners: &'a PerWheel<Corner>,
    run: &'a Run,
    row: usize,
    pub poses: PerWheel<CornerPose>,
    pub normal: Vector3<f64>,
    body: BodyMotion,
}

impl<'a> Instant<'a> {
    pub fn new(
        vehicle: &'a Vehicle,
        corners: &'a PerWheel<Corner>,
        run: &'a Run,
        row: usize,
        left_out: LeftOut,
    ) -> Option<Self> {
        let at = |wheel: Wheel, name: &str| run.get(&format!("{wheel}_{name}"), row);
        let poses = PerWheel::from_fn(|wheel| {
            let corner = &corners[wheel];
            let rack = if wheel.is_front() {
                run.get("rack", row)
            } else {
                0.0
            };
            let length = if left_out == LeftOut::FrozenGeometry {
                corner.design_strut_length_m()
            } else {
                at(wheel, "spring_len")
            };
            corner.pose(length, rack).expect("within reach")
        });
        let normal = if left_out == LeftOut::BodyAttitude {
            Vector3::z()
        } else {
            ground_plane(
                &poses,
                &PerWheel::from_fn(|wheel| axle(vehicle, wheel).tyre.unloaded_radius_m),
                &PerWheel::from_fn(|wheel| at(wheel, "tyre_defl")),
                &PerWheel::from_fn(|wheel| f64::from(u8::from(at(wheel, "Fz") > FIRM_LOAD_N))),
            )?
            .normal
        };
        Some(Self {
            vehicle,
            corners,
            run,
            row,
            poses,
            normal,
            body: BodyMotion {
                specific_force_m_s2: run.vector("f", "_body", row),
                reference_m: Vector3::new(0.0, 0.0, vehicle.body.cg_height_m),
                rate_rad_s: Vector3::new(run.get("p", row), run.get("q", row), run.get("r", row)),
                rate_dot_rad_s2: Vector3::new(
                    run.get("pdot", row),
                    run.get("qdot", row),
                    run.get("rdot", row),
                ),
            },
        })
    }

    pub fn at(&self, wheel: Wheel, name: &str) -> f64 {
        self.run.get(&format!("{wheel}_{name}"), self.row)
    }

    pub fn frame(&self, wheel: Wheel) -> TyreFrame {
        TyreFrame::new(
            &self.poses[wheel],
            self.normal,
            axle(self.vehicle, wheel).tyre.unloaded_radius_m,
            self.at(wheel, "tyre_defl"),
        )
    }

    /// Rate and acceleration of the rack, which moves the front wheels alone.
    fn rack(&self, wheel: Wheel) -> [f64; 2] {
        if wheel.is_front() {
            [
                self.run.slope("rack", self.row),
                self.run.bend("rack", self.row),
            ]
        } else {
            [0.0; 2]
        }
    }

    pub fn motion(&self, wheel: Wheel, left_out: LeftOut) -> CornerMotion {
        let (corner, pose) = (&self.corners[wheel], &self.poses[wheel]);
        if left_out == LeftOut::Inertia {
            return CornerMotion {
                axle_torque_n_m: self.at(wheel, "Tdrive"),
                ..CornerMotion::at_rest(self.normal * GRAVITY_M_S2)
            };
        }
        let rate = self.at(wheel, "shock_vel");
        let mut motion = CornerMotion::on_body(corner, pose, &self.body, rate, self.rack(wheel));
        if self.at(wheel, "Fz") > FIRM_LOAD_N {
            motion = motion.on_ground(corner, pose, self.normal, GRAVITY_M_S2);
        }
        let name = format!("{wheel}_omega");
        motion.spin_rad_s = self.at(wheel, "omega");
        motion.spin_dot_rad_s2 = self.run.slope(&name, self.row);
        motion.axle_torque_n_m = self.at(wheel, "Tdrive");
        motion
    }

    pub fn statics(&self, wheel: Wheel, sixth: ChannelKind, left_out: LeftOut) -> CornerStatics {
        let mut unsprung = axle(self.vehicle, wheel).unsprung.clone().expect("masses");
        if matches!(left_out, LeftOut::Mass | LeftOut::ArmMass) {
            unsprung.upper_arm_mass_kg = 0.0;
            unsprung.lower_arm_mass_kg = 0.0;
        }
        if left_out == LeftOut::Mass {
            unsprung.wheel_mass_kg = 0.0;
            unsprung.upright_mass_kg = 0.0;
        }
        CornerStatics::new(
            &self.corners[wheel],
            &self.poses[wheel],
            &self.frame(wheel),
            &unsprung,
            &self.motion(wheel, left_out),
            sixth,
        )
        .expect("a sound linkage")
    }

    pub fn members(&self, wheel: Wheel, left_out: LeftOut) -> MemberForces {
        let strut = axle(self.vehicle, wheel).strut.as_ref().expect("a strut");
        let mut force = strut.force(self.at(wheel, "spring_len"), self.at(wheel, "shock_vel"));
        match left_out {
            LeftOut::Damper => force.damper_n = 0.0,
            LeftOut::Stops => force.stop_n = 0.0,
            _ => {}
        }
        let excess = if left_out == LeftOut::ReadInboard {
            inboard_excess_n(
                &self.corners[wheel],
                &self.poses[wheel],
                axle(self.vehicle, wheel).unsprung.as_ref().expect("masses"),
                &self.motion(wheel, left_out),
                force.total_n(),
            )
        } else {
            [0.0; 2]
        };
        MemberForces {
            upper_front_n: self.at(wheel, "UCA_tubeF_T"),
            upper_rear_n: self.at(wheel, "UCA_tubeB_T"),
            lower_front_n: self.at(wheel, "LCA_tubeF_T") + excess[0],
            lower_rear_n: self.at(wheel, "LCA_tubeB_T") + excess[1],
            tie_rod_n: if left_out == LeftOut::TieRod {
                0.0
            } else {
                self.at(wheel, "tierod_T")
            },
            sixth_n: force.total_n(),
        }
    }

    pub fn truth(&self, wheel: Wheel) -> Wrench {
        Wrench {
            force_n: self.run.vector(&format!("{wheel}_F"), "", self.row),
            moment_n_m: self.run.vector(&format!("{wheel}_M"), "", self.row),
        }
    }
}

pub fn set_up(name: &str) -> Option<(&'static Vehicle, PerWheel<Corner>, Run)> {
    let vehicle = vehicle();
    let corners = PerWheel::from_fn(|wheel| Corner::of(vehicle, wheel).expect("hard-points"));
    Some((vehicle, corners, Run::open(name, STRIDE)?))
}
