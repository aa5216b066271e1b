"""Objects that went through a pickle behave as before, also in another process."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest

import atvrec

VEHICLE = atvrec.Vehicle.builtin("prowler").with_values({"body.mass_kg": 651.25})
SENSORS = atvrec.Sensors.builtin("full-bridge-16bit-bending")
CALIBRATION = atvrec.Calibration.from_dict(
    {"vehicle": VEHICLE.name, "imu": {"gyro_bias_rad_s": [1e-3, 0.1, 1.0 / 3.0]}}
)
TUNING = atvrec.Tuning().with_values({"motion.gate_sigma": 6.1, "lift.steps": 7})

SLIP = np.linspace(-0.3, 0.3, 7)
LOAD = np.full(7, 1_500.0)


def text(value: Any) -> Any:
    return value.to_toml()


def forces(tyre: Any) -> Any:
    return tyre.forces(LOAD, SLIP)["lateral_n"]


def step(model: Any) -> Any:
    return model.simulate(model.rolling(6.0), model.inputs(0.1), 1e-3, 50)


CASES: list[tuple[str, Any, Callable[[Any], Any]]] = [
    ("vehicle", VEHICLE, text),
    ("sensors", SENSORS, text),
    ("calibration", CALIBRATION, text),
    ("tuning", TUNING, text),
    ("tyre of a vehicle", atvrec.Tyre.of(VEHICLE, "rear"), forces),
    (
        "physical tyre",
        atvrec.Tyre.physical(
            "brush",
            cornering_stiffness_n_rad=20_000.0,
            slip_stiffness_n=15_000.0,
            friction=0.8,
            reference_load_n=1_400.0,
            load_exponent=0.7,
        ),
        forces,
    ),
    ("Magic Formula of 1989", atvrec.Tyre.magic_formula_89(), forces),
    ("Magic Formula 5.2", atvrec.Tyre.magic_formula_52({"PCY1": 1.5}), forces),
    (
        "rational tyre",
        atvrec.Tyre.rational(
            nominal_load_n=1_500.0,
            greatest_load_n=4_000.0,
            longitudinal=[[30_000, 1_400, 0.1, 1_200, 0.4], [55_000, 2_600, 0.1, 2_200, 0.4]],
            lateral=[[20_000, 1_300, 0.2, 1_100, 0.5], [36_000, 2_400, 0.2, 2_000, 0.5]],
            offset=[[0.17, 0.2, 0.4], [0.18, 0.2, 0.4]],
            radius_m=0.3,
            vertical_stiffness_n_m=150_000.0,
        ),
        forces,
    ),
    (
        "spring tyre",
        atvrec.SpringTyre(radius_m=0.3, deflection_m=0.02, load_n=1_500.0, interradial_part=0.2),
        lambda tyre: tyre.forces([0.1], [0.28], [[-1.0, 0.0], [1.0, 0.01]]),
    ),
    ("steering", atvrec.Steering(VEHICLE), lambda gear: gear.road_wheels([0.5, -0.2])),
    ("bicycle", atvrec.Bicycle(VEHICLE), lambda model: model.eigenvalues([5.0, 15.0])),
    ("four wheels", atvrec.FourWheel(VEHICLE), step),
    ("fourteen degrees of freedom", atvrec.FourteenDof(VEHICLE), step),
    ("quarter car", atvrec.Ride.quarter(VEHICLE, "rl"), lambda ride: ride.poles()),
    ("half car", atvrec.Ride.half(VEHICLE), lambda ride: ride.poles()),
    ("lateral half car", atvrec.Ride.half_lateral(VEHICLE, "fl"), lambda ride: ride.poles()),
    ("full car", atvrec.Ride.full(VEHICLE), lambda ride: ride.poles()),
    ("corner", atvrec.Corner(VEHICLE, "fr"), lambda one: one.curves([0.01])["camber_rad"]),
    ("strain channel", atvrec.StrainChannel.axial(), lambda one: one.counts([100.0, -300.0])),
    (
        "bending channel",
        atvrec.StrainChannel.of(SENSORS, "bending"),
        lambda one: one.counts([10.0, -30.0]),
    ),
]


@pytest.mark.parametrize(("value", "behaviour"), [case[1:] for case in CASES], ids=[c[0] for c in CASES])
def test_a_pickle_keeps_the_behaviour(value: Any, behaviour: Callable[[Any], Any]) -> None:
    for protocol in (2, pickle.HIGHEST_PROTOCOL):
        again = pickle.loads(pickle.dumps(value, protocol))
        assert type(again) is type(value)
        np.testing.assert_array_equal(behaviour(again), behaviour(value))
    np.testing.assert_array_equal(behaviour(copy.deepcopy(value)), behaviour(value))


def test_every_class_of_the_package_that_holds_values_is_tested() -> None:
    tested = {type(case[1]) for case in CASES}
    cannot = {atvrec.Log, atvrec.Estimator}
    classes = {
        value
        for name in atvrec.__all__
        if isinstance(value := getattr(atvrec, name), type)
        and value.__module__ in ("atvrec", "atvrec._atvrec")
        and not issubclass(value, BaseException)
    }
    assert classes - cannot == tested


def _in_a_process(job: tuple[Any, Any, Any, Any, Any]) -> tuple[float, str]:
    vehicle, sensors, calibration, tuning, model = job
    atvrec.Estimator(vehicle, sensors, calibration, tuning)
    return float(model.simulate(model.rolling(6.0), model.inputs(0.1), 1e-3, 50)[-1, 0]), tuning.to_toml()


def test_other_processes_take_them() -> None:
    model = atvrec.FourWheel(VEHICLE)
    job = (VEHICLE, SENSORS, CALIBRATION, TUNING, model)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(_in_a_process, [job, job]))
    assert found == [_in_a_process(job)] * 2
