"""Two changes at once: what imitates both is likelier than either, and is not what changed."""

import pytest

from sysid_vehicle import Change, Fit, Model, changed, drive, manoeuvres
from sysid_vehicle.diagnose.change.both_axles import FRICTION, STIFFNESS


def told(
    before: Fit, truth: Model, values: dict[str, float], candidates: tuple[str, ...]
) -> Change:
    effects = {n.split(".")[0] for n in values if "." in n}
    car = truth.add(*sorted(effects - {*truth.effects})).with_values(values)
    course = manoeuvres.handling_course(15.0, lateral_mps2=7.5)
    return changed(before, drive(car, course, seed=42, rate_hz=50.0), candidates=candidates)


def softer(truth: Model, letter: str, front: float, rear: float) -> dict[str, float]:
    by = {f"{letter}_front": front, f"{letter}_rear": rear}
    return {n: f * truth.value(n) for n, f in by.items()}


def test_drag_and_mass_are_no_force_gain(before: Fit, truth: Model) -> None:
    values = {"aero_drag.drag_area_m2": 0.3, "mass.relative_error": 0.13}
    few = ("mass", "aero_drag", "force_gain", "wheel_inertia", "rolling_resistance")
    change = told(before, truth, values, few)
    assert {e.id for e in change.named} == {"mass", "aero_drag"}
    assert all(e.group == () for e in change.named)
    for name, size in values.items():
        found = change[name.split(".")[0]]
        assert abs(found.value[0] - size) < 3.0 * found.std[0]


def test_less_grip_and_more_mass_are_no_tyres_of_each_axle(before: Fit, truth: Model) -> None:
    values = softer(truth, "D", 0.82, 0.82) | {"mass.relative_error": 0.09}
    few = ("mass", "force_gain", "lateral_load_transfer", "wheel_inertia", "aero_downforce")
    change = told(before, truth, values, few)
    assert {e.id for e in change.named} == {FRICTION, STIFFNESS, "mass"}
    assert change[FRICTION].value[0] == pytest.approx(-0.18, abs=0.01)
    assert change[STIFFNESS].value[0] == pytest.approx(-0.18, abs=0.01)
    assert change["mass"].value[0] == pytest.approx(0.09, abs=0.005)


def test_tyres_of_each_axle_are_both_and_one_of_them(before: Fit, truth: Model) -> None:
    """The same car by other names: none is named with certainty, and the headline has both."""
    change = told(before, truth, softer(truth, "B", 0.85, 0.76), ("steer_ratio",))
    named = {e.id: e for e in change.named}
    assert {"tyre_front", "tyre_rear"} <= {*named, *(g for e in named.values() for g in e.group)}
    assert all(e.group for e in named.values())
    axles = [e for e in ("tyre_front", "tyre_rear", STIFFNESS) if f"{e}:" in str(change)]
    assert len(axles) == 2
    assert "confounded with" in str(change).split("\n", maxsplit=1)[0]
