"""Estimates of a log against its truth, or against another log's."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, Literal, TypedDict, overload

import numpy as np

from atvrec._atvrec import ArgumentError
from atvrec.log import Log, Path, opened


class Signal(TypedDict):
    """Errors of one signal, estimate less truth."""

    signal: str
    """Its name: ``sideslip``, ``measured_force_z`` and so on."""
    wheel: str | None
    """``FL``, ``FR``, ``RL``, ``RR``; None for what no wheel has."""
    unit: str
    """Unit of the errors: ``rad``, ``rad/s``, ``m/s``, ``N`` or ``N m``."""
    frame: str | None
    """Forces and moments: axes of the truth, ``wheel_carrier`` or ``contact``."""
    count: int
    """Instants that were compared."""
    mean: float
    rmse: float
    percentile_95: float
    """Of the error's size."""
    peak: float
    """The same."""
    normalised_percent: float | None
    """Forces: 100 RMSE / max(peak of the truth, static wheel load); moments: with 50 N m."""
    delay_s: float | None
    """How late the estimate is; None where the series have no common peak."""
    nees: float | None
    """Mean of ((estimate - truth)/sigma)^2; None without deviations."""
    nees_inside: float | None
    """Part of the windows whose mean lies within the 95 % bounds."""


class Consistency(TypedDict):
    """Whether the deviations of all forces hold."""

    mean: float
    """Mean of ((estimate - truth)/sigma)^2."""
    median: float
    """Median of the windows' means."""
    windows: int
    inside: float
    """Part of the windows whose mean lies within the 95 % bounds."""
    above: float
    freedom: float
    """Effective degrees of freedom of a window."""
    bounds: list[float]


class PartForces(TypedDict):
    """Tyre forces of a part of the samples in one frame."""

    count: int
    """Samples of all wheels."""
    worst_percent: list[float | None]
    """100 RMSE / max(peak of the truth in all samples, static load) of F_x, F_y, F_z: the largest of all
    wheels."""
    nees: list[float | None]
    """Mean of ((estimate - truth)/sigma)^2 of F_x, F_y, F_z over all wheels."""


class Forces(TypedDict):
    """Tyre forces of an output of the estimator in one frame."""

    output: str
    """``estimate``, ``lagged`` or ``smoothed``."""
    frame: str
    """Axes of the truth: ``wheel_carrier`` or ``contact``."""
    estimate_frame: str
    """Axes of the estimate."""
    worst_percent: list[float | None]
    """100 RMSE / max(peak of the truth, static load) of F_x, F_y, F_z: the largest of all wheels."""
    worst_moment_percent: list[float | None]
    """100 RMSE / max(peak of the truth, 50 N m) of M_x, M_z: the largest of all wheels."""
    nees: list[float | None]
    """Mean of ((estimate - truth)/sigma)^2 of F_x, F_y, F_z over all wheels."""
    nees_median: list[float | None]
    """Median of the same."""
    windows: Consistency | None
    """Windows of all twelve forces together."""
    near_stops: PartForces | None
    """Samples within 0.1 s of a strut on its stop or of a touchdown; None for simple methods and after a
    low-pass."""
    elsewhere: PartForces | None
    """All other samples."""
    near_standstills: PartForces | None
    """Samples within 0.1 s of the instant at which the vehicle comes to a standstill."""


class Channels(TypedDict):
    """Channels that the estimator excluded."""

    excluded_healthy: list[str]
    """Exclusions of channels without a fault, in the order of time."""
    excluded_healthy_recovered: int
    """How many of them were used again."""
    injected_faults: int
    missed_faults: list[str]
    """Injected faults without an exclusion."""


class Innovations(TypedDict):
    """Whether innovations of one kind of measurement are as large as the filter expects."""

    kind: str
    """``strain``, ``bending``, ``strut``, ``accelerometer``, ``gyro``, ``gnss_velocity``,
    ``gnss_attitude`` or ``wheel_speed``."""
    count: int
    """Scalar measurements that were taken in."""
    rejected: int
    """Those that were left out because they contradicted the state."""
    mean: float
    """Mean of y^2/S over those taken in."""
    median: float
    """Median of the windows' means."""
    windows: int
    """Seconds in which any was taken in."""
    inside: float
    """Part of the windows whose mean lies within the 95 % bounds."""
    above: float
    bounds: list[float]
    """Of a window with as many measurements as the windows have on the average."""


