"""What inputs are: held from sample to sample or turned by a driver, a force or an acceleration."""

import math

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import lab
from sysid_vehicle.errors import InvalidInput

CAR = lab.GreyBoxVehicle(3.0, 0.045, 0.135, 0.125)
TYRES = ((8.0, 1.5, 0.8, -0.3), (10.0, 1.5, 0.82, -0.3))
SENSORS = (0.03, 0.03, 0.003, 0.08)
STEP_S, PARTS, SAMPLES = 0.005, 4, 3000


def per_load(slip: float, tyre: tuple[float, float, float, float]) -> float:
    b, c, d, e = tyre
    return d * math.sin(c * math.atan(b * slip - e * (b * slip - math.atan(b * slip))))


def rates(x: tuple[float, ...], steer: float, force: float) -> tuple[float, ...]:
    v_x, v_y, r = x
    base = CAR.lf_m + CAR.lr_m
    weight = CAR.mass_kg * 9.80665 / base
    front = per_load(steer - math.atan2(v_y + CAR.lf_m * r, v_x), TYRES[0]) * weight * CAR.lr_m
    rear = per_load(-math.atan2(v_y - CAR.lr_m * r, v_x), TYRES[1]) * weight * CAR.lf_m
    across = front * math.cos(steer)
    return (
        (force - front * math.sin(steer)) / CAR.mass_kg + v_y * r,
        (across + rear) / CAR.mass_kg - v_x * r,
        (CAR.lf_m * across - CAR.lr_m * rear) / CAR.yaw_inertia_kgm2,
    )


def driven(seed: int, *, held: bool, force: bool = True, turn: float = 0.18) -> sv.Log:
    """Four Runge-Kutta steps a sample, twenty give the same to 2e-7; by nothing of the package."""
    rng = np.random.default_rng(seed)
    at = np.arange(0.0, SAMPLES * STEP_S + 1.0, 0.3)
    turned = turn * rng.standard_normal(at.size)

    def steering(t: float) -> float:
        return float(np.interp(STEP_S * math.floor(t / STEP_S + 1e-9) if held else t, at, turned))

    x: tuple[float, ...] = (3.5, 0.0, 0.0)
    rows, h = np.empty((SAMPLES, 7)), STEP_S / PARTS
    for k in range(SAMPLES):
        pull = 6.0 * (3.5 - x[0])
        steer = steering(k * STEP_S)
        v_dot = rates(x, steer, pull)
        rows[k] = (steer, pull, *x, v_dot[0] - x[1] * x[2], v_dot[1] + x[0] * x[2])
        for part in range(PARTS):
            t = k * STEP_S + part * h

            def after(k_: tuple[float, ...], share: float, x: tuple[float, ...] = x) -> tuple:
                return tuple(a + share * h * b for a, b in zip(x, k_, strict=True))

            k1 = rates(x, steering(t), pull)
            middle = steering(t + 0.5 * h)
            k2 = rates(after(k1, 0.5), middle, pull)
            k3 = rates(after(k2, 0.5), middle, pull)
            k4 = rates(after(k3, 1.0), steering(t + (1.0 - 1e-6) * h), pull)
            x = tuple(
                a + h / 6.0 * (p + 2.0 * q + 2.0 * u + w)
                for a, p, q, u, w in zip(x, k1, k2, k3, k4, strict=True)
            )
    names = ("steer_rad", "fx_n", "vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    columns = dict(zip(names, rows.T.copy(), strict=True))
    for name, std in zip(("vx_mps", "vy_mps", "yaw_rate_radps", "ay_mps2"), SENSORS, strict=True):
        columns[name] += std * rng.standard_normal(SAMPLES)
    if not force:
        del columns["fx_n"]
    return sv.Log.from_arrays({"time_s": STEP_S * np.arange(SAMPLES), **columns}, name="small")


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
@pytest.mark.parametrize(("held", "seed"), [(False, 5), (True, 6)])
def test_the_stiffness_is_that_of_the_car_however_inputs_go_between_samples(
    held: bool, seed: int
) -> None:
    logs = lab.TyreLog.from_log(driven(seed, held=held), CAR)
    fit = lab.identify_tyres(CAR, logs, starts=1, profiles=False)
    assert fit.inputs_held is held
    assert fit.to_dict()["inputs_held"] is held
    assert ("held until the next" in str(fit)) is held
    for axle, tyre in zip(("front", "rear"), TYRES, strict=True):
        found = fit[f"BCD_{axle}"]
        true = tyre[0] * tyre[1] * tyre[2]
        assert abs(found.value - true) < 3.5 * found.std
        assert found.std < 0.01 * true


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_validation_predicts_as_the_log_was_driven() -> None:
    log = lab.TyreLog.from_log(driven(7, held=False), CAR)[0]
    values = [x for tyre in TYRES for x in tyre]
    car = lab.IdentifiedCar(
        CAR,
        np.array([*values, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]),
        np.array([*SENSORS, 1e-3, 1e-3, 1e-3]),
    )
    (found,) = lab.validate_tyres(car, log)
    yaw = found.rms[:, 2]
    assert yaw.max() < 1.1 * SENSORS[2]
    (wrong,) = lab.validate_tyres(
        car, lab.TyreLog(log.step_s, log.measurements, log.inputs, inputs_held=True)
    )
    assert wrong.rms[-1, 2] > 2.0 * SENSORS[2]


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_logs_of_two_kinds_are_refused() -> None:
    log = lab.TyreLog.from_log(driven(8, held=False), CAR)[0]
    other = lab.TyreLog(log.step_s, log.measurements, log.inputs, "other", inputs_held=True)
    moving = lab.TyreLog(log.step_s, log.measurements, log.inputs, "moving", inputs_held=False)
    with pytest.raises(InvalidInput, match="other: inputs_held is True, of other logs False"):
        lab.identify_tyres(CAR, [moving, other], starts=1)


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_without_a_wheel_force_side_forces_count_once() -> None:
    """The measured acceleration has the side force of turned wheels in it, and the drag."""
    logs = lab.TyreLog.from_log(driven(9, held=False, force=False, turn=0.3), CAR)
    fit = lab.identify_tyres(CAR, logs, starts=1, profiles=False)
    assert "drag_area_m2" not in [e.name for e in fit.estimates]
    for axle, tyre in zip(("front", "rear"), TYRES, strict=True):
        found = fit[f"BCD_{axle}"]
        assert abs(found.value - tyre[0] * tyre[1] * tyre[2]) < 3.5 * found.std
    known = lab.TyreLog.from_log(driven(10, held=False), CAR)
    with pytest.raises(InvalidInput, match=r"small: no wheel force .fx_n., which other logs have"):
        lab.identify_tyres(CAR, [*logs, *known], starts=1)
