use super::dynamics::{Held, centre};
use super::vector::{add, along, cross, dot, scale, sub};
use super::*;
use crate::chassis::bicycle::Bicycle;
use crate::suspension::Corner;
use crate::tyre::{Law, Physical, Stiffness, Tyre, tread_moment};
use crate::vehicle::Vehicle;
use nalgebra::{Complex, SVector, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use sample::Wheel;

fn prowler() -> Parameters {
    Parameters::from_vehicle(&Vehicle::builtin("prowler").unwrap()).unwrap()
}

/// The Prowler without dampers and without any friction: nothing takes or gives energy.
fn conservative() -> Parameters {
    let mut p = prowler();
    for corner in &mut p.corners {
        corner.strut.strut.damping_n_s_m = 0.0;
        corner.strut.strut.stop_damping_n_s_m = 0.0;
        corner.vertical_damping_n_s_m = 0.0;
        // A tread of which a part hangs free is no spring of its tilt alone.
        corner.tread_width_m = 0.0;
        corner.relaxation_length_m = 0.0;
        corner.rolling_resistance = 0.0;
        corner.tyre = Tyre::Physical(Physical {
            law: Law::Linear,
            cornering: Stiffness::Constant(0.0),
            slip: Stiffness::Constant(0.0),
            friction: 1.0,
            sliding_friction: 1.0,
            camber_stiffness_n_rad: 0.0,
            contact_length_m: 0.0,
        });
    }
    p
}

/// Momentum and angular momentum about the sprung centre of gravity (body axes), and energy.
fn mechanics(p: &Parameters, s: &State<f64>, inputs: &Inputs<f64>) -> ([f64; 3], [f64; 3], f64) {
    let held = Held::of(p, inputs);
    let (v, w) = (s.velocity_m_s, s.rate_rad_s);
    let [x, y, z] = p.inertia_kg_m2;
    let xz = p.inertia_xz_kg_m2;
    let mut momentum = scale(v, p.sprung_mass_kg);
    let mut turning = [x * w[0] - xz * w[2], y * w[1], z * w[2] - xz * w[0]];
    let mut energy = 0.5 * (p.sprung_mass_kg * dot(v, v) + dot(w, turning))
        + p.sprung_mass_kg * p.gravity_m_s2 * s.position_m[2];
    let (sr, cr) = math::sin_cos(s.attitude_rad[0]);
    let (sp, cp) = math::sin_cos(s.attitude_rad[1]);
    let up = [-sp, cp * sr, cp * cr];
    for (i, corner) in p.corners.iter().enumerate() {
        let r = centre(p, s, &held, i);
        let (sin, cos) = (held.sin[i], held.cos[i]);
        let own = add(
            add(v, cross(w, r)),
            along(corner.path, s.jounce_rate_m_s[i]),
        );
        momentum = add(momentum, scale(own, corner.mass_kg));
        turning = add(turning, scale(cross(r, own), corner.mass_kg));
        let spin = s.wheel_speed_rad_s[i] * corner.spin_inertia_kg_m2;
        turning = add(turning, scale([-sin, cos, 0.0], spin));
        let height = s.position_m[2] + dot(up, r);
        let lean = up[1] * cos - up[0] * sin;
        let upright = (1.0 - lean * lean).sqrt();
        let press = (corner.unloaded_radius_m - height / upright).max(0.0);
        let strut = &corner.strut.strut;
        let length = corner.strut.length_m(s.jounce_m[i]);
        let stop = (length - strut.droop_stop_length_m)
            .max(strut.bump_stop_length_m - length)
            .max(0.0);
        energy += 0.5 * corner.mass_kg * dot(own, own)
            + corner.mass_kg * p.gravity_m_s2 * height
            + 0.5 * spin * s.wheel_speed_rad_s[i]
            + 0.5 * corner.vertical_stiffness_n_m * press.powi(2)
            + 0.5 * strut.stiffness_n_m * (length - strut.free_length_m).powi(2)
            + 0.5 * strut.stop_stiffness_n_m * stop.powi(2);
    }
    (momentum, turning, energy)
}

#[test]
fn it_stands_on_its_springs_with_the_files_weight_split() {
    for name in ["prowler", "prowler-off-road", "prowler-chang"] {
        let vehicle = Vehicle::builtin(name).unwrap();
        let p = Parameters::from_vehicle(&vehicle).unwrap();
        let state = at_rest(&p).unwrap();
        let out = outputs(&p, &state, &Inputs::coasting());
        let weight = p.mass_kg() * p.gravity_m_s2;
        assert!((p.mass_kg() - vehicle.body.mass_kg).abs() < 1e-9);
        assert!(
            (out.load_n.iter().sum::<f64>() / weight - 1.0).abs() < 1e-9,
            "{name}"
        );
        let front = (out.load_n[0] + out.load_n[1]) / weight;
        let expected = vehicle.body.cg_to_rear_axle_m / vehicle.wheelbase_m();
        assert!(
            (front - expected).abs() < 0.01,
            "{name}: {front} {expected}"
        );
        assert!(state.attitude_rad[1].abs() < 0.03 && state.attitude_rad[0].abs() < 1e-9);
    }
}

#[test]
fn without_dampers_and_friction_energy_stays_even_when_wheels_lift_and_stops_touch() {
    let p = conservative();
    let mut state = at_rest(&p).unwrap().rolling(5.0, &p);
    state.rate_rad_s = [2.0, 0.6, 0.8];
    state.velocity_m_s[2] += 0.8;
    state.jounce_rate_m_s = [0.5, -0.3, 0.2, 0.1];
    let inputs = Inputs::steered(0.2);
    let (_, _, start) = mechanics(&p, &state, &inputs);
    let (mut lifted, mut stopped) = (false, false);
    for _ in 0..20_000 {
        state = stepped(&p, &state, &inputs, 5e-5, 1);
        let out = outputs(&p, &state, &inputs);
        lifted |= out.load_n.contains(&0.0);
        stopped |= (0..4).any(|i| {
            let strut = &p.corners[i].strut.strut;
            out.strut_length_m[i] > strut.droop_stop_length_m
                || out.strut_length_m[i] < strut.bump_stop_length_m
        });
    }
    let (_, _, end) = mechanics(&p, &state, &inputs);
    // Steered wheels' spin momentum is along their spindles, whose energy is the same.
    assert!((end - start).abs() < 1e-4 * start, "{start} {end}");
    assert!(lifted && stopped);
}

fn states() -> impl Strategy<Value = State<f64>> {
    let four = |range: std::ops::Range<f64>| prop::array::uniform4(range);
    let three = |range: std::ops::Range<f64>| prop::array::uniform3(range);
    (
        (
            three(-0.3..0.3),
            three(-1.0..1.0),
            2.0..15.0_f64,
            -2.0..2.0_f64,
            0.55..0.72_f64,
        ),
        (
            four(-0.06..0.06),
            four(-0.5..0.5),
            four(0.0..50.0),
            four(-0.4..0.4),
            four(-0.4..0.4),
        ),
    )
        .prop_map(
            |((attitude, rate, u, v, height), (jounce, jounce_rate, spin, tangent, ratio))| State {
                position_m: [3.0, -2.0, height],
                attitude_rad: attitude,
                velocity_m_s: [u, v, 0.2],
                rate_rad_s: rate,
                jounce_m: jounce,
                jounce_rate_m_s: jounce_rate,
                wheel_speed_rad_s: spin,
                slip_tangent: tangent,
                slip_ratio: ratio,
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 128,
        rng_seed: RngSeed::Fixed(14),
        ..ProptestConfig::default()
    })]

    /// The rates of momentum and angular momentum, differenced along the motion, are the outer
    /// forces and moments that the model reports.
    #[test]
    fn momentum_changes_by_outer_forces_only(state in states(), drive in 0.0..300.0_f64, brake in 0.0..300.0_f64, steer in -0.5..0.5_f64) {
        let p = prowler();
        let mut inputs = Inputs::steered(steer);
        inputs.drive_n_m = [0.0, 0.0, drive, drive];
        inputs.brake_n_m = [brake; 4];
        let out = outputs(&p, &state, &inputs);
        let h = 1e-6;
        let moved = |by: f64| State::from_vector(&(state.to_vector() + out.rate.to_vector() * by));
        let (before, after) = (mechanics(&p, &moved(-h), &inputs), mechanics(&p, &moved(h), &inputs));
        let slope = |a: [f64; 3], b: [f64; 3]| scale(sub(b, a), 0.5 / h);
        let (momentum, turning, _) = mechanics(&p, &state, &inputs);
        let w = state.rate_rad_s;
        let force = add(slope(before.0, after.0), cross(w, momentum));
        // About a point that moves with velocity v: H' + omega x H + v x P.
        let moment = add(add(slope(before.1, after.1), cross(w, turning)), cross(state.velocity_m_s, momentum));
        let (sr, cr) = math::sin_cos(state.attitude_rad[0]);
        let (sp, cp) = math::sin_cos(state.attitude_rad[1]);
        let up = [-sp, cp * sr, cp * cr];
        let (mut outer, mut outer_moment) = (scale(up, -p.gravity_m_s2 * p.mass_kg()), [0.0; 3]);
        let held = Held::of(&p, &inputs);
        for (i, corner) in p.corners.iter().enumerate() {
            let r = centre(&p, &state, &held, i);
            let spindle = [-held.sin[i], held.cos[i], 0.0];
            let lean = dot(up, spindle);
            let upright = (1.0 - lean * lean).sqrt();
            let ahead = scale(cross(spindle, up), 1.0 / upright);
            let left = cross(up, ahead);
            let radius = (state.position_m[2] + dot(up, r)) / upright;
            let contact = sub(r, scale(sub(up, scale(spindle, lean)), radius / upright));
            let push = add(scale(up, out.load_n[i]), add(scale(ahead, out.longitudinal_n[i]), scale(left, out.lateral_n[i])));
            outer = add(outer, push);
            let turn = crate::tyre::saturated(state.wheel_speed_rad_s[i]);
            let rolling = -corner.rolling_resistance * corner.rolling_radius_m * out.load_n[i] * turn;
            let (width, stiffness) = (corner.tread_width_m, corner.vertical_stiffness_n_m);
            let [by_jounce, by_steer] = corner.inclination;
            let inclination = lean + by_jounce * state.jounce_m[i] + by_steer * held.sin[i];
            let tipping = tread_moment(width, stiffness, out.load_n[i], inclination / upright);
            outer_moment = add(outer_moment, add(cross(contact, push), scale(spindle, rolling)));
            outer_moment = sub(outer_moment, scale(ahead, tipping));
            outer_moment = add(outer_moment, cross(r, scale(up, -corner.mass_kg * p.gravity_m_s2)));
        }
        for k in 0..3 {
            prop_assert!((force[k] - outer[k]).abs() < 1e-4 * 644.0 * 9.81, "{k}: {force:?} {outer:?}");
            prop_assert!((moment[k] - outer_moment[k]).abs() < 1e-4 * 644.0 * 9.81, "{k}: {moment:?} {outer_moment:?}");
        }
    }

    #[test]
    fn jacobian_meets_finite_differences(state in states(), steer in -0.5..0.5_f64) {
        let p = prowler();
        let inputs = Inputs::steered(steer);
        let exact = jacobian(&p, &state, &inputs);
        let at = |x: &SVector<f64, STATES>| derivative(&p, &State::from_vector(x), &inputs).to_vector();
        let x = state.to_vector();
        let here = at(&x);
        for j in 0..STATES {
            let h = 1e-6;
            let (mut up, mut down) = (x, x);
            up[j] += h;
            down[j] -= h;
            let (up, down) = (at(&up), at(&down));
            for i in 0..STATES {
                let size = 1.0 + exact.row(i).amax();
                let kink = ((up[i] - here[i]) - (here[i] - down[i])) / h;
                if kink.abs() < 1e-3 * size {
                    let slope = (up[i] - down[i]) / (2.0 * h);
                    prop_assert!((exact[(i, j)] - slope).abs() < 1e-4 * size, "d{i}/d{j}: {} {slope}", exact[(i, j)]);
                }
            }
        }
    }
}

