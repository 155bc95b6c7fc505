"""Regression of tyres on a known motion: the published losses, and the joint one."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.identify.search.tyre_shape import friction
from sysid_vehicle.lab import (
    GreyBoxVehicle,
    TyreMotion,
)
from sysid_vehicle.lab.tyres.fit import PARAMETERS
from sysid_vehicle.lab.tyres.problem import box_of
from sysid_vehicle.lab.tyres.projection import Regression
from sysid_vehicle.published import TYRE_BOX, TYRE_START, regress_tyres
from sysid_vehicle.published.tyre_search import LossTask

CAR = GreyBoxVehicle(780.0, 1000.0, 1.4, 1.6)
FRONT = np.array([22.0, 1.8, 1.6, 0.8])
REAR = np.array([18.0, 1.6, 1.4, 0.2])


def motion(n: int = 1500, noise: float = 0.0, seed: int = 0, *, published: bool) -> TyreMotion:
    """Slip of every size at both axles, with the accelerations that the forces give."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 30.0, n)
    v_x = 30.0 + 5.0 * np.sin(0.3 * t)
    slip_r = 0.18 * np.sin(1.1 * t) * t / 30.0
    slip_f = 0.18 * np.sin(1.7 * t) * t / 30.0
    r = 0.3 * np.sin(0.8 * t)
    v_y = 1.6 * r - v_x * np.tan(slip_r)
    steer = slip_f + np.arctan((v_y + 1.4 * r) / v_x)
    f_z = 780.0 * 9.81 * np.array([1.6, 1.4]) / 3.0
    force_f, force_r = f_z[0] * friction(slip_f, FRONT), f_z[1] * friction(slip_r, REAR)
    across = force_f if published else force_f * np.cos(steer)
    a_y = (across + force_r) / 780.0 + noise * rng.normal(size=n)
    yaw = (1.4 * across - 1.6 * force_r) / 1000.0 + noise * rng.normal(size=n)
    told = np.column_stack([v_x, v_y, r, steer, np.full(n, f_z[0]), np.full(n, f_z[1])])
    return TyreMotion(told, a_y, np.full(n, max(noise, 1e-3) ** 2), yaw)


@pytest.mark.parametrize("projection", [True, False])
@pytest.mark.parametrize("loss", ["plain", "weighted", "joint"])
def test_recovers_the_tyres_from_an_exact_motion(loss: str, projection: bool) -> None:
    told = motion(published=loss != "joint")
    fit = regress_tyres(CAR, told, loss=loss, projection=projection, starts=4)
    assert fit.tyre("front") == pytest.approx(FRONT, rel=2e-3)
    assert fit.tyre("rear") == pytest.approx(REAR, rel=2e-3)
    assert fit.stiffness("rear") == pytest.approx(18.0 * 1.6 * 1.4, rel=1e-3)


@pytest.mark.parametrize("method", ["nlopt", "scipy"])
def test_other_optimisers(method: str) -> None:
    told = motion(noise=0.02, published=True)
    here = regress_tyres(CAR, told, starts=4)
    there = regress_tyres(CAR, told, starts=4, method=method)
    assert there.value == pytest.approx(here.value, rel=2e-3)


def sliding(seed: int, n: int) -> tuple[GreyBoxVehicle, TyreMotion]:
    """Any car on any tyres, each axle swept over slip angles of its own."""
    rng = np.random.default_rng(seed)
    mass, lf, lr = rng.uniform(600.0, 2500.0), *rng.uniform(1.0, 1.6, 2)
    car = GreyBoxVehicle(mass, mass * lf * lr, lf, lr)
    front, rear = (rng.uniform([6.0, 1.1, 0.7, -2.0], [25.0, 2.0, 1.7, 0.9]) for _ in range(2))
    t = np.linspace(0.0, 60.0, n)
    v_x, r = 25.0 + 5.0 * np.sin(0.3 * t), 0.3 * np.sin(0.8 * t)
    slip_f = rng.uniform(0.05, 0.2) * np.sin(rng.uniform(0.5, 2.0) * t)
    slip_r = rng.uniform(0.05, 0.2) * np.sin(rng.uniform(0.5, 2.0) * t + 1.0)
    v_y = lr * r - v_x * np.tan(slip_r)
    steer = slip_f + np.arctan((v_y + lf * r) / v_x)
    load_f, load_r = mass * 9.81 * np.array([lr, lf]) / (lf + lr)
    force = load_f * friction(slip_f, front) + load_r * friction(slip_r, rear)
    a_y = force / mass + 0.05 * rng.normal(size=n)
    told = np.column_stack([v_x, v_y, r, steer, np.full(n, load_f), np.full(n, load_r)])
    return car, TyreMotion(told, a_y)


