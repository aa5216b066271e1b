"""The estimator in Python: samples in, motion and tyre forces out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeAlias, TypedDict, cast

import numpy as np
import numpy.typing as npt

from atvrec._atvrec import Calibration, SampleEstimator, Sensors, Tuning, Vehicle
from atvrec.log import Log, Path, opened

Doubles: TypeAlias = npt.NDArray[np.float64]
Quality: TypeAlias = Literal[
    "none", "single", "differential", "float", "fixed", "dead_reckoning"
]
Input: TypeAlias = Literal[
    "strain",
    "deflection",
    "imu",
    "gnss_velocity",
    "gnss_attitude",
    "wheel_speed",
    "steer",
    "ground_speed",
    "hub_acceleration",
]
Method: TypeAlias = Literal["fusion", "thesis"]


class _Times(TypedDict):
    log_time_ns: npt.ArrayLike
    """Log clock when the sample arrived, ns since 1970, (n,)."""


class Times(_Times, total=False):
    """Times of samples."""

    valid_time_ns: npt.ArrayLike
    """Log clock when the measured values were true, ns since 1970, (n,); ``log_time_ns`` where it is
    not given."""


class _Imu(Times):
    specific_force_m_s2: npt.ArrayLike
    """Specific force in the unit's own axes, m/s^2, (n, 3); what an accelerometer reads, +g upwards at
    rest."""
    angular_rate_rad_s: npt.ArrayLike
    """Angular rate in the unit's own axes, rad/s, (n, 3)."""


class ImuSamples(_Imu, total=False):
    """Samples of the inertial unit."""

    valid: npt.ArrayLike
    """Whether the unit marks its sample as valid, (n,); all are where it is not given."""


class _GnssVelocity(Times):
    velocity_enu_m_s: npt.ArrayLike
    """Velocity of the antenna to the east, to the north and upwards, m/s, (n, 3)."""


class GnssVelocitySamples(_GnssVelocity, total=False):
    """Samples of a receiver's velocity."""

    sigma_enu_m_s: npt.ArrayLike
    """Their standard deviations, m/s, (n, 3)."""
    quality: Quality | Sequence[Quality]
    """Quality of the solutions, one for all or one each; ``fixed`` where it is not given."""
    source: int | npt.ArrayLike
    """Number of the receiver, one for all or one each: give the same one where it also measures
    attitude."""


class GnssAttitudeSamples(Times, total=False):
    """Samples of a receiver with several antennas. NaN is an angle that it does not have."""

    yaw_rad: npt.ArrayLike
    """Yaw angle from east, left positive, rad, (n,)."""
    pitch_rad: npt.ArrayLike
    """Pitch angle, nose down positive, rad, (n,)."""
    roll_rad: npt.ArrayLike
    """Roll angle, right side down positive, rad, (n,)."""
    sigma_rad: npt.ArrayLike
    """Standard deviations of yaw, pitch and roll, rad, (n, 3)."""
    quality: Quality | Sequence[Quality]
    """Quality of the solutions, one for all or one each; ``fixed`` where it is not given."""
    source: int | npt.ArrayLike
    """Number of the receiver, one for all or one each."""


class _Corner(Times):
    wheel: str | Sequence[str]
    """``fl``, ``fr``, ``rl`` or ``rr``, one for all or one each."""


class CornerSamples(_Corner, total=False):
    """Samples of the converters of a wheel's suspension. NaN is a channel that is not there."""

    strain_counts: npt.ArrayLike
    """Counts of upper front and rear, lower front and rear arm, tie rod, and bending of the lower
    front and rear arm, (n, 7)."""
    strain_step_counts: npt.ArrayLike
    """Counts of one step of a value that was sent in another unit than counts, 0 for floating-point numbers, NaN for
    counts of a converter, (n, 7)."""
    deflection_counts: npt.ArrayLike
    """Counts of the spring potentiometer, (n,)."""
    deflection_step_counts: npt.ArrayLike
    """The same as ``strain_step_counts``, (n,)."""


class SteerSamples(Times):
    """Samples of the steering wheel."""

    steering_wheel_rad: npt.ArrayLike
    """Angle of the steering wheel, left positive, rad, (n,)."""


