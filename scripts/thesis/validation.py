"""The vehicle model against drives: figures 2.25 to 2.33."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from drawing import WHEELS, panels, plot, shared_legend, wheels
from drives import Drive, Drives, error_percent
from entry import Check, Made, at_least, at_most, figure, within

import atvrec

STEP_S = 0.0005
# The drive torque that holds the measured speed is set this often, s.
HOLD_S = 0.02
HOLD_N_M_PER_M_S = 300.0


@dataclass(frozen=True)
class Response:
    """What a four-wheel model does with the measured steer angles and the measured speed."""

    time_s: Any
    states: Any
    slip_rad: Any
    lateral_n: Any
    roll_arm_m: float

    def column(self, name: str) -> Any:
        """A state by the name that it has in a log; the lateral velocity is that of the centre of gravity,
        which swings as the body rolls."""
        states = atvrec.FourWheel.STATES
        if name == "sideslip_rad":
            return np.arctan2(self.column("velocity_y_m_s"), self.column("longitudinal_m_s"))
        if name == "velocity_y_m_s":
            return self.column("lateral_m_s") - self.roll_arm_m * self.column("roll_rate_rad_s")
        return self.states[:, states.index(name)]


def respond(vehicle: atvrec.Vehicle, drive: Drive, from_s: float = 0.5) -> Response:
    """The model on the steer angles and the speed that the sensors of a drive give."""
    model = atvrec.FourWheel(vehicle)
    motion = drive.topic("/estimate/motion")
    instants = np.arange(from_s, motion["t_s"][-1] - HOLD_S, HOLD_S)
    rows = round(HOLD_S / STEP_S)
    speed = np.interp(instants, motion["t_s"], np.hypot(motion["velocity_x_m_s"], motion["velocity_y_m_s"]))
    steer = [np.interp(instants, motion["t_s"], motion[f"{wheel}.steer_rad"]) for wheel in ("fl", "fr")]
    along = atvrec.FourWheel.STATES.index("longitudinal_m_s")
    state = model.rolling(float(speed[0]))
    states, inputs = [], []
    for index in range(instants.size):
        torque = HOLD_N_M_PER_M_S * (speed[index] - state[along])
        one = model.inputs(
            steer_rad=[steer[0][index], steer[1][index], 0.0, 0.0], drive_n_m=[0.0, 0.0, torque, torque]
        )
        states.append(state)
        inputs.append(one)
        state = model.step(state, one, STEP_S, rows)
    kept = np.array(states)
    found = model.outputs(kept, np.array(inputs))
    return Response(instants, kept, found["slip_angle_rad"], found["lateral_n"], vehicle.roll_arm_m)


def errors(response: Response, drive: Drive, motion: str) -> tuple[float, float]:
    """Errors of the model and of the estimate, percent of the peak of the truth."""
    late = response.time_s > 2.0
    true = drive.column("/truth/motion", motion, response.time_s)[late]
    found = drive.column("/estimate/motion", motion, response.time_s)[late]
    return error_percent(response.column(motion)[late], true), error_percent(found, true)


@functools.cache
def with_stiffness_of(drive: Drive, vehicle: atvrec.Vehicle) -> atvrec.Vehicle:
    """The vehicle with the cornering stiffness that `identify cornering` finds in a drive."""
    found = drive.log.identify("cornering")[0]["findings"]
    return vehicle.with_values(
        {
            f"{axle}.tyre.cornering_stiffness_n_rad": 0.5 * found[f"cornering_stiffness_{axle}"]["value"]
            for axle in ("front", "rear")
        }
    )


@functools.cache
def against_independent(drives: Drives) -> Response:
    return respond(with_stiffness_of(drives.sine, drives.prowler), drives.sine)


def beside_simulator(drives: Drives, motion: str, label: str, limit: float) -> Made:
    drive, response = drives.sine, against_independent(drives)
    drawn, axes = panels(height_in=2.6)
    t = drive.time_s("/truth/motion")
    plot(axes, t, np.degrees(drive.column("/truth/motion", motion)), "truth", "independent simulator")
    plot(axes, response.time_s, np.degrees(response.column(motion)), "expected", "model, four wheels")
    found_t = drive.time_s("/estimate/motion")
    plot(
        axes,
        found_t,
        np.degrees(drive.column("/estimate/motion", motion)),
        "estimate",
        "estimate",
        linestyle="--",
    )
    axes.set(xlabel="time (s)", ylabel=label)
    shared_legend(drawn, axes)
    model_error, found_error = errors(response, drive, motion)
    unit = "% of the peak"
    peak = np.degrees(np.abs(response.column(motion)).max())
    true_peak = np.degrees(np.abs(drive.column("/truth/motion", motion)).max())
    late = response.time_s > 2.0
    together = np.corrcoef(
        response.column(motion)[late], drive.column("/truth/motion", motion, response.time_s)[late]
    )[0, 1]
    return Made(
        figure=drawn,
        seen="Sine steer of 0.3 Hz at 8 m/s. The independent multibody simulator has tyres of its own, as CarSim had; the model has the cornering stiffness that <code>identify cornering</code> finds in this drive.",
        checks=[
            at_least("correlation of model and simulator", together, 0.9),
            at_most("error of the model", model_error, limit, unit),
            at_most("error of the estimate", found_error, 6.0, unit),
            within("peak of the model over that of the simulator (no spike)", peak / true_peak, 0.5, 1.6),
        ],
        today=f"The estimator has an error of {found_error:.1f} % of the peak, the model alone {model_error:.0f} %: the estimator measures the motion "
        "and needs the model between the measurements only.",
    )


@figure(
    "2.25",
    "Sideslip: model and independent simulator",
    "Under a sine steer at constant speed the model follows CarSim well. Its tyres are other ones, which explains the rest. "
    "There is a spike at low speed.",
    "2.8 is right for clockwise angles; in ISO 8855 sideslip is minus (course less heading). The velocity is first moved to the "
    "centre of gravity. 2.9 needs atan2.",
)
def sideslip(drives: Drives) -> Made:
    return beside_simulator(drives, "sideslip_rad", "sideslip (°)", 40.0)


@figure(
    "2.26",
    "Yaw rate: model and independent simulator",
    "The yaw rate of the model follows that of CarSim in phase and size.",
    "2.6 has F_yFL in the place of F_yRL; 2.7 has wrong signs and lever arms in the terms of F_x.",
)
def yaw_rate(drives: Drives) -> Made:
    return beside_simulator(drives, "yaw_rate_rad_s", "yaw rate (°/s)", 20.0)


# Begin of the second drive in the figures, s.
SECOND_S = 28.0


@functools.cache
def experiment(drives: Drives) -> tuple[tuple[Drive, float], ...]:
    """The two drives of figures 2.27 to 2.33 and where they begin in the figures."""
    return (drives.slow_sine, 0.0), (drives.fast_sine, SECOND_S)


@functools.cache
def improved(drives: Drives) -> atvrec.Vehicle:
    """The vehicle with the parameters that `identify` finds in the first drive."""
    roll = drives.slow_sine.log.identify("roll-pitch")[0]["findings"]
    return with_stiffness_of(drives.slow_sine, drives.prowler).with_values(
        {
            f"{axle}.roll_stiffness_n_m_rad": roll[f"roll_stiffness_{axle}"]["value"]
            for axle in ("front", "rear")
        }
    )


@functools.cache
def responses(drives: Drives, good: bool) -> tuple[Response, ...]:
    vehicle = improved(drives) if good else atvrec.Vehicle.builtin("prowler-table-2.3")
    return tuple(respond(vehicle, drive) for drive, _ in experiment(drives))


@figure(
    "2.27",
    "Inputs of the model",
    "Steer angle and speed of the validation run: sine steer of two frequencies at constant speed.",
)
def inputs(drives: Drives) -> Made:
    drawn, (steers, speeds) = panels(2, 1, 3.4, sharex=True, height_ratios=(2, 1))
    frequencies, spreads = [], []
    for drive, begin in experiment(drives):
        motion = drive.topic("/estimate/motion")
        steer = 0.5 * (motion["fl.steer_rad"] + motion["fr.steer_rad"])
        speed = np.hypot(motion["velocity_x_m_s"], motion["velocity_y_m_s"])
        plot(steers, motion["t_s"] + begin, np.degrees(steer), "measured")
        plot(speeds, motion["t_s"] + begin, speed, "measured")
        late = motion["t_s"] > 1.0
        spectrum = np.abs(np.fft.rfft(steer[late] - steer[late].mean(), 1 << 14))
        frequencies.append(np.fft.rfftfreq(1 << 14, 0.01)[np.argmax(spectrum)])
        spreads.append(100.0 * np.std(speed[late]) / np.mean(speed[late]))
    steers.set(ylabel="mean steer angle (°)")
    speeds.set(ylabel="speed (m/s)", xlabel="time (s)", ylim=(0, 10))
    drive = drives.slow_sine
    steer_error = error_percent(
        drive.column("/estimate/motion", "fl.steer_rad"),
        drive.column("/truth/motion", "fl.steer_rad", drive.time_s("/estimate/motion")),
    )
    return Made(
        figure=drawn,
        seen="Two drives of the virtual Prowler, one after the other.",
        checks=[
            within("frequency of the first part", frequencies[0], 0.27, 0.33, "Hz"),
            within("frequency of the second part", frequencies[1], 0.63, 0.77, "Hz"),
            at_most("standard deviation of the speed", max(spreads), 5.0, "%"),
        ],
        today=f"Encoder, steering map and GNSS give both inputs; the steer angle of the front left wheel has an error of {steer_error:.1f} % of its peak.",
    )


RATES = (("roll_rate_rad_s", "roll rate"), ("pitch_rate_rad_s", "pitch rate"), ("yaw_rate_rad_s", "yaw rate"))
LATERAL = (
    ("sideslip_rad", "sideslip"),
    ("yaw_rate_rad_s", "yaw rate"),
    ("velocity_y_m_s", "lateral velocity"),
)
LIMITS = {"roll_rate_rad_s": 30.0, "yaw_rate_rad_s": 12.0, "sideslip_rad": 16.0, "velocity_y_m_s": 15.0}


def pooled(drives: Drives, good: bool, motion: str) -> tuple[float, float]:
    """Larger error of both drives: of the model and of the estimate, percent of the peak."""
    found = [
        errors(response, drive, motion)
        for response, (drive, _) in zip(responses(drives, good), experiment(drives))
    ]
    return max(one[0] for one in found), max(one[1] for one in found)


def compared(drives: Drives, good: bool, rows: Any) -> Any:
    """A panel for each quantity: data and model."""
    drawn, axes = panels(len(rows), 1, 1.5 * len(rows) + 0.6, sharex=True)
    for one, (motion, name) in zip(axes, rows):
        linear = motion.endswith("_m_s")
        scale = 1.0 if linear else np.degrees(1.0)
        for response, (drive, begin) in zip(responses(drives, good), experiment(drives)):
            first = begin == 0.0
            plot(
                one,
                drive.time_s("/estimate/motion") + begin,
                scale * drive.column("/estimate/motion", motion),
                "measured",
                "measured" if first else None,
            )
            plot(
                one,
                response.time_s + begin,
                scale * response.column(motion),
                "expected",
                "model" if first else None,
            )
        unit = "m/s" if linear else "°/s" if "rate" in motion else "°"
        one.set_ylabel(f"{name} ({unit})")
    axes[-1].set_xlabel("time (s)")
    shared_legend(drawn, axes[0])
    return drawn


def verdict(drives: Drives, good: bool, rows: Any) -> list[Check]:
    checks = []
    for motion, name in rows:
        if motion == "pitch_rate_rad_s":
            continue
        bad_error, good_error = pooled(drives, False, motion)[0], pooled(drives, True, motion)[0]
        if good:
            checks.append(at_most(f"{name}: error of the model", good_error, LIMITS[motion], "% of the peak"))
        else:
            checks.append(
                at_least(
                    f"{name}: error with wrong parameters over that with identified ones",
                    bad_error / good_error,
                    1.3,
                )
            )
    return checks


def words(drives: Drives, good: bool, rows: Any) -> str:
    """Errors of the estimate and of the model, larger of both drives."""
    found = [(name, *pooled(drives, good, motion)) for motion, name in rows if motion != "pitch_rate_rad_s"]
    return (
        "Errors of the estimate, percent of the peak: "
        + ", ".join(f"{name} {estimate:.1f}" for name, _, estimate in found)
        + ". Those of this model: "
        + ", ".join(f"{name} {model:.0f}" for name, model, _ in found)
        + "."
    )


WRONG = "Parameters of tables 2.3 and 2.5 as printed: the inertia of the solid model, the roll stiffness of 2.30. Measured: the estimates."
RIGHT = "Warner's inertia; cornering and roll stiffness as <code>identify</code> finds them in the first drive. Measured: the estimates."


@figure(
    "2.28",
    "Angular rates, wrong parameters",
    "With the first parameters the model has the right trends and sizes, and distinct differences from the data.",
    "2.10 and 2.15: sprung mass, roll angle missing, inertia about the roll axis; longitudinal load transfer is missing everywhere.",
)
def wrong_rates(drives: Drives) -> Made:
    return Made(
        figure=compared(drives, False, RATES),
        seen=WRONG,
        checks=verdict(drives, False, RATES),
        today=words(drives, False, RATES),
    )


@figure(
    "2.29",
    "Sideslip, yaw rate and lateral velocity, wrong parameters",
    "The same run: the model differs from the data, most where the steering is fast.",
)
def wrong_lateral(drives: Drives) -> Made:
    return Made(
        figure=compared(drives, False, LATERAL),
        seen=WRONG,
        checks=verdict(drives, False, LATERAL),
        today=words(drives, False, LATERAL),
    )


def slips(drives: Drives, good: bool) -> tuple[Any, float, float]:
    """The drawing, and the largest error of model and estimate over the wheels, percent of the peak."""
    drawn, axes = wheels(ylabel="slip angle (°)", sharey=True)
    worst = [0.0, 0.0]
    for response, (drive, begin) in zip(responses(drives, good), experiment(drives)):
        late = response.time_s > 2.0
        for index, wheel in enumerate(WHEELS):
            name = f"{wheel}.slip_angle_rad"
            true = drive.column("/truth/motion", name, response.time_s)[late]
            found = drive.column("/estimate/motion", name, response.time_s)[late]
            worst[0] = max(worst[0], error_percent(response.slip_rad[late, index], true))
            worst[1] = max(worst[1], error_percent(found, true))
            first = begin == 0.0
            plot(
                axes[wheel],
                drive.time_s("/estimate/motion") + begin,
                np.degrees(drive.column("/estimate/motion", name)),
                "measured",
                "measured" if first else None,
            )
            plot(
                axes[wheel],
                response.time_s + begin,
                np.degrees(response.slip_rad[:, index]),
                "expected",
                "model" if first else None,
            )
    shared_legend(drawn, axes["fl"])
    return drawn, worst[0], worst[1]


@figure(
    "2.30",
    "Slip angles, wrong parameters",
    "The slip angles of the wheels differ from the data in the same way.",
    "2.9 with atan2; the slip angles of the thesis have the opposite sign.",
)
def wrong_slips(drives: Drives) -> Made:
    drawn, bad, found = slips(drives, False)
    _, good, _ = slips(drives, True)
    return Made(
        figure=drawn,
        seen=WRONG,
        checks=[at_least("largest error of the model over that with identified parameters", bad / good, 1.3)],
        today=f"Largest error of the estimated slip angles: {found:.1f} % of the peak, of the model {bad:.0f} %.",
    )


@figure(
    "2.31",
    "Angular rates, identified parameters",
    "With improved parameters the model fits the data well to the eye; the assumption of a constant cornering stiffness "
    "leaves errors.",
)
def right_rates(drives: Drives) -> Made:
    return Made(
        figure=compared(drives, True, RATES),
        seen=RIGHT,
        checks=verdict(drives, True, RATES),
        today=words(drives, True, RATES),
    )


@figure(
    "2.32",
    "Sideslip, yaw rate and lateral velocity, identified parameters",
    "The same for the lateral motion.",
)
def right_lateral(drives: Drives) -> Made:
    return Made(
        figure=compared(drives, True, LATERAL),
        seen=RIGHT,
        checks=verdict(drives, True, LATERAL),
        today=words(drives, True, LATERAL),
    )


@figure(
    "2.33",
    "Slip angles, identified parameters",
    "The same for the slip angles of the wheels.",
)
def right_slips(drives: Drives) -> Made:
    drawn, good, found = slips(drives, True)
    return Made(
        figure=drawn,
        seen=RIGHT,
        checks=[
            at_most("largest error of the model", good, 12.0, "% of the peak"),
            at_most("largest error of the estimate", found, 20.0, "% of the peak"),
        ],
        today=f"Largest error of the estimated slip angles: {found:.1f} % of the peak, of the model {good:.0f} %. The estimate is "
        "the angle of the wheel centre, the true angle that of the tyre, which follows it after 0.25 m of way.",
    )
