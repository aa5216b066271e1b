use nalgebra::{SVector, Vector3};
use sample::Wheel;

use super::dynamics::{earth_from_vehicle, runge_kutta};
use super::*;
use crate::chassis::fourteen_dof;
use crate::road::{Ground, GroundContact, Plane};
use crate::simulation::Model;
use crate::suspension::linkage::Coordinates;
use crate::vehicle::Vehicle;

const STEP_S: f64 = 1e-3;

/// Waves on a plane that goes down by `slope` along x, met by the tangent plane below the wheel
/// centre.
struct Waves {
    slope: f64,
    amplitude_m: f64,
}

impl Waves {
    /// Height and gradient.
    fn at(&self, x: f64, y: f64) -> [f64; 3] {
        let waves = [(1.9, 0.4, 0.0), (0.8, -1.3, 1.0), (3.7, 2.1, 2.0)];
        let mut all = [-self.slope * x, -self.slope, 0.0];
        for (kx, ky, phase) in waves {
            let (sin, cos) = math::sin_cos(kx * x + ky * y + phase);
            let amplitude_m = self.amplitude_m / math::hypot(kx, ky);
            all[0] += amplitude_m * sin;
            all[1] += amplitude_m * kx * cos;
            all[2] += amplitude_m * ky * cos;
        }
        all
    }
}

impl Ground for Waves {
    fn contact(
        &self,
        centre: Vector3<f64>,
        spindle: Vector3<f64>,
        radius_m: f64,
        width_m: f64,
    ) -> GroundContact {
        let [height, along, across] = self.at(centre.x, centre.y);
        let plane = Plane {
            normal: Vector3::new(-along, -across, 1.0).normalize(),
            height_m: height - along * centre.x - across * centre.y,
            friction: 1.0,
        };
        plane.contact(centre, spindle, radius_m, width_m)
    }
}

fn vehicle(name: &str) -> Vehicle {
    Vehicle::builtin(name).unwrap()
}

fn parameters(name: &str) -> Parameters {
    Parameters::from_vehicle(&vehicle(name)).unwrap()
}

#[test]
fn at_rest_the_tyres_carry_the_weight() {
    let vehicle = vehicle("prowler");
    let p = Parameters::from_vehicle(&vehicle).unwrap();
    let state = at_rest(&p, &Plane::LEVEL, [3.0, -2.0, 0.7]).unwrap();
    let found = outputs(&p, &state, &Inputs::default(), &Plane::LEVEL).unwrap();
    let weight_n = p.mass_kg() * p.gravity_m_s2;
    let sum: f64 = found.wheels.iter().map(|wheel| wheel.force_n.z).sum();
    assert!((sum / weight_n - 1.0).abs() < 1e-9, "{sum} {weight_n}");
    let other = fourteen_dof::Parameters::from_vehicle(&vehicle).unwrap();
    let rest = fourteen_dof::at_rest(&other).unwrap();
    let coasting = fourteen_dof::Inputs::coasting();
    let loads = fourteen_dof::outputs(&other, &rest, &coasting).load_n;
    for wheel in Wheel::ALL {
        let load = found.wheels[wheel.index()].force_n.z;
        let misses = [
            load / vehicle.static_load_n(wheel) - 1.0,
            load / loads[wheel.index()] - 1.0,
        ];
        println!("{wheel} {load:.1} N, off by {misses:.5?} of file and 14 degrees of freedom");
        assert!(misses.iter().all(|miss| miss.abs() < 2e-3), "{misses:?}");
    }
}

/// A drive of 60 s and what the balances left open.
struct Ledger {
    energy_j: f64,
    work_j: f64,
    momentum_n_s: f64,
    angular_n_m_s: f64,
    lifted_s: f64,
    travelled_m: f64,
}

