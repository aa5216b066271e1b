"""Replay and simulation, as ``atvrec replay`` and ``atvrec simulate`` do them, in this process."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from atvrec._atvrec import (
    ArgumentError,
    Calibration,
    Sensors,
    Vehicle,
    manoeuvres,
    replay_log,
    simulate_log,
)
from atvrec.estimation import Estimated, Input, Method, estimated
from atvrec.log import Log, Path, opened

__all__ = ["Replayed", "Simulated", "manoeuvres", "replay", "simulate"]


@dataclass(frozen=True, eq=False)
class Replayed:
    """Result of a replay: the keys of ``atvrec replay --json``, and the estimates."""

    arrivals: int
    """Arrivals of the log."""
    records: int
    """Records that were computed from them."""
    left_out: int
    """Arrivals that the estimator left out while it recorded, and that the replay leaves out too."""
    estimates_during_silence: int
    """Estimates of an older log during silence, which this version does not compute."""
    log_s: float
    """Time from the first arrival to the last, s."""
    missing: list[str]
    """What the log does not hold."""
    verify: dict[str, Any] | None
    """Result of the comparison with the log, where ``verify`` asked for one."""
    estimated: Estimated | None
    """Output of the estimator; None where it was written to ``output``."""


@dataclass(frozen=True)
class Simulated:
    """Result of a simulation."""

    output: Path
    """The log."""
    drive: str
    """Name of the manoeuvre or of the truth file."""
    duration_s: float
    """Duration of the drive, s."""
    arrivals: int
    """Arrivals in the log."""
    messages: int
    """Decoded messages in the log."""


def replay(
    log: Log | Path | Iterable[Path],
    output: Path | None = None,
    *,
    force: bool = False,
    vehicle: Vehicle | Path | None = None,
    sensors: Sensors | Path | None = None,
    calibration: Calibration | Path | None = None,
    overrides: Sequence[Path] = (),
    payload: Sequence[str] | None = None,
    without: Sequence[Input] = (),
    with_inputs: Sequence[Input] = (),
    method: Method | None = None,
    config: Path | None = None,
    smooth: bool = False,
    verify: bool = False,
    compress: bool = True,
) -> Replayed:
    """Estimates again from the raw bytes of a log.

    The result has the same bits as that of ``atvrec replay`` with the same options. With ``output``
    it is written to a new log, otherwise it is returned as arrays.

    - ``vehicle``, ``sensors``, ``calibration`` replace those of the log: an object, a file, or the
      name of one that ships with the package; ``overrides`` are files of ``atvrec identify -o``
    - ``payload`` names the payloads on the vehicle at the start, in place of those of the log
    - ``without`` names inputs that are not used, ``with_inputs`` those that are used although the log's
      configuration ignores them
    - ``config`` replaces the log's configuration, and excludes the above
    - ``smooth`` also writes estimates that use the measurements after their instant; needs ``output``
    - ``verify`` compares with what was recorded
    - ``compress = False`` writes the chunks of ``output`` without compression: a log that is read at once and
      then removed is made with less work

    Raises :class:`FileExistsError` where ``output`` exists and ``force`` is not set,
    :class:`atvrec.LogError` where the log cannot be read, :class:`atvrec.ArgumentError` where a name
    or a configuration has errors.
    """
    changes = (vehicle, sensors, calibration, payload, method, *overrides, *without, *with_inputs)
    if config is not None and any(change is not None for change in changes):
        raise ArgumentError(
            f"config = {os.fspath(config)}: excludes vehicle, sensors, calibration, overrides, "
            "payload, without, with_inputs and method; write them into the configuration"
        )
    if smooth and output is None:
        raise ArgumentError("smooth = True: needs output, the log for the smoothed estimates")
    result, found = replay_log(
        opened(log)._reader,
        _path(output),
        force,
        _path(config),
        _object_or_path(vehicle),
        [os.fspath(path) for path in overrides],
        _object_or_path(sensors),
        _object_or_path(calibration),
        None if payload is None else list(payload),
        list(without),
        list(with_inputs),
        method,
        smooth,
        verify,
        compress,
    )
    return Replayed(**json.loads(result), estimated=None if found is None else estimated(found))


def simulate(
    manoeuvre: str | None,
    output: Path,
    *,
    truth: Path | None = None,
    road: Path | None = None,
    force: bool = False,
    vehicle: Vehicle | Path = "prowler",
    sensors: Sensors | Path = "thesis-10bit",
    payload: Sequence[str] = (),
    seed: int = 1,
    options: Path | None = None,
    duration_s: float | None = None,
    config: Path | None = None,
    true_calibration: Path | None = None,
) -> Simulated:
    """Drives a virtual vehicle and writes the log of its sensors, with estimates and truth.

    The log has the same bytes as that of ``atvrec simulate`` with the same options.

    - ``manoeuvre`` is one of :func:`manoeuvres`; or it is None and ``truth`` is a truth file (Parquet
      or CSV)
    - ``road`` is ``iso8608:A`` to ``iso8608:F`` or a road file; without it the manoeuvre has its own
      ground
    - ``payload`` names the payloads of the vehicle file that are on the vehicle
    - ``seed`` is that of the sensor noise, and of a road of a class
    - ``options`` is a file with hidden errors, faults and delays
    - ``duration_s`` ends the drive earlier; only mixed driving is repeated for longer
    - ``true_calibration`` names a file to which the calibration without errors is written

    Raises :class:`FileExistsError` where an output exists and ``force`` is not set,
    :class:`atvrec.SimulationError` where the vehicle cannot perform the manoeuvre.
    """
    if duration_s is not None and not 0.0 < duration_s < float("inf"):
        raise ArgumentError(f"duration_s = {duration_s} s: must be finite and greater than 0")
    own_duration_s, drive, arrivals, messages = simulate_log(
        manoeuvre,
        _path(truth),
        _path(road),
        os.fspath(output),
        force,
        _object_or_path(vehicle),
        _object_or_path(sensors),
        list(payload),
        seed,
        _path(options),
        duration_s,
        _path(config),
        _path(true_calibration),
    )
    return Simulated(
        output=output,
        drive=drive,
        duration_s=own_duration_s,
        arrivals=arrivals,
        messages=messages,
    )


def _path(path: Path | None) -> str | None:
    return None if path is None else os.fspath(path)


def _object_or_path(value: Any) -> Any:
    return os.fspath(value) if isinstance(value, os.PathLike) else value
