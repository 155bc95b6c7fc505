"""Commands that stand until the next one: a line between their samples is half a period early."""

import warnings

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput, SysidWarning

HELD = {c: {"column": c, "held": True} for c in ("steer_rad", "fx_n")}


def smooth(time_s: np.ndarray) -> dict[str, np.ndarray]:
    """A gentle drive without noise; commands as a controller would like them."""
    yaw_rate = 0.2 * np.sin(1.3 * time_s)
    return {
        "time_s": time_s,
        "vx_mps": 20.0 + np.sin(0.5 * time_s),
        "yaw_rate_radps": yaw_rate,
        "ay_mps2": 20.0 * yaw_rate,
        "ax_mps2": 0.5 * np.cos(0.5 * time_s),
        "steer_rad": 0.03 * np.sin(1.3 * time_s),
        "fx_n": 800.0 * np.cos(0.5 * time_s),
    }


def commanded(time_s: np.ndarray, period_s: float) -> dict[str, np.ndarray]:
    """The same with commands that are sent every `period_s` and stand in between."""
    sent = smooth(period_s * np.floor(time_s / period_s + 1e-6))
    return smooth(time_s) | {c: sent[c] for c in HELD}


@pytest.mark.parametrize("period_s", [0.01, 0.02, 0.05])
def test_what_lines_between_samples_give_is_as_late_as_the_command(period_s: float) -> None:
    """The mean of a held command is half a period behind what was sent, as of a delay."""
    time_s = 0.01 * np.arange(3000)
    log = sv.read_log(commanded(time_s, period_s), HELD, check=False)
    for channel in HELD:
        late = smooth(time_s - 0.5 * period_s)[channel]
        early = smooth(time_s)[channel]
        inner = slice(20, -20)
        moved = np.gradient(early, time_s)[inner]
        off = (log[channel] - late)[inner]
        delay = -float(moved @ off / (moved @ moved))
        assert abs(delay) < 0.1 * 0.5 * period_s
        assert np.mean(off**2) < np.mean((early - late)[inner] ** 2)


def test_rows_of_slow_commands_are_those_of_the_quickest_other_channel() -> None:
    """At stamps of their own, between those of the log; before the first nothing is known."""
    time_s = 0.01 * np.arange(2000)
    sent_s = 0.053 + 0.05 * np.arange(380)
    columns = {c: (time_s, x) for c, x in smooth(time_s).items() if c != "time_s"}
    columns |= {c: (sent_s, smooth(sent_s)[c]) for c in HELD}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)  # of the rows, and of the end
        log = sv.read_log(columns, HELD, check=False)
    assert log.rate_hz == pytest.approx(100.0)
    last = np.maximum(np.floor((log["time_s"] - sent_s[0]) / 0.05 + 1e-9).astype(int), 0)
    stands = smooth(sent_s)["fx_n"][np.minimum(last, sent_s.size - 1)]
    since = log["time_s"] - sent_s[last.clip(max=sent_s.size - 1)]
    inside = (since > 0.0051) & (since < 0.0449) & (log["time_s"] < 18.0)
    assert inside.sum() > 1000
    np.testing.assert_allclose(log["fx_n"][inside], stands[inside], rtol=1e-9, atol=1e-9)
    assert np.isnan(log["fx_n"][:5]).all()
    # Long after the last one a command is none any more.
    assert np.isnan(log["fx_n"][log["time_s"] > sent_s[-1] + 0.3]).all()


def test_how_late_a_command_was_written_counts_beside() -> None:
    time_s = 0.01 * np.arange(2000)
    plain = sv.read_log(commanded(time_s, 0.05), HELD, check=False)
    late = {c: {**entry, "delay_s": 0.03} for c, entry in HELD.items()}
    log = sv.read_log(commanded(time_s, 0.05), late, check=False)
    np.testing.assert_allclose(log["fx_n"][10:1900], plain["fx_n"][13:1903], rtol=1e-9)


def test_only_what_drives_the_model_is_a_command() -> None:
    with pytest.raises(InvalidInput, match="give it for steer_rad, fx_n alone"):
        sv.ChannelMap.from_dict({"vx_mps": {"column": "v", "held": True}})


def test_a_log_with_repeated_commands_says_what_to_do() -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        sv.read_log(commanded(0.01 * np.arange(3000), 0.05), check=True)
    said = [str(w.message) for w in told if "held = true" in str(w.message)]
    assert len(said) == 2  # of each command one


@pytest.mark.parametrize(
    ("name", "held"), [("/drive_cmd/steering_angle", True), ("/eps/steering_angle", False)]
)
def test_a_proposed_map_holds_what_its_name_calls_a_command(name: str, held: bool) -> None:
    columns = commanded(0.01 * np.arange(3000), 0.02)
    columns[name] = columns.pop("steer_rad")
    proposal = sv.propose_channels(columns)
    assert proposal.channel_map.sources["steer_rad"].held is held
    assert ("held = true" in proposal.to_toml()) is held
