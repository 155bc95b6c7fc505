"""On a banked oval the lateral speed seems to break the laws of motion, as gravity is not felt."""

from collections.abc import Iterator

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle._common.arrays import FloatArray
from sysid_vehicle.compare.unrelated import incoherent
from sysid_vehicle.estimate import Driving
from sysid_vehicle.log.laws.plausibility import check_coherence
from sysid_vehicle.manoeuvres import Manoeuvre
from sysid_vehicle.vehicle import GRAVITY_MPS2

CAR = sv.Vehicle(
    name="oval racer",
    mass_kg=750.0,
    yaw_inertia_kgm2=1100.0,
    lf_m=1.72,
    lr_m=1.25,
    cg_height_m=0.28,
    track_front_m=1.64,
    track_rear_m=1.52,
    drag_area_m2=0.9,
    brake_front_share=0.55,
    drive_front_share=0.0,
    tyre_front=sv.Tyre(B=14.0, C=1.4, D=1.5, E=-0.5),
    tyre_rear=sv.Tyre(B=15.0, C=1.4, D=1.55, E=-0.5),
)
KNOWN = {"known_bank.share": 1.0}
DOWNFORCE = {"aero_downforce.cl_a_front_m2": 1.2, "aero_downforce.cl_a_rear_m2": 1.7}


@pytest.fixture(autouse=True)
def known_bank() -> Iterator[None]:
    sv.define_effect(
        "known_bank",
        title="gravity along a road whose bank is known",
        parameters=[sv.parameter("share", "1", typical=1.0, lower=0.0, upper=2.0)],
        channels={"bank_rad": (-0.6, 0.6)},
        force_y=lambda d, p: p.share * CAR.mass_kg * GRAVITY_MPS2 * np.sin(d.bank_rad),
        reads={"ay_mps2": lambda d, p: -p.share * GRAVITY_MPS2 * np.sin(d.bank_rad)},
        breaks="on a slope",
    )
    yield
    sv.forget_effect("known_bank")


def turns(time_s: FloatArray) -> FloatArray:
    """Two of them in 50 s, both to the left."""
    within = np.mod(time_s, 25.0)
    return np.clip((within - 8.0) / 2.0, 0.0, 1.0) * np.clip((25.0 - within) / 2.0, 0.0, 1.0)


def laps(bank_deg: float, *, seconds: float = 75.0, to_mps: float = 65.0, seed: int = 5) -> sv.Log:
    truth = sv.Model(CAR).add("known_bank", "aero_downforce").with_values({**KNOWN, **DOWNFORCE})
    oval = Manoeuvre(
        name="oval",
        purpose="turns that lean",
        duration_s=seconds,
        speed_mps=lambda t: np.interp(t, [0.0, seconds], [58.0, to_mps]),
        lateral_mps2=lambda t: 12.0 * turns(t),
    )
    bank = {"bank_rad": lambda t: np.radians(bank_deg) * turns(t)}
    return sv.drive(truth, oval, seed=seed, channels=bank)


def columns(log: sv.Log) -> dict[str, FloatArray]:
    return {name: log[name] for name in log.channels}


@pytest.mark.parametrize("bank_deg", [10.0, 20.0])
def test_it_is_read_with_a_note_that_tells_the_bank(bank_deg: float) -> None:
    log = laps(bank_deg)
    found = check_coherence(columns(log), log.rate_hz)
    (told,) = (c.text for c in found if c.channel == "vy_mps")
    leans = float(told.split(" leans by up to ")[1].split()[0])
    assert leans == pytest.approx(bank_deg, abs=1.5)
    assert all(c.on_the_level for c in found)
    with pytest.warns(sv.SysidWarning, match="looks? like that, too|leans by up to"):
        sv.Log.from_arrays(columns(log))


def test_a_level_road_has_no_bank() -> None:
    log = laps(0.0)
    assert not check_coherence(columns(log), log.rate_hz)


def test_a_lateral_speed_of_another_drive_is_refused_as_before() -> None:
    table = columns(laps(20.0))
    with pytest.raises(sv.InvalidInput, match="vy_mps: does not change as"):
        # As if the road leaned to the outside of every turn, which none does.
        sv.Log.from_arrays({**table, "ay_mps2": 2.0 * 12.0 * turns(table["time_s"])})


def test_a_model_that_knows_the_bank_is_not_contradicted() -> None:
    driving = Driving.of(laps(10.0))
    assert "vy_mps" in incoherent(driving, sv.Model(CAR))
    assert not incoherent(driving, sv.Model(CAR).add("known_bank").with_fixed(KNOWN))


def test_a_law_that_nothing_breaks_is_refused() -> None:
    with pytest.raises(sv.InvalidInput, match=r"breaks = 'on a slop'; there are .*on a slope"):
        sv.define_effect(
            "sloping",
            title="",
            parameters=[sv.parameter("share", "1", typical=1.0, lower=0.0, upper=2.0)],
            force_y=lambda d, p: p.share * d.v_x,
            breaks="on a slop",
        )
