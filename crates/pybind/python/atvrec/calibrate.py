"""Calibration of sensors, as ``atvrec calibrate`` does it, on arrays.

Every function returns findings as those of :mod:`atvrec.identify` and, in ``calibration``, the tables
of the calibration file; :func:`wheel_radius` returns findings alone. ``known_calibration`` takes the
``calibration`` that an earlier step gave. Data that do not tell what is looked for raise
:class:`atvrec.DataError`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypedDict

import numpy.typing as npt

from atvrec._atvrec import calibrate_gnss as gnss
from atvrec._atvrec import calibrate_hub as hub
from atvrec._atvrec import calibrate_imu as imu
from atvrec._atvrec import calibrate_load_rig as load_rig
from atvrec._atvrec import calibrate_member as member
from atvrec._atvrec import calibrate_rest as rest
from atvrec._atvrec import calibrate_steer as steer
from atvrec._atvrec import calibrate_weight as weight
from atvrec._atvrec import calibrate_wheel_radius as wheel_radius
from atvrec._atvrec import calibrate_zero as zero
from atvrec.identify import Findings

__all__ = [
    "Antennas",
    "Calibrated",
    "Counts",
    "HubLog",
    "SteeringWheel",
    "Inertial",
    "InertialLog",
    "LoadRig",
    "Rest",
    "Zeros",
    "gnss",
    "hub",
    "imu",
    "load_rig",
    "member",
    "rest",
    "steer",
    "weight",
    "wheel_radius",
    "zero",
]


class Counts(TypedDict):
    """All converters of a vehicle at rest; wheels front left, front right, rear left, rear right."""

    time_s: npt.ArrayLike
    """Instants, s, (n,)."""
    strain: npt.ArrayLike
    """Counts of upper front and rear, lower front and rear arm, tie rod, and bending of the lower
    front and rear arm, (n, 4, 7); NaN where there is no such channel."""
    deflection: npt.ArrayLike
    """Counts of the spring potentiometers, (n, 4)."""


class Inertial(TypedDict):
    """Readings of an inertial unit."""

    time_s: npt.ArrayLike
    """Instants, s, rising, (n,)."""
    force_m_s2: npt.ArrayLike
    """Specific force, m/s^2, (n, 3)."""
    rate_rad_s: npt.ArrayLike
    """Angular rate, rad/s, (n, 3)."""


class SteeringWheel(TypedDict, total=False):
    """The steering wheel, where it is measured."""

    steering_wheel_time_s: npt.ArrayLike
    """Instants, s, (l,)."""
    steering_wheel_rad: npt.ArrayLike
    """Angle from straight ahead, rad, (l,)."""


class InertialLog(SteeringWheel):
    """What :func:`imu` reads of a log."""

    imu: Inertial
    """The unit's readings in its own axes."""
    speed_time_s: npt.ArrayLike
    """Instants of the speed, s, (m,)."""
    speed_m_s: npt.ArrayLike
    """Forward speed, m/s, (m,)."""
    compression_time_s: npt.ArrayLike
    """Instants of the compressions, s, (k,); empty where they are not measured."""
    compression_m: npt.ArrayLike
    """Compression of the four springs from their design length, m, (k, 4)."""


class HubLog(SteeringWheel):
    """What :func:`hub` reads of a log."""

    imu: Inertial
    """The inertial unit in body axes, bias and misalignment taken off."""
    hub_time_s: npt.ArrayLike
    """Instants of the hub accelerometers, s, (n,)."""
    hub_m_s2: Sequence[npt.ArrayLike]
    """Specific force along the axes of each of the four sensors before calibration, m/s^2, four times
    (n, 3); NaN where an axis is not measured."""
    compression_time_s: npt.ArrayLike
    """Instants of the compressions, s, (k,)."""
    compression_m: npt.ArrayLike
    """Compression of the four springs from their design length, m, (k, 4)."""
    wheel_time_s: npt.ArrayLike
    """Instants of the wheel speeds, s, (m,)."""
    wheel_rad_s: npt.ArrayLike
    """Angular speeds of the wheels, rad/s, (m, 4)."""


class Calibrated(Findings):
    """Findings with what goes into the calibration file."""

    calibration: dict[str, Any]
    """Tables of the calibration file, as nested dicts and lists."""


class Zeros(Calibrated):
    """What :func:`zero` found."""

    faults: list[str]
    """What is wrong with which channel."""


class LoadRig(Zeros):
    """What :func:`load_rig` found."""

    counts_per_n: dict[str, tuple[float, float, float]]
    """Counts for one newton of F_x, F_y, F_z by wheel and channel (``FL upper_front``)."""


class Antennas(Calibrated):
    """What :func:`gnss` found; ``calibration`` is the velocity receiver's table."""

    attitude: dict[str, Any]
    """Table of the attitude receiver."""


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
