"""Calibration behind ask and tell, the double track beside it, the experiments as one call."""

from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, NumericalError
from sysid_vehicle.published import (
    DoubleTrackObserver,
    estimate_mass,
    estimate_pitch,
    estimate_roll_yaw,
    sideslip_and_mass_cost,
)
from sysid_vehicle.twin import (
    LOADED_SUV,
    READINGS,
    SPORTS_CAR,
    BayesianSearch,
    Box,
    Calibration,
    Optimiser,
    calibrate,
    measure,
    urban_cycle,
)

BOX = Box({"a": (0.01, 100.0), "b": (-1.0, 1.0)})


def bowl(gains: dict[str, float]) -> float:
    """Least, 0.01, at a = 3, b = 0.5; where b is far too small the twin is lost."""
    if gains["b"] < -0.8:
        raise NumericalError("lost")
    return 0.01 + np.log10(gains["a"] / 3.0) ** 2 + (gains["b"] - 0.5) ** 2


class Dice:
    """Ten lines make an optimiser: here, one that throws dice."""

    def __init__(self) -> None:
        self.random = np.random.default_rng(3)
        self.told: list[float] = []

    def ask(self) -> np.ndarray:
        return self.random.uniform(size=2)

    def tell(self, place: np.ndarray, cost: float) -> None:
        self.told.append(cost)


def test_any_optimiser_plugs_in() -> None:
    dice = Dice()
    assert isinstance(dice, Optimiser)
    heard: list[float] = []
    found = calibrate(bowl, BOX, trials=60, optimiser=dice, tell=lambda i, best: heard.append(best))
    assert isinstance(found, Calibration)
    assert found.cost == min(c for _, c in found.tried)
    assert found.lost > 0
    # What was lost is told as dearer than all that was not.
    assert max(dice.told) >= 10.0 * max(c for _, c in found.tried if np.isfinite(c)) * 0.3
    assert heard == sorted(heard, reverse=True)
    assert "trials" in str(found)
    assert found.plot().get_ylabel() == "cost"


@pytest.mark.skipif(find_spec("bayes_opt") is None, reason="bayesian-optimization not installed")
def test_bayesian_search_finds_the_bowl_sooner_than_dice() -> None:
    found = calibrate(bowl, BOX, trials=16, optimiser=BayesianSearch(2, first=8, seed=1))
    dice = calibrate(bowl, BOX, trials=16, optimiser=Dice())
    assert found.cost < 0.05
    assert found.cost < dice.cost
    again = calibrate(bowl, BOX, trials=10, optimiser=BayesianSearch(2, first=8, seed=1))
    assert again.tried == found.tried[:10]


def test_a_calibration_that_cannot_work_is_said() -> None:
    def always(gains: dict[str, float]) -> float:
        raise NumericalError("lost")

    with pytest.raises(NumericalError, match="all 3 trials"):
        calibrate(always, BOX, trials=3, optimiser=Dice())
    with pytest.raises(InvalidInput, match="trials = 0"):
        calibrate(bowl, BOX, trials=0, optimiser=Dice())
    with pytest.raises(InvalidInput, match="the range 2"):
        Box({"a": (2.0, 1.0)})


def test_the_cost_is_that_of_equation_26() -> None:
    drive = urban_cycle(SPORTS_CAR, duration_s=12.0)
    slip = drive["sideslip_rad"] + np.radians(0.2)
    mass = np.full(len(slip), 1400.0)
    mass[:1000] = 0.0  # earlier than the last ten seconds
    assert sideslip_and_mass_cost(slip, mass, drive, 1393.0) == pytest.approx(2.0 + 7.0)


def test_the_double_track_follows_a_calm_drive() -> None:
    drive = urban_cycle(SPORTS_CAR, duration_s=25.0)
    readings = measure(drive, READINGS[:10])
    run = DoubleTrackObserver(SPORTS_CAR, yaw_yaw_ps=5.0, ax_mass=0.0).run(
        drive.inputs, readings, speed_mps=float(drive["vx_mps"][0]), mass_error_kg=0.0
    )
    assert np.std(run.vx_mps - drive["vx_mps"]) < 0.1
    assert np.corrcoef(run.sideslip_rad, drive["sideslip_rad"])[0, 1] > 0.98
    few = measure(drive, ["ax_mps2"])
    with pytest.raises(InvalidInput, match="'ay_mps2'"):
        DoubleTrackObserver(SPORTS_CAR).run(drive.inputs, few, speed_mps=10.0, mass_error_kg=0.0)


