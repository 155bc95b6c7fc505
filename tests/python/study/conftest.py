"""What several tests of studies share."""

from typing import Any

import pytest

from sysid_vehicle.identify import maximum


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
