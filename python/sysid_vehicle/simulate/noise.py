"""What sensors add to a drive, and what the road does to the car."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import scipy

from .._common.arguments import check_not_negative
from .._common.arrays import FloatArray, as_float64
from .._common.typed import typed_fields
from ..errors import InvalidInput
from ..vehicle import GRAVITY_MPS2


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of white Gaussian noise on the measured channels.

    Parameters
    ----------
    vx_mps, vy_mps, yaw_rate_radps, ax_mps2, ay_mps2, steer_rad : float
        Standard deviation, in the unit of the channel. The wheel force `fx_n` is commanded, not
        measured, and carries none.

    Raises
    ------
    InvalidInput
        If one is negative.
    """

    vx_mps: float = 0.03
    vy_mps: float = 0.03
    yaw_rate_radps: float = 0.0025
    ax_mps2: float = 0.06
    ay_mps2: float = 0.06
    steer_rad: float = 2e-4

    @typed_fields
    def __post_init__(self) -> None:
        check_not_negative(self, finite=True)

    @classmethod
    def none(cls) -> SensorNoise:
        """Sensors without noise."""
        return cls(**{field.name: 0.0 for field in fields(cls)})

    def scaled(self, factor: float) -> SensorNoise:
        """Return the same sensors with `factor` times the noise."""
        return SensorNoise(**{f.name: factor * getattr(self, f.name) for f in fields(self)})

    def add_to(self, columns: dict[str, FloatArray], rng: np.random.Generator) -> None:
        """Put noise upon what the sensors would read without."""
        for f in fields(self):
            clean = columns[f.name]
            columns[f.name] = clean + getattr(self, f.name) * rng.standard_normal(len(clean))


@dataclass(frozen=True)
class RoadDisturbance:
    """Forces, a moment and a slope of the road that change at random and that no model knows.

    Each is an Ornstein-Uhlenbeck process, Gaussian with this standard deviation and correlation
    ``exp(-|t| / correlation_time_s)``, and begins in its stationary state.

    Gravity on a slope moves the car; no accelerometer feels it, and it shifts no wheel load.

    Parameters
    ----------
    fx_n, fy_n : float
        Standard deviation of the forces on the body [N].
    mz_nm : float
        Standard deviation of the yaw moment [N m].
    correlation_time_s : float
        Correlation time, more than zero.
    slope_rad, slope_time_s : float
        Standard deviation of the slopes along and across the car, and their correlation time.

    Raises
    ------
    InvalidInput
        If one is negative, or a correlation time is not positive.
    """

    fx_n: float = 0.0
    fy_n: float = 0.0
    mz_nm: float = 0.0
    correlation_time_s: float = 0.3
    slope_rad: float = 0.0
    slope_time_s: float = 5.0

    @typed_fields
    def __post_init__(self) -> None:
        check_not_negative(self, finite=True)
        for name in ("correlation_time_s", "slope_time_s"):
            if getattr(self, name) == 0.0:
                raise InvalidInput(f"RoadDisturbance: {name} must be more than zero")

    def sample(self, n: int, rate_hz: float, rng: np.random.Generator) -> FloatArray:
        """Draw `n` samples of F_x [N], F_y [N] and M_z [N m]: an array of shape (n, 3).

        On a road that slopes two columns more, the gravity along and across [m/s2].
        """
        forces = _wandering(n, 3, self.correlation_time_s * rate_hz, rng)
        forces *= np.array([self.fx_n, self.fy_n, self.mz_nm])
        if self.slope_rad == 0.0:
            return as_float64(forces)
        slopes = self.slope_rad * _wandering(n, 2, self.slope_time_s * rate_hz, rng)
        return as_float64(np.hstack([forces, GRAVITY_MPS2 * np.sin(slopes)]))


def _wandering(n: int, width: int, samples: float, rng: np.random.Generator) -> FloatArray:
    """Ornstein-Uhlenbeck processes of unit variance with a correlation time in samples.

    Exact sampling of the process: D. T. Gillespie, Phys. Rev. E 54 (1996), 2084-2091.
    """
    keep = float(np.exp(-1.0 / samples))
    fresh = rng.standard_normal((n, width))
    fresh[1:] *= np.sqrt(1.0 - keep**2)
    return as_float64(scipy.signal.lfilter([1.0], [1.0, -keep], fresh, axis=0))
