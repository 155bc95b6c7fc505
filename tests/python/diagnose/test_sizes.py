"""Sizes of candidates in words."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from sysid_vehicle import effect
from sysid_vehicle.diagnose.candidates.candidate import Candidate


@pytest.mark.parametrize(
    ("name", "said"),
    [("combined_slip", "ellipse 0.4 +- 0.02"), ("steer_lag", "time_constant_s 0.4 +- 0.02 s")],
)
def test_a_pure_number_has_no_unit(name: str, said: str) -> None:
    told = SimpleNamespace(effect=effect(name), value=(0.4,), std=(0.02,))
    assert cast(Any, Candidate.size).fget(told) == said
