"""Strain, circuits, spectrum and jackstands: tables 3.1 and 3.2, figures 3.6, 3.17 and 3.18."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
from drawing import C, STEPS, WHEEL_NAMES, WHEELS, panels, plain_decades, plot, shared_legend, wheels
from drives import LONG, MEMBERS, Drive, Drives
from entry import Made, at_least, at_most, figure, shown, table, within

import atvrec

MATERIALS = (
    ("Aluminum (2024-T4)", 0.32, 73.0),
    ("Aluminum (6061)", 0.32, 71.7),
    ("Steel 1018", 0.285, 206.8),
    ("Steel 4130", 0.28, 190.0),
    ("Steel 304 SS", 0.25, 193.0),
)
MEMBER_NAMES = {member: member.replace("_", " ") for member in MEMBERS}


def chain() -> dict[str, Any]:
    """The table `strain` of the sensors file of the thesis."""
    return dict(tomllib.loads(atvrec.Sensors.builtin().to_toml())["strain"])


def area_m2() -> float:
    values = chain()
    outer, wall = values["tube_outer_diameter_m"], values["tube_wall_m"]
    return float(np.pi * wall * (outer - wall))


@table(
    "3.1",
    "Materials",
    "Poisson's ratio and elastic modulus of five materials; frame and arms of the Prowler are of steel 4130. Stress and strain of a "
    "member follow from its force by Hooke's law.",
    "A stress of 180 to 200 MPa in steel 4130 is a strain of 947 to 1053 µm/m, where section 3.3 prints about 10.",
)
def materials(drives: Drives) -> Made:
    values = chain()
    modulus = values["youngs_modulus_pa"]
    by_hand = (
        2.0
        * modulus
        * area_m2()
        / (values["gauge_factor"] * atvrec.amplifier_gain(100.0) * 2 ** values["adc_bits"])
    )
    found = atvrec.StrainChannel.axial().load_per_count
    rows = [
        [
            name,
            shown(ratio),
            f"{shown(gpa)} GPa",
            f"{1e6 * 180e6 / (gpa * 1e9):.0f} to {1e6 * 200e6 / (gpa * 1e9):.0f} µm/m",
        ]
        for name, ratio, gpa in MATERIALS
    ]
    return Made(
        table=(["material", "Poisson's ratio", "modulus", "strain at 180 to 200 MPa"], rows),
        checks=[
            within("modulus of the sensors file", modulus / 1e9, 190.0, 190.0, "GPa"),
            within("Poisson's ratio of the sensors file", values["poisson_ratio"], 0.28, 0.28),
            within("strain of steel 4130 at 180 MPa", 180e12 / modulus, 947.0, 948.0, "µm/m"),
            within("strain of steel 4130 at 200 MPa", 200e12 / modulus, 1052.0, 1053.0, "µm/m"),
            within("E A of a tube of 25.4 mm × 1.65 mm", modulus * area_m2() / 1e6, 23.3, 23.5, "MN"),
            within("newtons for a count over the same by hand", found / by_hand, 0.999, 1.001),
        ],
        today=f"The chain of the sensors file <code>thesis-10bit</code> gives {found:.1f} N for a count of an axial half bridge. A leg carries 0.35 to "
        "2 kN on the road, 15 to 86 µm/m.",
    )


@table(
    "3.2",
    "Strain circuits",
    "Sixteen circuits in four boxes, with gain resistors of 100 or 350 Ω, twelve half and four quarter bridges. Gain 5 + 80 kΩ/R: 805 and "
    "about 233. The low-pass filter has its corner at 19.9 Hz.",
    "Box 5 is the rear right, where the table prints rear left again. Of 1000 µm/m a quarter bridge makes 2.6 mV, a half bridge 5.2 mV and a "
    "full bridge 10.5 mV, where section 3.4 prints 5 to 20 mV. The filter delays by 8 ms. A socket of 1 Ω costs 1 % of gain at 100 Ω.",
)
def circuits(drives: Drives) -> Made:
    table_rows = atvrec.strain_circuits()
    names = {
        "FrontLeft": "front left",
        "FrontRight": "front right",
        "RearLeft": "rear left",
        "RearRight": "rear right",
    }
    rows = [
        [
            str(one["can_box"]),
            names[one["wheel"]],
            "".join(f" {c.lower()}" if c.isupper() else c for c in one["member"]).strip(),
            one["bridge"].lower(),
            f"{one['gain_resistor_ohm']:.0f} Ω",
            f"{one['gain']:.1f}",
        ]
        for one in table_rows
    ]
    halves = sum(one["bridge"] == "Half" for one in table_rows)
    socket = 100.0 * (1.0 - atvrec.amplifier_gain(101.0) / atvrec.amplifier_gain(100.0))
    corner_hz = 1.0 / (2.0 * np.pi * 80.0 * 100e-6)
    phase = -np.degrees(np.arctan(6.0 / corner_hz))
    values = chain()
    half_mv = 1e3 * values["gauge_factor"] * 1e-3 / 2.0 * values["excitation_v"]
    return Made(
        table=(["box", "wheel", "member", "bridge", "R", "gain"], rows),
        checks=[
            within("circuits", len(table_rows), 16, 16),
            within("half bridges", halves, 12, 12),
            within(
                "circuits of box 5 at the rear right",
                sum(one["can_box"] == 5 and one["wheel"] == "RearRight" for one in table_rows),
                4,
                4,
            ),
            within("gain with 100 Ω", atvrec.amplifier_gain(100.0), 805.0, 805.0),
            within("gain with 350 Ω", atvrec.amplifier_gain(350.0), 233.5, 233.6),
            within("gain that a socket of 1 Ω costs at 100 Ω", socket, 0.97, 0.99, "%"),
            within(
                "corner of 80 Ω and 100 µF less that of the sensors file",
                corner_hz - values["lag_hz"],
                -0.05,
                0.05,
                "Hz",
            ),
            within("phase of the filter at 6 Hz", phase, -16.9, -16.7, "°"),
            within("half bridge at 1000 µm/m", half_mv, 5.2, 5.3, "mV"),
        ],
        today="The estimator models the filter as a first-order lag. <code>sensors-file</code> describes bridges, gains and converters as data; "
        "<code>calibrate load-rig</code> finds wrong gains and bridges on stands.",
    )


def spectrum_mm(drive: Drive, wheel: str) -> tuple[Any, Any]:
    """Frequency, and the mean power of the spring deflection by Welch's method, mm^2 in each band."""
    span_m = tomllib.loads(atvrec.Sensors.builtin().to_toml())["deflection"]["span_m"]
    columns = drive.topic("/deflection")
    millimetres = 1e3 * span_m / 1024.0 * columns[f"{wheel}.raw_counts"].astype(float)
    used = millimetres[columns["t_s"] > 2.0]
    window = np.hanning(512)
    parts = [used[k : k + 512] for k in range(0, used.size - 511, 256)]
    power = [np.abs(np.fft.rfft((part - part.mean()) * window)) ** 2 for part in parts]
    return np.fft.rfftfreq(512, 0.01), np.mean(power, axis=0) / np.sum(window) ** 2


