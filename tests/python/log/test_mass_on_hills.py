"""A driver who answers slopes with the force: the car seems to be heavier than it is."""

import pytest

import sysid_vehicle as sv
from sysid_vehicle.log.against_car import check_car

CAR = sv.example_vehicle()
WHEELBASE_M = CAR.lf_m + CAR.lr_m


def driven(course: sv.manoeuvres.Manoeuvre, seed: int, slope_rad: float) -> sv.Log:
    road = sv.RoadDisturbance(slope_rad=slope_rad)
    return sv.drive(sv.Model(CAR), course, seed=seed, rate_hz=50.0, disturbance=road)


@pytest.mark.parametrize("seed", [35, 59])
def test_a_sound_log_is_read(seed: int) -> None:
    town = sv.manoeuvres.usual_road("town", 50.0, seed=seed)
    check_car(driven(town, seed, 0.03), mass_kg=CAR.mass_kg, wheelbase_m=WHEELBASE_M)


@pytest.mark.parametrize("slope_rad", [0.0, 0.03])
def test_a_mass_that_is_far_too_small_is_refused(slope_rad: float) -> None:
    log = driven(sv.manoeuvres.lap(40.0), 1, slope_rad)
    with pytest.raises(sv.InvalidInput, match="as if it had"):
        check_car(log, mass_kg=0.45 * CAR.mass_kg, wheelbase_m=WHEELBASE_M)
