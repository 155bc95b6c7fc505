"""What a user says of parameters and the data contradict: it is told."""

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.identify.intervals.estimates import Estimate
from sysid_vehicle.identify.intervals.priors import against_priors

INERTIA = "yaw_inertia_kgm2"


@pytest.fixture(scope="module")
def free(truth: sv.Model) -> sv.Model:
    return truth.with_free([INERTIA])


def test_what_the_data_say_follows_from_prior_and_posterior() -> None:
    # A prior 1 +- 0.5 and data 4 +- 1 of a normal variable.
    variance = 1.0 / (1.0 / 0.25 + 1.0)
    value = variance * (1.0 / 0.25 + 4.0)
    e = Estimate("x", value, variance**0.5, "m")
    (told,) = against_priors([e], np.array([[variance]]), {"x": (1.0, 0.5)}, least=2.5)
    assert (told.value, told.std) == pytest.approx((4.0, 1.0))
    assert told.apart == pytest.approx(3.0 / np.hypot(0.5, 1.0))
    assert not against_priors([e], np.array([[variance]]), {"x": (1.0, 0.5)}, least=2.7)
    # Nothing is said of what the data do not feel, and of what has no prior.
    assert not against_priors([e], np.array([[0.25]]), {"x": (1.0, 0.5)}, least=0.1)
    assert not against_priors([e], np.array([[variance]]), {}, least=0.1)


def test_a_prior_that_excludes_the_car_is_told(free: sv.Model, lap: sv.Log) -> None:
    true = free.value(INERTIA)
    with pytest.warns(sv.SysidWarning, match=r"yaw_inertia_kgm2: the prior 1200 \+- 10 contradi"):
        fit = sv.identify(free, lap, starts=1, priors={INERTIA: (1200.0, 10.0)})
    (told,) = fit.against_priors
    assert abs(told.value - true) < 0.05 * true  # the estimate itself is a third too low
    assert fit[INERTIA].value < 0.8 * true
    assert f"Warning: {told}" in str(fit).splitlines()
    assert str(told) in fit._repr_html_()


def test_a_prior_that_holds_the_car_is_not(
    free: sv.Model, lap: sv.Log, recwarn: pytest.WarningsRecorder
) -> None:
    true = free.value(INERTIA)
    fit = sv.identify(free, lap, starts=1, priors={INERTIA: (true + 50.0, 50.0)})
    assert fit.against_priors == ()
    assert "contradicts" not in str(fit)
    assert not [w for w in recwarn if "contradicts" in str(w.message)]


def test_a_study_tells_what_of_the_user_is_contradicted(
    free: sv.Model, lap: sv.Log, course: sv.Log
) -> None:
    wrong = free.with_priors({INERTIA: (1200.0, 10.0)})
    with pytest.warns(sv.SysidWarning, match="contradicts"):
        fit = sv.identify(wrong, lap, starts=1)
    study = sv.improve(wrong, lap, course, starts=1, candidates=[], sensors=False)
    assert study.verdict == "unknown"
    assert any(w.startswith(f"{INERTIA}: the prior 1200 +- 10") for w in study.warnings)
    assert study.next_steps[0].startswith(f"correct the prior of {INERTIA}")
    assert study.fit.against_priors[0].apart == pytest.approx(fit.against_priors[0].apart, rel=0.1)


def test_a_study_tells_the_bound_at_which_it_ends(
    free: sv.Model, lap: sv.Log, course: sv.Log
) -> None:
    true = free.value(INERTIA)
    bounds = {INERTIA: (1000.0, 1400.0)}
    study = sv.improve(
        free.with_bounds(bounds), lap, course, starts=1, candidates=[], sensors=False
    )
    (said,) = (w for w in study.warnings if w.startswith(f"{INERTIA}: ends at its bound 1400 kg"))
    beyond = float(said.split("to about ")[1].split()[0])
    assert abs(beyond - true) < 0.1 * true
    assert study.next_steps[0].startswith(f"correct the bounds of {INERTIA}")
