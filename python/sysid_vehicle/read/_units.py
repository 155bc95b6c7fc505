"""Units that stand in a row of their own below the column names."""

from __future__ import annotations

import math

_G = 9.80665

# Factor to the SI unit of a canonical channel, by that unit and the text in the file.
_FACTORS: dict[str, dict[str, float]] = {
    "s": {
        "s": 1.0,
        "sec": 1.0,
        "second": 1.0,
        "seconds": 1.0,
        "ms": 1e-3,
        "msec": 1e-3,
        "us": 1e-6,
        "µs": 1e-6,
        "μs": 1e-6,
        "ns": 1e-9,
        "min": 60.0,
    },
    "m/s": {
        "m/s": 1.0,
        "mps": 1.0,
        "km/h": 1.0 / 3.6,
        "kmh": 1.0 / 3.6,
        "kph": 1.0 / 3.6,
        "mph": 0.44704,
        "mm/s": 1e-3,
        "cm/s": 1e-2,
        "kn": 1852.0 / 3600.0,
        "knots": 1852.0 / 3600.0,
        "ft/s": 0.3048,
    },
    "rad/s": {
        "rad/s": 1.0,
        "radps": 1.0,
        "deg/s": math.pi / 180.0,
        "degps": math.pi / 180.0,
        "dps": math.pi / 180.0,
        "°/s": math.pi / 180.0,
        "mrad/s": 1e-3,
    },
    "m/s2": {
        "m/s2": 1.0,
        "mps2": 1.0,
        "g": _G,
        "mg": 1e-3 * _G,
        "km/h/s": 1.0 / 3.6,
        "ft/s2": 0.3048,
        "cm/s2": 1e-2,
    },
    "rad": {
        "rad": 1.0,
        "mrad": 1e-3,
        "deg": math.pi / 180.0,
        "°": math.pi / 180.0,
        "degree": math.pi / 180.0,
        "degrees": math.pi / 180.0,
    },
    "N": {"n": 1.0, "kn": 1e3, "dan": 10.0, "lbf": 4.4482216152605},
}
_SEEN = {unit for factors in _FACTORS.values() for unit in factors} | {"-", "1", "%", "bar", "nm"}


def plain(text: str) -> str:
    """Return a unit as it is looked up: without brackets, spaces, powers written in other ways."""
    text = text.strip().strip("[](){}").replace(" ", "").replace("²", "2").replace("^", "")
    return text.replace("**", "").replace("*", "").replace("s-2", "s2").lower()


def is_unit(text: str) -> bool:
    """Tell whether a cell is a unit that logs of cars have, in brackets or not."""
    return plain(text) in _SEEN or (text.strip()[:1] in ("[", "(") and len(text.strip()) < 20)


def factor_to(si_unit: str, text: str) -> float | None:
    """Return the factor from the unit in a file to that of a channel; None if it is not known."""
    return _FACTORS.get(si_unit, {}).get(plain(text))
