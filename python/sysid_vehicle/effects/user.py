"""Effects that users define in Python; they are used exactly as those of the catalogue."""

from __future__ import annotations

import math
import re
import runpy
from collections.abc import Mapping, Sequence
from pathlib import Path

from .._common.arguments import expect
from .._common.files import read_bytes
from .._common.kinds import EMPTY, TABLE, kind_of
from .._common.typed import typed
from ..errors import InvalidInput
from . import plugins
from .catalogue import Effect, catalogue, effect, forget, register
from .checks import Function, State, check_names, checked
from .formula import EVERYTHING, OUTSET, SIGNALS, TARGETS, Formula, trace
from .parts import OwnState, Parameter
from .slope import decay_of

_MOVES = {
    "force_x": ("ax_mps2", "vx_mps"),
    "force_y": ("ay_mps2",),
    "moment_z": ("yaw_rate_radps",),
    "force_y_front": ("yaw_rate_radps", "ay_mps2"),
    "force_y_rear": ("yaw_rate_radps", "ay_mps2"),
}
_NEEDS = ("steer_rad", "vx_mps", "yaw_rate_radps", "ay_mps2")


@typed
def parameter(
    name: str,
    unit: str,
    *,
    typical: float,
    lower: float,
    upper: float,
    null_value: float | None = None,
    matters: float | None = None,
    typical_low: float | None = None,
    typical_high: float | None = None,
    scan: str = "",
) -> Parameter:
    """One parameter of an effect of your own.

    Parameters
    ----------
    name, unit : str
        A pure number has the unit `1`.
    typical : float
        A size one may meet, other than the null value.
    lower, upper : float
        Bounds of the search, finite.
    null_value : float
        Where the effect vanishes exactly; by default 0, or the typical value if it is scanned.
    matters : float, optional
        Smallest distance from the null value worth acting on; by default a fifth of the typical.
    typical_low, typical_high : float, optional
        Where most cars lie; by default a third and three times the typical distance.
    scan : str
        `range` for a second parameter that means nothing while the first is null, such as a time
        constant: it is tried at several values of its typical range.

    Raises
    ------
    InvalidInput
        The figures contradict each other.
    """
    if null_value is None:
        null_value = typical if scan else 0.0
    distance = typical if scan else typical - null_value
    nothing = 0.0 if scan else null_value
    made = Parameter(
        name=name,
        unit=unit.strip() or "1",
        null_value=float(null_value),
        typical=float(typical),
        matters=abs(distance) / 5.0 if matters is None else float(matters),
        lower=float(lower),
        upper=float(upper),
        typical_low=nothing + distance / 3.0 if typical_low is None else float(typical_low),
        typical_high=nothing + 3.0 * distance if typical_high is None else float(typical_high),
        mirrored=False,
        scan=scan,
        column=-1,
    )
    if not name.isidentifier():
        raise InvalidInput(f"parameter '{name}': the name must be a Python name")
    if not -math.inf < lower < upper < math.inf:
        raise InvalidInput(
            f"parameter '{name}': the bounds are {lower:g} to {upper:g}; give (lowest, highest), "
            "finite: the search begins all over the range"
        )
    if not (lower <= null_value <= upper and lower <= typical <= upper):
        raise InvalidInput(
            f"parameter '{name}': null value {null_value:g} and typical size {typical:g} must lie "
            f"within the bounds {lower:g} to {upper:g}"
        )
    if (typical == null_value and not scan) or not made.matters > 0.0:
        raise InvalidInput(
            f"parameter '{name}': the typical size must differ from the null value "
            f"{null_value:g}, and the size that matters must be above 0"
        )
    if scan not in ("", "range") or (scan and not made.typical_low > 0.0):
        raise InvalidInput(f"parameter '{name}': scan may be 'range', with a typical range above 0")
    return made


@typed
def state(
    name: str,
    unit: str,
    *,
    rate: Function,
    usual: tuple[float, float],
    initial: Function | float | None = None,
) -> State:
    """A state of an effect of your own: a temperature, a filtered signal, a wear.

    Parameters
    ----------
    name, unit : str
        Functions read it as `d.name`.
    rate : callable
        Its derivative by time, of the namespaces `d` and `p`; `d` has all signals, the channels and
        the states.
    usual : tuple of 2 floats
        Where its values lie in brisk driving, to check the functions there.
    initial : callable or float, optional
        Its value when a run begins, of `d` as `force_x` knows it and `p`. By default it begins
        where it would rest, which a state that only adds up does not have.

    Raises
    ------
    InvalidInput
        The name is no Python name.
    """
    if not name.isidentifier():
        raise InvalidInput(f"state '{name}': the name must be a Python name")
    begins = initial if callable(initial) or initial is None else _constant(float(initial))
    return State(name, unit, rate, begins, usual)


def _constant(value: float) -> Function:
    return lambda _d, _p: value