class Lift(TypedDict, total=False):
    """A lift in the truth: of a ``wheel``, or of both wheels of a ``side``."""

    wheel: str
    side: str
    at_s: float
    """From the start of the truth."""
    duration_s: float
    declared_after_s: float | None
    """None: missed."""
    warned_before_s: float | None
    fall_s: float | None
    """How long the load took from 25 to 2 % of the static load; None: it had not been at 25 % since the
    lift before."""
    warning_due_s: float | None
    """How long before the lift a warning is due; None: no warning is due."""


class WarningLeads(TypedDict):
    """How many lifts were warned of in time."""

    due: int
    """Lifts before which a warning is due."""
    in_time: int
    late: int
    missed: int
    not_due: int
    """Lifts whose load falls too quickly for a warning."""


class OffGround(TypedDict):
    """Times off the ground in the truth, lifts and shorter ones."""

    count: int
    per_km: float | None
    share_of_time: float


class Stops(TypedDict):
    """Instants of the truth near which the forces change within a step."""

    touchdowns: int
    strut_stops: int | None
    """None if the truth has no strut lengths or the vehicle file no stops."""
    standstills: int


class LowPassed(TypedDict):
    """Tyre forces after a low-pass, which estimate and truth pass alike."""

    hz: float
    forces: list[Forces]
    """By output and frame, without standard deviations and moments."""


class Landings(TypedDict):
    """Peaks of the load after the landings in the truth."""

    output: str
    """``estimate``, ``lagged`` or ``smoothed``."""
    count: int
    mean_percent: float
    """Mean of the errors, of the true peak."""
    standard_deviation_percent: float | None
    """None for a single landing."""


class SurfaceChange(TypedDict):
    """A change of the surface under an axle in the truth."""

    axle: str
    """``front`` or ``rear``."""
    at_s: float
    """From the start of the truth."""
    friction_ratio: float
    """After over before."""
    detectable: bool
    """Whether the tyres used enough of the lower friction."""
    declared_after_s: float | None
    declared_force_ratio: float | None
    """Part of the lateral force that was declared to be left."""


class RoadOutput(TypedDict):
    """The road of one output against the heights of the ground in the truth.

    Each error has ``count``, ``rms_<unit>``, ``truth_rms_<unit>`` and ``nees``.
    """

    output: str
    """``estimate`` or ``lagged``."""
    height: dict[str, float]
    """Above 0.5 Hz, of the worst wheel, m."""
    bank: dict[str, float]
    grade: dict[str, float]
    warp: dict[str, float]


class Roughness(TypedDict):
    """Roughness by ISO 8608."""

    # A keyword of Python: read it as ``roughness["class"]``.
    class_bounds: list[str]
    gd_n0_m3: float
    bounds_m3: list[float]
    waviness: float | None
    distance_m: float


class RoadScore(TypedDict):
    """The road against the truth."""

    outputs: list[RoadOutput]
    roughness: Roughness | None
    """The last estimate."""
    roughness_truth: Roughness | None
    """By the same method from the true heights."""
    class_agrees: float
    """Part of the instants with the class of the truth."""
    roughness_inside: float
    """Part of the instants whose bounds contain the Gd(n0) of the truth."""
    stated_class: str | None
    iri_m_km: float | None
    iri_truth_m_km: float | None
    unknown: dict[str, int]
    """Instants without values, by reason."""


class Score(TypedDict):
    """Estimates against truth: the keys of ``atvrec score --json``."""

    seconds: float
    """Time that was compared."""
    signals: list[Signal]
    forces: list[Forces]
    """By output and frame; first the frame that the estimate is given in."""
    forces_nees: Consistency | None
    low_passed: LowPassed | None
    """None without ``low_pass_hz``."""
    landings: list[Landings]
    innovations: list[Innovations]
    lifts: list[Lift]
    missed_lifts: int
    declared_lifts: int
    false_lifts: int
    lift_warnings: int
    false_lift_warnings: int
    lift_warning_leads: WarningLeads
    off_ground: OffGround
    two_wheel_lifts: list[Lift]
    missed_two_wheel_lifts: int
    declared_two_wheel_lifts: int
    false_two_wheel_lifts: int
    two_wheel_lift_warnings: int
    false_two_wheel_lift_warnings: int
    two_wheel_lift_warning_leads: WarningLeads
    two_wheels_off_ground: OffGround
    stops: Stops
    surface_changes: list[SurfaceChange] | None
    missed_surface_changes: int | None
    """Detectable changes that were not declared."""
    false_surface_changes: int | None
    road: RoadScore | None
    """None if the truth has no heights of the ground."""
    channels: Channels | None
    """None if the log does not tell the faults that its simulation injected."""
    events: dict[str, int]
    """How many events of each kind were declared."""


