"""Profile intervals where B, C, D and E copy each other along a long, bent valley."""

import pytest

from sysid_vehicle import Fit, Model, Tyre, Vehicle, drive, identify, manoeuvres
from sysid_vehicle.identify import refine

HALF = 0.5 * 1.96**2  # nats that the end of a 95 % interval costs
FORMULA = Vehicle(
    name="formula student",
    mass_kg=280.0,
    yaw_inertia_kgm2=130.0,
    lf_m=0.8,
    lr_m=0.75,
    cg_height_m=0.3,
    track_front_m=1.2,
    track_rear_m=1.2,
    drag_area_m2=1.0,
    brake_front_share=0.6,
    drive_front_share=0.0,
    tyre_front=Tyre(B=9.0, C=1.5, D=1.5, E=0.0),
    tyre_rear=Tyre(B=10.0, C=1.5, D=1.6, E=0.0),
)


@pytest.fixture(scope="module")
def profiled() -> Fit:
    """Of a car below its peaks: tyres without a peak suit the log as well as the true ones."""
    course = manoeuvres.handling_course(40.0, lateral_mps2=9.8)
    log = drive(Model(FORMULA), course, seed=381210, rate_hz=50.0)
    unknown = Model(FORMULA.replace(tyre_front=Tyre(), tyre_rear=Tyre()))
    return identify(unknown, log, starts=3, intervals="profile")


def test_what_is_nearly_as_likely_lies_within_all_intervals(profiled: Fit) -> None:
    """The profile at its values costs no more than it costs itself."""
    near = refine(Model(FORMULA), profiled.driving, profiled.noise)
    assert profiled.log_likelihood - HALF < near.log_likelihood
    assert near.model.value("B_rear") < profiled.model.value("B_rear") - 3.0
    for name in profiled.model.free_names:
        low, high = profiled[name].interval
        assert low <= near.model.value(name) <= high, name


def test_an_interval_that_the_data_leave_open_has_no_end(profiled: Fit) -> None:
    """Nor does a search break down on its way to tyres without a peak."""
    assert profiled["slip at the peak front"].interval[1] == float("inf")
    assert profiled["C_rear"].interval == profiled.model.bounds("C_rear")
