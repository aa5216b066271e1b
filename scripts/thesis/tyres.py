"""Tyre models: figures 2.2 and 2.14 to 2.17."""

from __future__ import annotations

from typing import Any

import numpy as np
from drawing import C, STEPS, panels
from drives import Drives, rms
from entry import Made, at_least, at_most, figure, within

import atvrec

LOAD_N, FRICTION, STIFFNESS_N_RAD = 1831.0, 0.87, 8538.0
ANGLE_DEG = np.linspace(-30.0, 30.0, 241)
ANGLE_RAD = np.radians(ANGLE_DEG)
LAWS = {"linear": "soft", "fiala": "measured", "exponential": "estimate", "dugoff": "expected"}

# -F_y, N, of independent programs, at 1831 N, 0.87 and 8538 N/rad.
SLIP_DEG = (2.0, 5.0, 10.0, 20.0, 40.0)
INDEPENDENT_N = {
    "fiala": (279.939, 636.303, 1081.017, 1524.829, 1592.970),
    "exponential": (271.813, 595.098, 967.881, 1347.682, 1555.200),
    "dugoff": (298.154, 746.978, 1171.584, 1388.828, 1504.421),
}
# The Magic Formula of 1989 at 4 kN and 4 degrees.
MAGIC_FORMULA_89_N = 3096.609


def tyre(law: str, stiffness_n_rad: float = STIFFNESS_N_RAD, **more: Any) -> atvrec.Tyre:
    return atvrec.Tyre.physical(
        law,
        cornering_stiffness_n_rad=stiffness_n_rad,
        slip_stiffness_n=12_000.0,
        friction=FRICTION,
        **more,
    )


def lateral_n(law: atvrec.Tyre, load_n: Any, angle_rad: Any) -> Any:
    return law.forces(load_n, angle_rad)["lateral_n"]


def at_deg(law: str, angle_deg: float, **more: Any) -> float:
    """-F_y at a slip angle, N."""
    return -float(lateral_n(tyre(law, **more), LOAD_N, [np.radians(angle_deg)])[0])


def slip_axes(height_in: float = 2.8) -> tuple[Any, Any]:
    drawn, axes = panels(height_in=height_in)
    axes.set(xlabel="slip angle (°)", ylabel="lateral force (N)")
    return drawn, axes


def measured_tyre(drives: Drives, kind: str) -> dict[str, Any]:
    """The model that fits the outer front tyre of the right turn best, from the estimates."""
    drive = drives.circle
    time_s = drive.time_s("/estimate/motion")
    return dict(
        atvrec.identify.tyre(
            kind,
            drive.force("fl", "z", "estimate", time_s)[500:],
            drive.column("/estimate/motion", "fl.slip_angle_rad")[500:],
            drive.force("fl", "y", "estimate", time_s)[500:],
            dt_s=0.01,
            reference_load_n=1327.0,
        )
    )


@figure(
    "2.2",
    "Tyre curves",
    "At small slip angles the lateral force of a tyre is proportional to the slip angle. The bicycle model "
    "uses this line, the cornering stiffness, in the place of the curve.",
    "ISO 8855 signs: a positive slip angle gives a negative force. The thesis writes this minus sign in 2.3 "
    "and 2.4, and leaves it out in 2.28.",
)
def curves(drives: Drives) -> Made:
    drawn, axes = slip_axes()
    for load_n, colour in zip((1000.0, 1831.0, 2500.0), STEPS):
        law = tyre("fiala", reference_load_n=LOAD_N, load_exponent=0.75)
        axes.plot(ANGLE_DEG, lateral_n(law, load_n, ANGLE_RAD), color=colour, label=f"Fiala, {load_n:.0f} N")
    axes.plot(
        ANGLE_DEG, lateral_n(tyre("linear"), LOAD_N, ANGLE_RAD), "--", color=C["soft"], label="line of C"
    )
    axes.set_ylim(-2300, 2300)
    axes.legend(loc="lower left")
    found = measured_tyre(drives, "fiala")["findings"]
    stiffness, friction = (found[k]["value"] for k in ("cornering_stiffness", "friction"))
    line = at_deg("linear", 2.0)
    return Made(
        figure=drawn,
        checks=[
            at_least("Fiala over the line of C at 2°", at_deg("fiala", 2.0) / line, 0.90),
            at_most("Fiala over the line of C at 10°", at_deg("fiala", 10.0) / at_deg("linear", 10.0), 0.75),
            within(
                "slip angle 5°: sign of F_y",
                float(lateral_n(tyre("fiala"), LOAD_N, [0.0873])[0]),
                -650,
                -620,
                "N",
            ),
        ],
        today="On the right turn of figure 4.8, <code>identify tyre</code> finds for the outer front tyre a "
        f"cornering stiffness of {stiffness:.0f} N/rad at its static load and a friction coefficient of "
        f"{friction:.2f} from estimated forces and slip angles. The tyre of that simulator is neither of these models.",
    )


