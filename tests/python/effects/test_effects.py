"""The catalogue of effects: what it says of itself, and that null values change nothing."""

import numpy as np
import pytest

from sysid_vehicle import (
    Effect,
    Fit,
    InvalidInput,
    Log,
    Model,
    _core,
    catalogue,
    effect,
    example_vehicle,
)
from sysid_vehicle.diagnose import beside_what_they_refine, considered, refining
from sysid_vehicle.effects import base_parameters
from sysid_vehicle.estimate import Driving
from sysid_vehicle.estimate.driving import MEASURED

ALL = pytest.mark.parametrize("e", catalogue(), ids=lambda e: e.id)


def test_the_catalogue_fills_the_core_vector_without_overlap() -> None:
    columns = [p.column for p in base_parameters()]
    for e in catalogue():
        columns += e.columns
    assert columns == list(range(_core.USER_OFFSET))
    assert [e.bit for e in catalogue()] == [1 << i for i in range(len(catalogue()))]
    assert len({e.id for e in catalogue()}) == len(catalogue())


@ALL
def test_an_effect_says_what_it_is(e: Effect) -> None:
    text = str(e)
    for part in (e.id, e.title, e.equation, e.source, e.excited_by, e.moves):
        assert part
        assert part in text
    assert e._repr_html_().startswith("<pre>")
    assert "<" not in e._repr_html_().removeprefix("<pre>").removesuffix("</pre>")
    for p in e.parameters:
        assert p.unit
        assert p.name in text
        assert p.lower <= p.null_value <= p.upper
        assert p.lower <= p.typical <= p.upper
        assert p.matters > 0.0
        assert p.scan or p.matters <= abs(p.typical - p.null_value)
        assert p.lower <= p.typical_low <= p.typical <= p.typical_high <= p.upper
        assert p.one_sided == (p.null_value in (p.lower, p.upper))


def test_what_moves_the_car_along_and_no_other_way() -> None:
    along = {e.id for e in catalogue() if e.along_alone}
    assert {"aero_drag", "road_grade", "mass"} < along
    assert {"steer_lag", "imu_lever_arm", "speed_sensor_lever_arm"}.isdisjoint(along)


def test_what_the_accelerometer_alone_feels() -> None:
    assert {e.id for e in catalogue() if e.felt_alone} == {
        "accelerometer_bias",
        "accelerometer_scale",
        "body_attitude",
        "imu_lever_arm",
    }


def test_twins_name_each_other_and_needs_are_channels() -> None:
    for e in catalogue():
        assert e.needs
        assert set(e.needs) <= {*MEASURED, "steer_rad", "fx_n"}
        assert ("fx_n" in e.needs) >= e.needs_force
        for twin in e.confounded_with:
            assert e.id in effect(twin).confounded_with
            assert twin in str(e)
        assert not e.through or effect(e.through).id in str(e)


def test_effects_say_what_they_break_and_what_logs_share() -> None:
    broken = {e.id: e.breaks for e in catalogue() if e.breaks}
    late = ("steer_delay", "steer_lag", "tyre_relaxation", "front_tyre_relaxation")
    expected = dict.fromkeys(late, "answers late") | {"sensor_delay": "readings late"}
    expected |= dict.fromkeys(("speed_sensor_lever_arm", "imu_lever_arm"), "readings elsewhere")
    assert broken == expected | {"road_grade": "on a slope"}
    assert all(f"breaks      laws of motion: {e.breaks}" in str(e) for e in map(effect, broken))
    shared = {e.id for e in catalogue() if e.same_in_all_logs}
    assert shared == {e.id for e in catalogue() if e.id.endswith("lever_arm")}
    assert all("the same in all logs of a car" in str(effect(e)) for e in shared)


def test_what_refines_another_is_a_candidate_beside_it_or_where_it_is_named() -> None:
    finer = {e.id for e in catalogue() if e.refines}
    assert finer == {"body_roll"} == {e.id for e in refining()}
    assert "beside body_attitude or accelerometer_scale, or where" in str(effect("body_roll"))
    model = Model(example_vehicle())
    assert not finer & {e.id for e in model.candidates}
    for refined in effect("body_roll").refines:
        beside = model.add(refined)
        assert finer <= {e.id for e in beside.candidates}
        assert beside_what_they_refine(refining(), beside) == refining()
    assert beside_what_they_refine(refining(), model.add("mass")) == ()
    # What they refine may have been dropped since.
    assert beside_what_they_refine(refining(), model.add("body_roll")) == refining()
    assert [e.id for e in considered(model, ["mass", "body_roll"])] == ["mass", "body_roll"]
    assert considered(model.add("body_roll"), ["body_roll"]) == ()
    assert considered(model, None) == model.candidates


