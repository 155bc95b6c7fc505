"""Drives that end at standstill, creep, or go backwards."""

from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.online import KINDS, cornering_stiffness, estimate_sideslip

CAR = sv.example_vehicle()
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def driven() -> Columns:
    log = sv.drive(sv.Model(CAR), sv.manoeuvres.handling_course(15.0), seed=140114)
    return {name: np.array(log[name]) for name in log.channels}


def braked(driven: Columns) -> Columns:
    """After the drive the car brakes on a straight road, and stands for three seconds."""
    end = driven["vx_mps"][-1]
    vx = np.append(np.arange(end, 0.0, -0.03), np.zeros(300))
    rng = np.random.default_rng(410738)
    still = {
        "vx_mps": vx,
        "ax_mps2": np.gradient(vx, 0.01),
        "fx_n": CAR.mass_kg * np.gradient(vx, 0.01),
        **{c: np.zeros(vx.size) for c in ("vy_mps", "yaw_rate_radps", "ay_mps2", "steer_rad")},
    }
    for name in ("yaw_rate_radps", "ay_mps2", "ax_mps2"):
        still[name] = still[name] + 0.003 * rng.standard_normal(vx.size)
    result = {name: np.append(driven[name], values) for name, values in still.items()}
    return result | {"time_s": 0.01 * np.arange(len(result["vx_mps"]))}


def backwards(driven: Columns) -> Columns:
    return driven | {"vx_mps": -driven["vx_mps"]}


def creeping(driven: Columns) -> Columns:
    """A metre per second on a path that the wheels roll along: slip angles are noise."""
    rng, time_s = np.random.default_rng(260463), driven["time_s"]
    steer = 0.3 * np.sin(0.5 * time_s)
    yaw = np.tan(steer) / CAR.wheelbase_m
    noise = {"vx_mps": 0.02, "yaw_rate_radps": 0.002, "ax_mps2": 0.05, "ay_mps2": 0.05}
    right = {
        "vx_mps": np.ones(time_s.size),
        "yaw_rate_radps": yaw,
        "ax_mps2": np.zeros(time_s.size),
        "ay_mps2": yaw,
    }
    return {
        **driven,
        **{c: x + noise[c] * rng.standard_normal(x.size) for c, x in right.items()},
        "steer_rad": steer,
        "vy_mps": yaw * CAR.lr_m,
    }


def log_of(columns: Columns) -> sv.Log:
    return sv.Log.from_arrays(columns, name="run", check=False)


def test_a_drive_that_ends_at_standstill_is_drawn(driven: Columns, tmp_path: Path) -> None:
    CAR.to_toml(tmp_path / "car.toml")
    log_of(braked(driven)).to_csv(tmp_path / "run.csv")
    arguments = [str(tmp_path / "run.csv"), "--vehicle", str(tmp_path / "car.toml")]
    assert main(["sideslip", *arguments, "--plot", str(tmp_path / "run.svg")]) == 0
    assert (tmp_path / "run.svg").exists()
    run = estimate_sideslip(CAR, log_of(braked(driven)))
    last = float(np.nanmax([c[np.isfinite(c)][-1] for c in (run.cf_npr, run.cr_npr)]))
    assert run.plot_stiffness().get_ylim() == pytest.approx((0.0, 2e-3 * last))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("drive", [backwards, creeping], ids=["backwards", "creeping"])
def test_a_drive_without_driving_forwards_is_told(driven: Columns, drive, kind: str) -> None:
    log = log_of(drive(driven))
    with pytest.warns(SysidWarning, match=r"run: vx_mps: reaches .* no sideslip was estimated"):
        run = estimate_sideslip(CAR, log, kind=kind)
    assert (run.mode == 1).all()
    run.plot_stiffness()


def test_a_stiffness_that_no_tyre_has_is_told(driven: Columns) -> None:
    with pytest.warns(SysidWarning, match="rear cornering stiffness is -.* which no tyre has"):
        run = cornering_stiffness(CAR, log_of(creeping(driven)))
    assert run.cr_npr[-1] < 0.0


@pytest.mark.parametrize("end", ["stands", "parks"])
def test_what_a_car_does_at_walking_pace_takes_nothing_from_its_stiffness(
    driven: Columns, end: str
) -> None:
    """Noise of the sideslip at a standstill made the stiffness twice as large +- itself."""
    columns = braked(driven)
    rng = np.random.default_rng(991_200)
    standing = np.arange(columns["vx_mps"].size) >= driven["vx_mps"].size
    columns["vy_mps"] = columns["vy_mps"] + 0.03 * rng.standard_normal(standing.size) * standing
    if end == "parks":
        time_s = 0.01 * np.arange(2000)
        vx, steer = 1.3 + 0.02 * rng.standard_normal(2000), 0.4 * np.sin(0.5 * time_s)
        rate = np.tan(steer) * 1.3 / CAR.wheelbase_m
        more = {
            "vx_mps": vx,
            "vy_mps": CAR.lr_m * rate + 0.03 * rng.standard_normal(2000),
            "yaw_rate_radps": rate + 0.003 * rng.standard_normal(2000),
            "ay_mps2": 1.3 * rate + 0.06 * rng.standard_normal(2000),
            "steer_rad": steer,
        }
        zero = np.zeros(2000)
        columns = {n: np.append(x, more.get(n, zero)) for n, x in columns.items()}
        columns["time_s"] = 0.01 * np.arange(columns["vx_mps"].size)
    run = cornering_stiffness(CAR, log_of(columns))
    alone = cornering_stiffness(CAR, log_of(driven))
    for found, std, other, other_std in zip(
        (run.cf_npr[-1], run.cr_npr[-1]),
        (run.cf_std_npr[-1], run.cr_std_npr[-1]),
        (alone.cf_npr[-1], alone.cr_npr[-1]),
        (alone.cf_std_npr[-1], alone.cr_std_npr[-1]),
        strict=True,
    ):
        assert abs(found - other) < 2.0 * other_std
        assert std < 1.5 * other_std
