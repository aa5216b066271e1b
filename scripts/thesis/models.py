"""The bicycle at low speed and the tables of parameters: figure 2.3, tables 2.1 to 2.3."""

from __future__ import annotations

from typing import Any

import numpy as np
from drawing import C, WHEELS, panels, plain_decades, plot
from drives import GRAVITY_M_S2, Drives, rms
from entry import Made, at_least, at_most, figure, shown, table, within

import atvrec

STEP_S = 0.01
RELAXATION_M = 0.15


def crawling() -> tuple[Any, Any, Any, Any]:
    """Time, speed, and the yaw rates of equation 2.5 and of the form with relaxing tyres, rad/s."""
    bicycle = atvrec.Bicycle(atvrec.Vehicle.builtin("prowler-table-2.3"))
    steer_rad = np.radians(5.0)
    time_s = np.arange(0.0, 10.0, STEP_S)
    speed_m_s = np.interp(time_s, [0.0, 5.0, 6.0, 10.0], [5.0, 0.04, 0.04, 4.0])
    rates = np.zeros((2, time_s.size))
    plain, relaxed = np.zeros(2), np.zeros(4)
    for index, speed in enumerate(speed_m_s):
        a, b = bicycle.system(speed)
        plain = np.clip(plain + STEP_S * (a @ plain + b * steer_rad), -10.0, 10.0)
        # The relaxed form is stiff in the slip angles only; ten steps resolve them.
        a, b = bicycle.relaxed_system(speed, RELAXATION_M)
        for _ in range(10):
            relaxed = relaxed + 0.1 * STEP_S * (a @ relaxed + b * steer_rad)
        rates[:, index] = plain[1], relaxed[1]
    return time_s, speed_m_s, rates[0], rates[1]


@figure(
    "2.3",
    "The bicycle model at low speed",
    "The speed is in the denominator of the bicycle model. Below a threshold the numerical solution becomes "
    "unusable, and at rest the model is singular. The thesis switches the model off below a threshold.",
    "2.5 is right as printed; its stiffnesses are those of axles. A relaxation length takes the speed out of the "
    "denominator.",
)
def low_speed(drives: Drives) -> Made:
    time_s, speed, plain, relaxed = crawling()
    drawn, (rates, speeds) = panels(2, 1, 3.6, sharex=True, height_ratios=(3, 1))
    plot(rates, time_s, np.degrees(plain), "expected", "equation 2.5, steps of 10 ms")
    plot(rates, time_s, np.degrees(relaxed), "measured", "with relaxation length")
    rates.set(ylabel="yaw rate (°/s)", ylim=(-60, 60))
    rates.legend(loc="upper left")
    plot(speeds, time_s, speed, "ink")
    speeds.set(xlabel="time (s)", ylabel="speed (m/s)")
    early = (time_s > 1.0) & (time_s < 2.5)
    drive = drives.launch_brake
    found = drive.column("/estimate/motion", "yaw_rate_rad_s")
    true = drive.column("/truth/motion", "yaw_rate_rad_s", drive.time_s("/estimate/motion"))
    return Made(
        figure=drawn,
        seen="Steer angle 5°, constant. The speed falls to 0.04 m/s and rises again.",
        checks=[
            at_least("largest yaw rate of equation 2.5", np.degrees(np.abs(plain).max()), 100.0, "°/s"),
            at_most(
                "largest yaw rate with relaxation length", np.degrees(np.abs(relaxed).max()), 20.0, "°/s"
            ),
            at_most(
                "difference of both forms above 3 m/s",
                100 * rms(plain[early] - relaxed[early]) / rms(plain[early]),
                4.0,
                "%",
            ),
        ],
        today="From rest to 15 m/s and back to walking pace (manoeuvre launch-brake) the estimated yaw rate has no "
        f"spike: its largest error is {np.degrees(np.max(np.abs(found - true))):.2f} °/s.",
    )


# Table 2.1: Chang's quarter car.
CHANG = {"m_s": 53.61, "m_u": 23.24, "k_s": 8265.5, "b_s": 640.0, "k_t": 30922.0, "b_t": 1500.0}