#[test]
fn an_inner_wheel_lifts_in_a_hard_turn_and_the_rest_carries_the_weight() {
    let p = prowler();
    let mut state = at_rest(&p).unwrap().rolling(12.0, &p);
    let mut inputs = Inputs::steered(0.35);
    inputs.friction_scale = [1.4; 4];
    let mut lifted = false;
    for _ in 0..2000 {
        state = stepped(&p, &state, &inputs, 5e-4, 1);
        let out = outputs(&p, &state, &inputs);
        assert!(out.load_n.iter().all(|load| *load >= 0.0));
        lifted |= out.load_n[0] == 0.0 && out.deflection_m[0] < -1e-3;
    }
    assert!(lifted, "{state:?}");
    assert!(
        state.attitude_rad[0] > 0.05,
        "it rolls out of the left turn"
    );
}

#[test]
fn a_gentle_turn_agrees_with_the_four_wheel_model() {
    use crate::chassis::four_wheel;
    use crate::simulation::Model;
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let p = prowler();
    let mut state = at_rest(&p).unwrap().rolling(5.0, &p);
    let inputs = Inputs::steered(0.03);
    let other = four_wheel::Parameters::from_vehicle(&vehicle);
    let mut planar = four_wheel::State::rolling(5.0, &other);
    for _ in 0..3000 {
        state = stepped(&p, &state, &inputs, 5e-4, 1);
        planar = other
            .step(&planar, &four_wheel::Inputs::steered(0.03), 5e-4)
            .unwrap();
    }
    let ratio = state.rate_rad_s[2] / planar.yaw_rate_rad_s;
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    assert!((state.attitude_rad[0] - planar.roll_rad).abs() < 0.3 * planar.roll_rad.abs());
}

