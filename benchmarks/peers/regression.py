"""A tyre regression by several libraries: half the sum of squares, its gradient, and J^T J.

a_y = (F_yf + F_yr) / m and dr/dt = (l_f F_yf - l_r F_yr) / I_z, Magic Formulas of both axles at
known slip angles and loads; eight parameters, two residuals a sample.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_vehicle import _core

MASS_KG, INERTIA_KGM2, LF_M, LR_M = 1500.0, 2500.0, 1.2, 1.5
P = np.array([10.0, 1.4, 1.0, 0.1, 11.0, 1.4, 1.0, 0.1])

Result = tuple[Any, Any, Any]
Work = Callable[[], Result]


@dataclass(frozen=True, eq=False)
class Data:
    """Motion: v_x, v_y, r, steering angle, loads of both axles. Readings: a_y, dr/dt."""

    motion: np.ndarray
    readings: np.ndarray

    @classmethod
    def random(cls, samples: int) -> Data:
        some = np.random.default_rng(0)
        columns = [some.normal(c, w, samples) for c, w in ((25, 5), (0, 0.5), (0, 0.3), (0, 0.05))]
        loads = [some.uniform(5000.0, 9000.0, samples) for _ in range(2)]
        return cls(np.column_stack([*columns, *loads]), some.normal(size=(samples, 2)))

    def core(self) -> Work:
        car = _core.VehicleData()
        car.mass_kg, car.lf_m, car.lr_m = MASS_KG, LF_M, LR_M
        ones = np.ones_like(self.readings)
        loss = _core.TyreLoss(car, INERTIA_KGM2, False, self.motion, self.readings, ones)
        p = np.array([*P, 0, 0, 0, 1, 1, 0])
        return lambda: loss.normal_equations(p, None, list(range(8)))

    def axles(self) -> tuple[np.ndarray, ...]:
        """Slip angles, and what a unit of friction of each axle gives to both readings."""
        vx, vy, r, steer, front, rear = self.motion.T
        vx = np.maximum(vx, 1.0)
        return (
            steer - np.arctan2(vy + LF_M * r, vx),
            -np.arctan2(vy - LR_M * r, vx),
            front / MASS_KG,
            rear / MASS_KG,
            LF_M * front / INERTIA_KGM2,
            -LR_M * rear / INERTIA_KGM2,
        )


def with_numpy(data: Data) -> Work:
    alpha_f, alpha_r, *shares = data.axles()
    both = np.array(shares).reshape(2, 2, -1)  # reading, axle

    def curve(alpha: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        b, c, d, e = p
        x = b * alpha
        bend = x - np.arctan(x)
        y = x - e * bend
        phi = c * np.arctan(y)
        force, slope = d * np.sin(phi), d * np.cos(phi)
        by_y = slope * c / (1.0 + y * y)
        by_x = by_y * (1.0 - e * x * x / (1.0 + x * x))
        return force, np.stack([by_x * alpha, slope * np.arctan(y), np.sin(phi), -by_y * bend])

    def work() -> Result:
        (front, df), (rear, dr) = curve(alpha_f, P[:4]), curve(alpha_r, P[4:])
        error, jacobian = [], []
        for k in range(2):
            error.append(data.readings[:, k] - both[k, 0] * front - both[k, 1] * rear)
            jacobian.append(np.vstack([both[k, 0] * df, both[k, 1] * dr]))
        e, j = np.concatenate(error), np.hstack(jacobian)
        return 0.5 * e @ e, j @ e, j @ j.T

    return work


def with_numba(data: Data) -> Work:
    import numba

    @numba.njit(cache=False)
    def work(alpha, shares, readings, p):
        half, slope, squares = 0.0, np.zeros(8), np.zeros((8, 8))
        j = np.zeros((2, 8))
        for k in range(len(readings)):
            error = np.empty(2)
            error[0], error[1] = readings[k, 0], readings[k, 1]
            for axle in range(2):
                b, c, d, e = p[4 * axle], p[4 * axle + 1], p[4 * axle + 2], p[4 * axle + 3]
                x = b * alpha[axle, k]
                bend = x - np.arctan(x)
                y = x - e * bend
                bent = np.arctan(y)
                sine, cosine = np.sin(c * bent), np.cos(c * bent)
                by_y = d * cosine * c / (1.0 + y * y)
                by_x = by_y * (1.0 - e * x * x / (1.0 + x * x))
                for i in range(2):
                    share = shares[i, axle, k]
                    error[i] -= share * d * sine
                    j[i, 4 * axle] = share * by_x * alpha[axle, k]
                    j[i, 4 * axle + 1] = share * d * cosine * bent
                    j[i, 4 * axle + 2] = share * sine
                    j[i, 4 * axle + 3] = -share * by_y * bend
            for i in range(2):
                half += 0.5 * error[i] ** 2
                for a in range(8):
                    slope[a] += j[i, a] * error[i]
                    for b_ in range(a + 1):
                        squares[a, b_] += j[i, a] * j[i, b_]
        for a in range(8):
            for b_ in range(a):
                squares[b_, a] = squares[a, b_]
        return half, slope, squares

    alpha_f, alpha_r, *shares = data.axles()
    alpha, both = np.stack([alpha_f, alpha_r]), np.array(shares).reshape(2, 2, -1)
    return lambda: work(alpha, both, data.readings, P)


def with_jax(data: Data) -> Work:
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    alpha_f, alpha_r, *shares = (jnp.asarray(a) for a in data.axles())
    readings = jnp.asarray(data.readings)

    def curve(alpha: Any, p: Any) -> Any:
        x = p[0] * alpha
        return p[2] * jnp.sin(p[1] * jnp.arctan(x - p[3] * (x - jnp.arctan(x))))

    def errors(p: Any) -> Any:
        front, rear = curve(alpha_f, p[:4]), curve(alpha_r, p[4:])
        lateral = readings[:, 0] - shares[0] * front - shares[1] * rear
        return jnp.concatenate([lateral, readings[:, 1] - shares[2] * front - shares[3] * rear])

    @jax.jit
    def work(p: Any) -> Any:
        e, j = errors(p), -jax.jacfwd(errors)(p)
        return 0.5 * e @ e, j.T @ e, j.T @ j

    return lambda: jax.block_until_ready(work(P))


def with_casadi(data: Data) -> Work:
    import casadi

    p, known, reading = casadi.SX.sym("p", 8), casadi.SX.sym("known", 6), casadi.SX.sym("y", 2)

    def curve(alpha: Any, q: Any) -> Any:
        x = q[0] * alpha
        return q[2] * casadi.sin(q[1] * casadi.atan(x - q[3] * (x - casadi.atan(x))))

    front, rear = curve(known[0], p[:4]), curve(known[1], p[4:])
    error = reading - casadi.vertcat(
        known[2] * front + known[3] * rear, known[4] * front + known[5] * rear
    )
    j = -casadi.jacobian(error, p)
    one = casadi.Function(
        "one", [p, known, reading], [0.5 * casadi.sumsqr(error), j.T @ error, j.T @ j]
    )
    fixed, readings = casadi.DM(np.array(data.axles())), casadi.DM(data.readings.T)
    total = one.map("total", "serial", len(data.readings), [0], [0, 1, 2])

    def work() -> Result:
        half, slope, squares = total(P, fixed, readings)
        return float(half), np.array(slope).ravel(), np.array(squares)

    return work


PEERS: dict[str, Callable[[Data], Work]] = {
    "numpy": with_numpy,
    "numba": with_numba,
    "jax": with_jax,
    "casadi": with_casadi,
}
