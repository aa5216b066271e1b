//! The wheel's balance of forces on rough ground, with the true signals of an independent simulator.

use atvrec_model::suspension::linkage::{Coordinates, Linkage, strut_force_n};
use atvrec_model::suspension::{
    BodyMotion, ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, MemberForces,
    TyreFrame,
};
use atvrec_model::vehicle::Vehicle;
use nalgebra::{Matrix3, Rotation3, Vector3};
use sample::Wheel;
use testkit::truth::{self, vehicle};

use super::instant::axle;
use super::run::Run;

/// Where l'' of a row is from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Acceleration {
    /// The wheel centre's acceleration, less the body's.
    OfTheWheel,
    /// Central differences of the strut's rate.
    Differences,
    /// None: the flat-ground assumption of the live estimator.
    FlatGround,
}

/// One wheel at one row.
struct Balance<'a> {
    vehicle: &'a Vehicle,
    corner: &'a Corner,
    run: &'a Run,
    row: usize,
    pose: CornerPose,
    body: BodyMotion,
    rate: Coordinates,
}

impl<'a> Balance<'a> {
    fn new(vehicle: &'a Vehicle, corner: &'a Corner, run: &'a Run, row: usize) -> Self {
        let name = corner.wheel.abbreviation();
        let front = f64::from(u8::from(corner.wheel.is_front()));
        let rack = front * run.get("rack", row);
        Self {
            vehicle,
            corner,
            run,
            row,
            pose: corner
                .pose(run.get(&format!("{name}_spring_len"), row), rack)
                .expect("within reach"),
            body: BodyMotion {
                specific_force_m_s2: run.vector("f", "_body", row),
                reference_m: Vector3::new(0.0, 0.0, vehicle.body.cg_height_m),
                rate_rad_s: run.three(["p", "q", "r"], row),
                rate_dot_rad_s2: run.three(["pdot", "qdot", "rdot"], row),
            },
            rate: Coordinates {
                strut: run.get(&format!("{name}_shock_vel"), row),
                rack: front * run.slope("rack", row),
            },
        }
    }

    fn name(&self, column: &str) -> String {
        format!("{}_{column}", self.corner.wheel)
    }

    fn at(&self, column: &str) -> f64 {
        self.run.get(&self.name(column), self.row)
    }

    fn vector(&self, column: &str) -> Vector3<f64> {
        self.run.vector(&self.name(column), "", self.row)
    }

    /// l'' and z''.
    fn acceleration(&self, from: Acceleration) -> Coordinates {
        let rack = if self.corner.wheel.is_front() {
            self.run.bend("rack", self.row)
        } else {
            0.0
        };
        let strut = match from {
            Acceleration::Differences => self.run.slope(&self.name("shock_vel"), self.row),
            Acceleration::OfTheWheel => self.strut_acceleration_m_s2(rack),
            Acceleration::FlatGround => 0.0,
        };
        Coordinates { strut, rack }
    }

    /// What of the wheel centre's acceleration is left along its path, over the path's length.
    fn strut_acceleration_m_s2(&self, rack: f64) -> f64 {
        let [roll, pitch, yaw] = ["roll", "pitch", "yaw"].map(|name| self.run.get(name, self.row));
        let earth_from_body = Rotation3::from_euler_angles(roll, pitch, yaw);
        let own = earth_from_body.inverse() * self.vector("wcw_a_");
        let without_gravity = BodyMotion {
            specific_force_m_s2: self.run.vector("a", "_body", self.row),
            ..self.body
        };
        let wheel = self.corner.path(&self.pose).wheel;
        wheel.strut_acceleration_m_s2(&without_gravity, self.rate, rack, own)
    }

    fn frame(&self) -> TyreFrame {
        let normal = self.vector("n_chassis_").normalize();
        let radius_m = axle(self.vehicle, self.corner.wheel).tyre.unloaded_radius_m;
        TyreFrame::new(&self.pose, normal, radius_m, self.at("tyre_defl"))
    }

