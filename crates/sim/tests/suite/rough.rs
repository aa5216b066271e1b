//! Drives on rough ground, and what follows from the wheels' accelerations.

use atvrec_sim::{
    Course, Hitch, Motion, Options, RoughPlan, TruthState, VirtualVehicle, WheelGround, drive_rough,
};
use model::road::{Ground, GroundContact, Plane};
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{ForceFrame, Wheel};
use testkit::truth::vehicle as simulated;

use crate::support::{sensors, vehicle};

/// Waves, met by the tangent plane below the wheel centre.
struct Waves(f64);

impl Ground for Waves {
    fn contact(
        &self,
        centre: Vector3<f64>,
        spindle: Vector3<f64>,
        radius_m: f64,
        width_m: f64,
    ) -> GroundContact {
        let (mut height, mut along, mut across) = (0.0, 0.0, 0.0);
        for (kx, ky, phase) in [(1.7, 0.5, 0.0), (0.9, -1.4, 1.0), (3.1, 2.3, 2.0)] {
            let (sin, cos) = math::sin_cos(kx * centre.x + ky * centre.y + phase);
            let amplitude_m = self.0 / math::hypot(kx, ky);
            height += amplitude_m * sin;
            along += amplitude_m * kx * cos;
            across += amplitude_m * ky * cos;
        }
        let plane = Plane {
            normal: Vector3::new(-along, -across, 1.0).normalize(),
            height_m: height - along * centre.x - across * centre.y,
            friction: 1.0,
        };
        plane.contact(centre, spindle, radius_m, width_m)
    }
}

fn plan(speed_m_s: f64, course: Course) -> RoughPlan {
    RoughPlan {
        duration_s: 15.0,
        rows_per_s: 200,
        start_m: [0.0; 2],
        start_yaw_rad: 0.0,
        start_speed_m_s: speed_m_s,
        speed_m_s: Box::new(move |_| speed_m_s),
        course,
        hitch: None,
    }
}

fn straight() -> Course {
    Course::Line(Box::new(|_| 0.0))
}

/// The speed and the line that the driver keeps on waves that lift wheels.
#[test]
fn the_driver_keeps_speed_and_line_on_waves() {
    for speed_m_s in [6.0, -2.5] {
        let plan = plan(speed_m_s, straight());
        let motion = drive_rough("waves", &vehicle(), &Waves(0.06), &plan).unwrap();
        let mut lifted = 0;
        for state in motion.states() {
            let [u, ..] = state.velocity_body_m_s;
            assert!((u - speed_m_s).abs() < 1.2, "{} s: {u} m/s", state.time_s);
            let [_, north, _] = state.position_m;
            assert!(north.abs() < 1.0, "{} s: {north} m", state.time_s);
            lifted += u32::from(state.wheels.0.iter().any(|wheel| wheel.force_n[2] == 0.0));
        }
        let [east, ..] = motion.states()[motion.states().len() - 1].position_m;
        println!("{speed_m_s} m/s: {east:.1} m, {lifted} rows with a wheel in the air");
        assert!((east / (15.0 * speed_m_s) - 1.0).abs() < 0.05, "{east}");
    }
}

/// What scoring takes from a row is one: forces in all frames, wheel places and their derivatives.
#[test]
fn rows_tell_forces_and_wheels_alike() {
    let weave = Course::SteeringWheel(Box::new(|t| 0.8 * math::sin(2.0 * t)));
    let plan = plan(7.0, weave);
    let motion = drive_rough("waves", &vehicle(), &Waves(0.05), &plan).unwrap();
    assert!(motion.has_link_forces());
    let rows = motion.states();
    let mut worst = [0.0_f64; 3];
    for row in 1..rows.len() - 1 {
        let (before, state, after) = (&rows[row - 1], &rows[row], &rows[row + 1]);
        let span_s = after.time_s - before.time_s;
        for wheel in Wheel::ALL {
            let moving = |state: &TruthState| state.wheels[wheel].motion.unwrap();
            let ground = state.wheels[wheel].ground.unwrap();
            let contact = ground.force_n(ForceFrame::Contact);
            for axis in 0..3 {
                let rise = moving(after).centre_m[axis] - moving(before).centre_m[axis];
                let gained = moving(after).velocity_m_s[axis] - moving(before).velocity_m_s[axis];
                let misses = [
                    contact[axis] - state.wheels[wheel].force_n[axis],
                    rise / span_s - moving(state).velocity_m_s[axis],
                    gained / span_s - moving(state).acceleration_m_s2[axis],
                ];
                for (worst, miss) in worst.iter_mut().zip(misses) {
                    *worst = worst.max(miss.abs());
                }
            }
        }
    }
    println!(
        "force {:.1e} N, velocity {:.1e} m/s, acceleration {:.1e} m/s^2",
        worst[0], worst[1], worst[2]
    );
    assert!(
        worst[0] < 1e-6 && worst[1] < 0.02 && worst[2] < 12.0,
        "{worst:?}"
    );
}

