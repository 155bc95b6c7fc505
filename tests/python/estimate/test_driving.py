"""Logs made ready for the core: what is usable, and what stands in for what is missing."""

import re
from collections.abc import Callable

import numpy as np
import pytest

from sysid_vehicle import Driving, InvalidInput, Log, Model, SysidWarning, _core
from sysid_vehicle.estimate import MEASURED, first_guess
from sysid_vehicle.estimate.samples import thinned


@pytest.fixture
def short(lap: Log) -> Log:
    return lap.between(0.0, 10.0)


def test_driving_is_made_of_one_log_or_several(short: Log, course: Log) -> None:
    one = Driving.of(short)
    assert one.samples == short.n
    assert Driving.of(one) is one
    two = Driving.of([short, course])
    assert two.samples == short.n + course.n
    assert two.log_number.tolist() == [0.0] * short.n + [1.0] * course.n
    assert np.array_equal(two.channel("vx_mps"), np.r_[short["vx_mps"], course["vx_mps"]])
    assert "40.0 s usable in 2 stretch(es)" in str(two)


def test_no_log_is_refused() -> None:
    with pytest.raises(InvalidInput, match="no log was given; pass one Log or a list"):
        Driving.of([])


def test_a_log_too_slow_to_use_is_refused(short: Log, altered: Callable[..., Log]) -> None:
    slow = altered(short, vx_mps=np.full(short.n, 0.8))
    with pytest.raises(InvalidInput, match=r"lap .*no stretch of 1 s or more at 1 m/s or faster"):
        Driving.of(slow)


def test_where_all_is_slow_less_speed_is_enough(short: Log, altered: Callable[..., Log]) -> None:
    assert short.least_speed_mps == 3.0
    vx = np.full(short.n, 2.0)
    vx[:100] = 0.5
    slow = altered(short, vx_mps=vx)
    assert slow.least_speed_mps == 1.0
    assert Driving.of(slow).samples == short.n - 100
    assert altered(short, vx_mps=np.full(short.n, 5.0)).least_speed_mps == pytest.approx(2.0)


def test_slow_parts_are_left_out(short: Log, truth: Model, altered: Callable[..., Log]) -> None:
    vx = short["vx_mps"].copy()
    vx[200:300] = 1.0
    driving = Driving.of(altered(short, vx_mps=vx))
    assert [(s.where.start, s.where.stop) for s in driving.stretches] == [(0, 200), (300, short.n)]
    assert driving.problem(truth).samples == driving.samples == short.n - 100


def test_without_force_the_acceleration_becomes_an_input(
    short: Log, truth: Model, altered: Callable[..., Log]
) -> None:
    driving = Driving.of(altered(short, without=["fx_n"]))
    assert not driving.force_known
    assert driving.present == ("vx_mps", "vy_mps", "yaw_rate_radps", "ay_mps2")
    assert np.isnan(driving.measured[:, MEASURED.index("ax_mps2")]).all()
    assert driving.problem(truth).samples == short.n


def test_one_log_without_force_decides_for_all_and_this_is_said(
    short: Log, course: Log, altered: Callable[..., Log]
) -> None:
    blind = altered(short, without=["fx_n"])
    with pytest.warns(
        SysidWarning, match=rf"^{re.escape(short.name)} has no fx_n.*of {course.name} is not"
    ):
        driving = Driving.of([blind, course])
    assert not driving.force_known
    assert np.isnan(driving.measured[:, MEASURED.index("ax_mps2")]).all()


def test_logs_that_share_neither_force_nor_acceleration_are_refused(
    short: Log, course: Log, altered: Callable[..., Log]
) -> None:
    logs = [altered(short, without=["fx_n"]), altered(course, without=["ax_mps2"])]
    with pytest.raises(
        InvalidInput, match=f"{course.name} has no ax_mps2, and {re.escape(short.name)} has"
    ):
        Driving.of(logs)


def test_where_the_acceleration_takes_the_place_of_a_force_it_counts_as_an_input(
    short: Log, course: Log, altered: Callable[..., Log]
) -> None:
    """Its short holes are filled, and where it is missing for long the model does not run."""
    ax = course["ax_mps2"].copy()
    ax[100:103] = np.nan
    ax[1000:1050] = np.nan
    with pytest.warns(SysidWarning, match="ax_mps2: no values at samples 1000 to 1049"):
        holed = altered(course, ax_mps2=ax)
    with pytest.warns(SysidWarning, match="has no fx_n"):
        driving = Driving.of([altered(short, without=["fx_n"]), holed])
    assert [(s.where.start, s.where.stop) for s in driving.stretches[1:]] == [
        (0, 1000),
        (1050, course.n),
    ]
    assert np.isfinite(driving.inputs()).all()


def test_an_absent_channel_is_missing_only_where_it_is_absent(
    short: Log, course: Log, altered: Callable[..., Log]
) -> None:
    driving = Driving.of([altered(short, without=["vy_mps"]), course])
    known = np.isfinite(driving.measured[:, MEASURED.index("vy_mps")])
    assert known.tolist() == [False] * short.n + [True] * course.n
    assert driving.present == MEASURED


def test_missing_measurements_leave_the_others_in(short: Log, altered: Callable[..., Log]) -> None:
    ay = short["ay_mps2"].copy()
    ay[200:300] = np.nan
    with pytest.warns(SysidWarning, match="ay_mps2: no values at samples 200 to 299"):
        log = altered(short, ay_mps2=ay)
    driving = Driving.of(log)
    assert driving.samples == short.n
    assert np.isnan(driving.measured[:, MEASURED.index("ay_mps2")]).sum() == 100


def test_a_thinned_problem_keeps_windows_from_everywhere(lap: Log, truth: Model) -> None:
    driving = Driving.of(lap)
    thin = driving.problem(truth, most_samples=1500)
    assert 0.8 * 1500 < thin.samples < 1.2 * 1500
    assert driving.problem(truth, most_samples=10**6).samples == driving.samples
    starts = [where.start for _, where, _ in thinned(driving._whole, 1500)]
    assert starts[0] == 0
    assert starts[-1] > 0.6 * driving.samples


def test_what_a_filter_told_is_its_trace(
    short: Log, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    driving = Driving.of(short)
    p, noise = truth.vector(), first_guess(driving, truth.vehicle).vector()
    problem = driving.problem(truth)
    whole = _core.Problem.trace(problem, p, noise, False)
    gains = problem.freeze(p, noise)
    monkeypatch.setattr(_core.Problem, "freeze", None)  # it ran already
    told = driving.problem(truth).trace(p, noise, False)
    assert told["log_likelihood"] == gains.log_likelihood
    for name in ("innovation", "spread", "whitened", "log_density", "state", "state_std"):
        np.testing.assert_allclose(told[name], whole[name], rtol=1e-8, atol=1e-9, err_msg=name)
