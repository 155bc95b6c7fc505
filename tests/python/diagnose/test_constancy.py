"""What is truly there has one value everywhere; what stands in for it has many."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Model, drive, effect, identify, manoeuvres
from sysid_vehicle.diagnose import EffectVerdict, Verdicts, constancy, judge
from sysid_vehicle.diagnose.candidates.score import _p_value
from sysid_vehicle.identify import refine

ROLLING = "rolling_resistance.coefficient"
RATIO = "steer_ratio.ratio_error"


@pytest.fixture(scope="module")
def fits(truth: Model, start: Model) -> dict[str, Fit]:
    """A car that rolls less freely than is known, explained by that and by a head wind."""
    car = truth.add("rolling_resistance").with_values({ROLLING: 0.012})
    logs = [
        drive(car, manoeuvres.sine_sweep(15.0, speed, 2.5, to_hz=1.5), seed=seed, rate_hz=50.0)
        for seed, speed in ((31, 14.0), (32, 30.0))
    ]
    return {e: identify(start.add(e), logs, starts=1) for e in ("rolling_resistance", "head_wind")}


def test_a_true_effect_keeps_its_value(fits: dict[str, Fit]) -> None:
    kept = constancy(fits["rolling_resistance"])["rolling_resistance"]
    assert kept.holds
    assert kept.p_value > 0.001
    assert str(kept).startswith("rolling_resistance keeps its value")


def test_what_was_never_felt_has_no_value_that_could_differ(fits: dict[str, Fit]) -> None:
    """Cut into pieces it would take any, and the others of the effect move against it."""
    fit = fits["rolling_resistance"]

    def unfelt(*names: str) -> Fit:
        told = (replace(e, std=np.inf) if e.name in names else e for e in fit.estimates)
        return replace(fit, estimates=tuple(told))

    found = constancy(unfelt("rolling_resistance.per_speed_spm"))["rolling_resistance"]
    assert found.degrees == 1
    assert found.holds
    assert constancy(unfelt("rolling_resistance.per_speed_spm", ROLLING)) == {}


def test_a_proxy_changes_from_drive_to_drive(fits: dict[str, Fit]) -> None:
    fit = fits["head_wind"]
    kept = constancy(fit)["head_wind"]
    assert kept.degrees == 1
    assert not kept.holds
    assert kept.p_value < 1e-6
    # A wind pushes in proportion to speed, which differs by a factor of 2.1.
    slow, fast = kept.values
    assert slow > 1.6 * fast > 0.0
    assert "head_wind does not keep its value: speed_mps from" in str(kept)
    judged = judge(fit, lacked={"head_wind"}, groups={}, acted=set())["head_wind"]
    assert judged.finding == "proxy"
    assert "its value is not constant (speed_mps from " in judged.sentence
    assert judged.sentence.endswith("m/s)")


def test_noise_of_the_steering_is_no_other_value(truth: Model) -> None:
    """On a motorway little but noise moves the wheels, and asks for no steering at all."""
    car = truth.add("steer_ratio").with_values({RATIO: 0.16})
    rng = np.random.default_rng(1)
    roads = [manoeuvres.usual_road(kind, 50.0, rng) for kind in ("motorway", "country")]
    logs = [drive(car, road, seed=1 + i, rate_hz=50.0) for i, road in enumerate(roads)]
    kept = constancy(identify(truth.add("steer_ratio"), logs, starts=1))["steer_ratio"]
    assert kept.holds
    assert kept.p_value > 0.01


def test_with_an_effect_its_rivals_are_doubted() -> None:
    drag, rolling, mass = (effect(e) for e in ("aero_drag", "rolling_resistance", "mass"))
    told = Verdicts(
        (
            EffectVerdict(mass, "missing", (0.1,), (0.01,)),
            EffectVerdict(drag, "one of a group", (0.4,), (0.01,), group=("rolling_resistance",)),
            EffectVerdict(rolling, "one of a group", group=("aero_drag",)),
        )
    )
    reserved = told.with_reservation({"aero_drag"}, "it explains little", added={"aero_drag"})
    assert [v.finding for v in reserved.all] == ["missing", "proxy", "proxy"]
    assert reserved["rolling_resistance"].sentence == ("significant, but it explains little")
    # What was added does not fall with a rival.
    both = {"aero_drag", "rolling_resistance"}
    kept = told.with_reservation({"rolling_resistance"}, "it explains little", added=both)
    assert [kept[e].finding for e in sorted(both)] == ["one of a group", "proxy"]
    assert told.with_reservation((), "nothing").all == told.all


def test_the_only_log_is_cut_into_pieces(hidden_fit: Callable[[str, float], Fit]) -> None:
    fit = hidden_fit("steer_offset.offset_rad", 0.002)
    assert constancy(fit) == {}  # no effect in it
    added = fit.model.add("steer_offset").with_values({"steer_offset.offset_rad": 0.002})
    kept = constancy(refine(added, fit.driving, fit.noise.floor()))["steer_offset"]
    assert len(kept.values) >= 3
    assert kept.holds


@pytest.mark.parametrize(("name", "alike"), [("body_attitude", -0.7), ("body_attitude", 0.8)])
def test_two_parameters_of_one_sign_have_the_level_they_claim(name: str, alike: float) -> None:
    information = np.array([[4.0, 6.0 * alike], [6.0 * alike, 9.0]])
    scores = np.random.default_rng(3).multivariate_normal([0.0, 0.0], information, size=20000)
    p = _p_value(effect(name), scores, information)
    for level in (0.01, 0.05, 0.2):
        assert np.mean(p < level) == pytest.approx(level, abs=4.0 * np.sqrt(level / 20000))
    assert _p_value(effect(name), np.array([[-5.0, -5.0]]), information) == [1.0]


def test_differences_that_matter_to_nobody_are_none(fits: dict[str, Fit]) -> None:
    kept = constancy(fits["head_wind"])["head_wind"]
    size = kept.effect.parameters[0].matters
    # A slow drive tells less of a wind, and of the difference as much as the fast one does.
    assert kept.spread * size == pytest.approx(np.std(kept.values), rel=0.05)
    assert not kept.holds
    assert replace(kept, spread=0.99).holds
