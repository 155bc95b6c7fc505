"""Laws that turn what the car and its twin read into a better load.

Two kinds. `ParameterLaw` takes one reading and one parameter: the laws of Dettu et al. (2023),
eqs. (14), (15), (18), (24), or a normalised gradient in place of their sign. `SideBySide` runs one
twin more per unknown, a step beside the estimate; the differences of their readings are the
sensitivities, and recursive least squares do the rest. Equations: `cpp/include/sysid/twin/laws.hpp`
and `batch.hpp`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .. import _core
from .._common.typed import check_types, typed, typed_fields
from ..errors import InvalidInput, near_names
from .car import LOAD_NAMES, NOMINAL_SUV, Load
from .checks import check_apart
from .kept import forces_among, kept_states

# Of the first guess's size: how far the twins stand apart, how wrong the guess may be, limits.
_APART, _LIMIT = 0.01, 0.45
_SPREAD = {"mass_kg": 0.15, "jxx_kgm2": 0.15, "jyy_kgm2": 0.2, "jzz_kgm2": 0.2}
_SPREAD_M = {"cg_x_m": 0.1, "cg_y_m": 0.03, "cg_z_m": 0.1}
_PRODUCT = 0.03  # of the root of its two moments
INPUT_SCALE = "input_scale"
_ESTIMATED, _CONSIDERED, _START = 0.0, 1.0, 2.0  # as the core's binding reads them
_START_STEP = 0.01  # between the twins, of the standard deviation
_ANGULAR = {
    "jxx_kgm2": "roll_rate_radps",
    "jyy_kgm2": "pitch_rate_radps",
    "jzz_kgm2": "yaw_rate_radps",
}


@dataclass(frozen=True)
class ParameterLaw:
    """One reading, one parameter.

    Parameters
    ----------
    parameter : str
        What is corrected, such as ``mass_kg``.
    channel : str
        Reading whose error corrects it; an angular rate is differentiated first.
    gain : float
        Parameter per second and unit of the reading's error. The gain in force is
        ``max(gain, first_gain / (1 + t/first_gain_s))``, `t` the time the law has acted.
    first_gain, first_gain_s : float
        A larger gain to begin with.
    kind : {"sign", "gradient"}
        ``d(delta)/dt = K sgn(s~) (s~ - s)``, the published law; or its normalised gradient
        ``K s~ (s~ - s)/(floor^2 + mean of s~^2)``, which does not weigh small readings, mostly
        noise, as it does large ones.
    sign : {"twin", "measured"}
        Whose reading gives the direction. A measured one holds the same noise as the error; their
        product has a mean, and the parameter drifts.
    published_sign : bool
        True takes the direction as it was printed. It diverges.
    deadband : float
        Readings smaller than this do nothing.
    floor : float
        Of the gradient.
    averaging_s : float
        Of the gradient's mean square.
    yaw_rate_below_radps, yaw_rate_above_radps : float
        The law acts only between these: straight driving, or bends.
    lower, upper : float
        Limits of the parameter.
    stage : int
        Turn in the schedule.

    Raises
    ------
    InvalidInput
        If a gain is negative or the limits are reversed.
    """

    parameter: str
    channel: str
    gain: float
    first_gain: float = 0.0
    first_gain_s: float = 1.0
    kind: Literal["sign", "gradient"] = "sign"
    sign: Literal["twin", "measured"] = "twin"
    published_sign: bool = False
    deadband: float = 0.0
    floor: float = 0.1
    averaging_s: float = 5.0
    yaw_rate_below_radps: float = float("inf")
    yaw_rate_above_radps: float = 0.0
    lower: float = 0.0
    upper: float = float("inf")
    stage: int = 0

    @typed_fields
    def __post_init__(self) -> None:
        check_types(self)
        if self.gain < 0.0 or self.first_gain < 0.0 or not self.lower < self.upper:
            raise InvalidInput(
                f"law of {self.parameter}: gains must not be negative and lower must be below upper"
            )

    def core(self, parameters: Sequence[str], channels: Sequence[str]) -> _core.ParameterLaw:
        """The compiled law, for a twin with these parameters and outputs."""
        law = _core.ParameterLaw()
        law.parameter = place_of(self.parameter, parameters, "parameter")
        law.channel = place_of(self.channel, channels, "channel")
        law.differentiate = self.channel in _ANGULAR.values()
        law.by_gradient = self.kind == "gradient"
        law.sign_measured = self.sign == "measured"
        for name in vars(self).keys() - {"parameter", "channel", "kind", "sign"}:
            setattr(law, name, getattr(self, name))
        return law


@dataclass(frozen=True)
class Schedule:
    """When the next stage begins: figure 12 of the paper, spelt out.

    Parameters
    ----------
    excited_s : float
        A law has acted for so long, and
    window_s, relative_rate_ps : float
        its parameter moved less than so much of its first value per second, over such a window.
    """

    excited_s: float = 60.0
    window_s: float = 10.0
    relative_rate_ps: float = 1e-3


@dataclass(frozen=True)
class Unknown:
    """A parameter that twins side by side look for.

    Parameters
    ----------
    parameter : str
        Its name.
    spread : float
        Standard deviation of the first guess.
    apart : float
        Step between the twins.
    lower, upper : float
        Limits.
    walk_per_root_s : float
        How far the truth may change in a second; zero for a constant.
    """

    parameter: str
    spread: float
    apart: float
    lower: float
    upper: float
    walk_per_root_s: float = 0.0

    def __post_init__(self) -> None:
        check_types(self)


@typed
def unknowns(*names: str, around: Load = NOMINAL_SUV) -> tuple[Unknown, ...]:
    """Unknowns of a load with customary spreads around a first guess.

    Raises
    ------
    InvalidInput
        If a name is no number of a load.
    """
    out = []
    for name in names:
        place_of(name, LOAD_NAMES, "parameter")
        value = getattr(around, name)
        if name in _SPREAD_M or name not in _SPREAD:
            spread = _SPREAD_M.get(name) or _spread_of_product(name, around)
            out.append(Unknown(name, spread, 0.2 * spread, value - 6 * spread, value + 6 * spread))
        else:
            out.append(
                Unknown(
                    name,
                    _SPREAD[name] * value,
                    _APART * value,
                    (1.0 - _LIMIT) * value,
                    (1.0 + _LIMIT) * value,
                )
            )
    return tuple(out)


def _spread_of_product(name: str, around: Load) -> float:
    moments = [getattr(around, f"j{axis}{axis}_kgm2") for axis in name[1:3]]
    return _PRODUCT * float(np.sqrt(moments[0] * moments[1]))


@dataclass(frozen=True)
class SideBySide:
    """Recursive least squares on a batch of twins.

    Where the twin's states can be set, every change of the estimate also moves the twins to where
    they would be, had the parameters always been the new ones; nothing learnt from a wrong twin
    then stays in its states. Without that, old data must be forgotten faster.

    Parameters
    ----------
    unknowns : sequence of Unknown
        What is looked for; each costs one twin more.
    channels : mapping of str to float
        Readings that are compared, with the standard deviation of their noise; the scale of the
        residual is learnt and never taken to be less.
    forgetting : float
        ``n``: after the time t old data count as ``t^-n``.
    start_s : float
        Nothing is learnt earlier.
    residual_s : float
        Averaging time of the residual's scale.
    clip : float
        A residual counts as at most so many of its scales.
    gentle_s : float
        For so long data count less, the earlier the less: the first steps are long.
    high_pass_hz : float
        Slower differences between car and twin are left alone; zero leaves none.
    input_std : float
        Standard deviation of a factor of the uncertain inputs, 0.03 by default. Under torques told
        2 % too high a mass 2 % too large fits as well; only drag and rolling resistance, themselves
        not known so well, tell the two apart. So the factor is not estimated but considered: where
        ``mass_kg`` is looked for and the twin takes such inputs, the spreads hold what its
        uncertainty does to the estimates. It costs one twin more. Zero: the inputs are exact.
    uncertain_inputs : sequence of str, optional
        Inputs that have this factor, those of them that the twin takes; not the steering. By
        default the torques of the built-in car, and of a twin that takes none of these all whose
        names end in ``_n`` or ``_nm``; where there are none a warning says so.
    start_std : float
        Standard deviation of the first value of a state that is compared, in its unit. Without a
        gain that corrects it a speed keeps for long where it began, and what the steps to each new
        guess left in it; either would pass for another mass. So where such a state is compared its
        start is looked for too, and that of ``vx_mps`` where an acceleration is; that costs one
        twin more. Angular rates and ``vy_mps``, which tyres hold, forget their start within a
        second: they have none. Zero: the twin starts exactly where the car does, and with a first
        guess that is nearly right, as the steps to others leave something in the speed.

    Raises
    ------
    InvalidInput
        If a spread, step, noise or time is not positive, limits are reversed, or steps exceed them.
    """

    unknowns: Sequence[Unknown]
    channels: Mapping[str, float]
    forgetting: float = 2.0
    start_s: float = 1.0
    residual_s: float = 5.0
    clip: float = 4.0
    gentle_s: float = 20.0
    high_pass_hz: Mapping[str, float] = field(default_factory=dict)
    input_std: float = 0.03
    uncertain_inputs: Sequence[str] | None = None
    start_std: float = 1.0

    @typed_fields
    def __post_init__(self) -> None:
        check_apart("unknowns", [u.parameter for u in self.unknowns])
        check_apart("channels", list(self.channels))
        for name in ("forgetting", "start_s", "residual_s", "clip", "gentle_s", "start_std"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise InvalidInput(f"{name} = {getattr(self, name)!r}; give a number from 0 on")
        for u in self.unknowns:
            if not (0.0 < u.spread < np.inf and 0.0 < abs(u.apart) < np.inf and u.lower < u.upper):
                text = "spread and step must be positive, lower below upper"
                raise InvalidInput(f"{u.parameter}: {text}")
            if not abs(u.apart) < u.upper - u.lower:
                text = f"twins {u.apart:g} apart, with limits of {u.lower:g} to {u.upper:g}"
                raise InvalidInput(f"{u.parameter}: {text}; give a step within them")
        for channel, noise in self.channels.items():
            if not 0.0 < noise < np.inf:
                raise InvalidInput(
                    f"{channel}: a noise of {noise!r}; give its standard deviation, positive"
                )
        if not 0.0 <= self.input_std < 1.0:
            raise InvalidInput(f"input_std = {self.input_std!r}; give a part from 0 to 1")
        if any(name.startswith("steer") for name in self.uncertain_inputs or ()):
            raise InvalidInput("uncertain_inputs: the steering has no factor; leave it out")

    def scaled(self, inputs: Sequence[str]) -> list[int]:
        """Positions of the uncertain inputs among a twin's, none if no factor is considered."""
        if not self.doubts_inputs:
            return []
        uncertain = self.uncertain_inputs
        if uncertain is None:
            uncertain = forces_among(inputs)
        return [i for i, name in enumerate(inputs) if name in uncertain]

    @property
    def doubts_inputs(self) -> bool:
        """Whether forces and torques are to count as uncertain."""
        return self.input_std > 0.0 and any(u.parameter == "mass_kg" for u in self.unknowns)

    def looked_for(self, inputs: Sequence[str]) -> tuple[Unknown, ...]:
        """Unknowns for a twin with these inputs, last the factor of the uncertain ones, if any."""
        if not self.scaled(inputs):
            return tuple(self.unknowns)
        deviation = self.input_std
        most = min(6.0 * deviation, 0.9)
        scale = Unknown(INPUT_SCALE, deviation, 0.2 * deviation, 1.0 - most, 1.0 + most)
        return (*self.unknowns, scale)

    def starts(self, states: Sequence[str], corrected: Sequence[str] = ()) -> dict[str, float]:
        """States of a twin whose start is looked for, with the steps between the twins.

        Parameters
        ----------
        states : sequence of str
            Names of its states.
        corrected : sequence of str
            Those that gains correct by readings of themselves.
        """
        if self.start_std == 0.0:
            return {}
        step, kept = _START_STEP * self.start_std, kept_states(self.channels)
        return {name: step for name in kept if name in states and name not in corrected}

    def start_steps(
        self, inputs: Sequence[str], states: Sequence[str], starts: Mapping[str, float]
    ) -> list[tuple[int, int, float]]:
        """Of each start: which twin is apart, in which of its states, and how far."""
        steps = enumerate(starts.items(), 1 + len(self.looked_for(inputs)))
        return [(i, states.index(name), step) for i, (name, step) in steps]

    def core(
        self,
        parameters: Sequence[str],
        channels: Sequence[str],
        dt_s: float,
        inputs: Sequence[str] = (),
        starts: Mapping[str, float] | None = None,
    ) -> _core.BatchEstimator:
        """The compiled estimator, for a twin with these parameters, outputs, inputs and starts."""
        rows = [
            [
                float(
                    len(LOAD_NAMES)
                    if u.parameter == INPUT_SCALE
                    else place_of(u.parameter, parameters, "parameter")
                ),
                u.apart,
                u.spread,
                u.walk_per_root_s,
                u.lower,
                u.upper,
                _CONSIDERED if u.parameter == INPUT_SCALE else _ESTIMATED,
            ]
            for u in self.looked_for(inputs)
        ]
        rows += [
            [0.0, step, self.start_std, 0.0, 0.0, 0.0, _START] for step in (starts or {}).values()
        ]
        read = [
            [float(place_of(c, channels, "channel")), noise, self.high_pass_hz.get(c, 0.0)]
            for c, noise in self.channels.items()
        ]
        settings = [self.forgetting, self.start_s, self.residual_s, self.clip, self.gentle_s]
        try:
            return _core.BatchEstimator(rows, read, dt_s, settings)
        except ValueError as error:
            raise InvalidInput(str(error)) from error


