#!/usr/bin/env python3
"""What a step of each vehicle model costs, from Rust, from Python, and of its peers, in one run.

Called by `scripts/bench-model`, which makes the environment. One core; the best of several rounds
counts, because other work on the machine only adds. `BENCH_RUNS` sets the size of a batch: on a busy
machine a small one fits between two of the scheduler's slices.
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

RUNS = int(os.environ.get("BENCH_RUNS", "10000"))
STEPS, STEP_S = 10, 1e-3
# About two million steps of each model, however large a batch is.
ROUNDS = max(2_000_000 // (RUNS * STEPS), 20)
SINGLE_ROUNDS = 300


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
    """A batch through the Python package."""
    model = kind(atvrec.Vehicle.builtin("prowler"))
    states = np.tile(model.rolling(6.0), (RUNS, 1))
    inputs = np.stack([model.inputs(0.1 * run / RUNS) for run in range(RUNS)])
    return best_ns(lambda: model.step(states, inputs, step_s, STEPS), RUNS * STEPS)


def ours_single(kind: type, step_s: float) -> float:
    """One run of 1,000 steps through the Python package."""
    model = kind(atvrec.Vehicle.builtin("prowler"))
    state, inputs = model.rolling(6.0), model.inputs(0.05)
    return best_ns(lambda: model.step(state, inputs, step_s, 1_000), 1_000, SINGLE_ROUNDS)


def rust(program: str, runs: int, steps: int, rounds: int) -> dict[str, float]:
    """The same runs by a Rust program."""
    command = [program, str(runs), str(steps), str(rounds)]
    told = json.loads(subprocess.check_output(command))
    return {name: value for name, value in told.items() if name.endswith("step_ns")}


def commonroad(multi_body: bool) -> float:
    """One RK4 step of commonroad-vehicle-models: single track with slip, or multi-body."""
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


def numba_bicycle() -> float:
    """The linear bicycle (beta, r) at constant speed, RK4, compiled by numba: the equations and the
    numbers of the Rust program's."""
    import numba

    bicycle = atvrec.Bicycle(atvrec.Vehicle.builtin("prowler"))
    a, b = bicycle.system(6.0)

    @numba.njit(cache=False, fastmath=False)
    def rollout(states, steers, a, b, steps, h):  # type: ignore[no-untyped-def]
        a00, a01, a10, a11 = a[0, 0], a[0, 1], a[1, 0], a[1, 1]
        for i in range(states.shape[0]):
            x, y = states[i]
            u, v = b[0] * steers[i], b[1] * steers[i]
            for _ in range(steps):
                k0, l0 = a00 * x + a01 * y + u, a10 * x + a11 * y + v
                p, q = x + 0.5 * h * k0, y + 0.5 * h * l0
                k1, l1 = a00 * p + a01 * q + u, a10 * p + a11 * q + v
                p, q = x + 0.5 * h * k1, y + 0.5 * h * l1
                k2, l2 = a00 * p + a01 * q + u, a10 * p + a11 * q + v
                p, q = x + h * k2, y + h * l2
                k3, l3 = a00 * p + a01 * q + u, a10 * p + a11 * q + v
                x += h / 6.0 * (k0 + 2.0 * k1 + 2.0 * k2 + k3)
                y += h / 6.0 * (l0 + 2.0 * l1 + 2.0 * l2 + l3)
            states[i] = x, y

    steers = np.linspace(0.0, 0.1, RUNS)
    start = np.zeros((RUNS, 2))
    return best_ns(lambda: rollout(start, steers, a, b, STEPS, STEP_S), RUNS * STEPS)


