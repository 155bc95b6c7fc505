"""Parameters that predict best some seconds ahead.

The likelihood is that of one step. What a model lacks it lays upon disturbances, and these follow
slow errors so well that parameters serve fast ones: a car whose tyres answer late may be given half
its cornering stiffness. The prediction over a longer time knows no disturbance. Its errors, squared
and summed, are the criterion of the simulation error, or of prediction many steps ahead (Ljung,
System Identification, 2nd ed., sec. 7.2 and 8.5; Farina & Piroddi, Int. J. Control 2011). Where the
model is the car, both give the same car within their uncertainty, and the likelihood is the surer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import in_parallel
from ...errors import InvalidInput, NumericalError
from ...estimate import Driving, NoiseModel
from ...estimate.pieces import DrivingProblem
from ...model import Model
from ..fit import Fit
from ..intervals.estimates import box_covariance, wald
from ..intervals.retimed import pushes_of_time
from ..search.box import free_box, free_prior
from ..search.objective import LinearRows, Penalised
from ..search.search import Box, minimise
from .windows import Gains, Windows, blocks_of, counting, squares_of, turns_of, windows_of

# Windows that err by more than so many times the typical error count as lost, but of all windows
# no more than a tenth: they are left out (trimmed squares, Rousseeuw, JASA 1984). Both are those of
# windows in which the car turns: beside a straight every corner would be lost.
_LOST, _KEPT = 3.0, 0.9
_PASSES, _ROUNDS = 3, 60
_SETTLED = 1e-3  # observations
_ERRS = 0.1  # of the motion: what a fair model leaves; a car whose a_y shakes by 4 m/s2 chose it
_BLIND = 1e4  # standard deviations of a channel: a sensor that corrects nothing
_STILL = 1e-6  # noise of a motion that is certain


def predicting_ahead(fit: Fit, horizon_s: float = 2.0) -> Fit:
    """Fit the free parameters to predictions over windows, from a fit of the likelihood.

    Each window begins with the smoothed motion, and from there on knows steering, wheel force, and
    the smoothed grade of a road that is not level: drivers answer grades, and of models that do
    not know them one that answers less would err less. A crossfall is not known: what a model errs
    sideways looks like one to its smoother, and would not be fitted. Errors count in standard
    deviations of their channel over the driving, together with ten times the noise of its sensor:
    beside an accelerometer that shakes other channels decide. Windows in which the model loses the
    car do not count, a tenth at most. The search begins from the likelihood's parameters, and once
    more with the tyres of the vehicle file. Standard errors are those of windows that are wrong
    alike for ten seconds (sandwich of Huber and White over such blocks).

    Parameters
    ----------
    fit : Fit
        Of the likelihood.
    horizon_s : float

    Returns
    -------
    Fit
        Its log-likelihood is still that of one step, with the noise of the fit it began from.

    Raises
    ------
    InvalidInput
        No time above zero, or longer than every stretch of the driving.
    """
    if not (np.isfinite(horizon_s) and horizon_s > 0.0):
        raise InvalidInput(f"horizon_s = {horizon_s}: give a time above zero, in seconds")
    box, model = free_box(fit.model), fit.model
    ahead = _Ahead.of(fit, horizon_s, box)
    ends = ahead.ends(_starts(model, box))
    end, look = ends[0], None
    if len(ends) > 1:
        looks = in_parallel(lambda e: ahead.looked(e.p), ends)
        best = min(range(len(ends)), key=lambda i: ahead.trimmed(looks[i]))
        end, look = ends[best], looks[best]
    for _ in range(_PASSES - 1):
        begun = end.p
        end, look = ahead.searched(begun, look), None
        if np.array_equal(end.p, begun):
            break  # from here every pass is the same one
    p, errors, gains = end.p, end.errors, end.gains
    information = _information(
        errors.sensitivities(p, gains, box.columns),
        errors.residuals(p, gains).ravel(),
        np.repeat(
            blocks_of(fit.driving, end.counted), [_core.CHANNELS * size for _, size in end.counted]
        ),
    )
    for rows in ahead.prior:
        stated = rows(p)[1][:, box.columns]
        information = information + stated.T @ stated
    information = as_float64(information)
    # What the driving does not tell, the box holds.
    told = box_covariance(information, box, p[box.columns]) @ information
    pushed = as_float64(told @ ahead.pushed(end))
    names = model.free_names
    units = {n: parameter.unit for n, parameter in model.parameters.items()}
    x = p[box.columns]
    estimates, covariance = wald(
        names,
        units,
        x,
        information,
        box,
        [model.bounds(n) for n in names],
        pushed=np.hstack([pushed, ahead.of_slopes()]),
    )
    return replace(
        fit,
        model=model.with_values(dict(zip(names, map(float, x), strict=True))),
        estimates=estimates,
        covariance=covariance,
        pushed=pushed,
        log_likelihood=float(ahead.whole.freeze(p, fit.noise.vector()).log_likelihood),
        converged=end.settled,
        profiles=(),
        horizon_s=float(horizon_s),
    )


_Look = tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class _End:
    """Where a search over windows ended: all parameters, and what counted."""

    p: FloatArray
    errors: Windows
    gains: Gains
    counted: list[tuple[int, int]]
    settled: bool


@dataclass(frozen=True)
class _Ahead:
    """Predictions over windows of one driving, as functions of all parameters."""

    fit: Fit
    box: Box
    whole: DrivingProblem
    windows: list[tuple[int, int]]
    turns: npt.NDArray[np.bool_]
    noise: FloatArray
    prior: tuple[LinearRows, ...]

    @classmethod
    def of(cls, fit: Fit, horizon_s: float, box: Box) -> _Ahead:
        driving = fit.driving
        windows = windows_of(driving, horizon_s)
        return cls(
            fit,
            box,
            driving.problem(fit.model),
            windows,
            turns_of(driving, windows),
            _blind_noise(driving, fit.noise.floor()),
            free_prior(fit.model),
        )

    def ends(self, starts: list[FloatArray]) -> list[_End]:
        """Where a search from each start ends, of those that end.

        Raises
        ------
        NumericalError
            The car spins in the model from every one.
        """

        def end(p: FloatArray) -> _End | Exception:
            try:
                return self.searched(p)
            except (NumericalError, np.linalg.LinAlgError) as error:
                return error

        found = in_parallel(end, starts)
        ended = [e for e in found if isinstance(e, _End)]
        if not ended and isinstance(found[0], Exception):
            raise found[0]
        return ended

    def searched(self, p: FloatArray, look: _Look | None = None) -> _End:
        """Where the errors of the windows that count at a start are least.

        `look` is `looked` of the start, where it is known.
        """
        driving, model, windows = self.fit.driving, self.fit.model, self.windows
        squares, told = self.looked(p) if look is None else look
        turning = squares[self.turns]
        typical = float(np.median(turning))
        most = max(_LOST**2 * typical, float(np.quantile(turning, _KEPT)))
        kept = [w for w, square in zip(windows, squares, strict=True) if square <= most]
        counted = sorted(kept, key=lambda window: window[::-1])
        errors = counting(driving, model, counted, told, typical)
        gains = errors.freeze(p, self.noise)
        found = minimise(
            Penalised(errors, self.prior),
            p,
            gains,
            self.box,
            rounds=_ROUNDS,
            tolerance=_SETTLED,
        )
        return _End(self.box.put(p, found.x), errors, gains, counted, found.settled)

    def pushed(self, end: _End) -> FloatArray:
        """What an end moves by where readings were moved in time by one standard error more."""
        if not any(log.retimed for log in self.fit.driving.logs):
            return np.empty((len(self.box.columns), 0))
        curvature = Penalised(end.errors, self.prior).normal_equations(
            end.p, end.gains, self.box.columns
        )[2]

        def slope(of: Driving) -> FloatArray:
            """Downhill; priors are the same whatever was read."""
            told = self._told(of.problem(self.fit.model), end.p)
            problems = counting(of, self.fit.model, end.counted, told, 1.0).problems
            errors = replace(end.errors, problems=problems)
            return errors.normal_equations(end.p, end.gains, self.box.columns)[1]

        pushes = pushes_of_time(self.fit.driving, slope)
        return as_float64(np.linalg.pinv(curvature, hermitian=True) @ pushes)

    def of_slopes(self) -> FloatArray:
        """Principal directions, one standard error long, of what slopes were smoothed with.

        Slopes take up what a wrong mass or force leaves: windows that know them begin with the
        likelihood's parameters, and tell these no better. Shape (n, m); (n, 0) on a level road.
        """
        if not self.fit.noise.sloping:
            return np.empty((len(self.box.columns), 0))
        values, vectors = np.linalg.eigh(self.fit.covariance)
        directions = vectors * np.sqrt(np.maximum(values, 0.0))
        # What the likelihood found elsewhere may have been fewer parameters, or others.
        rows = {e.name: row for e, row in zip(self.fit.estimates, directions, strict=False)}
        none = np.zeros(len(values))
        return np.array([rows.get(n, none) for n in self.fit.model.free_names])

    def trimmed(self, look: _Look) -> float:
        """Mean square of the windows in which the car turns, without those that err most."""
        squares = np.sort(look[0][self.turns])
        return float(np.mean(squares[: max(int(_KEPT * len(squares)), 1)]))

    def looked(self, p: FloatArray) -> _Look:
        """Mean square of each window, and what the smoother tells at these parameters."""
        told = self._told(self.whole, p)
        every = self.fit.driving.windows(self.fit.model, self.windows, told)
        return squares_of(every.residuals(p, every.freeze(p, self.noise)), self.windows), told

    def _told(self, problem: DrivingProblem, p: FloatArray) -> FloatArray:
        # What is not measured is smoothed with the parameters that are being sought.
        return as_float64(problem.smoothed_means(p, self.fit.noise.vector()))


def _starts(model: Model, box: Box) -> list[FloatArray]:
    """Parameters of the likelihood, and with the tyres of the vehicle file where all are free.

    Where the likelihood bends the tyres, no search leads back over the shapes between.
    """
    p = box.inside(model.vector())
    axles = ("front", "rear")
    tyres = [model.parameters[f"{c}_{axle}"].column for axle in axles for c in "BCDE"]
    if not set(tyres) <= set(box.columns):
        return [p]
    other = p.copy()
    other[tyres] = box.inside(Model(model.vehicle).vector())[tyres]
    return [p, box.inside(other)]


def _blind_noise(driving: Driving, noise: NoiseModel) -> FloatArray:
    """Noise with which a filter only predicts, and whitens errors by what a model may err.

    That is a share of the motion, and the noise of the sensor, both told by the spread of the
    channel.
    """
    sensor = np.array(noise.reading)
    spread = np.array(
        [np.std(y[np.isfinite(y)]) if np.isfinite(y).any() else 1.0 for y in driving.measured.T]
    )
    motion = np.maximum(spread**2 - sensor**2, 0.0)
    spread = np.sqrt(motion + (sensor / _ERRS) ** 2)
    spread[~(spread > 0.0)] = 1.0
    still, none, sensors = (_STILL,) * 3, (0.0,) * 3, tuple(map(float, _BLIND * spread))
    return NoiseModel(sensors, still, none, (0.1,) * 3).vector()


@lru_cache
def of_few(blocks: int) -> float:
    """How much wider Student's 95 % interval of so many blocks is than that of many."""
    return float(scipy.special.stdtrit(max(blocks - 1, 1), 0.975) / scipy.special.ndtri(0.975))


def _information(
    slope: FloatArray, residual: FloatArray, blocks: npt.NDArray[np.intp]
) -> FloatArray:
    """Inverse of the sandwich covariance, H J^-1 H.

    Blocks are hardly more than parameters. The scatter of their scores is drawn towards that of
    blocks which differ in nothing but how many alike samples one of them counts for. It is itself
    known from few blocks (`of_few`).
    """
    H = slope.T @ slope
    count = int(blocks.max()) + 1
    scores = np.zeros((count, H.shape[0]))
    np.add.at(scores, blocks, slope * residual[:, None])
    J = scores.T @ scores * (count / max(count - 1, 1) * of_few(count) ** 2)
    felt = np.sqrt(np.maximum(np.diag(H), 1e-300))
    alike = float(np.trace(np.linalg.pinv(H / np.outer(felt, felt)) @ (J / np.outer(felt, felt))))
    own = count / (count + len(H))
    J = own * J + (1.0 - own) * max(alike / len(H), 1e-12) * H
    return as_float64(H @ np.linalg.pinv(J, hermitian=True) @ H)
