//! The MacPherson struts of the second vehicle of the independent simulator. Its arms have bushings, so that
//! poses and forces differ by what these give.

use atvrec_model::suspension::linkage::Coordinates;
use atvrec_model::suspension::{
    BodyMotion, ChannelKind, Corner, CornerMotion, CornerStatics, MemberForces, TyreFrame,
};
use atvrec_model::vehicle::Vehicle;
use nalgebra::{Matrix3, Vector3};
use sample::{Wheel, WheelAxes};
use testkit::truth::Run;

/// Rate of the truth files of the second vehicle, Hz.
const RATE_HZ: f64 = 100.0;
/// Static load of a front wheel, N.
const STATIC_N: f64 = 3750.0;

/// The front axle is that of the simulator, the rear axle is not.
fn vehicle() -> Vehicle {
    let text = include_str!("../../../../../testdata/vehicle-with-struts.toml");
    Vehicle::from_toml(text, "vehicle-with-struts.toml").expect("a vehicle")
}

/// One front corner at one row.
struct Row<'a> {
    run: &'a Run,
    wheel: Wheel,
    row: usize,
}

impl Row<'_> {
    fn get(&self, name: &str) -> f64 {
        self.run.column(name)[self.row]
    }

    fn at(&self, name: &str) -> f64 {
        self.get(&format!("{}_{name}", self.wheel))
    }

    fn vector(&self, name: &str) -> Vector3<f64> {
        Vector3::from(["x", "y", "z"].map(|axis| self.at(&format!("{name}{axis}"))))
    }

    fn near(&self, name: &str) -> [f64; 3] {
        let values = self.run.column(name);
        [values[self.row - 1], values[self.row], values[self.row + 1]]
    }

    fn slope(&self, name: &str) -> f64 {
        let [before, _, after] = self.near(name);
        (after - before) * RATE_HZ / 2.0
    }

    fn bend(&self, name: &str) -> f64 {
        let [before, now, after] = self.near(name);
        (after - 2.0 * now + before) * RATE_HZ * RATE_HZ
    }

    fn statics(&self, vehicle: &Vehicle, corner: &Corner) -> CornerStatics {
        let pose = corner
            .pose(self.at("spring_len"), self.get("rack"))
            .expect("within reach");
        let body = BodyMotion {
            specific_force_m_s2: Vector3::from(
                ["fx_body", "fy_body", "fz_body"].map(|n| self.get(n)),
            ),
            reference_m: Vector3::z() * vehicle.body.cg_height_m,
            rate_rad_s: Vector3::from(["p", "q", "r"].map(|n| self.get(n))),
            rate_dot_rad_s2: Vector3::from(["pdot", "qdot", "rdot"].map(|n| self.get(n))),
        };
        let rate_name = format!("{}_spring_rate", self.wheel);
        let rate = Coordinates {
            strut: self.at("spring_rate"),
            rack: self.get("rack_rate"),
        };
        let acceleration = Coordinates {
            strut: self.slope(&rate_name),
            rack: self.bend("rack"),
        };
        let mut motion = CornerMotion::on_path(corner, &pose, &body, rate, acceleration);
        motion.spin_rad_s = self.at("omega");
        motion.spin_dot_rad_s2 = self.at("omega_dot");
        let axes = WheelAxes::carrier(pose.spindle.into());
        let frame = TyreFrame {
            contact_m: pose.wheel_centre_m,
            vehicle_from_tyre: Matrix3::from_fn(|row, column| axes.rows()[column][row]),
        };
        let unsprung = vehicle.front.unsprung.as_ref().expect("masses");
        CornerStatics::new(corner, &pose, &frame, unsprung, &motion, ChannelKind::Strut)
            .expect("a sound linkage")
    }

    /// Forces of the file in the order of the members; the transverse ones along the tube's directions in the
    /// file's own pose.
    fn members(&self) -> MemberForces {
        let down = -self.vector("strut_dir_");
        let (d, g) = (self.at("steer"), self.at("incl_body"));
        let spindle = Vector3::new(
            -math::sin(d) * math::cos(g),
            math::cos(d) * math::cos(g),
            math::sin(g),
        );
        let forward = spindle.cross(&-down).normalize();
        let side = self.vector("strut_side_F");
        MemberForces {
            upper_front_n: side.dot(&forward),
            upper_rear_n: side.dot(&forward.cross(&down)),
            lower_front_n: self.at("LCA_tubeF_T"),
            lower_rear_n: self.at("LCA_tubeB_T"),
            tie_rod_n: self.at("tierod_T"),
            sixth_n: self.at("strut_axial_F"),
        }
    }
}

/// Members of the file with an arm in one piece on two bushings: the forces of its legs near the bushings.
fn legs(row: &Row<'_>) -> MemberForces {
    MemberForces {
        lower_front_n: row.at("LCA_legF_N"),
        lower_rear_n: row.at("LCA_legB_N"),
        ..row.members()
    }
}

/// With the legs' own forces, the file has the front bushing's share of the force along the hinge. Braking moves the arm
/// in its bushings by 1.5 mm, which the model does not have.
#[test]
fn forces_of_a_strut_close_with_gauges_on_the_legs() {
    let split = Vehicle::builtin("second-vehicle").expect("ships with the project");
    check(&split, legs, 1.6);
}

/// Root mean square of the errors of F_x, F_y, F_z over the larger of static load and peak force. On rough ground,
/// the accelerations are differences over 20 ms.
#[test]
fn forces_of_a_strut_close() {
    check(&vehicle(), |row: &Row<'_>| row.members(), 0.5);
}

/// `lateral`: limit of F_y on rough ground and under braking, %.
fn check(vehicle: &Vehicle, members: impl Fn(&Row<'_>) -> MemberForces, lateral: f64) {
    for (name, limits) in [
        ("f1_slalom_a", [0.4, 0.2, 0.2]),
        ("f4_launch_brake_a", [0.4, lateral, 0.12]),
        ("r2_iso_e_a", [1.6, lateral, 1.6]),
        ("r3_bumps_a", [1.4, lateral, 1.0]),
    ] {
        let Some(path) = testkit::shared(&format!("data/truth-second/{name}.parquet")) else {
            continue;
        };
        let run = Run::read(&path);
        for wheel in [Wheel::FrontLeft, Wheel::FrontRight] {
            let corner = Corner::of(vehicle, wheel).expect("a strut");
            let (mut square, mut peak) = ([0.0; 3], [STATIC_N; 3]);
            let mut count = 0.0;
            for row in (100..run.rows - 1).step_by(7) {
                let row = Row {
                    run: &run,
                    wheel,
                    row,
                };
                let found = row.statics(vehicle, &corner).wrench(&members(&row));
                let told = row.vector("Fcar_");
                count += 1.0;
                for axis in 0..3 {
                    square[axis] += (found.force_n[axis] - told[axis]).powi(2);
                    peak[axis] = peak[axis].max(told[axis].abs());
                }
            }
            let percent: [f64; 3] =
                std::array::from_fn(|i| 100.0 * f64::sqrt(square[i] / count) / peak[i]);
            println!("{name} {wheel}: {percent:.2?} %");
            for axis in 0..3 {
                assert!(percent[axis] < limits[axis], "{name} {wheel}: {percent:?}");
            }
        }
    }
}