/// Rates of work, of its amount, of impulse and of angular impulse about the earth's origin.
fn rates(p: &Parameters, state: &State, inputs: &Inputs, found: &Outputs) -> SVector<f64, 8> {
    let earth = earth_from_vehicle(state);
    let mut power = SVector::<f64, 2>::zeros();
    let mut add = |watt: f64| power += SVector::<f64, 2>::new(watt, watt.abs());
    let weight = Vector3::new(0.0, 0.0, -p.gravity_m_s2);
    let place = |point: Vector3<f64>| state.position_m + earth * (point - p.sprung_cg_m);
    let speed = state.velocity_m_s.x;
    let drag = Vector3::x() * (-p.drag_n_s2_m2 * speed * speed.abs());
    let hitch = earth * inputs.hitch_force_n;
    let at_hitch = state.velocity_m_s + state.rate_rad_s.cross(&(inputs.hitch_m - p.sprung_cg_m));
    add(drag.dot(&state.velocity_m_s));
    add(inputs.hitch_force_n.dot(&at_hitch));
    let mut force = hitch + earth * drag + weight * p.mass_kg();
    let mut moment = place(inputs.hitch_m).cross(&hitch)
        + state
            .position_m
            .cross(&(earth * drag + weight * p.sprung_mass_kg));
    for (i, wheel) in found.wheels.iter().enumerate() {
        add(wheel.tyre_power_w);
        add((wheel.strut.damper_n + wheel.strut.stop_n) * state.strut_rate_m_s[i]);
        let tyre = earth * (wheel.vehicle_from_contact * wheel.force_n);
        force += tyre;
        moment += place(wheel.centre_m).cross(&tyre) + earth * wheel.centre_moment_n_m;
        let corner = &p.corners[i];
        let at = Coordinates {
            strut: state.strut_m[i],
            rack: state.rack[i],
        };
        let outboard = corner.suspension.outboard(at, &corner.unsprung).unwrap();
        for part in &outboard.parts {
            moment += place(part.cg.point_m).cross(&(weight * part.mass_kg));
        }
    }
    let mut all = SVector::<f64, 8>::zeros();
    all.fixed_rows_mut::<2>(0).copy_from(&power);
    all.fixed_rows_mut::<3>(2).copy_from(&force);
    all.fixed_rows_mut::<3>(5).copy_from(&moment);
    all
}

/// Coasts for 60 s down a slope of waves, a rack held at `rack`, with the work and the impulses
/// integrated by the same rule.
fn coast(p: &Parameters, rack: f64, hitch_force_n: Vector3<f64>, step_s: f64) -> Ledger {
    const ALL: usize = STATES + 8;
    let ground = Waves {
        slope: 0.06,
        amplitude_m: 0.05,
    };
    let inputs = Inputs {
        hitch_force_n,
        hitch_m: Vector3::new(-1.0, 0.1, 0.4),
        ..Inputs::default()
    };
    let mut start = at_rest(p, &ground, [0.0; 3]).unwrap().rolling(6.0, p);
    start.rack = [rack, rack, 0.0, 0.0];
    let balances = |state: &State| (energy_j(p, state).unwrap(), momentum(p, state).unwrap());
    let before = balances(&start);
    let mut x = SVector::<f64, ALL>::zeros();
    x.fixed_rows_mut::<STATES>(0).copy_from(&start.to_vector());
    let mut lifted_s = 0.0;
    for _ in 0..(60.0 / step_s) as usize {
        let rate = |x: &SVector<f64, ALL>| {
            let state = State::from_vector(&x.fixed_rows::<STATES>(0).into_owned());
            let found = outputs(p, &state, &inputs, &ground)?;
            let mut rate = SVector::<f64, ALL>::zeros();
            rate.fixed_rows_mut::<STATES>(0)
                .copy_from(&found.rate.to_vector());
            rate.fixed_rows_mut::<8>(STATES)
                .copy_from(&rates(p, &state, &inputs, &found));
            Ok(rate)
        };
        x = runge_kutta(&x, step_s, rate).unwrap();
        let state = State::from_vector(&x.fixed_rows::<STATES>(0).into_owned());
        let found = outputs(p, &state, &inputs, &ground).unwrap();
        if found.wheels.iter().any(|wheel| wheel.force_n.z == 0.0) {
            lifted_s += step_s;
        }
    }
    let state = State::from_vector(&x.fixed_rows::<STATES>(0).into_owned());
    let after = balances(&state);
    let three = |first: usize| Vector3::new(x[first], x[first + 1], x[first + 2]);
    let linear = after.1.linear_n_s - before.1.linear_n_s - three(STATES + 2);
    let angular = after.1.angular_n_m_s - before.1.angular_n_m_s - three(STATES + 5);
    Ledger {
        energy_j: after.0 - before.0 - x[STATES],
        work_j: x[STATES + 1],
        momentum_n_s: linear.norm(),
        angular_n_m_s: angular.norm(),
        lifted_s,
        travelled_m: (state.position_m - start.position_m).norm(),
    }
}

/// Change of energy less the work of tyres, dampers, stops, drag and hitch, over the sum of the
/// amounts of that work; changes of momentum less the impulses, over the impulse of the weight and
/// that at 100 m.
const ENERGY_TOLERANCE: f64 = 1e-6;
const MOMENTUM_TOLERANCE: f64 = 1e-8;

