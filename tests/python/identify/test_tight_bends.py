"""Where driving of a small, slow car begins in a bend, the filter does not lose its way."""

from itertools import pairwise

import numpy as np
import pytest

from sysid_vehicle import Log, Model, Vehicle, drive, example_vehicle
from sysid_vehicle.estimate import Driving, NoiseModel
from sysid_vehicle.estimate.samples import thinned
from sysid_vehicle.manoeuvres import RoadKind, usual_road

CAR = Vehicle(
    name="one tenth",
    mass_kg=3.74,
    yaw_inertia_kgm2=0.0471,
    lf_m=0.159,
    lr_m=0.171,
    cg_height_m=0.074,
    track_front_m=0.24,
    track_rear_m=0.24,
    drag_area_m2=0.03,
    brake_front_share=0.5,
    drive_front_share=0.5,
)
# What a fit makes of tyres that relax where the model's do not.
TYRES = {
    "B_front": 13.9,
    "C_front": 1.14,
    "D_front": 0.56,
    "E_front": 1.0,
    "B_rear": 20.7,
    "C_rear": 0.71,
    "D_rear": 0.69,
    "E_rear": 1.0,
}


def driven(seconds: float, dt: float = 5e-4) -> Log:
    """At 1.3 to 2.5 m/s, up to 7 m/s2, with tyres that answer after 0.12 m (Euler's rule)."""
    rng = np.random.default_rng(101)
    knots = np.arange(0.0, seconds + 1.0, 0.8)
    wish = rng.uniform(-1.0, 1.0, knots.size)
    m, i_z, l_f, l_r = CAR.mass_kg, CAR.yaw_inertia_kgm2, CAR.lf_m, CAR.lr_m
    load = m * 9.81 / (l_f + l_r) * np.array([l_r, l_f])
    stiff, peak = np.array([7.0, 8.0]), np.array([0.95, 1.0]) * load
    vy = r = 0.0
    force = np.zeros(2)
    rows = []
    for k in range(round(seconds / dt)):
        t = k * dt
        vx = 1.9 + 0.6 * np.sin(0.5 * t)
        steer = np.interp(t, knots, wish) * min(0.35, 2.6 / vx**2)
        slip = np.arctan2([vy + l_f * r, vy - l_r * r], vx) - [steer, 0.0]
        target = -peak * np.sin(1.5 * np.arctan(stiff * slip))
        force += (target - force) * vx / 0.12 * dt
        ax, ay = 0.3 * np.cos(0.5 * t) - vy * r, force.sum() / m
        if k % 20 == 0:
            rows.append((t, vx, r, ax, ay, steer))
        vy += (ay - vx * r) * dt
        r += (l_f * force[0] - l_r * force[1]) / i_z * dt
    names = ("time_s", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2", "steer_rad")
    spread = (0.0, 0.02, 0.01, 0.15, 0.15, 0.0)
    return Log.from_arrays(
        {
            n: column + s * rng.standard_normal(column.size)
            for n, column, s in zip(names, np.array(rows).T, spread, strict=True)
        }
    )


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_windows_that_begin_in_a_bend_cost_no_more_than_their_start() -> None:
    driving = Driving.of(driven(60.0))
    model = Model(CAR).with_values(TYRES)
    noise = NoiseModel(
        sensor=(0.02, 0.001, 0.009, 0.005, 0.13),
        motion=(0.015, 0.0088, 3.5e-5),
        disturbance=(0.0037, 1.95, 0.075),
        correlation_time_s=(0.3, 0.99, 0.029),
    ).vector()

    def density(most: int | None) -> np.ndarray:
        trace = driving.problem(model, most_samples=most).trace(model.vector(), noise, False)
        return trace["log_density"] - 0.5 * np.sum(trace["whitened"] ** 2, axis=1)

    whole, few = density(None), density(3000)
    windows = [(s.at, s.where.stop - s.where.start) for s in thinned(driving._whole, 3000)]
    ends = np.cumsum([0, *(n for _, n in windows)])
    lost = [
        whole[at : at + n].sum() - few[a:b].sum()
        for (at, n), (a, b) in zip(windows, pairwise(ends), strict=True)
    ]
    assert len(lost) > 10
    assert 5.0 < np.median(lost) < 20.0  # nothing is known yet
    assert max(lost) < 40.0


@pytest.mark.parametrize("kind", ["town", "country"])
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_road_car_whose_log_begins_in_a_bend(kind: RoadKind, seed: int) -> None:
    """Lateral speed is not measured, and the first reading finds the car at three quarters of g."""
    model = Model(example_vehicle())
    log = drive(model, usual_road(kind, 60.0, seed), seed=seed, rate_hz=50.0)
    turning = np.flatnonzero(np.abs(log["ay_mps2"]) > 0.6 * np.abs(log["ay_mps2"]).max())
    for k in turning[:: len(turning) // 8]:
        part = slice(k, min(k + 100, log.n))
        columns = {c: log[c][part] for c in log.channels if c != "vy_mps"}
        driving = Driving.of(Log.from_arrays(columns, check=False))
        noise = NoiseModel(
            (0.03, 0.03, 0.0025, 0.06, 0.06), (0.005, 0.005, 0.001), (50.0, 50.0, 50.0), 0.3
        )
        problem = driving.problem(model)
        state = problem.trace(model.vector(), noise.vector(), False)["state"]
        assert np.abs(state[:, 1] - log["vy_mps"][part]).max() < 0.3


def test_where_it_begins_depends_on_the_tyres_and_derivatives_know_it() -> None:
    model = Model(example_vehicle())
    log = drive(model, usual_road("town", 60.0, 11), seed=11, rate_hz=50.0)
    k = int(np.argmax(np.abs(log["ay_mps2"])))
    columns = {c: log[c][k : k + 100] for c in log.channels if c != "vy_mps"}
    problem = Driving.of(Log.from_arrays(columns, check=False)).problem(model)
    noise = NoiseModel(
        (0.03, 0.03, 0.0025, 0.06, 0.06), (0.005, 0.005, 0.001), (50.0, 50.0, 50.0), 0.3
    )
    p, names = model.vector(), ("B_rear", "C_rear", "D_rear")
    gains = problem.freeze(p, noise.vector())
    places = [model.parameters[n].column for n in names]
    found = problem.sensitivities(p, gains, places)
    for column, place in zip(found.T, places, strict=True):
        step = np.zeros_like(p)
        step[place] = 1e-5 * p[place]
        ends = (problem.residuals(q, gains).ravel() for q in (p - step, p + step))
        difference = (next(ends) - next(ends)) / (2.0 * step[place])
        assert np.abs(difference[:15]).max() > 0.5  # of the first samples
        np.testing.assert_allclose(column, difference, atol=1e-6)
