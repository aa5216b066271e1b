"""The model through Python: the same bits as Rust, shapes, check values and errors."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

import atvrec


@pytest.fixture
def vehicle() -> atvrec.Vehicle:
    return atvrec.Vehicle.builtin("prowler")


def test_python_and_rust_give_the_same_bits(vehicle: atvrec.Vehicle) -> None:
    path = os.environ.get("ATVREC_TEST_ROLLOUT")
    if not path:
        pytest.skip("ATVREC_TEST_ROLLOUT names no output of the example; scripts/test-python makes it")
    rust = json.loads(Path(path).read_text())
    bits = np.array([[int(word, 16) for word in row] for row in rust["states"]], dtype=np.uint64)
    model = atvrec.FourWheel(vehicle)
    runs = len(bits)
    inputs = np.stack([model.inputs(0.1 * run / runs) for run in range(runs)])
    state = model.rolling(6.0)
    stepped = model.step(np.tile(state, (runs, 1)), inputs, rust["step_s"], 1_000)
    np.testing.assert_array_equal(stepped.view(np.uint64), bits)
    simulated = model.simulate(state, inputs[:, None, :], rust["step_s"], 1_000, every=1_000)
    np.testing.assert_array_equal(simulated[:, -1].view(np.uint64), bits)


def test_fourteen_degrees_of_freedom_give_the_same_bits_too(vehicle: atvrec.Vehicle) -> None:
    path = os.environ.get("ATVREC_TEST_ROLLOUT")
    if not path:
        pytest.skip("ATVREC_TEST_ROLLOUT names no output of the example; scripts/test-python makes it")
    rust = json.loads(Path(path).read_text())
    rows = rust["fourteen_dof"]
    bits = np.array([[int(word, 16) for word in row] for row in rows], dtype=np.uint64)
    model = atvrec.FourteenDof(vehicle)
    inputs = np.stack([model.inputs(0.1 * run / len(bits)) for run in range(len(bits))])
    states = np.tile(model.rolling(6.0), (len(bits), 1))
    stepped = model.step(states, inputs, 0.5 * rust["step_s"], 1_000)
    np.testing.assert_array_equal(stepped.view(np.uint64), bits)


def test_batches_are_single_runs_side_by_side(vehicle: atvrec.Vehicle) -> None:
    model = atvrec.FourWheel(vehicle)
    rng = np.random.default_rng(1)
    speeds = rng.uniform(2.0, 10.0, 64)
    states = np.stack([model.rolling(speed) for speed in speeds])
    inputs = np.tile(model.inputs(), (64, 50, 1))
    inputs[:, :, :2] = rng.uniform(-0.2, 0.2, (64, 50, 1))
    batch = model.simulate(states, inputs, 0.002)
    assert batch.shape == (64, 51, 19)
    for run in (0, 63):
        alone = model.simulate(states[run], inputs[run], 0.002)
        np.testing.assert_array_equal(batch[run], alone)
        for step in range(2):
            np.testing.assert_array_equal(
                model.step(alone[step], inputs[run, step], 0.002), alone[step + 1]
            )
    np.testing.assert_array_equal(model.simulate(states, inputs, 0.002, every=25), batch[:, ::25])
    # Views that do not stand in row order give the same.
    turned = np.asfortranarray(inputs)
    np.testing.assert_array_equal(model.simulate(states[::2], turned[::2], 0.002), batch[::2])


def test_rollouts_over_parameters(vehicle: atvrec.Vehicle) -> None:
    masses = [500.0, 600.0, 700.0]
    models = [
        atvrec.FourWheel(vehicle.with_values({"body.mass_kg": mass})) for mass in masses
    ]
    state, inputs = models[0].rolling(6.0), models[0].inputs(0.05)
    together = atvrec.FourWheel.simulate_each(models, state, inputs, 0.001, 200)
    assert together.shape == (3, 201, 19)
    for model, states in zip(models, together, strict=True):
        np.testing.assert_array_equal(model.simulate(state, inputs, 0.001, 200), states)
    assert not np.array_equal(together[0], together[1])


def test_outputs_and_jacobian(vehicle: atvrec.Vehicle) -> None:
    model = atvrec.FourWheel(vehicle)
    turn = model.steady_turn(6.0, 15.0)
    state, inputs = turn["state"], turn["inputs"]
    outputs = model.outputs(state, inputs)
    assert outputs["load_n"].shape == (4,)
    np.testing.assert_allclose(outputs["load_n"].sum(), vehicle.mass_kg * 9.80665, rtol=1e-6)
    np.testing.assert_allclose(outputs["lateral_m_s2"], 6.0**2 / 15.0, rtol=1e-6)
    many = model.outputs(np.tile(state, (5, 1)), inputs)
    assert many["load_n"].shape == (5, 4) and many["lateral_m_s2"].shape == (5,)
    jacobian = model.jacobian(state, inputs)
    step = 1e-6
    for column in range(7):
        ahead, behind = state.copy(), state.copy()
        ahead[column] += step
        behind[column] -= step
        slope = (model.derivative(ahead, inputs) - model.derivative(behind, inputs)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, column], slope, rtol=1e-4, atol=1e-3)


def test_vehicles(vehicle: atvrec.Vehicle, tmp_path: Path) -> None:
    assert "prowler-table-2.3" in atvrec.Vehicle.builtin_names()
    path = tmp_path / "vehicle.toml"
    path.write_text(vehicle.to_toml())
    assert atvrec.Vehicle.load(path).to_dict() == vehicle.to_dict()
    heavier = vehicle.with_values({"body.mass_kg": 700.0})
    assert heavier.mass_kg == 700.0 and vehicle.mass_kg != 700.0
    with pytest.raises(atvrec.VehicleError, match="body.mass_kg = -1"):
        vehicle.with_values({"body.mass_kg": -1.0})
    with pytest.raises(ValueError, match="mass_lb"):
        vehicle.with_values({"body.mass_lb": 1400.0})
    with pytest.raises(atvrec.VehicleError, match="not a built-in vehicle"):
        atvrec.Vehicle.builtin("tank")
    with pytest.raises(FileNotFoundError):
        atvrec.Vehicle.load(tmp_path / "absent.toml")


def test_bicycle_meets_the_check_values() -> None:
    bicycle = atvrec.Bicycle(atvrec.Vehicle.builtin("prowler-table-2.3"))
    assert bicycle.understeer_gradient_rad_m_s2 == pytest.approx(0.0234266, abs=5e-8)
    assert bicycle.characteristic_speed_m_s == pytest.approx(7.85949, abs=5e-6)
    gains = bicycle.steady_gains(np.array([2.0, 5.0, 8.0, 15.0]))["yaw_rate_1_s"]
    np.testing.assert_allclose(gains, [1.298022, 2.459703, 2.715175, 2.232778], atol=5e-7)
    eigenvalues = bicycle.eigenvalues(np.array([5.0, 10.0]))
    np.testing.assert_allclose(eigenvalues[0], [-6.593133, -2.210658], atol=5e-7)
    a, b = bicycle.system(5.0)
    np.testing.assert_allclose(np.linalg.eigvals(a), eigenvalues[0].real)
    response = bicycle.frequency_response(5.0, np.array([0.0, 3.0]))
    np.testing.assert_allclose(response[1, :2], np.linalg.solve(3j * np.eye(2) - a, b))
    assert response[0, 1].real == pytest.approx(gains[1])
    with pytest.raises(atvrec.ArgumentError, match="speed_m_s = 0 m/s"):
        bicycle.system(0.0)


def test_tyres_meet_the_check_values() -> None:
    angles = np.radians([2.0, 5.0, 10.0, 20.0, 40.0])
    expected = {
        "fiala": [101.215, 242.144, 450.719, 781.708, 1130.161],
        "exponential": [99.712, 233.368, 419.563, 686.649, 964.904],
        "dugoff": [104.326, 261.372, 526.777, 848.049, 1021.567],
    }
    for law, forces in expected.items():
        tyre = atvrec.Tyre.physical(
            law, cornering_stiffness_n_rad=2987.5, slip_stiffness_n=12000.0, friction=0.87
        )
        np.testing.assert_allclose(-tyre.forces(1327.0, angles)["lateral_n"], forces, atol=6e-4)
    pacejka = atvrec.Tyre.magic_formula_89().forces(4000.0, np.radians(4.0))
    assert -pacejka["lateral_n"] == pytest.approx(3096.609, abs=6e-4)
    grid = tyre.forces(np.array([[500.0], [1000.0], [-5.0]]), angles)["lateral_n"]
    assert grid.shape == (3, 5)
    assert np.all(grid[2] == 0.0) and np.all(grid[:2] < 0.0)
    with pytest.raises(atvrec.ArgumentError, match="slip_angle_rad = NaN rad"):
        tyre.forces(1000.0, np.nan)
    with pytest.raises(atvrec.ArgumentError, match="friction = -1"):
        atvrec.Tyre.physical(
            "fiala", cornering_stiffness_n_rad=1.0, slip_stiffness_n=1.0, friction=-1.0
        )


def test_suspension(vehicle: atvrec.Vehicle) -> None:
    ride = atvrec.Ride.quarter(vehicle, "fl")
    a, road, rate = ride.system()
    assert a.shape == (4, 4) and road.shape == rate.shape == (4, 1)
    poles = ride.poles()
    np.testing.assert_allclose(
        np.sort_complex(poles), np.sort_complex(np.linalg.eigvals(a)), rtol=1e-8
    )
    slow = ride.response(0, np.array([1e-3, 1.0]))
    np.testing.assert_allclose(slow[0, 2:], 1.0, rtol=1e-2)
    assert atvrec.Ride.full(vehicle).system()[0].shape == (14, 14)
    corner = atvrec.Corner(vehicle, "fl")
    jounce = np.linspace(-0.05, 0.05, 11)
    curves = corner.curves(jounce)
    assert all(values.shape == (11,) for values in curves.values())
    strut = np.gradient(curves["strut_length_m"], jounce)
    np.testing.assert_allclose(curves["motion_ratio"][1:-1], -strut[1:-1], rtol=1e-3)
    wrench = np.array([[100.0, -500.0, 1800.0, 0.0, 0.0, 10.0], [0.0, 0.0, 1500.0, 0.0, 0.0, 0.0]])
    members = corner.members(wrench)
    np.testing.assert_allclose(corner.wrench(members), wrench, atol=1e-8)
    with pytest.raises(atvrec.ArgumentError, match="jounce"):
        corner.curves(np.array([5.0]))
    with pytest.raises(atvrec.ArgumentError, match="wheel = \"front\""):
        atvrec.Corner(vehicle, "front")


def test_strain_chain() -> None:
    channel = atvrec.StrainChannel.axial()
    loads = np.linspace(-1000.0, 1000.0, 21)
    error = channel.load(channel.counts(loads)) - loads
    assert np.abs(error).max() <= 0.51 * channel.load_per_count
    assert atvrec.amplifier_gain(100.0) == pytest.approx(805.0)
    other = atvrec.amplifier_gain(100.0, base_gain=1.0, gain_ohm=49_400.0)
    assert other == pytest.approx(495.0)
    assert len(atvrec.strain_circuits()) == 16


def test_bad_input_is_named(vehicle: atvrec.Vehicle) -> None:
    model = atvrec.FourWheel(vehicle)
    state, inputs = model.rolling(5.0), model.inputs()
    bad = state.copy()
    bad[2] = np.inf
    with pytest.raises(atvrec.ArgumentError, match="state: yaw_rate_rad_s in row 0 is inf"):
        model.step(bad, inputs, 0.001)
    with pytest.raises(atvrec.ArgumentError, match="step_s = -0.001 s"):
        model.step(state, inputs, -0.001)
    with pytest.raises(atvrec.ArgumentError, match="last axis must hold 19"):
        model.step(state[:5], inputs, 0.001)
    with pytest.raises(atvrec.ArgumentError, match="numbers of runs differ: state 2, inputs 3"):
        model.step(np.tile(state, (2, 1)), np.tile(inputs, (3, 1)), 0.001)
    with pytest.raises(atvrec.ArgumentError, match="inputs has 5 rows for steps = 4"):
        model.simulate(state, np.tile(inputs, (5, 1)), 0.001, 4)
    with pytest.raises(atvrec.SimulationError, match="no equilibrium"):
        model.steady_turn(30.0, 5.0)
    with pytest.raises(atvrec.ArgumentError, match="bank_rad = NaN"):
        model.inputs(bank_rad=float("nan"))
    with pytest.raises(atvrec.ArgumentError, match="brake_n_m = -5 N m: must be 0 or greater"):
        model.step(state, model.inputs(brake_n_m=-5.0), 0.001)


def test_rest_is_physics_not_an_error(vehicle: atvrec.Vehicle) -> None:
    model = atvrec.FourWheel(vehicle)
    states = model.simulate(model.rolling(0.0), model.inputs(0.1), 0.001, 500)
    assert np.isfinite(states).all()
    np.testing.assert_allclose(states[-1, :3], 0.0, atol=1e-9)


def test_a_wheel_lifts_in_the_fourteen_degree_model(vehicle: atvrec.Vehicle) -> None:
    model = atvrec.FourteenDof(vehicle)
    rolling = model.rolling(7.0)
    loads = model.outputs(rolling, model.inputs())["load_n"]
    np.testing.assert_allclose(loads.sum(), vehicle.mass_kg * 9.80665, rtol=1e-3)
    states = model.simulate(rolling, model.inputs(0.35), 5e-4, 3_000, every=10)
    assert states.shape == (301, 32) and np.isfinite(states).all()
    outputs = model.outputs(states, np.tile(model.inputs(0.35), (301, 1)))
    assert outputs["load_n"].shape == (301, 4) and outputs["specific_force_m_s2"].shape == (301, 3)
    lifted = outputs["deflection_m"] < 0.0
    assert np.all(outputs["load_n"][lifted] == 0.0) and np.all(outputs["load_n"] >= 0.0)
    alone = model.step(rolling, model.inputs(0.35), 5e-4, 3_000)
    np.testing.assert_array_equal(alone, states[-1])
    assert model.jacobian(rolling, model.inputs()).shape == (32, 32)


def test_events_and_adaptive_steps(vehicle: atvrec.Vehicle) -> None:
    model = atvrec.FourteenDof(vehicle)
    start, inputs = model.rolling(12.0), model.inputs(0.35, friction_scale=1.4)
    found = model.simulate_events(start, inputs, 1.0, 1e-3)
    assert found["states"].shape == (len(found["time_s"]), 32)
    lifted = [event for event in found["events"] if event[2] == "lift-off"]
    assert lifted and lifted[0][1] in ("fl", "rl")
    # The tyre has just let go at the instant of the event.
    at = int(np.argmin(np.abs(found["time_s"] - lifted[0][0])))
    wheel = ("fl", "fr", "rl", "rr").index(lifted[0][1])
    assert abs(model.outputs(found["states"][at], inputs)["deflection_m"][wheel]) < 1e-6
    gentle = model.inputs(0.05)
    times, states = model.simulate_adaptive(model.rolling(6.0), gentle, 0.3)
    assert times[0] == 0.0 and times[-1] == pytest.approx(0.3) and np.all(np.diff(times) > 0.0)
    fixed = model.step(model.rolling(6.0), gentle, 1e-4, 3_000)
    np.testing.assert_allclose(states[-1], fixed, atol=1e-6)
    with pytest.raises(atvrec.ArgumentError, match="duration_s = -1 s"):
        model.simulate_adaptive(start, gentle, -1.0)
    with pytest.raises(atvrec.ArgumentError, match="give one row"):
        model.simulate_adaptive(np.tile(start, (2, 1)), gentle, 1.0)


def test_magic_formula_52_and_rational_tyres() -> None:
    tyre = atvrec.Tyre.magic_formula_52({"PHX1": 0.0, "fnomin": 4000.0})
    forces = tyre.forces(4000.0, 0.07, 0.0)
    # The independent calculation of the Rust tests.
    assert float(forces["lateral_n"]) == pytest.approx(-2697.83303, abs=1e-4)
    with pytest.raises(atvrec.ArgumentError, match="PKY9"):
        atvrec.Tyre.magic_formula_52({"PKY9": 1.0})
    with pytest.raises(atvrec.ArgumentError, match="FNOMIN = -1 N"):
        atvrec.Tyre.magic_formula_52({"FNOMIN": -1.0})
    rational = atvrec.Tyre.rational(
        nominal_load_n=1600.0,
        greatest_load_n=5600.0,
        longitudinal=[[22_400.0, 1472.0, 0.16, 1200.0, 0.8], [41_600.0, 2752.0, 0.17, 2240.0, 0.8]],
        lateral=[[7000.0, 1472.0, 0.44, 1360.0, 1.1], [11_900.0, 2656.0, 0.48, 2464.0, 1.15]],
        offset=[[0.178, 0.3, 0.8], [0.19, 0.32, 0.85]],
        radius_m=0.3175,
        vertical_stiffness_n_m=120_000.0,
    )
    peak = rational.forces(1600.0, np.arctan(0.44))["lateral_n"]
    assert float(peak) == pytest.approx(-1472.0)


def test_a_spring_tyre_feels_a_step() -> None:
    tyre = atvrec.SpringTyre(radius_m=0.3175, deflection_m=0.02, load_n=1500.0)
    flat = [[-1.0, 0.0], [1.0, 0.0]]
    force = tyre.forces([0.0, 0.2], [0.2975, 0.2975], flat)
    np.testing.assert_allclose(force, [[0.0, 1500.0]] * 2, atol=1e-6)
    step = [[-1.0, 0.0], [0.1, 0.0], [0.1001, 0.05], [1.0, 0.05]]
    assert tyre.forces([0.0], [0.2975], step)[0, 0] < 0.0
    with pytest.raises(atvrec.ArgumentError, match="positions must ascend"):
        tyre.forces([0.0], [0.3], [[1.0, 0.0], [0.0, 0.0]])


def test_steering(vehicle: atvrec.Vehicle) -> None:
    gear = atvrec.Steering(vehicle)
    hand = np.linspace(-2.0, 2.0, 9)
    wheels = gear.road_wheels(hand)
    assert wheels.shape == (9, 4) and np.all(np.diff(wheels[:, :2], axis=0) > 0.0)
    mean = wheels[:, :2].mean(axis=1)
    assert gear.steering_wheel_rad(float(mean[2])) == pytest.approx(hand[2])
    played = gear.road_wheels(hand, play=True)
    assert np.all(np.abs(played[:, 0]) <= np.abs(wheels[:, 0]) + gear.lash_rad)
    left, right = atvrec.ackermann_rad(0.3, 1.4471, 1.143)
    assert 1 / np.tan(right) - 1 / np.tan(left) == pytest.approx(1.143 / 1.4471)


def test_parity_stands_in_for_a_dead_channel(vehicle: atvrec.Vehicle) -> None:
    corner = atvrec.Corner(vehicle, "fl")
    wrench = np.array([300.0, -600.0, 1700.0, 0.0, 0.0, 0.0])
    members = corner.members(wrench)
    sigma = np.full(6, 50.0)
    found, covariance = corner.wrench_with_parity(members, sigma)
    np.testing.assert_allclose(found, wrench, atol=1e-6)
    assert covariance.shape == (6, 6)
    sigma[4] = np.inf
    found, dead = corner.wrench_with_parity(members, sigma)
    np.testing.assert_allclose(found, wrench, atol=1e-6)
    assert np.all(np.diag(dead) >= np.diag(covariance) * (1.0 - 1e-9))
    with pytest.raises(atvrec.ArgumentError, match="do not determine"):
        corner.wrench_with_parity(members, np.full(6, np.inf))


def test_sensors_files_of_ones_own(tmp_path: Path) -> None:
    root = Path(__file__).parents[2] / "model" / "sensors" / "thesis-10bit.toml"
    path = tmp_path / "mine.toml"
    text = root.read_text()
    path.write_text(text.replace("adc_bits = 10", "adc_bits = 12", 1))
    own, builtin = atvrec.StrainChannel.load_axial(path), atvrec.StrainChannel.axial()
    assert own.load_per_count < 0.3 * builtin.load_per_count
    with pytest.raises(atvrec.ArgumentError, match="no bending bridges"):
        atvrec.StrainChannel.load_bending(path)
    path.write_text("name = 3")
    with pytest.raises(atvrec.VehicleError, match="name"):
        atvrec.StrainChannel.load_axial(path)
    with pytest.raises(FileNotFoundError):
        atvrec.StrainChannel.load_axial(tmp_path / "absent.toml")
