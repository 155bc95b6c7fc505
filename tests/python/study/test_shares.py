"""What could be explained of the errors ahead, and what is."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log
from sysid_vehicle.diagnose.evidence.coordinates import begins
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import share_between
from sysid_vehicle.study.ahead.shares import CHANNELS, Shares, _errors, _path, shares


@pytest.fixture(scope="module")
def found(fit: Fit, course: Log) -> Shares:
    """A car answered late and too strongly by the baseline, and half cured by an effect."""
    late, half = (
        fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": t})
        for t in (0.16, 0.08)
    )
    fits = (replace(fit, model=m) for m in (late, half))
    return shares(*fits, Driving.of(course), named=["a lag of half the size"])


def test_the_ceiling_lies_between_the_sensors_and_what_is_explained(found: Shares) -> None:
    assert found.channels == CHANNELS
    assert found.horizons_s == (0.0, 0.5, 1.0, 2.0, 5.0)
    baseline, final, ceiling = (x[1] for x in (found.baseline, found.final, found.ceiling))
    assert (ceiling <= final).all()
    yaw = CHANNELS.index("yaw_rate_radps")
    # Taught on a lap and judged on a handling course, it finds a part of what is left.
    assert (ceiling[1:4, yaw] < 0.85 * final[1:4, yaw]).all()
    assert (final[1:4, yaw] < 0.7 * baseline[1:4, yaw]).all()
    assert (ceiling[:, yaw] > 0.7 * found.noise[yaw]).all()
    for x in (found.baseline, found.final, found.ceiling):
        assert (np.diff(x, axis=0) >= 0.0).all()  # deciles


def test_half_the_effect_explains_most_but_not_all(found: Shares) -> None:
    # At most: a better regression would find more that could be explained.
    assert 0.6 < found.whole.low <= found.whole.value < 1.0
    assert found.whole.value <= found.whole.high <= 1.0
    assert f"explain {found.whole}" in found.sentence
    text = str(found)
    assert "one step" in text
    assert "path" in text
    assert "m/s2" in found._repr_html_()
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert told["channels"]["path_m"]["sensor_noise"] is None
    assert told["channels"]["yaw_rate_radps"]["baseline"][1][2] == found.baseline[1, 2, 1]


def test_of_a_complete_model_nothing_is_left_to_explain(fit: Fit, course: Log) -> None:
    found = shares(fit, fit, Driving.of(course), horizons_s=(1.0, 2.0))
    assert not found.whole.known
    assert found.to_dict()["whole"]["value"] is None
    assert found.sentence.startswith("No function of the driving is shown to predict")


def test_what_no_effect_explains_is_told(found: Shares) -> None:
    alone = replace(found, named=())
    assert "no effect was added" in alone.sentence
    assert "yaw rate" in alone.sentence
    unsure = replace(found, whole=share_between(np.ones((9, 3))))
    assert "is not significant" in unsure.sentence


def test_pieces_of_several_logs_count_alike(fit: Fit, course: Log) -> None:
    """Predictions begin and end within a stretch, wherever in its log that lies."""
    late = replace(
        fit,
        model=fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.16}),
    )
    apart = Driving.of([course.between(1.0, 12.0), course.between(13.0, 29.0)])
    assert len(begins(apart)) == 2
    ends, errors = _errors(late, fit.noise.floor(), apart, (0.5, 1.0), ())[0]
    problem, p = apart.problem(late.model), late.model.vector()
    rows = problem.look_ahead(p, fit.noise.floor().vector(), [(round(0.5 * course.rate_hz), 1)])[0]
    np.testing.assert_allclose(errors[:, 1], rows[ends, 2])
    assert np.isfinite(errors).all()
    lengths = np.diff([*begins(apart), apart.samples])
    second = np.count_nonzero(ends >= lengths[0])
    assert second / len(ends) == pytest.approx(lengths[1] / apart.samples, abs=0.05)


def test_a_model_that_loses_the_car_is_told_so(fit: Fit, course: Log) -> None:
    broken = replace(fit, model=fit.model.with_values({"B_front": float("nan")}))
    found = shares(broken, fit, Driving.of(course), named=["tyres"], horizons_s=(1.0,))
    assert found.baseline[1, 0, 0] > 50.0 * found.final[1, 0, 0]
    assert found.whole.value == pytest.approx(1.0, abs=0.01)


def test_the_path_is_integrated() -> None:
    """Errors in proportion to time: v_y = a t, r = b t, the course b t^2/2."""
    a, b, v, t = 0.3, 0.02, np.array([25.0]), 2.0
    half, whole = (np.array([[0.0, a * x, b * x, 0.0, 0.0]]) for x in (t / 2, t))
    expected = a * t**2 / 2 + v * b * t**3 / 6
    np.testing.assert_allclose(_path(half, whole, v, t), expected, rtol=1e-12)


def test_shares_are_known_only_where_something_could_be_explained() -> None:
    rng = np.random.default_rng(0)
    noise = 1.0 + 0.02 * rng.standard_normal((400, 3))
    known = share_between(noise * np.array([4.0, 2.0, 1.0]))
    assert known.low < 2.0 / 3.0 < known.high
    assert known.high - known.low < 0.15
    assert str(known).startswith("67 % (")
    # The final model is a function of the driving too, and bounds the ceiling.
    assert share_between(noise * np.array([4.0, 1.0, 2.0])).value == pytest.approx(1.0)
    assert not share_between(noise * np.array([1.0, 1.0, 1.0])).known
    assert str(share_between(noise)) == ""
    assert not share_between(noise * np.array([1.0, 0.99, 0.99]), 0.05).known
    worse = share_between(noise * np.array([2.0, 3.0, 1.0]))
    assert worse.value == pytest.approx(-1.0, abs=0.2)


def test_a_channel_that_was_not_measured_is_left_out(fit: Fit, course: Log) -> None:
    """Without a warning of the arithmetic: here these are errors."""
    blind = {c: np.array(course[c]) for c in course.channels if c != "vy_mps"}
    driving = Driving.of(Log.from_arrays(blind, name="blind"))
    _, errors = _errors(fit, fit.noise.floor(), driving, (0.5,), ())[0]
    known = np.isfinite(errors).any(axis=0)
    assert dict(zip(CHANNELS, known, strict=True)) == {
        "vy_mps": False,
        "yaw_rate_radps": True,
        "ay_mps2": True,
        "path_m": False,
    }
    told = shares(fit, fit, driving, horizons_s=(0.5,))
    assert {row[1] for row in told.rows()} == {"yaw rate", "a_y"}
    assert str(told).startswith("Errors on validation data, with the parameters that predict them")
    assert told.CAPTION in told._repr_html_()
