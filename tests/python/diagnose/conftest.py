"""What tests of changes share."""

import pytest
from changed_drives import FEW, later

from sysid_vehicle import Change, Fit, Model, changed, drive, identify, manoeuvres


@pytest.fixture(scope="module")
def before(request: pytest.FixtureRequest, start: Model, truth: Model) -> Fit:
    """A reference of half a lap, at `RATE_HZ` of the file: searches take as long as the samples."""
    rate_hz = getattr(request.module, "RATE_HZ", 25.0)
    return identify(start, drive(truth, manoeuvres.lap(20.0), seed=1, rate_hz=rate_hz), starts=1)


@pytest.fixture(scope="module")
def offset(truth: Model, before: Fit) -> Change:
    return changed(before, later(truth, steer_offset__offset_rad=0.006), candidates=FEW)
