"""Maximum likelihood of sensor faults, with the motion, the road and the noise unknown beside.

Gauss-Newton over the splines of the motion and the faults at once; the faults' information is the
Schur complement, so that their intervals hold whatever the motion was. What a fault does to the
readings is taken from a smoothed motion, as an instrument: the estimated one follows the noise of
all sensors, and noise times the derivative of noise moves delays and places by more than the rest
together. Smoothed or not, the motion is independent of the errors that it leaves, so that nothing
is biased (W. A. Fuller, Measurement Error Models, Wiley 1987, sec. 2.4). Noise is learned from
errors of motions drawn from the posterior (Monte Carlo EM: Wei & Tanner, JASA 85 (1990), 699-704),
because the errors of the best motion alone are too small where it follows the noise. The splines
are those of P. Furgale, T. D. Barfoot, G. Sibley, Continuous-time batch estimation using temporal
basis functions, ICRA 2012, which let every reading enter at its own time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import check_time
from .colour import Colour, fit_colour, neighbours
from .covariance import covariance_of, inflated
from .equations import FAULTS, SLIPS, Readings, predict
from .motion import QUICK, SLOW, Grid
from .one_sided import OneSided
from .road import Unevenness
from .system import Band, drawn, linearise, normal_equations, whitened_errors

LEVEL_MPS2 = 0.05
"""Change of gravity within a second on a road that counts as level."""
_ROUNDS = 30
_LEAST_ROUNDS = 8
_DRAWS = 2
_ORDER = 4  # of the colour of the noise, within the bandwidth of the splines
_STEP_S = 0.06  # largest change of a delay in one round
_LARGEST_DELAY_S = 0.28  # the splines reach no farther
_SETTLED = 0.03  # of a standard deviation
# Second derivatives of speeds and yaw rate: so large that they matter only without readings.
_ROUGH = {"vx": 300.0, "vy": 300.0, "yaw": 100.0}
_ROAD_ROUNDS = 3  # the road is learned in every third round at least
_BACK = 0.5  # of the last step
_NEARLY = 0.3  # of a standard deviation: near enough to learn it, and at the end


@dataclass(frozen=True, eq=False)
class Estimate:
    """Faults with their covariance, noise, road and motion.

    Attributes
    ----------
    faults : dict of float
        By name.
    covariance : ndarray, shape (n, n)
        Of the faults, with the errors' dependence over time allowed for.
    information : ndarray, shape (n, n)
        Fisher information of the faults, prior included.
    null_covariance : ndarray, shape (n, n)
        The covariance were there no fault.
    prior : ndarray, shape (n,)
        The prior's part in its diagonal.
    colours : dict of Colour
        Noise by channel.
    offsets : dict of (value, standard deviation)
        Mean of `grade` and `bank` [m/s2].
    road_mps2 : dict of float
        How much they change within a second.
    x : ndarray
        Coefficients of the motion.
    grid : Grid
        Its knots.
    rounds : int
        Rounds until nothing moved any more.
    settled : bool
        Whether that was reached, or nearly.
    factor : ndarray, shape (width, grid.size)
        Banded Cholesky factor of the motion's information, the faults held.
    across : ndarray, shape (grid.size, n)
        How the motion moves against the faults.
    """

    faults: dict[str, float]
    covariance: FloatArray
    information: FloatArray
    null_covariance: FloatArray
    prior: FloatArray
    colours: dict[str, Colour]
    offsets: dict[str, tuple[float, float]]
    road_mps2: dict[str, float]
    x: FloatArray
    grid: Grid
    rounds: int
    settled: bool
    factor: FloatArray
    across: FloatArray

    @property
    def slips(self) -> dict[str, float]:
        """Slip per acceleration of wheels whose speed is logged [s2/m]; empty where none is."""
        return {name: x for name, x in self.faults.items() if name in SLIPS}

    @property
    def leaning_with_turns(self) -> float:
        """The scale of a_y that a road has which leans with its turns as it leans elsewhere.

        Roads are built to lean with their turns. That part reads as a scale of a_y, and what is
        left of the road tells how large it may be: on level ground nothing.
        """
        vx, yaw, bank = (self.x[self.grid.index[name]] for name in ("vx", "yaw", "bank"))
        turning = float(np.std(vx * yaw))
        return float(np.std(bank)) / turning if turning > 0.0 else 0.0

    @property
    def hilly(self) -> bool:
        """Whether the road climbs and falls by more than one that counts as level."""
        return self.road_mps2["grade"] > LEVEL_MPS2

    @property
    def slowing_on_climbs(self) -> tuple[float, float]:
        """The scale of a_x, and the delay of the speeds [s], that a driver makes up on hills.

        A car slows where the road climbs and gains where it falls, sooner or later: so much of the
        slope goes with the change of the speed, or with the change of that. How far the road
        climbs tells how large either may be: where it brakes hard next to nothing, and nothing
        where it counts as level.
        """
        if not self.hilly:
            return 0.0, 0.0
        grade = float(np.std(self.x[self.grid.index["grade"]]))
        felt = (self.grid.changes(self.x, "vx", order) for order in (1, 2))
        scale, late_s = (grade / float(np.std(a)) if np.any(a) else 0.0 for a in felt)
        return scale, late_s

    def draw(
        self, count: int, seed: int | np.random.Generator = 0
    ) -> tuple[FloatArray, FloatArray]:
        """Motions and faults as likely as the estimate leaves them.

        Parameters
        ----------
        count : int
            How many.
        seed : int or Generator

        Returns
        -------
        x : ndarray, shape (grid.size, count)
            Coefficients of the motion.
        faults : ndarray, shape (n, count)
            In the order of `faults`.
        """
        rng = np.random.default_rng(seed)
        numbers = rng.standard_normal((self.x.size, count))
        values = np.array(list(self.faults.values()))
        root = np.linalg.cholesky(self.covariance)
        apart = root @ rng.standard_normal((values.size, count))
        x = self.x[:, None] + drawn(self.factor, numbers) - self.across @ apart
        return as_float64(x), as_float64(values[:, None] + apart)


def estimate(
    readings: Sequence[Readings],
    grid: Grid,
    names: Sequence[str],
    *,
    floors: dict[str, float],
    begin: dict[str, float] | None = None,
    seed: int = 0,
) -> Estimate:
    """Estimate the faults `names`.

    Parameters
    ----------
    readings : sequence of Readings
        One per channel.
    grid : Grid
        Knots of the motion.
    names : sequence of str
        Faults to estimate, of `FAULTS`.
    floors : dict of float
        Least standard deviation of each channel's noise.
    begin : dict of float, optional
        Where the search begins, by fault; without it, where nothing is wrong.
    seed : int
        Of the draws that teach the noise.

    Raises
    ------
    NumericalError
        If the motion cannot be told.
    """
    numbers = np.random.default_rng(seed).standard_normal((grid.size, _DRAWS))
    faults = dict.fromkeys(names, 0.0) | (begin or {})
    typical = np.array([FAULTS[name].typical for name in names])
    most = np.array([FAULTS[name].most for name in names])
    runs = {r.channel: neighbours(r.stretch, r.time_s) for r in readings}
    x, colours = _begin(readings, grid, floors)
    uneven = {signal: Unevenness(grid.steps(signal)) for signal in SLOW}
    gains = OneSided(names)
    settled, road, last = False, dict[str, float](), np.zeros(len(names))
    for count in range(1, _ROUNDS + 1):
        check_time()
        system = linearise(readings, grid, x, faults, colours, runs, calm=grid.smoothed(x))
        before, road = road, {signal: slope.std_mps2 for signal, slope in uneven.items()}
        if road != before:
            rows = _rows(readings, grid, road)
        now = np.array([faults[name] for name in names])
        # Cauchy's prior at its present curvature.
        prior = np.diag(2.0 / (typical**2 + now**2) + most**-2.0)
        normal = normal_equations(system, rows, x, prior, now)
        std = np.sqrt(np.diag(np.linalg.inv(normal.information)))
        # The motion of the speeds alone is too rough to tell from its derivatives what faults do:
        # all sensors settle it first.
        settles = count == 1
        wanted = np.zeros(now.size) if settles else gains.step(normal, now)
        last = step = _bounded(_calmed(wanted, last, normal.information), names, faults)
        dx = normal.motion_step - normal.across @ step
        x = x + dx
        for name, change in zip(names, step, strict=True):
            faults[name] += float(change)
        moved = float(np.max(np.abs(step) / std, initial=0.0))
        at_rest = all(slope.at_rest for slope in uneven.values())
        settled = count >= _LEAST_ROUNDS and moved < _SETTLED and at_rest
        if settled:
            break
        # The same numbers in each round: then the rounds converge.
        varied = normal.band.draw(numbers)
        if count > 1:
            for r in readings:
                c = r.channel
                left = system.errors[c] - system.raw_motion[c] @ dx - system.raw_faults[c] @ step
                errors = left[None, :] - (system.raw_motion[c] @ varied).T
                colours[c] = fit_colour(errors, runs[c], floors[c], _ORDER)
        if moved < _NEARLY or count % _ROAD_ROUNDS == 0:
            for slope in uneven.values():
                slope.improve(x, normal.band)
                if not slope.at_rest:
                    gains.forget()
    # Noise and road may creep on, which moves no fault by anything that matters.
    settled = settled or moved < _NEARLY
    # On a smooth motion delays are not told from places by what is noise. Faults that act alike
    # where there are none look told apart where the estimate has left zero: a delay at constant
    # speed is the place of the IMU, up to the square of the delay.
    calm = grid.smoothed(x)

    def smooth(at: FloatArray) -> FloatArray:
        there = linearise(
            readings, grid, calm, dict(zip(names, at.tolist(), strict=True)), colours, runs
        )
        equations = normal_equations(there, rows, calm, prior, at)
        return covariance_of(
            readings, replace(there, white=system.white, weights=system.weights), equations
        )

    inverse = as_float64(np.linalg.inv(normal.information))
    return Estimate(
        faults,
        inflated(covariance_of(readings, system, normal), np.diag(smooth(now))),
        normal.information,
        smooth(np.zeros(len(names))),
        np.diag(prior),
        colours,
        _offsets(grid, x, normal.band, normal.across, inverse),
        road,
        x,
        grid,
        count,
        settled,
        normal.band.factor,
        normal.across,
    )


def preferred(
    misfit_of: Callable[[Estimate, Estimate], float], one: Estimate, other: Estimate
) -> float:
    """How much likelier one explanation is than another, priors included [nats].

    Each is judged with the noise that either has learned: with its own alone, one that lays much
    to noise would have no misfit.

    Parameters
    ----------
    misfit_of : callable
        `misfit` of the readings, from an explanation and what has learned the noise.
    one, other : Estimate
    """
    claimed = set(one.faults) - set(other.faults)
    costs = [
        sum(FAULTS[name].cost(f, one_sided=name in claimed) for name, f in of.faults.items())
        for of in (other, one)
    ]
    apart = sum(misfit_of(other, noise) - misfit_of(one, noise) for noise in (one, other))
    return costs[0] - costs[1] + 0.5 * apart


def misfit(readings: Sequence[Readings], found: Estimate, noise: Estimate) -> float:
    """Half the squares of the errors and of the motion, the motion at its best."""
    runs = {r.channel: neighbours(r.stretch, r.time_s) for r in readings}
    rows = _rows(readings, found.grid, noise.road_mps2)

    system = linearise(readings, found.grid, found.x, found.faults, noise.colours, runs)
    none = np.zeros(len(found.faults))
    x = found.x + normal_equations(system, rows, found.x, np.eye(none.size), none).motion_step
    left = whitened_errors(readings, found.grid, x, found.faults, noise.colours, runs)
    total = 0.5 * float(np.sum((rows @ x) ** 2))
    for white, weight in left.values():
        total += float(np.sum((1.0 / weight - 0.5) * (weight * white) ** 2))  # Huber's
    return total


def noise_of(
    readings: Sequence[Readings], found: Estimate, floors: dict[str, float]
) -> dict[str, tuple[Colour, FloatArray]]:
    """Noise of each channel at its own rate, and what it should have read."""
    result = {}
    for r in readings:
        expected, _, _ = predict(r, found.grid, found.x, found.faults)
        run = neighbours(r.stretch, r.time_s)
        result[r.channel] = (
            fit_colour((r.values - expected)[None], run, floors[r.channel]),
            expected,
        )
    return result


def _begin(
    readings: Sequence[Readings], grid: Grid, floors: dict[str, float]
) -> tuple[FloatArray, dict[str, Colour]]:
    """Motion from speeds and yaw rate alone, noise from second differences."""
    rows = [_levels(readings, grid), *(grid.bends(s) / _ROUGH[s] for s in QUICK)]
    values, colours = [np.zeros(row.shape[0]) for row in rows], {}
    for r in readings:
        c = r.channel
        second = np.diff(r.values, 2)
        std = float(np.sqrt(np.mean(np.clip(second, *np.percentile(second, (2, 98))) ** 2) / 6.0))
        std = max(std, floors[c])
        colours[c] = Colour(std, std, np.empty(0))
        if c in ("vx_mps", "vy_mps", "yaw_rate_radps"):
            _, j, _ = predict(r, grid, np.zeros(grid.size), {})
            rows.append(j / std)
            values.append(r.values / std)
    j = scipy.sparse.vstack(rows, format="csr")
    return Band(j).solve(j.T @ np.concatenate(values)), colours


def _levels(readings: Sequence[Readings], grid: Grid) -> scipy.sparse.csr_matrix:
    of = [r.stretch for r in readings if r.channel == "vy_mps"]
    return grid.levels(set(np.concatenate(of).tolist()) if of else set())


def _rows(
    readings: Sequence[Readings], grid: Grid, road: dict[str, float]
) -> scipy.sparse.csr_matrix:
    """Prior of the motion and of the road, whitened."""
    steps = [grid.steps(signal) / road[signal] for signal in SLOW]
    bends = [grid.bends(signal) / _ROUGH[signal] for signal in QUICK]
    return scipy.sparse.vstack([_levels(readings, grid), *steps, *bends], format="csr")


def _calmed(step: FloatArray, last: FloatArray, information: FloatArray) -> FloatArray:
    """Half of a step that takes back most of the last one: the whole one goes to and fro."""
    back = float(step @ information @ last) < -_BACK * float(last @ information @ last)
    return 0.5 * step if back else step


def _bounded(step: FloatArray, names: Sequence[str], faults: dict[str, float]) -> FloatArray:
    result = step.copy()
    for i, name in enumerate(names):
        if name.startswith("delay."):
            change = float(np.clip(step[i], -_STEP_S, _STEP_S))
            to = float(np.clip(faults[name] + change, -_LARGEST_DELAY_S, _LARGEST_DELAY_S))
            result[i] = to - faults[name]
        else:
            most = 10.0 * FAULTS[name].typical
            result[i] = float(np.clip(step[i], -most, most))
    return result


def _offsets(
    grid: Grid, x: FloatArray, band: Band, across: FloatArray, inverse: FloatArray
) -> dict[str, tuple[float, float]]:
    found = {}
    for signal in SLOW:
        at = grid.index[signal]
        mean = np.zeros(grid.size)
        mean[at] = 1.0 / at.size
        back = mean @ across
        variance = float(mean @ band.solve(mean)) + float(back @ inverse @ back)
        found[signal] = (float(mean @ x), float(np.sqrt(variance)))
    return found