def test_what_is_there_on_request_is_a_candidate_only_where_it_is_named() -> None:
    asked = {e.id for e in catalogue() if e.on_request}
    assert asked == {"front_roll_steer", "rear_roll_steer"}
    assert "considered  where it is named" in str(effect("rear_roll_steer"))
    model = Model(example_vehicle()).add("body_attitude", "body_roll")
    assert not asked & {e.id for e in model.candidates}
    assert {e.id for e in considered(model, [*asked, "mass"])} == asked | {"mass"}
    assert considered(model.add("rear_roll_steer"), ["rear_roll_steer"]) == ()


def test_a_scanned_parameter_is_tried_over_the_log_or_its_range() -> None:
    at = effect("friction_change").scanned
    assert at is not None
    assert at.name == "at_s"
    assert np.allclose(np.diff(at.grid(80.0)), 10.0)
    assert at.grid(80.0)[0] == 10.0
    slow = effect("tyre_temperature").scanned
    assert slow is not None
    assert slow.grid(80.0)[[0, -1]] == pytest.approx([slow.typical_low, slow.typical_high])
    assert effect("mass").scanned is None
    assert "grid of at_s" in effect("friction_change").form
    assert "step" in effect("steer_lag").form


def test_an_effect_is_found_by_name() -> None:
    assert effect("steer_lag").id == "steer_lag"
    assert effect(effect("mass")) is effect("mass")


def test_a_wrong_name_is_answered_with_near_ones() -> None:
    with pytest.raises(InvalidInput, match=r"no effect is called 'ster_lag'.*'steer_lag'"):
        effect("ster_lag")


@pytest.fixture(scope="module")
def short(lap: Log) -> Driving:
    return Driving.of(lap.between(0.0, 8.0))


@ALL
def test_null_values_change_no_bit(e: Effect, short: Driving, fit: Fit) -> None:
    model = fit.model
    noise = fit.noise.vector()
    plain = short.problem(model)
    filter_ = plain.freeze(model.vector(), noise)
    added = model.add(e)
    with_it = plain.with_model(added.core())
    # Of its own parameters a filter tells the path: both are to walk it.
    stiffer = model.with_values({"B_front": 1.01 * model.value("B_front")})
    gains = plain.freeze(stiffer.vector(), noise)
    without = plain.residuals(model.vector(), gains)
    assert np.array_equal(with_it.residuals(added.vector(), gains), without)
    assert with_it.freeze(added.vector(), noise).log_likelihood == pytest.approx(
        filter_.log_likelihood, rel=1e-9
    )


@ALL
def test_a_typical_size_is_seen(e: Effect, short: Driving, fit: Fit) -> None:
    base = fit.model
    if e.through:
        through = effect(e.through)
        base = base.add(through)
        base = base.with_values({f"{through.id}.{p.name}": p.typical for p in through.parameters})
    added = base.add(e)
    # The drive is too short for slow ones at their typical pace.
    sizes = {p.name: p.typical_low if p.scan == "range" else p.typical for p in e.parameters}
    typical = added.with_values({f"{e.id}.{name}": value for name, value in sizes.items()})
    problem = short.problem(added)
    filter_ = problem.freeze(added.vector(), fit.noise.vector())
    null = problem.residuals(added.vector(), filter_)
    moved = problem.residuals(typical.vector(), filter_) - null
    assert np.isfinite(moved).all()
    # In standard deviations of the noise, over all samples and channels.
    assert np.linalg.norm(moved) > 3.0


def test_a_model_at_typical_values_is_another_one(short: Driving, fit: Fit) -> None:
    model = fit.model.add("aero_drag")
    p = model.vector()
    motion = np.array([30.0, 0.0, 0.0])
    drag = model.with_values({"aero_drag.drag_area_m2": 0.45}).vector()
    slower = model.core().evaluate(drag, motion, 0.0, 0.0)[0, 0]
    usual = model.core().evaluate(p, motion, 0.0, 0.0)[0, 0]
    car = model.vehicle
    force = 0.5 * car.air_density_kgpm3 * 0.45 * 30.0**2
    assert usual - slower == pytest.approx(force / car.mass_kg, rel=1e-12)
    plain: Model = fit.model
    assert plain.core().evaluate(drag, motion, 0.0, 0.0)[0, 0] == usual
