"""Tyres are named as changed where their force is shown to differ, not by what is gained."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid_vehicle import Fit, Model, Tyre, changed, drive, identify, manoeuvres
from sysid_vehicle.diagnose.change.may_change import beyond, forces_of_tyre, of_tyre, room
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.change.search import Search
from sysid_vehicle.diagnose.changed import _later
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL
from sysid_vehicle.tyre import magic_formula


def test_forces_differ_by_the_shares_that_are_told() -> None:
    before, change = (10.0, 1.4, 1.0, 0.1), (0.0, 0.0, -0.1, 0.0)
    found = list(forces_of_tyre(before, change, 0.9))
    np.testing.assert_allclose([share for share, _ in found], -0.1)
    for _, (later, earlier) in found:
        assert later[2] == pytest.approx(1.0, rel=1e-6)  # D alone scales all forces
        assert earlier[2] == pytest.approx(-0.9, rel=1e-6)
    first, last = found[0][1][0], found[-1][1][0]
    assert first[:3] == pytest.approx(0.9 / np.array([10.0, 1.4, 0.9]), rel=1e-2)  # as B C D
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
    search = cast(Any, Search.__new__(Search))
    search.can, search.tyres, search.rules = {m.id: m}, (m,), USUAL
    search.before = SimpleNamespace(model=truth)
    search.start = SimpleNamespace(driving=driving)
    told = SimpleNamespace(std_along=lambda *_: std)
    said = cast(Any, Saying.__new__(Saying))
    said.search = search
    assert said._off_nothing(m.id, SimpleNamespace(changes=changes), told) is named


def test_errors_of_a_tyre_are_those_of_its_force(truth: Model) -> None:
    """Where the stiffness is known and B, C and D are not, and a large change bends that line."""
    log = drive(truth, manoeuvres.lap(20.0, lateral_mps2=4.0), seed=31, rate_hz=25.0)
    softer = truth.with_values({"B_rear": 0.8 * truth.value("B_rear")})
    later = drive(softer, manoeuvres.lap(20.0, lateral_mps2=4.0), seed=32, rate_hz=25.0)
    known = identify(truth, log, starts=1)
    assert known["B_rear"].std > 0.3 * known["B_rear"].value
    change = changed(known, later, candidates=("steer_ratio",))
    assert [e.id for e in change.named] == ["tyre_rear"]
    share, std = change["tyre_rear"].stiffness or (0.0, np.inf)
    assert share == pytest.approx(-0.2, abs=3.0 * std)
    assert std < 0.01


@pytest.fixture(scope="module")
def gentle(truth: Model) -> Fit:
    """Of gentle driving, which tells the stiffness of tyres and none of their coefficients."""
    usual = truth.vehicle.replace(tyre_front=Tyre(), tyre_rear=Tyre())
    log = drive(truth, manoeuvres.lap(20.0, lateral_mps2=4.0), seed=31, rate_hz=25.0)
    return identify(Model(usual), log, starts=1)


def gently_later(truth: Model, fit: Fit, rear: float) -> Saying:
    """Other such driving, with the rear tyres' B multiplied."""
    car = truth.with_values({"B_rear": rear * truth.value("B_rear")})
    log = drive(car, manoeuvres.lap(20.0, lateral_mps2=4.0), seed=32, rate_hz=25.0)
    few = ("steer_ratio",)
    return Saying(Search(fit, _later(fit, Driving.of(log), None), few, USUAL))


def test_tyres_that_did_not_change_have_errors_of_their_stiffness_too(
    truth: Model, gentle: Fit
) -> None:
    """Together with later driving they are fitted elsewhere in the valley of coefficients."""
    change = gently_later(truth, gentle, 1.0).change()
    assert change.calm
    for axle in ("front", "rear"):
        assert gentle[f"C_{axle}"].note == "not determined"
        known = gentle[f"cornering stiffness {axle}"]
        share, std = change[f"tyre_{axle}"].stiffness or (0.0, np.inf)
        assert std < 2.0 * known.std / known.value
        assert abs(share) < 3.0 * std
        assert (change[f"tyre_{axle}"].least_stiffness or np.inf) < 0.1


def test_less_grip_is_told_where_both_drivings_were_fitted(truth: Model) -> None:
    """Lines from the reference alone met it elsewhere in the valley: they dropped the friction."""
    usual = truth.vehicle.replace(tyre_front=Tyre(), tyre_rear=Tyre())
    less = truth.with_values({n: 0.8 * truth.value(n) for n in ("D_front", "D_rear")})
    course = manoeuvres.lap(20.0, lateral_mps2=4.0)
    log, later = (
        drive(car, course, seed=seed, rate_hz=25.0).without("vy_mps")
        for car, seed in ((truth, 31), (less, 32))
    )
    change = changed(identify(Model(usual), log, starts=1), later, candidates=("steer_ratio",))
    assert {e.id for e in change.named} == {"friction_both_axles", "stiffness_both_axles"}
    for e in change.named:
        assert abs(e.value[0] + 0.2) < 2.0 * e.std[0]
    assert change["stiffness_both_axles"].std[0] < 0.02


def test_what_tyres_can_be_is_asked_of_their_stiffness(truth: Model, gentle: Fit) -> None:
    """A coefficient may go far along its valley, and no line tells how far it may."""
    said = gently_later(truth, gentle, 0.7)
    assert said.state.put == ("tyre_rear",)
    B, C, D = (gentle.model.value(f"{n}_rear") for n in "BCD")
    along = {"B_rear": -0.05 * B, "C_rear": C, "D_rear": (0.7 / 0.95 / 2.0 - 1.0) * D}
    causes = said.change().causes
    m, (sizes, stds) = said.search.can["tyre_rear"], said._told_sizes([], said.state)
    stds |= dict.fromkeys(along, 1e-3)
    found = said._of(m, causes, {**sizes, **along}, stds, said.told, calm=False)
    assert found.said == "changed"
    assert found.stiffness is not None
    assert found.stiffness[0] == pytest.approx(-0.3, abs=1e-6)
    assert not said._can_be(m, (2.0, 0.01))


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
