"""Scores in Python have the keys that their types promise, and say what the columns say."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest

import atvrec
from atvrec import scoring


def test_a_score_has_the_promised_keys(simulated_log: Path) -> None:
    found = atvrec.score(simulated_log)
    assert set(found) == set(get_type_hints(scoring.Score))
    assert found["seconds"] > 1.0
    for row in found["signals"]:
        assert set(row) == set(get_type_hints(scoring.Signal))
    carrier, contact = (row for row in found["forces"] if row["output"] == "estimate")
    assert (carrier["frame"], contact["frame"]) == ("wheel_carrier", "contact")
    for forces in (carrier, contact):
        assert set(forces) == set(get_type_hints(scoring.Forces))
        assert forces["windows"] is not None
        for part in (forces["near_stops"], forces["elsewhere"], forces["near_standstills"]):
            assert part is not None
            assert set(part) == set(get_type_hints(scoring.PartForces))
    assert set(found["stops"]) == set(get_type_hints(scoring.Stops))
    assert found["channels"] is not None
    assert set(found["channels"]) == set(get_type_hints(scoring.Channels))
    assert found["channels"]["excluded_healthy"] == []
    assert found["forces_nees"] is not None
    assert set(found["forces_nees"]) == set(get_type_hints(scoring.Consistency))
    kinds = [row["kind"] for row in found["innovations"]]
    assert {"strain", "strut", "accelerometer", "gyro", "gnss_velocity"} <= set(kinds)
    for of_kind in found["innovations"]:
        assert set(of_kind) == set(get_type_hints(scoring.Innovations))
    assert atvrec.innovations(simulated_log) == found["innovations"]
    same = atvrec.score(atvrec.open(simulated_log), from_s=2.0)
    assert same == found
    assert atvrec.score(simulated_log, from_s=3.0)["seconds"] < found["seconds"]


def test_simple_methods_have_the_numbers_of_the_program(simulated_log: Path) -> None:
    program = os.environ.get("ATVREC_BIN")
    if not program:
        pytest.skip("ATVREC_BIN names no program; scripts/test-python sets it")
    found = atvrec.score(simulated_log, methods=True)
    assert set(found) == set(get_type_hints(scoring.ScoreWithMethods))
    assert {row["output"] for row in found["methods"]} == {"deflection", "statics", "model"}
    command = [program, "score", "--methods", "--json", str(simulated_log)]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert found == json.loads(printed)


def test_a_score_is_that_of_the_columns(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    truth, told = log.read("/truth/tyre_forces"), log.read("/estimate/tyre_forces")
    _, here, there = np.intersect1d(
        told["log_time_ns"], truth["log_time_ns"], return_indices=True
    )
    begin_ns = truth["log_time_ns"][0] + 2_000_000_000
    late = told["log_time_ns"][here] >= begin_ns
    error = (told["fl.z_n"][here] - truth["fl.z_n"][there])[late]
    rows = atvrec.score(log)["signals"]
    row = next(r for r in rows if (r["signal"], r["wheel"]) == ("measured_force_z", "FL"))
    assert row["count"] == error.size
    assert row["rmse"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)


def test_a_log_is_identical_to_itself(simulated_log: Path) -> None:
    found = atvrec.compare(simulated_log, atvrec.open(simulated_log))
    assert set(found) == set(get_type_hints(scoring.Comparison))
    assert found["identical"]
    for row in found["signals"]:
        assert set(row) == set(get_type_hints(scoring.Difference))
        assert row["largest"] == 0.0


def test_what_cannot_be_scored_is_said(simulated_log: Path, reference_log: Path) -> None:
    with pytest.raises(atvrec.LogError, match="vehicle"):
        atvrec.score(reference_log)
    with pytest.raises(atvrec.LogError, match="smooth"):
        atvrec.score(simulated_log, smoothed=True)
    with pytest.raises(atvrec.ArgumentError, match="from_s"):
        atvrec.score(simulated_log, from_s=float("nan"))
    with pytest.raises(atvrec.ArgumentError, match="from_s"):
        atvrec.innovations(simulated_log, from_s=-1.0)
