"""What is known of the car stands in the model with values that are fixed, and is no finding."""

import pytest

import sysid_vehicle as sv
from sysid_vehicle.diagnose.candidates.constancy import constancy
from sysid_vehicle.study.search.steps import insignificant

KNOWN = {"aero_downforce.cl_a_front_m2": 0.5, "aero_downforce.cl_a_rear_m2": 0.8}
FRONT, REAR = KNOWN


@pytest.fixture(scope="module")
def start() -> sv.Model:
    return sv.Model(sv.example_vehicle()).add("aero_downforce")


@pytest.fixture(scope="module")
def logs(start: sv.Model) -> tuple[sv.Log, sv.Log]:
    hidden = {"steer_compliance.compliance_radpn": 1.5e-6}
    truth = start.add("steer_compliance").with_values({**KNOWN, **hidden})
    lap = sv.drive(truth, sv.manoeuvres.lap(40.0), seed=71, rate_hz=25.0)
    course = sv.manoeuvres.handling_course(40.0)
    return lap, sv.drive(truth, course, seed=72, rate_hz=25.0)


@pytest.fixture(scope="module")
def study(start: sv.Model, logs: tuple[sv.Log, sv.Log]) -> sv.Study:
    return sv.improve(start.with_fixed(KNOWN), *logs, starts=1, sensors=False)


def test_a_study_keeps_it_and_names_what_is_hidden(study: sv.Study) -> None:
    assert [a.id for a in study.added] == ["steer_compliance"]
    assert study.verdict == "explained"
    assert {n: study.model.value(n) for n in KNOWN} == KNOWN
    assert "aero_downforce" not in {v.effect.id for v in study.verdicts.all}


def test_what_asks_the_driving_leaves_it_out(start: sv.Model, logs: tuple[sv.Log, sv.Log]) -> None:
    fit = sv.identify(start.with_fixed(KNOWN), logs[0], starts=1)
    assert not fit.model.sought
    assert insignificant(fit) == set()
    assert constancy(fit) == {}
    assert "aero_downforce" not in {v.effect.id for v in sv.verdicts(sv.diagnose(fit)).all}


def test_of_an_effect_known_in_part_the_rest_is_sought(
    start: sv.Model, logs: tuple[sv.Log, sv.Log]
) -> None:
    fit = sv.identify(start.with_fixed({FRONT: KNOWN[FRONT]}), logs[0], starts=1)
    (sought,) = fit.model.sought
    assert [*sought.named] == [REAR]
    assert [*constancy(fit)] == ["aero_downforce"]
    assert insignificant(fit) <= {"aero_downforce"}
    whole = start.sought
    assert whole == start.parts
