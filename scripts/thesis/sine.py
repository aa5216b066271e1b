"""Sine steer and the change from asphalt to gravel: figures 4.12 to 4.15 and 4.17."""

from __future__ import annotations

from typing import Any

import numpy as np
from drawing import C, WHEEL_NAMES, WHEELS, panels, plot, shared_legend, wheels
from drives import FITTED, Drive, Drives, error_percent, rms
from entry import Made, at_least, at_most, figure, within
from turn import STATIC_N, change, gauge_forces, smoothed, total_error, wheel_error
from validation import respond, with_stiffness_of

import atvrec

SETUP = "Motion of an independent multibody simulator: sine steer of 0.3 Hz at 8 m/s; sensors of the thesis."
GRAVEL_S = 12.0


@figure(
    "4.12",
    "Steer angle and speed, sine steer",
    "A driver steers about a sine at about constant speed.",
)
def steer_and_speed(drives: Drives) -> Made:
    drive = drives.sine
    motion = drive.topic("/estimate/motion")
    t = motion["t_s"]
    steer = 0.5 * (motion["fl.steer_rad"] + motion["fr.steer_rad"])
    speed = np.hypot(motion["velocity_x_m_s"], motion["velocity_y_m_s"])
    drawn, (angles, speeds) = panels(2, 1, 3.2, sharex=True, height_ratios=(2, 1))
    plot(angles, t, np.degrees(steer), "measured")
    angles.set(ylabel="mean steer angle (°)")
    plot(speeds, t, speed, "measured")
    speeds.set(ylabel="speed (m/s)", xlabel="time (s)", ylim=(0, 10))
    spectrum = np.abs(np.fft.rfft(steer - steer.mean(), 1 << 14))
    true = drive.column("/truth/motion", "velocity_x_m_s", t)
    return Made(
        figure=drawn,
        seen=SETUP,
        checks=[
            within("frequency", np.fft.rfftfreq(1 << 14, 0.01)[np.argmax(spectrum)], 0.27, 0.33, "Hz"),
            at_most("standard deviation of the speed", 100 * np.std(speed[100:]) / np.mean(speed), 2.0, "%"),
        ],
        today=f"Error of the estimated speed {rms(motion['velocity_x_m_s'][100:] - true[100:]):.3f} m/s (root mean square).",
    )


def axial_lateral(drives: Drives, drive: Drive) -> tuple[Any, dict[str, Any]]:
    """Times and lateral forces, N, of the fitted gauges with the right wiring."""
    t, members = drives.member_forces(drive, atvrec.StrainChannel.axial(), FITTED)
    return t, drives.lateral_n(members)


@figure(
    "4.13",
    "Lateral force by the gauges, sine steer",
    "The gauges show the dynamic forces; size and trend are those of the lateral acceleration and the model. Errors of sign by the wiring were corrected afterwards.",
    "See figure 4.9: with bridges that read bending the sum has the opposite sign and many times the size.",
)
def lateral_by_gauges(drives: Drives) -> Made:
    wrong, right = drives.sine_miswired, drives.sine
    t, _, bending = gauge_forces(drives, wrong)
    at, axial = axial_lateral(drives, right)
    force = lambda time_s: 644.0 * right.column("/estimate/motion", "acceleration_m_s2.y", time_s)
    drawn, axes = panels(height_in=3.0)
    total_wrong, total_right = sum(bending.values()), sum(axial.values())
    plot(axes, t, total_wrong / 20.0, "measured", "all gauges, wrong wiring ÷ 20")
    plot(axes, at, smoothed(total_right, 10), "estimate", "all gauges, right wiring")
    plot(axes, at, smoothed(force(at), 10), "expected", "mass times lateral acceleration")
    axes.set(xlabel="time (s)", ylabel="lateral force (N)")
    shared_legend(drawn, axes, 1)
    used, inside = t > 2.0, at > 2.0
    return Made(
        figure=drawn,
        seen=f"{SETUP} Forces of all four wheels added; channels as in the thesis.",
        checks=[
            at_least(
                "right wiring: correlation with mass times acceleration",
                np.corrcoef(total_right[inside], force(at)[inside])[0, 1],
                0.85,
            ),
            at_most(
                "wrong wiring: correlation (opposite sign)",
                np.corrcoef(total_wrong[used], force(t)[used])[0, 1],
                -0.85,
            ),
            within(
                "right wiring: size over mass times acceleration",
                rms(total_right[inside]) / rms(force(at)[inside]),
                0.5,
                2.0,
            ),
            at_least(
                "wrong wiring: size over mass times acceleration",
                rms(total_wrong[used]) / rms(force(t)[used]),
                5.0,
            ),
        ],
        today=f"Errors of the estimated F_y of the wheels: {total_error(right, 'y', right, 2.0)} % with all gauges right, {total_error(drives.sine_calibrated, 'y', wrong, 2.0)} % with the thesis's wiring after "
        "<code>calibrate zero</code> (front left, front right, rear left, rear right).",
    )


