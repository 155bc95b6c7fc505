"""Parameters fitted to predictions of seconds, beside those of the one-step likelihood."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import (
    ChannelMap,
    Fit,
    InvalidInput,
    Log,
    Model,
    RoadDisturbance,
    Vehicle,
    diagnose,
    drive,
    example_vehicle,
    identify,
    manoeuvres,
    read_log,
)
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import predicting_ahead
from sysid_vehicle.rules import USUAL, ErrorChange
from sysid_vehicle.study.ahead.horizons import changes, typical_error
from sysid_vehicle.study.ahead.waterfall import look_ahead
from sysid_vehicle.study.results.predicting import Predicting

STIFFNESS = ("cornering stiffness front", "cornering stiffness rear")


@pytest.fixture(scope="module")
def ahead(fit: Fit) -> Fit:
    """The complete model fitted to predictions."""
    return predicting_ahead(fit)


def test_of_the_right_model_both_criteria_tell_the_same_car(
    fit: Fit, ahead: Fit, truth: Model
) -> None:
    true = fit.values_of(truth)
    for name in STIFFNESS:
        assert ahead[name].value == pytest.approx(true[name], abs=4.0 * ahead[name].std)
        assert ahead[name].value == pytest.approx(true[name], rel=0.02)
        # The likelihood uses all that there is to be known.
        assert 0.7 * fit[name].std < ahead[name].std < 5.0 * fit[name].std
    assert ahead.log_likelihood <= fit.log_likelihood
    assert ahead.horizon_s == 2.0
    assert "fitted to 2 s ahead" in str(ahead)
    assert "ahead" not in str(fit)


def test_tyres_that_the_likelihood_bends_do_not_hold_the_search_back(
    hidden_fit: Callable[..., Fit],
) -> None:
    """From such a shape alone it ends where the car errs 1 % more."""
    fit = hidden_fit("tyre_relaxation.relaxation_length_m", 0.6, 100.0)
    front = {"B_front": 7.0, "C_front": 0.5, "D_front": 2.2, "E_front": 0.4}
    rear = {"B_rear": 25.0, "C_rear": 0.5, "D_rear": 2.4, "E_rear": -6.0}
    bent = replace(fit, model=fit.model.with_values(front | rear))
    errors = [
        typical_error(predicting_ahead(f), fit.noise.floor(), fit.driving, (2.0,))
        for f in (fit, bent)
    ]
    assert errors[1] == pytest.approx(errors[0], abs=1e-3)


def test_standard_errors_are_those_of_repeated_drives(complete_fits: tuple[Fit, ...]) -> None:
    fits = [predicting_ahead(f) for f in complete_fits]
    for name in STIFFNESS:
        scatter = np.std([f[name].value for f in fits], ddof=1)
        # Chi-square with three degrees of freedom: between the quantiles of 0.1 and 99.9 %.
        share = 3.0 * scatter**2 / np.mean([f[name].std ** 2 for f in fits])
        assert 0.02 < share < 16.3


def test_a_driver_who_answers_slopes_hides_no_force() -> None:
    """The force is there with each slope: the car seemed 28 % heavier, and is 20."""
    hilly_road = manoeuvres.Manoeuvre(
        *("road", "slopes and bends", 100.0),
        *(lambda t: 20.0 + 4.0 * np.sin(0.1 * t), lambda t: 4.0 * np.sin(0.35 * t) ** 3),
        tracks_path=True,
    )
    name, slopes = "mass.relative_error", RoadDisturbance(slope_rad=0.026)
    car = Model(example_vehicle()).add("mass").with_values({name: 0.2})
    log = drive(car, hilly_road, seed=4, rate_hz=50.0, disturbance=slopes)
    one_step = identify(car, log, starts=1)
    found = predicting_ahead(one_step, 5.0)[name]
    assert found.value == pytest.approx(0.2, abs=min(0.03, 3.0 * found.std))
    # What grades are smoothed with is known no better than that; a crossfall, of which windows do
    # not know, is noise to them.
    assert one_step[name].std < found.std < 0.02


def test_a_car_of_another_simulator_is_predicted_better(shared_data: Path, repo: Path) -> None:
    folder = repo / "benchmarks" / "real_driving"
    channels = ChannelMap.from_toml(folder / "carsim_like_handling.channels.toml")
    car = Vehicle.from_toml(folder / "carsim_like_handling.vehicle.toml")
    log = read_log(shared_data / "carsim_like_handling" / "handling_course.csv", channels)
    columns = {c: np.array(log[c]) for c in log.channels if c != "fx_n"}  # it comes late
    log = Log.from_arrays(columns, name=log.name, check=False)
    fit = identify(Model(car), log.between(35.0, 75.0), starts=1)
    other = Driving.of(log.between(75.0, 1e9))
    for found in changes(fit, predicting_ahead(fit), other, (2.0,)):
        assert found.log_ratio < np.log(0.5)
        assert found.log_ratio < -3.0 * found.error


def test_a_window_counts_alike_at_any_rate(truth: Model, start: Model) -> None:
    gripping = truth.with_values({"B_front": 1.4 * truth.value("B_front")})
    logs = [drive(car, manoeuvres.lap(20.0), seed=61) for car in (truth, gripping)]
    coarse = [
        Log.from_arrays({c: log[c][::5] for c in log.channels if log.has(c)}, name=log.name)
        for log in logs
    ]
    found = [
        identify(start, pair, starts=1, horizon_s=2.0)[STIFFNESS[0]].value
        for pair in ((logs[0], coarse[1]), (coarse[0], logs[1]))
    ]
    alone = [identify(start, log, starts=1, horizon_s=2.0)[STIFFNESS[0]].value for log in logs]
    assert abs(found[1] - found[0]) < 0.15 * abs(alone[1] - alone[0])


def test_what_is_fixed_or_known_beforehand_stays(
    start: Model, fine_lap: Log, fine_fit: Fit
) -> None:
    lap, fit = fine_lap, fine_fit
    held = identify(
        fit.model, lap, starts=1, horizon_s=1.0, fixed=["E_front"], priors={"D_rear": (1.3, 1e-4)}
    )
    assert held.model.value("E_front") == fit.model.value("E_front")
    assert held["D_rear"].value == pytest.approx(1.3, abs=5e-4)
    assert held["D_rear"].std < 2e-4
    assert held.horizon_s == 1.0


def test_without_lateral_speed_windows_begin_with_the_smoothed_one(fit: Fit, altered) -> None:
    log = altered(fit.driving.logs[0], without=["vy_mps"])
    blind = predicting_ahead(identify(fit.model, log, starts=1))
    for name in STIFFNESS:
        assert blind[name].value == pytest.approx(fit[name].value, rel=0.05)


def test_a_channel_that_shakes_decides_little(fit: Fit, start: Model, altered) -> None:
    """Vibration of 4 m/s2 in a_y, and a yaw rate that tells another stiffness than a_y does."""
    log = fit.driving.logs[0].between(0.0, 20.0)
    noise = np.random.default_rng(3).standard_normal(log.n)
    shaken = altered(log, ay_mps2=1.2 * log["ay_mps2"] + 4.0 * noise)
    calm = altered(log, ay_mps2=1.2 * log["ay_mps2"])
    off = {}
    for name, driven in (("shaken", shaken), ("calm", calm)):
        ahead = predicting_ahead(identify(start, driven, starts=1))
        own = look_ahead(ahead, fit.noise.floor(), fit.driving, 2.0, apart=0.1)[:, 2]
        off[name] = float(np.sqrt(np.nanmean(own**2)))
    assert off["shaken"] < 0.7 * off["calm"]


def test_what_cannot_be_asked_is_refused(fit: Fit, ahead: Fit, lap: Log, start: Model) -> None:
    with pytest.raises(InvalidInput, match="horizon_s = 100: no stretch"):
        predicting_ahead(fit, 100.0)
    with pytest.raises(InvalidInput, match=r"horizon_s = -1\.0: give a time above zero"):
        predicting_ahead(fit, -1.0)
    with pytest.raises(InvalidInput, match="profile intervals are of the likelihood"):
        identify(start, lap, horizon_s=2.0, intervals="profile")
    with pytest.raises(InvalidInput, match="2 s ahead, and evidence is of the likelihood"):
        diagnose(ahead)


def _said(better: float, needed: float | None, fit: Fit) -> Predicting:
    def change(log_ratio: float) -> tuple[ErrorChange, ...]:
        return (ErrorChange("vy_mps", 2.0, log_ratio, 0.05),)

    from sysid_vehicle.study.ahead.horizons import horizons

    errors = horizons([fit, fit], ["one step", "2 s ahead"], fit.driving, (2.0,))
    more = () if needed is None else change(needed)
    return Predicting(fit, fit, 2.0, change(better), more, errors, USUAL)


def test_it_is_said_what_predicts_better_and_what_is_not_needed(fit: Fit) -> None:
    assert str(_said(-0.05, None, fit)) == ""
    assert "has smaller errors there" in str(_said(-0.5, None, fit))
    assert "not needed" not in str(_said(-0.5, -0.5, fit))
    assert "not needed" in str(_said(-0.5, 0.0, fit))
    # One error that grows is no help.
    both = replace(_said(-0.5, None, fit))
    grown = replace(both, better=(*both.better, ErrorChange("yaw_rate_radps", 2.0, 0.5, 0.05)))
    assert str(grown) == ""