@figure(
    "2.14",
    "Tyre models side by side",
    "Linear, Pacejka, Dugoff and Fiala (which the thesis also calls exponential) agree at small slip and "
    "part beyond it. The thesis chooses the exponential model, because it holds at large slip angles.",
    "Fiala's model and the exponential are two models. 2.28 lacks the minus sign.",
)
def models(drives: Drives) -> Made:
    drawn, axes = slip_axes()
    for law, colour in LAWS.items():
        axes.plot(ANGLE_DEG, lateral_n(tyre(law), LOAD_N, ANGLE_RAD), color=C[colour], label=law)
    pacejka = atvrec.Tyre.magic_formula_89()
    axes.plot(
        ANGLE_DEG, lateral_n(pacejka, LOAD_N, ANGLE_RAD), color=C["other"], label="Pacejka, a car's tyre"
    )
    axes.set_ylim(-2500, 2500)
    axes.legend(loc="lower left")
    worst = max(
        abs(at_deg(law, angle) - value)
        for law, values in INDEPENDENT_N.items()
        for angle, value in zip(SLIP_DEG, values)
    )
    pacejka_n = -float(lateral_n(pacejka, 4000.0, [np.radians(4.0)])[0])
    residuals = {}
    for law in ("linear", "fiala", "exponential", "dugoff"):
        found = measured_tyre(drives, law)["findings"]["cornering_stiffness"]
        residuals[law] = found["value"]
    return Made(
        figure=drawn,
        seen="Load 1831 N, friction 0.87, cornering stiffness 8538 N/rad: a rear wheel of the Prowler at rest.",
        checks=[
            at_most(
                "largest difference from the values of independent programs, 3 models at 5 angles",
                worst,
                0.01,
                "N",
            ),
            at_most(
                "Magic Formula of 1989 at 4 kN and 4°: difference",
                abs(pacejka_n - MAGIC_FORMULA_89_N),
                0.01,
                "N",
            ),
            within(
                "Fiala over exponential at 20°",
                at_deg("fiala", 20.0) / at_deg("exponential", 20.0),
                1.10,
                1.16,
            ),
        ],
        today="The cornering stiffness that the estimates of the right turn give depends on the model: "
        + ", ".join(f"{law} {value:.0f}" for law, value in residuals.items())
        + " N/rad (<code>identify tyre</code>, outer front tyre).",
    )


@figure(
    "2.15",
    "Effect of the cornering stiffness",
    "The tyres of an ATV leave the straight line even at small slip angles; a line holds within ±2° only. "
    "Small loads and small stiffnesses flatten the curve.",
)
def stiffness(drives: Drives) -> Made:
    drawn, axes = slip_axes()
    for value, colour in zip((3000.0, 6000.0, 9000.0, 15000.0), STEPS):
        forces = lateral_n(tyre("fiala", value), LOAD_N, ANGLE_RAD)
        axes.plot(ANGLE_DEG, forces, color=colour, label=f"{value:.0f} N/rad")
    axes.axvspan(-2.0, 2.0, color=C["line"], alpha=0.5, linewidth=0)
    axes.legend(loc="lower left")
    lack = lambda angle: 100.0 * (1.0 - at_deg("fiala", angle) / at_deg("linear", angle))
    drive = drives.circle
    slip_deg = np.degrees(np.abs(drive.column("/estimate/motion", "fl.slip_angle_rad")[500:]))
    true_deg = np.degrees(
        np.abs(drive.column("/truth/motion", "fl.slip_angle_rad", drive.time_s("/estimate/motion"))[500:])
    )
    return Made(
        figure=drawn,
        seen="Fiala's model; the band is ±2°.",
        checks=[
            at_most("force that the line has too much at 2°", lack(2.0), 8.0, "%"),
            at_least("force that the line has too much at 5°", lack(5.0), 12.0, "%"),
        ],
        today=f"In the right turn the slip angle of the outer front tyre is above 2° in {100 * np.mean(true_deg > 2.0):.0f} % "
        f"of the time. The estimator has this slip angle with an error of {rms(slip_deg - true_deg):.2f}° (root mean square).",
    )


