"""The estimator through Python: the bits of the program, one by one and as arrays, and its errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import Writer

import atvrec


def vehicle_of(log: atvrec.Log) -> tuple[atvrec.Vehicle, atvrec.Sensors]:
    texts = {name: data.decode() for name, data in log.attachments.items()}
    return (
        atvrec.Vehicle.from_toml(texts["prowler.vehicle.toml"]),
        atvrec.Sensors.from_toml(texts["thesis-10bit.sensors.toml"]),
    )


def compare_with_log(found: atvrec.Estimates, log: atvrec.Log, *, least: int) -> None:
    """All values of all instants that both have, bit by bit."""
    motion, forces = log.read("/estimate/motion"), log.read("/estimate/tyre_forces")
    assert np.array_equal(motion["log_time_ns"], forces["log_time_ns"])
    _, here, there = np.intersect1d(
        found.time_ns, motion["log_time_ns"], assume_unique=True, return_indices=True
    )
    assert len(here) >= least
    compared = {
        "velocity_x_m_s": found.velocity_x_m_s,
        "velocity_y_m_s": found.velocity_y_m_s,
        "sideslip_rad": found.sideslip_rad,
        "sideslip_sigma_rad": found.sideslip_sigma_rad,
        "roll_rad": found.roll_rad,
        "pitch_rad": found.pitch_rad,
        "acceleration_m_s2.y": found.acceleration_m_s2[:, 1],
        "rl.slip_angle_rad": found.slip_angle_rad[:, 2],
    }
    for name, values in compared.items():
        np.testing.assert_array_equal(values[here], motion[name][there], err_msg=name)
    for wheel, name in enumerate(("fl", "fr", "rl", "rr")):
        for axis, letter in enumerate("xyz"):
            column = forces[f"{name}.{letter}_n"][there]
            np.testing.assert_array_equal(found.force_n[here, wheel, axis], column)


def test_samples_of_a_log_give_its_estimates(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    samples = atvrec.samples(log)
    assert {"imu", "gnss_velocity", "gnss_attitude", "corner", "steer"} <= set(samples)
    estimator = atvrec.Estimator(*vehicle_of(log))
    estimator.advance(log.start_ns)
    found = estimator.run(samples)
    instants = log.read("/estimate/motion")["log_time_ns"].size
    compare_with_log(found.estimates, log, least=instants - 2)
    assert found.estimates.force_frame == "wheel_carrier"
    assert set(found.estimates.force_source[-1]) == {"fusion"}
    parameters = log.read("/estimate/parameters")
    np.testing.assert_array_equal(found.parameters.time_ns, parameters["log_time_ns"])
    np.testing.assert_array_equal(
        found.parameters.stiffness_factor[:, 0], parameters["front.stiffness_factor"]
    )
    assert len(estimator.take().estimates) == 0


def test_samples_one_by_one_give_the_same_bits(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    samples = atvrec.samples(log)
    until = log.start_ns + 700_000_000
    rows = [
        (int(time_ns), kind, row)
        for kind, table in samples.items()
        for row, time_ns in enumerate(table["log_time_ns"])  # type: ignore[index]
        if time_ns <= until
    ]
    one_by_one, at_once = (atvrec.Estimator(*vehicle_of(log)) for _ in range(2))
    for estimator in (one_by_one, at_once):
        estimator.advance(log.start_ns)
    for time_ns, kind, row in sorted(rows, key=lambda entry: entry[0]):
        values = {name: column[row] for name, column in samples[kind].items()}  # type: ignore
        times = {
            "log_time_ns": int(values.pop("log_time_ns")),
            "valid_time_ns": int(values.pop("valid_time_ns")),
        }
        values = {name: _plain(value) for name, value in values.items()}
        getattr(one_by_one, f"push_{kind}")(**times, **values)
    cut = {
        kind: {name: column[table["log_time_ns"] <= until] for name, column in table.items()}
        for kind, table in samples.items()
    }
    found, expected = one_by_one.take(), at_once.run(cut)  # type: ignore[arg-type]
    assert len(found.estimates) > 60
    for name, values in vars(expected.estimates).items():
        np.testing.assert_array_equal(getattr(found.estimates, name), values, err_msg=name)


def _plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value


def test_calibration_and_tuning_have_an_effect(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    vehicle, sensors = vehicle_of(log)
    samples = atvrec.samples(log)

    def last_force(
        calibration: atvrec.Calibration | None = None, tuning: atvrec.Tuning | None = None
    ) -> float:
        estimator = atvrec.Estimator(vehicle, sensors, calibration, tuning)
        return float(estimator.run(samples).estimates.force_n[-1, 0, 2])

    nominal = last_force()
    assert nominal > 0.0
    offset = {"vehicle": vehicle.name, "corner": {"front_left": {"deflection": {"offset_counts": 520.0}}}}
    assert last_force(atvrec.Calibration.from_dict(offset)) != nominal
    assert last_force(tuning=atvrec.Tuning().with_values({"motion.aiding.lateral_sigma_m_s": 5.0})) != nominal


def test_payload_on_the_vehicle_has_an_effect(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    plain, sensors = vehicle_of(log)
    driver = '[[payload]]\nname = "driver"\nmass_kg = 80.0\nposition_m = [-0.8, 0.3, 0.7]\n'
    vehicle = atvrec.Vehicle.from_toml(plain.to_toml() + "\n" + driver)
    samples = atvrec.samples(log)

    def loads(payload: tuple[str, ...]) -> Any:
        estimator = atvrec.Estimator(vehicle, sensors, payload=payload)
        return estimator.run(samples).estimates.force_n[-1, :, 2]

    assert np.array_equal(loads(()), atvrec.Estimator(plain, sensors).run(samples).estimates.force_n[-1, :, 2])
    assert not np.array_equal(loads(("driver",)), loads(()))
    with pytest.raises(atvrec.ArgumentError, match="driver"):
        atvrec.Estimator(vehicle, payload=["pilot"])


def _control_log(path: Path, rows: list[dict[str, float]], units: dict[str, str]) -> None:
    """A log with values of a controller, 10 ms apart, as the recorder writes them."""
    file = descriptor_pb2.FileDescriptorProto(
        name="signals.proto", package="atvrec.signals", syntax="proto2"
    )
    message = file.message_type.add(name="car")
    for number, name in enumerate(units, start=1):
        message.field.add(
            name=name,
            number=number,
            type=descriptor_pb2.FieldDescriptorProto.TYPE_DOUBLE,
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
        )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("atvrec.signals.car"))
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(
            "atvrec.signals.car",
            "protobuf",
            descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString(),
        )
        metadata = {f"unit.{name}": unit for name, unit in units.items()}
        channel = writer.register_channel("/control/car", "protobuf", schema, metadata)
        for row, values in enumerate(rows):
            time_ns = 1_000_000_000 + 10_000_000 * row
            writer.add_message(channel, time_ns, kind(**values).SerializeToString(), time_ns)
        writer.finish()


def test_torques_and_hitch_force_of_a_log_reach_the_estimator(tmp_path: Path) -> None:
    units = {
        "drive_torque_RL": "N m",
        "brake_torque_FR": "N m",
        "hitch_force_x": "N",
        "drive_torque_FL": "lb ft",
        "throttle": "1",
    }
    rows = [
        {"drive_torque_RL": 80.0, "drive_torque_FL": 5.0},
        {"throttle": 0.5},
        {"hitch_force_x": -300.0, "brake_torque_FR": 12.0},
    ]
    _control_log(tmp_path / "control.mcap", rows, units)
    found = atvrec.samples(tmp_path / "control.mcap")["control"]
    nan = np.nan
    np.testing.assert_array_equal(found["log_time_ns"], [1_000_000_000, 1_020_000_000])
    np.testing.assert_array_equal(
        found["drive_torque_n_m"], [[nan, nan, 80.0, nan], [nan, nan, nan, nan]]
    )
    np.testing.assert_array_equal(found["brake_torque_n_m"][1], [nan, 12.0, nan, nan])  # type: ignore
    np.testing.assert_array_equal(found["hitch_force_n"][1], [-300.0, nan, nan])  # type: ignore
    assert np.isnan(np.asarray(found["bridge_temperature_c"])).all()


def test_a_hitch_force_has_an_effect(simulated_log: Path) -> None:
    log = atvrec.open(simulated_log)
    samples = atvrec.samples(log)
    assert "control" not in samples
    times = np.asarray(samples["steer"]["log_time_ns"])

    def last_force(force_n: float) -> float:
        hitch = np.tile([force_n, 0.0, 0.0], (len(times), 1))
        pulled: Any = {**samples, "control": {"log_time_ns": times, "hitch_force_n": hitch}}
        estimator = atvrec.Estimator(*vehicle_of(log))
        return float(estimator.run(pulled).estimates.force_n[-1, :, 0].sum())

    # A load that pulls backwards needs more force of the tyres for the same motion.
    assert last_force(-400.0) > last_force(0.0) + 10.0


def test_errors_name_the_value_and_the_next_step() -> None:
    vehicle = atvrec.Vehicle.builtin("prowler")
    estimator = atvrec.Estimator(vehicle)
    steer: dict[str, Any] = {"log_time_ns": [2_000], "steering_wheel_rad": [0.1]}
    estimator.push({"steer": steer})
    with pytest.raises(atvrec.ArgumentError, match="log_time_ns = 1000 is earlier than 2000"):
        estimator.push_steer(1_000, 0.1)
    with pytest.raises(atvrec.ArgumentError, match="no such kind of samples; there are imu"):
        estimator.push({"stear": steer})  # type: ignore[typeddict-unknown-key]
    with pytest.raises(atvrec.ArgumentError, match=r'samples\["steer"\]\["angle_rad"\]: no such array'):
        estimator.push({"steer": steer | {"angle_rad": [0.1]}})  # type: ignore[typeddict-item]
    with pytest.raises(atvrec.ArgumentError, match=r'\["steering_wheel_rad"\] has 1 rows, fewer'):
        estimator.push({"steer": steer | {"log_time_ns": [3_000, 4_000]}})
    with pytest.raises(atvrec.ArgumentError, match="must be fl, fr, rl or rr"):
        estimator.push_corner(5_000, "front left", deflection_counts=500)
    with pytest.raises(atvrec.ArgumentError, match="is 500.5: counts are whole numbers of 32 bits"):
        estimator.push_corner(5_000, "fl", deflection_counts=500.5)
    with pytest.raises(atvrec.ArgumentError, match="must be none, single"):
        estimator.push_gnss_velocity(5_000, [0.0, 0.0, 0.0], quality="good")  # type: ignore[arg-type]
    with pytest.raises(atvrec.ArgumentError, match='"fusoin" is not known; did you mean "fusion"'):
        atvrec.Estimator(vehicle, method="fusoin")  # type: ignore[arg-type]
    other = atvrec.Calibration.from_toml('vehicle = "another"')
    with pytest.raises(atvrec.ArgumentError, match="calibrate this vehicle, or name the right files"):
        atvrec.Estimator(vehicle, calibration=other)
    with pytest.raises(atvrec.ArgumentError, match="motion.gate_sgma; docs/filter-spec.md lists"):
        atvrec.Tuning().with_values({"motion.gate_sgma": 6.0})
    with pytest.raises(atvrec.ArgumentError, match=r"motion.gate_sigma = \[-1.0\] found where a number above 0"):
        atvrec.Tuning().with_values({"motion": {"gate_sigma": -1.0}})
    with pytest.raises(atvrec.ArgumentError, match=r"cal.toml: (.|\n)*unknown field `vehicel`"):
        atvrec.Calibration.from_toml('vehicel = "x"', "cal.toml")
    with pytest.raises(FileNotFoundError, match="absent.toml"):
        atvrec.Calibration.load("absent.toml")


def test_readings_in_another_unit_than_counts_are_taken_with_their_step() -> None:
    nothing = np.full(3, np.nan)
    columns: dict[str, Any] = {f"{wheel}.raw_counts": nothing for wheel in ("fr", "rl", "rr")}
    columns |= {
        "log_time_ns": np.array([10, 20, 30]),
        "publish_time_ns": np.array([10, 20, 30]),
        "fl.raw_counts": np.array([500.0, np.nan, np.nan]),
        "fl.equivalent_counts": np.array([np.nan, 500.25, 501.5]),
        "fl.step_counts": np.array([np.nan, 0.5, np.nan]),
    }
    corner = atvrec.estimation._corners(columns, "deflection")[0]
    np.testing.assert_equal(corner["deflection_counts"], [500.0, 500.25, 501.5])
    np.testing.assert_equal(corner["deflection_step_counts"], [np.nan, 0.5, 0.0])
    vehicle = atvrec.Vehicle.builtin("prowler")
    atvrec.Estimator(vehicle).push({"corner": corner})  # type: ignore[typeddict-item]
    with pytest.raises(atvrec.ArgumentError, match="is 500.25: counts are whole numbers"):
        atvrec.Estimator(vehicle).push({"corner": corner | {"deflection_step_counts": nothing}})  # type: ignore[typeddict-item]
