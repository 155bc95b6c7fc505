"""Tyres of a model as property files of Pacejka's MF 5.2, pure lateral slip."""

from __future__ import annotations

from ..errors import InvalidInput
from ..identify.loads import LoadAtRest
from ..model import Model

_LINEAR = 1000.0  # PKY2 with which the stiffness is proportional to the load to 1e-6
_SENSITIVITY = "tyre_load_sensitivity.sensitivity"
_SCALED = ("LFZO", "LCY", "LMUY", "LEY", "LKY", "LHY", "LVY", "LGAY")


def left_out_of_tir(model: Model) -> list[str]:
    """Effects of a model for which the property file of a tyre has no place."""
    return [e for e in model.effects if e != "tyre_load_sensitivity"]


def tir_text(model: Model, axle: str) -> str:
    """Return the property file of a tyre of an axle, ``front`` or ``rear``.

    The stiffness is ``K = PKY1 Fz0 sin(2 atan(Fz / (PKY2 Fz0)))``; where the tyre of the model
    loses friction with load it agrees with the model in value and slope at the static load.
    Slip angles are those of the format, ``tan(alpha) = v_y / |v_x|``: PKY1 is negative.

    Raises
    ------
    InvalidInput
        If the friction rises with load, or falls faster than the format can tell.
    """
    b, c, d, e = (model.value(f"{letter}_{axle}") for letter in "BCDE")
    car = model.vehicle
    load = 0.5 * LoadAtRest(model, axle)(model.vector())
    loss = model.value(_SENSITIVITY) if "tyre_load_sensitivity" in model.effects else 0.0
    if not 0.0 <= loss < 1.0:
        raise InvalidInput(
            f"{_SENSITIVITY} = {loss:g}: MF 5.2 has no stiffness that grows so with load; give "
            f"it a value from 0 to 1 with with_values"
        )
    # d log K / d log Fz at the static load is 1 - loss.
    pky2 = min(((2.0 - loss) / loss) ** 0.5, _LINEAR) if loss > 0.0 else _LINEAR
    pky1 = -b * c * d * (pky2**2 + 1.0) / (2.0 * pky2)
    coefficients = {
        "PCY1": c,
        "PDY1": d,
        "PDY2": -loss * d,
        "PDY3": 0.0,
        "PEY1": e,
        **dict.fromkeys(("PEY2", "PEY3", "PEY4"), 0.0),
        "PKY1": pky1,
        "PKY2": pky2,
        **dict.fromkeys(("PKY3", "PHY1", "PHY2", "PHY3"), 0.0),
        **dict.fromkeys(("PVY1", "PVY2", "PVY3", "PVY4"), 0.0),
    }
    rows = "\n".join(f"{name:<24s}= {value!r}" for name, value in coefficients.items())
    scales = "\n".join(f"{name:<24s}= 1.0" for name in _SCALED)
    left = ", ".join(left_out_of_tir(model)) or "none"
    return f"""$ {" ".join(car.name.split())}, {axle} tyre: pure lateral slip as it was identified.
$ No part of the identified model, and left to fill in: longitudinal and combined slip, aligning
$ moment, camber, radius. Effects of the model that are not in this file: {left}.
[MDI_HEADER]
FILE_TYPE               = 'tir'
FILE_VERSION            = 3.0
FILE_FORMAT             = 'ASCII'
[UNITS]
LENGTH                  = 'meter'
FORCE                   = 'newton'
ANGLE                   = 'radians'
MASS                    = 'kg'
TIME                    = 'second'
[MODEL]
PROPERTY_FILE_FORMAT    = 'MF_05'
FITTYP                  = 52
USE_MODE                = 2
[VERTICAL]
FNOMIN                  = {load!r}
[SCALING_COEFFICIENTS]
{scales}
[LATERAL_COEFFICIENTS]
{rows}
"""
