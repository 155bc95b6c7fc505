"""What the residuals of a curve say against it, and against what was told of the readings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ..._common.text import HALF_95
from ...errors import InvalidInput
from ...rules import USUAL
from .curve import MAGIC_FORMULA, TWO_PARAMETER, MuSlipCurve
from .data import MuSlipData
from .least_squares import mu_slip_fit
from .results import MuSlipEstimate

_FEWEST = 20  # readings that the normal distribution of the ratio takes
_ROUNDS = 100  # of a fit
_FIRST = 0.01  # of the readings' range: the offset that is tried first
_LARGEST_CONDITION = 1e14
_STEP = 1e-5  # of slip, for the slope of a curve
_TWICE = 1.5  # by how much squares of differences that share a reading scatter more
_NOISY = (
    "slip: readings scatter more where the curve is steep, as noise of about {noise:.2g} in it "
    "makes them: values are off by more than their standard deviation, which takes it as free of "
    "noise; filter or smooth the wheel speed"
)
_CAUSES = {
    "slip": "the speed or the rolling radius was told wrong by {share:.2g} %",
    "mu": "a slope of the road, drag, or an offset of the sensor is in it",
}


@dataclass(frozen=True)
class _Shifted:
    """A curve that fits once an offset is taken off slip or mu."""

    channel: str
    offset: float
    std: float
    values: FloatArray
    left: FloatArray
    p_value: float

    @property
    def squares(self) -> float:
        return float(self.left @ self.left)

    def moved(self, slip: FloatArray) -> FloatArray:
        return slip - self.offset if self.channel == "slip" else slip

    def text(self, curve: MuSlipCurve) -> str:
        values = (f"{n} {x:.4g}" for n, x in zip(curve.parameters[:2], self.values, strict=False))
        cause = _CAUSES[self.channel].format(share=100.0 * abs(self.offset))
        return (
            f"{self.channel}: with an offset of {self.offset:.3g} +- {self.std:.2g} the curve fits "
            f"(without one p = {self.p_value:.2g}), with {', '.join(values)}: {cause}"
        )


def doubts(data: MuSlipData, found: MuSlipEstimate) -> list[str]:
    """Say what speaks against an estimate; nothing where the curve leaves white noise as told.

    Offsets come first: they look like a curve of another kind. What is left over the slip, or over
    the order of the readings, is told by J. von Neumann's ratio, Ann. Math. Statist. 12 (1941),
    p. 367: neighbours differ by less than readings with white noise do.
    """
    there = np.isfinite(data.mu)
    slip, mu = data.slip[there], data.mu[there]
    error = mu - found.curve.mu(slip, found.values)
    if error.size < _FEWEST or not error.any():
        return []
    over_slip = _alike(error[np.argsort(slip, kind="stable")])
    shifted = () if found.at_bound else _shifted(found, slip, mu)
    best = shifted[0] if shifted else None
    noise = (
        _noise_of_slip(found.curve, slip, found.values, error)
        if best is None
        else _noise_of_slip(found.curve, best.moved(slip), best.values, best.left)
    )
    notes = []
    if noise > 0.0:
        notes = [_NOISY.format(noise=noise)]
        # An offset that noise in the slip may look like is not told beside it.
        reach = {"slip": noise, "mu": noise * _steepest(found, slip)}
        shifted = tuple(one for one in shifted if abs(one.offset) > reach[one.channel])
    if shifted and not _other_curve_is_better(data, found.curve, shifted[0]):
        text = "; as likely, ".join(one.text(found.curve) for one in shifted)
        note = "; take it off, values here are off by more than their standard deviation"
        return [*notes, text + note]
    if notes:
        return notes
    if over_slip < USUAL.strict:
        others = [c.name for c in (TWO_PARAMETER, MAGIC_FORMULA) if c is not found.curve]
        note = (
            f"the {found.curve.name} curve does not fit: what it leaves depends on the slip "
            f"(p = {over_slip:.2g}), so values may be off by more than their standard deviation; "
            f"try the {others[0]} curve, or, where noise is not white, filter less"
        )
        return [note]
    in_order = _alike(error)
    if in_order < USUAL.strict:
        note = (
            f"mu: what the curve leaves depends on the order of the readings (p = {in_order:.2g}): "
            "the road changed on the way, or noise is not white, and standard deviations are too "
            "small; take each road alone, or let the filter follow it (drift_std)"
        )
        return [note]
    return _noise_told(data.noise_std, error, len(found.values))


def _noise_of_slip(
    curve: MuSlipCurve, slip: FloatArray, values: FloatArray, left: FloatArray
) -> float:
    """Standard deviation of noise in the slip, where the readings show some; else zero.

    It makes readings scatter with the slope of the curve: R. Koenker's test, J. Econometrics 17
    (1981), p. 107. Neighbours over the slip are compared: what else bends the readings is the same
    in both.
    """
    order = np.argsort(slip, kind="stable")
    steep = _over_slip(curve, slip[order], values) ** 2
    squares = 0.5 * np.diff(left[order]) ** 2
    of = 0.5 * (steep[1:] + steep[:-1])
    away, swing = of - of.mean(), squares - squares.mean()
    slope = float(away @ swing) / max(float(away @ away), 1e-300)
    explained = slope * float(away @ swing) / max(float(swing @ swing), 1e-300)
    p_value = 0.5 * math.erfc(math.sqrt(0.5 * squares.size * explained / _TWICE))
    return math.sqrt(slope) if slope > 0.0 and p_value < USUAL.strict else 0.0


def _over_slip(curve: MuSlipCurve, slip: FloatArray, values: FloatArray) -> FloatArray:
    """Derivative of the curve by the slip."""
    after, before = (curve.mu(slip + side * _STEP, values) for side in (1.0, -1.0))
    return as_float64((after - before) / (2.0 * _STEP))


def _steepest(found: MuSlipEstimate, slip: FloatArray) -> float:
    return float(np.abs(_over_slip(found.curve, slip, found.values)).max())


def _alike(left: FloatArray) -> float:
    """Probability that white noise has neighbours as much alike."""
    n = left.size
    ratio = float(np.sum(np.diff(left) ** 2)) / float(left @ left)
    below = (2.0 - ratio) / (2.0 * math.sqrt((n - 2.0) / (n**2 - 1.0)))
    return 0.5 * math.erfc(below / math.sqrt(2.0))


def _noise_told(told: float | None, error: FloatArray, parameters: int) -> list[str]:
    """Say that readings scatter by more or less than was told, by the chi-square test."""
    if told is None:
        return []
    freedom = error.size - parameters
    squares = float(error @ error)
    half = 0.5 * freedom, 0.5 * squares / told**2
    p_value = 2.0 * min(scipy.special.gammainc(*half), scipy.special.gammaincc(*half))
    if p_value >= USUAL.strict:
        return []
    seen = math.sqrt(squares / freedom)
    small = seen > told
    factor = seen / told if small else told / seen
    note = (
        f"noise_std: readings scatter by {seen:.3g} about the curve, {told:.3g} was told: standard "
        f"deviations are {factor:.2g} times too {'small' if small else 'large'}; leave it out, and "
        "it is learnt"
    )
    return [note]


def _shifted(found: MuSlipEstimate, slip: FloatArray, mu: FloatArray) -> tuple[_Shifted, ...]:
    """Offsets with which the curve fits, where the readings ask for one; the best one first."""
    curve = found.curve
    freedom = slip.size - len(found.values) - 1
    _, squares = _fitted(curve, slip, mu, found.values)
    result = []
    for channel in _CAUSES:
        sides = (1.0, 0.0) if channel == "slip" else (0.0, 1.0)

        def at(offset: float, sides: tuple[float, float] = sides) -> tuple[FloatArray, float]:
            return _fitted(curve, slip - sides[0] * offset, mu - sides[1] * offset, found.values)

        step = _FIRST * float(np.ptp(slip if channel == "slip" else mu))
        search = scipy.optimize.minimize_scalar(lambda x, at=at: at(x)[1], bracket=(0.0, step))
        offset = float(search.x)
        values, shifted = at(offset)
        gain = (squares - shifted) / max(shifted, 1e-300) * freedom
        p_value = float(scipy.special.betainc(0.5 * freedom, 0.5, freedom / (freedom + gain)))
        if not p_value < USUAL.strict:
            continue
        moved = slip - sides[0] * offset
        left = mu - sides[1] * offset - curve.mu(moved, values)
        slope = _slopes(curve, moved, values, channel)
        information = slope.T @ slope
        fits = _alike(left[np.argsort(slip, kind="stable")]) >= USUAL.strict
        if fits and np.linalg.cond(information) < _LARGEST_CONDITION:
            inverse = np.linalg.inv(information)
            std = math.sqrt(shifted / freedom * inverse[-1, -1])
            # Readings that count for much and scatter more than others say less than they seem to.
            std = max(std, _uneven_std(slope, as_float64(inverse), as_float64(left)))
            if math.erfc(abs(offset) / std / math.sqrt(2.0)) < USUAL.strict:
                result.append(_Shifted(channel, offset, std, values, as_float64(left), p_value))
    result.sort(key=lambda one: one.squares)
    least = result[0].squares if result else 0.0
    return tuple(r for r in result if freedom * math.log(r.squares / least) < HALF_95**2)


def _uneven_std(slope: FloatArray, inverse: FloatArray, left: FloatArray) -> float:
    """Standard deviation of the last parameter under noise of another size at every reading.

    J. G. MacKinnon & H. White, J. Econometrics 29 (1985), p. 305: the estimate called HC3.
    """
    share = slope @ inverse[:, -1]
    leverage = np.einsum("ni,ij,nj->n", slope, inverse, slope)
    return math.sqrt(float(np.sum((share * left / (1.0 - leverage).clip(0.01)) ** 2)))


def _other_curve_is_better(data: MuSlipData, curve: MuSlipCurve, shifted: _Shifted) -> bool:
    """Whether the other curve explains the readings without an offset, by BIC."""
    other = TWO_PARAMETER if curve is MAGIC_FORMULA else MAGIC_FORMULA
    try:
        values = mu_slip_fit(replace(data, noise_std=None), curve=other).values
    except InvalidInput:
        return False
    left = data.mu - other.mu(data.slip, values)
    n, squares = shifted.left.size, float(np.nansum(left**2))
    more = len(other.parameters) - len(curve.parameters) - 1
    return n * math.log(squares / shifted.squares) + more * math.log(n) < 0.0


def _fitted(
    curve: MuSlipCurve, slip: FloatArray, mu: FloatArray, near: FloatArray
) -> tuple[FloatArray, float]:
    """Least squares of the parameters and their sum, the better from two starts."""
    ends = as_float64(curve.kernels.LOWER), as_float64(curve.kernels.UPPER)
    starts = near, as_float64(curve.prior.mean)
    both = [curve.kernels.fit(slip, mu, start, *ends, _ROUNDS) for start in starts]
    found = min(both, key=lambda one: one["sum_of_squares"])
    return as_float64(found["mean"]), float(found["sum_of_squares"])


def _slopes(curve: MuSlipCurve, slip: FloatArray, values: FloatArray, channel: str) -> FloatArray:
    """Derivatives of a reading by the parameters and the offset."""
    own = curve.points(slip, values)[1]
    if channel == "mu":
        return np.hstack([own, np.ones((slip.size, 1))])
    return np.hstack([own, -_over_slip(curve, slip, values)[:, None]])
