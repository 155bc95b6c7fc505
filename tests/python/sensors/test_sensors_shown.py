"""What a check of several logs shows says which log it is of."""

import matplotlib.pyplot as plt
import numpy as np

import sysid_vehicle as sv


def test_several_logs_are_told_apart() -> None:
    model = sv.Model(sv.example_vehicle())
    drives = [sv.drive(model, sv.manoeuvres.lap(20.0), seed=s, rate_hz=50.0) for s in (1, 2)]
    logs = [
        sv.Log.from_arrays({c: np.array(log[c]) for c in log}, name=name)
        for log, name in zip(drives, ("morning", "noon"), strict=True)
    ]
    both, one = sv.check(logs), sv.check(logs[0])
    rows = [line.split() for line in str(both).splitlines() if "50 Hz" in line]
    assert [row[0] for row in rows].count("noon") == len(rows) // 2
    assert "<td>noon</td>" in both._repr_html_().replace('<td class="text">', "<td>")
    assert "morning " not in str(one).split("\n", 1)[1]
    ax = both.plot("vx_mps")
    assert [text.get_text() for text in ax.texts] == ["noon"]
    ends = [line.get_xdata()[[0, -1]] for line in ax.lines if len(line.get_xdata()) > 2]
    assert max(np.max(e) for e in ends) > 1.9 * logs[0].duration_s
    plt.close("all")


def test_what_was_known_before_is_not_shown_as_a_result() -> None:
    """On a straight nothing tells how the car corners; what sensors usually do is no reading."""
    model = sv.Model(sv.example_vehicle())
    straight = sv.drive(model, sv.manoeuvres.straight_acceleration(), seed=1, rate_hz=50.0)
    check = sv.check(straight)
    gain = check["gain_ay"]
    assert not gain.told
    assert not gain.measured
    assert "corners at several speeds would tell it" in str(gain)
    (row,) = (line for line in str(check).splitlines() if line.startswith(f"  {gain.title}"))
    assert not any(character.isdigit() for character in row.replace("ay_mps2", ""))
    assert check.to_dict()["faults"]["gain_ay"]["value"] is None
    # What the log measures is shown, whether it is told well enough or not.
    told = check["gain_ax"]
    assert told.measured
    assert check.to_dict()["faults"]["gain_ax"]["value"] == told.value