    /// The tyre's force from the members, contact frame and chassis axes.
    fn force(&self, from: Acceleration) -> [Vector3<f64>; 2] {
        let frame = self.frame();
        let acceleration = self.acceleration(from);
        let (corner, pose, body) = (self.corner, &self.pose, &self.body);
        let mut motion = if from == Acceleration::FlatGround {
            let rack = [self.rate.rack, acceleration.rack];
            CornerMotion::on_body(corner, pose, body, self.rate.strut, rack).on_ground(
                corner,
                pose,
                frame.normal(),
                super::instant::GRAVITY_M_S2,
            )
        } else {
            CornerMotion::on_path(corner, pose, body, self.rate, acceleration)
        };
        motion.spin_rad_s = self.at("omega");
        motion.spin_dot_rad_s2 = self.run.slope(&self.name("omega"), self.row);
        motion.axle_torque_n_m = self.at("Tdrive");
        let unsprung = axle(self.vehicle, corner.wheel).unsprung.as_ref();
        let unsprung = unsprung.expect("masses");
        let kind = ChannelKind::Strut;
        let statics = CornerStatics::new(corner, pose, &frame, unsprung, &motion, kind);
        let found = statics.expect("a sound linkage").wrench(&self.members());
        [found.force_n, frame.vehicle_from_tyre * found.force_n]
    }

    fn members(&self) -> MemberForces {
        MemberForces {
            upper_front_n: self.at("UCA_tubeF_T"),
            upper_rear_n: self.at("UCA_tubeB_T"),
            lower_front_n: self.at("LCA_tubeF_T"),
            lower_rear_n: self.at("LCA_tubeB_T"),
            tie_rod_n: self.at("tierod_T"),
            sixth_n: self.at("spring_F") + self.at("shock_F"),
        }
    }
}

/// Worst wheel's 100 RMS / max(peak, static) of (F_x, F_y, F_z), contact frame and chassis axes.
fn closure(run: &Run, from: Acceleration) -> [[f64; 3]; 2] {
    let vehicle = vehicle();
    let mut worst = [[0.0_f64; 3]; 2];
    for wheel in Wheel::ALL {
        let corner = Corner::of(vehicle, wheel).expect("hard-points");
        let mut sum = [Vector3::<f64>::zeros(); 2];
        let mut peak = [Vector3::repeat(vehicle.static_load_n(wheel)); 2];
        for row in 0..run.rows {
            let balance = Balance::new(vehicle, &corner, run, row);
            let truth = ["F", "Fchassis_"].map(|name| balance.vector(name));
            let found = balance.force(from);
            for frame in 0..2 {
                let miss = found[frame] - truth[frame];
                sum[frame] += miss.component_mul(&miss);
                peak[frame] = peak[frame].sup(&truth[frame].abs());
            }
        }
        for frame in 0..2 {
            for axis in 0..3 {
                let rms = (sum[frame][axis] / run.rows as f64).sqrt();
                worst[frame][axis] = worst[frame][axis].max(100.0 * rms / peak[frame][axis]);
            }
        }
    }
    worst
}

/// Worst wheel's F_x, F_y, F_z in per cent. What is left with the wheel's own acceleration is the
/// inertia of upright and arms about their own centres of gravity, which vehicle files do not have
/// (see [`virtual_work_gives_the_strut_force`]); with differences at 200 Hz it is the
/// differentiation. Flat ground assumed, the balance stays open.
#[test]
fn the_wheel_balances_on_rough_ground() {
    use Acceleration::{Differences, FlatGround, OfTheWheel};
    for (name, limits, by_differences) in [
        ("r1_iso_c_a", [0.06, 0.3, 1.0], [0.06, 0.3, 1.0]),
        ("r3_rocks_a", [0.12, 0.4, 0.8], [0.3, 0.4, 0.8]),
    ] {
        let Some(run) = truth::rough_run(name).map(|whole| Run::of(whole, 1)) else {
            return;
        };
        for (from, limits) in [(OfTheWheel, limits), (Differences, by_differences)] {
            let found = closure(&run, from);
            println!("{name}, l'' by {from:?}: contact, chassis {found:.3?} %");
            for axis in 0..3 {
                let most = found[0][axis].max(found[1][axis]);
                assert!(most < limits[axis], "{name} by {from:?}: {found:.3?} %");
            }
        }
        let [contact, _] = closure(&run, FlatGround);
        println!("{name}, flat ground assumed: {contact:.3?} %");
        assert!(contact[2] > 5.0 * limits[2], "{name}: {contact:.3?} %");
    }
}

