"""How much of the missing force any function of the driving could explain.

A flexible regression of the missing side force and yaw moment on what the driver does: steering,
speed and longitudinal acceleration, and their history. Measured lateral motion is no regressor: it
holds the missing force itself. Of errors along the car ahead, speed and pull are none from where
the prediction begins: the speed holds the error, and whoever holds a speed answers it with the
pull, so that the pull tells of every slope. The regression is
fitted to the training data and judged on validation data, so that what it explains there is a lower
bound of what is explainable; the rest is disturbance, noise, or hidden from the inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.text import html_text
from ..._common.threads import check_time
from ..._common.typed import typed
from ...estimate import Driving
from ...identify import Fit, explaining
from ...log import Log
from ...rules import USUAL, Rules
from ..evidence.coordinates import BLOCK_S, begins, blocks
from ..evidence.evidence import evident
from .force_map import UNITS, missing_forces

Whole = npt.NDArray[np.intp]

_RATE_HZ = 20.0  # missing forces are smooth
_LAGS_S = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.8)
_FOLDS = 5
_PENALTIES = 10.0 ** np.arange(-4.0, 2.5, 0.5)  # over the number of samples
_DRAWS = 400
_UNDERSTEER_MPS = 25.0  # characteristic speed, by which steering becomes lateral acceleration
_REACH = 4.0  # standard deviations of a regressor, beyond which nothing is extrapolated


@dataclass(frozen=True)
class Explainable:
    """What the driving predicts of one missing force.

    Attributes
    ----------
    share, low, high : float
        Of its variance on validation data, with a 95 % interval from blocks of the driving; below
        zero where the regression predicts nothing.
    rms : float
        Of the missing force on validation data, about its mean in training [N, N m].
    """

    target: str
    share: float
    low: float
    high: float
    rms: float

    def __str__(self) -> str:
        return (
            f"{100 * max(self.share, 0.0):.0f} % ({100 * max(self.low, 0.0):.0f} to "
            f"{100 * max(self.high, 0.0):.0f}) of the missing {self.target}, "
            f"{self.rms:.3g} {UNITS[self.target]} rms"
        )


@dataclass(frozen=True)
class Ceiling:
    """How much of the missing forces a function of the driving could explain.

    Attributes
    ----------
    forces : tuple of Explainable
        Side force and yaw moment.
    rules : Rules
    """

    forces: tuple[Explainable, ...]
    rules: Rules = USUAL

    @property
    def structure(self) -> tuple[Explainable, ...]:
        """Those of which more than `Rules.explainable` is shown to depend on the driving."""
        return tuple(f for f in self.forces if f.low > self.rules.explainable)

    def __str__(self) -> str:
        told = "; ".join(map(str, self.structure))
        if told:
            return f"a function of steering, speed and acceleration history explains {told}"
        most = max(self.forces, key=lambda f: f.share)
        return (
            "no function of steering, speed and acceleration history is shown to explain what is "
            f"missing (at best {most})"
        )

    _repr_html_ = html_text

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            f.target: {
                "share": f.share,
                "interval": [f.low, f.high],
                "rms": f.rms,
                "unit": UNITS[f.target],
            }
            for f in self.forces
        }


@typed
@explaining
def ceiling(
    fit: Fit,
    test: Log | Sequence[Log] | Driving,
    logs: Log | Sequence[Log] | Driving | None = None,
    *,
    seed: int = 0,
    rules: Rules = USUAL,
) -> Ceiling:
    """Find how much of what a model lacks any function of the driving could explain.

    Cubic ridge regression of the smoothed missing forces on the histories of steering, speed and
    longitudinal acceleration; the penalty is chosen by cross-validation within the training data.

    Parameters
    ----------
    fit : Fit
    test : Log, sequence of Log, or Driving
        Validation data.
    logs : Log, sequence of Log, or Driving, optional
        Training data; by default what the model was fitted to.
    seed : int
        Of the draws that make the intervals.
    rules : Rules

    Returns
    -------
    Ceiling
    """
    train, other = evident(fit, logs), evident(fit, test)
    rng = generator(seed)
    few, there = thinned(train), thinned(other)
    inputs = Inputs.of(fit, train, other)
    known, hidden = (missing_forces(fit, d) for d in (train, other))
    piece = np.unique(_block_numbers(other)[there], return_inverse=True)[1]
    targets = [i for i, t in enumerate(known.targets) if t != "F_x"]
    y = known.force[few][:, targets]
    law = ridge(inputs.train[few], y, folds(train)[few])
    missing = hidden.force[there][:, targets] - law.mean
    error = missing - inputs.other[there] @ law.size
    return Ceiling(
        tuple(
            _share(known.targets[i], missing[:, k], error[:, k], piece, rng)
            for k, i in enumerate(targets)
        ),
        rules,
    )


@dataclass(frozen=True, eq=False)
class Inputs:
    """Regressors of two drives, centred and scaled by the first; shape (samples, n)."""

    train: FloatArray
    other: FloatArray

    @classmethod
    def of(cls, fit: Fit, train: Driving, other: Driving, *, along_until_s: float = 0.0) -> Inputs:
        """Histories of steering, speed and longitudinal acceleration.

        Parameters
        ----------
        fit : Fit
        train, other : Driving
        along_until_s : float
            How long ago the latest speed and pull are.
        """
        features = [_features(fit, d, along_until_s) for d in (train, other)]
        centre, spread = features[0].mean(axis=0), features[0].std(axis=0)
        used = spread > 1e-9 * np.maximum(np.abs(centre), 1e-9)
        X, Z = (
            np.clip((f[:, used] - centre[used]) / spread[used], -_REACH, _REACH) for f in features
        )
        return cls(as_float64(X), as_float64(Z))


@dataclass(frozen=True, eq=False)
class Law:
    """A linear regression: ``mean + X @ size``.

    Attributes
    ----------
    mean : array, shape (m,)
    size : array, shape (n, m)
    """

    mean: FloatArray
    size: FloatArray


def ridge(X: FloatArray, Y: FloatArray, fold: Whole) -> Law:
    """Regress each column of `Y` with the penalty that predicts left-out folds best.

    Parameters
    ----------
    X : array, shape (samples, n)
    Y : array, shape (samples, m)
    fold : array of int, shape (samples,)
    """
    errors = np.zeros((len(_PENALTIES), Y.shape[1]))
    parts = [fold == k for k in np.unique(fold)]
    grams = [X[part].T @ X[part] for part in parts]
    whole = np.sum(grams, axis=0)
    for out, gram in zip(parts, grams, strict=True):
        if out.all():
            continue
        mean = Y[~out].mean(axis=0)
        sizes = _sizes(whole - gram, X[~out].T @ (Y[~out] - mean), int((~out).sum()))
        wrong = (Y[out] - mean) - X[out] @ sizes
        errors += np.sum(wrong**2, axis=1)
    best = np.argmin(errors, axis=0)
    mean = Y.mean(axis=0)
    size = _sizes(whole, X.T @ (Y - mean), len(X))[best, :, np.arange(Y.shape[1])]
    return Law(as_float64(mean), as_float64(size.T))


def _sizes(gram: FloatArray, across: FloatArray, rows: int) -> FloatArray:
    """Coefficients at each penalty, (penalties, n, m), from one eigendecomposition."""
    value, vector = np.linalg.eigh(gram)
    loosened = value + rows * _PENALTIES[:, None]
    return as_float64(vector @ ((vector.T @ across) / loosened[:, :, None]))


def left_out(
    targets: Sequence[str],
    X: FloatArray,
    Y: FloatArray,
    fold: Whole,
    piece: Whole,
    *,
    seed: int = 0,
) -> list[Explainable]:
    """What of the square of signals is predicted in folds that the regressions did not see.

    Parameters
    ----------
    targets : sequence of str
        A name for each signal.
    X : array, shape (samples, n)
    Y : array, shape (samples, m)
        The signals; one decomposition of the regressors serves all of them.
    fold, piece : array of int, shape (samples,)
        Of cross-validation, and the blocks that are drawn anew for the interval.

    Returns
    -------
    list of Explainable
        Empty where there is one fold only.
    """
    parts = [fold == k for k in np.unique(fold)]
    if len(parts) == 1:
        return []
    error = np.empty_like(Y)
    for part in parts:
        check_time()
        law = ridge(X[~part], Y[~part], fold[~part])
        error[part] = Y[part] - law.mean - X[part] @ law.size
    return [
        _share(name, Y[:, k], error[:, k], piece, generator(seed)) for k, name in enumerate(targets)
    ]


def pieces(driving: Driving, rows: Whole) -> tuple[Whole, Whole]:
    """Fold of cross-validation, and number of the block, of these samples."""
    block = _block_numbers(driving)[rows]
    return block % _FOLDS, np.unique(block, return_inverse=True)[1]


def folds(driving: Driving) -> Whole:
    """To which fold of cross-validation each sample belongs."""
    return _block_numbers(driving) % _FOLDS


def thinned(driving: Driving) -> Whole:
    """Samples that tell all of what is smooth."""
    every = max(round(driving.mean_rate_hz / _RATE_HZ), 1)
    return np.arange(0, driving.samples, every)


def _block_numbers(driving: Driving) -> Whole:
    starts = blocks(driving, min(BLOCK_S, driving.usable_s / (2.0 * _FOLDS)))
    return np.searchsorted(starts, np.arange(driving.samples), side="right") - 1


def _features(fit: Fit, driving: Driving, along_until_s: float = 0.0) -> FloatArray:
    """Regressors, (samples, n): polynomials of the inputs now and some time ago."""
    car = fit.model.vehicle
    steer, v = driving.channel("steer_rad"), driving.channel("vx_mps")
    pull = driving.channel("fx_n") / car.mass_kg if driving.force_known else None
    pull = driving.channel("ax_mps2") if pull is None else pull
    v, pull = (np.nan_to_num(x, nan=float(np.nanmean(x))) for x in (v, pull))
    v, pull = (_ago(driving, x, along_until_s) for x in (v, pull))
    # Lateral acceleration that a neutral car would have, and some yaw rate.
    turn = steer * v / (car.wheelbase_m * (1.0 + (v / _UNDERSTEER_MPS) ** 2))
    columns = [v, v**2, pull, pull**2]
    for lag in _LAGS_S:
        s, t, u, p = (_ago(driving, x, lag) for x in (steer, turn, v, pull))
        a = t * u
        columns += [s, t, a, a * np.abs(a), a**3, a**2, a * u, a * p, np.abs(a) * p, p]
    return as_float64(np.column_stack(columns))


def _ago(driving: Driving, x: FloatArray, seconds: float) -> FloatArray:
    """The signal so long ago; at the begin of a stretch its first value."""
    lag = np.round(seconds * driving.sample_rate_hz).astype(int)
    first = begins(driving)
    own = first[np.searchsorted(first, np.arange(len(x)), side="right") - 1]
    return as_float64(x[np.maximum(np.arange(len(x)) - lag, own)])


def _share(
    target: str,
    missing: FloatArray,
    error: FloatArray,
    piece: Whole,
    rng: np.random.Generator,
) -> Explainable:
    """Share of the variance, with an interval from draws of the blocks (Efron 1979)."""
    n = int(piece.max()) + 1
    before, after = (np.bincount(piece, x**2, minlength=n) for x in (missing, error))
    drawn = rng.integers(0, n, (_DRAWS, n))
    shares = 1.0 - after[drawn].sum(axis=1) / np.maximum(before[drawn].sum(axis=1), 1e-300)
    low, high = np.quantile(shares, (0.025, 0.975))
    share = 1.0 - float(after.sum()) / max(float(before.sum()), 1e-300)
    return Explainable(target, share, float(low), float(high), float(np.sqrt(np.mean(missing**2))))