#[test]
fn energy_and_momentum_balance_on_rough_ground() {
    let pull = Vector3::new(150.0, 40.0, -30.0);
    for (name, rack) in [("prowler", 0.004), ("prowler-chang", 0.03)] {
        let p = parameters(name);
        let found = coast(&p, rack, pull, STEP_S);
        let impulse = p.mass_kg() * p.gravity_m_s2 * 60.0;
        let [energy, linear, angular] = [
            found.energy_j.abs() / found.work_j,
            found.momentum_n_s / impulse,
            found.angular_n_m_s / (impulse * 100.0),
        ];
        println!(
            "{name}: {:.0} m, a wheel in the air for {:.1} s; energy off by {:.2} of {:.0} J \
             ({energy:.1e}), momentum by {linear:.1e}, angular by {angular:.1e}",
            found.travelled_m, found.lifted_s, found.energy_j, found.work_j
        );
        assert!(found.lifted_s > 0.5, "{name}: a wheel must lift");
        assert!(energy < ENERGY_TOLERANCE, "{name}: {energy}");
        assert!(linear < MOMENTUM_TOLERANCE, "{name}: {linear}");
        assert!(angular < MOMENTUM_TOLERANCE, "{name}: {angular}");
    }
}

/// In the air the whole vehicle's centre of gravity falls with g and its angular momentum about
/// that point stays, while the wheels drop against their stops and spin.
#[test]
fn all_wheels_in_the_air_it_falls_freely() {
    let p = parameters("prowler");
    let ground = Plane::LEVEL;
    let mut state = at_rest(&p, &ground, [0.0; 3]).unwrap().rolling(9.0, &p);
    state.position_m.z += 6.0;
    state.rate_rad_s = Vector3::new(0.4, -0.3, 0.5);
    let before = momentum(&p, &state).unwrap();
    let linear = before.linear_n_s;
    let cg_of = |momentum: &Momentum, time_s: f64, start: Vector3<f64>| {
        start + momentum.linear_n_s / p.mass_kg() * time_s
            - Vector3::z() * (0.5 * p.gravity_m_s2 * time_s * time_s)
    };
    // The start is known to a rotation only: the angular momentum about the centre of gravity must
    // stay, which pulls at the place of that point.
    let start = centre_of_gravity(&p, &state);
    let spin = before.angular_n_m_s - start.cross(&linear);
    let seconds = 1.0;
    for _ in 0..1000 {
        state = step(&p, &state, &Inputs::default(), &ground, STEP_S).unwrap();
        let found = outputs(&p, &state, &Inputs::default(), &ground).unwrap();
        assert!(found.wheels.iter().all(|wheel| wheel.force_n.norm() == 0.0));
    }
    let after = momentum(&p, &state).unwrap();
    let fallen = linear - Vector3::z() * (p.mass_kg() * p.gravity_m_s2 * seconds);
    let miss = (after.linear_n_s - fallen).norm() / linear.norm();
    let cg = centre_of_gravity(&p, &state);
    let place = (cg - cg_of(&before, seconds, start)).norm();
    let turned = (after.angular_n_m_s - cg.cross(&after.linear_n_s) - spin).norm() / spin.norm();
    println!(
        "momentum off by {miss:.1e}, place by {place:.1e} m, angular momentum by {turned:.1e}"
    );
    assert!(miss < 1e-8 && place < 1e-7 && turned < 1e-7);
    for (i, corner) in p.corners.iter().enumerate() {
        assert!(state.strut_m[i] > corner.strut.droop_stop_length_m);
    }
}

fn centre_of_gravity(p: &Parameters, state: &State) -> Vector3<f64> {
    let mut moment = p.sprung_cg_m * p.sprung_mass_kg;
    for (i, corner) in p.corners.iter().enumerate() {
        let at = Coordinates {
            strut: state.strut_m[i],
            rack: state.rack[i],
        };
        let outboard = corner.suspension.outboard(at, &corner.unsprung).unwrap();
        for part in &outboard.parts {
            moment += part.cg.point_m * part.mass_kg;
        }
    }
    let from_sprung = moment / p.mass_kg() - p.sprung_cg_m;
    state.position_m + earth_from_vehicle(state) * from_sprung
}

