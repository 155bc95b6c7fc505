"""Tyres are named as changed where their force is shown to differ, not by what is gained."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid_vehicle import Model
from sysid_vehicle.diagnose.change.changed import _Said
from sysid_vehicle.diagnose.change.may_change import beyond, forces_of_tyre, of_tyre, room
from sysid_vehicle.rules import USUAL
from sysid_vehicle.tyre import magic_formula


def test_forces_differ_by_the_shares_that_are_told() -> None:
    before, change = (10.0, 1.4, 1.0, 0.1), (0.0, 0.0, -0.1, 0.0)
    found = list(forces_of_tyre(before, change, 0.9))
    np.testing.assert_allclose([share for share, _ in found], -0.1)
    for _, slope in found:
        assert slope[2] == pytest.approx(1.0, rel=1e-6)  # D alone scales all forces
    first, last = found[0][1], found[-1][1]
    np.testing.assert_allclose(first[:3], 1.0 / np.array(before[:3]), rtol=1e-2)  # as B C D
    assert abs(last[0]) < 0.5 * first[0]  # at much slip stiffness says less
    slips = np.linspace(0.0, 0.3, 3000)
    driven = slips[np.argmax(magic_formula(slips, *before) >= 0.9)]
    assert magic_formula(driven, *before) == pytest.approx(0.9, rel=0.01)


@pytest.mark.parametrize(("std", "named"), [(0.02, True), (0.06, False), (np.inf, False)])
def test_an_interval_that_holds_nothing_names_no_tyre(
    truth: Model, std: float, named: bool
) -> None:
    m = of_tyre(truth, "rear")
    changes = dict(zip(m.names, (0.0, 0.0, -0.1 * truth.value("D_rear"), 0.0), strict=True))
    driving = SimpleNamespace(channel=lambda _: np.linspace(-8.0, 8.0, 100))
    search = SimpleNamespace(
        can={m.id: m},
        tyres=(m,),
        before=SimpleNamespace(model=truth),
        start=SimpleNamespace(driving=driving),
        rules=USUAL,
    )
    told = SimpleNamespace(std_along=lambda *_: std)
    said = cast(Any, _Said.__new__(_Said))
    said.search = search
    assert said._off_nothing(m.id, SimpleNamespace(changes=changes), told) is named


def test_no_line_is_followed_beyond_what_a_tyre_can_be(truth: Model) -> None:
    ends = room(of_tyre(truth, "front"), truth)
    p = truth.parameters["D_front"]
    value = truth.value("D_front")
    assert ends[2] == pytest.approx((p.lower - value, p.upper - value))
    inside = (1.0, 0.1, -0.2, 0.0)
    assert beyond(inside, (0.0,) * 4, ends) == 0.0
    # All of a tyre is cut together: its stiffness follows from all of it.
    far = (1.0, 0.1, 10.0 * ends[2][0], 0.0)
    assert beyond(far, (0.0,) * 4, ends) == pytest.approx(0.9)
    assert beyond(far, (0.0, 0.0, -9.0 * ends[2][0], 0.0), ends) == pytest.approx(0.0)
