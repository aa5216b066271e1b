"""Replay and simulation in process: the bytes of the program, its rules on outputs, Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from test_estimator import compare_with_log

import atvrec


@pytest.fixture
def program() -> str:
    """The program, named by ATVREC_BIN."""
    path = os.environ.get("ATVREC_BIN")
    if not path:
        pytest.skip("ATVREC_BIN names no program; scripts/test-python makes one")
    return path


def run(program: str, *arguments: object) -> str:
    done = subprocess.run(
        [program, *map(str, arguments)], capture_output=True, text=True, check=True
    )
    return done.stdout


def test_a_simulation_has_the_bytes_of_the_program(program: str, tmp_path: Path) -> None:
    ours, theirs = tmp_path / "ours.mcap", tmp_path / "theirs.mcap"
    calibrations = tmp_path / "ours.toml", tmp_path / "theirs.toml"
    done = atvrec.simulate(
        "step-steer", ours, seed=11, duration_s=1.5, true_calibration=calibrations[0]
    )
    run(
        program, "simulate", "--manoeuvre", "step-steer", "--seed", 11, "--for", 1.5,
        "-o", theirs, "--true-calibration", calibrations[1],
    )  # fmt: skip
    assert ours.read_bytes() == theirs.read_bytes()
    assert calibrations[0].read_bytes() == calibrations[1].read_bytes()
    assert done.drive == "step-steer"
    assert done.arrivals == atvrec.open(ours).info()["counters"]["arrivals"]


def test_a_replay_has_the_bytes_of_the_program(
    program: str, simulated_log: Path, tmp_path: Path
) -> None:
    vehicle = atvrec.Vehicle.builtin("prowler").with_values({"body.mass_kg": 650.0})
    heavy = tmp_path / "heavy.toml"
    heavy.write_text(vehicle.to_toml())
    ours, theirs = tmp_path / "ours.mcap", tmp_path / "theirs.mcap"
    done = atvrec.replay(
        simulated_log, ours, vehicle=heavy, without=["gnss_attitude", "strain"], smooth=True
    )
    printed = json.loads(
        run(
            program, "replay", simulated_log, "-o", theirs, "--vehicle", heavy,
            "--without", "gnss_attitude,strain", "--smooth", "--json",
        )  # fmt: skip
    )
    assert ours.read_bytes() == theirs.read_bytes()
    assert done.estimated is None
    printed.pop("took_s")
    assert {name: value for name, value in asdict(done).items() if name != "estimated"} == printed

    in_memory = atvrec.replay(
        atvrec.open(simulated_log), vehicle=vehicle, without=["gnss_attitude", "strain"]
    )
    assert in_memory.estimated is not None
    compare_with_log(in_memory.estimated.estimates, atvrec.open(ours), least=300)
    assert in_memory.records == done.records


def test_a_replay_of_an_unchanged_log_is_verified(simulated_log: Path) -> None:
    done = atvrec.replay(simulated_log, verify=True)
    assert done.verify is not None
    assert done.verify["identical"] is True
    assert done.estimated is not None
    compare_with_log(done.estimated.estimates, atvrec.open(simulated_log), least=300)


def test_a_score_has_the_numbers_of_the_program(program: str, simulated_log: Path) -> None:
    assert atvrec.score(simulated_log) == json.loads(run(program, "score", simulated_log, "--json"))


def test_objects_take_the_place_of_files(simulated_log: Path, tmp_path: Path) -> None:
    """A vehicle that has no file can be driven, and its log carries it."""
    vehicle = atvrec.Vehicle.builtin("prowler").with_values({"body.mass_kg": 650.0})
    log = tmp_path / "log.mcap"
    atvrec.simulate("circle", log, vehicle=vehicle, sensors=atvrec.Sensors.builtin(), duration_s=1.0)
    attached = atvrec.open(log).attachments
    assert atvrec.Vehicle.from_toml(attached["vehicle.toml"].decode()).mass_kg == 650.0
    assert "sensors.toml" in attached
    verified = atvrec.replay(log, verify=True)
    assert verified.verify is not None
    assert verified.verify["identical"] is True
    calibration = atvrec.Calibration.nominal(vehicle)
    same = atvrec.replay(log, calibration=calibration, sensors=atvrec.Sensors.builtin())
    assert same.estimated is not None
    compare_with_log(same.estimated.estimates, atvrec.open(log), least=80)


def test_nothing_is_replaced_without_force(simulated_log: Path, tmp_path: Path) -> None:
    taken = tmp_path / "taken.mcap"
    taken.write_text("precious")
    with pytest.raises(FileExistsError, match=r"taken.mcap exists already.*force=True"):
        atvrec.replay(simulated_log, taken)
    with pytest.raises(FileExistsError, match="force=True"):
        atvrec.simulate("circle", taken, duration_s=0.5)
    assert taken.read_text() == "precious"
    with pytest.raises(atvrec.ArgumentError, match="is the input .* cannot be its output"):
        atvrec.replay(simulated_log, simulated_log, force=True)
    with pytest.raises(atvrec.ArgumentError, match="wrong extension for a log"):
        atvrec.replay(simulated_log, tmp_path / "log.txt")
    with pytest.raises(atvrec.ArgumentError, match="the directory .* does not exist; create it"):
        atvrec.replay(simulated_log, tmp_path / "absent" / "log.mcap")
    atvrec.simulate("circle", taken, duration_s=0.5, force=True)
    assert atvrec.open(taken).topics
    assert [path.name for path in tmp_path.iterdir()] == ["taken.mcap"]


def test_errors_name_the_value_and_the_next_step(simulated_log: Path, tmp_path: Path) -> None:
    output = tmp_path / "log.mcap"
    with pytest.raises(atvrec.ArgumentError, match='"gnss_attitud" is not known\n.*did you mean'):
        atvrec.replay(simulated_log, without=["gnss_attitud"])  # type: ignore[list-item]
    with pytest.raises(atvrec.ArgumentError, match="smooth = True: needs output"):
        atvrec.replay(simulated_log, smooth=True)
    with pytest.raises(atvrec.ArgumentError, match="config = atvrec.toml: excludes vehicle"):
        atvrec.replay(simulated_log, config="atvrec.toml", vehicle="prowler")
    with pytest.raises(FileNotFoundError, match="absent.toml"):
        atvrec.replay(simulated_log, config=tmp_path / "absent.toml")
    with pytest.raises(FileNotFoundError, match="absent.toml"):
        atvrec.replay(simulated_log, vehicle=tmp_path / "absent.toml")
    with pytest.raises(atvrec.ArgumentError, match="give one of them"):
        atvrec.simulate(None, output)
    with pytest.raises(atvrec.ArgumentError, match='"step" is not a manoeuvre; use one of: circle'):
        atvrec.simulate("step", output)
    with pytest.raises(atvrec.ArgumentError, match="duration_s = nan s"):
        atvrec.simulate("circle", output, duration_s=float("nan"))
    other = atvrec.Calibration.from_toml('vehicle = "another"')
    with pytest.raises(atvrec.ArgumentError, match='"another", but the vehicle is "'):
        atvrec.replay(simulated_log, calibration=other)
    assert not list(tmp_path.iterdir())


def test_other_threads_run_during_a_replay(simulated_log: Path) -> None:
    steps = 0
    done = threading.Event()

    def count() -> None:
        nonlocal steps
        while not done.is_set():
            steps += 1
            time.sleep(1e-3)

    counter = threading.Thread(target=count)
    counter.start()
    begin = time.perf_counter()
    atvrec.replay(simulated_log)
    took_s = time.perf_counter() - begin
    done.set()
    counter.join()
    assert steps > 20.0 * took_s


INTERRUPTED = """
import sys, atvrec
print("ready", flush=True)
try:
    atvrec.simulate("mixed-driving", sys.argv[1], duration_s=100_000.0)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_control_c_ends_a_simulation(tmp_path: Path) -> None:
    output = tmp_path / "log.mcap"
    child = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(output)], stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "ready\n"
    active = tmp_path / "log.mcap.active"
    deadline = time.monotonic() + 60.0
    while not active.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    child.send_signal(signal.SIGINT)
    begin = time.monotonic()
    printed, _ = child.communicate(timeout=60.0)
    assert printed == "interrupted\n"
    assert child.returncode == 0
    assert time.monotonic() - begin < 10.0
    assert not list(tmp_path.iterdir()), "the unfinished log is removed"


def test_all_manoeuvres_are_named() -> None:
    names = atvrec.manoeuvres()
    assert {"circle", "step-steer", "mixed-driving"} <= set(names)
    assert len(names) == len(set(names))
    assert np.all([name == name.lower() for name in names])