@figure(
    "3.6",
    "Frequency content of the suspension deflection",
    "Nearly all of the suspension's motion is below 20 Hz, and most of it at 2 to 6 Hz; 100 Hz of sampling suffice, and a filter of 19.9 Hz "
    "is taken to lose nothing.",
    "The filter of 3.6 delays by 8 ms, turns the phase by 16.8° at 6 Hz and takes 8.6 dB at 50 Hz.",
)
def spectrum(drives: Drives) -> Made:
    drive = drives.rough
    drawn, axes = panels(height_in=2.7)
    above, low = [], []
    for wheel in WHEELS:
        frequency, power = spectrum_mm(drive, wheel)
        axes.semilogy(frequency[1:], np.sqrt(power[1:]), color=C[wheel], label=WHEEL_NAMES[wheel])
        above.append(100.0 * power[frequency > 20.0].sum() / power[1:].sum())
        low.append(100.0 * power[(frequency > 0.0) & (frequency <= 6.0)].sum() / power[1:].sum())
    plain_decades(axes.yaxis)
    axes.axvline(19.9, color=C["soft"], linestyle="--", linewidth=1)
    axes.set(xlabel="frequency (Hz)", ylabel="spring deflection (mm)", xlim=(0, 50))
    axes.legend(loc="upper right", ncols=2)
    lag_db = -10.0 * np.log10(1.0 + (50.0 / 19.9) ** 2)
    classes = drive.topic("/estimate/road")["roughness.class"]
    enough = [str(one) for one in classes if one not in (None, "")]
    return Made(
        figure=drawn,
        seen="Road of ISO 8608 class C at 8 to 12 m/s. Dashed: corner of the filter.",
        checks=[
            at_most("power above 20 Hz, worst wheel", max(above), 2.0, "%"),
            at_least("power up to 6 Hz, worst wheel", min(low), 60.0, "%"),
            within("what the filter takes at 50 Hz", lag_db, -8.7, -8.5, "dB"),
        ],
        today="From the deflections and the other sensors the estimator finds the road below the wheels and its class "
        f"({enough[-1] if enough else 'not known'} at the end of this drive).",
    )


