"""The posterior of what is missing: right sums of evidence, confounded effects in one set."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import pyplot
from scipy.integrate import quad
from scipy.stats import norm

from sysid_vehicle import Fit, Log, Model, Vehicle, diagnose, drive, identify, manoeuvres
from sysid_vehicle.diagnose import Causes, Diagnosis
from sysid_vehicle.diagnose.candidates import confirm
from sysid_vehicle.diagnose.candidates.causes import CredibleSet
from sysid_vehicle.diagnose.candidates.single_effects import Hypothesis, ScoreModel

Hidden = Callable[[str, float], Fit]


def model(
    information: np.ndarray, score: np.ndarray, ratio: float = 1.0, sides: tuple[float, ...] = ()
) -> ScoreModel:
    """One effect for each column."""
    n = len(score)
    signs = sides or (0.0,) * n
    few = tuple(Hypothesis(f"e{i}", (i,), (signs[i],), 1.0) for i in range(n))
    return ScoreModel(few, score, information, np.full(n, ratio), 0.5)


@pytest.mark.parametrize("side", [0.0, 1.0, -1.0])
@pytest.mark.parametrize("ratio", [1.0, 3.0])
def test_evidence_is_the_integral_of_likelihood_times_prior(side: float, ratio: float) -> None:
    score, information = 4.0, 9.0
    m = model(np.array([[information]]), np.array([score]), ratio, (side,))

    def density(x: float) -> float:
        prior = norm.pdf(x) * (1.0 if side == 0.0 else 2.0 * (side * x > 0.0))
        return float(np.exp((score * x - 0.5 * information * x**2) / ratio) * prior)

    odds = quad(density, -8.0, 8.0, points=[0.0])[0]
    assert m.subsets()[0].log_odds == pytest.approx(np.log(odds), abs=1e-6)
    found = m.posterior(1)
    assert found.weights[0, 0] == pytest.approx(odds / (1.0 + odds), abs=1e-6)
    mean = quad(lambda x: x * density(x), -8.0, 8.0, points=[0.0])[0] / odds
    second = quad(lambda x: x**2 * density(x), -8.0, 8.0, points=[0.0])[0] / odds
    assert found.means[0, 0] == pytest.approx(mean, abs=1e-5)
    assert found.stds[0, 0] == pytest.approx(np.sqrt(second - mean**2), abs=1e-5)


def test_what_goes_with_an_effect_is_told_with_both_of_them_free() -> None:
    """Fitted alone it made up for most of the other one; its own score says nothing of that."""
    alike = 0.95
    information = 400.0 * np.array([[1.0, alike, 0.0], [alike, 1.0, 0.0], [0.0, 0.0, 1.0]])
    m = model(information, information @ np.array([-alike, 1.0, 0.2]))
    assert m.score[0] == pytest.approx(0.0, abs=1e-9)
    assert m.beside(("e0",))["e1"] > m.beside(("e0",))["e2"] + 3.0
    assert set(m.beside(("e0",))) == {"e1", "e2"}
    subsets = {s.effects: s.log_odds for s in m.subsets()}
    gain = subsets["e0", "e1"] - subsets["e0",]
    assert m.beside(("e0",))["e1"] == pytest.approx(gain, abs=1e-6)


def test_two_that_hold_only_together_are_found() -> None:
    """Almost the same direction with opposite sizes: each alone explains next to nothing."""
    alike = 0.98
    information = 4000.0 * np.array([[1.0, alike, 0.0], [alike, 1.0, 0.0], [0.0, 0.0, 1.0]])
    m = model(information, information @ np.array([1.0, -1.0, 0.0]))
    leading = m.subsets()[0]
    assert leading.effects == ("e0", "e1")
    alone = {s.effects: s.log_odds for s in m.subsets()}
    assert leading.log_odds > 50.0 > 4.0 > max(alone["e0",], alone["e1",])
    found = m.posterior(3, leading)
    assert found.weights.sum(axis=0) == pytest.approx([1.0, 1.0, 0.0], abs=0.1)


def test_a_complete_model_has_no_cause(rng: np.random.Generator) -> None:
    """Twenty correlated candidates; a set by chance in fewer than one of thirty draws."""
    shared = rng.standard_normal((60, 20)) + 0.7 * rng.standard_normal((60, 1))
    information = 1e4 * shared.T @ shared / 60.0
    root = np.linalg.cholesky(information + 1e-6 * np.eye(20))
    claimed = 0
    for _ in range(60):
        m = model(information, root @ rng.standard_normal(20))
        found = m.posterior(4, m.subsets(2)[0])
        claimed += found.weights.sum(axis=1).max() > 0.95
    assert claimed <= 2


@pytest.fixture(scope="module")
def found(hidden_fit: Hidden) -> Diagnosis:
    return diagnose(hidden_fit("steer_offset.offset_rad", 0.002), refits=0)


def test_the_hidden_effect_is_the_cause(found: Diagnosis) -> None:
    causes = found.causes
    assert next(iter(causes.inclusion)) == "steer_offset"
    assert causes.inclusion["steer_offset"] > 0.99
    assert [s.effects for s in causes.sets] == [("steer_offset",)]
    (value,), (std,) = causes.sizes["steer_offset"]
    assert abs(value - 0.002) < 4.0 * std
    assert causes.subsets[0].effects[:1] == ("steer_offset",)


def test_what_a_large_effect_does_beyond_first_order_is_no_further_cause(
    start: Model, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mass that is 20 % wrong bends the fit: its scores ask for three effects.

    Beside the mass their scores are next to nothing: none of them is refitted.
    """
    heavy = truth.add("mass").with_values({"mass.relative_error": 0.2})
    log = drive(heavy, manoeuvres.lap(30.0), seed=1, rate_hz=50.0)
    some = ["mass", "force_gain", "yaw_inertia", "aero_drag", "steer_lag"]
    found = diagnose(identify(start, log, starts=1), candidates=some)
    assert len(found.proposed.sets) > 1
    tried: list[str] = []
    monkeypatch.setattr(confirm, "refitted", lambda fit, driving, c: tried.append(c.id) or c)
    assert [s.effects for s in found.causes.sets] == [("mass",)]
    assert not tried
    assert found.causes.inclusion["mass"] > 0.99
    assert found.causes.inclusion["yaw_inertia"] < found.proposed.inclusion["yaw_inertia"]
    assert found.causes.sizes["mass"] == found.sizes["mass"]


