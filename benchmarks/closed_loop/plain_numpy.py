"""The observer and one EM iteration in plain NumPy, as one would write them down: the yardstick.

Written apart from the package, so that it checks it too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sysid_vehicle.lab import ObserverCar, ObserverRecord

DT = 0.01


def held_response(J: np.ndarray) -> np.ndarray:
    """Integral of exp(J s) over one sample: power series over a part of it, doubled."""
    parts = max(0, int(np.ceil(np.log2(np.abs(J).sum() * DT / 0.1 + 1e-9))))
    h = DT / 2**parts
    term = out = h * np.eye(3)
    for i in range(2, 9):
        term = J @ term * (h / i)
        out = out + term
    for _ in range(parts):
        out = out @ (2.0 * np.eye(3) + J @ out)
    return out


@dataclass
class Pass:
    """What a pass of the filter leaves behind."""

    log_likelihood: float = 0.0
    A: list[np.ndarray] = field(default_factory=list)
    offset: list[np.ndarray] = field(default_factory=list)  # predicted = A before + offset
    H: list[np.ndarray] = field(default_factory=list)
    error: list[np.ndarray] = field(default_factory=list)  # reading - H predicted - its offset
    predicted: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    updated: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)


class Plain:
    """Corrected or published observer of one record."""

    def __init__(self, car: ObserverCar, record: ObserverRecord, published: bool) -> None:
        self.car, self.u, self.y = car, record.inputs(), record.readings
        self.published = published

    def coefficients(self, v: float, u: np.ndarray) -> tuple[float, float, float, float]:
        c, s = self.car, max(v, 1.0)
        f, r = u[2], u[3]
        turn = f * c.lf_m - r * c.lr_m
        return (
            -(f + r) / (c.mass_kg * s),
            -turn / (c.mass_kg * s),
            -turn / (c.yaw_inertia_kgm2 * s),
            -(f * c.lf_m**2 + r * c.lr_m**2) / (c.yaw_inertia_kgm2 * s),
        )

    def predict(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c = self.car
        y_v, y_r, n_v, n_r = self.coefficients(x[0], u)
        G = np.diag([1 / c.mass_kg, 1 / c.mass_kg, 1 / c.yaw_inertia_kgm2])
        J = np.array([[-c.drag_nspm / c.mass_kg, 0, 0], [0, y_v, y_r - x[0]], [0, n_v, n_r]])
        rate = J @ x[:3] + G @ (x[3:] + np.array([u[0], u[2] * u[1], u[2] * c.lf_m * u[1]]))
        response = DT * np.eye(3)
        if not self.published:
            rate[0] += x[1] * x[2]
            slope = -1.0 / x[0] if x[0] > 1.0 else 0.0
            J[0, 1:] = x[2], x[1]
            J[1, 0] = slope * (y_v * x[1] + y_r * x[2]) - x[2]
            J[2, 0] = slope * (n_v * x[1] + n_r * x[2])
            response = held_response(J)
        A = np.eye(6)
        A[:3, :3] += J @ response
        A[:3, 3:] = response @ G
        return np.concatenate([x[:3] + response @ rate, x[3:]]), A

    def observe(self, v: float, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        m = self.car.mass_kg
        y_v, y_r, _, _ = self.coefficients(v, u)
        H = np.zeros((4, 6))
        H[:3, :3] = np.eye(3)
        H[3, [1, 2, 4]] = y_v, y_r, 1 / m
        y = H @ x
        if not self.published:
            y[3] += u[2] * u[1] / m
            H[3, 0] = -(y_v * x[1] + y_r * x[2]) / x[0] if x[0] > 1.0 else 0.0
        return y, H

    def forward(
        self, x: np.ndarray, P: np.ndarray, Q: np.ndarray, R: np.ndarray, *, keep: bool = True
    ) -> Pass:
        """Run the filter in Joseph's form."""
        out = Pass()
        for k, y in enumerate(self.y):
            v = x[0]
            if self.published or k > 0:
                before = x
                x, A = self.predict(x, self.u[k if self.published else k - 1])
                P = A @ P @ A.T + Q
            else:
                before, A = x, np.eye(6)
            expected, H = self.observe(v if self.published else x[0], x, self.u[k])
            if keep:
                out.A.append(A)
                out.offset.append(x - A @ before)
                out.H.append(H)
                out.error.append(y - expected + H @ x)
                out.predicted.append((x, P))
            S = H @ P @ H.T + R
            K = np.linalg.solve(S, H @ P).T
            e = y - expected
            L = np.eye(6) - K @ H
            x, P = x + K @ e, L @ P @ L.T + K @ R @ K.T
            if keep:
                out.updated.append((x, P))
            _, log_det = np.linalg.slogdet(S)
            out.log_likelihood -= 0.5 * (
                e @ np.linalg.solve(S, e) + log_det + 4 * np.log(2 * np.pi)
            )
        return out

    def em_iteration(
        self, x: np.ndarray, P: np.ndarray, Q: np.ndarray, R: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Run filter, smoother and both maximisations; the variances found."""
        run = self.forward(x, P, Q, R)
        n = len(self.y)
        xs, Ps = run.updated[-1]
        new_Q, new_R = np.zeros((6, 6)), np.zeros((4, 4))
        for k in range(n - 1, -1, -1):
            if self.published:
                _, H = self.observe(xs[0], xs, self.u[k])
                e = self.y[k] - H @ xs
            else:
                H = run.H[k]
                e = run.error[k] - H @ xs
            new_R += np.outer(e, e) + H @ Ps @ H.T
            if k == 0:
                break
            (xf, Pf), (xp, Pp) = run.updated[k - 1], run.predicted[k]
            # The published smoother uses the matrix one sample late and a ridge.
            late = run.A[k - 1] if self.published else run.A[k]
            ridge = 1e-9 if self.published else 0.0
            J = np.linalg.solve(Pp + ridge * np.eye(6), late @ Pf).T
            xb, Pb = xf + J @ (xs - xp), Pf + J @ (Ps - Pp) @ J.T
            if self.published:
                expected, A = self.predict(xb, self.u[k - 1])
            else:
                A = run.A[k]
                expected = A @ xb + run.offset[k]
            w = xs - expected
            mixed = Ps @ J.T @ A.T
            new_Q += np.outer(w, w) + Ps + A @ Pb @ A.T - mixed - mixed.T
            xs, Ps = xb, Pb
        return run.log_likelihood, np.diag(new_Q) / (n - 1), np.diag(new_R) / n
