"""Figures 2.25 and 2.26: sideslip and yaw rate under sine steer, three models of one vehicle.

The thesis set its model against CarSim; here the 14-degree-of-freedom model stands in for it.

Sideslip is that of the vehicle over the ground, below its centre of gravity, where the bicycle's
and the four-wheel model's is. The state of the 14-degree-of-freedom model is the velocity of the
sprung part's centre of gravity, which swings sideways as the body rolls: for small angles at 0.3 Hz
and 6 m/s its own sideslip is 0.104 of the steer angle and leads the steer by 163 degrees, that on
the ground is 0.129 at 110 degrees (four wheels: 0.108 at 110; bicycle: 0.113 at 98).
"""

import matplotlib.pyplot as plt
import numpy as np
from common import finish

import atvrec

STEP_S = 5e-4
SPEED_M_S = 6.0
AMPLITUDE_RAD = np.radians(6.0)

vehicle = atvrec.Vehicle.builtin("prowler")
time_s = np.arange(0.0, 12.0, STEP_S)
steer_rad = np.where(time_s > 1.0, AMPLITUDE_RAD * np.sin(2 * np.pi * 0.3 * (time_s - 1.0)), 0.0)


def hold_speed(model, steer, speed_column, rows=40):
    """States with the rear wheels' torque set every 20 ms so that the speed stays."""
    state, kept, torque_n_m = model.rolling(SPEED_M_S), [], 0.0
    for first in range(0, steer.size, rows):
        torque_n_m = 300.0 * (SPEED_M_S - state[speed_column])
        inputs = np.tile(model.inputs(drive_n_m=[0.0, 0.0, torque_n_m, torque_n_m]), (rows, 1))
        inputs[:, 0] = inputs[:, 1] = steer[first : first + rows]
        states = model.simulate(state, inputs, STEP_S)
        kept.append(states[:-1])
        state = states[-1]
    return np.concatenate(kept)


bicycle_a, bicycle_b = atvrec.Bicycle(vehicle).system(SPEED_M_S)
linear = np.zeros((time_s.size, 2))
for index in range(time_s.size - 1):
    rate = bicycle_a @ linear[index] + bicycle_b * steer_rad[index]
    linear[index + 1] = linear[index] + STEP_S * rate
four = hold_speed(atvrec.FourWheel(vehicle), steer_rad, speed_column=0)
fourteen = hold_speed(atvrec.FourteenDof(vehicle), steer_rad, speed_column=6)

height_m, ahead_m_s, left_m_s, roll_rate_rad_s = fourteen[:, [2, 6, 7, 9]].T
ground_m_s = left_m_s + roll_rate_rad_s * height_m

figure, (sideslip, yaw) = plt.subplots(2, 1, sharex=True, figsize=(9, 7))
for name, beta, rate, style in (
    ("bicycle", linear[:, 0], linear[:, 1], "C2--"),
    ("four wheels", np.arctan2(four[:, 1], four[:, 0]), four[:, 2], "C0"),
    ("14 degrees of freedom", np.arctan2(ground_m_s, ahead_m_s), fourteen[:, 11], "C3"),
):
    sideslip.plot(time_s, np.degrees(beta), style, label=name)
    yaw.plot(time_s, np.degrees(rate), style, label=name)
sideslip.set(ylabel="sideslip (°)", title="2.25: sideslip, sine steer of 6° at 6 m/s")
yaw.set(ylabel="yaw rate (°/s)", xlabel="time (s)", title="2.26: yaw rate")
sideslip.legend()
finish(figure)
