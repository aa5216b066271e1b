import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias, TypedDict, final

import numpy as np
import numpy.typing as npt

from atvrec.calibrate import (
    Antennas,
    Calibrated,
    Counts,
    Inertial,
    HubLog,
    InertialLog,
    LoadRig,
    Rest,
    Zeros,
)
from atvrec.identify import Findings
from atvrec.log import Info

_Doubles: TypeAlias = npt.NDArray[np.float64]
_Complexes: TypeAlias = npt.NDArray[np.complex128]
_PerWheel: TypeAlias = float | Sequence[float] | _Doubles
_Wheel: TypeAlias = Literal["fl", "fr", "rl", "rr"]

__all__ = [
    "ArgumentError",
    "AtvrecError",
    "Bicycle",
    "Calibration",
    "Corner",
    "DataError",
    "Drive",
    "FourWheel",
    "FourteenDof",
    "LogError",
    "LogReader",
    "Ride",
    "SampleEstimator",
    "Sensors",
    "SimulationError",
    "SpringTyre",
    "Steering",
    "StrainChannel",
    "Tuning",
    "Tyre",
    "Vehicle",
    "VehicleError",
    "__version__",
    "_restore",
    "ackermann_rad",
    "amplifier_gain",
    "calibrate_gnss",
    "calibrate_hub",
    "calibrate_imu",
    "calibrate_load_rig",
    "calibrate_member",
    "calibrate_rest",
    "calibrate_steer",
    "calibrate_weight",
    "calibrate_wheel_radius",
    "calibrate_zero",
    "identify_cornering",
    "identify_frequency_response",
    "identify_friction",
    "identify_pendulum",
    "identify_roll_centre",
    "identify_roll_pitch",
    "identify_step_response",
    "identify_tyre",
    "identify_understeer",
    "identify_yaw_inertia",
    "manoeuvres",
    "rainflow",
    "replay_log",
    "road_height_m",
    "run_program",
    "simulate_log",
    "strain_circuits",
]
__version__: str

_Topic: TypeAlias = tuple[dict[str, npt.NDArray[Any]], dict[str, str], list[str]]

class AtvrecError(Exception): ...
class LogError(AtvrecError): ...
class VehicleError(AtvrecError, ValueError): ...
class ArgumentError(AtvrecError, ValueError): ...
class SimulationError(AtvrecError): ...
class DataError(AtvrecError, ValueError): ...

@final
class LogReader:
    def __new__(cls, paths: Sequence[str | os.PathLike[str]]) -> LogReader: ...
    def topics(self) -> list[str]: ...
    def span_ns(self) -> tuple[int, int] | None: ...
    def info(self) -> Info: ...
    def attachments(self) -> dict[str, bytes]: ...
    def read(
        self,
        topics: Sequence[str],
        fields: Sequence[Sequence[str]],
        start_ns: int,
        end_ns: int,
        joined: bool,
    ) -> list[_Topic]: ...
    def frame(
        self,
        topics: Sequence[str],
        fields: Sequence[Sequence[str]],
        start_ns: int,
        end_ns: int,
        rate_hz: float | None,
        method: str,
        max_gap_ns: int | None,
    ) -> tuple[npt.NDArray[np.int64], list[_Topic]]: ...
    def latencies_json(self) -> str: ...
    def mistakes_json(self) -> str: ...
    def identify(self, kind: str, from_s: float, seed: int) -> list[Findings]: ...
    def report_json(self, smoothed: bool) -> str: ...
    def enums(self, topic: str) -> dict[str, dict[int, str]]: ...
    def score_json(
        self,
        against: LogReader | None,
        smoothed: bool,
        from_s: float,
        methods: bool,
        low_pass_hz: float | None,
    ) -> str: ...
    def innovations_json(self, from_s: float) -> str: ...