class WheelSpeedSamples(Times):
    """Samples of the wheel speeds."""

    angular_speed_rad_s: npt.ArrayLike
    """Angular speeds of the wheels, forward positive, rad/s, (n, 4); NaN where there is none."""


class _GroundSpeed(Times):
    forward_m_s: npt.ArrayLike
    """Forward velocity of the centre of gravity, body axes, m/s, (n,)."""


class GroundSpeedSamples(_GroundSpeed, total=False):
    """Samples of the velocity over ground."""

    leftward_m_s: npt.ArrayLike
    """Leftward velocity, body axes, m/s, (n,); NaN where there is none."""


class HubAccelerationSamples(Times):
    """Samples of the accelerometers on the uprights."""

    wheel: str | Sequence[str]
    """``fl``, ``fr``, ``rl`` or ``rr``, one for all or one each."""
    specific_force_m_s2: npt.ArrayLike
    """Specific force along the sensor's own axes before calibration, m/s^2, (n, 3): x forward, y
    along the spindle to the left, z up; NaN where an axis is not measured."""


class ControlSamples(Times, total=False):
    """Samples of a controller. NaN is a value that is not there."""

    hitch_force_n: npt.ArrayLike
    """Force of a load on the hitch, vehicle axes, N, (n, 3)."""
    drive_torque_n_m: npt.ArrayLike
    """Drive torques of the wheels about their spindles, N m, (n, 4)."""
    brake_torque_n_m: npt.ArrayLike
    """Brake torques of the wheels, N m, (n, 4)."""
    bridge_temperature_c: npt.ArrayLike
    """Temperatures of the strain bridges of the wheels, degrees Celsius, (n, 4)."""
    tyre_pressure_pa: npt.ArrayLike
    """Inflation pressures of the tyres above that of the air, Pa, (n, 4)."""


