"""Standard errors of parameters whose noise is learned beside them."""

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.estimate import learn_noise
from sysid_vehicle.identify import Fit, beside_noise, refine, refit

LENGTH = "tyre_relaxation.relaxation_length_m"
SHARE = "wheel_inertia.mass_share"
PUSHES = sv.RoadDisturbance(fx_n=150.0, fy_n=200.0, mz_nm=100.0, correlation_time_s=0.3)


def model() -> sv.Model:
    known = [f"{letter}_{axle}" for letter in "CDE" for axle in ("front", "rear")]
    return sv.Model(sv.example_vehicle()).add("tyre_relaxation").with_fixed(known)


def fitted(road: sv.RoadDisturbance | None) -> Fit:
    log = sv.drive(
        model().with_values({LENGTH: 0.45}),
        sv.manoeuvres.lap(40.0),
        seed=6115,
        rate_hz=50.0,
        disturbance=road,
    )
    return sv.identify(model(), log, starts=1, progress=False)


@pytest.fixture(scope="module")
def pushed() -> Fit:
    """Forces of the road change as fast as the tyres answer."""
    return fitted(PUSHES)


def lost_at(fit: Fit, length_m: float) -> float:
    """Log-likelihood lost where the length is held, and all else is learned anew."""
    held = fit.model.with_values({LENGTH: length_m}).with_fixed([LENGTH])
    return fit.log_likelihood - refine(held, fit.driving, fit.noise).log_likelihood


def test_one_standard_error_costs_half_a_nat_with_noise_learned_anew(pushed: Fit) -> None:
    length = pushed[LENGTH]
    both = [lost_at(pushed, length.value + sign * length.std) for sign in (-1.0, 1.0)]
    assert np.mean(both) == pytest.approx(0.5, abs=0.12)


def test_noise_that_is_held_leaves_too_small_an_error(pushed: Fit) -> None:
    held = refit(pushed.model, pushed.driving, pushed.noise)
    assert 1.1 < pushed[LENGTH].std / held[LENGTH].std < 1.4
    assert beside_noise(held)[LENGTH].std == pytest.approx(pushed[LENGTH].std, rel=0.02)


def test_covariance_and_standard_errors_agree(pushed: Fit) -> None:
    std = np.sqrt(np.diag(pushed.covariance))
    assert [e.std for e in pushed.estimates] == pytest.approx(std)
    assert np.linalg.eigvalsh(pushed.covariance).min() > 0.0


def test_ends_of_the_profile_cost_what_they_should_with_noise_learned_anew(pushed: Fit) -> None:
    profiled = sv.identify(model(), pushed.driving, starts=1, intervals="profile", progress=False)
    for end in profiled[LENGTH].interval:
        assert lost_at(profiled, end) == pytest.approx(1.92, abs=0.4)


def test_without_disturbances_noise_takes_next_to_nothing() -> None:
    fit = fitted(None)
    held = refit(fit.model, fit.driving, fit.noise)
    for wide, narrow in zip(fit.estimates, held.estimates, strict=True):
        assert narrow.std <= wide.std < 1.02 * narrow.std


def test_what_only_unknown_forces_tell_is_not_known() -> None:
    """At constant speed turning wheels are as heavy as forces that nobody knows are large."""
    known = [f"{letter}_{axle}" for letter in "BCDE" for axle in ("front", "rear")]
    car = sv.Model(sv.example_vehicle()).add("wheel_inertia").with_fixed(known)
    log = sv.drive(
        car.with_values({SHARE: 0.3}),
        sv.manoeuvres.sine_sweep(25.0, 25.0, 3.5),
        seed=7401,
        rate_hz=50.0,
        disturbance=PUSHES,
    )
    fit = sv.identify(car, log, starts=1, progress=False)
    held = refit(fit.model, fit.driving, fit.noise)[SHARE].std

    def learned_at(share: float) -> float:
        there = fit.model.with_values({SHARE: share})
        problem = fit.driving.problem(there)
        return learn_noise(problem, there.vector(), fit.noise, there.vehicle)[1]

    ends = [fit[SHARE].value + sign * held for sign in (-1.0, 1.0)]
    bend = 2.0 * learned_at(fit[SHARE].value) - sum(map(learned_at, ends))
    assert bend < 0.3  # 1 where the standard error is right
    assert fit[SHARE].std > 1.8 * held


def test_what_a_bound_holds_widens_nothing_else() -> None:
    """Coefficients that copy one at its bound are known beside it, and so is their product."""
    car = sv.Model(sv.example_vehicle()).add("tyre_relaxation")
    log = sv.drive(
        car.with_values({LENGTH: 0.45}),
        sv.manoeuvres.lap(40.0),
        seed=6115,
        rate_hz=50.0,
        disturbance=PUSHES,
    )
    fit = sv.identify(car, log, starts=1, progress=False, bounds={"C_front": (1.5, 2.5)})
    held = refit(fit.model, fit.driving, fit.noise)
    assert np.isinf(fit["C_front"].std)
    for name in ("cornering stiffness front", "cornering stiffness rear"):
        assert held[name].std <= fit[name].std < 1.2 * held[name].std