@figure(
    "3.17",
    "Strain channels of hanging wheels",
    "On jackstands the channels do not read zero: the bridges are not balanced, and wheels and uprights hang on the arms. The "
    "offsets are taken off. One channel of the front right wheel drifts, probably by a wrong connection.",
    "The arms of a hanging wheel are not free of load: they carry wheel, upright and arms against the coil spring and the droop stop.",
)
def hanging(drives: Drives) -> Made:
    drive = drives.jackstand
    time_s, counts = drive.strain()
    drawn, axes = wheels(ylabel="counts less 512")
    used = time_s < 8.0
    for wheel in WHEELS:
        for index, (member, colour) in enumerate(zip(MEMBERS, (*STEPS, C["soft"]))):
            plot(axes[wheel], time_s[used], counts[wheel][used, index] - 512.0, colour, MEMBER_NAMES[member])
    shared_legend(drawn, axes["fl"])
    output, found = drives.jackstand_zeros
    true = tomllib.loads((drives.folder / "jackstand-true.toml").read_text(encoding="utf-8"))["corner"]
    got = tomllib.loads(output.read_text(encoding="utf-8"))["corner"]
    differences = {
        (wheel, member): abs(
            got[LONG[wheel]]["strain"][member]["offset_counts"]
            - true[LONG[wheel]]["strain"][member]["offset_counts"]
        )
        for wheel in WHEELS
        for member in MEMBERS
        if member in got[LONG[wheel]]["strain"]
        and "offset_counts" in got[LONG[wheel]]["strain"][member]
        and (wheel, member) != ("fr", "lower_rear")
    }
    notes = " ".join(map(str, found["notes"]))
    largest = max(abs(float(np.mean(counts[w][used, k])) - 512.0) for w in WHEELS for k in range(5))
    return Made(
        figure=drawn,
        seen="Virtual Prowler on jackstands, wheels hanging; the zeros of the bridges are wrong by up to 40 counts. One count is 27 N.",
        checks=[
            at_least("largest offset", largest, 20.0, "counts"),
            within("channels whose zero is found", len(differences), 19, 19),
            at_most("error of the zeros, largest", max(differences.values()), 0.5, "counts"),
            at_least("notes that name the drifting channel", notes.count("FR lower_rear"), 1),
        ],
        today="<code>calibrate zero</code> computes what the hanging wheels put on the arms and takes it off. "
        f"Largest error of a zero: {max(differences.values()):.2f} counts. It says: “{drift_note(found['notes'])}”",
    )


def drift_note(notes: list[Any]) -> str:
    return next((str(note) for note in notes if "FR lower_rear" in str(note)), "nothing about the drift")


def spring_slopes(drive: Drive) -> dict[str, float]:
    """Newtons of wheel load for a metre of the spring, from the steps on the scales."""
    span_m = tomllib.loads(atvrec.Sensors.builtin().to_toml())["deflection"]["span_m"]
    marks = drive.topic("/mark")
    columns = drive.topic("/deflection")
    slopes = {}
    for index, wheel in enumerate(WHEELS):
        loads, lengths = [], []
        for t, text in zip(marks["t_s"], marks["text"]):
            part = (columns["t_s"] > t) & (columns["t_s"] < t + 1.5)
            lengths.append(span_m / 1024.0 * columns[f"{wheel}.raw_counts"][part].astype(float).mean())
            loads.append(float(text.split()[1 + index]))
        slopes[wheel] = float(np.polyfit(lengths, loads, 1)[0])
    return slopes


