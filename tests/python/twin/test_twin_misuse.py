"""What a twin is given that makes no sense is refused where it is given, by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.twin import (
    CallableTwin,
    Observation,
    Observer,
    ParameterLaw,
    SideBySide,
    StateGain,
    Unknown,
    observe_with,
)

N = 40
GIVEN: dict[str, Any] = {"spread": 300.0, "apart": 10.0, "lower": 500.0, "upper": 2000.0}
MASS = Unknown("mass_kg", **GIVEN)


def moved(x: np.ndarray, u: np.ndarray, p: dict[str, float]) -> np.ndarray:
    return x + 0.01 * u / p["mass_kg"]


def twin(**changes: Any) -> CallableTwin:
    given: dict[str, Any] = {
        "step": moved,
        "outputs": lambda x, u, p: np.array([x[0], u[0] / p["mass_kg"]]),
        "state": np.array([10.0]),
        "dt_s": 0.01,
        "input_names": ("force_n",),
        "output_names": ("vx_mps", "ax_mps2"),
        "state_names": ("vx_mps",),
        "parameters": {"mass_kg": 1000.0},
    }
    return CallableTwin(**{**given, **changes})


def run(mine: Any = None, **changes: Any) -> Observation:
    given: dict[str, Any] = {
        "inputs": np.full((N, 1), 500.0),
        "measured": {"ax_mps2": np.full(N, 0.5)},
        "observer": Observer(batch=SideBySide([MASS], {"ax_mps2": 0.05})),
    }
    return observe_with(twin() if mine is None else mine, **{**given, **changes})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: twin(step=3), "step = 3; give a function"),
        (lambda: twin(input_names=("f", "f")), "names of the twin: 'f' comes twice"),
        (lambda: twin(state="abc"), r"CallableTwin: state = 'abc' \(str\); give an array of num"),
        (lambda: run(twin(outputs=lambda x, u, p: np.array([1j, 0]))), "gave complex numbers; .*2"),
        (lambda: run(object()), "has no dt_s; give a NativeTwin, a CallableTwin"),
        (lambda: run(observer=3), r"observe_with: observer = 3 \(int\); give an Observer"),
        (lambda: run(measured=None), "observe_with: measured = None .*give a mapping"),
        (
            lambda: run(measured={"ax_mps2": np.zeros((N, 1))}),
            r"measured 'ax_mps2' has 40 samples, shape \(40, 1\); .*give shape \(40,\)",
        ),
        (lambda: run(stride=N + 1), "stride = 41: of 40 samples the first alone"),
        (lambda: run().last("mass"), r"no parameter 'mass' \(did you mean 'mass_kg'"),
        (lambda: run().plot("mass"), "no parameter 'mass'"),
        (lambda: run().error_percent("mass_kg", 1000.0, 0.0), "change = 0.0; give positive"),
        (lambda: StateGain("vx_mps", "vx_mps", 1.0, "per sample"), "give 'per_second' or 'per_sa"),  # type: ignore[arg-type]
        (lambda: ParameterLaw("mass_kg", "ax_mps2", 1.0, kind="grad"), "give 'sign' or 'gradient'"),  # type: ignore[arg-type]
        (lambda: Unknown("mass_kg", **{**GIVEN, "lower": None}), "lower = None .*give a number"),
        (lambda: SideBySide([], {"ax_mps2": 0.05}), "unknowns: none are given"),
        (lambda: SideBySide([MASS], {}), "channels: none are given"),
        (lambda: SideBySide([MASS, MASS], {"ax_mps2": 0.05}), "'mass_kg' comes twice; give it"),
        (lambda: SideBySide([MASS], {"ax_mps2": 0.05}, forgetting=-1.0), "forgetting = -1.0; give"),
        (lambda: SideBySide([MASS], {"ax_mps2": 0.05}, start_s=np.nan), "start_s = nan; give a nu"),
        (lambda: Observer(gains=3), r"Observer: gains = 3 \(int\); give a list of StateGains"),  # type: ignore[arg-type]
    ],
)
def test_it_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        call()