@pytest.mark.parametrize("law", ["side_by_side", "published", "gradient"])
def test_the_mass_is_found_from_either_side(law: str) -> None:
    for first in (-1.0, 0.8):
        done = estimate_mass(law=law, first_error=[first], duration_s=60.0)  # type: ignore[arg-type]
        assert done.error_percent("mass_kg") < 10.0
        parameters = done.to_dict()["parameters"]["mass_kg"]
        assert parameters["found"] == pytest.approx(LOADED_SUV.mass_kg, rel=0.02)
    assert "% of the change" in str(done)
    with pytest.raises(InvalidInput, match="first_error has 2"):
        estimate_mass(first_error=[0.0, 1.0])


def test_inertia_is_found_though_mass_and_centre_of_mass_are_wrong() -> None:
    done = estimate_roll_yaw(mass="wrong", wrong_cg=True, repeats=1)
    assert done.error_percent("jxx_kgm2") < 10.0
    assert done.error_percent("jzz_kgm2") < 10.0
    done = estimate_pitch(mass="wrong", wrong_cg=True, road_noise=0.1, duration_s=30.0, seed=2)
    assert done.error_percent("jyy_kgm2") < 6.0


def noisy(gains: dict[str, float], seed: int) -> float:
    """A bowl of least 0.3 at 3 and 0.5 under noise that a trial can be lucky with."""
    place = int(1e6 * (gains["a"] + 3.0 * gains["b"])) % 2**31
    luck = np.random.default_rng([seed, place]).standard_normal()
    deep = 0.3 + np.log10(gains["a"] / 3.0) ** 2 + (gains["b"] - 0.5) ** 2
    return float(deep * np.exp(0.3 * luck))


@pytest.mark.skipif(find_spec("bayes_opt") is None, reason="bayesian-optimization not installed")
def test_the_best_trial_is_lucky_and_the_best_predicted_is_judged_beside_it() -> None:
    fresh = [partial(noisy, seed=100 + k) for k in range(20)]
    lucky = []
    for seed in range(4):
        found = calibrate(partial(noisy, seed=seed), BOX, trials=25, seed=seed, fresh=fresh)
        observed, predicted = found.candidates
        assert (observed.how, predicted.how) == ("observed", "predicted")
        assert observed.cost == min(c for _, c in found.tried)
        assert len(observed.fresh) == len(predicted.fresh) == 20
        assert found.gains == min(found.candidates, key=lambda c: c.fresh_mean).gains
        lucky.append(observed.fresh_mean / observed.cost)
        assert "best observed: cost" in str(found)
        assert "best predicted: cost" in str(found)
        assert str(found).count(", taken") == 1
    assert np.median(lucky) > 1.1


@pytest.mark.skipif(find_spec("bayes_opt") is None, reason="bayesian-optimization not installed")
def test_the_posterior_mean_sees_through_noise_that_the_best_trial_owes_its_place_to() -> None:
    def deep(place: np.ndarray) -> float:
        return float(0.3 + (4.0 * place[0] - 2.5) ** 2 + (2.0 * place[1] - 1.5) ** 2)

    observed, predicted = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        search = BayesianSearch(2, first=60, seed=seed)
        best = (np.inf, np.zeros(2))
        for place in rng.uniform(size=(60, 2)):
            cost = deep(place) * np.exp(0.3 * rng.standard_normal())
            search.tell(place, cost)
            best = min(best, (cost, place), key=lambda b: b[0])
        place, mean = search.best_predicted()
        assert np.all((place >= 0.0) & (place <= 1.0))
        assert mean == pytest.approx(deep(place), rel=0.6)
        observed.append(deep(best[1]) - 0.3)
        predicted.append(deep(place) - 0.3)
    assert np.mean(predicted) < 0.8 * np.mean(observed)


def test_without_a_model_or_fresh_seeds_the_best_trial_stands() -> None:
    found = calibrate(bowl, BOX, trials=30, optimiser=Dice())
    assert [c.how for c in found.candidates] == ["observed"]
    assert found.gains == found.candidates[0].gains
    assert np.isnan(found.candidates[0].fresh_mean)
