"""What several tests of studies share."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import maximum
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.search.search import Search


@pytest.fixture
def settled_on(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many samples each search had that settled, in order."""
    asked: list[int] = []
    settle = maximum.settle

    def counted(objective: Any, *args: Any, **kwargs: Any) -> Any:
        asked.append(objective.samples)
        return settle(objective, *args, **kwargs)

    monkeypatch.setattr(maximum, "settle", counted)
    return asked


@pytest.fixture(scope="session")
def searching() -> Callable[..., Search]:
    """Make a search that judges by some driving, without any limit of time, and says nothing."""

    def make(test: Driving, **settings: Any) -> Search:
        usual = {
            "candidates": (),
            "most_effects": 4,
            "ends": np.inf,
            "rules": USUAL,
            "seed": 0,
            "progress": False,
            "say": lambda _: None,
        }
        return Search(test, **{**usual, **settings})

    return make
