"""The verdict on the whole, and the names that stand beside what is left."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.rules import (
    Added,
    Change,
    Facts,
    grade,
    share_explained,
    smaller_than,
    something_left,
    verdict,
)


def of(p_value: float, statistic: float = 99.0, target: str = "M_z") -> Omnibus:
    return Omnibus(statistic, 9, p_value, target)


NONE = of(0.5, 5.0)
BEFORE = of(1e-60, 909.0)
MASS = Added("mass", "missing", moves=frozenset({"yaw_rate_radps"}), taken=8.0)
DRAG = Added("aero_drag", "missing", moves=frozenset({"vx_mps"}), taken=1.0)
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
    silent = replace(WHOLE, structure=(0.02, -0.1))
    for evidence in ({"fitted": of(0.005)}, {"candidate": 0.005}):
        assert something_left(replace(WHOLE, **evidence))
        assert not something_left(replace(silent, **evidence))
        alone = replace(silent, added=(), together=None, **evidence)
        assert verdict(alone).verdict == "adequate"
        assert verdict(replace(alone, structure=(0.2, 0.0))).verdict == "unknown"
    # It does not speak against evidence beyond doubt.
    for evidence in ({"fitted": of(5e-4)}, {"candidate": 5e-4}, {"together": of(5e-4)}):
        assert something_left(replace(silent, **evidence))
    # What is predicted on all data is left, whatever the tests of forces say.
    shown = replace(WHOLE, structure=(0.5, 0.3))
    assert something_left(shown)
    assert something_left(replace(shown, added=(), together=None))
    assert verdict(replace(shown, added=(), together=None)).verdict == "unknown"
    assert verdict(replace(shown, added=(), together=None, small=True)).verdict == "adequate"
    assert not something_left(replace(WHOLE, structure=(0.5, 0.05)))


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


def test_names_beside_something_that_is_left() -> None:
    left = replace(WHOLE, fitted=of(1e-9, 209.0), missing=(8.0, 0.44), added=(MASS, DRAG))
    assert verdict(left).verdict == "partly_explained"
    assert withdrawn(left) == {}
    error = replace(left, missing=(8.0, 3.0))
    assert verdict(error).verdict == "unknown"
    assert set(withdrawn(error)) == {"mass", "aero_drag"}
    assert withdrawn(error)["mass"] == "takes up only 62 % of the error 1 to 5 s ahead"
    little = replace(left, added=(MASS, replace(DRAG, taken=0.1)), fitted=of(0.005, 209.0))
    assert withdrawn(little) == {"aero_drag": "what is left unexplained is larger"}
    assert verdict(little).verdict == "partly_explained"
    only = replace(left, added=(replace(MASS, finding="negligible"),))
    assert verdict(only).verdict == "unknown"


def falling(log_ratio: float = -0.3, error: float = 0.05) -> tuple[Change, ...]:
    channels = ("vy_mps", "yaw_rate_radps", "ay_mps2")
    return tuple(Change(c, h, log_ratio, error) for c in channels for h in (1.0, 2.0, 5.0))


def test_names_stand_beside_much_that_is_left_where_errors_fall_throughout() -> None:
    """On a real road the right effect takes up a third of the error, and much is left."""
    mass = replace(MASS, taken=3.0, changes=falling(), changes_in_training=falling(-0.1, 0.1))
    road = replace(WHOLE, fitted=of(1e-9, 709.0), missing=(8.0, 5.0), added=(mass,))
    said = verdict(road)
    assert said.verdict == "partly_explained"
    assert said.much_left
    assert withdrawn(road) == {}
    for spoilt in (
        (),
        # One channel that is not shown to fall, one horizon at which it does not; falls by chance,
        # and such as matter to nobody.
        (*falling()[:3], *falling(-0.09)[3:6], *falling()[6:]),
        (*falling()[:-1], replace(falling()[-1], log_ratio=0.01)),
        falling(error=0.2),
        falling(-0.04, 0.01),
    ):
        facts = replace(road, added=(replace(mass, changes=spoilt),))
        assert withdrawn(facts) == {"mass": "takes up only 38 % of the error 1 to 5 s ahead"}
        assert verdict(facts).verdict == "unknown"
        assert not verdict(facts).much_left
    for other in (
        replace(mass, changes_in_training=falling(0.01)),
        replace(mass, changes=falling(error=0.1), changes_in_training=falling(-0.1, 0.1)),
        replace(mass, taken=0.1),
        replace(mass, finding="proxy"),
    ):
        assert verdict(replace(road, added=(other,))).verdict == "unknown"
    # Each name stands or falls by itself.
    beside = replace(road, added=(mass, DRAG))
    assert set(withdrawn(beside)) == {"aero_drag"}
    assert verdict(beside).verdict == "partly_explained"


def test_an_effect_named_alone_should_have_explained_what_is_left() -> None:
    alone = "were it what is missing, nothing would be left"
    left = replace(WHOLE, fitted=of(1e-9, 209.0, "F_x"), missing=(8.0, 0.44))
    assert withdrawn(left) == {"mass": alone}
    assert verdict(left).verdict == "unknown"
    assert withdrawn(replace(left, fitted=of(0.005, 209.0))) == {}
    # Where errors ahead fall throughout the effect is in the car, and something else too.
    fallen = left.with_changes({"mass": (falling(), falling(-0.1, 0.1))})
    assert withdrawn(fallen) == {}
    assert verdict(fallen).verdict == "partly_explained"
    spoilt = left.with_changes({"mass": (falling(0.01), falling(-0.1, 0.1))})
    assert withdrawn(spoilt) == {"mass": alone}
    # Beside a proxy something else may be missing, which may be all that is left.
    proxy = replace(DRAG, finding="proxy")
    beside = replace(left, added=(MASS, proxy))
    assert withdrawn(beside).get("mass") is None
    turning = replace(beside, fitted=of(1e-9, 209.0, "M_z"))
    assert withdrawn(turning)["mass"] == alone
    on_all = replace(beside, fitted=of(0.005, 209.0, "F_x"), together=of(5e-4))
    assert withdrawn(on_all)["mass"] == alone


def test_grades_of_names() -> None:
    assert grade("missing", "missing") == "confirmed"
    assert grade("missing", "proxy") == "plausible"  # beside much that is left
    assert grade("one of a group", "one of a group") == "plausible"
    assert grade("negligible", "negligible") == "plausible"
    assert grade("proxy", "proxy") == "alias"
    assert grade("missing", "missing", much_left=True) == "plausible"


def test_what_took_up_less_than_is_left_is_doubted() -> None:
    taken = {"large": 10.0, "middle": 2.0, "tiny": 0.1}
    assert smaller_than(0.01, taken, frozenset()) == set()
    assert smaller_than(0.5, taken, frozenset()) == {"tiny"}
    # What proxies took up is unexplained too, and so is what was reserved for it.
    assert smaller_than(1.95, taken, frozenset()) == {"tiny", "middle"}
    assert smaller_than(0.5, taken, frozenset({"large"})) == {"tiny", "middle"}
    assert smaller_than(1.0, {}, frozenset()) == set()


def test_the_share_explained_is_of_what_is_beyond_the_noise_floor() -> None:
    assert share_explained(2.0, 1.0) == 1.0
    assert share_explained(2.0, 0.99) == 1.0
    assert share_explained(3.0, np.sqrt(5.0)) == pytest.approx(0.5)
    assert share_explained(2.0, 2.0) == 0.0
    assert share_explained(2.0, 3.0) < 0.0
    assert share_explained(1.0, 1.0) == 1.0


def moving(*channels: str, elsewhere: float = 0.0) -> tuple[Change, ...]:
    """Errors that fall in these channels, and change by next to nothing in the others."""
    return tuple(
        c if c.channel in channels else replace(c, log_ratio=elsewhere, error=0.01, reach=0.01)
        for c in (replace(c, reach=0.4) for c in falling())
    )


def test_errors_fall_where_an_effect_moves_something_and_grow_nowhere() -> None:
    """A bias of the gyro moves one channel only: of the others no fall can be asked."""
    one = moving("yaw_rate_radps", elsewhere=0.01)
    mass = replace(MASS, taken=3.0, changes=one, changes_in_training=one)
    road = replace(WHOLE, fitted=of(1e-9, 709.0), missing=(8.0, 5.0), added=(mass,))
    assert verdict(road).verdict == "partly_explained"
    for wrong in (
        moving("yaw_rate_radps", elsewhere=0.06),  # it grows elsewhere
        moving(),  # it moves nothing that could be seen to fall
        # It moves another channel as much, whose error does not fall.
        tuple(replace(c, reach=0.4) for c in one),
    ):
        for spoilt in (
            replace(mass, changes=wrong),
            replace(mass, changes=wrong, changes_in_training=wrong),
        ):
            assert verdict(replace(road, added=(spoilt,))).verdict == "unknown"
    assert (
        verdict(
            replace(road, added=(replace(mass, changes_in_training=moving("ay_mps2")),))
        ).verdict
        == "unknown"
    )


def test_no_name_stands_beside_a_stand_in_that_moves_the_same() -> None:
    """What the stand-in is for may be what the other one is for too."""
    mass = replace(MASS, taken=3.0, changes=falling(), changes_in_training=falling())
    road = replace(WHOLE, fitted=of(1e-9, 709.0), missing=(8.0, 5.0))
    both = frozenset({"yaw_rate_radps", "ay_mps2"})
    beside = Added("aligning_moment", "proxy", moves=both, taken=1.0)
    assert verdict(replace(road, added=(mass, beside))).verdict == "unknown"
    # Next to nothing of the error cannot be what takes up a third of it.
    small = replace(road, added=(mass, replace(beside, taken=0.1)))
    assert set(withdrawn(small)) == {"aligning_moment"}
    assert verdict(small).verdict == "partly_explained"
    assert verdict(replace(road, added=(mass, replace(beside, taken=-1.0)))).verdict == "unknown"
    unsure = replace(beside, finding="missing", changes=falling(0.2))
    assert verdict(replace(road, added=(mass, unsure))).verdict == "unknown"
    sure = replace(mass, id="aligning_moment", moves=both)
    assert withdrawn(replace(road, added=(mass, sure))) == {}