/// Sensors read a motion on rough ground, with hard-points and without; only the former has strain.
#[test]
fn sensors_read_rough_ground() {
    for name in ["prowler", "prowler-chang"] {
        let vehicle = Vehicle::builtin(name).expect("a built-in vehicle");
        let plan = RoughPlan {
            duration_s: 3.0,
            ..plan(5.0, Course::Curvature(Box::new(|_| 0.03)))
        };
        let motion = drive_rough(name, &vehicle, &Waves(0.04), &plan).unwrap();
        assert_eq!(motion.has_link_forces(), name == "prowler");
        let turn = motion.at(3.0).yaw_rad;
        assert!((0.2..0.6).contains(&turn), "{name}: {turn} rad");
        let sensed = VirtualVehicle::new(motion, &vehicle, &sensors(), &Options::default(), 11);
        assert!(sensed.expect("a virtual vehicle").count() > 1000);
    }
}

/// A hitch that pulls with a known force slows the vehicle that coasts.
#[test]
fn a_hitch_pulls() {
    let speed_after = |force_n: f64| {
        let plan = RoughPlan {
            duration_s: 3.0,
            hitch: Some(Hitch {
                point_m: [-0.9, 0.0, 0.45],
                force_n: Box::new(move |t| [if t > 1.0 { force_n } else { 0.0 }, 0.0, 0.0]),
            }),
            ..plan(5.0, straight())
        };
        let motion = drive_rough("tow", &vehicle(), &Plane::LEVEL, &plan).unwrap();
        let states = motion.states();
        states[states.len() - 1].velocity_body_m_s[0]
    };
    let [free, pulled] = [0.0, -400.0].map(speed_after);
    println!("{free:.3} m/s without, {pulled:.3} m/s with 400 N backwards");
    assert!((0.1..1.2).contains(&(free - pulled)), "{free} {pulled}");
}

#[test]
fn rows_that_no_step_meets_are_refused() {
    let plan = RoughPlan {
        rows_per_s: 300,
        ..plan(5.0, straight())
    };
    let error = drive_rough("x", &vehicle(), &Plane::LEVEL, &plan).unwrap_err();
    let said = error.to_string();
    assert!(
        said.contains("rows_per_s") && said.contains("500"),
        "{said}"
    );
}

/// Link forces that a truth file does not tell, from its tyre forces and wheel accelerations: root
/// mean square of the miss, N, worst wheel and link.
#[test]
fn link_forces_follow_from_the_accelerations_of_the_wheels() {
    for (name, most_n) in [("r1_iso_c_a", 5.0), ("r3_rocks_a", 11.0)] {
        let file = format!("data/truth-rough/{name}.parquet");
        let Some(path) = testkit::shared(&file) else {
            return;
        };
        let told = Motion::open(&path).expect("a truth file");
        let by_acceleration_n = link_miss_n(&told, |_| {});
        let by_inertia_n = link_miss_n(&told, |ground| ground.centre_acceleration_m_s2 = None);
        let flat_n = link_miss_n(&told, |ground| {
            ground.centre_acceleration_m_s2 = None;
            ground.unsprung_inertia_n = None;
        });
        println!(
            "{name}: {by_acceleration_n:.1} N by acceleration, {by_inertia_n:.1} N by m a, \
             {flat_n:.1} N as on flat ground"
        );
        assert!(
            by_acceleration_n < most_n && by_inertia_n < most_n,
            "{name}"
        );
        assert!(flat_n > 5.0 * most_n, "{name}: {flat_n}");
    }
}

/// The worst link's miss once link forces, and of the ground what `forget` takes, are forgotten.
fn link_miss_n(told: &Motion, forget: fn(&mut WheelGround)) -> f64 {
    let mut states = told.states().to_vec();
    for wheel in states.iter_mut().flat_map(|state| &mut state.wheels.0) {
        wheel.link_force_n = [f64::NAN; 5];
        wheel.ground.iter_mut().for_each(forget);
    }
    let mut motion = Motion::new("forgotten", states).expect("a motion");
    motion.complete(simulated()).expect("a linkage that stands");
    let mut squares = [[0.0_f64; 5]; 4];
    for (state, truth) in motion.states().iter().zip(told.states()) {
        for wheel in Wheel::ALL {
            let own = state.wheels[wheel].link_force_n;
            for (link, square) in squares[wheel.index()].iter_mut().enumerate() {
                *square += (own[link] - truth.wheels[wheel].link_force_n[link]).powi(2);
            }
        }
    }
    let rows = told.states().len() as f64;
    let largest = squares.as_flattened().iter().copied().fold(0.0, f64::max);
    (largest / rows).sqrt()
}
