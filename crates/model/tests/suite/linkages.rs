//! Kinematics and statics of all linkages beside those of the multibody package exudyn
//! (`scripts/linkage-reference.py`).

use std::path::Path;

use atvrec_model::suspension::live_axle::LINKS;
use atvrec_model::suspension::{
    BodyMotion, ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, LinkedAxle,
    LiveAxleMotion, LiveAxleStatics, TyreFrame, Wrench,
};
use atvrec_model::vehicle::Vehicle;
use nalgebra::{Matrix3, SVector, Vector3, Vector6};
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

/// Largest error of a position, m, and of an element of a rotation matrix.
const PLACE: f64 = 1e-9;
/// Largest error of a derivative, parts of the larger of it and 1 m/m or 1 rad/m.
const SLOPE: f64 = 1e-7;
/// Largest error of a force, parts of the largest force of the corner.
const FORCE: f64 = 1e-7;
/// Force, N, and moment about the wheel centre, N m, of the ground on a wheel, as in the script.
const LOAD: [[f64; 3]; 2] = [[1200.0, -2300.0, 4100.0], [760.0, 310.0, -95.0]];
/// Compression of the tyre, m: the load acts at the wheel centre, so that it has no influence.
const PRESSED_M: f64 = 0.015;

/// Rows of a file of the script: texts and numbers.
fn rows(text: &str) -> Vec<(Vec<&str>, Vec<f64>)> {
    let rows = text.lines().skip(2).map(|line| {
        let (texts, numbers): (Vec<&str>, Vec<&str>) = line
            .split(',')
            .partition(|cell| cell.parse::<f64>().is_err());
        let numbers = numbers.iter().map(|cell| cell.parse().expect("a number"));
        (texts, numbers.collect())
    });
    rows.collect()
}

fn vehicle(path: &str) -> Vehicle {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = std::fs::read_to_string(root.join(path)).expect(path);
    Vehicle::from_toml(&text, path).expect("a vehicle")
}

/// Largest errors of place, derivatives and forces.
#[derive(Debug, Default)]
struct Worst {
    place: f64,
    slope: f64,
    force: f64,
}

impl Worst {
    fn place(&mut self, moved: Vector3<f64>, turned: &Matrix3<f64>, expected: &[f64]) {
        let miss = (moved - Vector3::from_row_slice(&expected[..3])).amax();
        let turn = (turned - Matrix3::from_row_slice(&expected[3..12])).amax();
        self.place = self.place.max(miss).max(turn);
    }

    fn slopes(&mut self, found: &[Vector3<f64>], expected: &[f64]) {
        let found = found.iter().flat_map(|v| v.iter());
        for (found, expected) in found.zip(expected) {
            let miss = (found - expected).abs() / expected.abs().max(1.0);
            self.slope = self.slope.max(miss);
        }
    }

    fn forces(&mut self, found: &[f64], expected: &[f64]) {
        let largest = expected.iter().fold(1.0_f64, |a, b| a.max(b.abs()));
        for (found, expected) in found.iter().zip(expected) {
            self.force = self.force.max((found - expected).abs() / largest);
        }
    }

    fn assert(&self, what: &str) {
        println!("{what}: {self:?}");
        let Self {
            place,
            slope,
            force,
        } = *self;
        assert!(
            place <= PLACE && slope <= SLOPE && force <= FORCE,
            "{what}: {self:?}"
        );
    }
}

/// The load at a wheel centre as a wrench in the contact frame.
fn wrench(frame: &TyreFrame, centre_m: Vector3<f64>) -> Wrench {
    let [force, moment] = LOAD.map(Vector3::from);
    let moment = moment + (centre_m - frame.contact_m).cross(&force);
    let turn = frame.vehicle_from_tyre.transpose();
    Wrench {
        force_n: turn * force,
        moment_n_m: turn * moment,
    }
}

fn members(vehicle: &Vehicle, corner: &Corner, pose: &CornerPose) -> Vector6<f64> {
    let axle = vehicle.axle(corner.wheel);
    let frame = TyreFrame::new(pose, Vector3::z(), axle.tyre.unloaded_radius_m, PRESSED_M);
    let motion = CornerMotion::at_rest(Vector3::z() * STANDARD_GRAVITY_M_S2);
    let unsprung = axle.unsprung.as_ref().expect("masses");
    let kind = ChannelKind::Strut;
    let statics = CornerStatics::new(corner, pose, &frame, unsprung, &motion, kind).expect("held");
    statics
        .members(&wrench(&frame, pose.wheel_centre_m))
        .to_vector()
}