@figure(
    "2.16",
    "Effect of the load",
    "The slope of the curve at zero, the cornering stiffness, depends on the load. Roll and pitch of an ATV "
    "change the loads much, so that the stiffness changes in manoeuvres that are otherwise gentle.",
    "Dugoff's model as printed in the literature has a stiffness of its own; it changes with the load only if the "
    "stiffness is made to.",
)
def load(drives: Drives) -> Made:
    drawn, axes = slip_axes(3.0)
    pacejka = atvrec.Tyre.magic_formula_89()
    sensitive = tyre("dugoff", reference_load_n=LOAD_N, load_exponent=0.75)
    for value, colour in zip((500.0, 1000.0, 2000.0, 3000.0), STEPS):
        axes.plot(ANGLE_DEG, lateral_n(pacejka, value, ANGLE_RAD), color=colour, label=f"{value:.0f} N")
        axes.plot(ANGLE_DEG, lateral_n(sensitive, value, ANGLE_RAD), "--", color=colour)
    axes.legend(loc="lower left")
    slope = lambda law, value: -float(lateral_n(law, value, [1e-4])[0]) / 1e-4
    drive = drives.circle
    time_s = drive.time_s("/estimate/contact_forces")
    late = time_s > 20.0
    outer, true = drive.force("fl", "z", "estimate")[late], drive.force("fl", "z", "truth", time_s)[late]
    return Made(
        figure=drawn,
        seen="Full lines: Magic Formula of a car's tyre. Dashed: Dugoff with a stiffness that grows with the load to the power of 0.75.",
        checks=[
            within(
                "stiffness at 3000 N over that at 500 N, Magic Formula",
                slope(pacejka, 3000.0) / slope(pacejka, 500.0),
                3.0,
                7.0,
            ),
            within(
                "the same, Dugoff, power 0.75", slope(sensitive, 3000.0) / slope(sensitive, 500.0), 3.82, 3.85
            ),
            within(
                "the same, Dugoff as printed",
                slope(tyre("dugoff"), 3000.0) / slope(tyre("dugoff"), 500.0),
                0.999,
                1.001,
            ),
        ],
        today=f"In the right turn the load of the outer front wheel rises to {np.max(true):.0f} N, {np.max(true) / 1327.0:.1f} times "
        f"its static load. The estimator has it with an error of {rms(outer - true):.0f} N (root mean square).",
    )


@figure(
    "2.17",
    "Friction circle, 3000 N, µ = 0.87",
    "Load and friction limit the sum of lateral and longitudinal force. Hard braking or acceleration leaves "
    "little lateral force.",
)
def friction_circle(drives: Drives) -> Made:
    drawn, axes = panels(height_in=3.0)
    load_n, limit_n = 3000.0, FRICTION * 3000.0
    ratio = np.linspace(-1.0, 1.0, 241)
    greatest, full = 0.0, 0.0
    for angle, colour in zip((0.0, 2.0, 5.0, 10.0, 20.0), (C["soft"], *STEPS)):
        forces = tyre("brush").forces(load_n, np.radians(angle), ratio)
        x, y = forces["longitudinal_n"], -forces["lateral_n"]
        axes.plot(x, y, color=colour, label=f"{angle:.0f}°")
        greatest = max(greatest, float(np.hypot(x, y).max()))
        full = float(y[0] / y[120]) if angle == 5.0 else full
    around = np.linspace(0.0, np.pi, 121)
    axes.plot(limit_n * np.cos(around), limit_n * np.sin(around), "--", color=C["ink"], label="µ · load")
    axes.set(xlabel="longitudinal force (N)", ylabel="lateral force, amount (N)", ylim=(-100, 4000))
    axes.set_aspect("equal")
    axes.legend(ncols=3, loc="upper center")
    drive = drives.gravel
    t = drive.time_s("/estimate/contact_forces")
    used = [
        np.hypot(drive.force(w, "x", "estimate"), drive.force(w, "y", "estimate"))
        / np.maximum(drive.force(w, "z", "estimate"), 300.0)
        for w in ("fl", "fr")
    ]
    largest = lambda part: max(float(np.percentile(one[part], 99)) for one in used)
    asphalt, gravel = largest((t > 3.0) & (t < 11.5)), largest(t > 13.0)
    return Made(
        figure=drawn,
        seen="Brush model; one curve for each slip angle, from locked wheel to spinning wheel.",
        checks=[
            within("largest force over µ · load", greatest / limit_n, 0.99, 1.0 + 1e-9),
            at_most("slip angle 5°: lateral force of a locked wheel over that of a rolling one", full, 0.25),
        ],
        today="On the drive of figure 4.17 the estimated forces of the front wheels use at most "
        f"{asphalt:.2f} of their load on asphalt and {gravel:.2f} on the gravel, whose true friction is 0.4 (99 % of the time).",
    )
