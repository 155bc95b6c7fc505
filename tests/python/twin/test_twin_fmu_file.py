"""What a file of a Functional Mock-up Unit is refused for."""

import sys

import pytest

from sysid_vehicle import InvalidInput
from sysid_vehicle.twin.fmu_file import read_description


def test_without_fmpy_no_file_is_blamed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(InvalidInput, match=r"^a twin from an FMU needs FMPy: pip install"):
        read_description("car.fmu")
