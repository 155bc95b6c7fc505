"""What the car's sensors give: chosen outputs of a drive, with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .._common.arguments import generator
from .._common.arrays import FloatArray
from .._common.typed import typed
from ..errors import InvalidInput, near_names
from .drives import INPUTS, OUTPUTS, Drive14

READINGS = OUTPUTS[:16]
"""What may be measured: eq. (20) of Dettu et al. (2023), then what a reference unit adds."""


@dataclass(frozen=True, eq=False)
class Readings:
    """Measured channels.

    Attributes
    ----------
    values : ndarray, shape (n, 16)
        Columns as `READINGS`, NaN where nothing is measured.
    noise : mapping of str to float
        Standard deviation of each measured channel's noise.
    dt_s : float
        Step.
    """

    values: FloatArray
    noise: Mapping[str, float]
    dt_s: float

    __iter__ = None  # numbers are no names

    def __getitem__(self, name: str) -> FloatArray:
        """A channel by name."""
        return self.values[:, READINGS.index(name)]

    def __str__(self) -> str:
        lines = [f"{len(self.values)} samples, {1.0 / self.dt_s:g} Hz"]
        lines += [f"  {name:28s} noise {noise:.3g}" for name, noise in self.noise.items()]
        return "\n".join(lines)


@typed
def measure(
    drive: Drive14,
    channels: Sequence[str],
    *,
    snr: float = np.inf,
    seed: int | np.random.Generator = 0,
    unit: Literal["amplitude", "dB"] = "amplitude",
    noise: Mapping[str, float] | None = None,
) -> Readings:
    """Read channels of a drive with white noise, eq. (10) of Dettu et al. (2023).

    Parameters
    ----------
    drive : Drive14
        What was driven.
    channels : sequence of str
        Out of `READINGS`. The yaw rate is always there, for the gates of the laws.
    snr : float
        Signal to noise; infinite for none. The noise of a channel is its own standard deviation
        over `snr`.
    seed : int or Generator
        Of the noise.
    unit : {"amplitude", "dB"}
        How `snr` is meant; the paper does not say.
    noise : mapping of str to float, optional
        Standard deviations of sensors that are known, in place of the ratio.

    Raises
    ------
    InvalidInput
        If a channel is unknown or `snr` is not positive.
    """
    if not snr > 0.0 and unit == "amplitude":
        raise InvalidInput(f"snr = {snr!r}; give a positive number, inf for no noise")
    ratio = snr if unit == "amplitude" else 10.0 ** (snr / 20.0)
    rng = generator(seed)
    values = np.full((len(drive.outputs), len(READINGS)), np.nan)
    known, scale = noise or {}, {}
    for name in dict.fromkeys((*channels, "yaw_rate_radps")):
        if name not in READINGS:
            raise InvalidInput(f"there is no reading '{name}'{near_names(name, READINGS)}")
        clean = drive[name]
        scale[name] = float(known.get(name, np.std(clean) / ratio))
        values[:, READINGS.index(name)] = clean + scale[name] * rng.standard_normal(len(clean))
    return Readings(values, scale, drive.dt_s)


@typed
def noisy_road(
    inputs: FloatArray, relative: float, *, seed: int | np.random.Generator = 0
) -> FloatArray:
    """What the twin is told of the road: eq. (17), each axle's factor drawn at every sample.

    The vertical speed of the road gets the factor of its height: to differentiate the noise
    itself would give rates no road has.
    """
    rng = generator(seed)
    out = inputs.copy()
    for axle in (("fl", "fr"), ("rl", "rr")):
        factor = rng.uniform(1.0 - relative, 1.0 + relative, len(inputs))
        for wheel in axle:
            for name in (f"road_{wheel}_m", f"road_rate_{wheel}_mps"):
                out[:, INPUTS.index(name)] *= factor
    return out
