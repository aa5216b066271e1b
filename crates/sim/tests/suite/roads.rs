//! Manoeuvres on roads.

use atvrec_sim::{Manoeuvre, Motion};
use model::road::{Road, RoadClass};
use model::vehicle::Vehicle;

fn prowler() -> Vehicle {
    Vehicle::builtin("prowler").expect("a vehicle")
}

fn driven(manoeuvre: Manoeuvre) -> Motion {
    let motion = manoeuvre.drive(&prowler());
    motion.unwrap_or_else(|error| panic!("{}: {error}", manoeuvre.name()))
}

fn road(text: &str) -> Road {
    let none = |_: &str| Err("no file".to_owned());
    Road::from_toml(text, "test.toml", &none).expect("a road")
}

/// Parts of the rows in which a wheel of each axle, and every wheel, is in the air.
fn in_the_air(motion: &Motion) -> [f64; 3] {
    let mut counts = [0.0; 3];
    for state in motion.states() {
        let lifted = state.wheels.0.map(|wheel| wheel.force_n[2] <= 0.0);
        let part = |wheels: &[bool]| wheels.iter().filter(|lifted| **lifted).count() as f64;
        counts[0] += 0.5 * part(&lifted[..2]);
        counts[1] += 0.5 * part(&lifted[2..]);
        counts[2] += f64::from(u8::from(lifted == [true; 4]));
    }
    counts.map(|count| count / motion.states().len() as f64)
}

/// The independent simulator's run on a washboard of this wavelength has 31 and 17 % of lift.
#[test]
fn the_washboard_lifts_the_wheels_as_in_the_independent_simulator() {
    let motion = driven(Manoeuvre::Washboard);
    let [front, rear, _] = in_the_air(&motion);
    println!("front {:.1} %, rear {:.1} %", 100.0 * front, 100.0 * rear);
    assert!((0.2..0.4).contains(&front), "{front}");
    assert!((0.1..0.3).contains(&rear), "{rear}");
}

#[test]
fn jumps_and_ditches_take_wheels_off_the_ground() {
    let jump = driven(Manoeuvre::Jump);
    let [.., all] = in_the_air(&jump);
    let seconds = all * jump.duration_s();
    // Five jumps of 0.25 to 0.46 s in the independent simulator.
    assert!((1.0..2.5).contains(&seconds), "{seconds} s");
    assert!(!jump.tips_over());
    let ditch = driven(Manoeuvre::TwistDitch);
    let [front, rear, all] = in_the_air(&ditch);
    assert!(front > 0.02 && rear > 0.02 && all == 0.0, "{front} {rear}");
}

#[test]
fn flat_manoeuvres_are_driven_on_roads() {
    let rough = Road::iso8608(RoadClass::C, 11);
    let motion = Manoeuvre::FastSine.drive_on(&prowler(), &rough);
    let motion = motion.expect("driven");
    assert!((motion.duration_s() - 16.0).abs() < 1e-9);
    assert_eq!(motion.road_class(), Some(RoadClass::C));
    let roll = motion.states().iter().map(|state| state.roll_rad.abs());
    assert!(roll.fold(0.0, f64::max) > 0.02);
    let error = Manoeuvre::Circle.drive_on(&prowler(), &rough);
    let error = error.expect_err("it has its own ground").to_string();
    assert!(
        error.contains("circle") && error.contains("iso8608:C"),
        "{error}"
    );
    assert!(Manoeuvre::Weighed.drive_on(&prowler(), &rough).is_err());
}

/// A slope and its friction leave the class of the roughness, other shapes and the end of the roughness
/// on the way do not.
#[test]
fn a_motion_has_the_class_of_a_road_that_has_one() {
    let rough = "[part.a]\nkind = \"iso8608\"\nclass = \"B\"\n";
    let class = |more: &str| {
        let motion = Manoeuvre::FastSine.drive_on(&prowler(), &road(&format!("{rough}{more}")));
        motion.expect("driven").road_class()
    };
    let slope = "[part.b]\nkind = \"slope\"\nbank_rad = 0.02\n";
    assert_eq!(class(slope), Some(RoadClass::B));
    assert_eq!(class("x_m = [-50, 60]\n"), None);
    let bump = "[part.b]\nkind = \"half-rounds\"\nat_x_m = [900]\nheight_m = 0.03\n";
    assert_eq!(class(bump), None);
}

#[test]
fn a_road_that_the_tyres_cannot_climb_is_refused() {
    let wall = road("[part.log]\nkind = \"half-rounds\"\nat_x_m = [20]\nheight_m = 0.4\n");
    let error = Manoeuvre::RoughRoad.drive_on(&prowler(), &wall);
    let error = error.expect_err("too high").to_string();
    for word in ["test.toml", "part.log", "0.391 m", "0.318 m", "lower"] {
        assert!(error.contains(word), "{word}: {error}");
    }
}

/// Loads of about 1200 N sink in by a few centimetres in sand (`docs/roads.md`).
#[test]
fn wheels_sink_into_sand() {
    let sand = road("[part.pit]\nkind = \"soil\"\nsoil = \"sand\"\nx_m = [8, 3000]\n");
    let motion = Manoeuvre::TwistDitch.drive_on(&prowler(), &sand);
    let motion = motion.expect("driven");
    let at = |time_s: f64| motion.at(time_s).wheels.0[0];
    let height = |time_s: f64| at(time_s).ground.and_then(|ground| ground.ground_height_m);
    assert_eq!(height(1.0), Some(0.0));
    let sunk = height(20.0).expect("the height of the ground");
    assert!((-0.08..-0.01).contains(&sunk), "{sunk}");
    assert!(at(20.0).friction < at(1.0).friction);
}