def numba_single_track() -> float:
    """A non-linear single track (u, v, r) with linear tyres, RK4, compiled by numba."""
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
    """The equations of our four-wheel model in JAX, vmapped and jitted: 19 states (planar motion,
    roll, pitch, relaxing slips, wheel spin), brush tyres whose stiffness grows with the load to the
    power of 3/4, load transfer by two passes."""
    import jax
    import jax.numpy as jnp

    mass, sprung, gravity = 644.0, 520.0, 9.80665
    inertia = jnp.array([213.0, 446.0, 454.0])
    a, b, track, mu = 0.839, 0.6081, 1.143, 0.87
    arm, pitch_arm, pitch_centre, roll_centre, unsprung = 0.4, 0.4, 0.1, 0.155, 12.0
    roll_k, roll_b = jnp.array([8026.0, 7326.0]), jnp.array([750.0, 750.0])
    pitch_k, pitch_b = 26_386.0, 2_500.0
    x = jnp.array([a, a, -b, -b])
    y = 0.5 * track * jnp.array([1.0, -1.0, 1.0, -1.0])
    cornering = jnp.array([5960.0, 5960.0, 9000.0, 9000.0])
    reference, slip_over = 1600.0, 3.2
    radius, spin_inertia, relaxation, resistance = 0.31, 0.6, 0.25, 0.02
    length, lever = a + b, sprung * arm
    matrix = jnp.array(
        [
            [mass, 0.0, -lever],
            [0.0, inertia[2], 0.0],
            [-lever, 0.0, inertia[0] + lever * arm],
        ]
    )
    inverse = jnp.linalg.inv(matrix)

    def loads(state, lateral, ahead, felt):  # type: ignore[no-untyped-def]
        phi, p, theta, q = state[3:7]
        pitch = (pitch_k * theta + pitch_b * q - ahead * pitch_centre) / length
        front = jnp.clip(mass * gravity * b / length + pitch, 0.0, mass * gravity)
        sums = jnp.array([front, mass * gravity - front])
        moved = roll_k * phi + roll_b * p + lateral * roll_centre + felt * unsprung * 0.15
        moved = jnp.clip(moved / track, -0.5 * sums, 0.5 * sums)
        pairs = jnp.stack([0.5 * sums - moved, 0.5 * sums + moved], axis=1)
        return pairs.reshape(4)

    def rate(state, inputs):  # type: ignore[no-untyped-def]
        steer, drive, brake, bank, grade, grip, stiff = inputs
        u, v, r, phi, p, theta, q = state[:7]
        tangent, ratio, spin = state[7:11], state[11:15], state[15:19]
        delta = steer * jnp.array([1.0, 1.0, 0.0, 0.0])
        sin, cos = jnp.sin(delta), jnp.cos(delta)
        along, across = u - r * y, v + r * x
        rolling, sliding = along * cos + across * sin, across * cos - along * sin
        pull_x, pull_y = slip_over * ratio, -tangent
        amount = jnp.sqrt(jnp.maximum(pull_x**2 + pull_y**2, 1e-60))
        roll_moment = (
            lever * gravity * jnp.sin(phi) - roll_k.sum() * phi - roll_b.sum() * p
        )
        felt = u * r + gravity * jnp.sin(bank)
        lateral = felt * mass * jnp.array([b, a]) / length
        ahead = 0.0
        for _ in range(2):
            load = loads(state, lateral, ahead, felt)
            growth = jnp.maximum(load / reference, 1e-12) ** 0.75
            stiffness = cornering * growth * stiff
            part = stiffness * amount / (3.0 * mu * grip * jnp.maximum(load, 1e-9))
            factor = jnp.where(part < 1.0, 1.0 - part + part**2 / 3.0, 1.0 / (3.0 * part))
            force = jnp.where(load > 0.0, stiffness * factor, 0.0)
            fx, fy = force * pull_x, force * pull_y
            body_x, body_y = fx * cos - fy * sin, fx * sin + fy * cos
            ahead = body_x.sum()
            lateral = body_y.reshape(2, 2).sum(axis=1)
            turning = (x * body_y - y * body_x).sum()
            solved = inverse @ jnp.array([lateral.sum(), turning, roll_moment])
            felt = solved[0]
        load = loads(state, lateral, ahead, felt)
        felt_x = (ahead - 0.3 * u * jnp.abs(u)) / mass
        pitch = (
            -sprung * pitch_arm * felt_x
            + sprung * gravity * pitch_arm * jnp.sin(theta)
            - pitch_k * theta
            - pitch_b * q
        ) / (inertia[1] + sprung * pitch_arm**2)
        turn = jnp.clip(spin / 0.3, -1.0, 1.0)
        turn = turn * (15.0 - 10.0 * turn**2 + 3.0 * turn**4) / 8.0
        torque = drive - (brake + load * resistance * radius) * turn - fx * radius
        return jnp.concatenate(
            [
                jnp.array(
                    [
                        felt_x + gravity * jnp.sin(grade) + v * r,
                        felt - gravity * jnp.sin(bank) - u * r,
                        solved[1],
                        p,
                        solved[2],
                        q,
                        pitch,
                    ]
                ),
                (sliding - jnp.abs(rolling) * tangent) / relaxation,
                (spin * radius - rolling - jnp.abs(rolling) * ratio) / relaxation,
                torque / spin_inertia,
            ]
        )

    def step(state, inputs):  # type: ignore[no-untyped-def]
        h = STEP_S
        k1 = rate(state, inputs)
        k2 = rate(state + 0.5 * h * k1, inputs)
        k3 = rate(state + 0.5 * h * k2, inputs)
        k4 = rate(state + h * k3, inputs)
        return state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def run(state, inputs):  # type: ignore[no-untyped-def]
        return jax.lax.fori_loop(0, STEPS, lambda _, s: step(s, inputs), state)

    batch = jax.jit(jax.vmap(run))
    start = jnp.zeros(19).at[0].set(6.0).at[15:].set(6.0 / radius)
    states = jnp.tile(start, (RUNS, 1))
    wheels = jnp.ones((RUNS, 4))
    inputs = (
        jnp.linspace(0.0, 0.1, RUNS),
        0.0 * wheels,
        0.0 * wheels,
        jnp.zeros(RUNS),
        jnp.zeros(RUNS),
        wheels,
        wheels,
    )
    end = np.asarray(batch(states, inputs))
    if not (np.isfinite(end).all() and end[-1, 2] > end[0, 2]):
        raise ValueError("the JAX model does not turn as it is steered")
    return best_ns(lambda: batch(states, inputs).block_until_ready(), RUNS * STEPS)