class ScoreWithMethods(Score):
    """A score with that of simple methods on the same samples: ``atvrec score --methods --json``."""

    methods: list[Forces]
    """By method and frame; ``output`` has the method: ``deflection``, ``statics`` or ``model``."""


class Difference(TypedDict):
    """How one signal differs, here less there."""

    signal: str
    wheel: str | None
    unit: str
    count: int
    mean: float
    rms: float
    largest: float
    largest_at_s: float
    """From the first common estimate."""
    one_sided: int
    """Instants that one side alone knows."""
    largest_of_sigma: float | None
    """Largest difference of the stated standard deviations."""


class LoneEvent(TypedDict):
    """An event that one log alone has."""

    kind: str
    at_s: float
    text: str


class Comparison(TypedDict):
    """Two logs of the same drive: the keys of ``atvrec score --against --json``."""

    common: int
    only_here: int
    only_there: int
    identical: bool
    signals: list[Difference]
    parameters: int
    """Reports of parameters at the same instants."""
    parameters_different: int
    """Those that differ in anything."""
    same_events: int
    similar_events: int
    """Of the same kind within 0.1 s, but not to the instant and the letter."""
    events_only_here: list[LoneEvent]
    events_only_there: list[LoneEvent]


@overload
def score(
    log: Log | Path | Iterable[Path],
    *,
    smoothed: bool = False,
    from_s: float = 2.0,
    low_pass_hz: float | None = None,
    methods: Literal[False] = False,
) -> Score: ...
@overload
def score(
    log: Log | Path | Iterable[Path],
    *,
    smoothed: bool = False,
    from_s: float = 2.0,
    low_pass_hz: float | None = None,
    methods: Literal[True],
) -> ScoreWithMethods: ...
def score(
    log: Log | Path | Iterable[Path],
    *,
    smoothed: bool = False,
    from_s: float = 2.0,
    low_pass_hz: float | None = None,
    methods: bool = False,
) -> Score | ScoreWithMethods:
    """Errors of a log's estimates against the truth that it carries.

    The first ``from_s`` seconds of the signals are left out; events of the first seconds count,
    unless ``from_s`` is above 2. ``smoothed`` judges the estimates of
    ``replay --smooth`` in the place of the causal ones. ``methods`` adds the forces of simple methods
    on the same samples, which takes about as long as a replay. ``low_pass_hz`` compares the forces after
    a Butterworth low-pass of fourth order, forward and backward, too (key ``low_passed``).

    Raises :class:`atvrec.LogError` where the log has no truth, estimate or vehicle.
    """
    found: Score | ScoreWithMethods = _scored(
        log, None, smoothed, from_s, methods, low_pass_hz
    )
    return found


def compare(
    log: Log | Path | Iterable[Path],
    other: Log | Path | Iterable[Path],
    *,
    smoothed: bool = False,
    from_s: float = 2.0,
) -> Comparison:
    """How the estimates of a log differ from those of another log of the same drive.

    Raises :class:`atvrec.LogError` where they have no instant in common.
    """
    found: Comparison = _scored(log, other, smoothed, from_s, methods=False)
    return found


def innovations(
    log: Log | Path | Iterable[Path], *, from_s: float = 2.0
) -> list[Innovations]:
    """How large the innovations of a log's filters are; needs no truth.

    Seconds that begin within ``from_s`` of the first report are left out, and kinds of measurement
    of which the log has none.
    """
    found: list[Innovations] = json.loads(opened(log)._reader.innovations_json(_checked(from_s)))
    return found


def _scored(
    log: Log | Path | Iterable[Path],
    other: Log | Path | Iterable[Path] | None,
    smoothed: bool,
    from_s: float,
    methods: bool,
    low_pass_hz: float | None = None,
) -> Any:
    against = None if other is None else opened(other)._reader
    reader = opened(log)._reader
    return json.loads(
        reader.score_json(against, smoothed, _checked(from_s), methods, low_pass_hz)
    )


def _checked(from_s: float) -> float:
    if not (np.isfinite(from_s) and from_s >= 0.0):
        raise ArgumentError(f"from_s = {from_s} s: must be a finite number, not negative")
    return from_s

