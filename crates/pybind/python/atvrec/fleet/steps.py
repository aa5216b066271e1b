"""The steps of a fleet's work on one run."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import numpy.typing as npt

import atvrec
from atvrec._atvrec import ArgumentError, AtvrecError, rainflow
from atvrec.log import Log, Path

Doubles = npt.NDArray[np.float64]

_COUNT_MIN = 1e-4
"""A class with a smaller expected count is no row."""

WHEELS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
AXES = ("x", "y", "z")
KINDS = ("cornering", "tyre", "roll-pitch", "inertia", "understeer", "response", "friction")


@dataclass(frozen=True)
class Step:
    """A step and its options. Made by the functions of this module."""

    name: str
    """Its name in the table ``steps``."""
    options: dict[str, Any] = field(default_factory=dict)
    """Its options, as JSON can contain them."""
    files: dict[str, bytes] = field(default_factory=dict)
    """Contents of the files that the options name, by the option, so that a worker on another machine has
    them."""


@dataclass
class Drive:
    """A run on a worker while the steps are applied."""

    log: Log
    """The log; that of the replay after the step ``replay``."""
    folder: FilePath
    """A folder for this run alone, which is removed afterwards."""
    rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    """New rows by table."""
    estimates: Any = None
    """The table ``estimates``, a pyarrow table."""

    @property
    def vehicle(self) -> str | None:
        """Name of the vehicle that the log was recorded or replayed with."""
        for name, content in self.log.attachments.items():
            if name.endswith(".vehicle.toml"):
                try:
                    return atvrec.Vehicle.from_toml(content.decode(), name).name
                except (AtvrecError, UnicodeDecodeError):
                    return None
        return None

    def add(self, table: str, **row: Any) -> None:
        """Adds a row."""
        self.rows.setdefault(table, []).append(row)


def replay(**options: Any) -> Step:
    """Estimates again from the raw bytes, with the options of :func:`atvrec.replay` other than
    ``output``, ``force``, ``verify`` and ``compress``. The following steps use the result. Files are read here and sent
    to the workers."""
    files: dict[str, bytes] = {}
    plain: dict[str, Any] = {}
    for name, value in options.items():
        if name in ("output", "force", "verify", "smooth", "compress"):
            raise ArgumentError(f"replay: {name} is not an option of a fleet's step")
        if name in ("vehicle", "sensors", "calibration") and hasattr(value, "to_toml"):
            files[name] = value.to_toml().encode()
        elif name in ("vehicle", "sensors", "calibration", "config") and value is not None:
            text = os.fspath(value)
            if not os.path.exists(text) and name in ("vehicle", "sensors"):
                plain[name] = text
                continue
            files[name] = FilePath(text).read_bytes()
        elif name == "overrides":
            for number, path in enumerate(value):
                files[f"override-{number:02}"] = FilePath(path).read_bytes()
        elif value is not None:
            plain[name] = list(value) if isinstance(value, (tuple, set)) else value
    return Step("replay", plain, files)


def score() -> Step:
    """Errors against the truth of a simulated or imported log, to the table ``scores``."""
    return Step("score")


def identify(kind: str, *, start_s: float = 2.0) -> Step:
    """Parameters from the drive, after ``start_s``, as ``atvrec identify KIND`` finds them, to the table
    ``parameters``. A drive that does not determine them gives no row, and the reason is in the table
    ``steps``."""
    if kind not in KINDS:
        raise ArgumentError(f"identify: {kind!r} is unknown; use one of {', '.join(KINDS)}")
    return Step(f"identify:{kind}", {"start_s": float(start_s)})


def summary(*, cycle_classes: int = 32) -> Step:
    """What the report says at its top: distance, verdict, events, forces of each wheel; the parameters that
    the estimator learnt, and counts of load cycles in ``cycle_classes`` classes of equal width. To the
    tables ``summary``, ``verdict``, ``events``, ``forces``, ``parameters`` and ``cycles``."""
    if not 1 <= cycle_classes <= 1024:
        raise ArgumentError(f"cycle_classes = {cycle_classes}: must be from 1 to 1024")
    return Step("summary", {"cycle_classes": int(cycle_classes)})


def springs() -> Step:
    """Rate at the wheel (``fl.rate``) and load (``fl.load``) of each corner, from wheel loads that are
    estimated without the potentiometers. The load is that at zero deflection, or, where the log has
    readings of the converter only, at the middle of 10 or 16 bits. To the table ``parameters``."""
    return Step("springs")


def rest(*, longest_s: float = 30.0) -> Step:
    """Readings of the strain bridges and the potentiometers while the vehicle stands, for the first rest of
    2 s or more, to the table ``parameters``. They follow the zeros of the bridges, and the payload."""
    return Step("rest", {"longest_s": float(longest_s)})


def estimates(*, rate_hz: float = 100.0, fields: Sequence[str] = ()) -> Step:
    """Estimates at a rate, to the table ``estimates``. Without ``fields``, motion and tyre forces."""
    chosen = list(fields) or ["/estimate/motion", "/estimate/tyre_forces"]
    return Step("estimates", {"rate_hz": float(rate_hz), "fields": chosen})


_MIDDLE = (512.0, 32768.0)
"""Middle of the range of converters of 10 and of 16 bits, counts."""


class NoResult(Exception):
    """A step cannot say anything about this drive."""


def apply(step: Step, drive: Drive) -> None:
    """Applies a step to a drive."""
    name, _, argument = step.name.partition(":")
    _ACTIONS[name](drive, argument, step)


def _replay(drive: Drive, _: str, step: Step) -> None:
    options = dict(step.options)
    overrides: list[Path] = []
    for name, content in sorted(step.files.items()):
        path = drive.folder / f"{name}.toml"
        path.write_bytes(content)
        if name.startswith("override-"):
            overrides.append(path)
        else:
            options[name] = path
    output = drive.folder / "replayed.mcap"
    atvrec.replay(drive.log, output, overrides=overrides, compress=False, **options)
    drive.log = atvrec.open(output)


def _score(drive: Drive, _: str, __: Step) -> None:
    if not any(topic.startswith("/truth/") for topic in drive.log.topics):
        raise NoResult("the log has no truth to compare with")
    signals: list[Any] = list(atvrec.score(drive.log)["signals"])
    for signal in signals:
        names = ("signal", "wheel", "unit", "count", "mean", "rmse", "peak", "normalised_percent")
        drive.add("scores", **{name: signal[name] for name in (*names, "nees", "nees_inside")})


def _identified(drive: Drive, kind: str, step: Step) -> None:
    results = drive.log.identify(kind, start_s=step.options["start_s"])
    for found in results:
        for name, one in found["findings"].items():
            shown = name if len(results) == 1 else f"{found['what']}: {name}"
            low, high = one["interval"] or (None, None)
            _parameter(drive, step.name, shown, one["value"], one["sigma"], one["unit"], (low, high))


def _parameter(
    drive: Drive,
    step: str,
    name: str,
    value: float,
    sigma: float,
    unit: str,
    interval: tuple[float | None, float | None] | None = None,
) -> None:
    if not (np.isfinite(value) and np.isfinite(sigma)):
        return
    low, high = interval or (value - 1.96 * sigma, value + 1.96 * sigma)
    drive.add(
        "parameters",
        step=step,
        parameter=name,
        value=float(value),
        sigma=float(sigma),
        low=low,
        high=high,
        unit=unit,
    )


def _summary(drive: Drive, _: str, step: Step) -> None:
    report = drive.log.summary()
    for quantity in ("distance_m", "duration_s"):
        unit = quantity.rsplit("_", 1)[1]
        drive.add("summary", quantity=quantity[: -len(unit) - 1], value=report[quantity], unit=unit)
    for quantity, found in report["vehicle_values"].items():
        drive.add("summary", quantity=quantity, value=found["value"], unit=found["unit"])
    for text in report["verdict"]:
        drive.add("verdict", text=text)
    for event in report["events"]:
        drive.add("events", **event)
    for wheel in report["wheels"]:
        for axis in AXES:
            of_axis = wheel[axis]
            if of_axis is None:
                continue
            drive.add(
                "forces",
                wheel=wheel["wheel"],
                axis=axis,
                **{f"{name}_n": of_axis[name] for name in ("min", "max", "rms", "percentile_95", "sigma")},
                utilisation=wheel["utilisation"],
                lifts=wheel["lifts"],
            )
    _learnt(drive)
    _cycles(drive, step.options["cycle_classes"])


_LEARNT = {
    "steer_offset": ("steer_offset_rad", "steer_offset_sigma_rad", "rad"),
    **{
        f"gyro_bias_{axis}": (f"gyro_bias_rad_s.{axis}", f"gyro_bias_sigma_rad_s.{axis}", "rad/s")
        for axis in AXES
    },
    **{
        f"accel_bias_{axis}": (f"accel_bias_m_s2.{axis}", f"accel_bias_sigma_m_s2.{axis}", "m/s^2")
        for axis in AXES
    },
    **{
        f"{axle}_stiffness_factor": (
            f"{axle}.stiffness_factor",
            f"{axle}.stiffness_factor_sigma",
            "-",
        )
        for axle in ("front", "rear")
    },
}


def _learnt(drive: Drive) -> None:
    """The parameters at the end of the drive."""
    if "/estimate/parameters" not in drive.log.topics:
        return
    columns = drive.log.read("/estimate/parameters")
    for name, (value, sigma, unit) in _LEARNT.items():
        if value in columns and columns[value].size:
            _parameter(drive, "learnt", name, columns[value][-1], columns[sigma][-1], unit)


def _cycles(drive: Drive, classes: int) -> None:
    """Rainflow counts of the forces of each wheel. The range of a cycle is uncertain by the standard
    deviations of its two turning points, so that the cycle may belong to several classes: the count of a
    class is the sum of its probabilities, with the variance of that sum."""
    topic = "/estimate/tyre_forces"
    if topic not in drive.log.topics:
        raise NoResult("the log has no estimated forces; put replay() before summary()")
    columns = drive.log.read(topic)
    for wheel, name in WHEELS.items():
        for axis in AXES:
            load = columns.get(f"{wheel}.{axis}_n")
            if load is None or not np.isfinite(load).any():
                continue
            sigma = columns.get(f"{wheel}.{axis}_sigma_n", np.zeros_like(load))
            for low, high, count, deviation in _histogram(load, sigma, classes):
                drive.add(
                    "cycles",
                    wheel=name,
                    axis=axis,
                    range_low_n=low,
                    range_high_n=high,
                    cycles=count,
                    sigma=deviation,
                )


def _histogram(load: Doubles, sigma: Doubles, classes: int) -> list[tuple[float, float, float, float]]:
    counts, (begin, end) = rainflow(np.ascontiguousarray(load, dtype=float))
    ranges = np.abs(load[begin] - load[end])
    deviation = np.hypot(np.nan_to_num(sigma[begin]), np.nan_to_num(sigma[end]))
    if not counts.size:
        return []
    # The same classes for all drives, so that counts can be added: 1, 2 or 5 times a power of ten.
    width = _round_up(float(ranges.max()) / classes)
    edges = width * np.arange(int(np.ceil(float(ranges.max()) / width)) + 1)
    below = _normal((edges[:, None] - ranges) / np.maximum(deviation, 1e-9))
    # A range is not negative, and nothing is above the last class.
    below[0], below[-1] = 0.0, 1.0
    within = np.diff(below, axis=0)
    found = within @ counts
    spread = np.sqrt((within * (1.0 - within)) @ counts**2)
    return [
        (float(edges[k]), float(edges[k + 1]), float(found[k]), float(spread[k]))
        for k in range(edges.size - 1)
        if found[k] >= _COUNT_MIN
    ]


def _round_up(width: float) -> float:
    if width <= 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(width))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= width * 0.999999))


def _normal(x: Doubles) -> Doubles:
    """Distribution function of the normal distribution."""
    from math import erf

    found = np.vectorize(erf, otypes=[float])(np.clip(x, -9.0, 9.0) / np.sqrt(2.0))
    return np.asarray(0.5 * (1.0 + found))


def _springs(drive: Drive, _: str, step: Step) -> None:
    found = atvrec.replay(drive.log, without=["deflection"]).estimated
    if found is None or not found.estimates.time_ns.size:
        raise NoResult("the log has no measurements to estimate from")
    times = found.estimates.time_ns
    loads = found.estimates.force_n[:, :, 2]
    measured = _travel(drive.log, times)
    if measured is None:
        raise NoResult("the log has no deflection of all four springs")
    travel, unit = measured
    reference = 0.0 if unit == "m" else _MIDDLE[int(np.nanmax(travel) >= 2 * _MIDDLE[0])]
    for index, wheel in enumerate(WHEELS):
        other = index ^ 1
        velocity = np.gradient(travel[:, index], times * 1e-9)
        apart = travel[:, index] - travel[:, other]
        known = np.isfinite(loads[:, index]) & np.isfinite(velocity) & np.isfinite(apart)
        known[: min(200, known.size)] = False
        if known.sum() < 500:
            raise NoResult(f"{WHEELS[wheel]}: less than 5 s with load and deflection")
        deflection = travel[known, index] - reference
        terms = np.column_stack([np.ones(known.sum()), deflection, apart[known], velocity[known]])
        value, sigma = _fit(terms, loads[known, index])
        _parameter(drive, step.name, f"{wheel}.load", value[0], sigma[0], "N")
        _parameter(drive, step.name, f"{wheel}.rate", value[1], sigma[1], f"N/{unit}")


def _travel(log: Log, times_ns: npt.NDArray[np.int64]) -> tuple[Doubles, str] | None:
    """Compression of the four springs at the estimates' instants, and its unit: counts of the converter
    where the log has no lengths."""
    if "/deflection" not in log.topics:
        return None
    columns = log.read("/deflection")
    for field, unit in (("deflection_m", "m"), ("raw_counts", "count")):
        found = [columns.get(f"{wheel}.{field}", np.full(0, np.nan)) for wheel in WHEELS]
        if all(np.isfinite(one).sum() > 1 for one in found):
            at = columns["publish_time_ns"]
            rows = [np.interp(times_ns, at[np.isfinite(one)], one[np.isfinite(one)]) for one in found]
            return np.column_stack(rows), unit
    return None


def _fit(terms: Doubles, values: Doubles) -> tuple[Doubles, Doubles]:
    """Least squares with the standard deviations of residuals that are correlated in time: those of the
    means over seconds."""
    value, *_ = np.linalg.lstsq(terms, values, rcond=None)
    residual = values - terms @ value
    inverse = np.linalg.pinv(terms.T @ terms)
    block = 100
    whole = residual.size // block * block
    scores = (terms * residual[:, None])[:whole].reshape(-1, block, terms.shape[1]).sum(axis=1)
    covariance = inverse @ (scores.T @ scores) @ inverse
    return np.asarray(value, float), np.asarray(np.sqrt(np.diag(covariance)))


def _rest(drive: Drive, _: str, step: Step) -> None:
    if "/estimate/motion" not in drive.log.topics:
        raise NoResult("the log has no estimates; put replay() before rest()")
    motion = drive.log.read("/estimate/motion", columns=["velocity_x_m_s", "yaw_rate_rad_s"])
    still = (np.abs(motion["velocity_x_m_s"]) < 0.05) & (np.abs(motion["yaw_rate_rad_s"]) < 0.02)
    span = _first_span(motion["t_s"], still, 2.0)
    if span is None:
        raise NoResult("the vehicle does not stand for 2 s")
    start_s, end_s = span[0] + 0.2, min(span[1] - 0.2, span[0] + step.options["longest_s"])
    for topic in ("/strain", "/deflection"):
        if topic not in drive.log.topics:
            continue
        columns = drive.log.read(topic, start_s, end_s)
        for name, values in columns.items():
            if not name.endswith(".raw_counts") or not np.isfinite(values).any():
                continue
            known = values[np.isfinite(values)]
            # A second of readings counts as one, because disturbances at rest are slow.
            sigma = max(known.std() / np.sqrt(max(end_s - start_s, 1.0)), 0.3 / np.sqrt(known.size))
            of = "bridge" if topic == "/strain" else "potentiometer"
            corner = name.removesuffix(".raw_counts")
            _parameter(drive, step.name, f"{of}.{corner}", known.mean(), sigma, "counts")


def _first_span(time_s: Doubles, flags: npt.NDArray[np.bool_], least_s: float) -> tuple[float, float] | None:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if time_s[end - 1] - time_s[begin] >= least_s:
            return float(time_s[begin]), float(time_s[end - 1])
    return None


def _estimates(drive: Drive, _: str, step: Step) -> None:
    fields, topics = step.options["fields"], drive.log.topics
    wanted = [f for f in fields if any(f == t or f.startswith(f"{t}.") for t in topics)]
    if not wanted:
        raise NoResult("the log has none of the fields")
    drive.estimates = drive.log.frame(wanted, rate_hz=step.options["rate_hz"], kind="arrow")


_ACTIONS: Mapping[str, Callable[[Drive, str, Step], None]] = {
    "replay": _replay,
    "score": _score,
    "identify": _identified,
    "summary": _summary,
    "springs": _springs,
    "rest": _rest,
    "estimates": _estimates,
}