#[test]
fn corners_are_those_of_a_multibody_package() {
    let mut kinds: Vec<(String, Worst)> = Vec::new();
    for (texts, numbers) in rows(include_str!("../../../../testdata/linkages.csv")) {
        let [path, axle, linkage] = texts[..] else {
            panic!("{texts:?}");
        };
        let vehicle = vehicle(path);
        let wheel = if axle == "front" {
            Wheel::FrontLeft
        } else {
            Wheel::RearLeft
        };
        let name = format!("{linkage}, {axle}");
        if kinds.last().is_none_or(|(last, _)| *last != name) {
            kinds.push((name, Worst::default()));
        }
        let (_, worst) = kinds.last_mut().expect("one");
        let corner = Corner::of(&vehicle, wheel).expect("a corner");
        let (at, expected) = numbers.split_at(2);
        let length_m = corner.design_strut_length_m() + at[0];
        let pose = corner.pose(length_m, at[1]).expect("a pose");
        let moved = pose.wheel_centre_m - corner.points.wheel_centre;
        worst.place(moved, &pose.vehicle_from_upright, expected);
        let found = members(&vehicle, &corner, &pose);
        worst.forces(found.as_slice(), &expected[12..18]);
        let rates = corner.rates(&pose);
        let twists = [rates.strut, rates.rack].map(|twist| [twist.wheel_centre, twist.rotation]);
        worst.slopes(twists.as_flattened(), &expected[18..30]);
    }
    assert_eq!(kinds.len(), 6);
    for (name, worst) in &kinds {
        worst.assert(name);
    }
}

/// Forces are compared without their parts along the self-stress of links and springs: the script has no force in one
/// of the links.
#[test]
fn a_live_axle_is_that_of_a_multibody_package() {
    let vehicle = Vehicle::builtin("second-vehicle").expect("a vehicle");
    let axle = LinkedAxle::of(&vehicle).expect("an axle");
    let unsprung = vehicle.rear.unsprung.as_ref().expect("masses");
    let mut worst = Worst::default();
    let rows = rows(include_str!("../../../../testdata/live-axle.csv"));
    assert_eq!(rows.len(), 5);
    for (_, numbers) in &rows {
        let (at, expected) = numbers.split_at(2);
        let design_m = axle.design_lengths_m();
        let pose = axle
            .pose([design_m[0] + at[0], design_m[1] + at[1]])
            .expect("a pose");
        let moved = pose.path.point_m - axle.origin_m;
        worst.place(moved, &pose.vehicle_from_axle, expected);
        let bind_m = axle.bind_m(&pose).abs();
        assert!((bind_m - expected[12].abs()).abs() < PLACE, "{bind_m}");
        let (travel, turn) = (&pose.path.travel, &pose.path.rotation);
        let slopes = [travel.by_strut, turn.by_strut, travel.by_rack, turn.by_rack];
        worst.slopes(&slopes, &expected[20..32]);
        let motion = LiveAxleMotion {
            body: BodyMotion {
                specific_force_m_s2: Vector3::z() * STANDARD_GRAVITY_M_S2,
                ..BodyMotion::default()
            },
            ..LiveAxleMotion::default()
        };
        let frames = axle.wheel_centres_m.map(|centre_m| TyreFrame {
            contact_m: pose.point_m(centre_m),
            vehicle_from_tyre: Matrix3::identity(),
        });
        let statics = LiveAxleStatics::new(&axle, &pose, &frames, unsprung, &motion);
        let [force, moment] = LOAD.map(Vector3::from);
        let load = Vector6::from_iterator(force.iter().chain(moment.iter()).copied());
        let [still, ..] = statics.balance_offset;
        let outer = statics.balance_from_tyre[0] * load + statics.balance_from_tyre[1] * load;
        let from_balance = statics.members_from_balance(&axle).expect("held");
        let found = from_balance * (outer + still);
        let stress = statics.self_stress(&axle).normalize();
        let without = |forces: SVector<f64, 7>| forces - stress * stress.dot(&forces);
        let expected = SVector::<f64, 7>::from_column_slice(&expected[13..LINKS + 15]);
        worst.forces(without(found).as_slice(), without(expected).as_slice());
    }
    worst.assert("live axle");
}
