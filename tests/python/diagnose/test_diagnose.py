"""The missing effect is ranked first, and nothing is claimed where nothing is missing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import pyplot

from sysid_vehicle import (
    Diagnosis,
    Fit,
    InvalidInput,
    Log,
    Model,
    catalogue,
    compare,
    diagnose,
    drive,
    identify,
    manoeuvres,
)
from sysid_vehicle.diagnose import where
from sysid_vehicle.diagnose.candidates.refitting import _rivals, _too_fast
from sysid_vehicle.identify import with_exact_inputs

Hidden = Callable[[str, float], Fit]
OFFSET = "steer_offset.offset_rad", 0.002


@pytest.fixture(scope="module")
def found(hidden_fit: Hidden) -> Diagnosis:
    return diagnose(hidden_fit(*OFFSET))


def test_the_hidden_effect_is_first(found: Diagnosis) -> None:
    first = found.ranking[0]
    assert found.best.id == first.id == "steer_offset"
    assert first.p_value < 1e-6
    assert first.indistinguishable_from == ()
    assert first in found.significant
    assert found.omnibus.p_value < 1e-3


def test_its_size_is_that_of_the_refit(found: Diagnosis) -> None:
    first = found.ranking[0]
    assert first.fit is not None
    estimate = first.fit[OFFSET[0]]
    assert (first.value, first.std) == ((estimate.value,), (estimate.std,))
    assert abs(estimate.value - OFFSET[1]) < 4.0 * estimate.std
    gain = 2.0 * (with_exact_inputs(first.fit) - with_exact_inputs(found.fit))
    assert first.statistic == pytest.approx(gain, rel=1e-12)
    # What `compare` prints of the model with it, without it far above.
    assert first.error == compare(first.fit, found.driving).error
    assert found.error == compare(found.fit, found.driving, noise=found.floor).error
    assert first.error < 1.02 < 1.2 < found.error
    assert all(np.isnan(c.error) == (c.fit is None) for c in found.ranking)
    assert f"{first.error:.3f}" in str(found)


def test_every_candidate_is_ranked_once(found: Diagnosis) -> None:
    ids = [c.id for c in found.ranking]
    assert len(set(ids)) == len(ids)
    assert set(ids) <= {e.id for e in catalogue()}
    assert len(ids) > 15
    assert all(c.fit is None for c in found.ranking if c not in found.significant)


def test_nothing_is_claimed_of_a_complete_model(complete_fits: tuple[Fit, ...]) -> None:
    for fit in complete_fits:
        dx = diagnose(fit)
        assert dx.significant == ()
        assert dx.ranking
        with pytest.raises(InvalidInput, match="no effect of the catalogue is missing"):
            _ = dx.best
        assert "no effect of the catalogue is missing; no remaining error" in str(dx)


def test_scores_alone_need_no_refit(hidden_fit: Hidden, found: Diagnosis) -> None:
    quick = diagnose(hidden_fit(*OFFSET), refits=0)
    assert quick.ranking[0].id == "steer_offset"
    assert all(c.fit is None for c in quick.ranking)
    assert quick.named is None
    with pytest.raises(InvalidInput, match="steer_offset is likeliest by its score alone"):
        _ = quick.best
    assert quick.ranking[0].value[0] == pytest.approx(found.ranking[0].value[0], rel=0.2)


def test_a_refit_that_failed_names_nothing(found: Diagnosis) -> None:
    """Nor does an effect beside it that was never refitted, whatever it scores."""
    first, second = found.ranking[:2]
    unfitted = replace(first, fit=None, statistic=0.0)
    assert replace(found, ranking=(unfitted,)).named is None
    strong = replace(second, fit=None, p_value=0.0, statistic=2.0 * first.statistic)
    for ranking in ((strong, unfitted), (unfitted, strong)):
        dx = replace(found, ranking=ranking)
        assert dx.named is None
        assert "no refit confirms it" in str(dx)
    assert replace(found, ranking=(first, strong)).named is first


def test_what_is_asked_for_is_refitted_again_where_there_is_evidence(
    hidden_fit: Hidden, found: Diagnosis
) -> None:
    fit = hidden_fit(*OFFSET)
    near = {found.best.id, *found.best.confounded_with}
    asked = next(c.id for c in reversed(found.significant) if c.id not in near)
    absent = next(c.id for c in reversed(found.ranking) if c not in found.significant)
    some = [found.best.id, asked, absent]

    def refitted(*again: str) -> set[str]:
        dx = diagnose(fit, candidates=some, refits=1, again=again)
        return {c.id for c in dx.ranking if c.fit is not None}

    assert refitted() == {found.best.id}
    assert refitted(asked, absent) == {found.best.id, asked}


def test_only_the_candidates_asked_for_are_considered(hidden_fit: Hidden) -> None:
    fit = hidden_fit(*OFFSET)
    few = diagnose(fit, candidates=["aero_drag", "steer_offset"], refits=0)
    assert [c.id for c in few.ranking] == ["steer_offset", "aero_drag"]
    with pytest.raises(InvalidInput, match="no effect is called 'stear_offset'"):
        diagnose(fit, candidates=["stear_offset"])
    none = diagnose(fit, candidates=[])
    assert none.ranking == none.significant == ()


def test_an_effect_in_the_model_is_no_candidate(found: Diagnosis) -> None:
    inside = found.ranking[0].fit
    assert inside is not None
    dx = diagnose(inside)
    assert "steer_offset" not in [c.id for c in dx.ranking]
    assert dx.significant == ()


def test_the_same_seed_gives_the_same_diagnosis(complete_fits: tuple[Fit, ...]) -> None:
    fit = complete_fits[0]
    one, same, other = (diagnose(fit, refits=0, seed=seed) for seed in (5, 5, 6))
    assert [(c.id, c.p_value) for c in one.ranking] == [(c.id, c.p_value) for c in same.ranking]
    assert [c.p_value for c in one.ranking] != [c.p_value for c in other.ranking]


def test_effects_that_look_alike_at_constant_speed_are_named(truth: Model, start: Model) -> None:
    name = "rolling_resistance.coefficient"
    hidden = truth.add("rolling_resistance")
    car = hidden.with_values({name: hidden.parameters[name].typical})
    log = drive(car, manoeuvres.slalom(25.0), seed=9, rate_hz=50.0)
    dx = diagnose(identify(start, log, starts=1))
    alike = {dx.best.id, *dx.ranking[0].indistinguishable_from}
    assert {"rolling_resistance", "aero_drag"} <= alike
    # The accelerometer feels a force and does not feel gravity along the road.
    assert "road_grade" not in alike
    assert "confounded with" in str(dx)


def test_it_prints_and_draws(found: Diagnosis) -> None:
    assert str(found).startswith("most likely missing: offset of the logged steering angle")
    for text in (str(found), found._repr_html_()):
        assert f"offset_rad {found.ranking[0].value[0]:.3g} +- " in text
    ax = pyplot.subplots()[1]
    assert found.plot(ax, most=6) is ax
    assert len(ax.patches) == 6
    widths = [bar.get_width() for bar in ax.patches]
    assert widths[-1] == max(widths) == pytest.approx(found.ranking[0].statistic)
    assert np.isfinite(widths).all()
    assert found.plot() is not ax


def test_a_rival_that_scores_nearly_as_well_is_refitted(truth: Model, start: Model) -> None:
    """A refit gains far more than its score, so that a score beside it would look hopeless."""
    car = truth.add("tyre_relaxation").with_values({"tyre_relaxation.relaxation_length_m": 0.9})
    logs = [
        drive(car, m, seed=i, rate_hz=50.0)
        for i, m in enumerate((manoeuvres.sine_sweep(25.0, 25.0, 3.5), manoeuvres.lap(30.0, 8.0)))
    ]
    fit = identify(start, logs, starts=1)
    by_score = diagnose(fit, refits=0).ranking
    best, found = by_score[0], diagnose(fit)
    refitted = {c.id for c in found.ranking if c.fit is not None}
    rivals = {c.id for c in by_score if _rivals(c, best) and not _too_fast(c)}
    assert "tyre_relaxation" in {best.id} | rivals <= {best.id} | refitted
    assert found.ranking[0].id == "tyre_relaxation"
    assert found.ranking[0].value[0] == pytest.approx(0.9, abs=0.02)
    twin = next(c for c in by_score if c.id in best.effect.confounded_with)
    stranger = next(c for c in by_score if c.id == "road_grade")
    assert _rivals(replace(twin, statistic=0.5 * best.statistic), best)
    assert not _rivals(replace(twin, statistic=0.2 * best.statistic), best)
    assert not _rivals(replace(stranger, statistic=0.9 * best.statistic), best)


def test_logs_without_the_force_that_the_fit_had_are_refused(
    fit: Fit, course: Log, altered: Callable[..., Log]
) -> None:
    """Noise of the acceleration in its place was not learned: it would be an effect that lacks."""
    blind = altered(course, without=["fx_n"])
    for ask in (diagnose, where):
        with pytest.raises(InvalidInput, match=r"course.*the fit was made with the wheel force"):
            ask(fit, blind)