@final
class Vehicle:
    @staticmethod
    def builtin(name: str = "prowler") -> Vehicle: ...
    @staticmethod
    def builtin_names() -> list[str]: ...
    @staticmethod
    def load(path: str | os.PathLike[str]) -> Vehicle: ...
    @staticmethod
    def from_toml(text: str, name: str = "vehicle.toml") -> Vehicle: ...
    def to_toml(self) -> str: ...
    def to_dict(self) -> dict[str, Any]: ...
    def with_values(
        self, values: Mapping[str, float | bool | str | Sequence[float]]
    ) -> Vehicle: ...
    def warnings(self) -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def mass_kg(self) -> float: ...
    @property
    def sprung_mass_kg(self) -> float: ...
    @property
    def wheelbase_m(self) -> float: ...
    @property
    def roll_axis_height_m(self) -> float: ...
    @property
    def roll_arm_m(self) -> float: ...

class _TyreForces(TypedDict):
    longitudinal_n: _Doubles
    lateral_n: _Doubles
    aligning_n_m: _Doubles

@final
class Tyre:
    @staticmethod
    def of(vehicle: Vehicle, axle: Literal["front", "rear"]) -> Tyre: ...
    @staticmethod
    def physical(
        law: Literal["linear", "fiala", "brush", "exponential", "dugoff"],
        *,
        cornering_stiffness_n_rad: float,
        slip_stiffness_n: float,
        friction: float,
        sliding_friction: float | None = None,
        camber_stiffness_n_rad: float = 0.0,
        contact_length_m: float = 0.0,
        reference_load_n: float | None = None,
        load_exponent: float = 0.0,
    ) -> Tyre: ...
    @staticmethod
    def magic_formula_89() -> Tyre: ...
    @staticmethod
    def magic_formula_52(coefficients: Mapping[str, float] | None = None) -> Tyre: ...
    @staticmethod
    def rational(
        *,
        nominal_load_n: float,
        greatest_load_n: float,
        longitudinal: Sequence[Sequence[float]],
        lateral: Sequence[Sequence[float]],
        offset: Sequence[Sequence[float]],
        radius_m: float,
        vertical_stiffness_n_m: float,
    ) -> Tyre: ...
    def forces(
        self,
        load_n: npt.ArrayLike,
        slip_angle_rad: npt.ArrayLike | None = None,
        slip_ratio: npt.ArrayLike | None = None,
        camber_rad: npt.ArrayLike | None = None,
        friction_scale: npt.ArrayLike | None = None,
        stiffness_scale: npt.ArrayLike | None = None,
    ) -> _TyreForces: ...

@final
class SpringTyre:
    def __new__(
        cls,
        *,
        radius_m: float,
        deflection_m: float,
        load_n: float,
        spacing_rad: float = 0.017453292519943295,
        interradial_part: float = 0.3,
    ) -> SpringTyre: ...
    def forces(
        self,
        position_m: npt.ArrayLike,
        height_m: npt.ArrayLike,
        road_m: npt.ArrayLike,
    ) -> _Doubles: ...

@final
class Steering:
    def __new__(cls, vehicle: Vehicle) -> Steering: ...
    @property
    def lash_rad(self) -> float: ...
    def road_wheels(
        self, steering_wheel_rad: npt.ArrayLike, roll_rad: float = 0.0, *, play: bool = False
    ) -> _Doubles: ...
    def steering_wheel_rad(self, mean_steer_rad: float) -> float: ...

class _Gains(TypedDict):
    yaw_rate_1_s: _Doubles
    sideslip: _Doubles
    lateral_m_s2: _Doubles
    curvature_1_m: _Doubles

@final
class Bicycle:
    def __new__(cls, vehicle: Vehicle) -> Bicycle: ...
    def system(self, speed_m_s: float) -> tuple[_Doubles, _Doubles]: ...
    def relaxed_system(
        self, speed_m_s: float, relaxation_m: float
    ) -> tuple[_Doubles, _Doubles]: ...
    def eigenvalues(self, speed_m_s: npt.ArrayLike) -> _Complexes: ...
    def yaw_mode(self, speed_m_s: float) -> tuple[float, float] | None: ...
    @property
    def understeer_gradient_rad_m_s2(self) -> float: ...
    @property
    def characteristic_speed_m_s(self) -> float | None: ...
    @property
    def critical_speed_m_s(self) -> float | None: ...
    @property
    def static_margin(self) -> float: ...
    def steady_gains(self, speed_m_s: npt.ArrayLike) -> _Gains: ...
    def frequency_response(
        self, speed_m_s: float, frequency_rad_s: npt.ArrayLike
    ) -> _Complexes: ...

