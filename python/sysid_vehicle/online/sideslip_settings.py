"""What the sideslip observers assume about sensors, road and tyres."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from .. import _core
from .._files import refuse_unknown
from .._text import html_text, text_table
from ..errors import InvalidInput
from ..estimate.inputs import white_noise_std
from ..log import Log

_MEANING = {
    "vx_mps": "noise of the speed [m/s]",
    "yaw_rate_radps": "noise of the yaw rate [rad/s]",
    "ax_mps2": "noise of the longitudinal acceleration [m/s2]",
    "ay_mps2": "noise of the lateral acceleration [m/s2]",
    "road_mps2": "bank of the road as a lateral acceleration [m/s2]",
    "road_time_s": "time over which the bank changes [s]",
    "roll_expected": "gravity felt through body roll, share of a_y",
    "roll_share": "standard deviation of that share",
    "roll_time_s": "time that the body takes to roll [s]",
    "force_walk": "change of a lateral axle force, share of the load [1/sqrt(s)]",
    "error_load": "error of the tyre model, share of the load",
    "error_lateral": "error of the tyre model, share of the lateral force",
    "error_braking": "error of the tyre model, share of the grip that braking takes",
    "error_drive": "yaw moment by drive and brakes, share of their force at half the wheelbase",
    "error_time_s": "time over which these errors change [s]",
    "error_curve": "error of the tyre curve that is never learnt, share of the slip",
    "error_slip_rad": "slip angle without force, by toe, camber and compliance [rad]",
    "learning_use": "lateral force over load up to which slip tells less of the stiffness",
    "yaw_walk_radps": "unexplained change of the yaw rate [rad/s/sqrt(s)]",
    "sideslip_walk_rad": "unexplained change of the sideslip [rad/sqrt(s)]",
    "stiffness_prior": "standard deviation of the stiffness at first (of its logarithm)",
    "friction_prior": "change of the friction with the road (of its logarithm)",
    "stiffness_walk": "change of the stiffness in hard driving [1/sqrt(s)]",
    "friction_time_s": "time over which friction changes [s]",
    "relaxation_m": "relaxation length of the tyres [m]",
    "relaxation_std": "standard deviation of that length (of its logarithm)",
    "gate_probability": "readings less probable than this are refused",
    "gate_patience_s": "after so long they are taken again [s]",
    "frozen_after_s": "a sensor that stands still for longer is left out [s]",
    "stop_below_mps": "below this speed the car is taken to roll without slip [m/s]",
    "go_above_mps": "above this speed the observer begins again [m/s]",
    "fx_walk": "change of the longitudinal force, share of the weight [1/sqrt(s)]",
    "beta_walk_radps": "three-state observer: unexplained change of the sideslip [rad/sqrt(s)]",
    "model_ay_mps2": "three-state observer: error of the modelled lateral acceleration [m/s2]",
}
# Quieter than these no sensor of a car is; simulated channels without noise are.
_QUIETEST = {"vx_mps": 0.01, "yaw_rate_radps": 5e-4, "ax_mps2": 0.02, "ay_mps2": 0.02}
NOISE_BLOCK = 100  # samples; vibration comes and goes with the driving


class SideslipSettings(Mapping[str, float]):
    """Standard deviations, times and limits of the sideslip observers.

    Parameters
    ----------
    **changes : float
        Settings that differ from the default. ``print(SideslipSettings())`` lists all of them.

    Raises
    ------
    InvalidInput
        If a name is not known or a value not above 0.
    """

    def __init__(self, **changes: float) -> None:
        defaults = _core.sideslip_defaults()
        refuse_unknown(changes, defaults, "sideslip settings")
        for name, value in changes.items():
            if not (math.isfinite(value) and value > 0.0):
                raise InvalidInput(f"sideslip settings: {name} = {value:g}; give more than 0")
        self._values = {**defaults, **{name: float(value) for name, value in changes.items()}}
        v = self._values
        if v["gate_probability"] >= 1.0:
            raise InvalidInput("sideslip settings: gate_probability must lie between 0 and 1")
        if v["go_above_mps"] < v["stop_below_mps"]:
            raise InvalidInput(
                "sideslip settings: go_above_mps lies below stop_below_mps; give it a higher value"
            )

    @classmethod
    def of(cls, log: Log, **changes: float) -> SideslipSettings:
        """Take the noise of the sensors from the fast scatter of the log's channels."""
        noise = {
            name: max(white_noise_std(log[name], NOISE_BLOCK), least)
            for name, least in _QUIETEST.items()
            if log.has(name)
        }
        return cls(**{**noise, **changes})

    def replace(self, **changes: float) -> SideslipSettings:
        """Return a copy with some settings changed."""
        return SideslipSettings(**{**self._values, **changes})

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __str__(self) -> str:
        rows = [[name, f"{value:.4g}", _MEANING[name]] for name, value in self.items()]
        return text_table(["setting", "value", "meaning"], rows)

    def __repr__(self) -> str:
        return f"SideslipSettings({', '.join(f'{k}={v:.4g}' for k, v in self.items())})"

    _repr_html_ = html_text
