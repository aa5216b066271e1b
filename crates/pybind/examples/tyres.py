"""Figures 2.2 and 2.14 to 2.17: tyre models, cornering stiffness, load and the friction circle."""

import matplotlib.pyplot as plt
import numpy as np
from common import finish

import atvrec

LOAD_N, FRICTION, STIFFNESS_N_RAD = 1831.0, 0.87, 8538.0
angle_rad = np.radians(np.linspace(-30.0, 30.0, 601))
angle_deg = np.degrees(angle_rad)


def tyre(law: str, stiffness_n_rad: float = STIFFNESS_N_RAD, **more: float) -> atvrec.Tyre:
    return atvrec.Tyre.physical(
        law,
        cornering_stiffness_n_rad=stiffness_n_rad,
        slip_stiffness_n=12_000.0,
        friction=FRICTION,
        **more,
    )


figure, ((models, stiffness), (load, circle)) = plt.subplots(2, 2, figsize=(11, 8.5))

for law in ("linear", "fiala", "exponential", "dugoff"):
    models.plot(angle_deg, tyre(law).forces(LOAD_N, angle_rad)["lateral_n"], label=law)
pacejka = atvrec.Tyre.magic_formula_89()
models.plot(angle_deg, pacejka.forces(LOAD_N, angle_rad)["lateral_n"], label="Pacejka, a car's")
models.set(title="2.2, 2.14: models, $F_z$ = 1831 N, µ = 0.87", ylim=(-2500, 2500))

for value_n_rad in (3_000.0, 6_000.0, 9_000.0, 15_000.0):
    forces = tyre("fiala", value_n_rad).forces(LOAD_N, angle_rad)
    stiffness.plot(angle_deg, forces["lateral_n"], label=f"{value_n_rad:.0f} N/rad")
stiffness.set(title="2.15: cornering stiffness, Fiala")

for value_n, colour in zip((500.0, 1000.0, 2000.0, 3000.0), ("C0", "C1", "C2", "C3"), strict=True):
    for law, style in (("pacejka", "-"), ("dugoff", "--")):
        if law == "dugoff":
            sensitive = tyre(law, reference_load_n=LOAD_N, load_exponent=0.75)
        else:
            sensitive = pacejka
        forces = sensitive.forces(value_n, angle_rad)
        load.plot(angle_deg, forces["lateral_n"], colour + style, label=f"{value_n:.0f} N, {law}")
load.set(title="2.16: load (Dugoff: C growing as $F_z^{0.75}$)")

slip_ratio = np.linspace(-1.0, 1.0, 401)
for angle in (0.0, 2.0, 5.0, 10.0, 20.0):
    forces = tyre("brush").forces(3000.0, np.radians(angle), slip_ratio)
    circle.plot(forces["longitudinal_n"], -forces["lateral_n"], label=f"{angle:.0f}°")
around = np.linspace(0.0, np.pi, 181)
limit_n = FRICTION * 3000.0
circle.plot(limit_n * np.cos(around), limit_n * np.sin(around), "k--", label="µ $F_z$")
circle.set(title="2.17: friction circle, $F_z$ = 3000 N", xlabel="$F_x$ (N)", ylabel="$-F_y$ (N)")
circle.set_aspect("equal")
circle.set_ylim(0.0, 4200.0)

for axes in (models, stiffness, load):
    axes.set(xlabel="slip angle (°)", ylabel="$F_y$ (N)")
    axes.legend(fontsize="small")
circle.legend(fontsize="small", ncols=3, loc="upper center")
finish(figure)
