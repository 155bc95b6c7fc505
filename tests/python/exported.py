"""Models as they are exported, for the tests of what is written of them."""

from typing import Any

import sysid_vehicle as sv
from sysid_vehicle.export import python_text


def typical(model: sv.Model, *effects: str) -> sv.Model:
    """The model with effects at their typical sizes."""
    new = model.add(*effects)
    sizes = {f"{e}.{p.name}": p.typical for e in effects for p in sv.effect(e).parameters}
    return new.with_values(sizes)


def module_of(model: sv.Model) -> dict[str, Any]:
    """What the exported module of Python defines."""
    space: dict[str, Any] = {}
    exec(compile(python_text(model), "exported", "exec"), space)
    return space