#[test]
fn the_fixed_step_converges_with_fourth_order() {
    let p = prowler();
    let start = at_rest(&p).unwrap().rolling(6.0, &p);
    let inputs = Inputs::steered(0.05);
    // Into the turn first: no slip changes sign afterwards.
    let mut turned = start;
    for _ in 0..2000 {
        turned = stepped(&p, &turned, &inputs, 5e-4, 1);
    }
    let tighter = Inputs::steered(0.06);
    let run = |steps: usize| {
        let mut state = turned;
        for _ in 0..steps {
            state = stepped(&p, &state, &tighter, 0.2 / steps as f64, 1);
        }
        state.to_vector()
    };
    let exact = run(6400);
    let order: f64 = math::log2((run(200) - exact).amax() / (run(400) - exact).amax());
    assert!((3.5..4.6).contains(&order), "{order}");
}

#[test]
fn a_vehicle_without_struts_is_refused_by_name() {
    let vehicle = Vehicle::builtin("prowler-table-2.3").unwrap();
    let message = Parameters::from_vehicle(&vehicle).unwrap_err().to_string();
    assert!(message.contains("front.unsprung"), "{message}");
}

/// Sideslip, yaw rate and lateral acceleration for each radian of steer at 6 m/s, of the point fixed
/// to the body that is `below_m` below the whole vehicle's centre of gravity.
fn response(p: &Parameters, frequency_hz: f64, below_m: f64) -> [Complex<f64>; 3] {
    const SPEED_M_S: f64 = 6.0;
    let start = at_rest(p).unwrap().rolling(SPEED_M_S, p);
    let slope = jacobian(p, &start, &Inputs::coasting()).map(Complex::from);
    let rate = |steer| derivative(p, &start, &Inputs::steered(steer)).to_vector();
    let by_steer = ((rate(1e-6) - rate(-1e-6)) / 2e-6).map(Complex::from);
    let s = Complex::new(0.0, std::f64::consts::TAU * frequency_hz);
    let matrix = nalgebra::SMatrix::<Complex<f64>, STATES, STATES>::identity() * s - slope;
    let x = matrix.lu().solve(&by_steer).unwrap();
    let (v, roll_rate, yaw_rate) = (x[7], x[9], x[11]);
    let moment: f64 = p
        .corners
        .iter()
        .map(|c| c.mass_kg * c.wheel_centre_m[0])
        .sum();
    let ahead_m = moment / p.mass_kg();
    let lateral = v + yaw_rate * ahead_m + roll_rate * below_m;
    [
        lateral / SPEED_M_S,
        yaw_rate,
        s * lateral + yaw_rate * SPEED_M_S,
    ]
}

