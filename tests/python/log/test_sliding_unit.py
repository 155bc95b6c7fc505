"""A lateral speed in km/h is told as that, and not as another channel that comes early."""

import re

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.compare import incoherent
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.estimate import Driving

SEED = 118257


@pytest.fixture(scope="module")
def driven() -> dict[str, np.ndarray]:
    truth = sv.Model(sv.example_vehicle())
    log = sv.drive(truth, sv.manoeuvres.handling_course(lateral_mps2=6.5), seed=SEED)
    return {name: log[name] for name in log.channels}


@pytest.mark.parametrize("gyro", [1.0, 1.03])
def test_a_lateral_speed_in_kmh_is_told(driven: dict[str, np.ndarray], gyro: float) -> None:
    wrong = driven | {
        "vy_mps": 3.6 * driven["vy_mps"],
        "yaw_rate_radps": gyro * driven["yaw_rate_radps"],
    }
    with pytest.warns(SysidWarning, match=r"vy_mps: changes 3\.[4-8]\d? times .* in km/h:") as told:
        log = sv.Log.from_arrays(wrong, name="kmh")
    assert len(told) == 1
    model = sv.Model(sv.example_vehicle())
    assert list(incoherent(Driving.of(log), model)) == ["vy_mps"]


UNITS = {"km/h": 3.6, "mph": 1.0 / 0.44704, "knots": 1.0 / 0.5144444}


@pytest.mark.parametrize("manoeuvre", ["lap", "constant_radius", "double_lane_change"])
@pytest.mark.parametrize("forward_m", [-1.2, 0.0, 1.2])
def test_units_are_told_wherever_the_sensor_is(manoeuvre: str, forward_m: float) -> None:
    """The factor was that of another time: 1.87 +- 0.02 for knots, nothing on a constant radius."""
    truth = sv.Model(sv.example_vehicle()).add("speed_sensor_lever_arm")
    truth = truth.with_values({"speed_sensor_lever_arm.forward_m": forward_m})
    log = sv.drive(truth, getattr(sv.manoeuvres, manoeuvre)(), seed=734211)
    assert not [c for c in log.contradictions if c.channel == "vy_mps"]
    for unit, times in UNITS.items():
        wrong = {n: log[n] for n in log.channels} | {"vy_mps": times * log["vy_mps"]}
        with pytest.warns(SysidWarning, match="vy_mps: changes") as told:
            sv.Log.from_arrays(wrong, name="wrong")
        found = re.search(r"times \((\S+) to (\S+)\) .* to be in ([^:]*):", str(told[0].message))
        assert found is not None
        assert float(found[1]) <= times <= float(found[2])
        assert unit in found[3].split(" or ")


@pytest.mark.parametrize("roll", [1.1, 1.15])
def test_a_body_that_rolls_makes_no_other_unit(driven: dict[str, np.ndarray], roll: float) -> None:
    """The accelerometer reads gravity by roll, the factor is smaller: km/h were told as ft/s."""
    wrong = driven | {"vy_mps": 3.6 * driven["vy_mps"], "ay_mps2": roll * driven["ay_mps2"]}
    with pytest.warns(SysidWarning, match=r"vy_mps: changes .* seems to be in .*km/h"):
        sv.Log.from_arrays(wrong, name="kmh")


@pytest.mark.parametrize("late", ["ay_mps2", "yaw_rate_radps"])
def test_what_is_late_is_told_as_late(driven: dict[str, np.ndarray], late: str) -> None:
    shifted = {n: v[:-10] if n == late else v[10:] for n, v in driven.items()}
    with pytest.warns(SysidWarning, match=rf"{late}: lags behind .* by 0\.(1|09\d|10\d) s"):
        sv.Log.from_arrays(shifted, name="late")
