"""What is asked of the data: free parameters, where they are looked for, and the likelihood.

The likelihood is that of the main job, of a model whose axle loads are logged and whose inputs are
held from sample to sample where a digital controller gave them. Factors of mass and yaw inertia,
the drag and the friction ellipse are effects of it, P1, P2 and P3 an effect of its own: a lateral
force m (P1 v_x^2 + P2 v_y + P3 r) of the stated mass.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...effects import base_parameters, effect
from ...effects.formula import TARGETS, trace
from ...errors import InvalidInput, near_names
from ...estimate import MEASURED, NoiseModel
from ...identify.search.objective import Objective, gaussian_prior
from ...identify.search.search import Box
from ..observer.observed import READINGS
from .data import SHORTEST, GreyBoxVehicle, TyreLog
from .fit import ELLIPSE, PARAMETERS

_TYRES = base_parameters()[:8]
BOX: dict[str, tuple[float, float]] = {
    **{p.name: (p.lower, p.upper) for p in _TYRES},
    "P1": (-0.01, 0.01),
    "P2": (-1.0, 1.0),
    "P3": (-10.0, 10.0),
    "mass_factor": (0.5, 2.0),
    "yaw_inertia_factor": (0.3, 3.0),
    "drag_area_m2": (0.0, 10.0),
    ELLIPSE: (0.0, 1.5),
}
"""Where a search looks. Beyond E = 1 the curve would turn back to zero at large slip."""

_CAR = {"mass_factor": 1.0, "yaw_inertia_factor": 1.0, "drag_area_m2": 0.5, ELLIPSE: 0.0}
GIVEN = {p.name: p.typical for p in _TYRES} | _CAR
"""Where a search begins that is told nothing."""

_SETTLES_S = 1.0
# Of the disturbances: what steps of 10 ms and axles without a width leave out. Beside the true
# tyres a step is 3e-7 m/s, 3e-6 m/s and 3e-6 rad/s off in a slide: ten times that per root second
# where each step errs anew, as of v_y and yaw rate, and a hundred times where all of a second err
# alike, as of v_x. Without that floor a minute of sliding is taken as one calculation, and its
# coefficients as known to the sixth figure.
_SMALLEST = np.array([1e-4, 1e-4, 1e-5, 1e-4, 3e-5, 3e-5, 3e-5])
_LARGEST = np.array([10.0, 10.0, 2.0, 20.0, 5.0, 5.0, 5.0])


_EFFECTS = ("mass", "yaw_inertia", "aero_drag", "combined_slip")  # of the last four parameters
_TERMS = ("P1", "P2", "P3")
_COLUMNS = np.array(  # of all parameters in the core's vector
    [
        *range(8),
        *(_core.USER_OFFSET + i for i in range(len(_TERMS))),
        *(effect(name).columns[0] for name in _EFFECTS),
    ]
)
_NULL = np.array([0.0] * (len(PARAMETERS) - 4) + [1.0, 1.0, 0.0, 0.0])
_YAW_INERTIA = 8  # place in the core's vector
_CHANNELS = [MEASURED.index(name) for name in READINGS]
# Of the core's noise parameters those that are learned: sensors, and what disturbs the motion.
_LEARNED = [*_CHANNELS, *range(len(MEASURED), len(MEASURED) + 3)]
_NO_NOISE = NoiseModel((1.0,) * len(MEASURED), (0.0,) * 3, (0.0,) * 3, (0.5,) * 3).vector()


def first_point(start: Mapping[str, float]) -> FloatArray:
    """All parameters in the core's order: the given ones, `GIVEN` for the rest."""
    _refuse_others(start)
    values = GIVEN | dict(start)
    return as_float64([values.get(name, 0.0) for name in PARAMETERS])


def _refuse_others(names: Iterable[str]) -> None:
    for name in names:
        if name not in PARAMETERS:
            raise InvalidInput(f"there is no parameter '{name}'{near_names(name, PARAMETERS)}")


