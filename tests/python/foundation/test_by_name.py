"""What is asked by names cannot be asked by numbers, as iteration would."""

import importlib
import inspect
import pkgutil
from typing import get_type_hints

import pytest

import sysid_vehicle


def _asked_by_name() -> list[type]:
    found = {}
    for info in pkgutil.walk_packages(sysid_vehicle.__path__, "sysid_vehicle."):
        if "._core" in info.name or info.name.endswith("__main__"):
            continue
        for cls in vars(importlib.import_module(info.name)).values():
            if inspect.isclass(cls) and cls.__module__ == info.name and "__getitem__" in vars(cls):
                hints = get_type_hints(vars(cls)["__getitem__"], include_extras=False)
                keys = [hint for name, hint in hints.items() if name != "return"]
                if keys == [str]:
                    found[f"{cls.__module__}.{cls.__name__}"] = cls
    return [found[name] for name in sorted(found)]


@pytest.mark.parametrize("cls", _asked_by_name(), ids=lambda c: c.__name__)
def test_iteration_goes_over_names_or_is_refused(cls: type) -> None:
    """Python would ask for 0, 1, 2 otherwise, and `name in it` would end in a KeyError of '0'."""
    assert "__iter__" in {name for base in cls.__mro__ for name in vars(base)}


def test_results_are_among_them() -> None:
    assert {"Estimated", "RunsFit", "Posterior", "Change"} <= {c.__name__ for c in _asked_by_name()}