@figure(
    "3.18",
    "Lowered from the jackstands",
    "The front is lowered first, then the rear; the steering wheel is turned to both sides. Spring and arms take the weight, and the tie rod shows "
    "the force that turns the wheels. Load over deflection gives 158780 N/m, 2.44 times the spring's rate, which the thesis takes to confirm the lever "
    "of 2.3.",
    "2.25 to 2.27 have the lever upside down: by virtual work F_z is k Δl/2.3. The 2.44 is a secant through one point, consistent with about "
    "2.5 kN of preload at the droop stop.",
)
def lowered(drives: Drives) -> Made:
    drive = drives.jackstand
    time_s, counts = drive.strain()
    zeros = tomllib.loads(drives.jackstand_zeros[0].read_text(encoding="utf-8"))["corner"]
    newtons = atvrec.StrainChannel.axial().load_per_count
    drawn, (front, rear, steer) = panels(3, 1, 5.4, sharex=True, height_ratios=(3, 3, 1.3))
    for axes, wheel in ((front, "fl"), (rear, "rl")):
        for member, colour in (
            ("lower_front", STEPS[0]),
            ("lower_rear", STEPS[1]),
            ("upper_front", STEPS[2]),
            ("tie_rod", STEPS[3]),
        ):
            zero = zeros[LONG[wheel]]["strain"][member]["offset_counts"]
            plot(
                axes,
                time_s,
                newtons * (counts[wheel][:, MEMBERS.index(member)] - zero),
                colour,
                MEMBER_NAMES[member],
            )
        plot(
            axes,
            drive.time_s("/truth/contact_forces"),
            drive.force(wheel, "z", "truth"),
            "truth",
            "true load",
            linestyle="--",
        )
        axes.set(ylabel=f"{WHEEL_NAMES[wheel]} (N)")
    plot(steer, drive.time_s("/steer"), np.degrees(drive.column("/steer", "steering_wheel_rad")), "ink")
    steer.set(xlabel="time (s)", ylabel="steering\nwheel (°)")
    shared_legend(drawn, front)
    deflection = drive.topic("/deflection")
    step_s = lambda wheel: float(
        deflection["t_s"][
            np.argmax(
                np.abs(
                    deflection[f"{wheel}.raw_counts"].astype(float)
                    - float(deflection[f"{wheel}.raw_counts"][0])
                )
                > 100
            )
        ]
    )
    tie = newtons * counts["fl"][:, 4]
    straight = np.median(tie[(time_s > 21) & (time_s < 24)])
    turned = np.max(np.abs(tie[time_s > 24] - straight))
    slopes = spring_slopes(drives.weighed)
    ratio = {axle: drives.prowler.to_dict()[axle]["strut"]["motion_ratio"] for axle in ("front", "rear")}
    held = [slopes[w] / (65_000.0 * ratio["front" if w[0] == "f" else "rear"]) for w in WHEELS]
    calibrated = drives.jackstand_calibrated
    t = calibrated.time_s("/estimate/contact_forces")
    end = t > t[-1] - 2.0
    loads = {w: float(np.mean(calibrated.force(w, "z", "estimate")[end])) for w in WHEELS}
    true = {w: float(drive.force(w, "z", "truth")[-1]) for w in WHEELS}
    return Made(
        figure=drawn,
        seen="Arm forces from counts less the zeros of <code>calibrate zero</code>. The virtual vehicle is steered on the ground only.",
        checks=[
            at_least("front lowered before the rear by", step_s("rl") - step_s("fl"), 2.0, "s"),
            at_least("tie rod while the wheels are turned on the ground", turned, 100.0, "N"),
            within(
                "load for a metre of the spring over k / 2.46 and k / 2.42 (lever of the hard-points), mean",
                float(np.mean(held)),
                0.9,
                1.1,
            ),
            at_most("the same over 2.3 k of 2.27", max(slopes.values()) / (2.3 * 65_000.0), 0.25),
            at_most(
                "estimated loads at the end, largest error",
                max(abs(loads[w] - true[w]) / true[w] for w in WHEELS) * 100,
                3.0,
                "%",
            ),
        ],
        today="On the scales, with 0 to 180 kg put in (manoeuvre weighed), a metre of the spring stands for "
        + ", ".join(f"{slopes[w] / 1000:.1f}" for w in WHEELS)
        + " kN of wheel load; 2.27 says 149.5. At rest on the ground the estimated loads are "
        + ", ".join(f"{loads[w]:.0f}" for w in WHEELS)
        + " N, the true ones "
        + ", ".join(f"{true[w]:.0f}" for w in WHEELS)
        + " N (front left, front right, rear left, rear right).",
    )
