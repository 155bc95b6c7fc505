"""What tests of changes share."""

import pytest
from changed_drives import FEW, later

from sysid_vehicle import Change, Fit, Model, changed, drive, identify, manoeuvres


@pytest.fixture(scope="module")
def before(start: Model, truth: Model) -> Fit:
    """A reference of half a lap: searches take as long as the driving."""
    return identify(start, drive(truth, manoeuvres.lap(20.0), seed=1, rate_hz=50.0), starts=1)


@pytest.fixture(scope="module")
def offset(truth: Model, before: Fit) -> Change:
    return changed(before, later(truth, steer_offset__offset_rad=0.006), candidates=FEW)
