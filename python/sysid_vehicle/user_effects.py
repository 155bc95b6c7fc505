"""Effects that users define in Python; they are used exactly as those of the catalogue."""

from __future__ import annotations

import re
import runpy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._arrays import FloatArray
from .effects import Effect, Parameter, catalogue, forget, register
from .errors import InvalidInput
from .formula import SIGNALS, TARGETS, Formula, evaluate, trace

__all__ = ["define_effect", "forget_effect", "load_effects", "parameter"]

Function = Callable[[Any, Any], Any]

_LATERAL = {"v_y", "r", "steer", "alpha_f", "alpha_r", "F_yf", "F_yr", "a_y", "r_dot"}
_TURNING = {"force_y", "moment_z", "force_y_front", "force_y_rear"} | {
    "vy_mps",
    "yaw_rate_radps",
    "ay_mps2",
}
_MOVES = {
    "force_x": ("ax_mps2", "vx_mps"),
    "force_y": ("ay_mps2",),
    "moment_z": ("yaw_rate_radps",),
    "force_y_front": ("yaw_rate_radps", "ay_mps2"),
    "force_y_rear": ("yaw_rate_radps", "ay_mps2"),
}
_NEEDS = ("steer_rad", "vx_mps", "yaw_rate_radps", "ay_mps2")
# What a car in brisk driving shows, for checking functions.
_RANGES = {
    "time": (0.0, 60.0),
    "v_x": (8.0, 50.0),
    "v_y": (-2.0, 2.0),
    "r": (-0.8, 0.8),
    "steer": (-0.1, 0.1),
    "F_x": (-8e3, 6e3),
    "alpha_f": (-0.1, 0.1),
    "alpha_r": (-0.1, 0.1),
    "F_xf": (-5e3, 3e3),
    "F_xr": (-3e3, 5e3),
    "F_zf": (3e3, 9e3),
    "F_zr": (3e3, 9e3),
    "F_yf": (-7e3, 7e3),
    "F_yr": (-7e3, 7e3),
    "a_x": (-8.0, 5.0),
    "a_y": (-9.0, 9.0),
    "r_dot": (-2.0, 2.0),
}


def parameter(
    name: str,
    unit: str,
    *,
    typical: float,
    lower: float,
    upper: float,
    null_value: float = 0.0,
    matters: float | None = None,
    typical_low: float | None = None,
    typical_high: float | None = None,
    scan: str = "",
) -> Parameter:
    """One parameter of an effect of your own.

    Parameters
    ----------
    name, unit : str
    typical : float
        A size one may meet, other than the null value.
    lower, upper : float
        Bounds of the search.
    null_value : float
        Where the effect vanishes exactly.
    matters : float, optional
        Smallest distance from the null value worth acting on; by default a fifth of the typical.
    typical_low, typical_high : float, optional
        Where most cars lie; by default a third and three times the typical distance.
    scan : str
        `range` for a second parameter that means nothing while the first is null.

    Raises
    ------
    InvalidInput
        The figures contradict each other.
    """
    distance = typical - null_value
    made = Parameter(
        name=name,
        unit=unit,
        null_value=float(null_value),
        typical=float(typical),
        matters=abs(distance) / 5.0 if matters is None else float(matters),
        lower=float(lower),
        upper=float(upper),
        typical_low=null_value + distance / 3.0 if typical_low is None else float(typical_low),
        typical_high=null_value + 3.0 * distance if typical_high is None else float(typical_high),
        mirrored=False,
        scan=scan,
        column=-1,
    )
    if not name.isidentifier():
        raise InvalidInput(f"parameter '{name}': the name must be a Python name")
    if not (lower <= null_value <= upper and lower < upper and lower <= typical <= upper):
        raise InvalidInput(
            f"parameter '{name}': null value {null_value:g} and typical size {typical:g} must lie "
            f"within the bounds {lower:g} to {upper:g}"
        )
    if typical == null_value or not made.matters > 0.0:
        raise InvalidInput(
            f"parameter '{name}': the typical size must differ from the null value "
            f"{null_value:g}, and the size that matters must be above 0"
        )
    if scan not in ("", "range") or (scan and not made.typical_low > 0.0):
        raise InvalidInput(f"parameter '{name}': scan may be 'range', with a typical range above 0")
    return made


