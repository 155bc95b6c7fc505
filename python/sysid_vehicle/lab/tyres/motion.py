"""A motion that is taken as known, for regressions of tyre coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ... import _core
from ..._common.arrays import FloatArray, as_float64, filled
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput
from .data import GreyBoxVehicle, TyreLog

_COLUMNS = ("vx_mps", "vy_mps", "yaw_rate_radps", "steer_rad", "fz_front_n", "fz_rear_n")


@dataclass(frozen=True, eq=False)
class TyreMotion:
    """What the tyres did and what they had to explain, as a smoother or the truth gives it.

    Parameters
    ----------
    motion : array, shape (n, 6)
        v_x, v_y [m/s], yaw rate [rad/s], road-wheel angle [rad], axle loads front and rear [N].
    ay_mps2 : array, shape (n,)
        Lateral acceleration to explain.
    ay_variance : array, shape (n,), optional
        Of `ay_mps2`; ones where it is left out.
    yaw_acc_radps2 : array, shape (n,), optional
        Yaw acceleration to explain, for the loss that uses it.
    """

    motion: FloatArray
    ay_mps2: FloatArray
    ay_variance: FloatArray | None = None
    yaw_acc_radps2: FloatArray | None = None

    @typed_fields
    def __post_init__(self) -> None:
        motion = as_float64(self.motion)
        if motion.ndim != 2 or motion.shape[1] != len(_COLUMNS):
            raise InvalidInput(
                f"motion has shape {motion.shape}; expected (n, 6): {', '.join(_COLUMNS)}"
            )
        object.__setattr__(self, "motion", motion)
        for i, name in enumerate(_COLUMNS):
            _finite(name, motion[:, i])
        for name in ("ay_mps2", "ay_variance", "yaw_acc_radps2"):
            values = getattr(self, name)
            if values is None:
                continue
            values = as_float64(values)
            object.__setattr__(self, name, values)
            if values.shape != (len(motion),):
                raise InvalidInput(
                    f"{name} has shape {values.shape}; expected one value for each of the "
                    f"{len(motion)} samples"
                )
            _finite(name, values)

    @classmethod
    @typed
    def from_log(cls, log: TyreLog, window_s: float = 0.3) -> TyreMotion:
        """From the readings, smoothed by a cubic over a sliding window (Savitzky & Golay, 1964).

        The yaw acceleration is the derivative of the same cubic. v_y is integrated where it was
        not measured.
        """
        told = log if log.sideslip_measured else log.with_kinematic_sideslip()
        window = 2 * max(int(0.5 * window_s / log.step_s), 2) + 1
        y = np.column_stack([filled(told.measurements[:, i]) for i in range(4)])
        smooth = scipy.signal.savgol_filter(y[:, :3], window, 3, axis=0)
        rate = scipy.signal.savgol_filter(y[:, 2], window, 3, deriv=1, delta=log.step_s)
        motion = np.column_stack([smooth, told.inputs[:, 1:]])
        return cls(as_float64(motion), as_float64(y[:, 3]), None, as_float64(rate))

    @property
    def n(self) -> int:
        """Number of samples."""
        return len(self.motion)

    @classmethod
    @typed
    def joined(cls, motions: Sequence[TyreMotion]) -> TyreMotion:
        """All of them as one; what one of them lacks the whole lacks."""

        def together(name: str) -> FloatArray | None:
            parts = [getattr(m, name) for m in motions]
            return None if any(a is None for a in parts) else as_float64(np.concatenate(parts))

        return cls(
            as_float64(np.concatenate([m.motion for m in motions])),
            as_float64(np.concatenate([m.ay_mps2 for m in motions])),
            together("ay_variance"),
            together("yaw_acc_radps2"),
        )

    @typed
    def thinned(self, most: int) -> TyreMotion:
        """About `most` samples of it, evenly spread."""
        every = slice(None, None, max(1, self.n // most))
        variance, rate = (
            None if a is None else a[every] for a in (self.ay_variance, self.yaw_acc_radps2)
        )
        return TyreMotion(self.motion[every], self.ay_mps2[every], variance, rate)

    @typed
    def errors(
        self,
        vehicle: GreyBoxVehicle,
        ay_weight: FloatArray,
        yaw_weight: FloatArray,
        *,
        projects_steer: bool,
    ) -> _core.TyreLoss:
        """Weighted errors, as a problem for searches; weights are one over standard deviations."""
        rate = self.yaw_acc_radps2 if self.yaw_acc_radps2 is not None else np.zeros(self.n)
        return _core.TyreLoss(
            vehicle.core(),
            vehicle.yaw_inertia_kgm2,
            projects_steer,
            self.motion,
            as_float64(np.column_stack([self.ay_mps2, rate])),
            as_float64(np.column_stack([ay_weight, yaw_weight])),
        )


def _finite(name: str, values: FloatArray) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InvalidInput(
            f"{name} is {values[bad[0]]} at sample {bad[0]}; a regression needs every value: cut "
            "the motion there or fill the gap"
        )