class Samples(TypedDict, total=False):
    """Samples of all kinds. Those with the same log time are taken in the order of the keys."""

    imu: ImuSamples
    gnss_velocity: GnssVelocitySamples
    gnss_attitude: GnssAttitudeSamples
    corner: CornerSamples
    steer: SteerSamples
    wheel_speed: WheelSpeedSamples
    ground_speed: GroundSpeedSamples
    hub_acceleration: HubAccelerationSamples
    control: ControlSamples


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates of n instants, 10 ms apart. NaN is a value that is not known.

    Axes are ISO 8855: x forward, y left, z up. Wheels stand in the order front left, front right,
    rear left, rear right.
    """

    time_ns: npt.NDArray[np.int64]
    """Log clock of the instants, ns since 1970, (n,)."""
    velocity_x_m_s: Doubles
    """Forward velocity of the centre of gravity, body axes, m/s, (n,)."""
    velocity_y_m_s: Doubles
    """Leftward velocity of the centre of gravity, body axes, m/s, (n,)."""
    sideslip_rad: Doubles
    """Sideslip angle, from the heading to the velocity in the horizontal plane, rad, (n,)."""
    sideslip_sigma_rad: Doubles
    """Standard deviation of the sideslip angle, rad, (n,)."""
    roll_rad: Doubles
    """Roll angle, right side down positive, rad, (n,)."""
    pitch_rad: Doubles
    """Pitch angle, nose down positive, rad, (n,)."""
    rate_rad_s: Doubles
    """Roll, pitch and yaw rate, body axes, rad/s, (n, 3)."""
    acceleration_m_s2: Doubles
    """Acceleration of the centre of gravity without gravity, body axes, m/s^2, (n, 3)."""
    steer_rad: Doubles
    """Steer angles of the road wheels, left positive, rad, (n, 4)."""
    slip_angle_rad: Doubles
    """Slip angles of the wheels, rad, (n, 4)."""
    longitudinal_slip: Doubles
    """Longitudinal slips of the wheels, (n, 4); NaN without a wheel speed and below 1 m/s."""
    longitudinal_slip_sigma: Doubles
    """Their standard deviations, (n, 4)."""
    bank_rad: Doubles
    """Bank of the road, right side down positive, rad, (n,)."""
    grade_rad: Doubles
    """Grade of the road, nose down positive, rad, (n,)."""
    force_n: Doubles
    """Forces of the ground on the tyres, x, y, z in the axes of ``force_frame``, N, (n, 4, 3)."""
    force_sigma_n: Doubles
    """Standard deviations of the forces, N, (n, 4, 3)."""
    force_moment_n_m: Doubles
    """Moments of the ground on the tyres about the wheel centres, same axes, N m, (n, 4, 3)."""
    force_moment_sigma_n_m: Doubles
    """Standard deviations of the moments, N m, (n, 4, 3)."""
    contact_force_n: Doubles
    """The forces in the contact frame (z normal to the ground, x along the wheel's heading), N,
    (n, 4, 3)."""
    contact_force_sigma_n: Doubles
    """Their standard deviations, with that of the ground's unknown normal, N, (n, 4, 3)."""
    expected_force_n: Doubles
    """Forces that the vehicle model expects from steer angles and motion, contact frame, N,
    (n, 4, 3)."""
    expected_force_sigma_n: Doubles
    """Standard deviations of the expected forces, N, (n, 4, 3)."""
    force_source: npt.NDArray[np.str_]
    """What the forces rest on: ``none``, ``deflection``, ``statics``, ``fusion`` or ``model``,
    (n, 4)."""
    force_frame: str
    """Axes of ``force_n``: ``wheel_carrier`` (y along the spindle, x = unit(y × z of the vehicle))."""
    load_transfer_ratio: Doubles
    """Right less left over the sum of the loads: 1 where both left wheels are off the ground, (n,)."""
    load_transfer_ratio_sigma: Doubles
    """Standard deviation of the ratio, (n,)."""
    axle_load_transfer_ratio: Doubles
    """The ratio of the front and of the rear axle, (n, 2)."""
    time_to_lift_s: Doubles
    """Time until a wheel's load is zero at its present rate, s, (n, 4); infinite where the load does
    not fall."""
    time_to_two_wheel_lift_s: Doubles
    """The same of both wheels of the left and of the right side, s, (n, 2)."""

    def __len__(self) -> int:
        return len(self.time_ns)


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters that the estimator learns, once a second. Axles stand in the order front, rear."""

    time_ns: npt.NDArray[np.int64]
    """Log clock of the instants, ns since 1970, (n,)."""
    accel_bias_m_s2: Doubles
    """Biases of the accelerometers beyond the calibration, body axes, m/s^2, (n, 3)."""
    accel_bias_sigma_m_s2: Doubles
    """Their standard deviations, m/s^2, (n, 3)."""
    gyro_bias_rad_s: Doubles
    """Biases of the gyros beyond the calibration, body axes, rad/s, (n, 3)."""
    gyro_bias_sigma_rad_s: Doubles
    """Their standard deviations, rad/s, (n, 3)."""
    steer_offset_rad: Doubles
    """Offset of the front road wheels from the steering wheel's zero, left positive, rad, (n,)."""
    steer_offset_sigma_rad: Doubles
    """Its standard deviation, rad, (n,)."""
    stiffness_factor: Doubles
    """Factors on the vehicle file's cornering stiffnesses, (n, 2)."""
    stiffness_factor_sigma: Doubles
    """Their standard deviations, (n, 2)."""
    friction: Doubles
    """Friction coefficients, (n, 2); NaN where too little of the friction was used to see it."""
    friction_sigma: Doubles
    """Their standard deviations, (n, 2)."""
    friction_min: Doubles
    """Lower bounds of the friction coefficients, (n, 2)."""
    utilisation: Doubles
    """Used parts of the friction, (n, 2)."""
    utilisation_sigma: Doubles
    """Their standard deviations, (n, 2)."""

    def __len__(self) -> int:
        return len(self.time_ns)


@dataclass(frozen=True)
class Event:
    """An event that the estimator declares."""

    time_ns: int
    """Log clock of the declaration, ns since 1970."""
    onset_ns: int
    """Log clock when it happened, or is expected to happen, ns since 1970."""
    kind: str
    """``lift_warning``, ``lift``, ``touchdown``, ``two_wheel_lift_warning``, ``two_wheel_lift``,
    ``surface_change``, ``sensor_fault``, ``sensor_recovered``, ``filter_reset``,
    ``filter_recovered``, ``mistake`` or ``inexact_parameters``."""
    text: str
    """Description, for people."""
    probability: float | None
    """Probability, where the detector gives one."""
    load_transfer_ratio: float | None
    """Load-transfer ratio at the declaration of lifts and their warnings."""


@dataclass(frozen=True, eq=False)
class Estimated:
    """Output of the estimator."""

    estimates: Estimates
    parameters: Parameters
    events: list[Event]


class Estimator:
    """Estimates motion and tyre forces from samples, as ``atvrec record`` does.

    The same samples in the same order give the same bits as the program. ``sensors`` are the built-in
    ``thesis-10bit`` by default, ``calibration`` the nominal one of the vehicle, ``tuning`` the default
    values. ``ignore`` names inputs that are not used, ``payload`` the payloads of the vehicle file that
    are on the vehicle.

    Raises :class:`atvrec.ArgumentError` where the calibration belongs to another vehicle, or holds a
    value that cannot be used, and where the vehicle has no payload with a name.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        sensors: Sensors | None = None,
        calibration: Calibration | None = None,
        tuning: Tuning | None = None,
        *,
        method: Method = "fusion",
        ignore: Sequence[Input] = (),
        payload: Sequence[str] = (),
    ) -> None:
        self._estimator = SampleEstimator(
            vehicle,
            sensors or Sensors.builtin(),
            calibration or Calibration.nominal(vehicle),
            tuning or Tuning(),
            method,
            list(ignore),
            list(payload),
        )

    def push(self, samples: Samples) -> None:
        """Takes samples of several kinds as arrays, in the order of their log time.

        Log times never fall from one call to the next. Each instant of the 10 ms grid is estimated
        when a sample or :meth:`advance` has come 5 ms after it: the measurements of the instant have
        arrived by then.
        """
        self._estimator.push(samples)

    def advance(self, log_time_ns: int) -> None:
        """Moves time to ``log_time_ns`` without a sample. The first call, or the first sample, sets
        the first instant that is estimated."""
        self._estimator.advance(log_time_ns)

    def take(self) -> Estimated:
        """Hands out what was estimated since the last call of this method."""
        return estimated(self._estimator.take())

    def run(self, samples: Samples) -> Estimated:
        """:meth:`push` and :meth:`take` in one call."""
        self.push(samples)
        return self.take()

    def push_imu(
        self,
        log_time_ns: int,
        specific_force_m_s2: Sequence[float] | Doubles,
        angular_rate_rad_s: Sequence[float] | Doubles,
        *,
        valid_time_ns: int | None = None,
        valid: bool = True,
    ) -> None:
        """Takes one sample of the inertial unit; see :class:`ImuSamples`."""
        self._push_one(
            "imu",
            log_time_ns,
            valid_time_ns,
            specific_force_m_s2=[specific_force_m_s2],
            angular_rate_rad_s=[angular_rate_rad_s],
            valid=[valid],
        )

    def push_gnss_velocity(
        self,
        log_time_ns: int,
        velocity_enu_m_s: Sequence[float] | Doubles,
        *,
        sigma_enu_m_s: Sequence[float] | Doubles | None = None,
        quality: Quality = "fixed",
        source: int | None = None,
        valid_time_ns: int | None = None,
    ) -> None:
        """Takes one velocity of a receiver; see :class:`GnssVelocitySamples`."""
        self._push_one(
            "gnss_velocity",
            log_time_ns,
            valid_time_ns,
            velocity_enu_m_s=[velocity_enu_m_s],
            sigma_enu_m_s=None if sigma_enu_m_s is None else [sigma_enu_m_s],
            quality=quality,
            source=source,
        )

    def push_gnss_attitude(
        self,
        log_time_ns: int,
        *,
        yaw_rad: float | None = None,
        pitch_rad: float | None = None,
        roll_rad: float | None = None,
        sigma_rad: Sequence[float] | Doubles | None = None,
        quality: Quality = "fixed",
        source: int | None = None,
        valid_time_ns: int | None = None,
    ) -> None:
        """Takes one attitude of a receiver; see :class:`GnssAttitudeSamples`."""
        self._push_one(
            "gnss_attitude",
            log_time_ns,
            valid_time_ns,
            yaw_rad=None if yaw_rad is None else [yaw_rad],
            pitch_rad=None if pitch_rad is None else [pitch_rad],
            roll_rad=None if roll_rad is None else [roll_rad],
            sigma_rad=None if sigma_rad is None else [sigma_rad],
            quality=quality,
            source=source,
        )

    def push_corner(
        self,
        log_time_ns: int,
        wheel: str,
        *,
        strain_counts: Sequence[float] | Doubles | None = None,
        deflection_counts: float | None = None,
        strain_step_counts: Sequence[float] | Doubles | None = None,
        deflection_step_counts: float | None = None,
        valid_time_ns: int | None = None,
    ) -> None:
        """Takes one sample of the converters of a wheel; see :class:`CornerSamples`."""
        self._push_one(
            "corner",
            log_time_ns,
            valid_time_ns,
            wheel=wheel,
            strain_counts=None if strain_counts is None else [strain_counts],
            deflection_counts=None if deflection_counts is None else [deflection_counts],
            strain_step_counts=None if strain_step_counts is None else [strain_step_counts],
            deflection_step_counts=None
            if deflection_step_counts is None
            else [deflection_step_counts],
        )

    def push_steer(
        self, log_time_ns: int, steering_wheel_rad: float, *, valid_time_ns: int | None = None
    ) -> None:
        """Takes one angle of the steering wheel; see :class:`SteerSamples`."""
        self._push_one(
            "steer", log_time_ns, valid_time_ns, steering_wheel_rad=[steering_wheel_rad]
        )

    def push_wheel_speed(
        self,
        log_time_ns: int,
        angular_speed_rad_s: Sequence[float] | Doubles,
        *,
        valid_time_ns: int | None = None,
    ) -> None:
        """Takes one sample of the wheel speeds; see :class:`WheelSpeedSamples`."""
        self._push_one(
            "wheel_speed", log_time_ns, valid_time_ns, angular_speed_rad_s=[angular_speed_rad_s]
        )

    def push_ground_speed(
        self,
        log_time_ns: int,
        forward_m_s: float,
        leftward_m_s: float | None = None,
        *,
        valid_time_ns: int | None = None,
    ) -> None:
        """Takes one velocity over ground; see :class:`GroundSpeedSamples`."""
        self._push_one(
            "ground_speed",
            log_time_ns,
            valid_time_ns,
            forward_m_s=[forward_m_s],
            leftward_m_s=None if leftward_m_s is None else [leftward_m_s],
        )

    def push_hub_acceleration(
        self,
        log_time_ns: int,
        wheel: str,
        specific_force_m_s2: npt.ArrayLike,
        *,
        valid_time_ns: int | None = None,
    ) -> None:
        """Takes one sample of a hub accelerometer; see :class:`HubAccelerationSamples`."""
        self._push_one(
            "hub_acceleration",
            log_time_ns,
            valid_time_ns,
            wheel=wheel,
            specific_force_m_s2=[specific_force_m_s2],
        )

    def push_control(
        self,
        log_time_ns: int,
        *,
        hitch_force_n: Sequence[float] | Doubles | None = None,
        drive_torque_n_m: Sequence[float] | Doubles | None = None,
        brake_torque_n_m: Sequence[float] | Doubles | None = None,
        bridge_temperature_c: Sequence[float] | Doubles | None = None,
        tyre_pressure_pa: Sequence[float] | Doubles | None = None,
        valid_time_ns: int | None = None,
    ) -> None:
        """Takes one sample of a controller; see :class:`ControlSamples`."""
        values = {
            "hitch_force_n": hitch_force_n,
            "drive_torque_n_m": drive_torque_n_m,
            "brake_torque_n_m": brake_torque_n_m,
            "bridge_temperature_c": bridge_temperature_c,
            "tyre_pressure_pa": tyre_pressure_pa,
        }
        rows = {name: [value] for name, value in values.items() if value is not None}
        self._push_one("control", log_time_ns, valid_time_ns, **rows)

    def _push_one(
        self, kind: str, log_time_ns: int, valid_time_ns: int | None, **values: Any
    ) -> None:
        rows = {name: value for name, value in values.items() if value is not None}
        rows["log_time_ns"] = [log_time_ns]
        rows["valid_time_ns"] = [log_time_ns if valid_time_ns is None else valid_time_ns]
        self._estimator.push({kind: rows})


def estimated(found: tuple[dict[str, Any], dict[str, Any], list[dict[str, Any]]]) -> Estimated:
    """Records of what the extension module gives."""
    estimates, parameters, events = found
    sources = np.array(estimates.pop("force_source"), dtype="<U11").reshape(-1, 4)
    return Estimated(
        estimates=Estimates(**estimates, force_source=sources),
        parameters=Parameters(**parameters),
        events=[Event(**event) for event in events],
    )


_WHEELS = ("fl", "fr", "rl", "rr")
_MEMBERS = (
    "upper_front",
    "upper_rear",
    "lower_front",
    "lower_rear",
    "tie_rod",
    "lower_front_bending",
    "lower_rear_bending",
)
_Columns: TypeAlias = dict[str, npt.NDArray[Any]]


def samples(log: Log | Path | Iterable[Path]) -> Samples:
    """All samples of a log that concern the estimator, for :meth:`Estimator.run`.

    They are those of the decoded channels, with the same bits. An estimator that was made with the
    vehicle, sensors and calibration of the log, and that was moved to the log's first message
    (:attr:`Log.start_ns`) before, gives the estimates of the log.
    """
    log = opened(log)
    run = log.info()["metadata"].get("atvrec.run", {})
    sources = {
        text.split(" ", 1)[1]: int(key.removeprefix("source."))
        for key, text in run.items()
        if key.startswith("source.")
    }
    found: dict[str, list[_Columns]] = {}
    read = partial(log.read, rows="messages")
    for topic in log.topics:
        parts = topic.split("/")[1:]
        match parts:
            case ["imu", _]:
                found.setdefault("imu", []).append(_imu(read(topic)))
            case ["gnss", name, "velocity" | "attitude" as kind]:
                columns = read(topic)
                rows = _velocity(columns) if kind == "velocity" else _attitude(columns)
                names = {
                    number: text.removeprefix("FIX_QUALITY_").lower()
                    for number, text in log.enums(topic)["quality"].items()
                }
                rows["quality"] = np.array([names[number] for number in columns["quality"]], dtype=str)
                rows["source"] = np.full(len(rows["quality"]), sources.get(name, 0))
                found.setdefault(f"gnss_{kind}", []).append(rows)
            case ["strain" | "deflection" as kind]:
                found.setdefault("corner", []).extend(_corners(read(topic), kind))
            case ["steer"]:
                columns = read(topic)
                angle = {"steering_wheel_rad": columns["steering_wheel_rad"]}
                found.setdefault("steer", []).append(_times(columns) | angle)
            case ["wheel_speed"]:
                columns = read(topic)
                of_wheels = [columns[f"{wheel}.angular_speed_rad_s"] for wheel in _WHEELS]
                rows = _times(columns) | {"angular_speed_rad_s": np.stack(of_wheels, axis=1)}
                found.setdefault("wheel_speed", []).append(rows)
            case ["ground_speed", _]:
                columns = read(topic)
                speeds = {name: columns[name] for name in ("forward_m_s", "leftward_m_s")}
                found.setdefault("ground_speed", []).append(_times(columns) | speeds)
            case ["hub_acceleration"]:
                found.setdefault("hub_acceleration", []).extend(_hubs(read(topic)))
            case ["control", _]:
                found.setdefault("control", []).extend(_controls(read(topic), log.units(topic)))
    return cast(Samples, {kind: _merged(tables) for kind, tables in found.items() if tables})


_CONTROLS = {
    "hitch_force_n": ("hitch_force", "xyz", ("N",)),
    "drive_torque_n_m": ("drive_torque", _WHEELS, ("N m", "Nm")),
    "brake_torque_n_m": ("brake_torque", _WHEELS, ("N m", "Nm")),
    "bridge_temperature_c": ("bridge_temperature", _WHEELS, ("degC",)),
    "tyre_pressure_pa": ("tyre_pressure", _WHEELS, ("Pa",)),
}


def _controls(columns: _Columns, units: dict[str, str]) -> list[_Columns]:
    """A table of the messages that have a value for the estimator; none where none has one."""
    length = len(columns["log_time_ns"])
    of = {name.lower(): name for name in columns}
    values: _Columns = {}
    for argument, (name, parts, known) in _CONTROLS.items():
        fields = [of.get(f"{name}_{part}", "") for part in parts]
        values[argument] = np.full((length, len(fields)), np.nan)
        for column, field in enumerate(fields):
            if units.get(field) in known:
                values[argument][:, column] = columns[field]
    present = ~np.isnan(np.concatenate(list(values.values()), axis=1)).all(axis=1)
    if not present.any():
        return []
    rows = _times(columns) | values
    return [{name: column[present] for name, column in rows.items()}]


def _hubs(columns: _Columns) -> list[_Columns]:
    """A table for each wheel, of the messages that have it."""
    tables = []
    for wheel in _WHEELS:
        axes = [columns.get(f"{wheel}.{axis}.specific_force_m_s2") for axis in "xyz"]
        if all(axis is None for axis in axes):
            continue
        times = _times(columns)
        unknown = np.full(len(times["log_time_ns"]), np.nan)
        force = np.stack([unknown if axis is None else axis for axis in axes], axis=1)
        present = ~np.isnan(force).all(axis=1)
        table = {name: column[present] for name, column in times.items()}
        table |= {
            "wheel": np.full(int(present.sum()), wheel),
            "specific_force_m_s2": force[present],
        }
        tables.append(table)
    return tables


def _times(columns: _Columns) -> _Columns:
    return {
        "log_time_ns": columns["log_time_ns"],
        "valid_time_ns": columns["publish_time_ns"],
    }


def _triple(columns: _Columns, name: str, parts: Sequence[str]) -> Doubles:
    return np.stack([columns[f"{name}.{part}"] for part in parts], axis=1)


def _imu(columns: _Columns) -> _Columns:
    return _times(columns) | {
        "specific_force_m_s2": _triple(columns, "specific_force_m_s2", "xyz"),
        "angular_rate_rad_s": _triple(columns, "angular_rate_rad_s", "xyz"),
        "valid": columns["valid"],
    }


def _velocity(columns: _Columns) -> _Columns:
    parts = ("east", "north", "up")
    return _times(columns) | {
        "velocity_enu_m_s": _triple(columns, "velocity_m_s", parts),
        "sigma_enu_m_s": _triple(columns, "sigma_m_s", parts),
    }


def _attitude(columns: _Columns) -> _Columns:
    angles = {name: columns[name] for name in ("yaw_rad", "pitch_rad", "roll_rad")}
    sigma = _triple(columns, "sigma_rad", ("yaw", "pitch", "roll"))
    return _times(columns) | angles | {"sigma_rad": sigma}


def _corners(columns: _Columns, kind: str) -> list[_Columns]:
    """Rows of each wheel; a message holds some wheels only."""
    tables = []
    for wheel in _WHEELS:
        length = len(columns["log_time_ns"])
        counts = {
            "strain_counts": np.full((length, len(_MEMBERS)), np.nan),
            "strain_step_counts": np.full((length, len(_MEMBERS)), np.nan),
            "deflection_counts": np.full(length, np.nan),
            "deflection_step_counts": np.full(length, np.nan),
        }
        if kind == "strain":
            members = [_counts(columns, f"{wheel}.{member}") for member in _MEMBERS]
            counts["strain_counts"] = np.stack([counts for counts, _ in members], axis=1)
            counts["strain_step_counts"] = np.stack([step for _, step in members], axis=1)
            present = ~np.isnan(counts["strain_counts"]).all(axis=1)
        else:
            read = _counts(columns, wheel)
            counts["deflection_counts"], counts["deflection_step_counts"] = read
            present = ~np.isnan(counts["deflection_counts"])
        rows = _times(columns) | counts
        table = {name: values[present] for name, values in rows.items()}
        table["wheel"] = np.full(int(present.sum()), wheel)
        tables.append(table)
    return tables


def _counts(columns: _Columns, name: str) -> tuple[Doubles, Doubles]:
    """Counts of a converter, or those of a value in another unit; and the step, NaN for a converter."""
    raw = columns[f"{name}.raw_counts"]
    unknown = np.full(len(raw), np.nan)
    other = columns.get(f"{name}.equivalent_counts", unknown)
    step = columns.get(f"{name}.step_counts", unknown)
    is_other = np.isnan(raw) & ~np.isnan(other)
    step = np.where(is_other, np.nan_to_num(step, nan=0.0), np.nan)
    return np.where(is_other, other, raw), step


def _merged(tables: list[_Columns]) -> _Columns:
    """One table of several, ordered by log time."""
    columns = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    order = np.argsort(columns["log_time_ns"], kind="stable")
    return {name: values[order] for name, values in columns.items()}
