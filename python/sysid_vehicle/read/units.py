"""Units that a file states: what they measure, and their factors to the units of the channels.

One table is all that converts; a unit that it does not have is never guessed. Names that begin with
``unit_`` are those of Volkswagen's databases of CAN frames.
"""

from __future__ import annotations

import math
import re

from ..vehicle import GRAVITY_MPS2

_DEG = math.pi / 180.0
_POUND = 0.45359237

# Factor to the SI unit, by that unit and the text in the file as `plain` gives it.
FACTORS: dict[str, dict[str, float]] = {
    "s": {
        **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "unixtime"), 1.0),
        **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
        **dict.fromkeys(("us", "µs", "μs", "microsecond", "microseconds"), 1e-6),
        **dict.fromkeys(("ns", "nanosecond", "nanoseconds"), 1e-9),
        **dict.fromkeys(("min", "minutes"), 60.0),
        **dict.fromkeys(("h", "hr", "hours"), 3600.0),
        **dict.fromkeys(("d", "day", "days"), 86400.0),
    },
    "m/s": {
        **dict.fromkeys(("m/s", "mps", "ms-1", "m/sec"), 1.0),
        **dict.fromkeys(
            ("km/h", "kmh", "kph", "kmph", "km/hr", "unit_kilometerperhour"), 1.0 / 3.6
        ),
        **dict.fromkeys(("mph", "mi/h", "miles/h"), 0.44704),
        "mm/s": 1e-3,
        "cm/s": 1e-2,
        **dict.fromkeys(("kn", "kt", "kts", "knot", "knots"), 1852.0 / 3600.0),
        **dict.fromkeys(("ft/s", "fps"), 0.3048),
    },
    "rad/s": {
        **dict.fromkeys(("rad/s", "radps", "rad/sec", "rads-1"), 1.0),
        **dict.fromkeys(
            ("deg/s", "degps", "dps", "°/s", "deg/sec", "degree/s", "degrees/s", "degs-1"), _DEG
        ),
        **dict.fromkeys(("°/sec", "degree/sec", "degrees/sec", "grad/s", "degrees-1"), _DEG),
        "unit_degreofarcpersecon": _DEG,
        "mrad/s": 1e-3,
        **dict.fromkeys(("rpm", "1/min", "r/min", "rev/min", "min-1"), math.pi / 30.0),
    },
    "m/s2": {
        **dict.fromkeys(("m/s2", "mps2", "m/s/s", "m/ss", "ms2", "m/sec2"), 1.0),
        "unit_meterperseconsquar": 1.0,
        **dict.fromkeys(("g", "gn", "gee"), GRAVITY_MPS2),
        "mg": 1e-3 * GRAVITY_MPS2,
        **dict.fromkeys(("km/h/s", "kmh/s"), 1.0 / 3.6),
        "ft/s2": 0.3048,
        "cm/s2": 1e-2,
        "mm/s2": 1e-3,
    },
    "rad": {
        **dict.fromkeys(("rad", "radian", "radians"), 1.0),
        "mrad": 1e-3,
        # "Grad" is degree in German, which loggers use; no log of a car has angles in gon.
        **dict.fromkeys(
            ("deg", "°", "degree", "degrees", "grad°", "grad", "unit_degreofarc"), _DEG
        ),
        "gon": math.pi / 200.0,
        **dict.fromkeys(("arcmin", "'"), _DEG / 60.0),
        **dict.fromkeys(("rev", "revs", "turn", "turns"), 2.0 * math.pi),
    },
    "N": {
        **dict.fromkeys(("n", "newton", "newtons"), 1.0),
        "kn": 1e3,
        "mn": 1e6,
        "dan": 10.0,
        **dict.fromkeys(("lbf", "lb", "lbs"), _POUND * GRAVITY_MPS2),
        **dict.fromkeys(("klbf", "kip"), 1e3 * _POUND * GRAVITY_MPS2),
        **dict.fromkeys(("kgf", "kp", "kg"), GRAVITY_MPS2),
    },
    "kg": {
        **dict.fromkeys(("kg", "kilogram"), 1.0),
        **dict.fromkeys(("t", "ton", "tonne"), 1e3),
        **dict.fromkeys(("lb", "lbs", "lbm", "pound", "pounds"), _POUND),
        "slug": 14.593902937,
    },
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": 0.3048, "in": 0.0254, "mi": 1609.344},
    "N m": {"nm": 1.0, "knm": 1e3, "lbft": 1.3558179483, "ftlb": 1.3558179483, "lb-ft": 1.3558},
    "Pa": {"pa": 1.0, "kpa": 1e3, "mpa": 1e6, "bar": 1e5, "mbar": 1e2, "psi": 6894.757},
    "degC": {"degc": 1.0, "°c": 1.0, "c": 1.0, "degf": 1.0, "°f": 1.0, "f": 1.0, "k": 1.0},
    "V": {"v": 1.0, "mv": 1e-3, "volt": 1.0, "volts": 1.0},
    "A": {"a": 1.0, "ma": 1e-3, "amp": 1.0},
    "Hz": {"hz": 1.0, "khz": 1e3},
    "%": {"%": 1.0, "percent": 1.0},
}
WHAT = {
    "s": "a time",
    "m/s": "a speed",
    "rad/s": "an angular velocity",
    "m/s2": "an acceleration",
    "rad": "an angle",
    "N": "a force",
    "kg": "a mass",
    "m": "a length",
    "N m": "a torque",
    "Pa": "a pressure",
    "degC": "a temperature",
    "V": "a voltage",
    "A": "a current",
    "Hz": "a frequency",
    "%": "a share",
}
_LAST_WORD = re.compile(r"^(.*[^\W_])[\s_.]+([A-Za-z]\w*)$")
_QUOTIENT = re.compile(r"^(.*[^\W_])[\s_.]+([A-Za-z]+)[\s_]([A-Za-z]+2?)$")
# Units that are words of other meanings in names.
_WORDS = {"turn", "turns", "rev", "revs", "min", "h", "grad"}
_AT_END = re.compile(r"[\[({]([^\[\](){}]+)[\])}]\s*$")
# Words of units that are spelled out.
_SPELLED = tuple(
    (re.compile(rf"\b{word}\b"), short)
    for word, short in (
        ("kilomet(?:er|re)s?", "km"),
        ("met(?:er|re)s?", "m"),
        ("hours?", "h"),
        ("seconds?|secs?", "s"),
        ("degrees?", "deg"),
        ("radians?", "rad"),
    )
)
_NONE = {"", "-", "1", "none", "null", "n/a", "na", "[]", "unitless", "no_unit", "nounit"}


