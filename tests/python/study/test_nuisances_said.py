"""Nuisances of several logs, of which each has its own, in what a study prints."""

from types import SimpleNamespace

from sysid_vehicle import Log, Model, identify
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.results.sentences import nuisances


def test_they_are_told_log_by_log(start: Model, lap: Log) -> None:
    """Their mean is nothing here, and says as little as that of one log would."""
    logs = [
        Log.from_arrays(
            {c: part[c] for c in part} | {"yaw_rate_radps": part["yaw_rate_radps"] + bias},
            name=name,
        )
        for name, bias, part in (
            ("first", 0.02, lap.between(0.0, 12.0)),
            ("second", -0.02, lap.between(12.0, 24.0)),
        )
    ]
    fit = identify(start.with_nuisances(["gyro_bias", "steer_offset"]), logs, starts=1)
    assert abs(fit["gyro_bias.bias_radps"].value) < 0.002
    (told,) = nuisances(SimpleNamespace(fit=fit, estimates=fit.estimates, rules=USUAL))  # type: ignore[arg-type]
    assert told.startswith("Nuisance gyro_bias (bias of the yaw-rate sensor): bias_radps [rad/s] 0")
    words = told.split()
    for log, bias in (("first,", 0.02), ("second", -0.02)):
        assert abs(float(words[words.index(log) - 2]) - bias) < 0.002
