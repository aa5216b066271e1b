"""Roll and cornering stiffness: figures 2.20, 2.21, 2.23, tables 2.4 and 2.5."""

from __future__ import annotations

from typing import Any

import numpy as np
from drawing import C, panels, plot
from drives import GRAVITY_M_S2, Drive, Drives
from entry import Made, at_least, at_most, figure, shown, table, within

import atvrec

# Table 2.3 of the thesis, and the springs of section 2.4.4.
MASS_KG, A_M, B_M, H1_M = 644.0, 0.839, 0.6081, 0.579 - 0.155
SPRING_N_M, TRACKS_M, SPACING_M = 65_000.0, (1.143, 1.092), 0.6858
LEVER = 2.3


def roll_pitch(drive: Drive) -> dict[str, Any]:
    """Findings and other methods' values of `identify roll-pitch`."""
    found = drive.log.identify("roll-pitch")[0]
    return {name: one["value"] for name, one in found["findings"].items()} | {
        name: value for name, (value, _) in found["beside"].items()
    }


def file_roll_stiffness(vehicle: atvrec.Vehicle) -> float:
    values = vehicle.to_dict()
    return float(sum(values[axle]["roll_stiffness_n_m_rad"] for axle in ("front", "rear")))


def ryu(drives: Drives) -> tuple[Any, Any, Any]:
    """Roll angle, roll moment m_s h_1 a_y, and the coefficients of Ryu's regression."""
    drive = drives.slow_sine
    motion = drive.topic("/estimate/motion")
    used = motion["t_s"] > 2.0
    roll = motion["roll_rad"][used]
    lateral = (
        motion["acceleration_m_s2.y"] * np.cos(motion["roll_rad"])
        - motion["acceleration_m_s2.z"] * np.sin(motion["roll_rad"])
    )[used]
    moment = drives.prowler.sprung_mass_kg * drives.prowler.roll_arm_m * lateral
    columns = np.stack([roll, motion["roll_rate_rad_s"][used], np.ones(roll.size)], axis=1)
    return roll, moment, np.linalg.lstsq(columns, moment, rcond=None)[0]


@figure(
    "2.20",
    "Roll stiffness by regression",
    "Roll moment against roll angle and roll rate, by least squares (Ryu). The slope is taken as the roll "
    "stiffness; the thesis found the result irregular in its model.",
    "2.10 and 2.11 lack the roll angle and the sprung mass. The regression on V r gives the net stiffness, K less "
    "m g h_1; K itself follows from the accelerometer on the rolled body.",
)
def roll_regression(drives: Drives) -> Made:
    roll, moment, fit = ryu(drives)
    found = roll_pitch(drives.slow_sine)
    given = file_roll_stiffness(drives.prowler)
    drawn, axes = panels(height_in=2.8)
    axes.plot(np.degrees(roll[::4]), moment[::4], ".", ms=2.0, color=C["measured"], label="estimates")
    ends = np.array([roll.min(), roll.max()])
    axes.plot(
        np.degrees(ends), fit[0] * ends + fit[2], color=C["expected"], label=f"slope {fit[0]:.0f} N m/rad"
    )
    axes.set(xlabel="roll angle (°)", ylabel="$\\mathregular{m_s h_1 a_y}$ (N m)")
    axes.legend(loc="upper left")
    return Made(
        figure=drawn,
        seen="Virtual Prowler, sine steer of 0.3 Hz at 8 m/s. The line leaves out the inertia about the roll axis, the wheels and "
        "their inclination, which <code>identify</code> takes into account.",
        checks=[
            within(
                "slope of the regression over the roll stiffness of the vehicle", fit[0] / given, 0.55, 0.80
            ),
            within(
                "roll stiffness of identify over that of the vehicle",
                found["roll_stiffness"] / given,
                0.95,
                1.05,
            ),
            within(
                "what gravity takes: m_s g h_1 and the wheels'",
                found["gravity_roll_stiffness"],
                1400,
                2100,
                "N m/rad",
            ),
        ],
        today=f"<code>identify roll-pitch</code>: {found['roll_stiffness']:.0f} N m/rad, with the inertia and the inclination of the wheels; "
        f"the vehicle has {given:.0f} N m/rad. Ryu's regression, {found['ryu_net_roll_stiffness']:.0f} N m/rad, is printed beside it.",
    )


