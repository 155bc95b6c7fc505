"""A small grammar of formulas: monomials of what the car does, with their units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class _Quantity:
    text: str
    units: dict[str, int]
    value: Callable[[Any], Any]


_QUANTITIES = {
    "v_x": _Quantity("v_x", {"m": 1, "s": -1}, lambda d: d.v_x),
    "v_x r": _Quantity("v_x r", {"m": 1, "s": -2}, lambda d: d.v_x * d.r),
    "r": _Quantity("r", {"rad": 1, "s": -1}, lambda d: d.r),
    "steer": _Quantity("delta", {"rad": 1}, lambda d: d.steer),
    "alpha_f": _Quantity("alpha_f", {"rad": 1}, lambda d: d.alpha_f),
    "alpha_r": _Quantity("alpha_r", {"rad": 1}, lambda d: d.alpha_r),
    "F_x": _Quantity("F_x", {"N": 1}, lambda d: d.F_x),
}
_TARGET_UNITS = {
    "F_x": {"N": 1},
    "F_y": {"N": 1},
    "M_z": {"N": 1, "m": 1},
    "r": {"rad": 1, "s": -1},
    "a_x": {"m": 1, "s": -2},
    "a_y": {"m": 1, "s": -2},
}
# What stands for a power: x, x^2 and x^3 as they are, |x|, and the square with the sign of x.
_POWERS: dict[str, tuple[str, int, Callable[[Any], Any]]] = {
    "1": ("{}", 1, lambda x: x),
    "2": ("({})^2", 2, lambda x: x**2),
    "3": ("({})^3", 3, lambda x: x**3),
    "abs": ("|{}|", 1, np.abs),
    "signed": ("{0} |{0}|", 2, lambda x: x * np.abs(x)),
}


@dataclass(frozen=True)
class Form:
    """A product of quantities, each with a power.

    Attributes
    ----------
    factors : tuple of (str, str)
        Quantity and power.
    """

    factors: tuple[tuple[str, str], ...]

    def __call__(self, d: Any) -> Any:
        """Its value from a namespace with v_x, r, steer, F_x, alpha_f and alpha_r."""
        result: Any = d.v_x * 0.0 + 1.0 if not self.factors else None
        for quantity, power in self.factors:
            x = _POWERS[power][2](_QUANTITIES[quantity].value(d))
            result = x if result is None else result * x
        return result

    def uses(self, quantity: str) -> bool:
        """Whether a quantity is among its factors."""
        return any(q == quantity for q, _ in self.factors)

    @property
    def units(self) -> dict[str, int]:
        """Powers of m, s, rad and N."""
        total: dict[str, int] = {}
        for quantity, power in self.factors:
            for unit, n in _QUANTITIES[quantity].units.items():
                total[unit] = total.get(unit, 0) + n * _POWERS[power][1]
        return total

    def __str__(self) -> str:
        parts = [_POWERS[power][0].format(_QUANTITIES[q].text) for q, power in self.factors]
        return (
            " ".join(parts)
            .replace("(v_x)^", "v_x^")
            .replace("(delta)^", "delta^")
            .replace("(r)^", "r^")
        )


def unit_of_gain(target: str, form: Form) -> str:
    """Unit of the number that makes a force, moment or reading of a form."""
    units = dict(_TARGET_UNITS[target])
    for unit, n in form.units.items():
        units[unit] = units.get(unit, 0) - n
    over = [_power(u, n) for u, n in sorted(units.items()) if n > 0]
    under = [_power(u, -n) for u, n in sorted(units.items()) if n < 0]
    text = " ".join(over) or "1"
    return f"{text}/{under[0]}" if len(under) == 1 else "/".join([text, *under])


def _power(unit: str, n: int) -> str:
    return unit if n == 1 else f"{unit}{n}"


def forms(target: str) -> tuple[Form, ...]:
    """Forms that may act on a target.

    Those of F_x say the same in left and right turns, and know neither slip nor the wheel force:
    no force of the tyres is known before it.
    """
    speeds: list[tuple[tuple[str, str], ...]] = [(), (("v_x", "1"),), (("v_x", "2"),)]
    found: list[tuple[tuple[str, str], ...]] = list(speeds)
    if target == "F_x":
        found.append((("v_x", "3"),))
        for x in ("v_x r", "r", "steer"):
            found += [((x, power),) for power in ("abs", "2")]
        found.append((("v_x", "2"), ("steer", "2")))
        return tuple(Form(f) for f in found)
    turning = (
        ("v_x r", "steer")
        if target in ("r", "a_x", "a_y")
        else (
            "v_x r",
            "steer",
            "alpha_f",
            "alpha_r",
        )
    )
    for x in turning:
        found += [(*v, (x, "1")) for v in speeds]
        found += [((x, power),) for power in ("signed", "3", "2", "abs")]
    found.append((("r", "1"),))
    found += [(("F_x", power),) for power in ("1", "signed")]
    if target not in ("r", "a_x", "a_y"):
        found += [(("F_x", "1"), (x, "1")) for x in (*turning, "r")]
        found.append((("F_x", "abs"), ("v_x r", "1")))
    return tuple(Form(f) for f in found)
