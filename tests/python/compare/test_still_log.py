"""A log in which nothing happens: equal inputs are none, whatever their mean is rounded to."""

from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli.main import main
from sysid_vehicle.report import failure

DRAG_N = 213.444  # that the deviation of such equal numbers is above zero made it fail


def still(n: int, rng: np.random.Generator, force_n: float) -> dict[str, np.ndarray]:
    return {
        "time_s": np.arange(n) / 100.0,
        "vx_mps": 22.0 + 0.03 * rng.standard_normal(n),
        "vy_mps": 0.03 * rng.standard_normal(n),
        "yaw_rate_radps": 0.0025 * rng.standard_normal(n),
        "ax_mps2": 0.06 * rng.standard_normal(n),
        "ay_mps2": 0.06 * rng.standard_normal(n),
        "steer_rad": np.zeros(n),
        "fx_n": np.full(n, force_n),
    }


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_a_motion_that_is_noise_says_nothing_of_forces() -> None:
    """Both are smoothed from the same readings: 4 to 40 % of the one is the other."""
    log = sv.Log.from_arrays(still(3000, np.random.default_rng(12), 0.0), name="still")
    fit = sv.identify(sv.Model(sv.example_vehicle()), log, starts=1)
    failing = sv.where(fit)
    assert failing.left is not None
    assert failing.left.rejects  # a steady force along the car
    assert failing.best_map is None
    assert "nothing moved by more than the smoother could miss" in str(failing)
    assert "a steady F_x is missing" in str(failing)
    assert failing.to_dict()["best_pair"] is None
    assert failing.plot().get_xlabel() == "time driven [s]"


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_of_a_car_that_rolls_out_the_speed_alone_moves() -> None:
    v = 35.0 / (1.0 + 0.006 * np.arange(4000) / 100.0)  # by drag of 0.006 / m
    rng = np.random.default_rng(13)
    log = still(4000, rng, 0.0)
    log["vx_mps"] += v - 22.0
    fit = sv.identify(
        sv.Model(sv.example_vehicle()), sv.Log.from_arrays(log, name="rolls"), starts=1
    )
    failing = sv.where(fit, causes=False)
    assert failing.best_map is not None
    assert failing.best_map.coordinates == ("vx_mps",)
    assert {m.coordinates for m in failing.maps} == {("vx_mps",), ("time_s",)}
    assert "depends on speed, mostly F_x" in str(failing)
    assert failing.plot().get_xlabel() == "speed [m/s]"
    drawn = failure.over_one(failing.best_map).svg()
    assert "speed [m/s]" in drawn
    assert "nan" not in drawn


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_compare_takes_a_log_in_which_nothing_happens(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = still(1000, np.random.default_rng(660191), DRAG_N)
    assert np.std(log["fx_n"]) > 0.0
    sv.Log.from_arrays(log, name="still").to_csv(tmp_path / "still.csv")
    sv.example_vehicle().to_toml(tmp_path / "car.toml")
    assert (
        main(["compare", str(tmp_path / "still.csv"), "--vehicle", str(tmp_path / "car.toml")]) == 0
    )
    told = capsys.readouterr().out
    assert "no residual follows the wheel force" in told
    assert "no residual follows the steering" in told