/// Inertia of upright, upper and lower arm about their own centres of gravity, kg m^2: of the
/// simulator's parameters (`params.json`).
const OWN_INERTIA_KG_M2: [[f64; 3]; 3] = [
    [0.02, 0.016, 0.012],
    [0.016, 0.012, 0.027],
    [0.03, 0.035, 0.064],
];

/// The strut's force by virtual work of all outboard parts, which no member enters, per cent of the
/// strut's peak: without and with the inertia that vehicle files do not have.
#[test]
fn virtual_work_gives_the_strut_force() {
    for name in ["r1_iso_c_a", "r3_rocks_a"] {
        let Some(run) = truth::rough_run(name).map(|whole| Run::of(whole, 1)) else {
            return;
        };
        let vehicle = vehicle();
        for wheel in Wheel::ALL {
            let corner = Corner::of(vehicle, wheel).expect("hard-points");
            let unsprung = axle(vehicle, wheel).unsprung.as_ref().expect("masses");
            let (mut sum, mut peak) = ([0.0; 2], 0.0_f64);
            for row in 0..run.rows {
                let balance = Balance::new(vehicle, &corner, &run, row);
                let (pose, frame) = (balance.pose, balance.frame());
                let linked = (pose, corner.path(&pose));
                let force = balance.vector("Fchassis_");
                let arm = frame.contact_m - pose.wheel_centre_m;
                let moment = arm.cross(&force) + frame.vehicle_from_tyre * balance.vector("M");
                let s = pose.spindle;
                let rate = balance.body.rate_rad_s + linked.1.wheel.rotation.rate(balance.rate);
                let momentum = unsprung.wheel_spin_inertia_kg_m2 * balance.at("omega");
                let brake =
                    s * (moment.dot(&s) - momentum_rate(&balance, unsprung) + balance.at("Tdrive"));
                let on_carrier = moment - s * moment.dot(&s) - rate.cross(&s) * momentum + brake;
                let truth = balance.members().sixth_n;
                peak = peak.max(truth.abs());
                let mut parts = corner.parts(&linked, unsprung);
                for sum in &mut sum {
                    let found = strut_force_n(
                        &linked.1.wheel,
                        &parts,
                        &balance.body,
                        balance.rate,
                        balance.acceleration(Acceleration::OfTheWheel),
                        [force, on_carrier],
                    );
                    *sum += (found - truth).powi(2);
                    for (part, inertia) in parts[1..].iter_mut().zip(OWN_INERTIA_KG_M2) {
                        part.inertia_kg_m2 = Matrix3::from_diagonal(&inertia.into());
                    }
                }
            }
            let [without, with] = sum.map(|sum| 100.0 * (sum / run.rows as f64).sqrt() / peak);
            println!(
                "{name} {wheel}: strut force off by {without:.3} %, {with:.4} % with own inertia"
            );
            assert!(
                without < 0.5 && with < 0.003,
                "{name} {wheel}: {without} {with} %"
            );
        }
    }
}

/// Rate of the wheel's spin momentum, N m.
fn momentum_rate(balance: &Balance<'_>, unsprung: &atvrec_model::vehicle::Unsprung) -> f64 {
    let name = balance.name("omega");
    unsprung.wheel_spin_inertia_kg_m2 * balance.run.slope(&name, balance.row)
}