/// A step of 7 mm of the rack at 7 m/s on level ground against the model that the flat manoeuvres
/// drive, with the steer angles that the linkage gives.
#[test]
fn a_step_steer_on_flat_ground_agrees_with_the_straight_paths() {
    let vehicle = vehicle("prowler");
    let (p, ground) = (Parameters::from_vehicle(&vehicle).unwrap(), Plane::LEVEL);
    let other = fourteen_dof::Parameters::from_vehicle(&vehicle).unwrap();
    let mut state = at_rest(&p, &ground, [0.0; 3]).unwrap().rolling(7.0, &p);
    let mut flat = fourteen_dof::at_rest(&other).unwrap().rolling(7.0, &other);
    let (mut worst, mut most) = ([0.0_f64; 4], [0.0_f64; 4]);
    for count in 0..3000 {
        let time_s = f64::from(count) * STEP_S;
        let pull = match time_s {
            t if (0.5..0.6).contains(&t) => 0.7,
            t if (0.6..0.7).contains(&t) => -0.7,
            _ => 0.0,
        };
        let inputs = Inputs {
            rack_acceleration: [pull, pull, 0.0, 0.0],
            ..Inputs::default()
        };
        let found = outputs(&p, &state, &inputs, &ground).unwrap();
        let mut steered = fourteen_dof::Inputs::coasting();
        for (i, wheel) in found.wheels.iter().enumerate() {
            steered.steer_rad[i] = math::atan2(-wheel.spindle.x, wheel.spindle.y);
        }
        let told = fourteen_dof::outputs(&other, &flat, &steered);
        let load = |i: usize| [found.wheels[i].force_n.z, told.load_n[i]];
        for (k, [own, others]) in [
            [state.rate_rad_s.z, flat.rate_rad_s[2]],
            [state.attitude_rad.x, flat.attitude_rad[0]],
            [found.specific_force_m_s2.y, told.specific_force_m_s2[1]],
            load(1),
        ]
        .into_iter()
        .enumerate()
        {
            worst[k] = worst[k].max((own - others).abs());
            most[k] = most[k].max(others.abs());
        }
        state = step(&p, &state, &inputs, &ground, STEP_S).unwrap();
        flat = other.steps(&flat, &steered, STEP_S, 1);
    }
    let part: [f64; 4] = std::array::from_fn(|k| worst[k] / most[k]);
    println!("yaw rate, roll, specific force, load differ by {part:.3?} of their peaks {most:.2?}");
    assert!(most[2] > 1.5, "a turn");
    let limits = [0.04, 0.06, 0.05, 0.05];
    assert!((0..4).all(|k| part[k] < limits[k]), "{part:?}");
}

/// The strut's force that the corner's statics call for, from the tyre's wrench and the motion of
/// the parts, is the one of spring, damper and stops: equations of motion and statics are one.
#[test]
fn statics_and_equations_of_motion_agree() {
    let p = parameters("prowler");
    let ground = Waves {
        slope: 0.0,
        amplitude_m: 0.08,
    };
    let mut state = at_rest(&p, &ground, [0.0; 3]).unwrap().rolling(8.0, &p);
    let mut worst = 0.0_f64;
    for count in 0..4000_u32 {
        let pull = 2.0 * math::cos(0.02 * f64::from(count));
        let inputs = Inputs {
            rack_acceleration: [pull, pull, 0.0, 0.0],
            drive_n_m: [0.0, 0.0, 150.0, 150.0],
            brake_n_m: [40.0, 30.0, 0.0, 20.0],
            ..Inputs::default()
        };
        if count.is_multiple_of(10) {
            let found = outputs(&p, &state, &inputs, &ground).unwrap();
            for i in 0..4 {
                let carried = carried(&p, &state, &inputs, &found, i).unwrap();
                let strut_n = carried.expect("hard-points").members.sixth_n;
                worst = worst.max((strut_n - found.wheels[i].strut.total_n()).abs());
            }
        }
        state = step(&p, &state, &inputs, &ground, STEP_S).unwrap();
    }
    println!("strut forces of statics and motion differ by {worst:.1e} N");
    assert!(worst < 1e-6, "{worst}");
}

/// Drive torque backwards and a hitch that pulls: both move the vehicle.
#[test]
fn it_reverses_and_is_towed() {
    let (p, ground) = (parameters("prowler"), Plane::LEVEL);
    let drive = |inputs: Inputs| {
        let mut state = at_rest(&p, &ground, [0.0; 3]).unwrap();
        for _ in 0..2000 {
            state = step(&p, &state, &inputs, &ground, STEP_S).unwrap();
        }
        state
    };
    let back = drive(Inputs {
        drive_n_m: [0.0, 0.0, -100.0, -100.0],
        ..Inputs::default()
    });
    assert!((-2.0..-0.8).contains(&back.velocity_m_s.x), "{back:?}");
    assert!(back.wheel_speed_rad_s.iter().all(|spin| *spin < -2.0));
    let towed = drive(Inputs {
        hitch_force_n: Vector3::new(500.0, 0.0, 0.0),
        hitch_m: Vector3::new(1.2, 0.0, 0.4),
        ..Inputs::default()
    });
    assert!((0.6..1.6).contains(&towed.velocity_m_s.x), "{towed:?}");
}
