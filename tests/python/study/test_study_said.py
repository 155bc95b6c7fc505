"""What a study says of driving that tells little, and of effects that act alike."""

import pytest
from contradictions import contradictions

from sysid_vehicle import Model, SysidWarning, drive, improve, manoeuvres


@pytest.mark.manual
@pytest.mark.filterwarnings("ignore:.*not excited:sysid_vehicle.SysidWarning")
@pytest.mark.filterwarnings("ignore:.*too short:sysid_vehicle.SysidWarning")
@pytest.mark.filterwarnings("ignore:.*did not converge:sysid_vehicle.SysidWarning")
def test_driving_without_corners_tests_nothing_lateral(start: Model, truth: Model) -> None:
    car = truth.add("tyre_load_sensitivity").with_values({"tyre_load_sensitivity.sensitivity": 0.2})
    straight = [
        drive(car, manoeuvres.straight_acceleration(), seed=s, rate_hz=50.0) for s in (1, 2)
    ]
    found = improve(start, *straight, starts=1)
    assert found.verdict == "not_testable"
    assert found.added == ()
    assert "drive corners" in str(found)
    assert found.verdicts["tyre_load_sensitivity"].finding == "not testable"
    assert contradictions(str(found)) == []
    dragging = truth.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.45})
    straight = [
        drive(dragging, manoeuvres.straight_acceleration(), seed=s, rate_hz=50.0) for s in (1, 2)
    ]
    found = improve(start, *straight, starts=1, candidates=["aero_drag", "steer_lag"])
    assert [a.id for a in found.added] == ["aero_drag"]
    assert found.verdict == "explained"
    assert contradictions(str(found)) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("the one-step-ahead error fell from 1.22 to 1.32", "fell from 1.22 to 1.32"),
        (
            (
                "Verdict: unknown - it is.\nFinal model: "
                "no remaining error that depends on the driving"
            ),
            "no word of what is left",
        ),
        (
            "Verdict: explained - all.\nFinal model: an error that depends on the driving remains",
            "explained, and something is left",
        ),
        (
            (
                "the effects added explain 36 % (30 to 40) of the error 1 to 5 s ahead. The "
                "effects added remove 96 % (93 to 99) of the error 1 to 5 s ahead."
            ),
            "explains 36 %",
        ),
        (
            (
                "s ahead on validation data: v_y 0.25 -> 0.15 m/s. The error: the effects added do "
                "not reduce it"
            ),
            "takes nothing off errors that fell",
        ),
        (
            (
                "  baseline              1.028             1.643\n"
                "  noise floor           1.000             1.000\n"
                "The validation error is 1.38 noise floors, and 1.05 with parameters that"
            ),
            "a validation error of 1.38, and of 1.643 in the table",
        ),
        (
            (
                "On all data together: an error that depends on the driving remains. The "
                "validation error is 1.38 noise floors, and 1.05 with parameters that serve "
                "validation data too"
            ),
            "and something else does",
        ),
    ],
)
def test_statements_that_contradict_each_other_are_seen(text: str, said: str) -> None:
    assert said in " ".join(contradictions(text))


def test_at_ten_hertz_what_cannot_be_told_apart_is_named_together(truth: Model) -> None:
    car = truth.add("tyre_load_sensitivity").with_values(
        {"tyre_load_sensitivity.sensitivity": 0.25}
    )
    alike = {"tyre_load_sensitivity", "longitudinal_load_transfer"}
    found = improve(
        truth,
        drive(car, manoeuvres.lap(), seed=1, rate_hz=10.0),
        drive(car, manoeuvres.handling_course(), seed=1001, rate_hz=10.0),
        candidates=[*sorted(alike), "steer_delay"],
        starts=1,
        sensors=False,
    )
    (added,) = found.added
    assert {added.id, *added.confounded_with} == alike
    assert all(e in str(found).splitlines()[1] for e in alike)
    (told,) = found.to_dict()["effects"]
    assert {told["id"], *told["confounded_with"]} == alike
    (rival,) = alike - {added.id}
    # The size of the rival is that of the model with it in the other's place.
    size = next(c for c in found.diagnoses[0].ranking if c.id == rival)
    assert found.verdicts[rival].value == size.value
    # On the baseline the car seems to answer late; the final model shows that it does not.
    delays = [c.delay for c in found.where.coherence]
    assert not any(d.significant for d in delays if d is not None)
    assert not any("answers" in line for _, lines in found.where_lines for line in lines)


def test_an_error_that_tests_do_not_see_has_a_reason(start: Model) -> None:
    """The tests ask whether any parameters serve all data; the table has those of training data."""
    car = start.vehicle
    assert car.drive_front_share < 0.5
    wrong = Model(car.replace(drive_front_share=1.0))
    with pytest.warns(SysidWarning, match="mistake in the vehicle file"):
        found = improve(
            wrong,
            drive(Model(car), manoeuvres.constant_radius(), seed=77320, rate_hz=50.0),
            drive(Model(car), manoeuvres.handling_course(), seed=77321, rate_hz=50.0),
            candidates=["force_split"],
            starts=1,
            sensors=False,
        )
    assert found.test[-1].error > 1.2
    said = found.in_the_end
    assert "no remaining error that depends on the driving is shown" in said
    assert f"The validation error is {found.test[-1].error:.3g} noise floors, and 1.0" in said
    assert contradictions(str(found)) == []