def equation_2_31(drive: Drive, offset_rad: float = 0.0) -> tuple[Any, Any, Any]:
    """Time and the stiffness of the front and of the rear axle at each instant, N/rad (2.31, its minus sign
    put in). The reading of the steer angle is wrong by `offset_rad`."""
    motion = drive.topic("/estimate/motion")
    used = motion["t_s"] > 5.0
    column = lambda name: motion[name][used]
    speed = np.hypot(column("velocity_x_m_s"), column("velocity_y_m_s"))
    beta, r = column("sideslip_rad"), column("yaw_rate_rad_s")
    steer = 0.5 * (column("fl.steer_rad") + column("fr.steer_rad")) + offset_rad
    force = MASS_KG * speed * r
    length = A_M + B_M
    front = -force * B_M / length / (beta + A_M * r / speed - steer)
    rear = -force * A_M / length / (beta - B_M * r / speed)
    return motion["t_s"][used], front, rear


@figure(
    "2.21",
    "Cornering stiffness at each instant",
    "Cornering stiffness from lateral acceleration, sideslip and steer angle at each instant of a 50 ft turn of rising "
    "speed. It grows with the speed; the mean is taken as the value of the axle.",
    "2.31 lacks a minus sign and assumes steady state, small angles, no bank and no longitudinal force. A steer angle that "
    "is wrong by 2° alone gives such a growth. A mean of ratios is biased: regress the slip angle on the force, with an "
    "offset.",
)
def stiffness_over_time(drives: Drives) -> Made:
    drive = drives.circle
    t, front, rear = equation_2_31(drive)
    _, wrong, _ = equation_2_31(drive, -np.radians(2.0))
    drawn, axes = panels(height_in=2.9)
    plot(axes, t, rear / 1000, "estimate", "rear")
    plot(axes, t, front / 1000, "measured", "front")
    plot(axes, t, wrong / 1000, "expected", "front, steer angle wrong by 2°")
    axes.axhline(np.mean(wrong) / 1000, color=C["expected"], linestyle="--", linewidth=1)
    axes.set(xlabel="time (s)", ylabel="cornering stiffness (kN/rad)", ylim=(0, 32))
    axes.legend(loc="upper right", ncols=2)
    growth = lambda values: float(
        np.median(values[(t > 35) & (t < 45)]) / np.median(values[(t > 6) & (t < 16)])
    )
    offset_drive = drives.slow_sine_offset
    plain, offset = (one.log.identify("cornering")[0] for one in (drives.slow_sine, offset_drive))
    value = lambda found: found["findings"]["cornering_stiffness_front"]["value"]
    ratio = lambda found: found["beside"]["equation_2_31_front"][0]
    return Made(
        figure=drawn,
        seen="Dashed: the mean that the thesis would use of the curve with the wrong steer angle.",
        checks=[
            at_least("growth from 6-16 s to 35-45 s, steer angle wrong by 2°", growth(wrong), 1.15),
            at_most("the same, steer angle right", growth(front), 1.1),
            at_least(
                "sine steer, hidden zero error of the encoder: change of the mean of 2.31",
                100 * abs(ratio(offset) / ratio(plain) - 1),
                5.0,
                "%",
            ),
            at_most(
                "the same: change of what identify finds",
                100 * abs(value(offset) / value(plain) - 1),
                3.0,
                "%",
            ),
        ],
        today="<code>identify cornering</code> regresses with an offset: with a hidden error of the steering wheel it finds "
        f"{value(offset):.0f} N/rad in front, without it {value(plain):.0f}; the mean of 2.31 goes from {ratio(plain):.0f} to {ratio(offset):.0f}.",
    )


STIFFNESS_N_RAD = {"road, 12 psi": (5975.0, 17076.0), "off-road, 4 psi": (3124.0, 13886.0)}


@figure(
    "2.23",
    "Cornering stiffness of both tyres",
    "Road tyres at 12 psi: 5975 N/rad in front and 17076 N/rad at the rear; off-road tyres at 4 psi: 3124 and 13886 N/rad.",
    "The values are those of axles: m V r is a force of the whole vehicle. A tyre has half.",
)
def stiffness_table(drives: Drives) -> Made:
    rows, checks = [], []
    for (tyre, printed), drive in zip(STIFFNESS_N_RAD.items(), (drives.slow_sine, drives.slow_sine_off_road)):
        found = drive.log.identify("cornering")[0]["findings"]
        for axle, value in zip(("front", "rear"), printed):
            one = found[f"cornering_stiffness_{axle}"]
            low, high = one["interval"]
            rows.append(
                [
                    f"{tyre}, {axle}",
                    f"{value:.0f} N/rad",
                    f"{one['value']:.0f} N/rad",
                    f"{low:.0f} to {high:.0f}",
                ]
            )
            checks.append(
                within(f"{tyre}, {axle}: identified over the thesis's", one["value"] / value, 0.95, 1.05)
            )
    return Made(
        table=(["tyre", "thesis", "identify cornering", "95 %"], rows),
        checks=checks,
        today="The vehicle files <code>prowler</code> and <code>prowler-off-road</code> have the thesis's values; the last columns are found "
        "again from the bytes of the sensors on a sine of 0.3 Hz at 8 m/s.",
    )


