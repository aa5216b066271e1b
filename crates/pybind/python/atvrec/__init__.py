"""Vehicle dynamics and logs of atvrec, the recorder that estimates tyre forces.

- :func:`open` reads logs into NumPy arrays, pandas or polars frames
- :func:`score` judges a log's estimates by its truth, :func:`compare` by another log's,
  :func:`innovations` by its own measurements
- :class:`Vehicle` reads vehicle files
- :class:`Bicycle` the linear vehicle model
- :class:`FourWheel` the non-linear vehicle model, one run or thousands at once
- :class:`FourteenDof` the same with wheels that lift
- :class:`Tyre`, :class:`SpringTyre`, :class:`Steering`, :class:`Ride`, :class:`Corner`,
  :class:`StrainChannel` its parts
- :class:`Sensors` reads sensors files
- :mod:`atvrec.identify` finds parameters in drives, :mod:`atvrec.calibrate` calibrates sensors

Axes are ISO 8855: x forward, y left, z up. Wheels stand in the order front left, front right, rear
left, rear right. Every name ends with its unit; angles are radians.
"""

from atvrec import calibrate, identify
from atvrec._atvrec import (
    ArgumentError,
    AtvrecError,
    Bicycle,
    Corner,
    DataError,
    FourteenDof,
    FourWheel,
    LogError,
    Ride,
    Sensors,
    SimulationError,
    SpringTyre,
    Steering,
    StrainChannel,
    Tyre,
    Vehicle,
    VehicleError,
    __version__,
    ackermann_rad,
    amplifier_gain,
    road_height_m,
    strain_circuits,
)
from atvrec.log import Log, open
from atvrec.scoring import Comparison, Innovations, Score, compare, innovations, score

__all__ = [
    "ArgumentError",
    "AtvrecError",
    "Bicycle",
    "Comparison",
    "Corner",
    "DataError",
    "FourWheel",
    "FourteenDof",
    "Innovations",
    "Log",
    "LogError",
    "Ride",
    "Score",
    "Sensors",
    "SimulationError",
    "SpringTyre",
    "Steering",
    "StrainChannel",
    "Tyre",
    "Vehicle",
    "VehicleError",
    "__version__",
    "ackermann_rad",
    "amplifier_gain",
    "calibrate",
    "compare",
    "identify",
    "innovations",
    "open",
    "road_height_m",
    "score",
    "strain_circuits",
]