class _Outputs(TypedDict):
    load_n: _Doubles
    longitudinal_n: _Doubles
    lateral_n: _Doubles
    aligning_n_m: _Doubles
    slip_angle_rad: _Doubles
    slip_ratio: _Doubles
    longitudinal_m_s2: _Doubles
    lateral_m_s2: _Doubles

class _SteadyTurn(_Outputs):
    state: _Doubles
    inputs: _Doubles

class _Chassis:
    STATES: list[str]
    INPUTS: list[str]
    def rolling(self, speed_m_s: float) -> _Doubles: ...
    def derivative(self, state: npt.ArrayLike, inputs: npt.ArrayLike) -> _Doubles: ...
    def step(
        self, state: npt.ArrayLike, inputs: npt.ArrayLike, step_s: float, steps: int = 1
    ) -> _Doubles: ...
    def simulate(
        self,
        state: npt.ArrayLike,
        inputs: npt.ArrayLike,
        step_s: float,
        steps: int | None = None,
        every: int = 1,
    ) -> _Doubles: ...
    def simulate_adaptive(
        self,
        state: npt.ArrayLike,
        inputs: npt.ArrayLike,
        duration_s: float,
        *,
        relative: float = 1e-8,
        absolute: float = 1e-9,
    ) -> tuple[_Doubles, _Doubles]: ...
    def jacobian(self, state: npt.ArrayLike, inputs: npt.ArrayLike) -> _Doubles: ...

@final
class FourWheel(_Chassis):
    def __new__(cls, vehicle: Vehicle) -> FourWheel: ...
    @staticmethod
    def inputs(
        front_steer_rad: float | None = None,
        *,
        steer_rad: _PerWheel | None = None,
        drive_n_m: _PerWheel | None = None,
        brake_n_m: _PerWheel | None = None,
        bank_rad: float = 0.0,
        grade_rad: float = 0.0,
        friction_scale: _PerWheel | None = None,
        stiffness_scale: _PerWheel | None = None,
    ) -> _Doubles: ...
    @staticmethod
    def simulate_each(
        models: Sequence[FourWheel],
        state: npt.ArrayLike,
        inputs: npt.ArrayLike,
        step_s: float,
        steps: int | None = None,
        every: int = 1,
    ) -> _Doubles: ...
    def outputs(self, state: npt.ArrayLike, inputs: npt.ArrayLike) -> _Outputs: ...
    def steady_turn(
        self, longitudinal_m_s: float, radius_m: float, drive_front: float | None = None
    ) -> _SteadyTurn: ...

class _FourteenOutputs(TypedDict):
    load_n: _Doubles
    deflection_m: _Doubles
    longitudinal_n: _Doubles
    lateral_n: _Doubles
    slip_angle_rad: _Doubles
    slip_ratio: _Doubles
    strut_length_m: _Doubles
    strut_force_n: _Doubles
    specific_force_m_s2: _Doubles

class _WithEvents(TypedDict):
    time_s: _Doubles
    states: _Doubles
    events: list[tuple[float, str, str]]

@final
class FourteenDof(_Chassis):
    def __new__(cls, vehicle: Vehicle) -> FourteenDof: ...
    @staticmethod
    def inputs(
        front_steer_rad: float | None = None,
        *,
        steer_rad: _PerWheel | None = None,
        drive_n_m: _PerWheel | None = None,
        brake_n_m: _PerWheel | None = None,
        road_m: _PerWheel | None = None,
        road_rate_m_s: _PerWheel | None = None,
        bank_rad: float = 0.0,
        grade_rad: float = 0.0,
        friction_scale: _PerWheel | None = None,
        stiffness_scale: _PerWheel | None = None,
    ) -> _Doubles: ...
    @staticmethod
    def simulate_each(
        models: Sequence[FourteenDof],
        state: npt.ArrayLike,
        inputs: npt.ArrayLike,
        step_s: float,
        steps: int | None = None,
        every: int = 1,
    ) -> _Doubles: ...
    def simulate_events(
        self,
        state: npt.ArrayLike,
        inputs: npt.ArrayLike,
        duration_s: float,
        step_s: float,
    ) -> _WithEvents: ...
    def outputs(self, state: npt.ArrayLike, inputs: npt.ArrayLike) -> _FourteenOutputs: ...