def plain(text: str) -> str:
    """Return a unit as it is looked up: without brackets, spaces, powers written in other ways.

    UTF-8 that was read as Latin-1 is mended. Times ``since`` a date, as in netCDF, have the unit
    before that word.
    """
    text = text.replace("Â°", "°").replace("Â²", "²").partition(" since ")[0]
    text = text.replace("º", "°").replace("⁻", "-").replace("¹", "1").replace(" per ", "/")
    text = text.strip().strip("[](){}").replace(" ", "").replace("²", "2").replace("^", "")
    text = text.replace("**", "").replace("*", "").replace("·", "").replace("s-2", "s2").lower()
    for word, short in _SPELLED:
        text = word.sub(short, text)
    return {"m/s-2": "m/s2", "ms2": "m/s2"}.get(text, text)


def is_unit(text: str) -> bool:
    """Tell whether a cell is a unit that logs of cars have, in brackets or not."""
    there = plain(text)
    if any(there in factors for factors in FACTORS.values()) or there in _NONE - {""}:
        return True
    return text.strip()[:1] in ("[", "(") and len(text.strip()) < 20


def states_nothing(text: str) -> bool:
    """Tell whether a unit is a way to say that there is none."""
    return plain(text) in _NONE


def factor_to(si_unit: str, text: str) -> float | None:
    """Return the factor from the unit in a file to that of a channel; None if it is not known."""
    return FACTORS.get(si_unit, {}).get(plain(text))


def unit_in_name(name: str, si_unit: str) -> str:
    """Return the unit in brackets at the end of a name, ``Speed [km/h]``, if it is of that kind.

    Anything else in brackets, such as a place or an axle, states no unit.
    """
    found = _AT_END.search(name)
    return found[1] if found and factor_to(si_unit, found[1]) is not None else ""


def without_unit(name: str, si_unit: str) -> str:
    """Return a name without the unit of that kind in brackets at its end."""
    return _AT_END.sub("", name) if unit_in_name(name, si_unit) else name


def unit_at_end(name: str, si_unit: str) -> tuple[str, str]:
    """Return a name without the unit of that kind that is its last word, and that unit.

    ``steer_deg`` is ``steer`` in ``deg``, ``yaw_deg_s`` is ``yaw`` in ``deg/s``; both are what they
    were where there is none.
    """
    found = _QUOTIENT.search(name)
    if found is not None and factor_to(si_unit, f"{found[2]}/{found[3]}") is not None:
        return found[1], f"{found[2]}/{found[3]}"
    found = _LAST_WORD.search(name)
    if found is None or found[2].lower() in _WORDS or factor_to(si_unit, found[2]) is None:
        return name, ""
    return found[1], found[2]


def measures(text: str) -> str:
    """Return what a unit measures, in words; empty if it is not known."""
    return next((WHAT[si] for si, factors in FACTORS.items() if plain(text) in factors), "")
