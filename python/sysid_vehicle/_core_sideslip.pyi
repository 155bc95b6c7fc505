# The part of `_core` on sideslip observers; a file of its own only because one would be too long.
# At run time all of it is in `_core`.
from collections.abc import Mapping, Sequence
from typing import Self, type_check_only

from ._core import VehicleData, _Array, _Bound

class ObservedCar(metaclass=_Bound):
    def __init__(
        self,
        data: VehicleData,
        yaw_inertia_kgm2: float,
        front: Sequence[float],
        rear: Sequence[float],
    ) -> None: ...

@type_check_only
class _SideslipObserver(metaclass=_Bound):
    def step(
        self,
        dt_s: float,
        steer_rad: float,
        vx_mps: float,
        yaw_rate_radps: float,
        ax_mps2: float,
        ay_mps2: float,
    ) -> list[float]: ...
    def run(self, dt_s: _Array, sensors: _Array) -> _Array: ...
    def copy(self) -> Self: ...
    def __getstate__(self) -> _Array: ...
    def __setstate__(self, state: _Array) -> None: ...
    @property
    def samples(self) -> int: ...

class SideslipDual(_SideslipObserver):
    def __init__(self, car: ObservedCar, settings: Mapping[str, float]) -> None: ...

class PublishedDual(_SideslipObserver):
    def __init__(self, car: ObservedCar, cf_npr: float, cr_npr: float) -> None: ...

@type_check_only
class _SideslipUkf(_SideslipObserver):
    def __init__(self, car: ObservedCar, settings: Mapping[str, float], linear: bool) -> None: ...

class SideslipEkf(_SideslipUkf): ...
class SideslipUkf(_SideslipUkf): ...
class SideslipSquareRootUkf(_SideslipUkf): ...

class CorneringRls(metaclass=_Bound):
    def __init__(
        self,
        mass_kg: float,
        yaw_inertia_kgm2: float,
        lf_m: float,
        lr_m: float,
        forgetting: float,
        prior_std_npr: float,
        ay_std_mps2: float,
        yaw_acceleration_std_radps2: float,
        most_slip_rad: float,
        least_slip_rad: float,
        cf_npr: float,
        cr_npr: float,
    ) -> None: ...
    def step(
        self,
        alpha_f_rad: float,
        alpha_r_rad: float,
        ay_mps2: float,
        yaw_acceleration_radps2: float,
    ) -> bool: ...
    def run(self, readings: _Array) -> _Array: ...
    def reset(self) -> None: ...
    def copy(self) -> Self: ...
    def __getstate__(self) -> _Array: ...
    def __setstate__(self, state: _Array) -> None: ...
    @property
    def stiffness_npr(self) -> tuple[float, float]: ...
    @property
    def std_npr(self) -> tuple[float, float]: ...
    @property
    def samples(self) -> int: ...
    @property
    def used(self) -> int: ...

def sideslip_defaults() -> dict[str, float]: ...
def sideslip_meanings() -> dict[str, str]: ...
