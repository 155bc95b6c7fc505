"""What is tried in place of an effect of the model."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from sysid_vehicle import Model
from sysid_vehicle.diagnose import Candidate
from sysid_vehicle.effects import effect
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.steps import _with_others


def test_an_effect_that_was_tried_against_the_same_ones_is_not_refitted(
    start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    driving = object()
    tried: Any = SimpleNamespace(model=start.add("aero_drag"), driving=driving)
    windy: Any = SimpleNamespace(model=start.add("head_wind"), driving=driving, noise=None)
    names = {"refine": lambda *_: "refined", "without_insignificant": lambda fit, _: fit}
    for name, stand_in in names.items():
        monkeypatch.setitem(_with_others.__globals__, name, stand_in)
    drag = Candidate(
        effect("aero_drag"), 9.0, 0.0, (0.6,), (0.1,), 1.0, 1.0, fit=tried, finished=True
    )
    assert _with_others(windy, "head_wind", (drag,), USUAL) is tried
    elsewhere: Any = SimpleNamespace(model=tried.model, driving=object())
    beside: Any = SimpleNamespace(model=tried.model.add("rolling_resistance"), driving=driving)
    for other in (
        replace(drag, finished=False),
        replace(drag, fit=elsewhere),
        replace(drag, fit=beside),
    ):
        assert _with_others(windy, "head_wind", (other,), USUAL) == "refined"
