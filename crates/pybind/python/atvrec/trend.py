"""Parameters over many drives: which of them changed beyond what chance explains?

:func:`trend` reads the table ``parameters`` of a dataset that :func:`atvrec.fleet.run` wrote, and tests each
parameter of each vehicle for a change between two drives.

The test. Let the drives stand in the order of time, with the values x_i and their standard deviations. For each
split of the drives into earlier and later ones, z is the difference of the weighted means over its standard
deviation, with the weights 1/(sigma_i^2 + tau^2), where tau is the scatter between drives that the deviations do
not explain. The largest \\|z\\| of all splits is compared with that of random orders of the same drives. The
probability that a random order has as large a value needs no assumption about the distribution of the errors, but
that drives without a change have no order. Holm's method keeps the probability of any false alarm among all
parameters of a vehicle below ``false_alarms``.

S. Holm, A simple sequentially rejective multiple test procedure, Scand. J. Statist. 6 (1979) 65-70.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from atvrec import frames
from atvrec._atvrec import ArgumentError, DataError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Doubles = npt.NDArray[np.float64]

DRIVES_MIN = 8
"""Fewer drives have too few orders for a decision."""
_SIDE_MIN = 2
"""Drives on each side of a split."""
_CHUNK = 1 << 22
"""Values of random orders that are held at the same time."""


@dataclass(frozen=True)
class Series:
    """A parameter of a vehicle over its drives."""

    vehicle: str
    step: str
    """The step of the fleet that found it."""
    parameter: str
    unit: str
    time_ns: npt.NDArray[np.int64]
    """Begins of the drives, rising, ns since 1970, (n,)."""
    value: Doubles
    """(n,)."""
    sigma: Doubles
    """Standard deviations that the drives state, (n,)."""
    runs: Sequence[str]
    """Names of the runs."""
    scatter: float
    """Scatter between drives that the standard deviations do not explain (tau)."""
    split: int
    """Number of drives before the most likely change."""
    change: float
    """Mean of the later drives less that of the earlier ones."""
    change_sigma: float
    p: float
    """Probability that a random order of the drives has a change as clear."""
    changed: bool = False
    """Whether chance does not explain the change, by Holm's method over all parameters of the vehicle."""

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the change."""
        return self.change - 1.96 * self.change_sigma, self.change + 1.96 * self.change_sigma


@dataclass(frozen=True)
class Trend:
    """All parameters over the drives."""

    series: list[Series] = field(repr=False)
    """The series that were tested; those that changed first."""
    left_out: dict[str, str]
    """Reasons by parameter for those that could not be tested."""
    false_alarms: float
    """Probability of any false alarm among the parameters of a vehicle."""

    @property
    def changed(self) -> list[Series]:
        """The parameters that changed."""
        return [one for one in self.series if one.changed]

    def frame(self) -> pd.DataFrame:
        """The results as a pandas frame."""
        import pandas as pd

        return pd.DataFrame([_row(one) for one in self.series])

    def __str__(self) -> str:
        lines = [
            f"{len(self.changed)} of {len(self.series)} parameters changed "
            f"(probability of any false alarm: {100.0 * self.false_alarms:g} % for each vehicle)"
        ]
        for one in self.series:
            low, high = one.interval
            mark = "CHANGED" if one.changed else "       "
            lines.append(
                f"{mark} {one.vehicle}  {one.step} {one.parameter}: mean "
                f"{_mean(one):.6g} {one.unit}, change {one.change:+.4g} ({low:+.4g} to {high:+.4g}) before "
                f"{_date(one)}, {one.value.size} drives, p = {one.p:.2g}"
            )
        lines += [f"not tested: {name}: {reason}" for name, reason in self.left_out.items()]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        heads = ("changed", "vehicle", "parameter", "mean", "change", "95 % interval", "before", "drives", "p")
        rows = []
        for one in self.series:
            low, high = one.interval
            rows.append(
                (
                    "yes" if one.changed else "",
                    one.vehicle,
                    f"{one.step} {one.parameter}",
                    f"{_mean(one):.6g} {one.unit}",
                    f"{one.change:+.4g}",
                    f"{low:+.4g} to {high:+.4g}",
                    _date(one),
                    str(one.value.size),
                    f"{one.p:.2g}",
                )
            )
        facts = {"probability of any false alarm": f"{100.0 * self.false_alarms:g} % for each vehicle"}
        return frames.html("atvrec trend", facts, heads, rows)

    def figure(self, most: int = 12) -> Figure:
        """The parameters over time with their 95 % intervals, those that changed first. Needs matplotlib."""
        import matplotlib.pyplot as plt

        shown = self.series[:most]
        columns = 2 if len(shown) > 1 else 1
        rows = max(-(-len(shown) // columns), 1)
        figure, axes = plt.subplots(rows, columns, figsize=(6.0 * columns, 2.4 * rows), squeeze=False)
        for axis in axes.flat[len(shown) :]:
            axis.set_visible(False)
        for axis, one in zip(axes.flat, shown, strict=False):
            time = one.time_ns.view("M8[ns]")
            deviation = 1.96 * np.hypot(one.sigma, one.scatter)
            axis.errorbar(time, one.value, deviation, fmt=".", color="C3" if one.changed else "C0", lw=0.8)
            for part in (slice(None, one.split), slice(one.split, None)) if one.changed else ():
                level = np.average(one.value[part], weights=_weights(one)[part])
                axis.hlines(level, time[part][0], time[part][-1], color="k")
            axis.set_title(f"{one.vehicle}: {one.step} {one.parameter}", fontsize="small")
            axis.set_ylabel(one.unit)
            axis.tick_params(axis="x", labelrotation=30, labelsize="x-small")
        figure.tight_layout()
        return figure


def trend(
    dataset: str | os.PathLike[str] | pd.DataFrame,
    *,
    false_alarms: float = 0.01,
    vehicle: str | None = None,
    parameters: Sequence[str] | None = None,
    seed: int = 1,
    storage_options: Mapping[str, Any] | None = None,
) -> Trend:
    """Tests all parameters of a dataset of :func:`atvrec.fleet.run`.

    - ``dataset``: the dataset, or a pandas frame with the columns of its table ``parameters``
    - ``false_alarms``: probability of any false alarm among the parameters of a vehicle
    - ``vehicle``, ``parameters``: only this vehicle, only parameters with these names
    - ``seed``: of the random orders

    Raises :class:`atvrec.DataError` where there is no parameter to test.
    """
    if not 0.0001 <= false_alarms <= 0.5:
        raise ArgumentError(f"false_alarms = {false_alarms}: must be from 0.0001 to 0.5")
    table: Any = dataset
    if isinstance(dataset, (str, os.PathLike)):
        table = _parameters(os.fspath(dataset), storage_options)
    if vehicle is not None:
        table = table[table["vehicle"] == vehicle]
    if parameters is not None:
        table = table[table["parameter"].isin(list(parameters))]
    if table.empty:
        raise DataError(
            "the dataset has no parameter; use the steps summary, identify, springs or rest in fleet.run"
        )
    series: list[Series] = []
    left_out: dict[str, str] = {}
    table = table.assign(vehicle=table["vehicle"].fillna(""))
    for _, of_vehicle in table.groupby("vehicle"):
        groups = list(of_vehicle.groupby(["step", "parameter"]))
        # The smallest probability that Holm's method asks for, with tenfold resolution.
        orders = int(10.0 * len(groups) / false_alarms)
        tested = []
        for (step, name), rows in groups:
            rows = rows.dropna(subset=["start", "value", "sigma"]).sort_values("start")
            if len(rows) < DRIVES_MIN:
                left_out[f"{step} {name}"] = f"{len(rows)} drives; {DRIVES_MIN} are needed"
                continue
            tested.append(_tested(rows, orders, np.random.default_rng(seed)))
        series += holm(tested, false_alarms)
    if not series:
        counts = ", ".join(f"{name}: {reason}" for name, reason in left_out.items())
        raise DataError(f"no parameter has enough drives ({counts})")
    series.sort(key=lambda one: (not one.changed, one.p, one.vehicle, one.step, one.parameter))
    return Trend(series, left_out, false_alarms)


def holm(series: Sequence[Series], false_alarms: float) -> list[Series]:
    """The series with ``changed`` set by Holm's method."""
    decided = {}
    still = True
    for place, index in enumerate(np.argsort([one.p for one in series], kind="stable")):
        still = still and series[index].p <= false_alarms / (len(series) - place)
        decided[int(index)] = still
    return [replace(one, changed=decided[index]) for index, one in enumerate(series)]


