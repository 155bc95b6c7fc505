"""A road that pushes the car once, as a kerb or another car would."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sysid_vehicle import RoadDisturbance


@dataclass(frozen=True)
class Push(RoadDisturbance):
    """Forces F_x, F_y [N] and a moment [N m] from a moment on, for so long, beside a road's own."""

    at_s: float = 0.0
    lasts_s: float = 0.3
    force: tuple[float, float, float] = (0.0, 2500.0, 0.0)

    def sample(self, n: int, rate_hz: float, rng: np.random.Generator) -> npt.NDArray[np.float64]:
        """The road's own forces, and the push."""
        time = np.arange(n) / rate_hz
        acts = (time >= self.at_s) & (time < self.at_s + self.lasts_s)
        return np.ascontiguousarray(super().sample(n, rate_hz, rng) + np.outer(acts, self.force))
