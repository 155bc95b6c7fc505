"""Tyres that are driven and braked in corners, and intervals where the peak is not reached."""

import dataclasses
import math
import warnings

import numpy as np
import pytest

from sysid_vehicle import Log, SysidWarning, lab
from sysid_vehicle.identify.intervals.profile import Profile
from sysid_vehicle.lab.tyres.fit import ELLIPSE, PARAMETERS

CAR = lab.GreyBoxVehicle(
    1400.0, 2100.0, 1.2, 1.4, cg_height_m=0.5, brake_front_share=0.65, drive_front_share=0.0
)
TYRES = ((11.0, 1.45, 0.95, 0.1), (13.0, 1.45, 1.02, 0.1))
SENSORS = (0.03, 0.01, 0.002, 0.03)
STEP_S, PARTS, SAMPLES = 0.01, 4, 2500
State = tuple[float, float, float]


def driven(seed: int, *, ellipse: float, steered: float = 0.045, pulled_g: float = 0.25) -> Log:
    """Weaving under power and brakes, by nothing of the package."""
    rng = np.random.default_rng(seed)
    waves = [(*p, *rng.uniform(0.0, 2.0 * math.pi, 2)) for p in ((0.2, 0.13), (0.5, 0.3))]
    base = CAR.lf_m + CAR.lr_m
    weight = CAR.mass_kg * 9.80665
    waves = [tuple(float(p) for p in wave) for wave in waves]
    x, a_x = (22.0, 0.0, 0.0), 0.0

    def inputs(t: float, v_x: float) -> tuple[float, float]:
        rise = min(t, 1.0) * (0.5 + 0.5 * t / (SAMPLES * STEP_S))
        steer = steered * rise * sum(math.sin(2.0 * math.pi * f * t + p) for f, _, p, _ in waves)
        pull = 0.7 * sum(math.sin(2.0 * math.pi * g * t + q) for _, g, _, q in waves)
        return steer, weight * min(max(pulled_g * pull + 0.1 * (22.0 - v_x), -pulled_g), pulled_g)

    def rates(x: State, steer: float, along: float, a_x: float) -> State:
        v_x, v_y, r = x
        moved = CAR.mass_kg * a_x * CAR.cg_height_m / base
        front_share = CAR.brake_front_share if along < 0.0 else CAR.drive_front_share
        slips = (
            steer - math.atan2(v_y + CAR.lf_m * r, v_x),
            -math.atan2(v_y - CAR.lr_m * r, v_x),
        )
        pulls = (along * front_share, along * (1.0 - front_share))
        loads = (weight * CAR.lr_m / base - moved, weight * CAR.lf_m / base + moved)
        front, rear = (
            load
            * d
            * math.sin(c * math.atan(b * s - e * (b * s - math.atan(b * s))))
            * math.sqrt(max(1.0 - ellipse * (pull / (d * load)) ** 2, 0.04))
            for s, pull, load, (b, c, d, e) in zip(slips, pulls, loads, TYRES, strict=True)
        )
        ahead = pulls[0] * math.cos(steer) - front * math.sin(steer) + pulls[1]
        across = pulls[0] * math.sin(steer) + front * math.cos(steer)
        return (
            ahead / CAR.mass_kg + v_y * r,
            (across + rear) / CAR.mass_kg - v_x * r,
            (CAR.lf_m * across - CAR.lr_m * rear) / CAR.yaw_inertia_kgm2,
        )

    def stepped(x: State, slope: State, h: float) -> State:
        return x[0] + h * slope[0], x[1] + h * slope[1], x[2] + h * slope[2]

    rows = np.empty((SAMPLES, 7))
    h = STEP_S / PARTS
    for k in range(SAMPLES):
        for part in range(PARTS):
            steer, along = inputs(k * STEP_S + part * h, x[0])
            slope = rates(x, steer, along, a_x)
            a_x = slope[0] - x[1] * x[2]
            if part == 0:
                rows[k] = (steer, along, *x, a_x, slope[1] + x[0] * x[2])
            steer, along = inputs(k * STEP_S + (part + 0.5) * h, x[0])
            x = stepped(x, rates(stepped(x, slope, 0.5 * h), steer, along, a_x), h)
    names = ("steer_rad", "fx_n", "vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    columns = dict(zip(names, rows.T.copy(), strict=True))
    for name, std in zip(("vx_mps", "vy_mps", "yaw_rate_radps", "ay_mps2"), SENSORS, strict=True):
        columns[name] += std * rng.standard_normal(SAMPLES)
    return Log.from_arrays({"time_s": STEP_S * np.arange(SAMPLES), **columns}, name="weaving")


def fitted(log: Log, combined_slip: bool | None = None) -> tuple[lab.TyreFit, str]:
    logs = lab.TyreLog.from_log(log, CAR)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        fit = lab.identify_tyres(CAR, logs, combined_slip=combined_slip, starts=2, profiles=False)
    return fit, " ".join(str(w.message) for w in heard if issubclass(w.category, SysidWarning))


def test_drive_and_brake_force_make_no_smaller_peak() -> None:
    log = driven(1, ellipse=1.0)
    fit, heard = fitted(log)
    assert fit[ELLIPSE].value == pytest.approx(1.0, abs=0.1)
    assert "combined_slip=" not in heard
    plain, warned = fitted(log, combined_slip=False)
    assert ELLIPSE not in [e.name for e in plain.estimates]
    assert "the readings ask for a friction ellipse of" in warned
    assert "identify with combined_slip=True" in warned
    for one, most in ((fit, 0.005), (plain, None)):
        off = max(
            abs(one[f"BCD_{a}"].value / (b * c * d) - 1.0)
            for a, (b, c, d, _) in zip(("front", "rear"), TYRES, strict=True)
        )
        assert off < most if most is not None else off > 0.015
    for axle, tyre in zip(("front", "rear"), TYRES, strict=True):
        assert fit[f"D_{axle}"].value == pytest.approx(tyre[2], rel=0.01)


def test_no_ellipse_is_found_where_there_is_none() -> None:
    fit, heard = fitted(driven(2, ellipse=0.0))
    assert ELLIPSE not in [e.name for e in fit.estimates]
    assert "ellipse" not in heard
    for axle, tyre in zip(("front", "rear"), TYRES, strict=True):
        assert fit[f"D_{axle}"].value == pytest.approx(tyre[2], rel=0.01)


def test_an_identified_ellipse_is_validated_and_kept(tmp_path) -> None:
    fit, _ = fitted(driven(3, ellipse=1.0), combined_slip=True)
    known = lab.IdentifiedCar.of(fit)
    log = lab.TyreLog.from_log(driven(4, ellipse=1.0), CAR)[0]
    (found,) = lab.validate_tyres(known, log)
    without = known.parameters.copy()
    without[PARAMETERS.index(ELLIPSE)] = 0.0
    (other,) = lab.validate_tyres(dataclasses.replace(known, parameters=without), log)
    assert found.rms[1, 2] < 1.2 * SENSORS[2]
    assert other.rms[1, 2] > 2.0 * SENSORS[2]
    earlier = dataclasses.replace(known, parameters=known.parameters[:-1])
    assert np.array_equal(earlier.parameters, without)


def test_intervals_that_fail_short_of_the_peak_are_told() -> None:
    setup = lab.Setup.default()
    car = lab.GreyBoxVehicle.of(setup.plant.vehicle)
    told = {}
    for name, driver in (
        ("short of it", lab.excitation.Weaving(duration_s=20.0)),
        ("beyond it", lab.design_excitation(setup, duration_s=20.0).excitation),
    ):
        drive = lab.run_closed_loop(driver, setup, seed=5)
        logs = lab.TyreLog.from_log(drive.to_log(), car)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            told[name] = lab.identify_tyres(car, logs, starts=2, profiles=False)
    short, beyond = told["short of it"], told["beyond it"]
    assert {"B_front", "C_front", "B_rear", "C_rear"} <= {*short.bent, *short.undetermined}
    assert not {"B_front", "C_front", "D_front"} & set(short.determined)
    assert f"Intervals not to be trusted: {short.bent[0]}" in str(short)
    assert short.to_dict()["bent"] == list(short.bent)
    open_above = Profile("peak_front", np.array([1.0, 1.6]), np.zeros(2), 1.0, 1.7, False, True)
    assert dataclasses.replace(beyond, profiles=(open_above,)).interval("peak_front")[1] == np.inf
    assert beyond.bent == ()
    assert "not to be trusted" not in str(beyond)
