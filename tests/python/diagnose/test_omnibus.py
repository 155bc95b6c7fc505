"""Whether anything is left that depends on the driving."""

from collections.abc import Callable

import numpy as np
import pytest

from sysid_vehicle import (
    Driving,
    Fit,
    Log,
    Model,
    RoadDisturbance,
    SensorNoise,
    drive,
    identify,
    manoeuvres,
)
from sysid_vehicle.diagnose import Omnibus, instead, omnibus
from sysid_vehicle.diagnose.evidence.evidence import Evidence
from sysid_vehicle.diagnose.unexplained.omnibus import Unknown
from sysid_vehicle.identify import refine


def test_nothing_is_left_of_a_complete_model(complete_fits: tuple[Fit, ...]) -> None:
    found = [omnibus(f, f.driving) for f in complete_fits]
    p_values = [o.p_value for o in found]
    assert min(p_values) > 0.001
    assert max(p_values) > 0.05
    for o in found:
        # Mean and standard deviation of a chi-squared variable.
        assert abs(o.statistic - o.degrees) < 4.0 * np.sqrt(2.0 * o.degrees)


@pytest.mark.parametrize(
    ("name", "value", "shown_by"),
    [
        ("aero_drag.drag_area_m2", 0.45, {"F_x", "dv_x/dt"}),
        ("steer_offset.offset_rad", 0.006, {"F_y", "M_z", "dv_y/dt"}),
        ("gyro_bias.bias_radps", 0.01, {"r", "M_z", "dv_y/dt"}),
    ],
)
def test_a_hidden_effect_is_left(
    name: str, value: float, shown_by: set[str], hidden_fit: Callable[[str, float], Fit]
) -> None:
    fit = hidden_fit(name, value)
    before = omnibus(fit, fit.driving)
    assert before.p_value < 1e-6
    assert before.strongest in shown_by
    added = fit.model.add(name.split(".")[0]).with_values({name: 0.8 * value})
    after = refine(added, fit.driving, fit.noise.floor())
    assert omnibus(after, after.driving).p_value > 0.001


@pytest.mark.filterwarnings("ignore:.*no values at:sysid_vehicle.SysidWarning")
def test_a_gap_inside_a_log_is_no_turn_of_the_wheel(truth: Model) -> None:
    """What was known before a gap says nothing of what comes after it."""
    log = drive(truth, manoeuvres.lap(20.0), seed=3, rate_hz=50.0)
    columns = {c: log[c].copy() for c in log.channels}
    turned = int(np.argmax(np.abs(log["steer_rad"])))
    columns["steer_rad"][turned - 100 : turned] = np.nan
    gap = Log.from_arrays(columns, name="gap", check=False)
    evidence = Evidence(identify(truth, gap, starts=1), Driving.of(gap))
    assert len(evidence.driving.stretches) == 2
    first = turned - 100
    (section,) = evidence.sections()
    signals = Unknown(evidence).signals(evidence.problem, section.where)
    assert not signals[first].any(), "nothing was known yet"
    turn = signals[:, 11]  # of the first target: the last of its shapes
    assert turn[first + 1] == 0.0, "the jump over the gap"
    assert np.abs(turn[first + 2 :]).max() > 0.0


def test_it_speaks_plainly() -> None:
    assert str(Omnibus(40.0, 40, 0.47, "r")) == (
        "no remaining error that depends on the driving is shown (p = 0.47)"
    )
    assert str(Omnibus(400.0, 40, 1e-9, "F_x")) == (
        "an error that depends on the driving remains, mostly in F_x (p = 1e-09)"
    )


@pytest.mark.parametrize("seed", [7, 8])
def test_a_driver_who_knows_the_speed_better_than_its_sensor_leaves_nothing(
    seed: int, truth: Model
) -> None:
    """The pull answers slopes before the sensor shows what they do to the speed."""
    road = manoeuvres.Manoeuvre(
        *("road", "slopes and bends", 200.0),
        *(lambda t: 20.0 + 4.0 * np.sin(0.1 * t), lambda t: 4.0 * np.sin(0.35 * t) ** 3),
        tracks_path=True,
    )
    slopes, noise = RoadDisturbance(slope_rad=0.03), SensorNoise(vx_mps=0.1)
    log = drive(truth, road, seed=seed, rate_hz=50.0, disturbance=slopes, noise=noise)
    fit = identify(truth, log, starts=1)
    assert omnibus(fit, fit.driving).p_value > 0.01
    assert instead(fit, fit.driving, ()).omnibus.p_value > 0.01


def test_noise_of_the_last_moments_is_in_no_signal(fit: Fit) -> None:
    """Noise of sensors that lasts for some samples enters the errors that signals are to tell."""
    log = fit.driving.logs[0]
    columns = {c: log[c].copy() for c in log.channels}
    k = log.n // 2
    few = max(round(0.1 * log.rate_hz), 1)
    columns["yaw_rate_radps"][k - few : k] += 0.02
    columns["ay_mps2"][k - few : k] += 1.0
    disturbed = Driving.of(Log.from_arrays(columns, name=log.name, check=False))
    seen = []
    for driving in (Driving.of(log), disturbed):
        evidence = Evidence(fit, driving)
        unknown = Unknown(evidence)
        problem = next(evidence.sections()).evidence.problem
        seen.append((evidence.filtered[k], np.array(unknown.foreseen(problem))[:, k]))
    (filtered, foreseen), (other_filtered, other_foreseen) = seen
    assert abs(filtered[2] - other_filtered[2]) > 1e-3
    np.testing.assert_array_equal(foreseen, other_foreseen)
