"""The driving of a fit, driven again by its model with an effect more, and fitted without it.

The driver repeats what the log shows, once holding its motion and once its steering, at its speed.
Sensors and road have the noise that the fit learned: the same draw with every effect, with its sign
changed for the second driver. What is linear in the noise cancels in the mean of the two fits.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import check_time
from ...errors import NumericalError
from ...estimate import MEASURED, generous, steering_reach
from ...identify import Fit, free_box, objective_of, settle
from ...identify.search.search import Box, minimise
from ...log import Log
from ...model import Model
from ...simulate import RoadDisturbance
from ...vehicle import AXLES, GRAVITY_MPS2

# Slow enough to be quick; what tyres do to the motion is slower still.
_RATE_HZ = 25.0
_WINDOW_S = 10.0
_LOOKS, _ROUNDS = 3, 25
_BENDS = ((0.6, 1.6, 0.3), (1.3, 0.6, -3.0), (1.6, 1.0, 0.3))  # C, D, E
_AS_GOOD = 2.0  # nats
_A_X = MEASURED.index("ax_mps2")


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Uninterrupted driving to do again.

    Attributes
    ----------
    dt : float
    start_s : float
        Since the log began.
    motion : array, shape (n, 3)
        v_x, v_y [m/s] and yaw rate [rad/s] to hold.
    steer : array, shape (n,)
        Steering angle with which the car did it [rad].
    seen : array of bool, shape (n, 5)
        Which measurements there are.
    road : array, shape (n, 3)
        F_x, F_y [N] and M_z [N m] that act on the car.
    scatter : array, shape (n, 5)
        Noise of the sensors.
    channels : array, shape (n, channels in use)
        Columns of the log that effects of users read.
    shift : list of float
        By how much parameters differ in its log; empty where none does.
    """

    dt: float
    start_s: float
    motion: FloatArray
    steer: FloatArray
    seen: np.ndarray[tuple[int, int], np.dtype[np.bool_]]
    road: FloatArray
    scatter: FloatArray
    channels: FloatArray
    shift: list[float]


