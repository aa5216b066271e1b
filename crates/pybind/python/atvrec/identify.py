"""Vehicle parameters from a drive, as ``atvrec identify`` finds them, on arrays.

A :class:`Drive` comes from arrays of one's own or from a log, see :func:`drive_of`. Every function
returns a :class:`~atvrec.identify.Findings` dict, or raises :class:`atvrec.DataError` with what the
data lack.
"""

from __future__ import annotations

from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from atvrec._atvrec import Drive
from atvrec._atvrec import identify_cornering as cornering
from atvrec._atvrec import identify_frequency_response as frequency_response
from atvrec._atvrec import identify_friction as friction
from atvrec._atvrec import identify_pendulum as pendulum
from atvrec._atvrec import identify_roll_centre as roll_centre
from atvrec._atvrec import identify_roll_pitch as roll_pitch
from atvrec._atvrec import identify_step_response as step_response
from atvrec._atvrec import identify_tyre as tyre
from atvrec._atvrec import identify_understeer as understeer
from atvrec._atvrec import identify_yaw_inertia as yaw_inertia
from atvrec.log import Log

__all__ = [
    "Drive",
    "Finding",
    "Findings",
    "cornering",
    "drive_of",
    "frequency_response",
    "friction",
    "pendulum",
    "roll_centre",
    "roll_pitch",
    "step_response",
    "tyre",
    "understeer",
    "yaw_inertia",
]


class Finding(TypedDict):
    """A parameter that was found."""

    value: float
    """Value, in ``unit``."""
    sigma: float
    """Standard deviation, correlation of the residuals taken into account."""
    unit: str
    """SI unit; ``-`` for a ratio."""
    interval: tuple[float, float] | None
    """Interval that holds the truth with 95 %, from a seeded block bootstrap."""
    condition: float
    """Condition number of the regression, its columns brought to equal size."""
    excitation: tuple[float, str] | None
    """Root mean square of the regressor's part that no other explains, and its unit."""
    durbin_watson: float | None
    """Durbin-Watson statistic of the residuals."""
    ljung_box_p: float | None
    """Probability of such autocorrelations if the residuals were white."""
    span_s: tuple[float, float]
    """First and last instant used, s from the start of the data."""
    used_s: float
    """Time of the used rows put together, s."""
    rows: int
    """Rows used."""


class Findings(TypedDict):
    """Everything that one function found."""

    what: str
    """What was looked for."""
    findings: dict[str, Finding]
    """The parameters by name."""
    covariance: npt.NDArray[np.float64] | None
    """Covariance of the parameters in their order; ``None`` where only deviations are known."""
    beside: dict[str, tuple[float, str]]
    """Other methods' values and what a person judges by, with units."""
    notes: list[str]
    """What to know before using the values."""


def drive_of(log: Log, start_s: float = 2.0, end_s: float | None = None) -> Drive:
    """The drive of a log's ``/estimate/motion``, from ``start_s`` to ``end_s`` of the log, with the
    wheel loads of ``/estimate/contact_forces`` where the log has them.

    Accelerations are turned from the body's axes into the horizontal. The steer angle is the
    encoder's, without what the estimator has learnt of its zero. Estimates that are missing from
    the 100 Hz grid are NaN.
    """
    columns = log.read("/estimate/motion", start_s, end_s)
    row = np.rint(columns["t_s"] * 100.0).astype(np.int64)
    first = row[0] if row.size else 0
    length = row[-1] - first + 1 if row.size else 0

    def grid_of(columns: dict[str, npt.NDArray[Any]], name: str) -> npt.NDArray[np.float64]:
        row = np.rint(columns["t_s"] * 100.0).astype(np.int64) - first
        known = (row >= 0) & (row < length)
        values = np.full(length, np.nan)
        values[row[known]] = columns[name][known]
        return values

    def grid(name: str) -> npt.NDArray[np.float64]:
        return grid_of(columns, name)

    load = None
    if "/estimate/contact_forces" in log.topics:
        forces = log.read("/estimate/contact_forces", start_s, end_s)
        wheels = ("fl", "fr", "rl", "rr")
        load = np.column_stack([grid_of(forces, f"{wheel}.z_n") for wheel in wheels])
    learnt = np.zeros(length)
    if "/estimate/parameters" in log.topics:
        told = log.read("/estimate/parameters")
        if told["t_s"].size:
            at = (first + np.arange(length)) / 100.0
            learnt = np.interp(at, told["t_s"], told["steer_offset_rad"])
    forward, left = grid("velocity_x_m_s"), grid("velocity_y_m_s")
    along, across, up = (grid(f"acceleration_m_s2.{axis}") for axis in "xyz")
    roll, pitch = grid("roll_rad"), grid("pitch_rad")
    return Drive(
        0.01,
        speed_m_s=np.hypot(forward, left),
        sideslip_rad=grid("sideslip_rad"),
        yaw_rate_rad_s=grid("yaw_rate_rad_s"),
        lateral_m_s2=across * np.cos(roll) - up * np.sin(roll),
        longitudinal_m_s2=along * np.cos(pitch) + up * np.sin(pitch),
        steer_rad=0.5 * (grid("fl.steer_rad") + grid("fr.steer_rad")) - learnt,
        roll_rad=roll,
        pitch_rad=pitch,
        load_n=load,
    )
