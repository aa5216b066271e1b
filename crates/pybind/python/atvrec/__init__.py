"""Estimator, vehicle dynamics and logs of atvrec, the recorder that estimates tyre forces.

- :func:`open` reads logs into NumPy arrays, and into tables of pandas, polars, pyarrow and xarray
- :func:`simulate` makes the log of a virtual vehicle, :func:`replay` estimates a log again
- :class:`Estimator` estimates motion and tyre forces from samples, :func:`samples` reads them from a
  log
- :func:`score` judges a log's estimates by its truth, :func:`compare` by another log's,
  :func:`innovations` by its own measurements
- :class:`Vehicle` reads vehicle files
- :class:`Bicycle` the linear vehicle model
- :class:`FourWheel` the non-linear vehicle model, one run or thousands at once
- :class:`FourteenDof` the same with wheels that lift
- :class:`Tyre`, :class:`SpringTyre`, :class:`Steering`, :class:`Ride`, :class:`Corner`,
  :class:`StrainChannel` its parts
- :class:`Sensors` and :class:`Calibration` read sensors and calibration files, :class:`Tuning` has
  the tuned numbers of the estimator
- :mod:`atvrec.identify` finds parameters in drives, :mod:`atvrec.calibrate` calibrates sensors
- :mod:`atvrec.fleet` processes many drives on many machines, :mod:`atvrec.trend` finds parameters that
  changed; import them by their names

Axes are ISO 8855: x forward, y left, z up. Wheels stand in the order front left, front right, rear
left, rear right. Every name ends with its unit; angles are radians.
"""

from atvrec import calibrate, identify
from atvrec._atvrec import (
    ArgumentError,
    AtvrecError,
    Bicycle,
    Calibration,
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
    Tuning,
    Tyre,
    Vehicle,
    VehicleError,
    __version__,
    ackermann_rad,
    amplifier_gain,
    road_height_m,
    strain_circuits,
)
from atvrec.estimation import (
    Estimated,
    Estimates,
    Estimator,
    Event,
    Parameters,
    Samples,
    samples,
)
from atvrec.log import Log, open
from atvrec.replaying import Replayed, Simulated, manoeuvres, replay, simulate
from atvrec.scoring import (
    Comparison,
    Innovations,
    Score,
    ScoreWithMethods,
    compare,
    innovations,
    score,
)

__all__ = [
    "ArgumentError",
    "AtvrecError",
    "Bicycle",
    "Calibration",
    "Comparison",
    "Corner",
    "DataError",
    "Estimated",
    "Estimates",
    "Estimator",
    "Event",
    "FourWheel",
    "FourteenDof",
    "Innovations",
    "Log",
    "LogError",
    "Parameters",
    "Replayed",
    "Ride",
    "Samples",
    "Score",
    "ScoreWithMethods",
    "Sensors",
    "Simulated",
    "SimulationError",
    "SpringTyre",
    "Steering",
    "StrainChannel",
    "Tuning",
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
    "manoeuvres",
    "open",
    "replay",
    "road_height_m",
    "samples",
    "score",
    "simulate",
    "strain_circuits",
]