#[track_caller]
fn near(value: Complex<f64>, expected: Complex<f64>, share: f64, angle_deg: f64) {
    let ratio = value / expected;
    let angle = ratio.arg().to_degrees();
    assert!(
        (ratio.norm() - 1.0).abs() < share && angle.abs() < angle_deg,
        "{} times, {angle} degrees ahead",
        ratio.norm()
    );
}

#[test]
fn small_sines_of_steer_meet_the_bicycle_where_nothing_rolls() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let bicycle = Bicycle::from_vehicle(&vehicle);
    let mut stiff = prowler();
    for corner in &mut stiff.corners {
        corner.bar_n_m = 1e8;
        corner.vertical_stiffness_n_m = 1e8;
        corner.relaxation_length_m = 0.0;
        corner.rolling_resistance = 0.0;
    }
    for frequency_hz in [0.1, 0.3] {
        let line = bicycle
            .frequency_response(6.0, std::f64::consts::TAU * frequency_hz)
            .unwrap();
        let [sideslip, yaw_rate, lateral] = response(&stiff, frequency_hz, 0.0);
        near(sideslip, line.sideslip, 0.02, 1.5);
        near(yaw_rate, line.yaw_rate_1_s, 0.01, 0.5);
        near(lateral, line.lateral_m_s2, 0.01, 1.0);
    }
}

