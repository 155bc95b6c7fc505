"""A sensor's own low-pass, by the likelihood of the spectra that it leaves.

Noise of the sensor and of the road, and vibration, are sums of spectra of known form. A low-pass
takes all of them down alike; counting in quanta comes after it, and what the samples are too slow
for folds back. The likelihood of the powers is Whittle's (P. Whittle, *J. R. Statist. Soc. B* 15,
1953, 125-139). A causal low-pass of second order delays slow motion by a time that its magnitude
tells (it is of minimum phase: Oppenheim & Schafer, *Discrete-Time Signal Processing*, 3rd ed.,
sec. 5.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray
from ..._common.threads import check_time
from .forms import ROAD, Response, count, folded, images_of, parts_of
from .spectrum import Spectrum

_USUAL_DAMPING, _SPREAD = np.sqrt(0.5), 0.2  # Butterworth's, and of its logarithm
_CORNERS_HZ: Final = (8.0, 14.0, 24.0)  # from which a fit begins
_AFTER: Final = 1e-3  # share of white noise that comes after a filter, up to which there is one
_SHARED: Final = 3  # parameters of a response
_BOUNDS: Final = np.log([[2.0, 0.25, 1e-7], [200.0, 2.0, _AFTER]])
_ROUNDS: Final = 60
_LOST: Final = 14.0  # logarithm by which a part may go down or up from where it begins
_FAR: Final = 30.0  # the same for one spectrum by itself, from its median
_STEP: Final = 1e-4  # of differences
_PRICE: Final = 2.0  # nats that a part of the road must bring


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """Spectra of one device with or without a low-pass.

    Attributes
    ----------
    cost : float
        Negative log-likelihood [nats].
    mismatch : float
        Mean square of what is left over its expectation; 1 where the forms are right.
    smooth, white : tuple of ndarray
        For each spectrum the power without lines at all its frequencies, and that of the sensor
        alone.
    response : Response, optional
    delay_std_s : float
        Standard error of its delay.
    """

    cost: float
    mismatch: float
    smooth: tuple[FloatArray, ...]
    white: tuple[FloatArray, ...]
    response: Response | None = None
    delay_std_s: float = np.inf


def fitted(spectra: Sequence[Spectrum]) -> NoiseFit:
    """Fit without a filter."""
    problem = _Problem(tuple(spectra), None)
    return problem.result(problem.search(problem.begin()))


def with_low_pass(spectra: Sequence[Spectrum], most: float = np.inf) -> NoiseFit | None:
    """Fit with one filter for all the spectra; None where none costs less than `most`.

    A filter is analogue, or works at the rate of the log before samples are left out.
    """
    found = []
    for digital in (False, True):
        problem = _Problem(tuple(spectra), digital)
        for corner_hz in _CORNERS_HZ:
            x = problem.search(problem.begin(corner_hz))
            found.append((problem.state(x).cost, problem, x))
    cost, problem, x = min(found, key=lambda item: item[0])
    if not cost < most:
        return None  # nor does one with fewer parts of the road
    # Parts of the road that bring nothing would still bend the filter: they can only add. That one
    # cannot know whether they are there is part of the delay's uncertainty.
    less = _Problem(problem.spectra, problem.digital, problem.worth(x))
    return less.result(less.search(less.kept(x)), problem.delay_std_s(x))


@dataclass(frozen=True, eq=False)
class _State:
    cost: float
    slope: FloatArray
    information: FloatArray
    powers: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class _Problem:
    """Logarithms of a response and of the parts of each spectrum."""

    spectra: tuple[Spectrum, ...]
    digital: bool | None
    needed: tuple[npt.NDArray[np.bool_], ...] | None = None

    @property
    def _shared(self) -> int:
        return 0 if self.digital is None else _SHARED

    @cached_property
    def _places(self) -> tuple[slice, ...]:
        ends = np.cumsum([self._shared, *(count(s) for s in self.spectra)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @cached_property
    def _images(self) -> tuple[list[tuple[FloatArray, FloatArray]], ...]:
        return tuple(images_of(s, s.frequency_hz[s.used], self.digital) for s in self.spectra)

    @cached_property
    def _first_alike(self) -> list[int]:
        """For each spectrum, the first one with the same frequencies: a filter does the same there.

        Those of one device, as a rule.
        """
        seen: dict[tuple[float, float, bytes], int] = {}
        return [
            seen.setdefault((s.rate_hz, s.rows_hz, s.frequency_hz[s.used].tobytes()), n)
            for n, s in enumerate(self.spectra)
        ]

    @cached_property
    def _bounds(self) -> FloatArray:
        middle = self._levels
        bounds: FloatArray = np.array([middle - _LOST, middle + _LOST])
        if self._shared:
            bounds[:, :_SHARED] = _BOUNDS
        if self.needed is not None:
            for place, needed in zip(self._places, self.needed, strict=True):
                bounds[1, place] = np.where(needed, bounds[1, place], bounds[0, place])
        return bounds

    @cached_property
    def _levels(self) -> FloatArray:
        x = np.zeros(self._places[-1].stop)
        for place, s in zip(self._places, self.spectra, strict=True):
            power = s.power[s.used]
            early = power[: max(power.size // 4, 1)] if self._shared else power
            x[place] = np.log(0.3 * np.median(early))
            x[place.start] = np.log(np.median(early))
        return x

    def begin(self, corner_hz: float = np.inf) -> FloatArray:
        x = self._levels.copy()
        if self._shared:
            x[:_SHARED] = np.log([corner_hz, _USUAL_DAMPING, 0.1 * _AFTER])
        return x

    def kept(self, x: FloatArray) -> FloatArray:
        return np.clip(x, *self._bounds)

    def _response(self, x: FloatArray) -> Response | None:
        if self.digital is None:
            return None
        corner, damping, after = (float(v) for v in np.exp(x[:_SHARED]))
        return Response(corner, damping, after, self.digital)

    def state(self, x: FloatArray) -> _State:
        """Cost, its slope, and the information, at the parameters."""
        cost, slope, information = 0.0, np.zeros(x.size), np.zeros((x.size, x.size))
        every = [x, *(x + _STEP * row for row in np.eye(x.size)[: self._shared])]
        responses = [r for r in map(self._response, every) if r is not None]
        factors: dict[int, list[list[FloatArray]]] = {}
        powers = []
        for n, (place, s, images) in enumerate(
            zip(self._places, self.spectra, self._images, strict=True)
        ):
            amounts, parts = np.exp(x[place]), images[0][1]
            first = self._first_alike[n]
            if first not in factors:
                factors[first] = [[r.power(f, s.rows_hz) for f, _ in images] for r in responses]
            alike = factors[first]
            if responses:
                parts = folded(images, alike[0], responses[0])
            model = amounts @ parts + s.floor
            jacobian = np.zeros((x.size, model.size))
            jacobian[place] = amounts[:, None] * parts / model
            if responses:
                before = [amounts @ forms for _, forms in images]
                for k, other in enumerate(responses[1:]):
                    moved = sum(
                        (b * p for b, p in zip(before, alike[k + 1], strict=True)),
                        amounts[0] * other.after + s.floor,
                    )
                    jacobian[k] = (moved / model - 1.0) / _STEP
            ratio = s.power[s.used] / model
            cost += s.weight * float(np.sum(np.log(model) + ratio))
            slope += s.weight * (jacobian @ (1.0 - ratio))
            information += s.weight * (jacobian @ jacobian.T)
            powers.append(model)
        if self._shared:
            off = (x[1] - np.log(_USUAL_DAMPING)) / _SPREAD
            cost += 0.5 * float(off**2)
            slope[1] += off / _SPREAD
            information[1, 1] += _SPREAD**-2
        return _State(cost, slope, information, tuple(powers))

    def search(self, x: FloatArray) -> FloatArray:
        """Fisher scoring, damped."""
        low, high = self._bounds
        x = np.clip(x, low, high)
        state, damping = self.state(x), 1.0
        for _ in range(_ROUNDS):
            check_time()
            held = ((x <= low + 1e-9) & (state.slope > 0.0)) | (
                (x >= high - 1e-9) & (state.slope < 0.0)
            )
            free = ~held
            if not free.any():
                break
            matrix = state.information[np.ix_(free, free)].copy()
            matrix[np.diag_indices_from(matrix)] += damping * 0.1 * (np.diag(matrix) + 1.0)
            step = np.zeros(x.size)
            step[free] = -np.linalg.solve(matrix, state.slope[free])
            trial = np.clip(x + np.clip(step, -2.0, 2.0), low, high)
            new = self.state(trial)
            if new.cost <= state.cost:
                done = state.cost - new.cost < 1e-3 and damping < 10.0
                x, state, damping = trial, new, max(0.25 * damping, 1e-4)
                if done:
                    break
            elif damping > 1e8:
                break
            else:
                damping *= 6.0
        return x

    def worth(self, x: FloatArray) -> tuple[npt.NDArray[np.bool_], ...]:
        """Parts of the road that pay, for each spectrum, with the response as it is."""
        here = self._response(x)
        result = []
        for place, s, images in zip(self._places, self.spectra, self._images, strict=True):
            parts = parts_of(images, here, s)
            needed = np.ones(len(parts), dtype=bool)
            cost, amounts = _amounts(s, parts, np.exp(x[place]))
            while True:
                check_time()
                trials = []
                for k in np.flatnonzero(needed[ROAD]) + 1:
                    without = needed.copy()
                    without[k] = False
                    trials.append((*_amounts(s, parts[without], amounts[without]), int(k)))
                best = min(trials, key=lambda t: t[0], default=None)
                if best is None or best[0] - cost > _PRICE:
                    break
                needed[best[2]] = False
                cost, amounts[needed] = best[0], best[1]
            result.append(needed)
        return tuple(result)

    def delay_std_s(self, x: FloatArray) -> float:
        """Standard error of the delay, with everything else open."""
        response = self._response(x)
        if response is None:
            return np.inf
        # A tiny ridge for parts that are nothing.
        covariance = np.linalg.inv(self.state(x).information + 1e-6 * np.eye(x.size))
        slope = np.zeros(x.size)
        slope[:2] = -response.delay_s, response.delay_s
        return float(np.sqrt(slope @ covariance @ slope))

    def result(self, x: FloatArray, delay_std_s: float = np.inf) -> NoiseFit:
        state, response = self.state(x), self._response(x)
        left = expected = 0.0
        smooth, white = [], []
        for place, s, model in zip(self._places, self.spectra, state.powers, strict=True):
            ratio = s.power[s.used] / model
            left += 2.0 * s.weight * float(np.sum(ratio - 1.0 - np.log(ratio)))
            expected += s.independent
            amounts = np.exp(x[place])
            lowest, highest = s.frequency_hz[s.used][[0, -1]]
            parts = parts_of(images_of(s, s.frequency_hz, self.digital), response, s)
            amounts[ROAD.stop :] = 0.0
            inside = np.clip(s.frequency_hz, lowest, highest)
            within = parts_of(images_of(s, inside, self.digital), response, s)
            smooth.append(amounts @ within + s.floor)
            white.append(amounts[0] * parts[0] + s.floor)
        return NoiseFit(
            state.cost, left / expected, tuple(smooth), tuple(white), response, delay_std_s
        )


def _amounts(s: Spectrum, parts: FloatArray, begin: FloatArray) -> tuple[float, FloatArray]:
    """Amounts of given parts that fit one spectrum, and the cost."""
    power = s.power[s.used]

    def cost(x: FloatArray) -> tuple[float, FloatArray]:
        amounts = np.exp(x)
        model = amounts @ parts + s.floor
        slope = s.weight * (amounts[:, None] * parts / model) @ (1.0 - power / model)
        return s.weight * float(np.sum(np.log(model) + power / model)), slope

    usual = float(np.log(np.median(power)))
    bounds = (usual - _FAR, usual + _FAR)
    x = np.clip(np.log(np.maximum(begin, 1e-300)), *bounds)
    found = scipy.optimize.minimize(cost, x, jac=True, method="L-BFGS-B", bounds=[bounds] * x.size)
    return float(found.fun), np.exp(found.x)
