# The part of `_core` on the twin; a file of its own only because one would be too long.
# At run time all of it is in `_core`.
from collections.abc import Sequence

from ._core import Driver, _Array, _Bound

TWIN_ESTIMATES: int

class TwinTyre(metaclass=_Bound):
    nominal_load_n: float
    friction_x: float
    friction_y: float
    friction_slope: float
    slip_stiffness: float
    cornering_stiffness: float
    load_at_peak_stiffness: float
    shape: float
    curvature: float
    relaxation_m: float
    def __init__(self) -> None: ...

class TwinAxle(metaclass=_Bound):
    track_m: float
    spring_npm: float
    bump_damping_nspm: float
    rebound_damping_nspm: float
    anti_roll_npm: float
    travel_m: float
    stop_npm: float
    roll_centre_m: float
    anti_slope: float
    unsprung_kg: float
    tyre_npm: float
    tyre_damping_nspm: float
    radius_m: float
    wheel_inertia_kgm2: float
    rolling_resistance: float
    lift_area_m2: float
    tyre: TwinTyre
    def __init__(self) -> None: ...

class TwinCar(metaclass=_Bound):
    wheelbase_m: float
    drag_area_m2: float
    air_density_kgpm3: float
    front: TwinAxle
    rear: TwinAxle
    design: list[float]
    def __init__(self) -> None: ...

class Vehicle14(metaclass=_Bound):
    load: list[float]
    def __init__(self, car: TwinCar, load: Sequence[float]) -> None: ...
    def rest(self, vx: float) -> _Array: ...
    def evaluate(self, state: _Array, input: _Array) -> tuple[_Array, _Array]: ...
    def step(self, state: _Array, input: _Array, dt: float) -> _Array: ...
    def energy(self, state: _Array, input: _Array) -> float: ...
    def simulate(
        self, start: _Array, inputs: _Array, dt: float
    ) -> tuple[_Array, _Array, _Array]: ...
    def drive(
        self,
        driver: Driver,
        pedals: Sequence[float],
        references: _Array,
        base: _Array,
        dt: float,
    ) -> tuple[_Array, _Array, _Array, int]: ...

class ParameterLaw(metaclass=_Bound):
    parameter: int
    channel: int
    differentiate: bool
    by_gradient: bool
    sign_measured: bool
    published_sign: bool
    gain: float
    first_gain: float
    first_gain_s: float
    deadband: float
    floor: float
    averaging_s: float
    lower: float
    upper: float
    yaw_rate_below_radps: float
    yaw_rate_above_radps: float
    stage: int
    def __init__(self) -> None: ...

class ParameterLaws(metaclass=_Bound):
    def __init__(
        self,
        laws: Sequence[ParameterLaw],
        dt: float,
        yaw_rate_channel: int,
        derivative_hz: float,
        schedule: Sequence[float],
    ) -> None: ...
    def update(self, car: _Array, twin: _Array, parameters: Sequence[float]) -> list[float]: ...
    @property
    def stage(self) -> int: ...

class BatchEstimator(metaclass=_Bound):
    def __init__(
        self,
        parameters: Sequence[Sequence[float]],
        channels: Sequence[Sequence[float]],
        dt: float,
        settings: Sequence[float],
    ) -> None: ...
    def of_twin(self, which: int, estimate: Sequence[float]) -> list[float]: ...
    def update(
        self, car: _Array, twins: _Array, estimate: Sequence[float]
    ) -> tuple[list[float], _Array]: ...
    @property
    def spread(self) -> _Array: ...

def loaded(car_load: Sequence[float], masses: Sequence[Sequence[float]]) -> list[float]: ...
def observe14(
    twin: Vehicle14,
    start: _Array,
    inputs: _Array,
    measured: _Array,
    dt: float,
    gains: Sequence[Sequence[float]],
    laws: ParameterLaws | None,
    batch: BatchEstimator | None,
    stride: int,
    scaled: Sequence[int],
    starts: Sequence[Sequence[float]],
) -> tuple[_Array, _Array, list[int], list[float]]: ...
def observe_double_track(
    car: Sequence[float],
    front: Sequence[float],
    rear: Sequence[float],
    gains: Sequence[float],
    start: Sequence[float],
    inputs: _Array,
    measured: _Array,
    dt: float,
    published_sign: bool,
) -> _Array: ...