@final
class Ride:
    @staticmethod
    def quarter(vehicle: Vehicle, wheel: _Wheel) -> Ride: ...
    @staticmethod
    def half(vehicle: Vehicle) -> Ride: ...
    @staticmethod
    def half_lateral(vehicle: Vehicle, wheel: _Wheel) -> Ride: ...
    @staticmethod
    def full(vehicle: Vehicle) -> Ride: ...
    def system(self) -> tuple[_Doubles, _Doubles, _Doubles]: ...
    def poles(self) -> _Complexes: ...
    def response(self, wheel: int, frequency_hz: npt.ArrayLike) -> _Complexes: ...

class _Curves(TypedDict):
    strut_length_m: _Doubles
    camber_rad: _Doubles
    toe_in_rad: _Doubles
    track_m: _Doubles
    roll_centre_height_m: _Doubles
    motion_ratio: _Doubles

@final
class Corner:
    MEMBERS: list[str]
    def __new__(cls, vehicle: Vehicle, wheel: _Wheel) -> Corner: ...
    def curves(
        self, jounce_m: npt.ArrayLike, loaded_radius_m: float | None = None
    ) -> _Curves: ...
    def members(
        self, wrench: npt.ArrayLike, jounce_m: float = 0.0, rack_m: float = 0.0
    ) -> _Doubles: ...
    def wrench(
        self, members: npt.ArrayLike, jounce_m: float = 0.0, rack_m: float = 0.0
    ) -> _Doubles: ...
    def wrench_with_parity(
        self,
        members: Sequence[float] | _Doubles,
        member_sigma_n: Sequence[float] | _Doubles,
        *,
        moment_sigma_n_m: Sequence[float] | _Doubles = ...,
        rolling_m: float = 0.0,
        jounce_m: float = 0.0,
        rack_m: float = 0.0,
    ) -> tuple[_Doubles, _Doubles]: ...

@final
class Sensors:
    @staticmethod
    def builtin(name: str = "thesis-10bit") -> Sensors: ...
    @staticmethod
    def builtin_names() -> list[str]: ...
    @staticmethod
    def load(path: str | os.PathLike[str]) -> Sensors: ...
    @staticmethod
    def from_toml(text: str, name: str = "sensors.toml") -> Sensors: ...
    def to_toml(self) -> str: ...
    @property
    def name(self) -> str: ...

@final
class Calibration:
    @staticmethod
    def nominal(vehicle: Vehicle) -> Calibration: ...
    @staticmethod
    def load(path: str | os.PathLike[str]) -> Calibration: ...
    @staticmethod
    def from_toml(text: str, name: str = "calibration.toml") -> Calibration: ...
    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Calibration: ...
    def to_toml(self) -> str: ...
    def to_dict(self) -> dict[str, Any]: ...
    @property
    def vehicle(self) -> str: ...

@final
class Tuning:
    def __new__(cls) -> Tuning: ...
    @staticmethod
    def from_toml(text: str, name: str = "tuning.toml") -> Tuning: ...
    def with_values(self, values: Mapping[str, Any]) -> Tuning: ...
    def to_toml(self) -> str: ...
    def to_dict(self) -> dict[str, Any]: ...

_Estimated: TypeAlias = tuple[dict[str, Any], dict[str, Any], list[dict[str, Any]]]

@final
class SampleEstimator:
    def __new__(
        cls,
        vehicle: Vehicle,
        sensors: Sensors,
        calibration: Calibration,
        tuning: Tuning,
        method: str,
        ignore: Sequence[str],
        payload: Sequence[str],
    ) -> SampleEstimator: ...
    def advance(self, log_time_ns: int) -> None: ...
    def push(self, samples: Mapping[str, Any]) -> None: ...
    def take(self) -> _Estimated: ...

