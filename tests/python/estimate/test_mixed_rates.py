"""Runs of one car at several sampling rates are used together, each at its own."""

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, drive, identify, improve, manoeuvres, where
from sysid_vehicle.diagnose.evidence.coordinates import begins, blocks, late, running_time
from sysid_vehicle.diagnose.evidence.evidence import Evidence
from sysid_vehicle.diagnose.unexplained.coherence import coherence
from sysid_vehicle.diagnose.unexplained.force_map import _means, _places
from sysid_vehicle.estimate import Driving
from sysid_vehicle.report.excerpt import worst_excerpt
from sysid_vehicle.study import look_ahead

RATES = 50.0, 20.0


@pytest.fixture(scope="module")
def logs(truth: Model) -> list[Log]:
    car = truth.add("tyre_load_sensitivity").with_values(
        {"tyre_load_sensitivity.sensitivity": 0.25}
    )
    return [drive(car, manoeuvres.lap(25.0), seed=i, rate_hz=r) for i, r in enumerate(RATES)]


@pytest.fixture(scope="module")
def baseline(start: Model, logs: list[Log]) -> Fit:
    return identify(start, logs, starts=1)


def test_each_sample_has_the_rate_of_its_log(logs: list[Log]) -> None:
    driving = Driving.of(logs)
    np.testing.assert_array_equal(
        driving.sample_rate_hz, np.where(driving.log_number == 0.0, *RATES)
    )
    assert driving.mean_rate_hz == pytest.approx(driving.samples / driving.usable_s)
    assert running_time(driving)[-1] == pytest.approx(driving.usable_s)


@pytest.mark.parametrize("order", [1, -1])
def test_blocks_last_as_long_in_every_log(logs: list[Log], order: int) -> None:
    driving = Driving.of(logs[::order])
    starts = blocks(driving, 2.0)
    seconds = np.add.reduceat(1.0 / driving.sample_rate_hz, starts)
    np.testing.assert_allclose(seconds[:-1], 2.0, atol=0.051)


def test_a_horizon_is_as_far_ahead_in_every_log(baseline: Fit, logs: list[Log]) -> None:
    driving = Driving.of(logs)
    together = look_ahead(baseline, baseline.noise, driving, 0.5)
    apart = [look_ahead(baseline, baseline.noise, Driving.of(log), 0.5) for log in logs]
    np.testing.assert_allclose(together, np.vstack(apart), rtol=1e-9, atol=1e-12)
    for e, rate in zip(apart, RATES, strict=True):
        assert np.flatnonzero(np.isfinite(e[:, 0]))[0] == round(0.5 * rate)


def test_coherence_uses_every_log(baseline: Fit, logs: list[Log]) -> None:
    """The second log alone tells of 2 Hz: it has to be heard beside the first."""
    found = coherence(Evidence(baseline, Driving.of(logs)), delays=False)[0]
    one = coherence(Evidence(baseline, Driving.of(logs[0])), delays=False)[0]
    np.testing.assert_allclose(found.frequency_hz, one.frequency_hz)
    assert found.threshold < one.threshold, "more windows tell finer"


def test_neighbours_of_a_coarse_log_lie_further_apart(
    logs: list[Log], rng: np.random.Generator
) -> None:
    driving = Driving.of(logs)
    place, _ = _places(driving)
    steps = np.diff(place)
    own = driving.log_number[1:] == driving.log_number[:-1]
    first = driving.log_number[1:] == 0.0
    assert set(steps[own & first]) == {1}
    assert set(steps[own & ~first]) <= {2, 3}
    # The error of a mean of a wandering signal is that of its correlation time, not of samples.
    t = np.concatenate([running_time(Driving.of(log)) for log in logs])
    z = []
    for _ in range(200):
        parts = []
        for i, rate in enumerate(RATES):
            n = int((driving.log_number == float(i)).sum())
            keep = np.exp(-1.0 / (0.2 * rate))
            x = np.zeros(n)
            w = rng.standard_normal(n) * np.sqrt(1.0 - keep**2)
            x[0] = rng.standard_normal()
            for k in range(1, n):
                x[k] = keep * x[k - 1] + w[k]
            parts.append(x)
        x = np.concatenate(parts)
        mean, std, _window = _means(driving, np.zeros(len(t), dtype=np.intp), np.array([len(t)]), x)
        z.append(float(mean[0] / std[0]))
    assert 0.8 < np.std(z) < 1.35


def test_an_effect_is_found_in_logs_of_several_rates(
    start: Model, truth: Model, logs: list[Log]
) -> None:
    car = truth.add("tyre_load_sensitivity").with_values(
        {"tyre_load_sensitivity.sensitivity": 0.25}
    )
    test = [
        drive(car, manoeuvres.handling_course(25.0), seed=i, rate_hz=r)
        for i, r in enumerate(RATES[::-1], 10)
    ]
    few = ["tyre_load_sensitivity", "steer_lag", "mass"]
    study = improve(start, logs, test, starts=1, candidates=few, sensors=False)
    assert study.verdict == "explained"
    assert [a.id for a in study.added] == ["tyre_load_sensitivity"]
    found = study.fit["tyre_load_sensitivity.sensitivity"]
    assert abs(found.value - 0.25) < 4.0 * found.std
    falls = study.waterfall((0.5, 2.0))
    np.testing.assert_allclose(falls.test[-1], 1.0, atol=0.1)
    excerpt = worst_excerpt(study)
    assert excerpt is not None
    final = where(study.fit)
    assert final.change_points == ()
    assert not any(c.delay is not None and c.delay.significant for c in final.coherence)
    assert final.best_map.share < 0.05


@pytest.mark.filterwarnings("ignore:.*no values at:sysid_vehicle.SysidWarning")
def test_what_lies_between_stretches_is_no_step(truth: Model) -> None:
    log = drive(truth, manoeuvres.lap(20.0), seed=3, rate_hz=50.0)
    columns = {c: log[c].copy() for c in log.channels}
    columns["steer_rad"][400:460] = np.nan
    driving = Driving.of(Log.from_arrays(columns, name="gap", check=False))
    first = begins(driving)
    assert list(first) == [0, 400]
    signal = np.arange(float(driving.samples))
    moved = late(signal, first)
    assert list(moved[first]) == [0.0, 0.0]
    both = late(np.column_stack([signal, signal]), first)
    np.testing.assert_array_equal(both[:, 1], moved)
    np.testing.assert_array_equal(moved[1:400], signal[:399])
