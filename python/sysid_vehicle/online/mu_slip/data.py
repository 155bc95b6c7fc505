"""Readings of friction over slip: from arrays, from a file, or simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.text import brief
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput, near_names
from ...read.formats.csv import read_table
from .curve import TWO_PARAMETER, MuSlipCurve

_COLUMNS = ("slip", "mu")
_SIGNED = 10  # readings; noise alone may turn the sign of fewer
_LARGEST = {"slip": 1.5, "mu": 5.0}  # beyond them the unit is wrong
_REMEDY = {
    "slip": "give (v - v_wheel) / v as a ratio, not in percent",
    "mu": "give longitudinal force divided by vertical load, not the force",
}


@dataclass(frozen=True)
class MuSlipData:
    """Friction readings in the order they were taken.

    Attributes
    ----------
    slip : ndarray, shape (n,)
        Braking slip (v - v_wheel) / v, free of noise: 0 for a rolling wheel, 1 for a locked one.
    mu : ndarray, shape (n,)
        Braking force over vertical load; NaN where there is no reading.
    noise_std : float or None
        Standard deviation of a reading of `mu`; None if it has to be learnt from the readings.

    Raises
    ------
    InvalidInput
        If lengths differ, a slip is missing, or a value cannot be a slip or a friction.
    """

    slip: FloatArray
    mu: FloatArray
    noise_std: float | None = None

    @typed_fields
    def __post_init__(self) -> None:
        for name in _COLUMNS:
            values = as_float64(getattr(self, name)).copy()
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if self.slip.ndim != 1 or self.slip.shape != self.mu.shape:
            raise InvalidInput(
                f"slip has shape {self.slip.shape}, mu {self.mu.shape}; give two vectors of the "
                f"same length"
            )
        for name in _COLUMNS:
            check_values(name, getattr(self, name))
        if np.count_nonzero(np.isfinite(self.mu)) < 3:
            raise InvalidInput("mu: fewer than 3 readings; a curve needs more, record again")
        if self.noise_std is not None:
            check_noise(self.noise_std)
        product = (self.slip * self.mu)[np.isfinite(self.mu)]
        if product.size >= _SIGNED and np.sum(product) < -0.5 * np.sum(np.abs(product)):
            raise InvalidInput(
                "mu: of the other sign than slip at most readings, first at sample "
                f"{int(np.argmax(self.slip * self.mu < 0.0))}; friction that brakes is positive, "
                "as braking slip is: turn the sign of one of the two columns"
            )

    @classmethod
    @typed
    def from_csv(cls, path: str | Path, noise_std: float | None = None) -> MuSlipData:
        """Read the columns `slip` and `mu` of a CSV file; an empty cell of `mu` is no reading.

        Raises
        ------
        InvalidInput
            If the file cannot be read, a column is absent, or a cell cannot be used.
        """
        try:
            table = read_table(path)
            for name in _COLUMNS:
                if name not in table.names:
                    raise InvalidInput(
                        f"no column '{name}'{near_names(name, table.names)}; name the columns slip "
                        f"and mu"
                    )
            return cls(table.column("slip"), table.column("mu"), noise_std)
        except InvalidInput as error:
            if str(error).startswith(str(path)):
                raise
            raise InvalidInput(f"{path}: {error}") from error

    __repr__ = brief

    def __str__(self) -> str:
        there = np.isfinite(self.mu)
        noise = "unknown" if self.noise_std is None else f"{self.noise_std:.3g}"
        return (
            f"{there.sum()} friction readings, slip {self.slip[there].min():.3g} to "
            f"{self.slip[there].max():.3g}, noise {noise}"
        )


def check_values(name: str, values: FloatArray, first: int = 0) -> None:
    """Refuse slips and frictions that cannot be; NaN passes as a missing `mu`.

    `first` is the number of the first of them, for the message.
    """
    bad = ~(np.abs(values) <= _LARGEST[name])
    if name == "mu":
        bad &= ~np.isnan(values)
    if bad.any():
        k = int(np.argmax(bad))
        remedy = _REMEDY[name] if np.isfinite(values[k]) else "leave that reading out"
        raise InvalidInput(f"{name}: {values[k]:g} at sample {first + k} cannot be; {remedy}")


def check_noise(noise_std: float) -> float:
    """Refuse a standard deviation that is none."""
    if not (np.isfinite(noise_std) and noise_std > 0.0):
        raise InvalidInput(f"noise_std: {noise_std:g} is not above 0; give that of a mu reading")
    return float(noise_std)


def at_least_one(name: str, count: int) -> int:
    """Refuse a number of repetitions that is none."""
    if count < 1:
        raise InvalidInput(f"{name}: {count} is below 1; give 1 or more")
    return count


@typed
def sinusoidal_slip(
    mean: float = 0.2, amplitude: float = 0.2, periods: float = 3.0, readings: int = 300
) -> FloatArray:
    """Slip that swings to and fro at equal steps of time, for :func:`simulate_mu_slip`.

    Parameters
    ----------
    mean, amplitude : float
        Of the slip ratio; it begins at its smallest.
    periods : float
        How often it swings.
    readings : int
        Number of samples.

    Returns
    -------
    ndarray, shape (readings,)

    Raises
    ------
    InvalidInput
        If a number is not finite, nothing swings, or there are fewer than 3 readings.
    """
    if not np.isfinite([mean, amplitude, periods]).all():
        raise InvalidInput("slip: mean, amplitude or periods is not finite; give numbers")
    if readings < 3 or periods <= 0.0 or amplitude == 0.0:
        raise InvalidInput(
            f"slip: {readings} readings, {periods:g} periods, amplitude {amplitude:g}; give 3 "
            "readings or more, and periods and an amplitude above 0"
        )
    phase = 2.0 * np.pi * periods * np.arange(readings) / readings
    return as_float64(mean - amplitude * np.cos(phase))


@typed
def simulate_mu_slip(
    values: Sequence[float] = (0.35, 0.15),
    *,
    curve: MuSlipCurve = TWO_PARAMETER,
    noise_std: float = 0.04,
    slip: npt.ArrayLike | None = None,
    seed: int | np.random.Generator | None = None,
) -> MuSlipData:
    """Readings along a curve, as a wheel gives them that is braked until it locks.

    Parameters
    ----------
    values : sequence of float
        Parameters of the curve.
    curve : MuSlipCurve
        `TWO_PARAMETER` or `MAGIC_FORMULA`.
    noise_std : float
        Standard deviation of a reading; the estimators are told it.
    slip : array_like, optional
        Where readings are taken; 41 points (k/40)^2 if left out, since a wheel hurries through the
        far side of the curve.
    seed : int or Generator, optional
        Of the noise; without one the readings lie on the curve.
    """
    at = (np.arange(41) / 40.0) ** 2 if slip is None else as_float64(slip)
    mu = curve.mu(at, values)
    if seed is not None:
        mu = mu + noise_std * generator(seed).standard_normal(len(at))
    return MuSlipData(at, mu, noise_std)
