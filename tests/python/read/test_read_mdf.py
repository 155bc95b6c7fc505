"""What measuring tools put into MDF files beside numbers in seconds, written by asammdf."""

import gc
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_formats import FACTORS, FAST, MAP, SLOW, UNITS, check_values, measured, read_told

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import read_log

pytestmark = pytest.mark.filterwarnings(
    # What the libraries say of themselves and of each other.
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
    "ignore::PendingDeprecationWarning",
    "ignore::ResourceWarning",
)
asammdf: Any = pytest.importorskip("asammdf")
conversions: Any = pytest.importorskip("asammdf.blocks.conversion_utils")

SI = {c: {"column": n, "factor": FACTORS.get(c, 1.0)} for c, n in MAP.items()}
STEP, ZERO = 0.001, -20.0  # of the yaw rate as a count [deg/s]


def signal(name: str, time_s: np.ndarray = FAST) -> Any:
    return asammdf.Signal(measured(time_s)[name], time_s, name=name, unit=UNITS[name])


def others(*without: str) -> list[Any]:
    return [signal(name) for name in UNITS if name not in (*without, "Speed")]


def save(mdf: Any, path: Path) -> Path:
    mdf.append([signal("Speed", SLOW)])
    result = Path(mdf.save(path))
    mdf.close()
    return result


@pytest.mark.parametrize(
    "conversion",
    [
        {"val_0": 65535, "text_0": b"SNA", "default_addr": {"a": STEP, "b": ZERO}},
        {
            "lower_0": 65534,
            "upper_0": 65535,
            "text_0": b"SNA",
            "default_addr": {"a": STEP, "b": ZERO},
        },
    ],
    ids=["value", "range"],
)
def test_a_reading_with_a_name_is_no_measurement(
    tmp_path: Path, conversion: dict[str, Any]
) -> None:
    counts = np.round((measured(FAST)["YawRate"] - ZERO) / STEP).astype("<u2")
    counts[50:60] = 65535
    yaw = asammdf.Signal(
        counts, FAST, name="YawRate", unit="deg/s", conversion=conversions.from_dict(conversion)
    )
    mdf = asammdf.MDF(version="4.10")
    mdf.append([*others("YawRate"), yaw])
    path = save(mdf, tmp_path / "run.mf4")
    with pytest.warns(SysidWarning, match=r"YawRate: 10 samples are 'SNA' .*first sample 50"):
        log = read_log(path, SI, check=False)
    yaw_rate = log["yaw_rate_radps"]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(yaw_rate)), np.arange(50, 60))
    exact = np.deg2rad(measured(FAST)["YawRate"])
    np.testing.assert_allclose(np.delete(yaw_rate, range(50, 60)), np.delete(exact, range(50, 60)),
                               atol=np.deg2rad(STEP))  # fmt: skip


def test_a_state_keeps_its_numbers(tmp_path: Path) -> None:
    names = {"val_0": 1, "text_0": b"first", "val_1": 2, "text_1": b"second"}
    gear = asammdf.Signal(
        np.where(FAST < 1.0, 1, 2).astype("<u1"),
        FAST,
        name="Gear",
        conversion=conversions.from_dict(names),
    )
    mdf = asammdf.MDF(version="4.10")
    mdf.append([*others(), gear])
    log = read_told(save(mdf, tmp_path / "run.mf4"))
    np.testing.assert_array_equal(log["Gear"], np.where(FAST < 1.0, 1.0, 2.0))


def test_text_and_arrays_in_the_group_of_a_channel(tmp_path: Path) -> None:
    both = np.stack([measured(FAST)[n] for n in ("LongAcc", "LatAcc")], axis=1)
    acc = np.rec.fromarrays([both], dtype=np.dtype([("Acc", "<f8", (2,))]))
    fix = asammdf.Signal(np.array([b"3D"] * FAST.size), FAST, name="Fix", encoding="utf-8")
    mdf = asammdf.MDF(version="4.10")
    mdf.append([*others("LongAcc", "LatAcc"), fix, asammdf.Signal(acc, FAST, name="Acc", unit="g")])
    path = save(mdf, tmp_path / "run.mf4")
    elements = {**MAP, "ax_mps2": "Acc[0]", "ay_mps2": "Acc[1]"}
    factors = {c: {"column": n, "factor": 9.80665} for c, n in elements.items() if "Acc" in n}
    with pytest.warns(SysidWarning, match=r"1 channel is left out, .*: Fix \(text\); record"):
        log = read_told(path, {**elements, **factors})
    check_values(log)
    with pytest.raises(InvalidInput, match=r"names 'Fix', which cannot be read; .*Fix \(text\)"):
        read_log(path, {**MAP, "ax_mps2": "Fix"}, check=False)


def test_the_unit_of_the_time_counts(tmp_path: Path) -> None:
    mdf = asammdf.MDF(version="4.10")
    for names, time_s in (([n for n in UNITS if n != "Speed"], FAST), (["Speed"], SLOW)):
        mdf.append(
            [
                asammdf.Signal(measured(time_s)[n], 1e3 * time_s, name=n, unit=UNITS[n])
                for n in names
            ]
        )
    for group in mdf.groups:
        group.channels[0].unit = "ms"
    path = Path(mdf.save(tmp_path / "run.mf4"))
    mdf.close()
    check_values(read_told(path))


def test_a_file_that_breaks_off_is_one_sentence(tmp_path: Path) -> None:
    """And nothing that the library's half-made object writes when it is deleted."""
    mdf = asammdf.MDF(version="4.10")
    mdf.append(others())
    path = save(mdf, tmp_path / "run.mf4")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3])
    heard: list[Any] = []
    told, sys.unraisablehook = sys.unraisablehook, heard.append
    try:
        with pytest.raises(InvalidInput, match=r"run\.mf4: is an ASAM MDF file, but asammdf canno"):
            read_log(path, MAP, check=False)
        gc.collect()
    finally:
        sys.unraisablehook = told
    assert not heard