def clean_quarter(m_s: float, m_u: float, k_s: float, b_s: float, k_t: float, b_t: float) -> Any:
    """State matrix of z_s', z_u', z_s, z_u: equations 2.16 to 2.21 without their misprints."""
    return np.array(
        [
            [-b_s / m_s, b_s / m_s, -k_s / m_s, k_s / m_s],
            [b_s / m_u, -(b_s + b_t) / m_u, k_s / m_u, -(k_s + k_t) / m_u],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
        ]
    )


def clean_response(frequency_hz: Any, **quarter: float) -> Any:
    """Heights of body and wheel for a unit sine of the road, complex; the road enters through the tyre."""
    state = clean_quarter(**quarter)
    found = []
    for omega in 2j * np.pi * frequency_hz:
        road = np.array([0.0, (quarter["k_t"] + quarter["b_t"] * omega) / quarter["m_u"], 0.0, 0.0])
        found.append(np.linalg.solve(omega * np.eye(4) - state, road)[2:])
    return np.array(found)


@table(
    "2.1",
    "Suspension parameters of Chang's ATV",
    "Sprung and unsprung mass, spring and damper of the suspension and of the tyre of a quarter car, from "
    "another ATV.",
    "2.20 and 2.21 write one mass for two and leave out the tyre's damping; 2.17 and 2.19 name one road input "
    "with two symbols.",
)
def chang(drives: Drives) -> Made:
    half_m = 0.5 * atvrec.Vehicle.builtin("prowler-chang").wheelbase_m
    quarter = 4.0 * (CHANG["m_s"] + CHANG["m_u"])
    vehicle = atvrec.Vehicle.builtin("prowler-chang").with_values(
        {"body.mass_kg": quarter, "body.front_axle_to_cg_m": half_m, "body.cg_to_rear_axle_m": half_m}
    )
    poles = np.sort_complex(atvrec.Ride.quarter(vehicle, "fl").poles())
    clean = np.sort_complex(np.linalg.eigvals(clean_quarter(**CHANG)))
    bounce_hz = np.min(np.abs(poles)) / (2.0 * np.pi)
    frequency_hz = np.geomspace(0.3, 30.0, 200)
    drawn, axes = panels(height_in=2.6)
    # The state has the rates of body and wheel, then their heights.
    response = atvrec.Ride.quarter(vehicle, "fl").response(0, frequency_hz)[:, 2:]
    independent = clean_response(frequency_hz, **CHANG)
    axes.loglog(frequency_hz, np.abs(response[:, 0]), color=C["measured"], label="body over road")
    axes.loglog(frequency_hz, np.abs(response[:, 1]), color=C["expected"], label="wheel over road")
    axes.set(xlabel="frequency (Hz)", ylabel="amplitude ratio")
    plain_decades(axes.xaxis)
    plain_decades(axes.yaxis)
    axes.legend(loc="lower left")
    rows = [
        ["sprung mass", "53.61 kg"],
        ["unsprung mass", "23.24 kg"],
        ["spring, damper of the suspension", "8265.5 N/m, 640 N s/m"],
        ["spring, damper of the tyre", "30922 N/m, 1500 N s/m"],
    ]
    return Made(
        figure=drawn,
        table=(["Chang", "value"], rows),
        checks=[
            at_most(
                "poles against the corrected equations, largest difference",
                np.max(np.abs(poles - clean)),
                1e-6,
                "rad/s",
            ),
            at_most(
                "response to the road against the corrected equations, largest difference",
                np.max(np.abs(response - independent)),
                1e-6,
            ),
            within("body over road at 0.3 Hz", np.abs(response[0, 0]), 1.0, 1.1),
            within("frequency of the body", bounce_hz, 1.0, 2.5, "Hz"),
        ],
        today="The vehicle file <code>prowler-chang</code> has these values at the wheels of the Prowler. "
        f"Body frequency {bounce_hz:.2f} Hz. Figure 3.6 has the spectrum of a drive.",
    )


