"""What each log has of its own, in a model that is exported."""

import warnings
from pathlib import Path

import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning


@pytest.mark.parametrize("name", ["car.py", "car.hpp"])
def test_what_is_of_the_logs_is_told(tmp_path: Path, truth: sv.Model, name: str) -> None:
    """A bank of the road and a zero of the steering went into the car without a word."""
    model = truth.with_nuisances()
    with pytest.warns(SysidWarning, match=r"steer_offset, road_bank: what each log has of its own"):
        sv.export(model, tmp_path / name)
    assert "road_bank" in (tmp_path / name).read_text()
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        sv.export(model.drop("steer_offset", "road_bank"), tmp_path / name)
        sv.export(truth.add("road_bank"), tmp_path / name)  # a finding
    assert "road_bank" in (tmp_path / name).read_text()
