"""The error of every model of a study, one step ahead and further."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.style import AFTER, BEFORE, axes_or_new, tidy
from ..._common.text import brief, html_table, text_table
from ..._common.threads import check_time
from ...compare import Comparison
from ...errors import NumericalError
from ...estimate import MEASURED, Driving, NoiseModel
from ...identify import Fit, driving_of
from .road import told_by

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Waterfall:
    """Errors step by step, in units of the noise floor of one-step-ahead predictions.

    Attributes
    ----------
    steps : tuple of str
        The baseline, then what was added.
    horizons_s : tuple of float
        How far ahead was predicted from what was known then and the inputs since; 0 is one sample.
    train, test : array, shape (steps, horizons)
        Root mean square over all channels; infinite where a model lost the car, NaN where the
        driving is too short for the horizon.
    """

    steps: tuple[str, ...]
    horizons_s: tuple[float, ...]
    train: FloatArray
    test: FloatArray

    def _head(self) -> list[str]:
        ahead = ["one step" if h == 0.0 else f"{h:g} s" for h in self.horizons_s]
        errors = (f"{data} {a}" for data in ("train", "validation") for a in ahead)
        return ["error ahead by", *errors]

    def _rows(self) -> list[list[str]]:
        rows = [
            [step, *(f"{e:.2f}" for e in (*train, *test))]
            for step, train, test in zip(self.steps, self.train, self.test, strict=True)
        ]
        floor = ["1.00" if h == 0.0 else "" for h in self.horizons_s]
        return [*rows, ["noise floor", *floor, *floor]]

    __repr__ = brief

    def __str__(self) -> str:
        return text_table(self._head(), self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._head(), self._rows())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the validation errors over the horizon, one line for each step.

        Parameters
        ----------
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes
        """
        ax = axes_or_new(ax, 5.5, 3.4)
        places = np.arange(len(self.horizons_s))
        for i, step in enumerate(self.steps):
            colour = BEFORE if i == 0 else AFTER
            share = 1.0 if i in (0, len(self.steps) - 1) else 0.4
            ax.plot(places, self.test[i], "o-", color=colour, alpha=share, label=step)
        ax.axhline(1.0, color="0.4", linestyle="--", linewidth=0.8)
        ax.set_yscale("log")
        ax.set_xticks(places, ["one step" if h == 0.0 else f"{h:g} s" for h in self.horizons_s])
        ax.legend()
        return tidy(ax, xlabel="predicted ahead", ylabel="validation error / noise floor")


def waterfall(
    fits: Sequence[Fit],
    steps: Sequence[str],
    train: tuple[Driving, Comparison],
    test: tuple[Driving, Comparison],
    horizons_s: Sequence[float],
) -> Waterfall:
    """Work out the errors of several models on two sets of driving.

    Parameters
    ----------
    fits : sequence of Fit
    steps : sequence of str
        A word for each fit.
    train, test : (Driving, Comparison)
        Driving, and how the last fit did on it: its noise floor is the unit.
    horizons_s : sequence of float
        Beside one step.
    """
    floor = fits[-1].noise.floor()
    horizons = (0.0, *horizons_s)

    def errors(driving: Driving, score: Comparison) -> FloatArray:
        spread = np.array(
            [score.channels[c].noise_floor if c in score.channels else np.nan for c in MEASURED]
        )
        between = (fits[0], fits[-1])
        return np.array([_errors(f, floor, driving, horizons, spread, between) for f in fits])

    return Waterfall(tuple(steps), horizons, errors(*train), errors(*test))


def look_ahead(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizon_s: float,
    *,
    apart: float = 0.0,
    between: Sequence[Fit] = (),
) -> FloatArray:
    """Prediction errors so many seconds ahead, shape (samples, 5); see `all_ahead`."""
    ahead = all_ahead(fit, noise, driving, (horizon_s,), apart=apart, between=between)
    return as_float64(ahead[0])


def all_ahead(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: Sequence[float],
    *,
    apart: float = 0.0,
    between: Sequence[Fit] = (),
) -> FloatArray:
    """Prediction errors some times ahead, at the rate of each log, but one sample at least.

    Parameters
    ----------
    fit : Fit
    noise : NoiseModel
        Of the filter that tells what was known when a prediction begins.
    driving : Driving
    horizons_s : sequence of float
    apart : float
        How far predictions begin apart, as a share of the horizon; 0 for one at each sample.
    between : sequence of Fit
        Models that are held against each other: predictions know the crossfall that these tell
        in the mean. Of one model alone it fades from where a prediction begins.

    Returns
    -------
    array, shape (horizons, samples, 5)
        NaN where no prediction ends.
    """
    check_time()
    problem = driving_of(fit, driving).problem(fit.model)
    road = told_by(fit, between, noise, driving)
    errors = np.full((len(horizons_s), driving.samples, len(MEASURED)), np.nan)
    for rate in np.unique(driving.sample_rate_hz):
        own = driving.sample_rate_hz == rate
        ahead = [max(round(h * rate), 1) for h in horizons_s]
        steps = [max(int(apart * n), 1) for n in ahead]
        if not np.isfinite(driving.measured[own]).all():
            # Channels that are read every few samples are met by steps that share no divisor.
            steps = [_prime(n) for n in steps]
        asked = list(zip(ahead, steps, strict=True))
        errors[:, own] = problem.look_ahead(fit.model.vector(), noise.vector(), asked, road=road)[
            :, own
        ]
    return errors


def _prime(least: int) -> int:
    """The smallest prime from a number on; one stays one."""
    while any(least % k == 0 for k in range(2, least)):
        least += 1
    return least


def _errors(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: Sequence[float],
    spread: FloatArray,
    between: Sequence[Fit],
) -> list[float]:
    try:
        # Predictions that begin a twentieth of their length apart are wrong alike.
        e = all_ahead(fit, noise, driving, horizons_s, apart=0.05, between=between) / spread
    except NumericalError:
        return [float("inf")] * len(horizons_s)
    e = np.where(np.isfinite(driving.measured), e, np.nan)
    return [float(np.sqrt(np.nanmean(x**2))) if np.isfinite(x).any() else np.nan for x in e]