@typed
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
    channels: Mapping[str, tuple[float, float]] | None = None,
    states: Sequence[State] = (),
    equation: str = "",
    source: str = "defined by the user",
    excited_by: str = "",
    confounded_with: Sequence[str] = (),
    breaks: str = "",
) -> Effect:
    """Define an effect, checked and from then on used like one of the catalogue.

    Each function takes two namespaces, `d` of arrays and `p` of parameters, and returns what it
    adds. It is followed once and runs in the compiled core: arithmetic and NumPy functions are
    allowed, decisions only by `numpy.where`, of comparisons that `&`, `|` and `~` may join.

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
        also d.F_x, alpha_f, alpha_r, F_xf, F_xr, F_zf, F_zr, F_yf, F_yr, and of each wheel
        F_zfl, F_zfr, F_zrl, F_zrr, alpha_fl and so on, v_xfl and so on (the speed of its contact
        along the car, which force_x knows too).
    moment_z : callable, optional
        Yaw moment [N m]; knows the same.
    reads : mapping of str to callable, optional
        What a sensor reads too much, by channel (`ay_mps2`); knows also d.a_x, a_y, r_dot.
    channels : mapping of str to tuple of 2 floats, optional
        Further columns of the log that functions read as `d.name`, each with the lowest and the
        highest value one meets. Put the unit in the name. A log without one cannot be used with
        the effect.
    states : sequence of State
        States of the effect's own, made by :func:`state`; functions read them as `d.name`.
    equation, source, excited_by : str
        For the lists; the equation is that of the functions unless you give another.
    confounded_with : sequence of str
        Effects that act alike in most driving.
    breaks : str
        Law of motion that readings seem to break where it acts, through no fault of theirs, as
        `Effect.breaks` has them: `on a slope` of a road that is banked or climbs.

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
    texts = {"title": title, "equation": equation, "source": source, "excited_by": excited_by}
    for told, text in texts.items():
        expect(text, str, f"{what}: {told}")
    known = {e.breaks for e in catalogue()}
    if breaks not in known:
        raise InvalidInput(
            f"{what}: breaks = {breaks!r}; there are {', '.join(sorted(known - {''}))}"
        )
    columns = dict(channels or {})
    check_names(id, what, parameters, functions, columns, states)
    names = [p.name for p in parameters]

    def followed(function: Function, place: str, told: str, reads_states: bool = True) -> Formula:
        own = [s.name for s in states] if reads_states else []
        return trace(function, names, place, f"{what}, {told}", channels=list(columns), states=own)

    formulas = {t: followed(f, t, t) for t, f in functions.items()}
    rates = {s.name: followed(s.rate, EVERYTHING, f"rate of {s.name}") for s in states}
    own_states = []
    for i, s in enumerate(states):
        rate = rates[s.name].steps
        begins = s.initial and followed(s.initial, OUTSET, f"initial {s.name}", False).steps
        decay = decay_of(rate, i)
        if begins is None and decay[-1][0] == 0 and not decay[-1][2] > 0.0:
            raise InvalidInput(
                f"{what}: the state {s.name} does not come to rest by itself; give it an initial "
                "value"
            )
        own_states.append(OwnState(s.name, s.unit, rate, decay, begins))
    parameters, steep = checked(what, tuple(parameters), functions, columns, states)
    equations = [f"{t} += {f.text}" for t, f in formulas.items()]
    equations += [f"d{n}/dt = {f.text}" for n, f in rates.items()]
    made = Effect(
        id=id,
        title=title,
        equation=equation or ", ".join(equations),
        source=source,
        excited_by=excited_by or "driving in which " + _read(formulas | rates, columns) + " vary",
        moves=", ".join(dict.fromkeys(c for t in formulas for c in _MOVES.get(t, (t,)))),
        parameters=parameters,
        index=-1,
        scored_at_typical=steep,
        needs_force=set(formulas) == {"force_x"},
        needs=(*_NEEDS, *columns),
        confounded_with=tuple(confounded_with),
        through="",
        breaks=breaks,
        states=len(own_states),
        acts=tuple((TARGETS.index(t), f.steps) for t, f in formulas.items()),
        channels=tuple(columns),
        own_states=tuple(own_states),
    )
    return register(made)


@typed
def forget_effect(id: str) -> None:
    """Remove an effect of your own.

    Raises
    ------
    InvalidInput
        No effect of a user has this id.
    """
    forget(id)


@typed
def load_effects(path: str | Path) -> tuple[Effect, ...]:
    """Run a Python file that defines effects, and give those it defined.

    The file is a program: run only what you trust.

    Parameters
    ----------
    path : str or Path
        The file, or the id of an effect that an installed package defines
        (:func:`installed_effects` lists them).

    Raises
    ------
    InvalidInput
        The file cannot be read, fails, or defines nothing.

    Warns
    -----
    SysidWarning
        If code of an installed package runs.
    """
    path = Path(path)
    if not path.exists() and any(p.id == str(path) for p in plugins.installed_effects()):
        return (effect(str(path)),)
    refuse_no_program(path)
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


def refuse_no_program(path: Path) -> None:
    """Refuse what cannot be a Python file that defines effects, before it is run.

    Raises
    ------
    InvalidInput
    """
    wanted = "not a Python file that defines effects"
    if path.is_dir():
        if not (path / "__main__.py").exists():
            raise InvalidInput(f"{path}: is a folder, {wanted}; give the file")
        return
    kind = kind_of(read_bytes(path))
    if kind not in ("", EMPTY, TABLE, "a ZIP archive"):
        raise InvalidInput(f"{path}: is {kind}, {wanted}; give the file")


def _read(formulas: Mapping[str, Formula], channels: Mapping[str, object]) -> str:
    """Names of the signals and channels that the formulas read."""
    text = " ".join(f.text for f in formulas.values())
    found = [s for s in (*SIGNALS, *channels) if re.search(rf"\b{re.escape(s)}\b", text)]
    return ", ".join(found) if found else "speed and steering"
