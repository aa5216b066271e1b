"""The 50 ft right turn: figures 4.8 to 4.11 and 4.16."""

from __future__ import annotations

from typing import Any

import numpy as np
from drawing import C, WHEEL_NAMES, WHEELS, panels, plot, shared_legend, wheels
from drives import FITTED, Drive, Drives, error_percent, in_baseline, rms
from entry import Made, at_least, at_most, figure, within

import atvrec

RADIUS_M = 15.24
# Truth: the load of a wheel in the air, as a part of its static load.
LIFTED = 0.02
STATIC_N = {"fl": 1327.0, "fr": 1327.0, "rl": 1831.0, "rr": 1831.0}
SETUP = (
    "Motion of an independent multibody simulator: right turn of 15.24 m, 3.5 m/s rising by 0.12 m/s²; sensors of the thesis. Its tyres are not those of "
    "the model."
)


def smoothed(values: Any, samples: int = 100) -> Any:
    """Moving mean of a second."""
    padded = np.pad(values, (samples // 2, samples - samples // 2 - 1), mode="edge")
    return np.convolve(padded, np.ones(samples) / samples, "valid")


def total_error(drive: Drive, axis: str, true_of: Drive, from_s: float = 8.0) -> str:
    """Errors of the estimate for each wheel, percent of the larger of peak and static load, as text."""
    return ", ".join(f"{wheel_error(drive, wheel, axis, true_of, from_s):.1f}" for wheel in WHEELS)


def wheel_error(drive: Drive, wheel: str, axis: str, true_of: Drive, from_s: float = 8.0) -> float:
    t = drive.time_s("/estimate/contact_forces")
    late = t > from_s
    found = drive.force(wheel, axis, "estimate")[late]
    return error_percent(found, true_of.force(wheel, axis, "truth", t)[late], STATIC_N[wheel])


@figure(
    "4.8",
    "Steer angle and speed, 50 ft right turn",
    "A driver follows a circle of 50 ft clockwise at rising speed.",
    "Positive is right in the thesis and left here.",
)
def steer_and_speed(drives: Drives) -> Made:
    drive = drives.circle
    motion = drive.topic("/estimate/motion")
    t = motion["t_s"]
    steer = np.degrees(0.5 * (motion["fl.steer_rad"] + motion["fr.steer_rad"]))
    speed = np.hypot(motion["velocity_x_m_s"], motion["velocity_y_m_s"])
    drawn, (angles, speeds) = panels(2, 1, 3.4, sharex=True)
    plot(angles, t, steer, "measured")
    angles.set(ylabel="mean steer angle (°)")
    plot(speeds, t, speed, "measured")
    speeds.set(ylabel="speed (m/s)", xlabel="time (s)")
    used = (t > 5.0) & (t < 50.0)
    radius = np.median(-speed[used] / motion["yaw_rate_rad_s"][used])
    true_speed = drive.column("/truth/motion", "velocity_x_m_s", t)
    return Made(
        figure=drawn,
        seen=SETUP,
        checks=[
            within("radius of the path to the right", radius, 0.97 * RADIUS_M, 1.03 * RADIUS_M, "m"),
            at_most("steer angle, mean", np.mean(steer[used]), -4.0, "°"),
            at_least("speed gained", speed[-50:].mean() - speed[50:100].mean(), 5.0, "m/s"),
        ],
        today=f"Speed from GNSS and inertial unit, error {rms(motion['velocity_x_m_s'] - true_speed):.3f} m/s; steer angle from the encoder of the steering wheel "
        "through the calibrated steering maps of both wheels.",
    )


def gauge_forces(
    drives: Drives, drive: Drive, fitted: Any = FITTED
) -> tuple[Any, dict[str, Any], dict[str, Any]]:
    """Times, link forces and lateral forces of the wheels as the thesis takes them from its gauges, N."""
    channel = atvrec.StrainChannel.of(drives.thesis_sensors, "axial")
    time_s, members = drives.member_forces(drive, channel, fitted)
    return time_s, members, drives.lateral_n(members)


def change(drive: Drive, wheel: str, at_s: Any, of: str = "model") -> Any:
    """Lateral force less that of `BASELINE_S`, N, as the gauges' baseline is taken off."""
    values = drive.force(wheel, "y", of, at_s)
    return values - values[in_baseline(at_s)].mean()


def notes_of(drives: Drives) -> tuple[int, int]:
    """How many channels `calibrate zero` names as wired for bending, and as dead."""
    notes = drives.miswired_zeros[1]["notes"]
    return sum("reads bending" in note for note in notes), sum(
        "is dead: the converter" in note for note in notes
    )


@figure(
    "4.9",
    "Lateral force by the gauges, 50 ft turn",
    "The forces of the gauges follow the trend of the model and of the lateral acceleration, and are larger. The thesis explains "
    "this by the vertical force that the gauges feel too.",
    "Section 5.2.1 finds the cause: 12 of 16 bridges were wired for bending and read the vertical load. With the gauges in adjacent arms, axial strain "
    "cancels.",
)
def lateral_by_gauges(drives: Drives) -> Made:
    drive = drives.circle_miswired
    t, _, measured = gauge_forces(drives, drive)
    drawn, axes = wheels(ylabel="lateral force (N)", sharey=True)
    ratios = {}
    for wheel in WHEELS:
        model = change(drives.circle, wheel, t)
        plot(axes[wheel], t, measured[wheel] / 10.0, "measured", "gauges ÷ 10")
        plot(axes[wheel], t, model, "expected", "model")
        plot(axes[wheel], t, change(drive, wheel, t, "truth"), "truth", "truth", linestyle="--")
        used = (t > 5.0) & (t < 50.0)
        ratios[wheel] = rms(measured[wheel][used]) / rms(model[used])
    shared_legend(drawn, axes["fl"])
    bending, dead = notes_of(drives)
    after = drives.circle_calibrated
    return Made(
        figure=drawn,
        seen=f"{SETUP} Front upper arms and rear tie rods without a gauge, 12 half bridges wired for bending, gain resistors of 350 Ω. The bending is that at 0.10 m from the ball "
        "joint; where the gauges sit sets its size. All curves are changes since the begin.",
        checks=[
            *(
                at_least(f"{WHEEL_NAMES[w]}: gauges over model (root mean squares)", ratios[w], 1.5)
                for w in WHEELS
            ),
            within("lower bridges that calibrate zero names as wired for bending", bending, 8, 8),
            within("channels that it names as dead", dead, 6, 6),
            at_most(
                "estimate after this calibration: error of F_y, outer front wheel",
                wheel_error(after, "fl", "y", drive),
                15.0,
                "%",
            ),
            at_most(
                "the same: error of F_z, worst wheel",
                max(wheel_error(after, w, "z", drive) for w in WHEELS),
                6.0,
                "%",
            ),
        ],
        today=f"Hung on stands first, <code>calibrate zero</code> names {bending} bridges of lower arms as wired for bending and {dead} channels as dead, and takes them out; the four "
        "rear upper bridges that read nothing pass. With what is left (the front tie rods, springs, inertial unit, GNSS) the errors of F_y on this drive are "
        f"{total_error(after, 'y', drive)} %, those of F_z {total_error(after, 'z', drive)} % (front left, front right, rear left, rear right). F_x is then unknown. "
        f"With all gauges right: F_y {total_error(drives.circle, 'y', drive)} %. Without that calibration this wiring misleads the estimator: F_z {total_error(drive, 'z', drive)} %.",
    )


@figure(
    "4.10",
    "Sum of the gauges of each wheel, 50 ft turn",
    "All force goes through the links, so that the sum of the gauges of a wheel should be its force. The trend is right, the size differs much: the front upper arms "
    "did not respond, one rear link had no gauge, and some bridges had the wrong sign.",
    "Wiring as in figure 4.9. Without the strut and the missing links the sum is not the lateral force even with the right wiring.",
)
def combined(drives: Drives) -> Made:
    wrong, right = drives.circle_miswired, drives.circle
    t, members, _ = gauge_forces(drives, wrong)
    every = {wheel: atvrec.Corner.MEMBERS[:5] for wheel in WHEELS}
    axial = atvrec.StrainChannel.axial()
    at, good = drives.member_forces(right, axial, FITTED)
    complete = drives.lateral_n(drives.member_forces(right, axial, every)[1])
    drawn, axes = wheels(ylabel="force (N)", sharey=True)
    misses, signs = {}, {}
    used = (t > 5.0) & (t < 50.0)
    for wheel in WHEELS:
        plot(axes[wheel], t, members[wheel].sum(axis=1) / 10.0, "measured", "sum, wrong wiring ÷ 10")
        plot(axes[wheel], at, good[wheel].sum(axis=1), "estimate", "sum, right wiring")
        model = change(right, wheel, t)
        plot(axes[wheel], t, model, "expected", "model")
        misses[wheel] = rms(members[wheel].sum(axis=1)[used] - model[used]) / rms(model[used])
        signs[wheel] = np.corrcoef(members[wheel].sum(axis=1)[used], members["fl"].sum(axis=1)[used])[0, 1]
    shared_legend(drawn, axes["fl"], 2)
    inside = (at > 5.0) & (at < 50.0)
    outer = error_percent(complete["fl"][inside], change(right, "fl", at, "truth")[inside])
    return Made(
        figure=drawn,
        seen="Axial forces of all gauges of a wheel added, as the thesis does. Changes since the begin.",
        checks=[
            at_least(
                "wrong wiring: difference from the model over the model, least of the wheels",
                min(misses.values()),
                1.0,
            ),
            at_most(
                "wrong wiring: correlation of the inner with the outer front wheel (opposite signs)",
                signs["fr"],
                -0.3,
            ),
            at_most(
                "all five links and the statics of the corner, front left: error of F_y", outer, 15.0, "%"
            ),
            at_most(
                "method of the thesis: largest error of F_y",
                max(wheel_error(drives.circle_statics, w, "y", right) for w in WHEELS),
                8.0,
                "%",
            ),
            at_most(
                "force filter: largest error of F_y",
                max(wheel_error(right, w, "y", right) for w in WHEELS),
                2.0,
                "%",
            ),
        ],
        today='<code>method = "thesis"</code> solves the statics of each corner with all links and the strut: errors of F_y '
        f"{total_error(drives.circle_statics, 'y', right)} %. The force filter: {total_error(right, 'y', right)} %.",
    )


@figure(
    "4.11",
    "Vertical force by the deflection, 50 ft turn",
    "The vertical forces of the springs follow the model. The right wheels lose load as the vehicle rolls to the left; the front right wheel comes to zero and lifts, the "
    "rear right wheel does not, because more weight is at the rear.",
    "2.13 and 2.14: mass for each axle, roll stiffness for each axle, unsprung masses. The force of the spring alone reads too high in a turn, because inclined arms jack.",
)
def vertical(drives: Drives) -> Made:
    drive, springs = drives.circle, drives.circle_springs
    t = springs.time_s("/estimate/contact_forces")
    drawn, axes = wheels(ylabel="vertical force (N)", sharey=True)
    measured = {}
    for wheel in WHEELS:
        measured[wheel] = springs.force(wheel, "z", "estimate")
        plot(axes[wheel], t, measured[wheel], "measured", "by deflection")
        plot(axes[wheel], t, drive.force(wheel, "z", "model", t), "expected", "model")
        plot(axes[wheel], t, drive.force(wheel, "z", "truth", t), "truth", "truth", linestyle="--")
    shared_legend(drawn, axes["fl"])
    known = {w: np.nan_to_num(measured[w], nan=STATIC_N[w]) for w in WHEELS}
    low = {w: first_below(t, known[w], 0.1 * STATIC_N[w]) for w in WHEELS}
    true_low = {w: first_below(t, drive.force(w, "z", "truth", t), LIFTED * STATIC_N[w]) for w in WHEELS}
    at_lift = np.searchsorted(t, true_low["fr"])
    event_s = drive.event_s("FR", "off the ground")
    others = min(low[w] for w in WHEELS if w != "fr")
    return Made(
        figure=drawn,
        seen=f"{SETUP} Force of the strut from its potentiometer, through the lever of the hard-points and the model's lateral force (<code>replay --method thesis --without strain</code>).",
        checks=[
            within(
                "first time below 10 % of the static load by the spring, front right",
                low["fr"],
                40.0,
                54.0,
                "s",
            ),
            at_least("time until another wheel comes so low (99 s: none does)", others - low["fr"], 2.0, "s"),
            at_least(
                "rear right, as the front right lifts: load over static load",
                known["rr"][at_lift] / STATIC_N["rr"],
                0.3,
            ),
            at_most(
                "front left and right: error of the force by deflection",
                max(wheel_error(springs, w, "z", drive) for w in ("fl", "fr")),
                12.0,
                "%",
            ),
            at_most(
                "event “the FR wheel is off the ground”: time from the true lift",
                abs(event_s - true_low["fr"]),
                1.0,
                "s",
            ),
            within(
                "wheels that the estimator reports as lifted besides FR",
                sum("off the ground" in text and "FR" not in text for _, text in drive.events()),
                0,
                0,
            ),
        ],
        today=f"The estimator reports the lift at {event_s:.1f} s; the true load falls below 2 % of the static load at {true_low['fr']:.1f} s. Its errors of F_z are {total_error(drive, 'z', drive)} % "
        "(front left, front right, rear left, rear right).",
    )


def first_below(t: Any, values: Any, limit: float) -> float:
    """First instant after 5 s from which a value is below a limit; 99 where it never is."""
    below = (values < limit) & (t > 5.0)
    return float(t[np.argmax(below)]) if below.any() else 99.0


@figure(
    "4.16",
    "Tie rods and the force of the whole vehicle, 50 ft turn",
    "The force in the tie rod of the inner wheel decreases while that of the outer one and the force of the whole vehicle increase. The gauges show this before the wheel lifts. The strain had "
    "to be scaled to the total force.",
    "A quarter bridge reads axial force and bending; a tie rod with ball joints carries no bending, so that it may have one.",
)
def tie_rods(drives: Drives) -> Made:
    drive = drives.circle
    t, counts = drive.strain()
    newtons = atvrec.StrainChannel.axial().load_per_count
    rods = {w: smoothed(newtons * (counts[w][:, 4] - 512.0)) for w in ("fl", "fr")}
    total = 644.0 * drive.column("/estimate/motion", "acceleration_m_s2.y", t)
    drawn, (above, below) = panels(2, 1, 4.2, sharex=True)
    for wheel in ("fl", "fr"):
        plot(above, t, rods[wheel], wheel, f"{WHEEL_NAMES[wheel]} tie rod")
    true_lift = first_below(t, drive.force("fr", "z", "truth", t), LIFTED * STATIC_N["fr"])
    for axes in (above, below):
        axes.axvline(true_lift, color=C["soft"], linestyle="--", linewidth=1)
    above.set(ylabel="tension, mean of 1 s (N)")
    above.legend(loc="lower left")
    plot(below, t, smoothed(total), "ink", "mass times lateral acceleration")
    below.set(ylabel="force (N)", xlabel="time (s)")
    below.legend(loc="lower left")
    used = (t > 30.0) & (t < 50.0)
    slope = {w: np.polyfit(t[used], np.abs(rods[w][used]), 1)[0] for w in rods}
    peak_at = int(np.argmax(np.where(t < 45.0, rods["fr"], -np.inf)))
    fallen = (t > t[peak_at]) & (rods["fr"] < 0.7 * rods["fr"][peak_at])
    seen_s = float(t[np.argmax(fallen)])
    warning = drive.event_s("FR", "vanish")
    return Made(
        figure=drawn,
        seen="Dashed: the front right wheel leaves the ground.",
        checks=[
            at_most("inner tie rod, 30 to 50 s: change of its amount", slope["fr"], -3.0, "N/s"),
            at_least("outer tie rod, 30 to 50 s: change of its amount", slope["fl"], 5.0, "N/s"),
            at_least(
                "mass times lateral acceleration, 30 to 50 s: growth",
                abs(np.polyfit(t[used], total[used], 1)[0]),
                40.0,
                "N/s",
            ),
            at_least(
                "inner tie rod below 70 % of its peak, time before the lift", true_lift - seen_s, 3.0, "s"
            ),
            at_least("warning of the estimator before the lift", true_lift - warning, 0.5, "s"),
        ],
        today=f"The estimator warns {true_lift - warning:.1f} s before the wheel lifts (event: the load would vanish), from loads of all wheels and not from a scaled trend.",
    )
