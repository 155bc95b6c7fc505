from collections.abc import Sequence
from typing import Any, NoReturn, TypedDict, type_check_only

import numpy as np
import numpy.typing as npt

from ._core_banded import banded_gram as banded_gram
from ._core_banded import banded_squares as banded_squares
from ._core_lab_tyres import TyreLoss as TyreLoss
from ._core_mu_slip import MagicFormulaCurve as MagicFormulaCurve
from ._core_mu_slip import MagicFormulaFilter as MagicFormulaFilter
from ._core_mu_slip import TwoParameterCurve as TwoParameterCurve
from ._core_mu_slip import TwoParameterFilter as TwoParameterFilter
from ._core_mu_slip import _Curve as _Curve
from ._core_mu_slip import _CurveFilter as _CurveFilter
from ._core_mu_slip import magic_formula_coefficients as magic_formula_coefficients
from ._core_sideslip import CorneringRls as CorneringRls
from ._core_sideslip import ObservedCar as ObservedCar
from ._core_sideslip import PublishedDual as PublishedDual
from ._core_sideslip import SideslipDual as SideslipDual
from ._core_sideslip import SideslipEkf as SideslipEkf
from ._core_sideslip import SideslipSquareRootUkf as SideslipSquareRootUkf
from ._core_sideslip import SideslipUkf as SideslipUkf
from ._core_sideslip import _SideslipObserver as _SideslipObserver
from ._core_sideslip import _SideslipUkf as _SideslipUkf
from ._core_sideslip import sideslip_defaults as sideslip_defaults
from ._core_sideslip import sideslip_meanings as sideslip_meanings
from ._core_twin import TWIN_ESTIMATES as TWIN_ESTIMATES
from ._core_twin import BatchEstimator as BatchEstimator
from ._core_twin import ParameterLaw as ParameterLaw
from ._core_twin import ParameterLaws as ParameterLaws
from ._core_twin import TwinAxle as TwinAxle
from ._core_twin import TwinCar as TwinCar
from ._core_twin import TwinTyre as TwinTyre
from ._core_twin import Vehicle14 as Vehicle14
from ._core_twin import loaded as loaded
from ._core_twin import observe14 as observe14
from ._core_twin import observe_double_track as observe_double_track

_Array = npt.NDArray[np.float64]
_Steps = Sequence[tuple[int, tuple[int, int, int], float]]  # operation, operands, constant
_OwnState = tuple[_Steps, _Steps, _Steps | None]  # rate, decay, initial
# Place, channels, what is added to, states.
_User = tuple[int, Sequence[int], Sequence[tuple[int, _Steps]], Sequence[_OwnState]]

__version__: str
LANES: int
CHANNELS: int
GRAVITY_MPS2: float
NOISE_PARAMETERS: int
TOLD_SAMPLES: int
PARAMETERS: int
SHIFT_REACH: int
USER_EFFECTS: int
USER_OFFSET: int
USER_CHANNELS: int
USER_PARAMETERS: int
USER_STATES: int
USER_STATES_FROM: int
EXTERNALS: int

@type_check_only
class _Bound(type): ...

class Stop(metaclass=_Bound):
    def __init__(self) -> None: ...
    def set(self) -> None: ...
    def follow(self) -> None: ...
    @property
    def is_set(self) -> bool: ...

@type_check_only
class _Trace(TypedDict):
    innovation: _Array
    spread: _Array
    whitened: _Array
    log_density: _Array
    state: _Array
    state_std: _Array
    log_likelihood: float

class VehicleData(metaclass=_Bound):
    mass_kg: float
    lf_m: float
    lr_m: float
    cg_height_m: float
    track_front_m: float
    track_rear_m: float
    drag_area_m2: float
    air_density_kgpm3: float
    brake_front_share: float
    drive_front_share: float
    def __init__(self) -> None: ...

class SingleTrack(metaclass=_Bound):
    def __init__(
        self,
        car: VehicleData,
        effects: int,
        force_known: bool,
        user: Sequence[_User] = ...,
        loads_known: bool = False,
        inputs_held: bool = False,
    ) -> None: ...
    def on_known_slopes(self) -> SingleTrack: ...
    def evaluate(
        self, parameters: _Array, motion: _Array, steer: float, longitudinal: float
    ) -> _Array: ...
    def car(self, parameters: _Array) -> dict[str, float]: ...

