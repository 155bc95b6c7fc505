"""Nuisances of several logs, of which each has its own, in what a study prints."""

from types import SimpleNamespace

import pytest

from sysid_vehicle import Log, Model, drive, example_vehicle, identify, improve, manoeuvres
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


def test_what_a_poorer_model_put_into_them_goes_back_to_the_effect() -> None:
    """Short logs, whose nuisances take up much of a downforce that the baseline lacks."""
    hidden = {"aero_downforce.cl_a_front_m2": 0.7, "aero_downforce.cl_a_rear_m2": 1.1}
    car = Model(example_vehicle())
    truth = car.add("aero_downforce").with_values(hidden)
    whole = drive(truth, manoeuvres.handling_course(40.0, 7.0), seed=8731, rate_hz=25.0)
    short = [whole.between(t, t + 6.0) for t in (2.0, 10.0, 18.0, 26.0, 33.5)]
    found = improve(
        car.with_nuisances(),
        short[:4],
        short[4:],
        candidates=["aero_downforce"],
        starts=1,
        sensors=False,
    )
    assert [a.id for a in found.added] == ["aero_downforce"]
    anew = identify(found.model, short[:4], starts=1)
    for name, true in hidden.items():
        own = found.fit[name]
        assert abs(own.value - true) < 3.0 * own.std
        assert abs(own.value - anew[name].value) < 0.5 * own.std
    assert found.fit.log_likelihood == pytest.approx(anew.log_likelihood, abs=1.0)