@typed
def mass_law(gain: float = 150.0, *, around: Load = NOMINAL_SUV, **changes: object) -> ParameterLaw:
    """The mass by the longitudinal acceleration: eq. (14), with the gate of eq. (24)."""
    given: dict[str, object] = {
        "yaw_rate_below_radps": 0.0523598775598298873,  # 3 deg/s
        "lower": (1.0 - _LIMIT) * around.mass_kg,
        "upper": (1.0 + _LIMIT) * around.mass_kg,
    }
    return ParameterLaw("mass_kg", "ax_mps2", gain, **{**given, **changes})  # type: ignore[arg-type]


@typed
def inertia_law(
    parameter: str, gain: float, *, around: Load = NOMINAL_SUV, **changes: object
) -> ParameterLaw:
    """A moment of inertia by the angular acceleration about its axis: eqs. (15) and (18)."""
    place_of(parameter, _ANGULAR, "moment of inertia")
    value = getattr(around, parameter)
    given: dict[str, object] = {"lower": (1.0 - _LIMIT) * value, "upper": (1.0 + _LIMIT) * value}
    return ParameterLaw(parameter, _ANGULAR[parameter], gain, **{**given, **changes})  # type: ignore[arg-type]


def place_of(name: str, known: Sequence[str] | Mapping[str, str], what: str) -> int:
    """The position of a name among those known, or an error that gives near ones."""
    names = list(known)
    if name not in names:
        raise InvalidInput(f"there is no {what} '{name}'{near_names(name, names)}")
    return names.index(name)
