"""Parameters and noise come back from drives of a known car."""

import re
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from sysid_vehicle import (
    Fit,
    InvalidInput,
    Log,
    Model,
    NoiseModel,
    SensorNoise,
    SysidWarning,
    Tyre,
    Vehicle,
    drive,
    identify,
    manoeuvres,
)
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import METHODS, refine, refit
from sysid_vehicle.identify.search.search import Box, minimise

G = 9.80665
WHATS = ("cornering stiffness", "peak friction", "slip at the peak")
SPREAD = 4.0  # standard errors


def true_stiffness(car: Vehicle) -> tuple[float, float]:
    per_metre = car.mass_kg * G / car.wheelbase_m
    return (
        car.tyre_front.cornering_stiffness_per_load * per_metre * car.lr_m,
        car.tyre_rear.cornering_stiffness_per_load * per_metre * car.lf_m,
    )


def assert_stiffness_found(found: Fit, car: Vehicle) -> None:
    stiffness = [e for e in found.derived if e.name.startswith("cornering stiffness")]
    for estimate, true in zip(stiffness, true_stiffness(car), strict=True):
        assert abs(estimate.value - true) < SPREAD * estimate.std
        assert 0.0 < estimate.std < 0.1 * true


def test_derived_quantities_are_found_by_name(fit: Fit) -> None:
    for axle in ("front", "rear"):
        b, c, d, e = (fit.model.value(f"{letter}_{axle}") for letter in "BCDE")
        assert fit[f"cornering stiffness {axle}"] == fit[f"cornering_stiffness_{axle}"]
        assert fit[f"peak friction {axle}"].value == pytest.approx(d * min(1.0, c))
        slip = fit[f"slip_at_the_peak_{axle}"]
        low, high = slip.interval
        assert low < slip.value < high
        # No slip angle gives more force than that of the peak.
        x = b * np.linspace(0.0, 3.0, 200001)
        curve = np.sin(c * np.arctan(x - e * (x - np.arctan(x))))
        assert slip.value == pytest.approx(x[int(np.argmax(curve))] / b, abs=3e-5)
    assert {f"{what} {axle}" for what in WHATS for axle in ("front", "rear")} <= {
        line.split("  ")[1].strip() for line in str(fit).splitlines() if line.startswith("  ")
    }
    with pytest.raises(KeyError, match="there are"):
        fit["cornering stiffness middle"]


def test_a_meaning_whose_interval_reaches_nothing_is_not_determined(fit: Fit) -> None:
    assert fit["cornering stiffness front"].note == ""
    vague = replace(fit, covariance=1e6 * fit.covariance)
    assert vague["cornering stiffness front"].note == "not determined"
    assert vague["cornering stiffness front"].value == fit["cornering stiffness front"].value


def test_what_a_fit_means_is_worked_out_for_a_car_without_its_effects(
    fit: Fit, truth: Model
) -> None:
    """A demonstration sets the true car beside a model that has a wrong effect."""
    with_effect = refine(fit.model.add("steer_offset"), fit.driving, fit.noise)
    found = with_effect.values_of(truth)
    assert list(found) == [e.name for e in fit.derived]
    front, rear = true_stiffness(truth.vehicle)
    assert found["cornering stiffness front"] == pytest.approx(front)
    assert found["cornering stiffness rear"] == pytest.approx(rear)


def test_nuisances_cost_next_to_no_information(fit: Fit) -> None:
    found = refine(fit.model.with_nuisances(), fit.driving, fit.noise)
    base = [i for i, e in enumerate(found.estimates) if "." not in e.name]
    information = np.linalg.inv(found.covariance)
    alone = np.linalg.inv(information[np.ix_(base, base)])
    wider = np.sqrt(np.diag(found.covariance)[base] / np.diag(alone))
    assert np.all((wider > 1.0) & (wider < 1.05))
    for name, (mean, std) in found.model.priors.items():
        assert found[name].std < std  # the driving has told of each
        assert abs(found[name].value - mean) < SPREAD * found[name].std


def test_the_cornering_stiffness_is_found(fit: Fit, car: Vehicle, start: Model) -> None:
    assert fit.converged
    assert_stiffness_found(fit, car)
    front = fit.derived[0]
    begun = start.value("B_front") * start.value("C_front") * start.value("D_front")
    # The start lies outside what the estimate allows, or the test would tell nothing.
    assert abs(begun / car.tyre_front.cornering_stiffness_per_load - 1.0) * front.value > (
        SPREAD * front.std
    )