class WrittenModel(metaclass=_Bound):
    # Only `write_model` makes one. Steps: operation, up to three operands (or -1), constant.
    def __init__(self, *args: NoReturn, **kwargs: NoReturn) -> None: ...
    @property
    def steps(self) -> list[tuple[str, int, int, int, float]]: ...
    @property
    def names(self) -> list[tuple[int, str]]: ...
    @property
    def parts(self) -> list[tuple[int, str]]: ...
    @property
    def states(self) -> list[tuple[str, str, int, int, float]]: ...
    @property
    def car(self) -> list[tuple[str, int]]: ...
    @property
    def parameters(self) -> list[int]: ...
    @property
    def steer(self) -> int: ...
    @property
    def force(self) -> int: ...
    @property
    def a_x(self) -> int: ...
    @property
    def a_y(self) -> int: ...

class FrozenFilter(metaclass=_Bound):
    # Only `Problem.freeze` makes one.
    def __init__(self, *args: NoReturn, **kwargs: NoReturn) -> None: ...
    @property
    def log_likelihood(self) -> float: ...
    @property
    def observed(self) -> int: ...

class Problem(metaclass=_Bound):
    def __init__(self, model: SingleTrack) -> None: ...
    @property
    def samples(self) -> int: ...
    def add_run(
        self,
        dt: float,
        inputs: _Array,
        measurements: _Array,
        start: float = 0.0,
        name: str = "",
        steer_before: Sequence[float] = ...,
        steer_after: Sequence[float] = ...,
        shift: Sequence[float] = ...,
    ) -> None: ...
    def with_model(self, model: SingleTrack) -> Problem: ...
    def freeze(self, parameters: _Array, noise: _Array) -> FrozenFilter: ...
    def log_likelihoods(self, parameters: _Array, noise: _Array) -> _Array: ...
    def residuals(self, parameters: _Array, filter: FrozenFilter) -> _Array: ...
    def half_sum_of_squares(self, parameters: _Array, filter: FrozenFilter) -> float: ...
    def sensitivities(
        self, parameters: _Array, filter: FrozenFilter, columns: Sequence[int]
    ) -> _Array: ...
    def normal_equations(
        self, parameters: _Array, filter: FrozenFilter, columns: Sequence[int]
    ) -> tuple[float, _Array, _Array]: ...
    def signal_sensitivities(
        self, parameters: _Array, filter: FrozenFilter, signals: _Array, targets: Sequence[int]
    ) -> _Array: ...
    def noise_score(self, parameters: _Array, noise: _Array) -> tuple[float, _Array, _Array]: ...
    def filtered_noise_score(
        self, parameters: _Array, filter: FrozenFilter
    ) -> tuple[float, _Array, _Array]: ...
    def trace(self, parameters: _Array, noise: _Array, smoothed: bool) -> _Trace: ...
    def filtered_trace(self, parameters: _Array, filter: FrozenFilter) -> _Trace: ...
    def smoothed_means(self, parameters: _Array, noise: _Array) -> _Array: ...
    def filtered_smoothed_means(self, parameters: _Array, filter: FrozenFilter) -> _Array: ...
    def look_ahead(
        self,
        parameters: _Array,
        noise: _Array,
        horizons: Sequence[tuple[int, int]],
        readings: bool = False,
        road: _Array | None = None,
    ) -> _Array: ...
    def free_run(self, parameters: _Array) -> _Array: ...

class Driver(metaclass=_Bound):
    reaction_s: float
    yaw_rate_gain: float
    yaw_rate_integral_ps: float
    understeer_radps2pm: float
    speed_gain_ps: float
    steer_limit_rad: float
    steer_rate_limit_radps: float
    drive_limit_n: float
    brake_limit_n: float
    power_limit_w: float
    force_rate_limit_nps: float
    tracks_path: bool
    def __init__(self) -> None: ...

# --- lab loop
@type_check_only
class _LoopRecord(TypedDict):
    truth: _Array
    sensed: _Array
    estimate: _Array
    reference: _Array
    inputs: _Array
    limits: npt.NDArray[np.uint32]
    lost_at: int

class LabCar(metaclass=_Bound):
    mass_kg: float
    yaw_inertia_kgm2: float
    lf_m: float
    lr_m: float
    cg_height_m: float
    gravity_mps2: float
    drag_nspm: float
    stiffness_front: float
    stiffness_rear: float
    # Only `LabLoop` holds one.
    def __init__(self, *args: NoReturn, **kwargs: NoReturn) -> None: ...