@table(
    "2.4",
    "Roll and pitch by regression",
    "Ryu's regression gave a roll stiffness of 2743 and a pitch stiffness of 3153, which made the model irregular.",
    "Stiffness is in N m/rad and damping in N m s/rad; the table has the units exchanged. m g h_1 is 2678.7 N m/rad, "
    "so that a roll stiffness of 2743 leaves 64 N m/rad to hold the body.",
)
def regression_values(drives: Drives) -> Made:
    taken = MASS_KG * 9.81 * H1_M
    found = roll_pitch(drives.slow_sine)
    braking = roll_pitch(drives.launch_brake)
    given = file_roll_stiffness(drives.prowler)
    lean = np.degrees(MASS_KG * H1_M * GRAVITY_M_S2 / (2743.0 - taken))
    rows = [
        ["roll stiffness", "2743", f"{found['roll_stiffness']:.0f} N m/rad"],
        ["roll damping", "203.8", f"{found['roll_damping']:.0f} N m s/rad"],
        ["pitch stiffness", "3153", f"{braking['pitch_stiffness']:.0f} N m/rad"],
        ["pitch damping", "824.03", f"{braking['pitch_damping']:.0f} N m s/rad"],
    ]
    return Made(
        table=(["parameter", "thesis", "identify roll-pitch, virtual Prowler"], rows),
        checks=[
            within("2743 less m g h_1", 2743.0 - taken, 60.0, 70.0, "N m/rad"),
            at_least("roll angle for 1 g with 2743 N m/rad", lean, 1000.0, "°"),
            within(
                "identified roll stiffness over that of the vehicle",
                found["roll_stiffness"] / given,
                0.95,
                1.05,
            ),
        ],
        today="<code>identify roll-pitch</code> on a sine (roll) and on launch and brake (pitch) of the virtual Prowler, whose springs, "
        "dampers and hard-points are those of an independent simulator.",
    )


@table(
    "2.5",
    "Roll and pitch from the springs",
    "Gillespie's formula, half of the spring rate times the square of the springs' distance, gives 15285.5 for roll and "
    "67392 for pitch. The thesis tunes values between both tables.",
    "15285.5 is the front axle alone with the rate of the spring in the place of the wheel's; 67392 has s = 1.44 m. With the "
    "wheel rate k/2.3² (2.25 to 2.27 have the lever upside down): 15352 and 26386 N m/rad. Units as in table 2.4.",
)
def spring_values(drives: Drives) -> Made:
    rate = SPRING_N_M / LEVER**2
    roll = sum(0.5 * rate * track**2 for track in TRACKS_M)
    pitch = 2.0 * rate * (A_M**2 + B_M**2)
    found = roll_pitch(drives.slow_sine)
    braking = roll_pitch(drives.launch_brake)
    rows = [
        [
            "roll stiffness",
            "15285.5",
            f"{roll:.0f} N m/rad",
            f"{found['gillespie_roll_stiffness']:.0f} N m/rad",
            f"{found['roll_stiffness']:.0f} N m/rad",
        ],
        ["pitch stiffness", "67392", f"{pitch:.0f} N m/rad", "", f"{braking['pitch_stiffness']:.0f} N m/rad"],
    ]
    return Made(
        table=(
            ["parameter", "thesis", "wheel rates, lever 2.3", "lever of the hard-points", "identified"],
            rows,
        ),
        checks=[
            within("0.5 · 65000 · 0.6858²", 0.5 * SPRING_N_M * SPACING_M**2, 15285.0, 15286.0, "N m/rad"),
            within("both axles, wheel rates", roll, 15350.0, 15355.0, "N m/rad"),
            within("pitch, wheel rates", pitch, 26380.0, 26390.0, "N m/rad"),
            within(
                "identified roll stiffness over springs and tyres in series",
                found["roll_stiffness"] / found["gillespie_roll_stiffness_with_tyres"],
                0.93,
                1.05,
            ),
        ],
        today=f"The tyres are in series with the springs: {shown(found['gillespie_roll_stiffness_with_tyres'])} N m/rad by the formula, "
        f"{shown(found['roll_stiffness'])} N m/rad from the drive.",
    )