def test_every_determined_tyre_coefficient_is_found(fit: Fit, truth: Model) -> None:
    determined = [e for e in fit.estimates if not e.note]
    assert len(determined) >= 3
    for e in determined:
        assert abs(e.value - truth.value(e.name)) < SPREAD * e.std


def test_the_noise_is_found(fit: Fit) -> None:
    true = SensorNoise()
    for found, field in zip(fit.noise.sensor, fields(true)[:5], strict=True):
        assert found == pytest.approx(getattr(true, field.name), rel=0.15), field.name


def test_residuals_are_white(fit: Fit) -> None:
    problem, p = fit.driving.problem(fit.model), fit.model.vector()
    e = problem.residuals(p, problem.freeze(p, fit.noise.vector()))
    n = len(e)
    together = np.sum(e[1:] * e[:-1], axis=0) / np.sum(e**2, axis=0)
    assert np.abs(together).max() < SPREAD / np.sqrt(n)
    assert np.abs(e.var(axis=0) - 1.0).max() < SPREAD * np.sqrt(2.0 / n)
    assert np.abs(e.mean(axis=0)).max() < SPREAD / np.sqrt(n)
    across = np.corrcoef(e.T)[np.triu_indices(5, 1)]
    assert np.abs(across).max() < SPREAD / np.sqrt(n)


def test_all_methods_end_at_the_same_likelihood(fit: Fit, start: Model, lap: Log) -> None:
    assert set(METHODS) == {"gauss-newton", "nlopt", "scipy"}
    ends = [fit.log_likelihood]
    for method in ("nlopt", "scipy"):
        found = identify(start, lap, starts=1, method=method)
        assert found.converged
        ends.append(found.log_likelihood)
        assert found.derived[0].value == pytest.approx(fit.derived[0].value, rel=0.01)
    # In nats, of 46 000: far less than one standard error of any of the eight parameters.
    assert max(ends) - min(ends) < 2.0


def test_starting_at_the_truth_would_lead_no_higher(
    complete_fits: tuple[Fit, ...], truth: Model
) -> None:
    # B, C, D and E can copy each other: a search that stops in their valley ends many nats below.
    for found in complete_fits:
        best = refine(truth, found.driving, found.noise)
        assert best.log_likelihood - found.log_likelihood < 2.0


def test_an_unknown_method_is_refused(start: Model, lap: Log) -> None:
    with pytest.raises(InvalidInput, match="'simplex'; there are gauss-newton, nlopt, scipy"):
        identify(start, lap, method="simplex")


def test_starts_agree(fit: Fit, start: Model) -> None:
    assert len(fit.starts) == 3
    assert all(s.agrees for s in fit.starts)
    begins = [tuple(s.begin.values()) for s in fit.starts]
    assert len(set(begins)) == 3
    assert fit.starts[0].begin == {n: start.value(n) for n in start.free_names}
    assert "3 of 3 starts agree" in str(fit)


def test_the_same_seed_gives_the_same_answer(start: Model, lap: Log) -> None:
    short = lap.between(0.0, 8.0)
    one = identify(start, short, starts=2, seed=3)
    same = identify(start, short, starts=2, seed=3, workers=1)
    assert one.log_likelihood == same.log_likelihood
    assert one.estimates == same.estimates
    assert one.noise == same.noise
    other = identify(start, short, starts=2, seed=4)
    assert other.starts[1].begin != one.starts[1].begin


def test_an_unknown_yaw_inertia_is_found(car: Vehicle, lap: Log) -> None:
    unknown = car.replace(yaw_inertia_kgm2=None, tyre_front=Tyre(), tyre_rear=Tyre())
    found = identify(Model(unknown), lap, starts=1)["yaw_inertia_kgm2"]
    assert car.yaw_inertia_kgm2 is not None
    guess = Model(unknown).value("yaw_inertia_kgm2")
    assert abs(guess - car.yaw_inertia_kgm2) > 10.0 * found.std
    assert abs(found.value - car.yaw_inertia_kgm2) < SPREAD * found.std


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("steer_lag.time_constant_s", 0.06),
        ("aero_drag.drag_area_m2", 0.45),
        ("steer_offset.offset_rad", -0.006),
        ("gyro_bias.bias_radps", 0.01),
        ("tyre_relaxation.relaxation_length_m", 0.45),
    ],
)
def test_the_size_of_an_effect_is_found(
    name: str, value: float, truth: Model, start: Model
) -> None:
    effect = name.split(".")[0]
    log = drive(
        truth.add(effect).with_values({name: value}), manoeuvres.lap(30.0), seed=6, rate_hz=50.0
    )
    found = identify(start.add(effect), log, starts=1)[name]
    assert found.note == ""
    assert abs(found.value - value) < SPREAD * found.std
    assert abs(value) > 10.0 * found.std


