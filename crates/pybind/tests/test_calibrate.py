"""Calibration through Python: what is put in is found; logs give what the command gives."""

from __future__ import annotations

import os
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import atvrec
from atvrec import calibrate

WHEELS = ("fl", "fr", "rl", "rr")
Doubles = npt.NDArray[np.float64]
LINKS = ("upper_front", "upper_rear", "lower_front", "lower_rear", "tie_rod")


def test_rest_tells_mean_noise_and_drift() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 10.0, 0.01)
    rest = calibrate.rest(time, 500.0 + 0.5 * time + rng.normal(0.0, 2.0, time.size))
    assert rest["mean"] == pytest.approx(502.5, abs=0.3)
    assert rest["noise"] == pytest.approx(2.0, rel=0.15)
    assert rest["slope_per_s"] == pytest.approx(0.5, abs=5 * rest["slope_sigma"])
    assert not rest["unmoved"]
    assert calibrate.rest(time, np.full(time.size, 7.0))["unmoved"]
    with pytest.raises(atvrec.DataError, match="20"):
        calibrate.rest(time[:5], time[:5])
    with pytest.raises(atvrec.ArgumentError, match="as many"):
        calibrate.rest(time, time[:-1])


def test_steering_from_turning_plates() -> None:
    hand = np.concatenate([np.linspace(-4.0, 4.0, 17), np.linspace(4.0, -4.0, 17)])
    wheel = (hand - 0.1) / 9.16
    found = calibrate.steer(hand, np.stack([wheel, wheel], axis=1), plate_sigma_rad=0.001)
    assert found["calibration"]
    centre = [one["value"] for one in found["findings"].values()]
    assert any(value == pytest.approx(0.1, abs=0.01) for value in centre), found["findings"]
    with pytest.raises(atvrec.DataError, match="sign"):
        calibrate.steer(hand, -np.stack([wheel, wheel], axis=1), plate_sigma_rad=0.001)


@pytest.fixture
def program() -> str:
    path = os.environ.get("ATVREC_BIN")
    if not path:
        pytest.skip("ATVREC_BIN names no atvrec; scripts/test-python does")
    return path


def recorded(
    program: str, folder: Path, manoeuvre: str, *arguments: str
) -> tuple[atvrec.Log, Path]:
    """A log of the virtual vehicle, and where it is."""
    path = folder / f"{manoeuvre}.mcap"
    command = [program, "simulate", "--manoeuvre", manoeuvre, *arguments, "-o", path]
    subprocess.run(command, check=True, capture_output=True)
    return atvrec.open(path), path


def calibrated(program: str, folder: Path, step: str, *logs: Path) -> dict[str, Any]:
    found = folder / f"{step}.toml"
    command = [program, "calibrate", step, *logs, "-o", found]
    subprocess.run(command, check=True, capture_output=True)
    return tomllib.loads(found.read_text())


def vehicle_of(log: atvrec.Log) -> atvrec.Vehicle:
    return atvrec.Vehicle.from_toml(log.attachments["prowler.vehicle.toml"].decode())


def sensors_of(log: atvrec.Log) -> atvrec.Sensors:
    return atvrec.Sensors.from_toml(log.attachments["thesis-10bit.sensors.toml"].decode())


def strain_of(log: atvrec.Log, start_s: float, end_s: float) -> tuple[Doubles, Doubles]:
    """Instants and counts of all strain channels, NaN where a message does not bring one."""
    columns = log.read("/strain", start_s, end_s)
    channels = [*LINKS, "lower_front_bending", "lower_rear_bending"]
    counts = [[columns[f"{wheel}.{name}.raw_counts"] for name in channels] for wheel in WHEELS]
    return columns["t_s"], np.moveaxis(np.array(counts), 2, 0)


def deflection_of(
    log: atvrec.Log, start_s: float | None = None, end_s: float | None = None
) -> tuple[Doubles, Doubles]:
    columns = log.read("/deflection", start_s, end_s)
    return columns["t_s"], np.stack([columns[f"{wheel}.raw_counts"] for wheel in WHEELS], axis=1)


def vectors_of(log: atvrec.Log, topic: str, *names: str) -> tuple[Doubles, Doubles]:
    columns = log.read(topic)
    return columns["t_s"], np.stack([columns[name] for name in names], axis=1)


def inertial_of(log: atvrec.Log) -> calibrate.Inertial:
    time_s, force = vectors_of(log, "/imu/imu", *(f"specific_force_m_s2.{axis}" for axis in "xyz"))
    _, rate = vectors_of(log, "/imu/imu", *(f"angular_rate_rad_s.{axis}" for axis in "xyz"))
    return {"time_s": time_s, "force_m_s2": force, "rate_rad_s": rate}


def test_the_zero_of_a_log_is_the_commands(program: str, tmp_path: Path) -> None:
    log, path = recorded(program, tmp_path, "jackstand")
    by_command = calibrated(program, tmp_path, "zero", path)
    time_s, strain = strain_of(log, 1.0, 6.0)
    pot_s, pots = deflection_of(log, 1.0, 6.0)
    deflection = np.full((time_s.size, 4), np.nan)
    for wheel in range(4):
        known = np.isfinite(pots[:, wheel])
        row = np.searchsorted(time_s, pot_s[known]).clip(0, time_s.size - 1)
        deflection[row, wheel] = pots[known, wheel]
    hanging: calibrate.Counts = {"time_s": time_s, "strain": strain, "deflection": deflection}
    found = calibrate.zero(vehicle_of(log), sensors_of(log), hanging, weight_sigma=0.02)
    assert found["faults"] == []
    for wheel in ("front_left", "rear_right"):
        for link in LINKS:
            offset = found["calibration"]["corner"][wheel]["strain"][link]["offset_counts"]
            expected = by_command["corner"][wheel]["strain"][link]["offset_counts"]
            assert offset == pytest.approx(expected, abs=0.6), (wheel, link)
    hanging["strain"] = strain[:, :, 0]
    with pytest.raises(atvrec.ArgumentError, match=r"hanging\.strain has the shape"):
        calibrate.zero(vehicle_of(log), sensors_of(log), hanging)


