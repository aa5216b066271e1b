"""Calibration of sensors, as ``atvrec calibrate`` does it, on arrays.

Every function returns findings as those of :mod:`atvrec.identify`; :func:`steer` and :func:`weight`
add ``calibration``, the tables of the calibration file. Data that do not tell what is looked for
raise :class:`atvrec.DataError`. The steps that need all channels of a log at once (zero, load rig,
inertial unit, GNSS) are the command's.
"""

from __future__ import annotations

from typing import Any, TypedDict

from atvrec._atvrec import calibrate_rest as rest
from atvrec._atvrec import calibrate_steer as steer
from atvrec._atvrec import calibrate_weight as weight
from atvrec._atvrec import calibrate_wheel_radius as wheel_radius
from atvrec.identify import Findings

__all__ = ["Calibrated", "Rest", "rest", "steer", "weight", "wheel_radius"]


class Calibrated(Findings):
    """Findings with what goes into the calibration file."""

    calibration: dict[str, Any]
    """Tables of the calibration file, as nested dicts and lists."""


class Rest(TypedDict):
    """What a channel says at rest, in its own unit."""

    mean: float
    """Mean."""
    mean_sigma: float
    """Standard deviation of the mean, correlation taken into account."""
    noise: float
    """Standard deviation of one reading, from the differences of neighbours."""
    slope_per_s: float
    """Drift, a second."""
    slope_sigma: float
    """Standard deviation of the drift."""
    unsteadiness: float
    """How much more short means differ than noise and drift let them; 1 is no more."""
    unmoved: bool
    """Every reading is the same."""
    saturated: float
    """Part of the readings at either end of the range."""
