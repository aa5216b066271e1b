"""Identification through Python: parameters that are known, refusals, logs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import atvrec
from atvrec import identify


@pytest.fixture
def vehicle() -> atvrec.Vehicle:
    return atvrec.Vehicle.builtin("prowler")


def single_track(vehicle: atvrec.Vehicle, stiffness: tuple[float, float]) -> identify.Drive:
    """A slow sine of the linear two-wheel model at 8 m/s, with noise on the sideslip angle."""
    body = vehicle.to_dict()["body"]
    mass, inertia = body["mass_kg"], body["inertia_kg_m2"][2]
    a, b = body["front_axle_to_cg_m"], body["cg_to_rear_axle_m"]
    dt, speed = 0.01, 8.0
    time = np.arange(0.0, 30.0, dt)
    steer = 0.05 * np.sin(2.0 * np.pi * 0.3 * time)
    lateral, rate = np.zeros_like(time), np.zeros_like(time)
    acceleration = np.zeros_like(time)
    v = r = 0.0
    for i, delta in enumerate(steer):
        lateral[i], rate[i] = v, r
        for sub in range(20):
            front = -stiffness[0] * (np.arctan2(v + a * r, speed) - delta)
            rear = -stiffness[1] * np.arctan2(v - b * r, speed)
            across = (front * np.cos(delta) + rear) / mass
            if sub == 0:
                acceleration[i] = across
            v += (across - r * speed) * dt / 20
            r += (a * front * np.cos(delta) - b * rear) / inertia * dt / 20
    sideslip = np.arctan2(lateral, speed)
    sideslip += np.random.default_rng(1).normal(0.0, 0.002, time.size)
    return identify.Drive(
        dt,
        speed_m_s=np.hypot(speed, lateral),
        sideslip_rad=sideslip,
        yaw_rate_rad_s=rate,
        lateral_m_s2=acceleration,
        steer_rad=steer,
    )


def test_cornering_stiffness_of_a_single_track_is_found(vehicle: atvrec.Vehicle) -> None:
    stiffness = (6_000.0, 17_000.0)
    drive = single_track(vehicle, stiffness)
    assert len(drive) == 3000 and drive.dt_s == 0.01
    found = identify.cornering(drive, vehicle)
    for name, truth in zip(("front", "rear"), stiffness, strict=True):
        one = found["findings"][f"cornering_stiffness_{name}"]
        assert one["unit"] == "N/rad"
        assert one["value"] == pytest.approx(truth, rel=0.1)
        assert one["interval"] is not None and one["interval"][0] < one["value"] < one["interval"][1]
    assert found["covariance"] is not None and found["covariance"].shape == (4, 4)
    again = identify.cornering(drive, vehicle)
    assert again["findings"] == found["findings"], "the same seed gives the same intervals"


def test_what_a_drive_lacks_is_told(vehicle: atvrec.Vehicle) -> None:
    drive = identify.Drive(0.01, yaw_rate_rad_s=np.zeros(1000), steer_rad=np.zeros(1000))
    with pytest.raises(atvrec.DataError, match="there is no speed"):
        identify.cornering(drive, vehicle)
    with pytest.raises(atvrec.DataError, match="steps of the steer angle|no lateral"):
        identify.step_response(drive)
    with pytest.raises(atvrec.ArgumentError, match="999 values"):
        identify.Drive(0.01, yaw_rate_rad_s=np.zeros(1000), steer_rad=np.zeros(999))
    with pytest.raises(atvrec.ArgumentError, match="shape"):
        identify.Drive(0.01, yaw_rate_rad_s=np.zeros((10, 2)))
    with pytest.raises(atvrec.ArgumentError, match="must be one of linear, fiala"):
        identify.tyre(
            "square",  # type: ignore[arg-type]
            np.ones(9),
            np.ones(9),
            np.ones(9),
            dt_s=0.1,
            reference_load_n=1000.0,
        )


def test_a_tyre_is_fitted_to_its_own_curve(vehicle: atvrec.Vehicle) -> None:
    tyre = atvrec.Tyre.physical(
        "fiala", cornering_stiffness_n_rad=15_000.0, slip_stiffness_n=12_000.0, friction=0.8
    )
    rng = np.random.default_rng(2)
    slip = 0.25 * np.sin(np.linspace(0.0, 40.0, 800))
    load = np.full(800, 1_500.0)
    force = tyre.forces(load, slip)["lateral_n"] + rng.normal(0.0, 10.0, 800)
    found = identify.tyre("fiala", load, slip, force, dt_s=0.05, reference_load_n=1_500.0)
    values = found["findings"]
    assert values["cornering_stiffness"]["value"] == pytest.approx(15_000.0, rel=0.03)
    assert values["friction"]["value"] == pytest.approx(0.8, rel=0.02)


def test_roll_centres_come_from_hard_points(vehicle: atvrec.Vehicle) -> None:
    found = identify.roll_centre(vehicle)["findings"]
    corner = atvrec.Corner(vehicle, "fl")
    height = corner.curves(np.zeros(1))["roll_centre_height_m"][0]
    assert found["roll_centre_height_front"]["value"] == pytest.approx(height, abs=0.03)


def test_a_log_is_a_drive(vehicle: atvrec.Vehicle) -> None:
    path = os.environ.get("ATVREC_TEST_LOG")
    if not path:
        pytest.skip("ATVREC_TEST_LOG names no log; scripts/test-python makes it")
    drive = identify.drive_of(atvrec.open(path), start_s=0.0)
    assert len(drive) > 300
    with pytest.raises(atvrec.DataError, match=r"s of usable data, 6\.0 s are needed"):
        identify.cornering(drive, vehicle)


def run(*arguments: str) -> None:
    """Runs the program, which can run once in a process."""
    subprocess.run([sys.executable, "-m", "atvrec._program", *arguments], check=True)


def test_an_imported_drive_is_identified(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A table of a drive gives the stiffnesses of the drive; frames without estimates are refused."""
    monkeypatch.chdir(tmp_path)
    atvrec.simulate("slow-sine", "drive.mcap", seed=11)
    drive = atvrec.open("drive.mcap")
    fields = {
        "/imu/imu.specific_force_m_s2.x": ("acceleration.x", "m/s^2"),
        "/imu/imu.specific_force_m_s2.y": ("acceleration.y", "m/s^2"),
        "/imu/imu.specific_force_m_s2.z": ("acceleration.z", "m/s^2"),
        "/imu/imu.angular_rate_rad_s.x": ("rate.x", "rad/s"),
        "/imu/imu.angular_rate_rad_s.y": ("rate.y", "rad/s"),
        "/imu/imu.angular_rate_rad_s.z": ("rate.z", "rad/s"),
        "/steer.steering_wheel_rad": ("steer", "rad"),
    }
    velocity = {
        "/gnss/novatel/velocity.velocity_m_s.east": ("gnss.velocity_east", "m/s"),
        "/gnss/novatel/velocity.velocity_m_s.north": ("gnss.velocity_north", "m/s"),
        "/gnss/novatel/velocity.velocity_m_s.up": ("gnss.velocity_up", "m/s"),
    }
    table = drive.frame(list(fields), rate_hz=100).join(drive.frame(list(velocity)), how="outer")
    chosen = fields | velocity
    table = table[list(chosen)].set_axis([quantity for quantity, _ in chosen.values()], axis=1)
    table.index = (table.index - table.index[0]).total_seconds()
    table.to_csv("drive.csv", index_label="t", float_format="%.9f")
    columns = [
        f'[column.c{at}]\nfrom = "{quantity}"\nquantity = "{quantity}"\nunit = "{unit}"\n'
        for at, (quantity, unit) in enumerate(chosen.values())
    ]
    Path("map.toml").write_text('[time]\ncolumn = "t"\nunit = "s"\n' + "".join(columns))
    table_of = ["import", "csv", "drive.csv", "--columns", "map.toml", "--vehicle", "prowler"]
    run(*table_of, "-o", "table.mcap")
    (ours,) = drive.identify("cornering")
    (imported,) = atvrec.open("table.mcap").identify("cornering")
    for name in ("cornering_stiffness_front", "cornering_stiffness_rear"):
        one, other = ours["findings"][name], imported["findings"][name]
        sigma = np.hypot(one["sigma"], other["sigma"])
        assert abs(one["value"] - other["value"]) < 2.0 * sigma, (one, other)
    run("export", "drive.mcap", "--raw", "candump", "-o", "drive.log")
    run("import", "candump", "drive.log", "-o", "raw.mcap")
    with pytest.raises(atvrec.ArgumentError, match="nothing was estimated; write a log with estimates"):
        atvrec.open("raw.mcap").identify("cornering")


def test_a_pendulum_tells_its_inertia() -> None:
    time = np.arange(0.0, 40.0, 0.02)
    mass, arm, inertia = 300.0, 1.2, 120.0
    omega = np.sqrt(mass * 9.80665 * arm / (inertia + mass * arm**2))
    rate = 0.1 * np.exp(-0.01 * time) * np.cos(omega * time)
    rate += np.random.default_rng(4).normal(0.0, 0.002, time.size)
    found = identify.pendulum(rate, dt_s=0.02, mass_kg=mass, distance_m=arm)
    assert found["findings"]["inertia"]["value"] == pytest.approx(inertia, rel=0.02)
    with pytest.raises(atvrec.ArgumentError, match="stiffness_n_m_rad"):
        identify.pendulum(rate, dt_s=0.02, mass_kg=mass)
