"""A factor that a remedy gives is that beside the one which is taken already: whoever follows the
messages, one after the other, ends with the right log."""

import csv
import itertools
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from single_track import drive

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.read import read_log

G, DEG = 9.80665, np.pi / 180.0
SAID = "; it multiplies the factor that is taken now: "


def table(**times: float) -> dict[str, np.ndarray]:
    """A drive in columns of its own names, some of them times a factor."""
    return {f"col {c}": x * times.get(c, 1.0) for c, x in drive().items()}


def refused(data: dict[str, np.ndarray], **factors: float) -> str:
    channels = {
        c: {"column": f"col {c}", **({"factor": factors[c]} if c in factors else {})}
        for c in drive()
    }
    with pytest.raises(InvalidInput) as caught:
        read_log(data, channels)
    return str(caught.value)


def test_a_sign_stands_beside_the_unit_of_the_map() -> None:
    said = refused(table(yaw_rate_radps=-1 / DEG), yaw_rate_radps=DEG)
    assert "yaw_rate_radps: wrong sign" in said
    assert said.endswith(f"{SAID}0.01745329 for yaw_rate_radps")


def test_of_what_is_turned_round_instead_the_factors_are_told_too() -> None:
    data = table(yaw_rate_radps=-1 / DEG, ay_mps2=1 / G)
    said = refused(data, yaw_rate_radps=DEG, ay_mps2=G)
    assert said.endswith(f"{SAID}0.01745329 for yaw_rate_radps, 9.80665 for ay_mps2")


def test_a_map_without_factors_is_not_spoken_of() -> None:
    assert SAID not in refused(table(yaw_rate_radps=1 / DEG))
    assert SAID not in refused(table(yaw_rate_radps=1 / DEG), yaw_rate_radps=1.0)


def test_a_range_stands_beside_the_factor_too() -> None:
    said = refused(table(steer_rad=600 / DEG), steer_rad=2.0)
    assert "is no value of a car" in said
    assert said.endswith(f"{SAID}2 for steer_rad")


def test_a_unit_that_the_file_states_is_a_factor_that_is_taken(tmp_path: Path) -> None:
    data = drive()
    data["Acc Lat [g]"] = -data.pop("ay_mps2") / G
    path = tmp_path / "log.csv"
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(data)
        rows.writerows(np.column_stack(list(data.values())).tolist())
    with (
        pytest.raises(InvalidInput) as caught,
        pytest.warns(SysidWarning, match="the file states 'g'"),
    ):
        read_log(path, {"ay_mps2": "Acc Lat [g]"})
    assert "ay_mps2: wrong sign" in str(caught.value)
    assert str(caught.value).endswith(f"{SAID}9.80665 for ay_mps2")


def test_what_is_warned_of_stands_beside_the_factor_too() -> None:
    data = table(vy_mps=2 * 3.6)
    channels = {c: {"column": f"col {c}"} for c in drive()}
    channels["vy_mps"]["factor"] = 0.5  # type: ignore[assignment]
    with pytest.warns(SysidWarning, match=f"in km/h.*{re.escape(SAID)}0.5 for vy_mps"):
        read_log(data, channels)


def test_of_a_law_that_is_doubted_each_factor_is_told() -> None:
    data = table(yaw_rate_radps=6 / DEG, vx_mps=2.0)
    said = refused(data, yaw_rate_radps=DEG, vx_mps=0.5)
    assert "check the units of these channels" in said
    assert said.endswith(f"{SAID}0.5 for vx_mps, 0.01745329 for yaw_rate_radps")


def test_what_a_law_compares_with_is_not_to_be_multiplied() -> None:
    channels = {c: {"column": f"col {c}"} for c in drive()}
    channels["vx_mps"]["factor"] = 0.5  # type: ignore[assignment]
    with pytest.warns(SysidWarning, match="vy_mps: changes .* in km/h") as caught:
        read_log(table(vy_mps=3.6, vx_mps=2.0), channels)
    assert not any(SAID in str(w.message) for w in caught)


def followed(data: dict[str, np.ndarray]) -> dict[str, float]:
    """Factors to which the messages lead whoever does what they say."""
    factors = dict.fromkeys(drive(), 1.0)
    for _ in range(6):
        channels = {c: {"column": f"col {c}", "factor": f} for c, f in factors.items()}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", SysidWarning)
                read_log(data, channels)
        except (InvalidInput, SysidWarning) as error:
            said = str(error)
        else:
            return factors
        remedies = {c: f for f, c in re.findall(r"factor = (-?[\d.e+-]+\d) for (\w+_\w+)", said)}
        first = re.search(r"(?:^|: )(\w+_\w+): .*?factor = (-?[\d.e+-]+\d)", said)
        assert first is not None, said
        for channel, value in (remedies or {first[1]: first[2]}).items():
            present = re.search(rf"(-?[\d.e+-]+) for {channel}", said.partition(SAID)[2])
            assert (present is not None) == (factors[channel] != 1.0), said
            factors[channel] = float(value) * (float(present[1]) if present else 1.0)
    raise AssertionError(f"no end: {factors}")


MISTAKES: dict[str, tuple[str, float]] = {
    "yaw rate in deg/s": ("yaw_rate_radps", 1 / DEG),
    "speed in km/h": ("vx_mps", 3.6),
    "ay in g": ("ay_mps2", 1 / G),
    "ax in g": ("ax_mps2", 1 / G),
    "yaw rate to the right": ("yaw_rate_radps", -1.0),
    "ay to the right": ("ay_mps2", -1.0),
    "ax backwards": ("ax_mps2", -1.0),
    "steering to the right": ("steer_rad", -1.0),
    "vy to the right": ("vy_mps", -1.0),
}


@pytest.mark.parametrize(("one", "other"), [(a, b) for a, b in itertools.combinations(MISTAKES, 2)])
def test_two_mistakes_are_mended_one_after_the_other(one: str, other: str) -> None:
    times: dict[str, float] = {}
    for channel, factor in (MISTAKES[one], MISTAKES[other]):
        times[channel] = times.get(channel, 1.0) * factor
    found = followed(table(**times))
    product = {c: found[c] * times.get(c, 1.0) for c in found}
    # Axes with z down are axes, too: nothing tells left from right.
    left = np.sign(product["yaw_rate_radps"])
    for channel in ("yaw_rate_radps", "ay_mps2", "vy_mps", "steer_rad"):
        assert product[channel] == pytest.approx(left, rel=1e-4), found
    assert product["vx_mps"] == pytest.approx(1.0, rel=1e-4), found
    assert product["ax_mps2"] == pytest.approx(1.0, rel=1e-4), found
