"""Names that stand beside what is left, and what else speaks against them."""

from dataclasses import replace

from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.rules import Added, Facts, Share, standing, verdict

NONE, BEYOND_DOUBT = Omnibus(5.0, 9, 0.5, "M_z"), Omnibus(909.0, 9, 1e-60, "M_z")
MOST, SOME = Share(0.6, 0.5, 0.7), Share(0.2, 0.1, 0.3)
MASS = Added("mass", "missing", (), frozenset({"yaw_rate_radps"}), SOME, SOME)
WHOLE = Facts(NONE, NONE, missing=(8.0, 0.0), added=(MASS,))
LEFT = replace(WHOLE, fitted=BEYOND_DOUBT)


def test_what_speaks_against_a_name_takes_it_back_and_no_other() -> None:
    beside = Added("aero_downforce", "missing", (), MASS.moves, MOST, MOST)
    both = replace(LEFT, added=(MASS, beside))
    assert standing(both, verdict(both)) == {"mass", "aero_downforce"}
    told = both.with_against({"aero_downforce": "it is too small to matter"})
    found = verdict(told)
    assert found.verdict == "partly_explained"
    # Its share is the larger one, and is its own: the other has one beside it.
    assert standing(told, found) == {"mass"}
    because = {e: w.because for w in found.withdrawn for e in w.effects}
    assert because == {"aero_downforce": "it is too small to matter"}
    assert verdict(told.with_against({a.id: "no" for a in told.added})).verdict == "unknown"
    # Nor does the likelihood save it, where errors are below the noise.
    small = replace(told, buried=True, added=tuple(replace(a, sure=True) for a in told.added))
    assert standing(small, verdict(small)) == {"mass"}
    # Beside nothing that is missing nobody asks.
    assert verdict(replace(WHOLE, added=told.added)).verdict == "explained"


def test_what_kinematics_tells_is_no_question_of_errors_ahead() -> None:
    """A sensor elsewhere in the car takes no share of the errors, and is there all the same."""
    arm = Added("imu_lever_arm", "missing", (), frozenset({"ay_mps2"}), Share(0.0, -0.1, 0.1))
    told = replace(LEFT, added=(MASS, arm))
    assert standing(told, verdict(told)) == {"mass"}
    backed = replace(LEFT, added=(MASS, replace(arm, backed=True, against="other values")))
    assert standing(backed, verdict(backed)) == {"mass", "imu_lever_arm"}


def test_several_names_fall_where_one_effect_does_as_much() -> None:
    beside = Added("aero_downforce", "missing", (), MASS.moves, MOST, MOST)
    both = replace(LEFT, added=(MASS, beside))
    for facts, without in ((both, "partly_explained"), (replace(both, fitted=NONE), "explained")):
        assert verdict(facts).verdict == without
        found = verdict(replace(facts, one_for_all="steer_offset"))
        assert found.verdict == "unknown"
        because = {e: w.because for w in found.withdrawn for e in w.effects}
        assert because.keys() == {"mass", "aero_downforce"}
        assert all("steer_offset, which was not sought" in text for text in because.values())
