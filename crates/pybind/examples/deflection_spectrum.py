"""Figure 3.6: frequency content of suspension deflection, on a road of class D at 8 m/s.

The shortest waves of the road, 0.35 m, end the spectrum at 23 Hz.
"""

import matplotlib.pyplot as plt
import numpy as np
from common import finish

import atvrec

STEP_S = 5e-4
SPEED_M_S = 8.0
JOUNCE = slice(12, 16)

vehicle = atvrec.Vehicle.builtin("prowler")
model = atvrec.FourteenDof(vehicle)
time_s = np.arange(0.0, 40.0, STEP_S)
position_m = SPEED_M_S * time_s
heights = np.stack(
    [
        atvrec.road_height_m("D", position_m + ahead_m, seed=side)
        for ahead_m in (vehicle.wheelbase_m, 0.0)
        for side in (1, 2)
    ],
    axis=1,
)
# Onto the road gently, from level ground.
heights *= np.minimum(time_s / 2.0, 1.0)[:, None]
inputs = np.tile(model.inputs(), (time_s.size, 1))
inputs[:, 12:16] = heights
inputs[:, 16:20] = np.gradient(heights, STEP_S, axis=0)
states = model.simulate(model.rolling(SPEED_M_S), inputs, STEP_S, every=20)
jounce_m = states[400:, JOUNCE]
rate_hz = 1.0 / (20 * STEP_S)

window = np.hanning(512)[:, None]
parts = [
    np.abs(np.fft.rfft((part - part.mean(axis=0)) * window, axis=0)) ** 2
    for part in (jounce_m[k : k + 512] for k in range(0, len(jounce_m) - 512, 256))
]
amplitude_mm = 1e3 * 2.0 * np.sqrt(np.mean(parts, axis=0)) / window.sum()
frequency_hz = np.fft.rfftfreq(512, 1.0 / rate_hz)

figure, axes = plt.subplots(figsize=(8, 5))
for wheel, name in enumerate(("front left", "front right", "rear left", "rear right")):
    axes.plot(frequency_hz, amplitude_mm[:, wheel], label=name)
axes.set(
    xlabel="frequency (Hz)",
    ylabel="wheel travel (mm)",
    title="3.6: suspension deflection, ISO 8608 class D at 8 m/s",
    xlim=(0, 30),
)
axes.legend()
finish(figure)
