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