def define_effect(
    id: str,
    *,
    title: str,
    parameters: Sequence[Parameter],
    force_x: Function | None = None,
    force_y: Function | None = None,
    moment_z: Function | None = None,
    force_y_front: Function | None = None,
    force_y_rear: Function | None = None,
    reads: Mapping[str, Function] | None = None,
    equation: str = "",
    source: str = "defined by the user",
    excited_by: str = "",
    twins: Sequence[str] = (),
) -> Effect:
    """Define an effect, checked and from then on used like one of the catalogue.

    Each function takes two namespaces, `d` of arrays and `p` of parameters, and returns what it
    adds. It is followed once and runs in the compiled core: arithmetic and NumPy functions are
    allowed, decisions only by `numpy.where`.

    Parameters
    ----------
    id : str
        A name of your own. Defining it again replaces the former definition.
    title : str
    parameters : sequence of Parameter
        One to four, made by :func:`parameter`.
    force_x : callable, optional
        Force along the car at its centre of gravity [N]; knows d.time, v_x, v_y, r, steer.
    force_y, force_y_front, force_y_rear : callable, optional
        Lateral force at the centre of gravity, or along the wheel's axis at an axle [N]; know
        also d.F_x, alpha_f, alpha_r, F_xf, F_xr, F_zf, F_zr, F_yf, F_yr.
    moment_z : callable, optional
        Yaw moment [N m]; knows the same.
    reads : mapping of str to callable, optional
        What a sensor reads too much, by channel (`ay_mps2`); knows also d.a_x, a_y, r_dot.
    equation, source, excited_by : str
        For the lists; the equation is that of the functions unless you give another.
    twins : sequence of str
        Effects that act alike in most driving.

    Returns
    -------
    Effect

    Raises
    ------
    InvalidInput
        The name is taken or malformed, the effect does not vanish at its null values, a function
        cannot be followed, gives what is not finite, or a parameter does nothing.

    Examples
    --------
    >>> define_effect(
    ...     "roof_box",
    ...     title="side force that grows with speed",
    ...     parameters=[parameter("gain", "N s2/m2", typical=0.5, lower=-5, upper=5)],
    ...     force_y=lambda d, p: p.gain * d.v_x**2,
    ... )  # doctest: +SKIP
    """
    functions: dict[str, Function] = {
        name: function
        for name, function in {
            "force_x": force_x,
            "force_y": force_y,
            "moment_z": moment_z,
            "force_y_front": force_y_front,
            "force_y_rear": force_y_rear,
            **(reads or {}),
        }.items()
        if function is not None
    }
    what = f"effect '{id}'"
    _check_names(id, what, parameters, functions)
    names = [p.name for p in parameters]
    formulas = {t: trace(f, names, t, f"{what}, {t}") for t, f in functions.items()}
    parameters, steep = _checked(what, tuple(parameters), functions)
    made = Effect(
        id=id,
        title=title,
        equation=equation or ", ".join(f"{t} += {f.text}" for t, f in formulas.items()),
        source=source,
        excited_by=excited_by or "driving in which " + _read(formulas) + " vary",
        moves=", ".join(dict.fromkeys(c for t in formulas for c in _MOVES.get(t, (t,)))),
        parameters=parameters,
        index=-1,
        scored_at_typical=steep,
        needs_force=set(formulas) == {"force_x"},
        needs=_NEEDS,
        twins=tuple(twins),
        through="",
        states=0,
        acts=tuple((TARGETS.index(t), f.steps) for t, f in formulas.items()),
    )
    return register(made)


def forget_effect(id: str) -> None:
    """Remove an effect of your own.

    Raises
    ------
    InvalidInput
        No effect of a user has this id.
    """
    forget(id)


def load_effects(path: str | Path) -> tuple[Effect, ...]:
    """Run a Python file that defines effects, and give those it defined.

    The file is a program: run only what you trust.

    Raises
    ------
    InvalidInput
        The file cannot be read, fails, or defines nothing.
    """
    path = Path(path)
    before = [*catalogue()]
    try:
        runpy.run_path(str(path))
    except InvalidInput as e:
        raise InvalidInput(f"{path}: {e}") from e
    except Exception as e:
        raise InvalidInput(f"{path}: {type(e).__name__}: {e}") from e
    found = tuple(e for e in catalogue() if not any(e is b for b in before))
    if not found:
        raise InvalidInput(f"{path}: it defines no effect; call sysid_vehicle.define_effect in it")
    return found


