# The part of `_core` on friction over slip; a file of its own only because one would be too long.
# At run time all of it is in `_core`.
from typing import NoReturn, Self, TypedDict, type_check_only

from ._core import _Array, _Bound

@type_check_only
class _CurveFiltered(TypedDict):
    predicted_mean: _Array
    mean: _Array
    covariance: _Array
    innovation: _Array
    innovation_variance: _Array
    pseudo_variance: _Array
    signal_before: _Array
    signal_after: _Array

@type_check_only
class _CurveSmoothed(TypedDict):
    mean: _Array
    covariance: _Array
    rounds: int
    converged: bool

@type_check_only
class _CurveFit(TypedDict):
    mean: _Array
    covariance: _Array
    bias: _Array
    sum_of_squares: float
    used: int
    determined: bool
    iterations: int
    converged: bool

@type_check_only
class _Curve(metaclass=_Bound):
    LOWER: _Array
    UPPER: _Array
    def __init__(self, *args: NoReturn, **kwargs: NoReturn) -> None: ...
    @staticmethod
    def points(slip: _Array, parameters: _Array) -> tuple[_Array, _Array, _Array]: ...
    @staticmethod
    def filter(
        slip: _Array,
        mu: _Array,
        mean: _Array,
        covariance: _Array,
        noise_std: float,
        pseudo_noise: bool,
        iterations: int,
        drift_std: _Array,
    ) -> _CurveFiltered: ...
    @staticmethod
    def smooth(
        slip: _Array,
        mu: _Array,
        mean: _Array,
        covariance: _Array,
        noise_std: float,
        pseudo_noise: bool,
        drift_std: _Array,
        max_rounds: int,
    ) -> _CurveSmoothed: ...
    @staticmethod
    def fit(
        slip: _Array,
        mu: _Array,
        start: _Array,
        lower: _Array,
        upper: _Array,
        max_iterations: int,
    ) -> _CurveFit: ...

@type_check_only
class _CurveFilter(metaclass=_Bound):
    def __init__(
        self,
        mean: _Array,
        covariance: _Array,
        noise_std: float,
        pseudo_noise: bool,
        iterations: int,
        drift_std: _Array,
    ) -> None: ...
    def update(self, slip: float, mu: float) -> None: ...
    def copy(self) -> Self: ...
    def __getstate__(self) -> _Array: ...
    def __setstate__(self, state: _Array) -> None: ...
    @property
    def mean(self) -> _Array: ...
    @property
    def covariance(self) -> _Array: ...
    @property
    def readings(self) -> int: ...

class TwoParameterCurve(_Curve): ...
class MagicFormulaCurve(_Curve): ...
class TwoParameterFilter(_CurveFilter): ...
class MagicFormulaFilter(_CurveFilter): ...

def magic_formula_coefficients(parameters: _Array) -> tuple[float, float, float, float]: ...
