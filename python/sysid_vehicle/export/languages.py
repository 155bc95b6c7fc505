"""Equations as a module of Python, a header of C++, a function of CasADi."""

from __future__ import annotations

from typing import Any

from .._common.arguments import expect
from .._common.typed import typed
from .._core import __version__
from ..errors import InvalidInput
from ..model import Model
from .calculation import FUNCTIONS
from .equations import Equations, equations

_ABOUT = (
    "Axes of ISO 8855, SI units. steer: angle of the road wheels [rad], positive to the left;",
    "force: total force of the wheels [N], brakes negative, before drag.",
    "Forwards alone: at walking pace, at a standstill and backwards slip angles mean nothing.",
)


def title(model: Model, e: Equations) -> list[str]:
    """Say in lines what the equations are of."""
    acting = [p.id for p in model.parts if p.id not in e.left_out]
    name = " ".join(model.vehicle.name.split())  # one line, whatever it holds
    what = ", ".join(acting) or "baseline"
    lines = [
        f"{name}: single track with Magic Formula tyres, {what}.",
        f"Written by sysid_vehicle {__version__}.",
        *_ABOUT,
        f"State: {', '.join(f'{state.name} [{state.unit}]' for state in e.states)}.",
    ]
    if e.left_out:
        lines.append(f"Left out, because only sensors show it: {', '.join(e.left_out)}.")
    return lines


def python_text(model: Model) -> str:
    """Return a module of Python that needs NumPy alone.

    ``derivatives(state, steer, force)`` gives the rates of the state, `a_x` and `a_y`;
    ``step(state, before, after, dt)`` goes on by a time with inputs linear in between. States may
    be arrays of many cars.
    """
    e = equations(model)
    names = [state.name for state in e.states]
    about = "\n".join(title(model, e)).replace("\\", "").replace('"""', "'''")
    constants = "\n".join(f"{name} = {value!r}  # {told}" for name, value, told in e.constants)
    body = "\n".join(f"    {line}" for what, lines in e.sections for line in (f"# {what}", *lines))
    rates = _listed([f"{name}_rate" for name in names])
    return f'''"""{about}
"""

{_imports(e)}

{constants}


def derivatives(state, steer, force):
    """Rates of the state, and what accelerometers feel at the centre of gravity: a_x, a_y."""
    {_listed(names)} = state
{body}
    rates = {rates}
    return array({"rates" if e.even else "broadcast_arrays(*rates)"}), a_x, a_y


def step(state, before, after, dt, substeps=4):
    """The state after a time `dt` [s]; inputs (steer, force) go linearly from before to after."""
    state = array(state, dtype=float)
    first, last = array(before, dtype=float), array(after, dtype=float)
    h = dt / substeps
    for k in range(substeps):
        begin = first + (last - first) * (k / substeps)
        middle = first + (last - first) * ((k + 0.5) / substeps)
        end = first + (last - first) * ((k + 1.0) / substeps)
        k1 = derivatives(state, *begin)[0]
        k2 = derivatives(state + 0.5 * h * k1, *middle)[0]
        k3 = derivatives(state + 0.5 * h * k2, *middle)[0]
        k4 = derivatives(state + h * k3, *end)[0]
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state
'''


def _imports(e: Equations) -> str:
    used = e.functions | {"array"} | (set() if e.even else {"broadcast_arrays"})
    other = {"atan": "arctan", "atan2": "arctan2"}
    lines = [f"from numpy import {other[name]} as {name}" for name in sorted(used & set(other))]
    return "\n".join([*lines, f"from numpy import {', '.join(sorted(used - set(other)))}"])


def _listed(names: list[str]) -> str:
    """Names between commas, each on a line of its own where one line is too short."""
    line = ", ".join(names)
    if len(line) < 80:
        return line
    return "(\n" + "".join(f"        {name},\n" for name in names) + "    )"


def cpp_assignments(e: Equations) -> list[str]:
    """Statements of C++ in the order of the equations; each name is declared where it is new."""
    statements, known = [], set()
    for what, lines in e.sections:
        statements.append(f"// {what}")
        for line in lines:
            name, _, expression = line.partition(" = ")
            statements.append(f"{'' if name in known else 'double '}{name} = {expression};")
            known.add(name)
    return statements


