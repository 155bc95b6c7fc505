"""Parameters that a user fixes, bounds or knows roughly; intervals; which note takes precedence."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, InvalidInput, Log, Model, identify
from sysid_vehicle.identify import profile_fit, refit
from sysid_vehicle.identify.intervals.estimates import (
    Estimate,
    box_covariance,
    std_of_data,
    wald,
)
from sysid_vehicle.identify.intervals.estimates import profiled as with_profile
from sysid_vehicle.identify.intervals.profile import Profile
from sysid_vehicle.identify.search.objective import Penalised, gaussian_prior
from sysid_vehicle.identify.search.search import Box

SHAPES = ("C_front", "C_rear", "E_front", "E_rear")
HALF = 0.5 * 1.96**2  # nats that the end of a 95 % interval costs


@pytest.fixture(scope="module")
def short(lap: Log) -> Log:
    return lap.between(0.0, 12.0)


@pytest.fixture(scope="module")
def profiled(truth: Model, short: Log) -> Fit:
    return identify(
        truth,
        short,
        starts=1,
        fixed=SHAPES,
        bounds={"D_rear": (0.5, 1.5)},
        intervals="profile",
    )


def test_what_is_fixed_stays_and_is_not_estimated(profiled: Fit, truth: Model) -> None:
    assert [e.name for e in profiled.estimates] == ["B_front", "D_front", "B_rear", "D_rear"]
    for name in SHAPES:
        assert profiled.model.value(name) == truth.value(name)
    for e in profiled.estimates:
        assert abs(e.value - truth.value(e.name)) < 4.0 * e.std
    assert profiled.model.bounds("D_rear") == (0.5, 1.5)
    # Effects that are added keep what was said of the tyres.
    assert "C_front" not in profiled.model.add("mass").free_names


def test_profile_intervals_end_where_a_refit_says(profiled: Fit, truth: Model) -> None:
    assert "95 % interval (profile)" in str(profiled)
    problem = profiled.driving.problem(profiled.model)
    p, noise = profiled.model.vector(), profiled.noise.vector()
    gains = problem.freeze(p, noise)
    best = problem.half_sum_of_squares(p, gains)
    for name in ("B_front", "D_rear"):
        for end in profiled[name].interval:
            held = refit(
                profiled.model.with_fixed({name: end}), profiled.driving, profiled.noise, rounds=1
            )
            lost = problem.half_sum_of_squares(held.model.vector(), gains) - best
            assert lost == pytest.approx(HALF, abs=0.15), name
    # So does that of what follows from the parameters, and both agree where all is well known.
    stiffness = profiled["cornering stiffness front"]
    low, high = stiffness.interval
    assert (low, high) == profiled.profile("cornering_stiffness_front").interval
    assert high - low == pytest.approx(2.0 * 1.96 * stiffness.std, rel=0.1)
    with pytest.raises(KeyError, match="there are B_front"):
        profiled.profile("C_front")


def test_a_prior_counts_as_one_more_reading(profiled: Fit) -> None:
    plain = profiled
    free, std = plain["D_front"], plain["D_front"].std
    mean = free.value + 0.6 * std
    model = plain.model.with_priors({"D_front": (mean, std)})
    known = profile_fit(refit(model, plain.driving, plain.noise))
    # Two readings as sure as each other: halfway, and surer by the root of two.
    assert known["D_front"].value == pytest.approx(free.value + 0.3 * std, abs=0.1 * std)
    assert known["D_front"].std == pytest.approx(std / np.sqrt(2.0), rel=0.03)
    assert known.log_likelihood < plain.log_likelihood


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"fixed": ["C_frnt"]}, "no parameter 'C_frnt'"),
        ({"bounds": {"D_front": (2.0, 1.0)}}, r"bounds of D_front are 2 .. 1; give \(lower"),
        ({"priors": {"D_front": (1.0, 0.0)}}, "prior of D_front is 1 .- 0"),
        ({"priors": {"D_front": 1.0}}, r"prior of D_front: 1\.0 was given; give \(mean, standard"),
        ({"bounds": {"D_front": (1.0, 2.0, 3.0)}}, r"bounds of D_front: \(1.*give \(lower, upper"),
        ({"bounds": {"D_front": ("a", None)}}, "bounds of D_front: .*two numbers"),
        ({"fixed": {"D_front": float("nan")}}, "D_front = nan: give a finite number"),
        ({"fixed": {"D_front": "0.9"}}, "D_front = '0.9': give a finite number"),
        ({"fixed": {"D_front": -0.8}}, "D_front = -0.8 is out of range .* peak friction"),
        (
            {"fixed": ["D_front"], "priors": {"D_front": (1.0, 0.1)}},
            r"D_front has bounds or a prior but is not free; with_free\(\['D_front'\]\)",
        ),
        ({"fixed": [f"{x}_{a}" for x in "BCDE" for a in ("front", "rear")]}, "nothing is left"),
        ({"intervals": "bootstrap"}, "there are information, profile"),
    ],
)
def test_what_contradicts_itself_is_refused(
    start: Model, short: Log, told: dict[str, object], message: str
) -> None:
    with pytest.raises(InvalidInput, match=message):
        identify(start, short, **told)


def test_a_known_inertia_can_be_freed(truth: Model) -> None:
    name = "yaw_inertia_kgm2"
    assert name not in truth.free_names
    freed = truth.with_free([name]).with_priors({name: (1700.0, 100.0)})
    assert name in freed.free_names
    assert freed.priors == {name: (1700.0, 100.0)}
    assert "yaw_inertia" not in {e.id for e in freed.candidates}
    assert truth.add("mass").with_fixed({"mass.relative_error": 0.05}).drop("mass") == truth


def test_covariances_are_inverses_whatever_the_units() -> None:
    scale = np.array([1e-4, 1.0, 1e3])
    information = np.outer(scale, scale) * np.array(
        [[2.0, 0.6, 0.3], [0.6, 3.0, 0.5], [0.3, 0.5, 1.0]]
    )
    inverse = np.linalg.inv(information)
    assert std_of_data(information) == pytest.approx(np.sqrt(np.diag(inverse)), rel=1e-9)
    unfelt = np.zeros((4, 4))
    unfelt[:3, :3] = information
    assert np.isinf(std_of_data(unfelt)).tolist() == [False, False, False, True]
    # Of a uniform over the box, about the estimate, where the data tell nothing.
    box = Box([0, 1, 2], np.array([0.0, -1.0, 0.0]), np.array([1.0, 1.0, 12.0]))
    x = np.array([0.5, 1.0, 0.0])
    spread = np.sqrt(box.width**2 / 12.0 + np.array([0.0, 1.0, 6.0]) ** 2)
    none = box_covariance(np.zeros((3, 3)), box, x)
    assert np.sqrt(np.diag(none)) == pytest.approx(spread, rel=1e-12)
    both = np.linalg.inv(information + np.diag(1.0 / spread**2))
    assert box_covariance(information, box, x) == pytest.approx(both, rel=1e-9, abs=1e-15)


def test_an_open_end_of_a_profile_is_at_no_place() -> None:
    slip = Estimate("slip at the peak front", -0.2, 0.01, "rad")
    grid = np.array([-0.3, -0.2, -0.1])

    def told(below: bool, above: bool) -> Estimate:
        found = Profile(slip.name, grid, np.zeros(3), -0.3, -0.1, below, above)
        return with_profile(slip, (found,))

    assert told(False, False).interval == (-0.3, -0.1)
    assert (told(True, False).interval, told(True, False).note) == ((-np.inf, -0.1), "no lower end")
    assert (told(False, True).interval, told(False, True).note) == ((-0.3, np.inf), "no upper end")


def test_what_is_not_determined_is_not_called_at_bound() -> None:
    box = Box([0, 1, 2, 3, 4], np.zeros(5), np.ones(5))
    x = np.array([0.9, 1.0, 1.0, 0.5, 0.5])
    information = np.diag([1e-3, 1e-3, 1e6, 1e6, 0.0])
    found, _ = wald("abcde", dict.fromkeys("abcde", "1"), x, information, box)
    unknown = "not determined"
    assert [e.note for e in found] == [unknown, unknown, "at bound", "", unknown]
    loose, loose_held, held, free, never_felt = found
    # The data say nothing: no more is known than the box. A bound leaves no standard error.
    assert loose.std == pytest.approx(np.hypot(0.4, 1.0 / np.sqrt(12.0)), rel=1e-3)
    assert loose_held.std == held.std == never_felt.std == np.inf
    assert free.std == pytest.approx(1e-3, rel=1e-4)


def test_priors_are_residuals_like_those_of_the_data(profiled: Fit) -> None:
    problem = profiled.driving.problem(profiled.model, most_samples=300)
    p, columns = profiled.model.vector(), profiled.columns
    gains = problem.freeze(p, profiled.noise.vector())
    whole = Penalised(problem, gaussian_prior(len(p), {columns[1]: (1.5, 0.1)}))
    e, G = whole.residuals(p, gains), whole.sensitivities(p, gains, columns)
    cost, descent, information = whole.normal_equations(p, gains, columns)
    assert whole.half_sum_of_squares(p, gains) == pytest.approx(0.5 * e @ e)
    assert cost == pytest.approx(0.5 * e @ e)
    assert descent == pytest.approx(G.T @ e)
    assert information == pytest.approx(G.T @ G)
    assert e[-1] == pytest.approx((1.5 - p[columns[1]]) / 0.1)


def test_no_interval_passes_a_bound_of_its_parameter() -> None:
    length = Estimate("tyre_relaxation.relaxation_length_m", 0.05, 0.27, "m", bounds=(0.0, 2.0))
    assert length.interval == (0.0, pytest.approx(0.05 + 1.96 * 0.27))
    assert length.interval_text() == "0 (bound) .. 0.5792"
    assert str(length) == "tyre_relaxation.relaxation_length_m = 0.05 (95 %: 0 (bound) .. 0.5792) m"
    assert length.to_dict()["interval"] == list(length.interval)
    # The standard error, by which rules ask whether it holds no effect, is what it was.
    assert length.std == 0.27
    # As far as bounds do not matter, nothing is said of them.
    known = replace(length, std=0.01)
    assert known.interval == pytest.approx((0.05 - 0.0196, 0.05 + 0.0196))
    assert str(known) == "tyre_relaxation.relaxation_length_m = 0.05 +- 0.01 m"
    # Ends of a profile that found none are those of the bounds.
    open_ended = replace(length, ends=(-np.inf, 0.4))
    assert open_ended.interval == (0.0, 0.4)
    assert replace(length, value=np.inf, std=np.inf, bounds=(0.0, np.inf)).interval == (0.0, np.inf)
    held = replace(length, value=0.0, std=np.inf)
    assert held.interval == (0.0, 2.0)
    assert held.interval_text() == "-"
    assert "interval" not in held.to_dict()


def test_every_interval_of_a_fit_keeps_to_its_bounds(truth: Model, short: Log) -> None:
    model = truth.add("tyre_relaxation", "aero_drag").with_bounds(
        {"aero_drag.drag_area_m2": (-0.1, 3.0)}
    )
    few = short.between(4.0, 9.0)  # one corner: hardly anything is known well
    fit = identify(model, few, starts=1)
    cut = 0
    for e in fit.estimates:
        lower, upper = fit.model.bounds(e.name)
        assert e.bounds == (lower, upper)
        assert lower <= e.interval[0] <= e.interval[1] <= upper
        cut += bool(np.isfinite(e.std) and e.interval[0] == lower)
    assert cut
    assert (
        fit["tyre_relaxation.relaxation_length_m"].bounds[0] == 0.0
    )  # not where the search begins
    assert all(e.interval[0] >= 0.0 for e in fit.derived)
    assert "(bound)" in str(fit)
    table = fit.to_pandas()
    assert all(table["low"] >= [e.bounds[0] for e in (*fit.estimates, *fit.derived)])