def _check_names(
    id_: str, what: str, parameters: Sequence[Parameter], functions: Mapping[str, Function]
) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9_]*", id_):
        raise InvalidInput(f"{what}: use small letters, digits and underscores")
    if any(e.id == id_ and not e.acts for e in catalogue()):
        raise InvalidInput(f"{what}: the catalogue has one of this name")
    if not functions:
        raise InvalidInput(f"{what}: give at least one function of {', '.join(TARGETS)}")
    unknown = [t for t in functions if t not in TARGETS]
    if unknown:
        raise InvalidInput(f"{what}: there is no '{unknown[0]}'; there are {', '.join(TARGETS)}")
    if not 1 <= len(parameters) <= _core.USER_PARAMETERS:
        raise InvalidInput(f"{what}: it must have 1 to {_core.USER_PARAMETERS} parameters")
    names = [p.name for p in parameters]
    if len(set(names)) < len(names):
        raise InvalidInput(f"{what}: two parameters have the same name")
    scanned = [i for i, p in enumerate(parameters) if p.scan]
    if scanned and (scanned != [1] or len(parameters) != 2):
        raise InvalidInput(f"{what}: only the second of two parameters may be scanned")


def _checked(
    what: str, parameters: tuple[Parameter, ...], functions: Mapping[str, Function]
) -> tuple[tuple[Parameter, ...], bool]:
    """Parameters that know whether a mirror turns them, and whether a slope at null is missing."""
    rng = np.random.default_rng(0)
    signals = {n: rng.uniform(*_RANGES[n], 200) for n in SIGNALS}
    mirror = {n: -x if n in _LATERAL else x for n, x in signals.items()}
    null = {p.name: p.null_value for p in parameters}
    scanned = {p.name: p.typical for p in parameters if p.scan}

    def values(at: Mapping[str, float], given: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        with np.errstate(all="ignore"):
            return {t: evaluate(f, t, given, at) for t, f in functions.items()}

    for target, y in values(null | scanned, signals).items():
        if not np.isfinite(y).all():
            raise InvalidInput(f"{what}, {target}: it is not finite for all of brisk driving")
        if np.any(y != 0.0):
            at = ", ".join(f"{n} = {v:g}" for n, v in (null | scanned).items())
            raise InvalidInput(
                f"{what}, {target}: at the null values ({at}) it must vanish exactly, "
                f"and is up to {np.abs(y).max():g}"
            )
    steep = False
    seen = []
    for p in parameters:
        if p.scan:
            seen.append(p)
            continue
        full = values(null | scanned | {p.name: p.typical}, signals)
        few = values(
            null | scanned | {p.name: p.null_value + 1e-4 * (p.typical - p.null_value)}, signals
        )
        size = sum(float(np.linalg.norm(y)) for y in full.values())
        if not np.isfinite(size):
            raise InvalidInput(
                f"{what}: with {p.name} = {p.typical:g} it is not finite for all of brisk driving"
            )
        if size == 0.0:
            raise InvalidInput(
                f"{what}: {p.name} does nothing by itself; where it means nothing while another "
                "is null, give it scan='range'"
            )
        slope = sum(float(np.linalg.norm(y)) for y in few.values()) / (1e-4 * size)
        steep |= not 0.02 < slope < 50.0
        turned = values(null | scanned | {p.name: p.typical}, mirror)
        other = all(
            np.allclose(turned[t], y if t in _TURNING else -y, rtol=1e-9, atol=1e-12)
            for t, y in full.items()
        )
        seen.append(replace(p, mirrored=other))
    return tuple(seen), steep


def _read(formulas: Mapping[str, Formula]) -> str:
    """Names of the signals that the formulas read."""
    text = " ".join(f.text for f in formulas.values())
    found = [s for s in SIGNALS if re.search(rf"\b{re.escape(s)}\b", text)]
    return ", ".join(found) if found else "speed and steering"