def using(e: Equations, *more: str) -> str:
    """Declarations of the functions that the equations call, and of some more."""
    called = sorted({*e.functions, *more} - {"where"})
    return "\n".join(f"    using std::{name};" for name in called)


def cpp_text(model: Model) -> str:
    """Return a header of C++11 that needs the standard library alone."""
    e = equations(model)
    names = [state.name for state in e.states]
    about = "\n".join(f"// {line}" for line in title(model, e)).replace("\\", "")
    constants = "\n".join(
        f"constexpr double {name} = {value!r};  // {told}" for name, value, told in e.constants
    )
    read = "\n".join(f"    const double {name} = state[{k}];" for k, name in enumerate(names))
    written = "\n".join(f"    rate[{k}] = {name}_rate;" for k, name in enumerate(names))
    text = "\n".join(f"    {line}" for line in cpp_assignments(e))
    return f"""{about}
#pragma once

#include <array>
#include <cmath>

namespace identified_car {{

constexpr int kStates = {len(names)};
using State = std::array<double, kStates>;

{constants}

inline double where(bool condition, double yes, double no) {{ return condition ? yes : no; }}

/// Rates of the state; felt[0] and felt[1], if given, become a_x and a_y of the centre of gravity.
inline State derivatives(const State& state, double steer, double force, double* felt = nullptr) {{
{using(e)}
{read}
{text}
    State rate;
{written}
    if (felt != nullptr) {{
        felt[0] = a_x;
        felt[1] = a_y;
    }}
    return rate;
}}

/// The state after `dt` seconds; inputs {{steer, force}} go linearly from `before` to `after`.
inline State step(State state, const std::array<double, 2>& before,
                  const std::array<double, 2>& after, double dt, int substeps = 4) {{
    const double h = dt / substeps;
    const auto rate = [&](const State& x, double part) {{
        return derivatives(x, before[0] + part * (after[0] - before[0]),
                           before[1] + part * (after[1] - before[1]));
    }};
    const auto moved = [](const State& x, const State& by, double size) {{
        State y = x;
        for (int i = 0; i < kStates; ++i) y[i] += size * by[i];
        return y;
    }};
    for (int k = 0; k < substeps; ++k) {{
        const double begin = double(k) / substeps, middle = (k + 0.5) / substeps;
        const State k1 = rate(state, begin);
        const State k2 = rate(moved(state, k1, 0.5 * h), middle);
        const State k3 = rate(moved(state, k2, 0.5 * h), middle);
        const State k4 = rate(moved(state, k3, h), (k + 1.0) / substeps);
        for (int i = 0; i < kStates; ++i)
            state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    }}
    return state;
}}

}}  // namespace identified_car
"""


@typed
def casadi_function(model: Model) -> Any:
    """Return the model as a function of CasADi.

    Returns
    -------
    casadi.Function
        ``(state, input) -> (rate, felt)``: input is (steer, force), felt is (a_x, a_y).

    Raises
    ------
    InvalidInput
        If CasADi is not installed, or the model has an effect that cannot be exported.
    """
    expect(model, Model, "casadi_function")
    try:
        import casadi
    except ImportError as error:
        raise InvalidInput(
            "CasADi is not installed; pip install 'sysid-vehicle[casadi]'"
        ) from error
    e = equations(model)
    names = [state.name for state in e.states]
    state, given = casadi.SX.sym("state", len(names)), casadi.SX.sym("input", 2)
    known: dict[str, Any] = {
        **{f: getattr(casadi, f) for f in FUNCTIONS},
        "where": casadi.if_else,
        **{name: value for name, value, _ in e.constants},
        **{name: state[k] for k, name in enumerate(names)},
        "steer": given[0],
        "force": given[1],
    }
    for line in e.lines:
        name, _, expression = line.partition(" = ")
        known[name] = eval(expression, {"__builtins__": {}}, known)
    rate = casadi.vertcat(*(known[f"{name}_rate"] for name in names))
    felt = casadi.vertcat(known["a_x"], known["a_y"])
    return casadi.Function(
        "identified_car", [state, given], [rate, felt], ["state", "input"], ["rate", "felt"]
    )
