"""A menu of few drives, for what holds of each and needs no choice among all."""

import sys

import pytest

from sysid_vehicle.diagnose.experiment.limits import menu


def asked_of_few(monkeypatch: pytest.MonkeyPatch, every: int = 4) -> None:
    """Leave of the menu of next drives one in so many, the first among them."""
    module = sys.modules["sysid_vehicle.diagnose.experiment.next_drive"]
    monkeypatch.setattr(module, "menu", lambda *args: menu(*args)[::every])