def replay_log(
    log: LogReader,
    output: str | None,
    force: bool,
    config: str | None,
    vehicle: Vehicle | str | None,
    overrides: Sequence[str],
    sensors: Sensors | str | None,
    calibration: Calibration | str | None,
    payload: Sequence[str] | None,
    without: Sequence[str],
    with_inputs: Sequence[str],
    method: str | None,
    smooth: bool,
    verify: bool,
    compress: bool,
) -> tuple[str, _Estimated | None]: ...
def simulate_log(
    manoeuvre: str | None,
    truth: str | None,
    road: str | None,
    output: str,
    force: bool,
    vehicle: Vehicle | str,
    sensors: Sensors | str,
    payload: Sequence[str],
    seed: int,
    options: str | None,
    duration_s: float | None,
    config: str | None,
    true_calibration: str | None,
) -> tuple[float, str, int, int]: ...
def manoeuvres() -> list[str]: ...
def rainflow(
    load: _Doubles,
) -> tuple[_Doubles, tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]: ...
def run_program(arguments: Sequence[str]) -> int: ...
def _restore(
    cls: type[Any], method: str, arguments: tuple[Any, ...], named: dict[str, Any]
) -> Any: ...
@final
class StrainChannel:
    @staticmethod
    def of(sensors: Sensors, kind: Literal["axial", "bending"]) -> StrainChannel: ...
    @staticmethod
    def axial(sensors: str = "thesis-10bit") -> StrainChannel: ...
    @staticmethod
    def bending(sensors: str = "full-bridge-16bit-bending") -> StrainChannel: ...
    @staticmethod
    def load_axial(path: str | os.PathLike[str]) -> StrainChannel: ...
    @staticmethod
    def load_bending(path: str | os.PathLike[str]) -> StrainChannel: ...
    @staticmethod
    def builtin_names() -> list[str]: ...
    @property
    def load_per_count(self) -> float: ...
    @property
    def range(self) -> tuple[float, float]: ...
    def counts(self, load: npt.ArrayLike) -> _Doubles: ...
    def load(self, counts: npt.ArrayLike) -> _Doubles: ...

def road_height_m(
    road_class: Literal["A", "B", "C", "D", "E", "F", "G", "H"],
    position_m: npt.ArrayLike,
    *,
    seed: int = 0,
    sines: int = 400,
) -> _Doubles: ...
def ackermann_rad(
    mean_rad: float, wheelbase_m: float, track_m: float
) -> tuple[float, float]: ...
def amplifier_gain(
    gain_resistor_ohm: float, *, base_gain: float = 5.0, gain_ohm: float = 80_000.0
) -> float: ...
def strain_circuits() -> list[dict[str, Any]]: ...

@final
class Drive:
    def __new__(
        cls,
        dt_s: float,
        *,
        speed_m_s: npt.ArrayLike | None = None,
        sideslip_rad: npt.ArrayLike | None = None,
        yaw_rate_rad_s: npt.ArrayLike | None = None,
        lateral_m_s2: npt.ArrayLike | None = None,
        longitudinal_m_s2: npt.ArrayLike | None = None,
        steer_rad: npt.ArrayLike | None = None,
        roll_rad: npt.ArrayLike | None = None,
        pitch_rad: npt.ArrayLike | None = None,
        load_n: npt.ArrayLike | None = None,
    ) -> Drive: ...
    @property
    def dt_s(self) -> float: ...
    def __len__(self) -> int: ...