def _tested(rows: pd.DataFrame, orders: int, random: np.random.Generator) -> Series:
    value = rows["value"].to_numpy(float)
    sigma = np.maximum(rows["sigma"].to_numpy(float), 1e-300)
    scatter = _scatter(value, sigma)
    weight = 1.0 / (sigma**2 + scatter**2)
    z = _splits(value[None, :], weight[None, :])[0]
    split = int(np.argmax(z)) + _SIDE_MIN
    largest = float(z.max())
    above, done = 0, 0
    while done < orders:
        count = min(max(_CHUNK // value.size, 1), orders - done)
        order = random.permuted(np.tile(np.arange(value.size), (count, 1)), axis=1)
        found = _splits(value[order], weight[order]).max(axis=1)
        above += int((found >= largest * (1.0 - 1e-12)).sum())
        done += count
        # Far from any decision.
        if above > 200:
            break
    parts = (slice(None, split), slice(split, None))
    # Within the parts, the change itself is no scatter.
    within = float(np.sqrt(np.mean([_scatter(value[part], sigma[part]) ** 2 for part in parts])))
    best = 1.0 / (sigma**2 + within**2)
    means = [np.average(value[part], weights=best[part]) for part in parts]
    return Series(
        vehicle=str(rows["vehicle"].iloc[0]),
        step=str(rows["step"].iloc[0]),
        parameter=str(rows["parameter"].iloc[0]),
        unit=str(rows["unit"].iloc[0]),
        time_ns=rows["start"].to_numpy("M8[ns]").astype(np.int64),
        value=value,
        sigma=sigma,
        runs=[str(name) for name in rows["run"]],
        scatter=within,
        split=split,
        change=float(means[1] - means[0]),
        change_sigma=float(np.sqrt(sum(1.0 / best[part].sum() for part in parts))),
        p=(above + 1) / (done + 1),
    )


def _splits(value: Doubles, weight: Doubles) -> Doubles:
    """The statistic \\|z\\| of each split, for each row of values."""
    total = np.cumsum(weight, axis=1)
    moment = np.cumsum(weight * value, axis=1)
    left = slice(_SIDE_MIN - 1, value.shape[1] - _SIDE_MIN)
    before, after = total[:, left], total[:, -1:] - total[:, left]
    difference = (moment[:, -1:] - moment[:, left]) / after - moment[:, left] / before
    return np.asarray(np.abs(difference) / np.sqrt(1.0 / before + 1.0 / after))


def _scatter(value: Doubles, sigma: Doubles) -> float:
    """The tau with which the median of (x - m)^2/(sigma^2 + tau^2) is that of the normal distribution, with
    the weighted median m: a few outliers do not matter."""
    from statistics import NormalDist

    if value.size < 3:
        return 0.0
    order = np.argsort(value)
    weight = np.cumsum((1.0 / sigma**2)[order])
    middle = value[order][np.searchsorted(weight, 0.5 * weight[-1])]
    square = (value - middle) ** 2
    expected = NormalDist().inv_cdf(0.75) ** 2
    low, high = 0.0, float(square.max()) / expected
    if np.median(square / sigma**2) <= expected:
        return 0.0
    for _ in range(60):
        tau = 0.5 * (low + high)
        low, high = (tau, high) if np.median(square / (sigma**2 + tau)) > expected else (low, tau)
    return float(np.sqrt(high))


def _parameters(dataset: str, storage_options: Mapping[str, Any] | None) -> pd.DataFrame:
    import fsspec
    import pyarrow.dataset as ds

    fs, path = fsspec.core.url_to_fs(dataset, **(storage_options or {}))
    directory = f"{str(path).rstrip('/')}/parameters"
    if not fs.exists(directory):
        raise ArgumentError(
            f"dataset = {dataset}: has no table parameters; name a dataset that fleet.run wrote with the steps "
            "summary, identify, springs or rest"
        )
    return ds.dataset(directory, filesystem=fs, format="parquet").to_table().to_pandas()


def _weights(one: Series) -> Doubles:
    return np.asarray(1.0 / (one.sigma**2 + one.scatter**2))


def _mean(one: Series) -> float:
    return float(np.average(one.value, weights=_weights(one)))


def _date(one: Series) -> str:
    return str(one.time_ns[one.split].astype("M8[ns]").astype("M8[s]"))


def _row(one: Series) -> dict[str, Any]:
    low, high = one.interval
    return {
        "changed": one.changed,
        "vehicle": one.vehicle,
        "step": one.step,
        "parameter": one.parameter,
        "unit": one.unit,
        "mean": _mean(one),
        "change": one.change,
        "low": low,
        "high": high,
        "before": _date(one),
        "drives": one.value.size,
        "scatter": one.scatter,
        "p": one.p,
    }