def box_of(free: Sequence[str], bounds: Mapping[str, tuple[float, float]]) -> Box:
    """Box of the free parameters; `BOX` where `bounds` says nothing."""
    _refuse_others(bounds)
    table = np.array([(BOX | dict(bounds))[n] for n in free], dtype=float)
    if not np.all(table[:, 0] < table[:, 1]):
        worst = free[int(np.argmin(table[:, 1] - table[:, 0]))]
        raise InvalidInput(f"bounds of {worst} are {bounds[worst]}; give (lower, upper)")
    return Box([PARAMETERS.index(n) for n in free], table[:, 0].copy(), table[:, 1].copy())


def _tolerances(vehicle: GreyBoxVehicle) -> dict[str, float]:
    """Factors that are not known exactly, and their standard deviations."""
    stated = {
        "mass_factor": vehicle.mass_tolerance,
        "yaw_inertia_factor": vehicle.yaw_inertia_tolerance,
    }
    return {name: tolerance for name, tolerance in stated.items() if tolerance > 0.0}


def free_parameters(
    vehicle: GreyBoxVehicle, *, residual_terms: bool = False, force_known: bool = True
) -> tuple[str, ...]:
    """Names of what is identified: both tyres, what the vehicle is not sure of, the drag.

    A measured acceleration has the drag in it, which then is none of them.
    """
    terms = ("P1", "P2", "P3") if residual_terms else ()
    drag = ("drag_area_m2",) if force_known else ()
    return (*PARAMETERS[:8], *terms, *_tolerances(vehicle), *drag)