def least_found(car: GreyBoxVehicle, told: TyreMotion, starts: int) -> float:
    """Give the least plain loss that SciPy finds, with a model written apart."""
    v_x, v_y, r, steer, load_f, load_r = told.motion.T
    slip_f = steer - np.arctan((v_y + car.lf_m * r) / v_x)
    slip_r = -np.arctan((v_y - car.lr_m * r) / v_x)
    box = box_of(PARAMETERS[:8], {})

    def errors(p: np.ndarray) -> np.ndarray:
        force = load_f * friction(slip_f, p[:4]) + load_r * friction(slip_r, p[4:])
        return told.ay_mps2 - force / car.mass_kg

    rng = np.random.default_rng(0)
    usual = np.array([[5.0, 1.1, 0.6, -2.0] * 2, [25.0, 2.0, 1.8, 0.9] * 2])
    found = [
        least_squares(
            errors,
            rng.uniform(*usual),
            bounds=(box.lower, box.upper),
            x_scale="jac",
            ftol=1e-12,
            xtol=1e-12,
            gtol=1e-12,
            max_nfev=200,
        ).cost
        for _ in range(starts)
    ]
    return 2.0 * min(found)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.manual), 3])
def test_defaults_end_no_higher_than_another_optimiser(seed: int) -> None:
    car, told = sliding(seed, 2000)
    least = least_found(car, told, 6)
    assert regress_tyres(car, told).value <= least * (1.0 + 1e-6)


def test_side_valley_of_few_samples_is_left() -> None:
    # On every 25th sample another curvature of the rear tyre fits better.
    told = motion(20000, noise=0.1, seed=1, published=True)
    fits = [regress_tyres(CAR, told, projection=p) for p in (True, False)]
    values = [fit.value for fit in fits]
    assert max(values) <= min(values) * (1.0 + 1e-8)


def test_joint_loss_prefers_the_likelier_end() -> None:
    told = motion(3000, noise=0.05, seed=3, published=False)
    fit = regress_tyres(CAR, told, loss="joint", starts=8)
    one = np.ones(told.n)
    loss = told.errors(CAR, one, one, projects_steer=True)
    likelihood = []
    for end in fit.starts.end:
        p = fit.parameters.copy()
        p[:8] = end
        squares = np.mean(loss.residuals(p, None) ** 2, axis=0)
        likelihood.append(-0.5 * told.n * np.sum(np.log(squares)))
    assert fit.starts.log_likelihood == pytest.approx(np.array(likelihood), rel=1e-7)
    assert fit.parameters[:8] == pytest.approx(fit.starts.end[int(np.argmax(likelihood))])


def test_regularised_loss_is_the_same_from_every_start() -> None:
    told = motion(noise=0.05, published=True)
    fit = regress_tyres(CAR, told, loss="regularised", start=TYRE_START, box=TYRE_BOX, starts=4)
    given = np.zeros(len(PARAMETERS))
    given[:8] = [TYRE_START[n] for n in PARAMETERS[:8]]
    box = box_of(PARAMETERS[:8], TYRE_BOX)
    task = LossTask(CAR, told, box, given, loss="regularised")
    for end, merit in zip(fit.starts.end, fit.starts.log_likelihood, strict=True):
        p = given.copy()
        p[:8] = end
        assert -2.0 * merit == pytest.approx(task.at(p), rel=1e-6)
    assert fit.value == pytest.approx(-2.0 * np.max(fit.starts.log_likelihood))


def test_regularised_loss_is_the_published_sum() -> None:
    told = motion(noise=0.05, published=True)
    start = TYRE_START
    fit = regress_tyres(CAR, told, loss="regularised", start=start, box=TYRE_BOX)
    p = fit.parameters
    a_y = (
        told.motion[:, 4] * friction(_slip(told, "front"), p[:4])
        + told.motion[:, 5] * friction(_slip(told, "rear"), p[4:8])
    ) / 780.0
    first = np.array([start[n] for n in PARAMETERS[:8]])
    wanted = (
        np.sum((told.ay_mps2 - a_y) ** 2 / told.ay_variance)
        + 0.1 * np.sum(((p[:8] - first) / first) ** 2)
        + 1000.0 * np.sum(((p[:4] - p[4:8]) / first[:4]) ** 2)
    )
    assert fit.value == pytest.approx(wanted, rel=1e-9)
    # Drawn towards equal axles, away from what the data say.
    plain = regress_tyres(CAR, told, loss="weighted", start=start, box=TYRE_BOX)
    apart = [np.sum(((q[:4] - q[4:8]) / first[:4]) ** 2) for q in (p, plain.parameters)]
    assert apart[0] < 0.9 * apart[1]


