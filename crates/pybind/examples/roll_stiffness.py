"""Figure 2.20: roll moment against roll angle, and the roll stiffness found from it.

A virtual vehicle is steered at random; the moment m_s h_1 a_y is regressed on roll angle, rate
and acceleration; without the last, as the thesis has it, the stiffness comes out 9 % low here.
The slope is the stiffness less m_s g h_1, since the lateral acceleration is the centre of
gravity's: what an accelerometer reads on the rolled body would give the stiffness itself.
"""

import matplotlib.pyplot as plt
import numpy as np
from common import finish

import atvrec

STEP_S = 0.002
GRAVITY_M_S2 = 9.80665

vehicle = atvrec.Vehicle.builtin("prowler")
model = atvrec.FourWheel(vehicle)
rng = np.random.default_rng(7)
time_s = np.arange(0.0, 40.0, STEP_S)
phases = rng.uniform(0.0, 2.0 * np.pi, 8)
steer_rad = sum(
    0.02 * np.sin(2.0 * np.pi * f * time_s + phase)
    for f, phase in zip(np.geomspace(0.05, 0.6, 8), phases, strict=True)
)
inputs = np.tile(model.inputs(drive_n_m=[0.0, 0.0, 15.0, 15.0]), (time_s.size, 1))
inputs[:, 0] = inputs[:, 1] = steer_rad
states = model.simulate(model.rolling(7.0), inputs, STEP_S)[:-1]
roll_rad, roll_rate_rad_s = states[:, 3], states[:, 4]
lateral_m_s2 = model.outputs(states, inputs)["lateral_m_s2"]

values = vehicle.to_dict()
mass_kg = vehicle.sprung_mass_kg
moment_n_m = mass_kg * vehicle.roll_arm_m * lateral_m_s2
roll_rad_s2 = model.derivative(states, inputs)[:, 4]
columns = np.stack([roll_rad, roll_rate_rad_s, roll_rad_s2, np.ones_like(roll_rad)], axis=1)
slope, damping, inertia, offset = np.linalg.lstsq(columns, moment_n_m, rcond=None)[0]
stiffness = slope + mass_kg * GRAVITY_M_S2 * vehicle.roll_arm_m
given = sum(values[axle]["roll_stiffness_n_m_rad"] for axle in ("front", "rear"))

figure, axes = plt.subplots(figsize=(8, 5.5))
axes.plot(np.degrees(roll_rad), moment_n_m, ".", ms=1, color="C0", label="simulated")
line_rad = np.array([roll_rad.min(), roll_rad.max()])
axes.plot(np.degrees(line_rad), slope * line_rad + offset, "C3", label="least squares")
axes.set(
    xlabel="roll angle (°)",
    ylabel="$m_s h_1 a_y$ (N m)",
    title=f"2.20: K = {stiffness:.0f} N m/rad found, {given:.0f} in the vehicle file",
)
axes.legend()
finish(figure)
