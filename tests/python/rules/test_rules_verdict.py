"""The verdict on the whole, and the names that stand beside what is left."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.rules import (
    UNKNOWN,
    USUAL,
    Added,
    Facts,
    Share,
    grade,
    incomplete,
    little,
    low_of_mean,
    share_explained,
    something_left,
    unforeseen,
    verdict,
)


def of(p_value: float, statistic: float = 99.0, target: str = "M_z") -> Omnibus:
    return Omnibus(statistic, 9, p_value, target)


NONE = of(0.5, 5.0)
BEFORE = of(1e-60, 909.0)
MOST, SOME, NONE_OF_IT = Share(0.6, 0.5, 0.7), Share(0.2, 0.1, 0.3), Share(0.01, -0.1, 0.1)
MASS = Added("mass", "missing", (), frozenset({"yaw_rate_radps"}), MOST, MOST)
DRAG = Added("aero_drag", "missing", (), frozenset({"vx_mps"}), SOME, SOME)
WHOLE = Facts(NONE, NONE, missing=(8.0, 0.0), added=(MASS,))


def test_what_is_left_on_all_data_takes_more_evidence() -> None:
    assert not something_left(WHOLE)
    assert not something_left(replace(WHOLE, together=of(0.002)))
    assert something_left(replace(WHOLE, together=of(5e-4)))
    assert something_left(replace(WHOLE, fitted=of(0.005)))
    assert something_left(replace(WHOLE, candidate=0.005))
    # One effect more takes more evidence than the first one.
    assert not something_left(replace(WHOLE, candidate=0.03))
    assert something_left(replace(WHOLE, candidate=0.03, together=None, added=()))


def test_of_lesser_evidence_the_ceiling_has_the_last_word() -> None:
    """What no function of the driving predicts on any data is disturbance."""
    silent = replace(WHOLE, structure=0.02)
    for evidence in ({"fitted": of(0.005)}, {"candidate": 0.005}):
        assert something_left(replace(WHOLE, **evidence))
        assert not something_left(replace(silent, **evidence))
        alone = replace(silent, added=(), together=None, **evidence)
        assert verdict(alone).verdict == "adequate"
        assert verdict(replace(alone, structure=0.2)).verdict == "unknown"
    # It does not speak against evidence beyond doubt.
    for evidence in ({"fitted": of(5e-4)}, {"candidate": 5e-4}, {"together": of(5e-4)}):
        assert something_left(replace(silent, **evidence))
    # A driver who answers disturbances makes the driving tell of them: alone it is no evidence.
    shown = replace(WHOLE, structure=0.5)
    assert not something_left(shown)
    assert verdict(replace(shown, added=(), together=None)).verdict == "adequate"


def test_verdicts_where_nothing_was_added() -> None:
    facts = Facts(NONE)
    assert verdict(facts).verdict == "adequate"
    left = replace(facts, candidate=0.01)
    assert verdict(left).verdict == "unknown"
    assert verdict(replace(left, small=True)).verdict == "adequate"
    assert verdict(replace(facts, excited=False)).verdict == "not_testable"
    assert verdict(replace(facts, fitted=BEFORE, excited=False)).verdict == "unknown"
    said = verdict(replace(WHOLE, contradictions=("ay_mps2: turned round",)))
    assert said.verdict == "unknown"
    assert said.withdrawn[0].effects == {"mass"}
    assert said.withdrawn[0].because == "ay_mps2: turned round"


def test_a_baseline_is_not_adequate_by_the_training_data_alone() -> None:
    facts = Facts(NONE, NONE)
    assert verdict(facts).verdict == "adequate"
    for shown in ({"together": of(5e-4)}, {"unforeseen": True}, {"slow": ("moment of 90 N m",)}):
        assert verdict(replace(facts, **shown)).verdict == "unknown"
        assert verdict(replace(facts, small=True, **shown)).verdict == "adequate"
        # Tyres that never met a slip angle leave chance evidence, and foretell nothing.
        assert verdict(replace(facts, excited=False, **shown)).verdict == "not_testable"
    # Lesser evidence may be a disturbance.
    assert verdict(replace(facts, together=of(0.005))).verdict == "adequate"
    # Validation data may ask for tyres that no effect stands for: names stand by their own shares.
    assert verdict(replace(WHOLE, unforeseen=True)).verdict == "explained"


def test_validation_data_err_by_more_than_is_foretold_beyond_doubt_and_by_a_share() -> None:
    assert unforeseen(1.2, 1e-4)
    assert not unforeseen(1.2, 0.01)
    assert not unforeseen(1.1, 1e-9)  # long driving shows what is not worth a word
    assert unforeseen(np.inf, 0.0)
    assert not unforeseen(0.5, 1.0)


def test_a_baseline_with_small_errors_is_adequate_where_no_name_stands() -> None:
    proxy = replace(DRAG, finding="proxy")
    for alone in (
        replace(WHOLE, added=(proxy,)),
        replace(LEFT, added=(replace(MASS, own=UNKNOWN),)),
    ):
        assert verdict(alone).verdict == "unknown"
        small = verdict(replace(alone, small=True))
        assert small.verdict == "adequate"
        assert small.withdrawn == verdict(alone).withdrawn
    # What stands explains more than small errors do, and channels that contradict nothing.
    assert verdict(replace(WHOLE, small=True)).verdict == "explained"
    assert verdict(replace(LEFT, small=True)).verdict == "partly_explained"
    wrong = replace(WHOLE, added=(proxy,), contradictions=("ay_mps2: turned round",), small=True)
    assert verdict(wrong).verdict == "unknown"


def withdrawn(facts: Facts) -> dict[str, str]:
    return {e: w.because for w in verdict(facts).withdrawn for e in w.effects}


def test_verdicts_where_nothing_is_left() -> None:
    assert verdict(WHOLE).verdict == "explained"
    assert withdrawn(WHOLE) == {}
    proxy = replace(DRAG, finding="proxy")
    assert verdict(replace(WHOLE, added=(MASS, proxy))).verdict == "partly_explained"
    assert verdict(replace(WHOLE, added=(proxy,))).verdict == "unknown"
    # What cannot be told from a proxy is no better.
    rival = replace(MASS, finding="one of a group", group=("aero_drag",))
    assert verdict(replace(WHOLE, added=(rival, proxy))).verdict == "unknown"
    negligible = replace(MASS, finding="negligible")
    assert verdict(replace(WHOLE, added=(negligible,))).verdict == "explained"
    # Where nothing is missing no share is asked for, where a stand-in tells of something it is.
    small = replace(MASS, own=NONE_OF_IT)
    assert verdict(replace(WHOLE, added=(small,))).verdict == "explained"
    assert not incomplete(replace(WHOLE, added=(small,)))
    assert incomplete(replace(WHOLE, added=(small, proxy)))
    assert verdict(replace(WHOLE, added=(small, proxy))).verdict == "unknown"


LEFT = replace(WHOLE, fitted=of(1e-9, 209.0), missing=(8.0, 0.44), added=(MASS, DRAG))


def test_names_beside_something_that_is_left() -> None:
    assert verdict(LEFT).verdict == "partly_explained"
    assert not verdict(LEFT).much_left
    assert withdrawn(LEFT) == {}
    little = replace(LEFT, added=(MASS, replace(DRAG, own=NONE_OF_IT)))
    assert set(withdrawn(little)) == {"aero_drag"}
    assert "share of the error 1 to 5 s ahead is not significant" in withdrawn(little)["aero_drag"]
    assert verdict(little).verdict == "partly_explained"
    assert verdict(little).much_left  # a part of what is gone went with what does not stand
    only = replace(LEFT, added=(replace(MASS, finding="negligible"),))
    assert verdict(only).verdict == "unknown"


def test_no_name_stands_where_all_together_may_take_nothing() -> None:
    """A share whose interval reaches nothing is no part of what is explained."""
    facts = replace(LEFT, taken_low=0.0)
    assert verdict(facts).verdict == "unknown"
    assert set(withdrawn(facts)) == {"mass", "aero_drag"}
    assert "their share includes zero" in withdrawn(facts)["mass"]
    assert verdict(replace(LEFT, taken_low=0.05)).verdict == "partly_explained"
    # Where nothing is left no share is asked for.
    assert verdict(replace(WHOLE, taken_low=-0.1)).verdict == "explained"


def test_below_the_noise_of_the_sensors_the_likelihood_of_validation_data_decides() -> None:
    """Something is left on all data together, which training data do not show."""
    left = replace(LEFT, fitted=of(0.02), together=of(1e-9))
    unseen = replace(left, taken_low=-0.1, added=(replace(MASS, own=UNKNOWN, sure=True),))
    assert verdict(unseen).verdict == "unknown"
    low = replace(unseen, buried=True)
    assert verdict(low).verdict == "partly_explained"
    assert withdrawn(low) == {}
    # Shares that are shown all the same count as ever.
    both = replace(low, added=(*low.added, DRAG, replace(DRAG, id="head_wind", own=UNKNOWN)))
    assert set(withdrawn(both)) == {"aero_drag", "head_wind"}
    assert set(withdrawn(replace(both, taken_low=0.05))) == {"head_wind"}
    # What has rivals, is no finding, or is not sure has no name there.
    for wrong in ({"sure": False}, {"finding": "one of a group"}, {"finding": "negligible"}):
        alone = replace(low, added=(replace(low.added[0], **wrong),))
        assert verdict(alone).verdict == "unknown"
    # A stand-in beside it shows that what is missing is something else.
    beside = replace(low, added=(low.added[0], replace(DRAG, finding="proxy", sure=True)))
    assert verdict(beside).verdict == "unknown"
    # So do training data that show more beyond doubt.
    for shown in ({"fitted": of(5e-4)}, {"candidate": 5e-4}):
        assert verdict(replace(low, **shown)).verdict == "unknown"


def test_a_share_for_which_there_was_no_time_is_said_to_be_unknown() -> None:
    """It keeps no name, and is not said to have been looked for in vain."""
    shares = {a.id: (a.own, a.own_in_training) for a in LEFT.added if a is MASS}
    facts = LEFT.with_own(shares, late=["aero_drag"])
    assert [a.late for a in facts.added] == [False, True]
    assert set(withdrawn(facts)) == {"aero_drag"}
    assert "the time limit left open" in withdrawn(facts)["aero_drag"]
    neither = LEFT.with_own({}, late=["aero_drag"])
    assert "is not significant" in withdrawn(neither)["mass"]
    assert verdict(neither).verdict == "unknown"


def test_what_competed_with_nothing_unknown_in_time_has_no_sure_name() -> None:
    assert verdict(WHOLE).verdict == "explained"
    late = replace(WHOLE, together=None, unopposed=True)
    assert verdict(late).verdict == "unknown"
    assert "an unknown force would explain" in withdrawn(late)["mass"]


def test_beside_much_that_is_left_a_share_is_shown_to_be_worth_a_name() -> None:
    """A car whose tyres are of another form leaves much beside the right effect, too."""
    much = replace(LEFT, missing=(8.0, 5.0), added=(MASS,))
    assert withdrawn(much) == {}
    assert verdict(much).verdict == "partly_explained"
    assert verdict(much).much_left
    little = Share(0.2, 0.02, 0.4)
    unsure = replace(MASS, own=little, own_in_training=little)
    assert withdrawn(replace(LEFT, added=(unsure,))) == {}
    assert set(withdrawn(replace(much, added=(unsure,)))) == {"mass"}
    assert verdict(replace(much, added=(unsure,))).verdict == "unknown"
    # All data show it together; neither may show none.
    for where in ("own", "own_in_training"):
        assert withdrawn(replace(much, added=(replace(unsure, **{where: MOST}),))) == {}
        none = replace(unsure, **{where: Share(0.2, -0.02, 0.4)})
        assert set(withdrawn(replace(much, added=(none,)))) == {"mass"}


def test_what_is_left_of_one_motion_spoils_no_name_of_the_other() -> None:
    unsure = replace(DRAG, own=Share(0.2, 0.02, 0.4), own_in_training=Share(0.2, 0.02, 0.4))
    much = replace(LEFT, missing=(8.0, 5.0), added=(unsure,))
    assert set(withdrawn(much)) == {"aero_drag"}
    told = much.with_motions({"aero_drag": ((2.0, 0.1), 0.9)})
    assert withdrawn(told) == {}
    assert verdict(told).verdict == "partly_explained"
    assert verdict(told).much_left
    assert withdrawn(much.with_motions({"aero_drag": ((2.0, 1.0), 0.4)})) == withdrawn(much)
    # Nor does what all take together.
    nothing = replace(LEFT, taken_low=-0.1).with_motions({"aero_drag": ((2.0, 0.1), 0.9)})
    assert set(withdrawn(nothing)) == {"mass"}
    one = LEFT.with_motions({"aero_drag": ((2.0, 2.1), -0.2), "mass": ((2.0, 0.1), 0.9)})
    assert set(withdrawn(one)) == {"aero_drag"}
    assert "their share includes zero" in withdrawn(one)["aero_drag"]


@pytest.mark.parametrize(
    "wrong",
    [
        Share(0.09, 0.05, 0.13),  # a tenth is as little as is worth a name
        Share(0.3, -0.01, 0.5),  # it may be chance
        Share(-0.3, -0.5, -0.1),
        Share(float("nan"), float("nan"), float("nan")),  # it was not asked, or a model fails
    ],
)
@pytest.mark.parametrize("where", ["own", "own_in_training"])
def test_a_name_needs_a_share_of_its_own_on_all_data(wrong: Share, where: str) -> None:
    facts = replace(LEFT, added=(replace(MASS, **{where: wrong}),))
    assert set(withdrawn(facts)) == {"mass"}
    assert verdict(facts).verdict == "unknown"
    assert not verdict(facts).much_left


def test_the_share_that_is_worth_a_name_is_a_limit() -> None:
    facts = replace(LEFT, added=(DRAG,))
    assert withdrawn(facts) == {}
    strict = replace(USUAL, most=0.7)  # a share of 0.3
    assert {e for w in verdict(facts, strict).withdrawn for e in w.effects} == {"aero_drag"}


def test_grades_of_names() -> None:
    assert grade("missing", "missing") == "confirmed"
    assert grade("missing", "proxy") == "plausible"  # beside much that is left
    assert grade("one of a group", "one of a group") == "plausible"
    assert grade("negligible", "negligible") == "plausible"
    assert grade("proxy", "proxy") == "alias"
    assert grade("missing", "missing", much_left=True) == "plausible"
    assert grade("missing", "missing", takes_little=True) == "plausible"


def test_what_takes_little_of_the_fall_in_error_is_no_confirmed_name() -> None:
    assert not little(2.0, 2.0, 1.0, 1.0)  # the only one
    assert little(2.0, 1.1, 1.0, 1.0)  # 0.21 of 3
    assert not little(2.0, 1.2, 1.0, 1.0)
    assert not little(10.6, 2.7, 1.0, 1.0)  # a twentieth of the fall, but most of what was left
    assert little(10.6, 1.05, 1.0, 1.0)
    assert little(2.0, 1.0, 1.1, 1.1)
    assert not little(1.0, 1.0, 1.0, 1.0)  # nothing falls: it is not told
    assert not little(2.0, 1.1, 1.0, 1.0, rules=replace(USUAL, most=0.95))
    # Beside large lateral errors a drag takes little of one step, and most of those ahead.
    assert little(27.0, 26.8, 26.5, 1.7, (MOST, NONE_OF_IT))
    assert not little(27.0, 26.8, 26.5, 1.7, (MOST, MOST))
    assert little(27.0, 26.8, 26.5, 1.7, (MOST, UNKNOWN))


def test_the_share_explained_is_of_what_is_beyond_the_noise_floor() -> None:
    assert share_explained(2.0, 1.0) == 1.0
    assert share_explained(2.0, 0.99) == 1.0
    assert share_explained(3.0, np.sqrt(5.0)) == pytest.approx(0.5)
    assert share_explained(2.0, 2.0) == 0.0
    assert share_explained(2.0, 3.0) < 0.0
    assert share_explained(1.0, 1.0) == 1.0


def test_no_name_stands_beside_a_stand_in_that_moves_the_same() -> None:
    """What the stand-in is for may be what the other one is for too, if it is the larger one.

    A stand-in beside which an effect keeps the larger share has not taken its place: that share is
    what is left of it after the stand-in was fitted anew without it.
    """
    both = frozenset({"yaw_rate_radps", "ay_mps2"})
    beside = Added("aligning_moment", "proxy", (), both, SOME, SOME)
    small = replace(LEFT, added=(MASS, beside))
    assert set(withdrawn(small)) == {"aligning_moment"}
    assert verdict(small).verdict == "partly_explained"
    larger = Share(0.7, 0.2, 0.9)
    large = replace(beside, own=larger, own_in_training=larger)
    # So does an effect that is not shown to be one.
    unsure = replace(large, finding="missing", own_in_training=replace(larger, low=-0.1))
    for other in (large, unsure):
        told = verdict(replace(LEFT, added=(MASS, other)))
        assert told.verdict == "unknown"
        because = {e: w.because for w in told.withdrawn for e in w.effects}
        assert because["mass"].startswith("of the same errors aligning_moment explains more")
    elsewhere = replace(large, moves=frozenset({"vx_mps"}))
    assert set(withdrawn(replace(LEFT, added=(MASS, elsewhere)))) == {"aligning_moment"}
    # What it stands in for acts on both data sets.
    for where in ("own", "own_in_training"):
        once = replace(beside, **{where: larger})
        assert set(withdrawn(replace(LEFT, added=(MASS, once)))) == {"aligning_moment"}
    # What nobody asked counts as unknown.
    assert "mass" in withdrawn(replace(LEFT, added=(MASS, replace(large, own=UNKNOWN))))
    unknown = replace(beside, own=UNKNOWN, own_in_training=UNKNOWN)
    assert set(withdrawn(replace(LEFT, added=(MASS, unknown)))) == {"aligning_moment"}
    sure = replace(MASS, id="aligning_moment", moves=both, own=larger)
    assert withdrawn(replace(LEFT, added=(MASS, sure))) == {}


def test_effects_that_act_alike_stand_together() -> None:
    """Beside each other neither a drag nor a rolling resistance has a share of its own."""
    drag = replace(DRAG, own=NONE_OF_IT, own_in_training=NONE_OF_IT)
    both = (drag, replace(drag, id="rolling_resistance"))
    groups = {("aero_drag", "rolling_resistance"): (MOST, SOME)}
    alone = replace(LEFT, added=(MASS, *both))
    assert set(withdrawn(alone)) == {"aero_drag", "rolling_resistance"}
    said = verdict(alone.with_groups(groups))
    assert {e for w in said.withdrawn for e in w.effects} == set()
    assert said.groups == {
        "aero_drag": {"rolling_resistance"},
        "rolling_resistance": {"aero_drag"},
    }
    assert said.verdict == "partly_explained"
    # So do those of which the model needs each, while none is shown to be off nothing.
    needed = [replace(a, own=MOST, own_in_training=MOST, felt=False) for a in both]
    some = replace(LEFT, added=(MASS, *needed))
    assert verdict(some.with_groups(groups)).groups == said.groups
    nothing = dict.fromkeys(groups, (NONE_OF_IT, NONE_OF_IT))
    assert set(withdrawn(some.with_groups(nothing))) == {"aero_drag", "rolling_resistance"}
    # Where nothing else acts like it what the model loses without it is its own.
    assert withdrawn(replace(some, added=(MASS, needed[0]))) == {}
    # Their share has to be shown as that of a single one, on all data.
    for unsure in ((MOST, NONE_OF_IT), (UNKNOWN, MOST)):
        told = alone.with_groups(dict.fromkeys(groups, unsure))
        assert verdict(told).groups == {}
        assert set(withdrawn(told)) == {"aero_drag", "rolling_resistance"}
    # What has a share of its own stands alone, and what does not beside it is none.
    one = replace(alone, added=(MASS, DRAG, both[1])).with_groups(groups)
    assert verdict(one).groups == {}
    assert set(withdrawn(one)) == {"rolling_resistance"}
    # Nor do they stand where all that was added is not shown to take anything.
    nothing = replace(alone, taken_low=-0.1).with_groups(groups)
    assert verdict(nothing).groups == {}
    assert verdict(nothing).verdict == "unknown"


def test_what_there_was_no_time_for_is_not_told_as_nothing() -> None:
    """A share that nobody asked for does not reach nothing: the name falls for want of time."""
    own = replace(MASS, own=MOST, own_in_training=MOST)
    assert withdrawn(replace(LEFT, added=(own,))) == {}
    for low, because in ((-0.1, "includes zero"), (None, "the time limit left open")):
        told = verdict(replace(LEFT, added=(own,), taken_low=low))
        (fallen,) = (w for w in told.withdrawn if own.id in w.effects)
        assert because in fallen.because
        assert told.verdict == "unknown"


def test_the_mean_of_shares_is_known_better_than_each() -> None:
    assert low_of_mean([Share(0.3, 0.1, 0.5)]) == pytest.approx(0.1)
    assert low_of_mean([Share(0.3, 0.1, 0.5)] * 4) == pytest.approx(0.2)
    assert low_of_mean([Share(0.5, 0.2, 0.6), Share(0.3, -0.1, 0.9)]) == pytest.approx(0.15)
    assert np.isnan(low_of_mean([MOST, UNKNOWN]))


def test_a_share_is_told_without_a_negative_zero() -> None:
    assert str(Share(-0.001, -0.09, 0.004)) == "0 % (-9 to 0)"
    assert str(Share(0.5, float("-inf"), 1.0)) == "50 % (-inf to 100)"