def identify_cornering(
    drive: Drive, vehicle: Vehicle, *, lateral_max_m_s2: float = 2.5, seed: int = 1
) -> Findings: ...
def identify_understeer(drive: Drive, vehicle: Vehicle, *, seed: int = 1) -> Findings: ...
def identify_roll_pitch(drive: Drive, vehicle: Vehicle, *, seed: int = 1) -> Findings: ...
def identify_step_response(drive: Drive, *, step_min_rad: float = 0.02) -> Findings: ...
def identify_frequency_response(
    drive: Drive, *, window_s: float = 10.0, seed: int = 1
) -> Findings: ...
def identify_tyre(
    kind: Literal[
        "linear", "fiala", "exponential", "dugoff", "magic-formula-89", "magic-formula-52", "rational"
    ],
    load_n: npt.ArrayLike,
    slip_angle_rad: npt.ArrayLike,
    lateral_n: npt.ArrayLike,
    *,
    dt_s: float,
    reference_load_n: float,
    load_exponent: float = 1.0,
    friction: float = 0.9,
    seed: int = 1,
) -> Findings: ...
def identify_friction(
    load_n: npt.ArrayLike,
    slip_angle_rad: npt.ArrayLike,
    lateral_n: npt.ArrayLike,
    *,
    dt_s: float,
    reference_load_n: float,
    load_exponent: float = 1.0,
    seed: int = 1,
) -> Findings: ...
def identify_yaw_inertia(
    moment_n_m: npt.ArrayLike, yaw_rate_rad_s: npt.ArrayLike, *, dt_s: float, seed: int = 1
) -> Findings: ...
def identify_roll_centre(vehicle: Vehicle) -> Findings: ...
def identify_pendulum(
    rate_rad_s: npt.ArrayLike,
    *,
    dt_s: float,
    mass_kg: float | None = None,
    distance_m: float | None = None,
    radius_m: float | None = None,
    length_m: float | None = None,
    stiffness_n_m_rad: float | None = None,
    fixture_kg_m2: float = 0.0,
    seed: int = 1,
) -> Findings: ...
def calibrate_rest(
    time_s: npt.ArrayLike, value: npt.ArrayLike, *, low: float = ..., high: float = ...
) -> Rest: ...
def calibrate_steer(
    steering_wheel_rad: npt.ArrayLike, wheels_rad: npt.ArrayLike, *, plate_sigma_rad: float
) -> Calibrated: ...
def calibrate_weight(
    vehicle: Vehicle,
    load_n: npt.ArrayLike,
    compression_m: npt.ArrayLike,
    *,
    known_calibration: Mapping[str, Any] | None = None,
) -> Calibrated: ...
def calibrate_zero(
    vehicle: Vehicle,
    sensors: Sensors,
    hanging: Counts,
    standing: Counts | None = None,
    *,
    specific_force_m_s2: Sequence[float] = ...,
    steering_wheel_rad: Sequence[float] = ...,
    weight_sigma: float = 0.0,
    known_calibration: Mapping[str, Any] | None = None,
) -> Zeros: ...
def calibrate_load_rig(
    vehicle: Vehicle,
    sensors: Sensors,
    wheel: Sequence[str],
    force_n: npt.ArrayLike,
    compression_m: npt.ArrayLike,
    counts: npt.ArrayLike,
    counts_sigma: npt.ArrayLike,
    *,
    steering_wheel_rad: npt.ArrayLike | None = None,
    at_m: npt.ArrayLike | None = None,
    known_calibration: Mapping[str, Any] | None = None,
) -> LoadRig: ...
def calibrate_member(
    vehicle: Vehicle,
    sensors: Sensors,
    wheel: str,
    channel: str,
    load_n: npt.ArrayLike,
    *,
    axial_counts: npt.ArrayLike | None = None,
    moment_n_m: npt.ArrayLike | None = None,
    bending_counts: npt.ArrayLike | None = None,
    temperature_c: npt.ArrayLike | None = None,
    load_sigma: float = 0.002,
    known_calibration: Mapping[str, Any] | None = None,
) -> Calibrated: ...
def calibrate_imu(
    vehicle: Vehicle, logs: Sequence[InertialLog], *, imu_m: Sequence[float] = ...
) -> Calibrated: ...
def calibrate_hub(
    vehicle: Vehicle,
    sensors: Sensors,
    logs: Sequence[HubLog],
    *,
    imu_m: Sequence[float] | None = None,
) -> Calibrated: ...
def calibrate_gnss(
    sensors: Sensors,
    imu: Inertial,
    velocity_time_s: npt.ArrayLike,
    velocity_m_s: npt.ArrayLike,
    attitude_time_s: npt.ArrayLike,
    attitude_rad: npt.ArrayLike,
    *,
    antenna_m: Sequence[float] | None = None,
    imu_m: Sequence[float] | None = None,
) -> Antennas: ...
def calibrate_wheel_radius(
    velocity_time_s: npt.ArrayLike,
    velocity_m_s: npt.ArrayLike,
    imu: Inertial,
    wheel_time_s: npt.ArrayLike,
    wheel_rad_s: npt.ArrayLike,
    *,
    latency_s: float = 0.0,
) -> Findings: ...
