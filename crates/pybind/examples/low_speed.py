"""Figure 2.3: the bicycle's yaw rate as the vehicle slows down to a crawl while it is steered.

The bicycle of equation 2.5 divides by the speed: below some speed its fastest mode outruns the
integrator's step. With relaxing tyres nothing is divided by the speed.
"""

import matplotlib.pyplot as plt
import numpy as np
from common import finish

import atvrec

STEP_S = 0.01
STEER_RAD = np.radians(5.0)
RELAXATION_M = 0.15

bicycle = atvrec.Bicycle(atvrec.Vehicle.builtin("prowler-table-2.3"))
time_s = np.arange(0.0, 10.0, STEP_S)
speed_m_s = np.interp(time_s, [0.0, 5.0, 6.0, 10.0], [5.0, 0.1, 0.1, 4.0])

yaw_rate = np.zeros((2, time_s.size))
plain, relaxed = np.zeros(2), np.zeros(4)
for index, speed in enumerate(speed_m_s):
    a, b = bicycle.system(speed)
    plain = np.clip(plain + STEP_S * (a @ plain + b * STEER_RAD), -10.0, 10.0)
    # The relaxed form is stiff only in the slip angles, with the constant V/sigma: step them well.
    for _ in range(10):
        a, b = bicycle.relaxed_system(speed, RELAXATION_M)
        relaxed = relaxed + 0.1 * STEP_S * (a @ relaxed + b * STEER_RAD)
    yaw_rate[:, index] = plain[1], relaxed[1]

figure, (rates, speeds) = plt.subplots(
    2, 1, sharex=True, figsize=(8, 6), height_ratios=(3, 1)
)
rates.plot(time_s, np.degrees(yaw_rate[0]), "C3", label="equation 2.5, steps of 10 ms")
rates.plot(time_s, np.degrees(yaw_rate[1]), "C0", label="with relaxation length")
rates.set(ylabel="yaw rate (°/s)", ylim=(-40, 40), title="2.3: the bicycle at low speed")
rates.legend()
speeds.plot(time_s, speed_m_s, "k")
speeds.set(xlabel="time (s)", ylabel="speed (m/s)")
finish(figure)