@dataclass(frozen=True, eq=False)
class TyreProblem:
    """The main job's likelihood by the parameters and noises of tyre identification (`Predicting`).

    Parameters
    ----------
    problem : _core.Problem
    yaw_inertia_kgm2 : float
    """

    problem: _core.Problem
    yaw_inertia_kgm2: float

    @classmethod
    def of(
        cls,
        vehicle: GreyBoxVehicle,
        *,
        residual_terms: bool,
        inputs_held: bool = True,
        force_known: bool = True,
    ) -> TyreProblem:
        """Without runs; P1, P2, P3 act only in a problem with `residual_terms`."""
        terms = trace(
            lambda d, p: vehicle.mass_kg * (p.P1 * d.v_x**2 + p.P2 * d.v_y + p.P3 * d.r),
            _TERMS,
            "force_y",
            "P1 to P3",
        )
        mask = 0
        for name in _EFFECTS:
            mask |= effect(name).bit
        own: tuple[Any, ...] = (0, [], ((TARGETS.index("force_y"), terms.steps),), [])
        users = [own] if residual_terms else []
        model = _core.SingleTrack(vehicle.core(), mask, force_known, users, True, inputs_held)
        return cls(_core.Problem(model), vehicle.yaw_inertia_kgm2)

    def add_run(self, step_s: float, inputs: FloatArray, measurements: FloatArray) -> None:
        """Add a drive: inputs as in `TyreLog`, and `READINGS`."""
        y = np.full((len(measurements), len(MEASURED)), np.nan)
        y[:, _CHANNELS] = measurements
        self.problem.add_run(step_s, as_float64(inputs[:, [1, 0, 2, 3]]), y)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.problem.samples

    def _values(self, p: FloatArray) -> FloatArray:
        values = np.zeros((*p.shape[:-1], _core.PARAMETERS))
        values[..., _YAW_INERTIA] = self.yaw_inertia_kgm2
        values[..., _COLUMNS] = p - _NULL
        return values

    def freeze(self, p: FloatArray, noise: FloatArray) -> _core.FrozenFilter:
        """Gains of the filter."""
        return self.problem.freeze(self._values(p), _noise(noise))

    def log_likelihoods(self, sets: FloatArray, noise: FloatArray) -> FloatArray:
        """Log-likelihoods of sets of parameters, a row each."""
        return self.problem.log_likelihoods(self._values(sets), _noise(noise))

    def noise_score(self, p: FloatArray, noise: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Log-likelihood, its derivatives by the noise's logarithms, and their information."""
        value, slope, information = self.problem.noise_score(self._values(p), _noise(noise))
        return value, slope[_LEARNED], as_float64(information[np.ix_(_LEARNED, _LEARNED)])

    def residuals(self, p: FloatArray, gains: Any) -> FloatArray:
        """Whitened residuals."""
        return self.problem.residuals(self._values(p), gains)

    def half_sum_of_squares(self, p: FloatArray, gains: Any) -> float:
        """Half the sum of their squares."""
        return self.problem.half_sum_of_squares(self._values(p), gains)

    def sensitivities(self, p: FloatArray, gains: Any, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals, one row each."""
        return self.problem.sensitivities(self._values(p), gains, _COLUMNS[columns].tolist())

    def normal_equations(
        self, p: FloatArray, gains: Any, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, direction of descent, Gauss-Newton matrix."""
        return self.problem.normal_equations(self._values(p), gains, _COLUMNS[columns].tolist())

    def motion(self, p: FloatArray, noise: FloatArray) -> FloatArray:
        """Filtered v_x, v_y, r of every sample."""
        told = self.problem.trace(self._values(p), _noise(noise), False)
        return as_float64(told["state"][:, :3])

    def predicted(self, p: FloatArray, noise: FloatArray, ahead: int) -> FloatArray:
        """`READINGS` predicted so many samples ahead, shape (samples, 4)."""
        told = self.problem.look_ahead(self._values(p), _noise(noise), [(ahead, 1)], True)
        return as_float64(told[0][:, _CHANNELS])

    def free_run(self, p: FloatArray) -> FloatArray:
        """`READINGS` of runs simulated from their first ones, shape (samples, 4)."""
        return as_float64(self.problem.free_run(self._values(p))[:, _CHANNELS])


def _noise(learned: FloatArray) -> FloatArray:
    noise = _NO_NOISE.copy()
    noise[_LEARNED] = learned
    return noise


def objective_of(
    vehicle: GreyBoxVehicle,
    logs: Sequence[TyreLog],
    most_samples: int | None = None,
    *,
    residual_terms: bool = False,
) -> Objective:
    """Likelihood of logs thinned to `most_samples`, with priors where the vehicle is unsure."""
    problem = tyre_problem(vehicle, logs, most_samples=most_samples, residual_terms=residual_terms)
    unsure = {PARAMETERS.index(n): (1.0, std) for n, std in _tolerances(vehicle).items()}
    return Objective(problem, gaussian_prior(len(PARAMETERS), unsure), _SMALLEST, _LARGEST)


def tyre_problem(
    vehicle: GreyBoxVehicle,
    logs: Sequence[TyreLog],
    *,
    most_samples: int | None = None,
    window_s: float = 5.0,
    residual_terms: bool = False,
) -> TyreProblem:
    """The likelihood of logs; of about so many samples, if that is asked.

    Half of those are the windows of the hardest cornering, where tyres show their peak, half are
    spread evenly over the rest. Inputs of which nothing is said are taken as held.
    """
    held = all(log.inputs_held is not False for log in logs)
    problem = TyreProblem.of(
        vehicle,
        residual_terms=residual_terms,
        inputs_held=held,
        force_known=all(log.force_known for log in logs),
    )
    total = sum(log.n for log in logs)
    for log in logs:
        windows = [slice(0, log.n)]
        if most_samples is not None and total > most_samples:
            length = min(max(int(window_s / log.step_s), SHORTEST), log.n)
            windows = _telling(log, length, max(2, round(most_samples * log.n / total / length)))
        for window in windows:
            y = log.measurements[window].copy()
            if not log.sideslip_measured:
                # The first v_y is anyone's guess, and a filter that starts from a wrong one on
                # saturated tyres is led astray. A car forgets it within a second.
                y[: int(_SETTLES_S / log.step_s), 2:] = np.nan
            problem.add_run(log.step_s, log.inputs[window], as_float64(y))
    return problem


def _telling(log: TyreLog, length: int, count: int) -> list[slice]:
    tiles = [slice(k, k + length) for k in range(0, log.n - length + 1, length)]
    if count >= len(tiles):
        return tiles
    a_y = np.nan_to_num(np.abs(log.measurements[:, 3]))
    hard = [-float(np.percentile(a_y[t], 95.0)) for t in tiles]
    first = [int(i) for i in np.argsort(hard)[: count // 2]]
    rest = [i for i in range(len(tiles)) if i not in first]
    spread = np.linspace(0, len(rest) - 1, count - len(first)).round().astype(int)
    return [tiles[i] for i in sorted({*first, *(rest[k] for k in spread)})]