class LabController(metaclass=_Bound):
    speed_gain_ps: float
    yaw_rate_gain_ps: float
    heading_gain_ps: float
    yaw_rate_limit_radps: float
    yaw_acceleration_limit_radps2: float
    lateral_limit_mps2: float
    slip_limit_rad: float
    rear_slip_limit_rad: float
    rear_slip_gain_ps: float
    brakes_from_mps2: float
    feed_forward: bool
    coupling: bool
    lowest_speed_mps: float
    added_speed_mps: float
    # Only `LabLoop` holds one.
    def __init__(self, *args: NoReturn, **kwargs: NoReturn) -> None: ...

class LabLoop(metaclass=_Bound):
    dt: float
    steer_by: int
    def __init__(self) -> None: ...
    @property
    def car(self) -> LabCar: ...
    @property
    def controller(self) -> LabController: ...
    def set_force(self, least_most_rate_lag: Sequence[float]) -> None: ...
    def set_steer(self, least_most_rate_lag: Sequence[float]) -> None: ...
    def set_sensors(self, sensors: _Array) -> None: ...
    def set_noise(self, process: _Array, sensors: _Array) -> None: ...
    def set_track(self, points: _Array, metres: float, seconds: float) -> None: ...
    def set_observer_form(self, form: Sequence[bool]) -> None: ...
    def set_ways(
        self,
        pose_gain: float,
        load_sensors: bool,
        late_feedback: bool,
        first_late_load_n: float,
        certain_start: bool,
        inputs_linear: bool,
    ) -> None: ...
    def set_plant(
        self,
        load_share: float,
        late_loads: bool,
        air_speed_of_both: bool,
        steps: int,
        tolerance: float,
        gravity_mps2: float,
    ) -> None: ...
    def set_start(self, speed_mps: float, x_m: float, y_m: float) -> None: ...
    def run(
        self,
        model: SingleTrack,
        parameters: _Array,
        wanted: _Array,
        normal: _Array,
        external: _Array,
    ) -> _LoopRecord: ...

def base_parameters() -> list[dict[str, Any]]: ...
def effects() -> list[dict[str, Any]]: ...
def formula_parts() -> dict[str, Any]: ...
def write_model(model: SingleTrack, parameters: _Array, v_x: float) -> WrittenModel: ...
def simulate(
    model: SingleTrack,
    parameters: _Array,
    dt: float,
    references: _Array,
    driver: Driver,
    disturbance: _Array,
    initial_speed: float,
    initial_vy: float = 0.0,
    initial_yaw_rate: float = 0.0,
    initial_steer: float = 0.0,
    start: float = 0.0,
    channels: _Array = ...,
    farthest_m: float = ...,
) -> tuple[_Array, _Array, _Array, int]: ...

# --- lab observer

@type_check_only
class _ObserverTrace(TypedDict):
    log_likelihood: float
    state: _Array
    covariance: _Array
    reading: _Array
    reading_std: _Array
    innovation: _Array
    innovation_std: _Array

@type_check_only
class _ObserverEm(TypedDict):
    process: _Array
    sensors: _Array
    log_likelihood: list[float]
    converged: bool
    shortened: int
    fell: int
    leaps: int

class ObserverLog(metaclass=_Bound):
    def __init__(
        self,
        car: _Array,
        form: Sequence[bool],
        dt: float,
        inputs: _Array,
        readings: _Array,
        mean: _Array,
        covariance: _Array,
        one_before: bool,
        inputs_held: bool,
    ) -> None: ...
    @property
    def samples(self) -> int: ...
    def log_likelihood(self, process: _Array, sensors: _Array) -> float: ...
    def trace(self, process: _Array, sensors: _Array, smoothed: bool) -> _ObserverTrace: ...

class Observer(metaclass=_Bound):
    def __init__(
        self,
        car: _Array,
        form: Sequence[bool],
        dt: float,
        process: _Array,
        sensors: _Array,
        mean: _Array,
        covariance: _Array,
        one_before: bool,
    ) -> None: ...
    def step(self, input: _Array, reading: _Array) -> _Array: ...
    @property
    def covariance(self) -> _Array: ...
    @property
    def log_likelihood(self) -> float: ...

def observer_start(car: _Array, reading: _Array, sensors: _Array) -> tuple[_Array, _Array]: ...
def learn_observer_noise(
    logs: Sequence[ObserverLog],
    process: _Array,
    sensors: _Array,
    process_scale: Sequence[int],
    process_block: Sequence[int],
    process_floor: _Array,
    sensor_scale: Sequence[int],
    sensor_block: Sequence[int],
    sensor_floor: _Array,
    most_iterations: int,
    tolerance: float,
    never_fall: bool,
    accelerate: bool,
) -> _ObserverEm: ...
