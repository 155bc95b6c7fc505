"""What the sideslip observers assume about sensors, road and tyres."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from .. import _core
from .._common.files import refuse_unknown
from .._common.text import html_text, text_table
from .._common.typed import typed
from ..effects import length_beyond
from ..errors import InvalidInput
from ..estimate.inputs import white_noise_std
from ..log import Log
from ..vehicle import Vehicle

# Quieter than these no sensor of a car is; simulated channels without noise are.
_QUIETEST = {"vx_mps": 0.01, "yaw_rate_radps": 5e-4, "ax_mps2": 0.02, "ay_mps2": 0.02}
_LENGTHS = ("relaxation_m", "ahead_m")
_SPEEDS = ("stop_below_mps", "go_above_mps")
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

    @typed
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
    @typed
    def of_car(cls, vehicle: Vehicle, **changes: float) -> SideslipSettings:
        """The defaults with the lengths of a car, and with the speeds that go as their root.

        A model car turns hard at speeds at which an ordinary one parks.
        """
        length = length_beyond(vehicle.wheelbase_m)
        usual = _core.sideslip_defaults()
        sizes = {name: length * usual[name] for name in _LENGTHS}
        sizes |= {name: min(math.sqrt(length), 1.0) * usual[name] for name in _SPEEDS}
        return cls(**{**sizes, **changes})

    @classmethod
    @typed
    def of(cls, log: Log, vehicle: Vehicle | None = None, **changes: float) -> SideslipSettings:
        """Take the noise of the sensors from the fast scatter of the log's channels.

        The observer starts at the speed from which models are run (`Log.least_speed_mps`). Lengths
        are those of a car of ordinary size, or of `vehicle`.
        """
        noise = {
            name: max(white_noise_std(log[name], NOISE_BLOCK), least)
            for name, least in _QUIETEST.items()
            if log.has(name)
        }
        usual = _core.sideslip_defaults() if vehicle is None else cls.of_car(vehicle)
        slow = log.least_speed_mps / usual["stop_below_mps"]
        speeds = {name: slow * usual[name] for name in _SPEEDS}
        lengths = {name: usual[name] for name in _LENGTHS}
        return cls(**{**noise, **speeds, **lengths, **changes})

    @typed
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
        meaning = _core.sideslip_meanings()
        rows = [[name, f"{value:.4g}", meaning[name]] for name, value in self.items()]
        return text_table(["setting", "value", "meaning"], rows)

    def __repr__(self) -> str:
        return f"SideslipSettings({', '.join(f'{k}={v:.4g}' for k, v in self.items())})"

    _repr_html_ = html_text