/// The body's centre of gravity swings sideways as the body rolls: at 0.3 Hz its sideslip leads by
/// half a second, which the ground below it does not.
#[test]
fn the_lead_of_the_bodys_sideslip_is_its_roll() {
    let p = prowler();
    let line = Bicycle::from_vehicle(&Vehicle::builtin("prowler").unwrap())
        .frequency_response(6.0, std::f64::consts::TAU * 0.3)
        .unwrap();
    let [swinging, yaw_rate, _] = response(&p, 0.3, 0.0);
    let [on_ground, _, _] = response(&p, 0.3, p.design_height_m);
    near(yaw_rate, line.yaw_rate_1_s, 0.04, 1.5);
    near(on_ground, line.sideslip, 0.15, 15.0);
    let lead = (swinging / on_ground).arg().to_degrees();
    assert!((45.0..65.0).contains(&lead), "{lead}");
}

/// Where the contact points stand and how the wheels lean, against the linkage's own pose.
#[test]
fn wheels_steer_and_travel_as_the_linkage_lets_them() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let p = prowler();
    let cg = Vector3::from(vehicle.sprung().cg_m);
    for wheel in [Wheel::FrontLeft, Wheel::FrontRight] {
        let (i, linkage) = (wheel.index(), Corner::of(&vehicle, wheel).unwrap());
        for (jounce_m, rack_m) in [(0.0, 0.02), (0.0, -0.02), (0.03, 0.0), (-0.03, 0.01)] {
            let pose = linkage.pose_at_jounce(jounce_m, rack_m).unwrap();
            let held = Held::of(&p, &Inputs::steered(pose.steer_rad()));
            let mut state = State::zero();
            state.jounce_m[i] = jounce_m;
            // The model's path is that of the contact point, right below its wheel's centre.
            let contact = Vector3::from(centre(&p, &state, &held, i)) + cg;
            let down = (pose.spindle * pose.spindle.z - Vector3::z()).normalize();
            let true_contact = pose.wheel_centre_m + down * pose.wheel_centre_m.z;
            let off = (contact - true_contact).xy().norm();
            assert!(off < 0.004, "{wheel} {jounce_m} {rack_m}: {off}");
            let [by_jounce, by_steer] = p.corners[i].inclination;
            let leans = jounce_m * by_jounce + held.sin[i] * by_steer;
            let off = leans - pose.inclination_rad();
            assert!(
                off.abs() < 0.004,
                "{wheel} {jounce_m} {rack_m}: {leans} off by {off}"
            );
        }
    }
}
