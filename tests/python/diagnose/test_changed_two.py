"""Two changes at once: what imitates both is likelier than either, and is not what changed."""

import numpy as np
import pytest
from changed_drives import later

from sysid_vehicle import Change, Fit, Log, Model, SensorNoise, changed, drive, identify, manoeuvres
from sysid_vehicle.diagnose.change.both_axles import FRICTION, STIFFNESS
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.change.search import Search
from sysid_vehicle.diagnose.changed import _later
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL

LAP, COURSE = manoeuvres.lap(12.0), manoeuvres.handling_course(10.0, lateral_mps2=7.5)


def driven(car: Model, course: manoeuvres.Manoeuvre, seed: int, rate_hz: float = 25.0) -> Log:
    """Short driving by quiet sensors, that tells as much as longer driving by usual ones."""
    quiet = SensorNoise().scaled(0.7)
    return drive(car, course, seed=seed, rate_hz=rate_hz, noise=quiet)


@pytest.fixture(scope="module")
def short(start: Model, truth: Model) -> Fit:
    return identify(start, driven(truth, LAP, 1), starts=1)


def told(
    before: Fit,
    truth: Model,
    values: dict[str, float],
    candidates: tuple[str, ...],
    rate_hz: float = 25.0,
) -> Change:
    effects = {n.split(".")[0] for n in values if "." in n}
    car = truth.add(*sorted(effects - {*truth.effects})).with_values(values)
    return changed(before, driven(car, COURSE, 42, rate_hz), candidates=candidates)


def softer(truth: Model, letter: str, front: float, rear: float) -> dict[str, float]:
    by = {f"{letter}_front": front, f"{letter}_rear": rear}
    return {n: f * truth.value(n) for n, f in by.items()}


def test_drag_and_mass_are_no_force_gain(before: Fit, truth: Model) -> None:
    values = {"aero_drag.drag_area_m2": 0.3, "mass.relative_error": 0.13}
    few = ("mass", "aero_drag", "force_gain", "wheel_inertia", "rolling_resistance")
    change = changed(before, later(truth, **values), candidates=few)
    assert {e.id for e in change.named} == {"mass", "aero_drag"}
    assert all(e.group == () for e in change.named)
    for name, size in values.items():
        found = change[name.split(".")[0]]
        assert abs(found.value[0] - size) < 3.0 * found.std[0]


def test_less_grip_and_more_mass_are_no_tyres_of_each_axle(before: Fit, truth: Model) -> None:
    values = softer(truth, "D", 0.82, 0.82) | {"mass.relative_error": 0.09}
    few = ("mass", "force_gain", "lateral_load_transfer", "wheel_inertia", "aero_downforce")
    change = changed(before, later(truth, **values), candidates=few)
    assert {e.id for e in change.named} == {FRICTION, STIFFNESS, "mass"}
    assert change[FRICTION].value[0] == pytest.approx(-0.18, abs=0.01)
    assert change[STIFFNESS].value[0] == pytest.approx(-0.18, abs=0.01)
    assert change["mass"].value[0] == pytest.approx(0.09, abs=0.005)


def test_tyres_of_each_axle_are_both_and_one_of_them(before: Fit, truth: Model) -> None:
    """The same car by other names: none is named with certainty, and the headline has both."""
    worn = later(truth, **softer(truth, "B", 0.85, 0.76))
    change = changed(before, worn, candidates=("steer_ratio",))
    named = {e.id: e for e in change.named}
    assert {"tyre_front", "tyre_rear"} <= {*named, *(g for e in named.values() for g in e.group)}
    assert all(e.group for e in named.values())
    axles = [e for e in ("tyre_front", "tyre_rear", STIFFNESS) if f"{e}:" in str(change)]
    assert len(axles) == 2
    assert "confounded with" in str(change).split("\n", maxsplit=1)[0]
    # Each is as large as it is beside the others of the headline.
    sizes = {e: (change[e].stiffness or change[e].value)[0] for e in axles}
    for axle, factor in (("front", 0.85), ("rear", 0.76)):
        own = 1.0 + sizes.get(f"tyre_{axle}", 0.0)
        assert own * (1.0 + sizes.get(STIFFNESS, 0.0)) == pytest.approx(factor, abs=0.02)


def test_what_is_beside_its_rival_is_as_large_as_in_its_place(short: Fit, truth: Model) -> None:
    """Beside the other tyres that are put in it would be nothing."""
    car = truth.with_values(softer(truth, "B", 0.85, 0.76))
    after = Driving.of(driven(car, COURSE, 42))
    said = Saying(Search(short, _later(short, after, None), ("mass",), USUAL))
    change = said.change()
    (axle,) = {e.id for e in change.named if e.id.startswith("tyre_")} - {*said.state.put}
    share, std = change[axle].stiffness or (0.0, np.inf)
    state, _ = said._places[axle]
    assert axle in state.put
    model, reference = state.searched, short.model
    names = [f"{letter}_{axle.removeprefix('tyre_')}" for letter in "BCD"]
    fitted = np.prod([model.value(n) for n in names]) / np.prod([reference.value(n) for n in names])
    assert share == pytest.approx(fitted - 1.0, abs=0.02)
    assert abs(share) > 3.0 * std


def test_a_change_that_no_effect_explains_is_told_where_it_acts(start: Model, truth: Model) -> None:
    """A drag that may not have changed, beside a steering that was set otherwise: along the car."""
    # Half as many samples do not tell a force from a speed that drifts.
    before = identify(start, driven(truth, LAP, 1, 50.0), starts=1)
    values = {"aero_drag.drag_area_m2": 0.6, "steer_offset.offset_rad": 0.006}
    change = told(before, truth, values, ("steer_offset",), 50.0)
    # No tyres, which gained thousands of nats by what the drag does.
    assert [e.id for e in change.named] == ["steer_offset"]
    offset = change["steer_offset"]
    assert abs(offset.value[0] - 0.006) < 3.0 * offset.std[0]
    assert [s.effects for s in change.unknown] == [("unknown F_x",)]


def test_what_no_effect_explains_is_told_beside_what_acts_like_it(short: Fit, truth: Model) -> None:
    """A yaw moment has shapes that are like any effect: it is told where it is there beside it."""
    values = {"side_wind.yaw_moment_nm": 300.0, "mass.relative_error": 0.1}
    change = told(short, truth, values, ("mass", "steer_ratio"))
    assert [e.id for e in change.named] == ["mass"]
    assert change["mass"].value[0] == pytest.approx(0.1, abs=3.0 * change["mass"].std[0])
    assert [s.effects for s in change.unknown] == [("unknown M_z",)]