@table(
    "2.2",
    "Inertia of Warner's ATV",
    "Moments of inertia about the three axes, height of the centre of gravity and weight, from pendulum tests.",
)
def warner(drives: Drives) -> Made:
    inertia = drives.prowler.to_dict()["body"]["inertia_kg_m2"]
    results = drives.fast_sine_statics.log.identify("inertia")
    found = results[0]["findings"]["yaw_inertia"]
    low, high = found["interval"]
    ratio = inertia[2] / (644.0 * 0.839 * 0.6081)
    largest = 2.0 * max(inertia) / sum(inertia)
    rows = [
        ["roll", "213.4 kg m²", shown(inertia[0]) + " kg m²"],
        ["pitch", "445.7 kg m²", shown(inertia[1]) + " kg m²"],
        ["yaw", "453.9 kg m²", shown(inertia[2]) + " kg m²"],
    ]
    return Made(
        table=(["moment of inertia", "thesis", "vehicle file prowler"], rows),
        checks=[
            within("yaw inertia over m a b", ratio, 0.7, 1.5),
            at_most("triangle inequality: twice the largest over the sum", largest, 1.0),
            within("yaw inertia identified in a drive over Warner's", found["value"] / 453.9, 0.9, 1.1),
            within("interval of 95 % holds Warner's value (1: yes)", float(low <= 453.9 <= high), 1.0, 1.0),
        ],
        today=f"<code>identify inertia</code> on a sine of 0.7 Hz, forces by statics (which do not use the inertia): {found['value']:.0f} "
        f"kg m², 95 % from {low:.0f} to {high:.0f}. <code>vehicle mass</code> gives the inertia from a list of components.",
    )


@table(
    "2.3",
    "Measured parameters of the Prowler",
    "Masses, lengths, inertia from a solid model and heights of the Prowler, used in its model.",
    "The wheelbase is 57.00 in, where appendix A prints 75.25 in. 2.29 gives 452 kg m² with a = 0.89 m and b = 0.79 m, "
    "328.6 with a and b of this table. The moments of inertia are far above those of a uniform box (268, 609, "
    "543 kg m²); the vehicle file <code>prowler</code> has Warner's.",
)
def measured(drives: Drives) -> Made:
    printed = atvrec.Vehicle.builtin("prowler-table-2.3")
    values = printed.to_dict()["body"]
    a_m, b_m = values["front_axle_to_cg_m"], values["cg_to_rear_axle_m"]
    inertia = values["inertia_kg_m2"]
    warned = [text for text in printed.warnings() if "yaw inertia" in text]
    drive = drives.slow_sine
    t = drive.time_s("/estimate/contact_forces")
    still = t < 1.0
    loads = [float(np.mean(drive.force(w, "z", "estimate")[still])) for w in WHEELS]
    front = (loads[0] + loads[1]) / sum(loads)
    rows = [
        ["mass", "644 kg", f"{shown(printed.mass_kg)} kg"],
        ["a, b", "0.839 m, 0.6081 m", f"{shown(a_m)} m, {shown(b_m)} m"],
        ["wheelbase", "1.4478 m", f"{printed.wheelbase_m:.4f} m (a + b)"],
        ["inertia", "549, 1539, 1279 kg m²", ", ".join(shown(x) for x in inertia) + " kg m² (warned of)"],
        ["height of the centre of gravity", "0.579 m", f"{shown(values['cg_height_m'])} m"],
    ]
    return Made(
        table=(["parameter", "thesis", "vehicle file prowler-table-2.3"], rows),
        checks=[
            at_most(
                "a + b against the printed wheelbase", 1000 * abs(printed.wheelbase_m - 1.4478), 1.0, "mm"
            ),
            within("m a b", 644.0 * a_m * b_m, 328.5, 328.7, "kg m²"),
            at_least("printed yaw inertia over m a b", inertia[2] / (644.0 * a_m * b_m), 1.5),
            within("warnings about the printed yaw inertia", len(warned), 1, 1),
            within("printed weight over m g", 6318.0 / (644.0 * GRAVITY_M_S2), 0.999, 1.001),
            within(
                "estimated loads, straight on, over the weight",
                sum(loads) / (644.0 * GRAVITY_M_S2),
                0.98,
                1.02,
            ),
            within(
                "estimated share of the front axle less b/L",
                100 * (front - b_m / printed.wheelbase_m),
                -1.0,
                1.0,
                "%",
            ),
        ],
        today=f"While the virtual vehicle drives straight on, the estimated loads add to {sum(loads):.0f} N, of which the front axle "
        f"carries {100 * front:.1f} %. <code>calibrate weight</code> and <code>calibrate cg-height</code> measure both in the workshop.",
    )
