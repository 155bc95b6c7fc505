"""Changes of the tyres of both axles by one factor: what they reach at most, and their stiffness.

A wet road, warmer tyres, another set: Pacejka's scaling factors (Tire and Vehicle Dynamics, 3rd
ed., 4.3.1) are lambda_mu of the peak at the same cornering stiffness, D and 1/B by 1 + e, and
lambda_K of the stiffness at the same peak, B by 1 + e. Either is a change alone: in one driving it
is no more than other tyres, so that no model of the catalogue has it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect, Parameter
from ...errors import InvalidInput, NumericalError
from ...estimate import Driving
from ...model import Model
from ...tyre import TYRE_RANGES
from ...vehicle import AXLES
from .both_drivings import OneDriving
from .may_change import May

FRICTION, STIFFNESS = "friction_both_axles", "stiffness_both_axles"
_POWERS = {FRICTION: {"D": 1, "B": -1}, STIFFNESS: {"B": 1}}
# A wet road leaves a dry one's 1.0 at 0.6 to 0.8; tyres of other size, pressure or heat.
_USUAL = {FRICTION: 0.25, STIFFNESS: 0.15}
_RIVALS = {
    FRICTION: (STIFFNESS, "lateral_load_transfer", "aero_downforce"),
    STIFFNESS: (FRICTION, "mass", "steer_ratio"),
}
_MOVES = "ay_mps2, yaw_rate_radps"


def _effect(of: str) -> Effect:
    error = Parameter(
        name="relative_error",
        unit="1",
        null_value=0.0,
        typical=_USUAL[of],
        matters=0.02,
        lower=-0.9,
        upper=3.0,
        typical_low=-_USUAL[of],
        typical_high=_USUAL[of],
        mirrored=False,
        scan="",
        column=-1,
    )
    return Effect(
        id=of,
        title=of.replace("_", " of ", 1).replace("_", " "),
        equation=", ".join(f"{n} *= (1 + e)^{power}" for n, power in _POWERS[of].items()),
        source="Pacejka, Tire and Vehicle Dynamics, 4.3.1",
        excited_by="both drives near the limit",
        moves=_MOVES,
        parameters=(error,),
        index=-1,
        scored_at_typical=False,
        needs_force=False,
        needs=(),
        confounded_with=_RIVALS[of],
        through="",
        states=0,
        acts=((0, ()),),  # takes a place of the parameter vector that no effect of users has
    )


SCALINGS = tuple(_effect(of) for of in _POWERS)
"""Effects that multiply tyres; the compiled model does not know them (`Scaled` does)."""


def hold_tyres(put: Collection[str], effect: str) -> bool:
    """Whether changes hold one of the tyres, `tyre_rear` say, by other names.

    What changed both axles and was taken back at the other one changed this one; what changed each
    axle may have changed both.
    """
    axles = {f"tyre_{a}" for a in AXLES}
    if effect in _POWERS:
        return axles <= {*put}
    return effect in axles and axles - {effect} <= {*put} and not _POWERS.keys().isdisjoint(put)


def by_other_names(effect: str, put: Collection[str]) -> tuple[str, ...]:
    """What changes the tyres as an effect does beside other changes of them, one axle's at least.

    Both axles softer and the front one more is each axle softer by its own share.
    """
    axles = tuple(f"tyre_{a}" for a in AXLES)
    several = (*axles, *_POWERS)
    rest = {*put} - {effect}
    if effect not in several or rest.isdisjoint(several) or not {effect, *rest} & {*axles}:
        return ()
    return tuple(e for e in several if e != effect and e not in rest)


def seated(
    model: Model, tyres: Sequence[May], free: Collection[str], users: Sequence[Effect]
) -> tuple[Effect, ...]:
    """Changes of the tyres of both axles, where these are fitted and there is room for them."""
    if not all({*free}.issuperset(m.names) for m in tyres):
        return ()
    with suppress(InvalidInput):
        model.add(*users, *SCALINGS)
        return SCALINGS
    return ()


def _scalings_of(model: Model) -> list[Effect]:
    return [e for e in model.parts if e.id in _POWERS]


def without(model: Model) -> Model:
    """A model without these effects, its tyres as they are."""
    return model.drop(*(e.id for e in _scalings_of(model)))


def as_tyres(model: Model) -> Model:
    """The same car without these effects: its tyres have been multiplied."""
    if not _scalings_of(model):
        return model
    return without(model).with_values({n: f * model.value(n) for n, f in factors(model).items()})


def _factor(model: Model, letter: str) -> float:
    """By which one of the coefficients is multiplied on both axles."""
    factor = 1.0
    for e in _scalings_of(model):
        factor *= (1.0 + model.value(next(iter(e.named)))) ** _POWERS[e.id].get(letter, 0)
    return factor


def factors(model: Model) -> dict[str, float]:
    """By which coefficients of the tyres are multiplied in a model."""
    return {f"{letter}_{axle}": _factor(model, letter) for letter in "BD" for axle in AXLES}


def moves(of: str, model: Model) -> dict[str, float]:
    """By how much a coefficient would differ to do what the error of one of these effects does.

    Derivatives by the error, before the coefficients are multiplied.
    """
    error = model.value(f"{of}.relative_error") if of in model.effects else 0.0
    return {
        f"{letter}_{axle}": power * model.value(f"{letter}_{axle}") / (1.0 + error)
        for letter, power in _POWERS[of].items()
        for axle in AXLES
    }


@dataclass(frozen=True, eq=False)
class Scaled:
    """One driving of a model with these effects, as a problem (`identify.objective.Predicting`).

    Parameters
    ----------
    problem : OneDriving
        Of the model without them.
    tyres : dict of int to dict
        By column of a coefficient, by column of an effect: the power of its factor.
    most : dict of int to float
        By column of a coefficient, the largest one of any tyre: no likelihood has a larger one.
    """

    problem: OneDriving
    tyres: dict[int, dict[int, int]]
    most: dict[int, float]

    @classmethod
    def of(cls, driving: Driving, model: Model) -> OneDriving:
        """The likelihood of a driving under a model that may have such effects."""
        problem: OneDriving = driving.problem(without(model))
        parts, known = _scalings_of(model), model.parameters
        if not parts:
            return problem
        tyres: dict[int, dict[int, int]] = {}
        for e in parts:
            (column,) = e.columns
            for letter, power in _POWERS[e.id].items():
                for axle in AXLES:
                    tyres.setdefault(known[f"{letter}_{axle}"].column, {})[column] = power
        most = {known[f"{x}_{a}"].column: TYRE_RANGES[x].high for x in "BD" for a in AXLES}
        return cls(problem, tyres, most)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.problem.samples)

    def freeze(self, p: FloatArray, noise: FloatArray) -> Any:
        """Gains of the filter."""
        return self.problem.freeze(self._car(p), noise)

    def residuals(self, p: FloatArray, gains: Any) -> FloatArray:
        """Whitened residuals."""
        return self.problem.residuals(self._car(p), gains)

    def half_sum_of_squares(self, p: FloatArray, gains: Any) -> float:
        """Half the sum of their squares; infinite beyond any car, from where searches turn back."""
        with suppress(NumericalError):
            return self.problem.half_sum_of_squares(self._car(p), gains)
        return np.inf

    def sensitivities(self, p: FloatArray, gains: Any, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals by the parameters `columns`."""
        own, turn = self._turn(p, columns)
        return as_float64(self.problem.sensitivities(self._car(p), gains, own) @ turn)

    def normal_equations(
        self, p: FloatArray, gains: Any, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, G' e and G' G of the sensitivities G."""
        try:
            own, turn = self._turn(p, columns)
        except NumericalError:
            return np.inf, np.zeros(len(columns)), np.zeros((len(columns), len(columns)))
        cost, descent, information = self.problem.normal_equations(self._car(p), gains, own)
        return cost, as_float64(turn.T @ descent), as_float64(turn.T @ information @ turn)

    def noise_score(self, p: FloatArray, noise: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Log-likelihood, its derivatives by the noise's logarithms, and their information."""
        return self.problem.noise_score(self._car(p), noise)

    def log_likelihoods(self, sets: FloatArray, noise: FloatArray) -> FloatArray:
        """Of sets of parameters, a row each; minus infinity where one fails."""
        found = np.full(len(sets), -np.inf)
        cars: dict[int, FloatArray] = {}
        for i, p in enumerate(sets):
            with suppress(NumericalError):
                cars[i] = self._car(p)
        if cars:
            found[list(cars)] = self.problem.log_likelihoods(np.array([*cars.values()]), noise)
        return found

    def _car(self, p: FloatArray) -> FloatArray:
        """Parameters of the compiled model, its tyres multiplied."""
        car = p.copy()
        for column, powers in self.tyres.items():
            for own, power in powers.items():
                car[column] *= (1.0 + p[own]) ** power
            if car[column] > self.most[column]:
                raise NumericalError("the tyres are multiplied beyond those of any car")
        return car

    def _turn(self, p: FloatArray, columns: list[int]) -> tuple[list[int], FloatArray]:
        """Columns of the compiled model, and their derivatives by those that are asked for."""
        effects = {c for powers in self.tyres.values() for c in powers}
        own = list(dict.fromkeys([*(c for c in columns if c not in effects), *self.tyres]))
        car, turn = self._car(p), np.zeros((len(own), len(columns)))
        for j, c in enumerate(columns):
            if c not in effects:
                turn[own.index(c), j] = car[c] / p[c] if c in self.tyres else 1.0
                continue
            for column, powers in self.tyres.items():
                turn[own.index(column), j] = powers.get(c, 0) * car[column] / (1.0 + p[c])
        return own, as_float64(turn)