@dataclass(frozen=True, eq=False)
class Replay:
    """Driving of a fit that can be done again with effects that its model lacks.

    Attributes
    ----------
    fit : Fit
    most_samples : int
        Of driving that has more, windows are done again.
    seed : int
        Of the noise.
    """

    fit: Fit
    most_samples: int
    seed: int

    def refitted(self, acting: Model, sign: float, *, corrects: bool) -> FloatArray:
        """Drive with the model `acting`, and fit the fit's own model to that.

        Parameters
        ----------
        acting : Model
        sign : float
            Of the noise.
        corrects : bool
            Whether the driver holds the yaw rate of the log, or steers as it says. A car that
            he loses in this way he corrects.

        Returns
        -------
        array
            The core's parameter vector.

        Raises
        ------
        NumericalError
            The car cannot follow the driving, or the likelihood finds no end.
        """
        try:
            problem = self._driven(acting, sign, corrects)
        except NumericalError:
            if corrects:
                raise
            problem = self._driven(acting, sign, True)
        try:
            return self._fitted(problem)
        except (NumericalError, np.linalg.LinAlgError) as failure:
            raise NumericalError(f"the fit without it fails: {failure}") from failure

    def _fitted(self, problem: _core.Problem) -> FloatArray:
        model, box = self.fit.model, free_box(self.fit.model)
        every = _every(self.fit.driving.logs[0])
        noise = generous([s / np.sqrt(every) for s in self.fit.noise.sensor], model.vehicle)
        # First with disturbances everywhere: noise that is sure of the model, or has
        # taken up the effect before the parameters could, holds them where they are.
        p = model.vector()
        frozen = problem.freeze(p, noise.vector())
        _, p = min(self._ends(problem, (p, *self._bent(p)), frozen, box), key=_cost)
        objective, told = objective_of(model, problem, self.fit.driving), noise.vector()
        best = -np.inf
        for _ in range(_LOOKS):
            end, told, converged = settle(objective, p, told, box, rounds=_ROUNDS)
            if not converged:
                raise NumericalError("the fit without it does not converge")
            frozen = problem.freeze(end, told)
            if frozen.log_likelihood <= best:
                break
            found, best = end, frozen.log_likelihood
            # Now that the noise is known, do tyres that bend otherwise fit better?
            cost, p = min(self._ends(problem, self._bent(found), frozen, box), key=_cost)
            if cost > problem.half_sum_of_squares(found, frozen) - 1.0:
                break
        return found

    def rival(self) -> Model:
        """The fit's model, or one as good on this driving whose tyres have other peaks.

        An effect may act through what the driving does not determine, such as the peak of a tyre.
        """
        model, box = self.fit.model, free_box(self.fit.model)
        problem = self._driven(model, 1.0, True)
        p, every = model.vector(), _every(self.fit.driving.logs[0])
        sensor = tuple(s / np.sqrt(every) for s in self.fit.noise.sensor)
        frozen = problem.freeze(p, replace(self.fit.noise, sensor=sensor).vector())
        ends = self._ends(problem, (p.copy(), *self._bent(p)), frozen, box)
        enough = min(cost for cost, _ in ends) + _AS_GOOD
        peaks = [model.parameters[f"D_{axle}"].column for axle in AXLES]

        def away(end: FloatArray) -> float:
            return float(np.sum(np.abs(np.log(end[peaks] / p[peaks]))))

        return model.from_vector(max((end for cost, end in ends if cost <= enough), key=away))

    @staticmethod
    def _ends(
        problem: _core.Problem, starts: Iterable[FloatArray], frozen: _core.FrozenFilter, box: Box
    ) -> list[tuple[float, FloatArray]]:
        """Where searches from some starts end: half the sum of squares, and parameters."""
        ends = []
        for start in starts:
            check_time()
            begin = box.inside(start)
            found = minimise(problem, begin, frozen, box, tolerance=0.1)
            ends.append((found.cost, box.put(begin, found.x)))
        if not any(np.isfinite(cost) for cost, _ in ends):
            raise NumericalError("no fit without it has a finite likelihood")
        return ends

    def _bent(self, p: FloatArray) -> Iterator[FloatArray]:
        """The same parameters with tyres as stiff whose curves bend otherwise.

        The effect may bend them so that the way from the fitted curves leads to a bound.
        """
        columns = self.fit.model.parameters
        for C, D, E in _BENDS:
            other = p.copy()
            for axle in AXLES:
                b, c, d, e = (columns[f"{x}_{axle}"].column for x in "BCDE")
                other[b] *= p[c] * p[d] / (C * D)
                other[c], other[d], other[e] = C, D, E
            yield other

    def _driven(self, acting: Model, sign: float, corrects: bool) -> _core.Problem:
        """Drive it, and give what the sensors show to the fit's model."""
        driver = self._drivers[corrects]
        known = self.fit.driving.force_known
        core, p = acting.core(), acting.vector()
        problem = _core.Problem(self.fit.model.core(force_known=known))
        for s in self._stretches:
            references = self._references(s)
            v_x, v_y, yaw_rate = map(float, s.motion[0])
            inputs, _, outputs, lost_at = _core.simulate(
                core,
                p + np.array(s.shift) if s.shift else p,
                s.dt,
                references,
                driver,
                sign * s.road,
                v_x,
                v_y,
                yaw_rate,
                float(s.steer[0] - references[0, 2]),
                s.start_s,
                s.channels,
            )
            if lost_at < len(s.steer):
                raise NumericalError(
                    "the car with it cannot follow this driving: it is lost at "
                    f"t = {s.start_s + lost_at * s.dt:.6g} s"
                )
            reading = np.where(s.seen, outputs + sign * s.scatter, np.nan)
            if not known:
                inputs[:, 1] = outputs[:, _A_X]
                reading[:, _A_X] = np.nan
            inputs = as_float64(np.column_stack([inputs, s.channels]))
            problem.add_run(
                s.dt,
                inputs,
                as_float64(reading),
                s.start_s,
                # The car that was driven had stood so before.
                steer_before=[float(inputs[0, 0])] * steering_reach(1.0 / s.dt),
                shift=s.shift,
            )
        return problem

    @cached_property
    def _drivers(self) -> dict[bool, _core.Driver]:
        """By whether they correct what the car does."""
        made = {}
        for corrects in (True, False):
            driver = _core.Driver()
            driver.reaction_s = 0.0
            driver.speed_gain_ps = 5.0
            if not corrects:
                driver.yaw_rate_gain = driver.yaw_rate_integral_ps = 0.0
            driver.understeer_radps2pm = self._understeer
            driver.steer_limit_rad = 1.0
            driver.steer_rate_limit_radps = 1e3
            driver.drive_limit_n = driver.brake_limit_n = 1e6
            driver.power_limit_w = driver.force_rate_limit_nps = 1e9
            made[corrects] = driver
        return made

    @cached_property
    def _understeer(self) -> float:
        """Steering angle per lateral acceleration of the fitted tyres [rad s2/m], none below 0."""
        model = self.fit.model
        front, rear = (model.tyre(a).cornering_stiffness_per_load for a in AXLES)
        return max((1.0 / front - 1.0 / rear) / GRAVITY_MPS2, 0.0)

    def _references(self, s: _Stretch) -> FloatArray:
        """Speed, curvature, and what of the steering the driver does not add for the curvature."""
        v_x, curvature = s.motion[:, 0], s.motion[:, 2] / s.motion[:, 0]
        added = (self.fit.model.vehicle.wheelbase_m + self._understeer * v_x**2) * curvature
        return as_float64(np.column_stack([v_x, curvature, s.steer - added]))

    @cached_property
    def _stretches(self) -> tuple[_Stretch, ...]:
        fit, driving = self.fit, self.fit.driving
        rng = np.random.default_rng(self.seed)
        channels, measured = driving.channels(), driving.measured
        inputs = as_float64(np.column_stack([driving.inputs(), channels]))
        made = []
        for log, where, at in self._windows():
            here = slice(at, at + where.stop - where.start)
            start_s = where.start / log.rate_hz
            problem = _core.Problem(fit.model.core(force_known=driving.force_known))
            shift = driving.shift(fit.model, log)
            problem.add_run(1.0 / log.rate_hz, inputs[here], measured[here], start_s, shift=shift)
            motion = problem.smoothed_means(fit.model.vector(), fit.noise.vector())[:, :3]
            every = _every(log)
            parts = np.arange(0, len(motion), every)
            dt, n = every / log.rate_hz, len(parts)
            scatter = rng.standard_normal((n, 5)) * np.array(fit.noise.sensor) / np.sqrt(every)
            made.append(
                _Stretch(
                    dt,
                    start_s,
                    as_float64(motion[::every]),
                    as_float64(inputs[here][::every, 0]),
                    np.logical_or.reduceat(np.isfinite(measured[here]), parts, axis=0),
                    self._road(n, dt, rng),
                    as_float64(scatter),
                    as_float64(channels[here][parts]),
                    shift,
                )
            )
        return tuple(made)

    def _road(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """The disturbances that the fit's noise stands for: Ornstein-Uhlenbeck and white forces."""
        noise, model = self.fit.noise, self.fit.model
        x, y, moment = noise.disturbance
        times = noise.correlation_time_s
        single = ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, moment))
        disturbance = sum(
            RoadDisturbance(*size, time_s).sample(n, 1.0 / dt, rng)
            for size, time_s in zip(single, times, strict=True)
        )
        mass = model.vehicle.mass_kg
        inertia = np.array([mass, mass, model.value("yaw_inertia_kgm2")])
        white = rng.standard_normal((n, 3)) * np.array(noise.motion) * inertia / np.sqrt(dt)
        return as_float64(disturbance + white)

    def _windows(self) -> Iterator[tuple[Log, slice, int]]:
        """Logs, samples of them, and the place of the first among all usable samples.

        Of driving with more samples than are worth the time, windows evenly spread.
        """
        driving = self.fit.driving
        logs = [driving.logs[s.log] for s in driving.stretches]
        whole = sum(
            (end - at) / _every(log) for log, (at, end, _) in zip(logs, driving.spans, strict=True)
        )
        share = min(self.most_samples / whole, 1.0)
        for s, log, (at, _, _) in zip(driving.stretches, logs, driving.spans, strict=True):
            first, last = s.where.start, s.where.stop
            length = last - first if share == 1.0 else int(_WINDOW_S * log.rate_hz)
            for begin in range(first, last, int(np.ceil(length / share))):
                end = min(begin + length, last)
                if end - begin >= log.rate_hz:
                    yield log, slice(begin, end), at + begin - first


def _cost(end: tuple[float, FloatArray]) -> float:
    return end[0]


def _every(log: Log) -> int:
    return max(int(log.rate_hz / _RATE_HZ), 1)
