"""The crossfall that predictions of several models know."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, RoadDisturbance, compare, drive, identify
from sysid_vehicle._common.memo import forget
from sysid_vehicle.estimate import Driving
from sysid_vehicle.manoeuvres import usual_road
from sysid_vehicle.study.ahead import road
from sysid_vehicle.study.ahead.beyond import own_share
from sysid_vehicle.study.ahead.horizons import changes, horizons, squares_ahead
from sysid_vehicle.study.ahead.road import told_by
from sysid_vehicle.study.ahead.shares import shares
from sysid_vehicle.study.ahead.waterfall import all_ahead, waterfall


def test_models_that_are_held_against_each_other_know_the_same_crossfall(
    fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    hills = RoadDisturbance(slope_rad=0.015)
    biased = fit.model.add("gyro_bias").with_values({"gyro_bias.bias_radps": 0.02})
    log = drive(biased, usual_road("country", 40.0, 4), seed=7, disturbance=hills, rate_hz=50.0)
    right = replace(identify(biased, log, starts=1), model=biased)
    without = replace(right, model=fit.model)
    driving, noise = Driving.of(log), right.noise.floor()
    models = (without, right)
    means = [
        driving.problem(f.model).smoothed_means(f.model.vector(), noise.vector()) for f in models
    ]
    slopes = [m[:, -2:] for m in means]
    for model, own in zip(models, slopes, strict=True):
        told = told_by(model, models, noise, driving)
        assert told is not None
        np.testing.assert_allclose(told[:, 0], own[:, 0])
        np.testing.assert_allclose(told[:, 1], 0.5 * (slopes[0] + slopes[1])[:, 1])
    for alone in ((), (right,), (right, right)):
        assert told_by(right, alone, noise, driving) is None
    assert told_by(right, models, replace(noise, road=(0.0, 0.0)), driving) is None
    # Of long driving what is remembered would fill the memory.
    assert {f for f, *_ in road._told_remembered.known()} >= {*models}
    forget()
    monkeypatch.setattr(road._core, "TOLD_SAMPLES", 100)
    assert told_by(right, models, noise, driving) is not None
    assert not road._told_remembered
    monkeypatch.undo()
    # A model without the bias makes a bank of a part of it.
    assert np.abs(slopes[0] - slopes[1])[:, 1].mean() > 0.1


def test_whoever_compares_models_asks_them_on_one_crossfall(
    fit: Fit, course: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors of a model are other ones beside another model: the first and the last count."""
    late = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.15})
    noise = replace(fit.noise, road=(0.1, 0.1), road_time_s=5.0)
    models = (replace(fit, noise=noise), replace(fit, model=late, noise=noise))
    driving = Driving.of(course)
    asked: list[tuple[Fit, ...]] = []

    def noted(one: Fit, *args: Any, between: tuple[Fit, ...] = (), **kwargs: Any) -> np.ndarray:
        asked.append(between)
        return all_ahead(one, *args, between=between, **kwargs)

    def told(_: Fit, between: tuple[Fit, ...], *__: Any) -> None:
        asked.append(between)

    for module in ("horizons", "waterfall"):
        monkeypatch.setattr(f"sysid_vehicle.study.ahead.{module}.all_ahead", noted)
    monkeypatch.setattr("sysid_vehicle.study.ahead.shares.told_by", told)
    one = (driving, compare(models[1], driving))
    words = ("right", "late")
    for question in (
        lambda: changes(*models, driving, (0.5,)),
        lambda: horizons(models, words, driving, (0.5,)),
        lambda: squares_ahead(models, driving, (0.5,)),
        lambda: own_share(*models, driving, (0.5,)),
        lambda: waterfall(models, words, one, one, (0.5,)),
        lambda: shares(*models, driving, horizons_s=(0.5,)),
    ):
        forget()
        asked.clear()
        question()
        assert {*asked} == {models}
    forget()
    asked.clear()
    horizons(models[:1], ("right",), driving, (0.5,))
    assert asked == [()]
