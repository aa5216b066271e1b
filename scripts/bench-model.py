#!/usr/bin/env python3
"""What a step of each vehicle model costs, from Rust, from Python, and of its peers, in one run.

Called by `scripts/bench-model`, which makes the environment. One core; the best of several rounds
counts, because other work on the machine only adds.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable

os.environ.setdefault("RAYON_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")
os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)
os.environ.setdefault("JAX_ENABLE_X64", "1")

import numpy as np

import atvrec

# Each measurement is shorter than a scheduler's slice.
RUNS, STEPS, STEP_S = 200, 10, 1e-3
ROUNDS = 300


def best_ns(work: Callable[[], object], steps: int, rounds: int = ROUNDS) -> float:
    """Shortest time of a step over all rounds, ns; the first call, which may compile, is not one."""
    work()
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times) / steps * 1e9


def ours(kind: type, step_s: float) -> float:
    model = kind(atvrec.Vehicle.builtin("prowler"))
    states = np.tile(model.rolling(6.0), (RUNS, 1))
    inputs = np.stack([model.inputs(0.1 * run / RUNS) for run in range(RUNS)])
    return best_ns(lambda: model.step(states, inputs, step_s, STEPS), RUNS * STEPS)


def rust(program: str) -> float:
    """The four-wheel model over the same states, by a Rust program."""
    command = [program, str(RUNS), str(STEPS)]
    runs = [json.loads(subprocess.check_output(command)) for _ in range(ROUNDS)]
    return float(min(run["step_ns"] for run in runs))


def commonroad(multi_body: bool) -> float:
    """One RK4 step of commonroad-vehicle-models: single track with slip, or multi-body (29 states)."""
    from vehiclemodels.init_mb import init_mb
    from vehiclemodels.init_std import init_std
    from vehiclemodels.parameters_vehicle1 import parameters_vehicle1
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
    from vehiclemodels.vehicle_dynamics_std import vehicle_dynamics_std

    parameters = parameters_vehicle1()
    core = [0.0, 0.0, 0.02, 10.0, 0.0, 0.0, 0.0]
    state = init_mb(core, parameters) if multi_body else init_std(core, parameters)
    rate = vehicle_dynamics_mb if multi_body else vehicle_dynamics_std
    inputs, h = [0.01, 0.0], STEP_S

    def step() -> None:
        x = np.array(state)
        for _ in range(20):
            k1 = np.array(rate(x, inputs, parameters))
            k2 = np.array(rate(x + 0.5 * h * k1, inputs, parameters))
            k3 = np.array(rate(x + 0.5 * h * k2, inputs, parameters))
            k4 = np.array(rate(x + h * k3, inputs, parameters))
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    return best_ns(step, 20, 20)


def numba_single_track() -> float:
    """A single track (u, v, r) with linear tyres, RK4, compiled by numba."""
    import numba

    @numba.njit(cache=False)
    def rate(u, v, r, steer):  # type: ignore[no-untyped-def]
        front = np.arctan2(v + 0.839 * r, u) - steer
        rear = np.arctan2(v - 0.6081 * r, u)
        fy, ry = -5975.0 * front, -17076.0 * rear
        return (
            v * r - fy * np.sin(steer) / 644.0,
            (fy * np.cos(steer) + ry) / 644.0 - u * r,
            (0.839 * fy * np.cos(steer) - 0.6081 * ry) / 1279.0,
        )

    @numba.njit(cache=False)
    def rollout(states, steers, steps, h):  # type: ignore[no-untyped-def]
        for i in range(states.shape[0]):
            u, v, r = states[i]
            s = steers[i]
            for _ in range(steps):
                a = rate(u, v, r, s)
                b = rate(u + 0.5 * h * a[0], v + 0.5 * h * a[1], r + 0.5 * h * a[2], s)
                c = rate(u + 0.5 * h * b[0], v + 0.5 * h * b[1], r + 0.5 * h * b[2], s)
                d = rate(u + h * c[0], v + h * c[1], r + h * c[2], s)
                u += h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
                v += h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
                r += h / 6.0 * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2])
            states[i] = u, v, r

    steers = np.linspace(0.0, 0.1, RUNS)
    start = np.tile([6.0, 0.0, 0.0], (RUNS, 1))
    return best_ns(lambda: rollout(start.copy(), steers, STEPS, STEP_S), RUNS * STEPS)


def jax_four_wheel() -> float:
    """A four-wheel model in JAX, batched: planar motion and roll, load transfer, Fiala tyres (5
    states, where ours has 19 with wheel spin and relaxation)."""
    import jax
    import jax.numpy as jnp

    m, inertia_z, inertia_x, h_s, stiffness, damping = 644.0, 454.0, 213.0, 0.4, 15_350.0, 1_500.0
    a, b, track, gravity, mu = 0.839, 0.6081, 1.2, 9.80665, 0.87
    x = jnp.array([a, a, -b, -b])
    y = jnp.array([0.5, -0.5, 0.5, -0.5]) * track
    static = m * gravity / (2.0 * (a + b)) * jnp.array([b, b, a, a])
    cornering = jnp.array([2987.5, 2987.5, 8538.0, 8538.0])

    def rate(state, steer):  # type: ignore[no-untyped-def]
        u, v, r, phi, p = state
        delta = steer * jnp.array([1.0, 1.0, 0.0, 0.0])
        alpha = jnp.arctan2(v + r * x, u - r * y) - delta
        moment = 0.5 * (stiffness * phi + damping * p) / track
        load = jnp.maximum(static + moment * jnp.array([-1.0, 1.0, -1.0, 1.0]), 1.0)
        part = jnp.minimum(cornering * jnp.abs(jnp.tan(alpha)) / (3.0 * mu * load), 1.0)
        force = -mu * load * (1.0 - (1.0 - part) ** 3) * jnp.sign(alpha)
        fx, fy = -force * jnp.sin(delta), force * jnp.cos(delta)
        lateral = fy.sum() / m
        roll = m * h_s * (lateral + gravity * jnp.sin(phi)) - stiffness * phi - damping * p
        return jnp.array(
            [
                v * r + fx.sum() / m,
                lateral - u * r,
                (x * fy - y * fx).sum() / inertia_z,
                p,
                roll / (inertia_x + m * h_s**2),
            ]
        )

    def step(state, steer):  # type: ignore[no-untyped-def]
        h = STEP_S
        k1 = rate(state, steer)
        k2 = rate(state + 0.5 * h * k1, steer)
        k3 = rate(state + 0.5 * h * k2, steer)
        k4 = rate(state + h * k3, steer)
        return state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def run(state, steer):  # type: ignore[no-untyped-def]
        return jax.lax.fori_loop(0, STEPS, lambda _, s: step(s, steer), state)

    batch = jax.jit(jax.vmap(run))
    states = jnp.tile(jnp.array([6.0, 0.0, 0.0, 0.0, 0.0]), (RUNS, 1))
    steers = jnp.linspace(0.0, 0.1, RUNS)
    return best_ns(lambda: batch(states, steers).block_until_ready(), RUNS * STEPS)


def main() -> None:
    rows: list[tuple[str, Callable[[], float]]] = [
        ("four-wheel (19 states), Python batch", lambda: ours(atvrec.FourWheel, 1e-3)),
        ("14 degrees of freedom (32), Python batch", lambda: ours(atvrec.FourteenDof, 5e-4)),
        ("commonroad single track, Python", lambda: commonroad(False)),
        ("commonroad multi-body, Python", lambda: commonroad(True)),
        ("single track (3), numba batch", numba_single_track),
        ("four-wheel (5), JAX batch", jax_four_wheel),
    ]
    if len(sys.argv) > 1:
        rows.insert(0, ("four-wheel (19 states), Rust", lambda: rust(sys.argv[1])))
    print(f"RK4 steps on one core, {RUNS} runs of {STEPS} steps, best of several rounds")
    print(f"{'model':44} {'ns a step':>12} {'against ours':>13}")
    reference = None
    for name, measure in rows:
        try:
            step_ns = measure()
        except ImportError as error:
            print(f"{name:44} {'-':>12}   not installed: {error}")
            continue
        if name.startswith("four-wheel (19") and "Python" in name:
            reference = step_ns
        ratio = f"{step_ns / reference:12.2f}x" if reference else ""
        print(f"{name:44} {step_ns:12.1f} {ratio:>13}", flush=True)


if __name__ == "__main__":
    main()
