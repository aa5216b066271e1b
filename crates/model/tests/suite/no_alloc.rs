//! No step of any model asks for memory: a counting allocator watches.

use std::hint::black_box;

use atvrec_model::chassis::{bicycle::Bicycle, four_wheel, fourteen_dof};
use atvrec_model::integrate::{LANES, Tolerance, adaptive, step_to_event};
use atvrec_model::simulation::Model;
use atvrec_model::steering::{Lash, SteeringGear};
use atvrec_model::suspension::{Corner, QuarterCar};
use atvrec_model::tyre::{
    Contact, Law, MagicFormula52, MagicFormula89, Physical, RadialSpringTyre, Tyre,
};
use atvrec_model::vehicle::Vehicle;
use sample::Wheel;
use testkit::allocations;

/// Runs the work once to warm up, then counts what it asks for.
fn asks_for_nothing(what: &str, mut work: impl FnMut()) {
    work();
    let before = allocations();
    work();
    let asked = allocations() - before;
    assert_eq!(asked, 0, "{what} asked for memory {asked} times");
}

fn tyres() -> Vec<(&'static str, Tyre)> {
    let vehicle = Vehicle::builtin("prowler").expect("it ships with the crate");
    let physical = |law| Tyre::Physical(Physical::from_vehicle(&vehicle.front.tyre, law));
    vec![
        ("brush", physical(Law::Brush)),
        ("linear", physical(Law::Linear)),
        ("fiala", physical(Law::Fiala)),
        ("exponential", physical(Law::Exponential)),
        ("dugoff", physical(Law::Dugoff)),
        (
            "mf 89",
            Tyre::MagicFormula89(Box::<MagicFormula89>::default()),
        ),
        (
            "mf 5.2",
            Tyre::MagicFormula52(Box::<MagicFormula52>::default()),
        ),
        ("mf 6.1 from a property file", property()),
    ]
}

/// The tyre of a property file.
fn property() -> Tyre {
    let text = Vehicle::builtin_text("prowler").expect("a vehicle");
    let text = text.replacen("[front.tyre]", "[front.tyre]\ntir = \"my.tir\"", 1);
    let text = text.replacen("reference_load_n", "# reference_load_n", 1);
    let tir = include_str!("../../src/tyre/property/mf61.tir");
    let text =
        Vehicle::with_tyre_files(&text, "own.toml", |_| Ok(tir.to_owned())).expect("a vehicle");
    Tyre::from_vehicle(
        &Vehicle::from_toml(&text, "own.toml")
            .expect("a vehicle")
            .front
            .tyre,
    )
}

#[test]
fn the_counter_counts() {
    let before = allocations();
    black_box(vec![1.0; 10]);
    assert_eq!(allocations() - before, 1);
}

#[test]
fn four_wheel_steps_ask_for_no_memory() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    for (name, tyre) in tyres() {
        let mut p = four_wheel::Parameters::from_vehicle(&vehicle);
        p.front.tyre = tyre.clone();
        p.rear.tyre = tyre;
        p.prepare();
        let state = four_wheel::State::<f64>::rolling(7.0, &p);
        let inputs = four_wheel::Inputs::steered(0.1);
        let mut states = [state; LANES];
        asks_for_nothing(name, || {
            black_box(p.step(&state, &inputs, 1e-3).is_ok());
            black_box(four_wheel::outputs(&p, &state, &inputs));
            p.advance(&mut states, &[inputs; LANES], 1e-3, 3);
        });
        asks_for_nothing("jacobian", || {
            black_box(four_wheel::jacobian(&p, &state, &inputs));
        });
    }
}

#[test]
fn fourteen_dof_steps_and_events_ask_for_no_memory() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    for (name, tyre) in tyres() {
        let mut p = fourteen_dof::Parameters::from_vehicle(&vehicle).unwrap();
        let state = fourteen_dof::at_rest(&p).unwrap().rolling(7.0, &p);
        for corner in &mut p.corners {
            corner.tyre = tyre.clone();
        }
        let inputs = fourteen_dof::Inputs::steered(0.3);
        let mut states = [state; LANES];
        let rate = |_: f64, x: &[f64; fourteen_dof::STATES]| {
            let state = fourteen_dof::State::from_array(*x);
            fourteen_dof::derivative(&p, &state, &inputs).to_array()
        };
        asks_for_nothing(name, || {
            black_box(p.step(&state, &inputs, 5e-4).is_ok());
            black_box(fourteen_dof::outputs(&p, &state, &inputs));
            p.advance(&mut states, &[inputs; LANES], 5e-4, 3);
            black_box(step_to_event(
                &state.to_array(),
                5e-4,
                |x, h| {
                    let state = fourteen_dof::State::from_array(*x);
                    p.steps(&state, &inputs, h, 1).to_array()
                },
                |x| fourteen_dof::guards(&p, &fourteen_dof::State::from_array(*x), &inputs),
            ));
        });
        asks_for_nothing("adaptive steps", || {
            let limits = Tolerance {
                relative: 1e-5,
                ..Tolerance::default()
            };
            let end = adaptive(&state.to_array(), 0.0, 0.01, &limits, rate, |_, _| {});
            black_box(end.is_ok());
        });
    }
}

#[test]
fn parts_ask_for_no_memory() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    for (name, tyre) in tyres() {
        let contact = Contact::combined(1500.0, 0.1, 0.05);
        asks_for_nothing(name, || {
            black_box(tyre.forces(black_box(&contact)));
        });
    }
    let spring = RadialSpringTyre::calibrated(0.3175, 0.02, 0.3, 0.02, 1500.0);
    asks_for_nothing("spring tyre", || {
        black_box(spring.force(black_box(0.3), |_| 0.0));
    });
    let bicycle = Bicycle::from_vehicle(&vehicle);
    asks_for_nothing("bicycle", || {
        black_box(bicycle.system(black_box(5.0)).is_ok());
        black_box(bicycle.relaxed_system(black_box(0.0), 0.2).is_ok());
    });
    let quarter = QuarterCar::of(&vehicle, Wheel::FrontLeft).unwrap();
    asks_for_nothing("quarter car", || {
        let state = nalgebra::Vector4::new(0.1, 0.0, 0.01, 0.02);
        let road = nalgebra::Vector1::new(0.01);
        black_box(quarter.derivative(black_box(&state), &road, &road));
    });
    let corner = Corner::of(&vehicle, Wheel::FrontLeft).unwrap();
    asks_for_nothing("wishbone", || {
        let pose = corner.pose(corner.design_strut_length_m(), 0.0);
        black_box(pose.map(|pose| corner.rates(&pose)).is_ok());
    });
    let gear = SteeringGear::from_vehicle(&vehicle).unwrap();
    let mut lash = Lash::default();
    asks_for_nothing("steering", || {
        black_box(gear.road_wheels(lash.follow(black_box(0.3), 0.05), 0.01));
    });
}