def main() -> None:
    # Name, states, tyres, reference of the ratio, measurement.
    four, fourteen, bicycle = "four-wheel", "14-DOF", "bicycle"
    rows: list[tuple[str, str, str, str, Callable[[], float]]] = []
    if len(sys.argv) > 1:
        told = rust(sys.argv[1], RUNS, STEPS, ROUNDS)
        alone = rust(sys.argv[1], 1, 1_000, SINGLE_ROUNDS)
        rows += [
            ("four-wheel, Rust batch", "19", "brush", four, lambda: told["step_ns"]),
            ("14-DOF, Rust batch", "32", "brush", fourteen, lambda: told["fourteen_dof_step_ns"]),
            ("four-wheel, Rust, one run", "19", "brush", four, lambda: alone["step_ns"]),
            ("14-DOF, Rust, one run", "32", "brush", fourteen, lambda: alone["fourteen_dof_step_ns"]),
            ("linear bicycle, Rust batch", "2", "linear", bicycle, lambda: told["bicycle_step_ns"]),
        ]
    rows += [
        ("four-wheel, Python batch", "19", "brush", four, lambda: ours(atvrec.FourWheel, 1e-3)),
        ("four-wheel, JAX batch", "19", "brush", four, jax_four_wheel),
        ("single track, numba batch", "3", "linear", four, numba_single_track),
        ("linear bicycle, numba batch", "2", "linear", bicycle, numba_bicycle),
        ("14-DOF, Python batch", "32", "brush", fourteen, lambda: ours(atvrec.FourteenDof, 5e-4)),
        ("four-wheel, Python, one run", "19", "brush", four, lambda: ours_single(atvrec.FourWheel, 1e-3)),
        ("14-DOF, Python, one run", "32", "brush", fourteen, lambda: ours_single(atvrec.FourteenDof, 5e-4)),
        ("single track, commonroad, one run", "9", "MF", four, lambda: commonroad(False)),
        ("multi-body, commonroad, one run", "29", "MF", fourteen, lambda: commonroad(True)),
    ]
    print(f"RK4 steps on one core, batches of {RUNS} runs of {STEPS} steps, best of {ROUNDS} rounds")
    heading = f"{'model':36} {'states':>6} {'tyres':>7} {'ns a step':>12}   against our batch"
    print(heading, flush=True)
    reference: dict[str, tuple[str, float]] = {}
    for name, states, tyres, kind, measure in rows:
        try:
            step_ns = measure()
        except ImportError as error:
            print(f"{name:36} {states:>6} {tyres:>7} {'-':>12}   not installed: {error}")
            continue
        reference.setdefault(kind, (name, step_ns))
        base, base_ns = reference[kind]
        against = "" if base == name else f"{step_ns / base_ns:.2f} x {base}"
        print(f"{name:36} {states:>6} {tyres:>7} {step_ns:12.1f}   {against}", flush=True)


if __name__ == "__main__":
    main()
