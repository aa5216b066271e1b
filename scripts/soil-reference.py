#!/usr/bin/env python3
"""Reference numbers of crates/model/src/road/soil.rs: a rigid wheel on soft soil.

The stresses of Wong and Reece are integrated here over the horizontal distance x = R sin(t) instead
of the angle, with adaptive quadrature, and the sinkage is found by Brent's method. Prints one row for
each soil and slip: load, sinkage, thrust, resistance, torque.
"""

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

# n, k_c in kN/m^(n+1), k_phi in kN/m^(n+2), c in kPa, phi in degrees, K in cm
SOILS = {
    "sand": (1.1, 0.99, 1528.43, 1.04, 28.0, 2.5),
    "loam": (0.7, 5.27, 1515.04, 1.72, 29.0, 1.0),
    "clay": (0.5, 13.19, 692.15, 4.14, 13.0, 0.6),
    "snow": (1.6, 4.37, 196.72, 1.03, 19.7, 4.0),
}
RADIUS, WIDTH = 0.31, 0.20
# N; deep snow does not carry more before the hub sinks in.
LOADS = {"sand": 1500.0, "loam": 1500.0, "clay": 1500.0, "snow": 500.0}


def forces(soil, sinkage, slip):
    n, kc, kphi, c, phi, shear = soil
    contact = np.sqrt(RADIUS**2 - (RADIUS - sinkage) ** 2)
    peak = RADIUS * np.sin((0.18 + 0.32 * slip) * np.arcsin(contact / RADIUS))
    first, top = np.arcsin(contact / RADIUS), np.arcsin(peak / RADIUS)

    def stresses(x):
        angle = np.arcsin(x / RADIUS)
        deep = angle if x >= peak else first - angle * (first - top) / top
        z = max(RADIUS * np.cos(deep) - (RADIUS - sinkage), 0.0)
        radial = 1e3 * (kc / WIDTH + kphi) * z**n
        j = RADIUS * (first - angle) - (1.0 - slip) * (contact - x)
        strength = 1e3 * c + radial * np.tan(np.radians(phi))
        return radial, strength * np.sign(j) * (1.0 - np.exp(-abs(j) / (shear / 100)))

    # dx = R cos(t) dt, so that R cos(t) dt = dx and R sin(t) dt = tan(t) dx.
    def tangent(x):
        return x / np.sqrt(RADIUS**2 - x**2)

    def over(f):
        parts = [(0.0, peak), (peak, contact)]
        return WIDTH * sum(quad(f, a, b, epsrel=1e-10, limit=200)[0] for a, b in parts)

    load = over(lambda x: stresses(x)[0] + stresses(x)[1] * tangent(x))
    thrust = over(lambda x: stresses(x)[1])
    resistance = over(lambda x: stresses(x)[0] * tangent(x))
    torque = RADIUS * over(lambda x: stresses(x)[1] * np.sqrt(1.0 + tangent(x) ** 2))
    return load, thrust, resistance, torque


for name, soil in SOILS.items():
    load = LOADS[name]
    for slip in (0.0, 0.1, 0.3, 0.6):
        sinkage = brentq(lambda z: forces(soil, z, slip)[0] - load, 1e-4, 0.3)
        _, thrust, resistance, torque = forces(soil, sinkage, slip)
        print(f'("{name}", {load}, {slip}, {sinkage:.5f}, {thrust:.1f}, {resistance:.1f}, {torque:.2f}),')
