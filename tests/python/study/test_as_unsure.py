"""Sizes of effects have one standard error, wherever a study tells them."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from sysid_vehicle import Fit, Model, drive, improve, manoeuvres
from sysid_vehicle.diagnose import EffectVerdict, Verdicts
from sysid_vehicle.effects import effect
from sysid_vehicle.identify import refit
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.results.widened import as_unsure


def test_sizes_of_effects_are_as_unsure_wherever_they_stand(
    hidden_fit: Callable[[str, float], Fit],
) -> None:
    bare = hidden_fit("gyro_bias.bias_radps", 0.02)
    fit = refit(bare.model.add("mass"), bare.driving, bare.noise)
    one, rival = effect("mass"), effect("force_gain")
    estimate = fit["mass.relative_error"]
    wide = [replace(e, std=3.0 * e.std) for e in fit.estimates]
    told = Verdicts(
        (
            EffectVerdict(one, "one of a group", (estimate.value,), (estimate.std,), group=()),
            EffectVerdict(rival, "one of a group", (0.1, 0.1), (0.01, 0.02), group=("mass",)),
            EffectVerdict(effect("wheel_inertia"), "one of a group", group=("mass",)),
            EffectVerdict(effect("gyro_bias"), "absent", (0.1,), (0.01,), (0.2,)),
            EffectVerdict(effect("aero_drag"), "proxy", (0.1,), (0.01,), (0.2,), ("mass",)),
        )
    )
    found = as_unsure(told, wide, fit, USUAL)
    assert found["mass"].std == pytest.approx((3.0 * estimate.std,))
    assert found["force_gain"].std == pytest.approx((0.03, 0.06))
    reach = [0.1 + USUAL.bound * s for s in (0.03, 0.06)]
    assert found["force_gain"].bound == pytest.approx(reach)
    assert "; " not in found["wheel_inertia"].sentence.split("driving")[1]
    for name in ("gyro_bias", "aero_drag"):  # told beside the effect, not in its place
        assert found[name] == told[name]


def test_effects_and_verdicts_tell_one_size(start: Model, truth: Model) -> None:
    sizes = {"gyro_bias.bias_radps": 0.02, "steer_ratio.ratio_error": 0.12}
    car = truth.add("gyro_bias", "steer_ratio").with_values(sizes)
    train, test = (drive(car, manoeuvres.lap(20.0), seed=s, rate_hz=25.0) for s in (65, 66))
    few = ["steer_ratio", "mass"]
    study = improve(start, train, test, candidates=few, starts=1, sensors=False)
    assert study.verdict in ("unknown", "partly_explained")
    (added,) = (a for a in study.added if a.id == "steer_ratio")
    assert study.verdicts["steer_ratio"].std == tuple(e.std for e in added.parameters)
    assert added.parameters[0].std > study.fit["steer_ratio.ratio_error"].std