def test_the_load_rig_of_a_log_is_the_commands(program: str, tmp_path: Path) -> None:
    log, path = recorded(program, tmp_path, "load-rig")
    by_command = calibrated(program, tmp_path, "load-rig", path)
    marks = log.read("/mark")
    wheel, force_n, compression_m, counts, sigma, hand = [], [], [], [], [], []
    for start_s, text in zip(marks["t_s"], marks["text"], strict=True):
        _, name, *force = text.split()
        one = WHEELS.index(name.lower())
        strain_s, strain = strain_of(log, start_s, start_s + 2.0)
        rests = []
        for channel in range(7):
            known = np.isfinite(strain[:, one, channel])
            told = known.any()
            rest = calibrate.rest(strain_s[known], strain[known, one, channel]) if told else None
            rests.append((rest["mean"], rest["mean_sigma"]) if rest else (np.nan, np.nan))
        _, pots = deflection_of(log, start_s, start_s + 2.0)
        wheel.append(name.lower())
        force_n.append([float(part) for part in force])
        compression_m.append(0.15 / 1024 * (np.nanmean(pots[:, one]) - 512.0))
        counts.append([mean for mean, _ in rests])
        sigma.append([deviation for _, deviation in rests])
        hand.append(log.read("/steer", start_s, start_s + 2.0)["steering_wheel_rad"].mean())
    found = calibrate.load_rig(
        vehicle_of(log),
        sensors_of(log),
        wheel,
        force_n,
        compression_m,
        counts,
        sigma,
        steering_wheel_rad=hand,
    )
    for key, corner in by_command["corner"].items():
        for link, channel in corner["strain"].items():
            gain = found["calibration"]["corner"][key]["strain"][link]["gain_per_count"]
            # The readings at the ends of an interval differ between the command and `read`.
            assert gain == pytest.approx(channel["gain_per_count"], rel=1e-3), (key, link)
    assert len(found["counts_per_n"]) == 20


def test_unit_receivers_and_wheels_of_a_drive_are_the_commands(
    program: str, tmp_path: Path
) -> None:
    turned, turned_path = recorded(program, tmp_path, "turned")
    drive, path = recorded(program, tmp_path, "mixed-driving", "--for", "100")
    vehicle, sensors = vehicle_of(drive), sensors_of(drive)

    def inertial_log(log: atvrec.Log) -> calibrate.InertialLog:
        speed_s, wheels = vectors_of(log, "/wheel_speed", *(f"{wheel}.angular_speed_rad_s" for wheel in WHEELS))
        pot_s, pots = deflection_of(log)
        known = [np.isfinite(pots[:, wheel]) for wheel in range(4)]
        columns = [pots[rows, wheel] for wheel, rows in enumerate(known)]
        hand = log.read("/steer")
        radius = vehicle.to_dict()["front"]["tyre"]["unloaded_radius_m"]
        return {
            "imu": inertial_of(log),
            "speed_time_s": speed_s,
            "speed_m_s": radius * wheels.mean(axis=1),
            "compression_time_s": pot_s[known[0]],
            "compression_m": 0.15 / 1024 * (np.stack(columns, axis=1) - 512.0),
            "steering_wheel_time_s": hand["t_s"],
            "steering_wheel_rad": hand["steering_wheel_rad"],
        }

    by_command = calibrated(program, tmp_path, "imu", turned_path, path)["imu"]
    place = tomllib.loads(drive.attachments["thesis-10bit.sensors.toml"].decode())["imu"]["position_m"]
    logs = [inertial_log(turned), inertial_log(drive)]
    found = calibrate.imu(vehicle, logs, imu_m=place)["calibration"]
    for name, size in (("accel_bias_m_s2", 0.003), ("misalignment_rad", 0.0003)):
        assert found[name] == pytest.approx(by_command[name], abs=size), name

    velocity_s, velocity = vectors_of(
        drive, "/gnss/novatel/velocity", *(f"velocity_m_s.{way}" for way in ("east", "north", "up"))
    )
    attitude_s, attitude = vectors_of(
        drive, "/gnss/septentrio/attitude", "yaw_rad", "pitch_rad", "roll_rad"
    )
    imu = inertial_of(drive)
    antennas = calibrate.gnss(sensors, imu, velocity_s, velocity, attitude_s, attitude)
    receiver = calibrated(program, tmp_path, "gnss", path)["gnss_velocity"]
    assert antennas["calibration"]["antenna_m"] == pytest.approx(receiver["antenna_m"], abs=1e-3)
    assert antennas["calibration"]["latency_s"] == pytest.approx(receiver["latency_s"], abs=1e-4)

    wheel_s, wheels = vectors_of(drive, "/wheel_speed", *(f"{wheel}.angular_speed_rad_s" for wheel in WHEELS))
    radii = calibrate.wheel_radius(velocity_s, velocity, imu, wheel_s, wheels)["findings"]
    corner = calibrated(program, tmp_path, "wheel-radius", path)["corner"]["front_left"]
    assert radii["FL rolling radius"]["value"] == pytest.approx(corner["rolling_radius_m"], rel=1e-6)