def test_what_is_scored_over_a_grid_is_refitted_too(
    hidden_fit: Hidden, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`friction_change` has a column for each moment: the sum of effects states no size of it."""
    monkeypatch.setattr(confirm, "_HOPELESS", 0.0)
    some = ["steer_offset", "friction_change"]
    found = diagnose(hidden_fit("steer_offset.offset_rad", 0.002), candidates=some, refits=1)
    grid = CredibleSet(("friction_change",), (1.0,), {"friction_change": 1.0})
    sets = (*found.proposed.sets, grid)
    with_grid = replace(found, proposed=replace(found.proposed, sets=sets))
    assert "friction_change" not in with_grid.proposed.sizes
    causes = confirm.confirmed_causes(with_grid)
    assert causes.sets[0].effects == ("steer_offset",)
    assert str(causes)


def test_two_that_are_missing_both_stand(start: Model, truth: Model) -> None:
    both = {"mass.relative_error": 0.15, "steer_offset.offset_rad": 0.006}
    car = truth.add("mass", "steer_offset").with_values(both)
    log = drive(car, manoeuvres.lap(30.0), seed=2, rate_hz=50.0)
    some = ["mass", "steer_offset", "yaw_inertia", "force_gain"]
    causes = diagnose(identify(start, log, starts=1), candidates=some).causes
    assert {s.effects[0] for s in causes.sets} == {"mass", "steer_offset"}


def test_what_no_candidate_explains_is_unknown(hidden_fit: Hidden) -> None:
    """Mass and drag cannot imitate a biased gyro; a shift of the yaw rate can."""
    fit = hidden_fit("gyro_bias.bias_radps", 0.006)
    causes = diagnose(fit, candidates=["mass", "aero_drag"], refits=0).causes
    assert causes.sets
    assert all(s.effects[0].startswith("unknown ") for s in causes.sets)
    assert max(causes.inclusion["mass"], causes.inclusion["aero_drag"]) < 0.5


def test_unknown_forces_crowd_out_no_subset_that_a_refit_can_try(hidden_fit: Hidden) -> None:
    fit, some = hidden_fit("gyro_bias.bias_radps", 0.006), ["mass", "aero_drag"]
    causes = diagnose(fit, candidates=some, refits=0).causes
    assert not set(causes.subsets[0].effects) <= set(some)
    assert {s.effects for s in causes.known} == {("aero_drag",), ("mass",), ("aero_drag", "mass")}
    odds = [s.log_odds for s in causes.known]
    assert odds == sorted(odds, reverse=True)
    assert causes.known[0].log_odds < causes.subsets[0].log_odds


def test_confounded_effects_share_a_set(hidden_fit: Hidden) -> None:
    """On one lap a head wind is a drag; together they are as probable as one can be."""
    fit = hidden_fit("aero_drag.drag_area_m2", 0.3)
    causes = diagnose(fit, candidates=["aero_drag", "head_wind", "yaw_inertia"], refits=0).causes
    (only,) = causes.sets
    assert causes.of("aero_drag") is only
    assert sum(only.probabilities) >= 0.95
    assert causes.of("yaw_inertia") is None


def test_a_centre_of_gravity_that_is_off_is_one_fact(start: Model, car: Vehicle) -> None:
    """Sensors stay in the body: they do not move with what the vehicle file says of the car."""
    off = {"imu_lever_arm.forward_m": 0.12, "speed_sensor_lever_arm.forward_m": 0.12}
    behind = Model(car.replace(lf_m=car.lf_m + 0.12, lr_m=car.lr_m - 0.12))
    mounted = behind.add(*(n.split(".")[0] for n in off)).with_values(off)
    log = drive(mounted, manoeuvres.lap(30.0), seed=71, rate_hz=50.0)
    fit = identify(start, log, starts=1)
    causes = diagnose(fit, refits=0).causes
    assert [s.effects[0] for s in causes.sets] == ["cg_position"]
    found = identify(fit.model.add("cg_position"), log, starts=1)
    told = found["cg_position.shift_rearward_m"]
    assert abs(told.value - 0.12) < 4.0 * told.std
    assert told.std < 0.01
    assert diagnose(found, refits=0).causes.sets == ()


def test_causes_of_a_log_without_wheel_force(
    hidden_fit: Hidden, start: Model, altered: Callable[..., Log]
) -> None:
    """No clock competes: the steering's is an effect, and that of the force needs the force."""
    (log,) = hidden_fit("steer_offset.offset_rad", 0.002).driving.logs
    fit = identify(start, altered(log, without=["fx_n"]), starts=1)
    causes = diagnose(fit, candidates=["steer_offset", "steer_delay"], refits=0).causes
    assert next(iter(causes.inclusion)) == "steer_offset"


def test_the_clock_of_the_steering_has_a_sign(start: Model, truth: Model) -> None:
    log = drive(truth, manoeuvres.step_steer((20.0,), (3.0, 5.0)), seed=5, rate_hz=50.0)
    t = log["time_s"]
    # The log tells 30 ms too late what the wheels do: the car answers before.
    late = np.interp(t - 0.03, t, log["steer_rad"])
    shifted = Log.from_arrays({**{c: log[c] for c in log.channels}, "steer_rad": late})
    fit = identify(start, shifted, starts=1)
    causes = diagnose(fit, refits=0).causes
    assert next(iter(causes.inclusion)) == "steer_delay"
    (value,), (std,) = causes.sizes["steer_delay"]
    assert abs(value + 0.03) < 0.01  # by the slope of steps, to first order
    assert std < 0.003
    found = identify(fit.model.add("steer_delay"), shifted, starts=1)["steer_delay.delay_s"]
    assert abs(found.value + 0.03) < 4.0 * found.std
    assert found.std < 0.001


def test_it_prints_and_draws(found: Diagnosis) -> None:
    causes = found.causes
    assert str(causes).startswith("1 effect: steer_offset (100 %)")
    for text in (str(causes), causes._repr_html_()):
        assert "offset_rad 0.00" in text
    told = json.loads(json.dumps(causes.to_dict()))
    assert told["sets"][0]["effects"] == ["steer_offset"]
    assert told["sizes"]["steer_offset"]["offset_rad"]["unit"] == "rad"
    ax = pyplot.subplots()[1]
    assert causes.plot(ax, most=5, grades={"steer_offset": "confirmed"}) is ax
    assert [bar.get_width() for bar in ax.patches] == [
        p for _, p in sorted(causes.inclusion.items(), key=lambda k: -k[1])[:1]
    ] + [bar.get_width() for bar in ax.patches[1:]]
    assert len(ax.patches) == 5
    assert any("confirmed" in t.get_text() for t in ax.texts)
    assert causes.plot() is not ax
    assert str(Causes({}, (), {})).startswith("no effect is shown to be missing")


def test_what_is_in_no_set_is_as_probable_as_beside_those_that_stand(car: Vehicle) -> None:
    """A mass that is wrong by a third bends the scores: a body that leans looked likely, too."""
    heavy = Model(car).add("mass").with_values({"mass.relative_error": 0.3})
    log = drive(heavy, manoeuvres.brake_in_turn(), seed=248527, rate_hz=50.0)
    found = diagnose(identify(Model(car), log, starts=1))
    causes = found.causes
    assert [s.effects for s in causes.sets] == [("mass",)]
    others = {e: p for e, p in causes.inclusion.items() if e != "mass"}
    assert max(found.proposed.rest.values()) > 0.3
    assert max(others.values()) < 0.15