@figure(
    "4.14",
    "Lateral force and model for each wheel, sine steer",
    "The combined gauges of a wheel follow the model, with a size within reasonable limits.",
)
def with_model(drives: Drives) -> Made:
    drive = drives.sine
    t, measured = axial_lateral(drives, drive)
    drawn, axes = wheels(ylabel="lateral force (N)", sharey=True)
    together, sizes = {}, {}
    used = t > 2.0
    for wheel in WHEELS:
        model = change(drive, wheel, t)
        plot(axes[wheel], t, smoothed(measured[wheel], 10), "measured", "gauges")
        plot(axes[wheel], t, model, "expected", "model")
        plot(axes[wheel], t, change(drive, wheel, t, "truth"), "truth", "truth", linestyle="--")
        together[wheel] = np.corrcoef(measured[wheel][used], model[used])[0, 1]
        sizes[wheel] = rms(measured[wheel][used]) / rms(model[used])
    shared_legend(drawn, axes["fl"])
    return Made(
        figure=drawn,
        seen=f"{SETUP} Channels as in the thesis, right wiring, without the force of the strut.",
        checks=[
            *(at_least(f"{WHEEL_NAMES[w]}: correlation with the model", together[w], 0.6) for w in WHEELS),
            at_most(
                "force filter: largest error of F_y",
                max(wheel_error(drive, w, "y", drive, 2.0) for w in WHEELS),
                2.0,
                "%",
            ),
            within("size over the model, least", min(sizes.values()), 0.3, 4.0),
            within("size over the model, largest", max(sizes.values()), 0.3, 5.0),
        ],
        today=f"Errors of F_y: method of the thesis with all links and the strut {total_error(drives.sine_statics, 'y', drive, 2.0)} %, force filter {total_error(drive, 'y', drive, 2.0)} %.",
    )


@figure(
    "4.15",
    "Vertical force and model, sine steer",
    "The vertical forces by the deflection match the model in trend and size, with errors at the peaks; lateral force, roll and the change of camber are suggested as causes.",
    "The arms are inclined, so that a lateral force changes the force of the spring; the damper's force is left out too. Exact kinematics leave 0.1 to 1.6 N.",
)
def vertical(drives: Drives) -> Made:
    drive, springs = drives.sine, drives.sine_springs
    t = springs.time_s("/estimate/contact_forces")
    late = t > 2.0
    drawn, axes = wheels(ylabel="vertical force (N)")
    plain, exact = {}, {}
    for wheel in WHEELS:
        true = drive.force(wheel, "z", "truth", t)
        alone = drives.spring_alone_n(drive, wheel, t)
        plot(axes[wheel], t, alone, "measured", "spring alone")
        plot(axes[wheel], t, drive.force(wheel, "z", "model", t), "expected", "model")
        plot(axes[wheel], t, true, "truth", "truth", linestyle="--")
        peak = late & (np.abs(true - STATIC_N[wheel]) > 0.7 * np.max(np.abs(true[late] - STATIC_N[wheel])))
        middle = late & (np.abs(true - STATIC_N[wheel]) < 0.3 * np.max(np.abs(true[late] - STATIC_N[wheel])))
        plain[wheel] = rms(alone[peak] - true[peak]) / rms(alone[middle] - true[middle])
        exact[wheel] = error_percent(
            drive.force(wheel, "z", "estimate", t)[late], true[late], STATIC_N[wheel]
        )
    shared_legend(drawn, axes["fl"])
    alone_error = max(
        error_percent(
            drives.spring_alone_n(drive, w, t)[late], drive.force(w, "z", "truth", t)[late], STATIC_N[w]
        )
        for w in WHEELS
    )
    spring_error = max(wheel_error(springs, w, "z", drive, 2.0) for w in WHEELS)
    return Made(
        figure=drawn,
        seen=f"{SETUP} Spring alone: static load and rate of the spring times the lever, as 2.25 to 2.27 mean it.",
        checks=[
            at_most("spring alone: largest error", alone_error, 15.0, "%"),
            at_least(
                "spring alone: error at the peaks over that in the middle, largest of the wheels",
                max(plain.values()),
                1.2,
            ),
            at_most("estimate: largest error of F_z", max(exact.values()), 2.0, "%"),
        ],
        today=f"Largest error of F_z: spring alone {alone_error:.1f} %, deflection with linkage, damper and the model's lateral force {spring_error:.1f} %, force filter {max(exact.values()):.1f} %.",
    )


