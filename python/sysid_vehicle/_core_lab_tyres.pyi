# The part of `_core` on the tyres of the laboratory; a file of its own as one would be too long.
# At run time all of it is in `_core`.
from collections.abc import Sequence

from ._core import VehicleData, _Array, _Bound

class TyreLoss(metaclass=_Bound):
    def __init__(
        self,
        car: VehicleData,
        yaw_inertia_kgm2: float,
        projects_steer: bool,
        motion: _Array,
        targets: _Array,
        weights: _Array,
    ) -> None: ...
    @property
    def samples(self) -> int: ...
    def residuals(self, parameters: _Array, filter: None) -> _Array: ...
    def half_sum_of_squares(self, parameters: _Array, filter: None) -> float: ...
    def sensitivities(self, parameters: _Array, filter: None, columns: Sequence[int]) -> _Array: ...
    def normal_equations(
        self, parameters: _Array, filter: None, columns: Sequence[int]
    ) -> tuple[float, _Array, _Array]: ...