def test_an_absent_lateral_speed_is_no_obstacle(
    start: Model, car: Vehicle, lap: Log, altered: Callable[..., Log]
) -> None:
    blind = altered(lap, without=["vy_mps"])
    assert "vy_mps" in blind.missing()
    found = identify(start, blind, starts=1)
    assert found.driving.present == ("vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    # Nor is a noise told of what nobody measured.
    assert all("vy_mps" not in told for told in (str(found), found._repr_html_()))
    assert_stiffness_found(found, car)


def test_an_absent_force_is_no_obstacle(
    start: Model, car: Vehicle, lap: Log, altered: Callable[..., Log]
) -> None:
    blind = altered(lap, without=["fx_n"])
    assert "fx_n" in blind.missing()
    assert_stiffness_found(identify(start, blind, starts=1), car)


def test_an_effect_that_needs_the_force_is_named_without_it(
    start: Model, lap: Log, altered: Callable[..., Log]
) -> None:
    blind = altered(lap, without=["fx_n"]).between(0.0, 15.0)
    with pytest.warns(SysidWarning, match="without fx_n the log cannot show aero_drag"):
        drag = identify(start.add("aero_drag"), blind, starts=1)["aero_drag.drag_area_m2"]
    # What the driven wheels need for it reaches the lateral motion, but it tells next to nothing.
    assert drag.std > 0.1
    assert abs(drag.value) < SPREAD * drag.std


def test_holes_are_no_obstacle(
    start: Model, car: Vehicle, lap: Log, altered: Callable[..., Log]
) -> None:
    ay, vy, steer = (lap[c].copy() for c in ("ay_mps2", "vy_mps", "steer_rad"))
    ay[250:450] = np.nan
    vy[400:1000] = np.nan
    steer[1250:1300] = np.nan
    with pytest.warns(SysidWarning) as told:
        holed = altered(lap, ay_mps2=ay, vy_mps=vy, steer_rad=steer)
    said = "\n".join(str(w.message) for w in told)
    for channel, samples in (
        ("ay_mps2", "250 to 449"),
        ("vy_mps", "400 to 999"),
        ("steer_rad", "1250 to 1299"),
    ):
        assert f"{channel}: no values at samples {samples}" in said
    found = identify(start, holed, starts=1)
    assert found.driving.samples == lap.n - 50
    assert "in 2 stretch(es)" in str(found)
    assert_stiffness_found(found, car)


def test_what_gentle_driving_cannot_tell_is_named(start: Model, truth: Model) -> None:
    gentle = drive(truth, manoeuvres.lap(30.0, lateral_mps2=2.5), seed=8, rate_hz=50.0)
    found = identify(start, gentle, starts=2)
    # Far below the peak only the stiffness B C D shows.
    assert {"D_front", "D_rear", "E_front", "E_rear"} <= set(found.undetermined)
    for n in found.undetermined:
        assert re.search(rf"{n} .*(not determined|at bound)", str(found))
    assert_stiffness_found(found, truth.vehicle)


def test_straight_driving_warns(start: Model, truth: Model) -> None:
    straight = drive(truth, manoeuvres.straight_acceleration(30.0), seed=8, rate_hz=50.0)
    with pytest.warns(SysidWarning, match="straight_acceleration"):
        found = identify(start, straight, starts=1)
    assert "D_front" in found.undetermined


def test_short_logs_are_enough_together(fit: Fit, start: Model, lap: Log) -> None:
    pieces = [lap.between(4.0 * i, 4.0 * i + 3.0) for i in range(10)]
    found = identify(start, pieces, starts=1)
    stiffness = found["cornering stiffness front"]
    expected = fit["cornering stiffness front"].value
    assert stiffness.value == pytest.approx(expected, abs=4.0 * stiffness.std)
    with pytest.raises(InvalidInput, match=r"lap \[0 to 3 s\]: 3.0 s usable.*at least 5 s.*add"):
        identify(start, pieces[0])


def test_a_log_that_is_given_twice_is_told(start: Model, lap: Log) -> None:
    """It counts twice, and what it tells does not."""
    short = [lap.between(10.0, 20.0) for _ in range(2)]
    with pytest.warns(SysidWarning, match=r"lap \[10 to 20 s\] is given twice.*too narrow"):
        identify(start, short, starts=1)


def test_going_on_from_a_fit_changes_nothing(fit: Fit) -> None:
    again = refine(fit.model, fit.driving, fit.noise)
    assert abs(again.log_likelihood - fit.log_likelihood) < 1.0
    assert len(again.starts) == 0
    fixed = refit(fit.model, fit.driving, fit.noise)
    assert fixed.noise == fit.noise
    assert fixed.log_likelihood >= fit.log_likelihood - 1e-6


def test_a_fit_tells_its_figures(fine_fit: Fit) -> None:
    fit = fine_fit
    e = fit["B_front"]
    assert (e.name, e.unit) == ("B_front", "1/rad")
    assert e.interval == pytest.approx((e.value - 1.96 * e.std, e.value + 1.96 * e.std))
    assert fit.model.value("B_front") == e.value
    with pytest.raises(KeyError, match="B_middle"):
        fit["B_middle"]
    assert fit.covariance.shape == (8, 8)
    np.testing.assert_allclose(np.sqrt(np.diag(fit.covariance)), [e.std for e in fit.estimates])
    assert isinstance(fit.noise, NoiseModel)
    for text in (str(fit), fit._repr_html_()):
        assert "cornering stiffness front" in text
        assert "95 % interval" in text


def test_more_noise_gives_wider_intervals(fit: Fit, start: Model, truth: Model) -> None:
    noisy = drive(
        truth, manoeuvres.lap(40.0), seed=1, noise=SensorNoise().scaled(3.0), rate_hz=50.0
    )
    found = identify(start, noisy, starts=1)
    ratio = found.derived[0].std / fit.derived[0].std
    assert 2.0 < ratio < 5.0


class Linear:
    """Residuals ``J (x - best)``, of parameters that nearly copy each other."""

    def __init__(self, J: np.ndarray, best: np.ndarray) -> None:
        self.J, self.best = J, best

    def half_sum_of_squares(self, p: np.ndarray, _: object) -> float:
        return 0.5 * float(np.sum(np.square(self.J @ (p - self.best))))

    def normal_equations(
        self, p: np.ndarray, frozen: object, _: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        downhill = -self.J.T @ (self.J @ (p - self.best))
        return self.half_sum_of_squares(p, frozen), downhill, self.J.T @ self.J


def test_a_small_gain_of_a_damped_step_is_not_the_end(rng: np.random.Generator) -> None:
    """Along the valley the curvature is a millionth of that across it, and 20 nats are to gain."""
    common = rng.normal(size=200)
    J = np.column_stack([common, common * (1.0 + 5e-4 * rng.normal(size=200))])
    J *= 1e3 / np.linalg.norm(common)
    _, _, along = np.linalg.svd(J)
    away = along[1] / np.linalg.norm(J @ along[1]) * np.sqrt(2.0 * 20.0)
    problem, box = Linear(J, np.zeros(2)), Box([0, 1], np.full(2, -1e3), np.full(2, 1e3))
    found = minimise(problem, away, None, box, tolerance=0.05)  # type: ignore[arg-type]
    assert found.settled
    assert found.cost < 0.05


def test_a_refit_is_never_worse_than_its_start(truth: Model, altered: Callable[..., Log]) -> None:
    """On a yaw rate that is late no effect fits, and searches go astray."""
    log = drive(truth, manoeuvres.lap(15.0), seed=61, rate_hz=25.0)
    yaw = np.interp(log["time_s"] - 0.1, log["time_s"], log["yaw_rate_radps"])
    driving = Driving.of(altered(log, yaw_rate_radps=yaw))
    fit = identify(truth, list(driving.logs), starts=1)
    model = fit.model.add("steer_delay").with_values({"steer_delay.delay_s": 0.004})
    begin = driving.problem(model).freeze(model.vector(), fit.noise.vector()).log_likelihood
    assert refit(model, driving, fit.noise).log_likelihood >= begin
    assert refine(model, driving, fit.noise).log_likelihood >= begin


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")  # too short for many effects
def test_of_a_measured_car_a_richer_model_is_no_less_likely(
    double_lane_change: tuple[Vehicle, Log],
) -> None:
    # Beside a delay that is learned first, noise that suits it hides a relaxation of a metre.
    car, log = double_lane_change
    poor = Model(car).add("ins_lever_arm", "tyre_relaxation")
    poorer, richer = (identify(m, log, starts=1) for m in (poor, poor.add("steer_delay")))
    assert richer.log_likelihood > poorer.log_likelihood
    assert richer["tyre_relaxation.relaxation_length_m"].value > 0.5