def amplitude(t: Any, values: Any, first: float, last: float) -> float:
    """Half of the distance of the 2 % and the 98 % quantile in a stretch of time."""
    low, high = np.percentile(values[(t >= first) & (t < last)], [2.0, 98.0])
    return 0.5 * float(high - low)


def blind_forces(drives: Drives, drive: Drive) -> tuple[Any, dict[str, Any]]:
    """Lateral forces of the four-wheel model on the steer angle and the speed of a drive. Its cornering stiffness
    is the one that `identify` finds on the sine."""
    response = respond(with_stiffness_of(drives.sine, drives.prowler), drive)
    return response.time_s, {wheel: response.lateral_n[:, k] for k, wheel in enumerate(WHEELS)}


@figure(
    "4.17",
    "From asphalt to gravel",
    "A sine steer goes on as the ground changes. The model knows the steer angle only, so that its forces stay; the measured lateral forces fall with the friction of "
    "the ground. Force alone could tell the ground.",
)
def gravel(drives: Drives) -> Made:
    drive, statics = drives.gravel, drives.gravel_statics
    t = statics.time_s("/estimate/contact_forces")
    measured = {w: statics.force(w, "y", "estimate") for w in WHEELS}
    blind = blind_forces(drives, drive)
    drawn, axes = wheels(ylabel="lateral force (N)", sharey=True)
    for wheel in WHEELS:
        plot(axes[wheel], t, smoothed(measured[wheel], 10), "measured", "measured")
        plot(axes[wheel], blind[0], blind[1][wheel], "expected", "model, steer angle alone")
        axes[wheel].axvline(GRAVEL_S, color=C["soft"], linestyle="--", linewidth=1)
    shared_legend(drawn, axes["fl"])
    front = lambda forces: forces["fl"] + forces["fr"]
    ratio = lambda time_s, values: amplitude(time_s, values, 13.5, 18.9) / amplitude(
        time_s, values, 5.0, 11.7
    )
    fall, model = ratio(t, front(measured)), ratio(blind[0], front(blind[1]))
    true = ratio(t, front({w: drive.force(w, "y", "truth", t) for w in WHEELS}))
    asphalt = (t > 3.0) & (t < GRAVEL_S)
    expected = np.interp(t, blind[0], front(blind[1]))
    together = np.corrcoef(front(measured)[asphalt], expected[asphalt])[0, 1]
    event_s = drive.event_s("surface", "front axle")
    friction = drive.topic("/estimate/parameters")["front.friction"]
    last = friction[np.isfinite(friction)][-1] if np.isfinite(friction).any() else float("nan")
    return Made(
        figure=drawn,
        seen="Motion of an independent multibody simulator: friction 0.9, then 0.4 from 12 s (dashed). Measured: statics of each corner, all gauges right.",
        checks=[
            at_most("front axle: measured force on gravel over that on asphalt", fall, 0.92),
            at_least("front axle: force of the model on gravel over that on asphalt", model, 0.96),
            at_least("front axle on asphalt: correlation of measured force and model", together, 0.9),
            within("measured ratio over the true ratio", fall / true, 0.9, 1.1),
            within(
                "event: the surface under the front axle changed, after the change",
                event_s - GRAVEL_S,
                0.0,
                1.5,
                "s",
            ),
            within("friction that the estimator then states", last, 0.3, 0.6),
        ],
        today=f"The estimator reports the change {event_s - GRAVEL_S:.1f} s after it and then states a friction of {last:.2f} (true: 0.4); before, it says that the friction is not known, because too little of "
        "it was used.",
    )