def _slip(told: TyreMotion, axle: str) -> np.ndarray:
    v_x, v_y, r, steer = told.motion[:, :4].T
    return (
        steer - np.arctan((v_y + 1.4 * r) / v_x)
        if axle == "front"
        else -np.arctan((v_y - 1.6 * r) / v_x)
    )


def test_variance_has_a_floor() -> None:
    told = motion(noise=0.02, published=True)
    tiny = TyreMotion(told.motion, told.ay_mps2, np.full(told.n, 1e-12))
    least = TyreMotion(told.motion, told.ay_mps2, np.full(told.n, 1e-6))
    one, other = (regress_tyres(CAR, m, loss="weighted") for m in (tiny, least))
    assert one.value == other.value


def test_eliminated_parameters_are_the_best_ones() -> None:
    told = motion(noise=0.02, published=True)
    loss = told.errors(CAR, np.ones(told.n), np.zeros(told.n), projects_steer=False)
    linear = [PARAMETERS.index(n) for n in ("D_front", "D_rear", "P1", "P2", "P3")]
    box = box_of(["D_front", "D_rear", "P1", "P2", "P3"], {})
    problem = Regression(loss, linear, box.lower, box.upper)
    p = np.array([20.0, 1.7, 1.0, 0.5, 20.0, 1.5, 1.0, 0.0, 0, 0, 0, 1, 1, 0.5, 0.0])
    full = problem.complete(p)
    least = loss.half_sum_of_squares(full, None)
    assert problem.half_sum_of_squares(p) == pytest.approx(least)
    for column in linear:
        for step in (-1e-3, 1e-3):
            other = full.copy()
            other[column] += step
            assert loss.half_sum_of_squares(other, None) > least
    # The search sees the slope of what is left.
    _, gradient, _ = problem.normal_equations(p, None, [0, 4])
    for i, column in enumerate((0, 4)):
        high, low = p.copy(), p.copy()
        high[column] += 1e-4
        low[column] -= 1e-4
        slope = (problem.half_sum_of_squares(high) - problem.half_sum_of_squares(low)) / 2e-4
        assert gradient[i] == pytest.approx(-slope, rel=1e-4)


def test_eliminated_parameters_stay_in_their_bounds() -> None:
    told = motion(noise=0.02, published=True)
    fit = regress_tyres(CAR, told, box={"D_front": (0.1, 1.2)}, residual_terms=True, starts=1)
    assert fit.parameters[2] == pytest.approx(1.2)


def test_noise_on_the_motion_is_what_a_regression_cannot_stand() -> None:
    told = motion(published=True)
    rng = np.random.default_rng(2)
    noisy = told.motion.copy()
    noisy[:, 1] += 0.3 * rng.normal(size=told.n)
    fit = regress_tyres(CAR, TyreMotion(noisy, told.ay_mps2), starts=2)
    assert fit.stiffness("front") < 0.97 * float(np.prod(FRONT[:3]))


def test_prints() -> None:
    fit = regress_tyres(CAR, motion(published=True))
    assert "plain loss" in str(fit)
    assert "B C D [1/rad]" in fit._repr_html_()


def test_wrong_input_is_named() -> None:
    told = motion(200, published=True)
    with pytest.raises(InvalidInput, match="no loss is called 'best'"):
        regress_tyres(CAR, told, loss="best")
    with pytest.raises(InvalidInput, match="no optimiser"):
        regress_tyres(CAR, told, method="best")
    with pytest.raises(InvalidInput, match="joint loss needs yaw_acc_radps2"):
        regress_tyres(CAR, TyreMotion(told.motion, told.ay_mps2), loss="joint")
    with pytest.raises(InvalidInput, match="bounds of C_rear"):
        regress_tyres(CAR, told, box={"C_rear": (2.0, 1.0)})
    with pytest.raises(InvalidInput, match=r"expected \(n, 6\)"):
        TyreMotion(told.motion[:, :5], told.ay_mps2)
    broken = told.ay_mps2.copy()
    broken[7] = np.inf
    with pytest.raises(InvalidInput, match="ay_mps2 is inf at sample 7"):
        TyreMotion(told.motion, broken)
