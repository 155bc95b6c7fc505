"""Effects that a session defines are known where its studies are done."""

import os
import subprocess
import sys
from pathlib import Path

import sysid_vehicle as sv

PACKAGE = Path(sv.__file__).parents[1]

SESSION = """
import sysid_vehicle as sv


def main() -> None:
    sv.define_effect(
        "roof_box",
        title="side force that grows with speed",
        parameters=[sv.parameter("gain", "N s2/m2", typical=0.5, lower=-5, upper=5)],
        force_y=lambda d, p: p.gain * d.v_x**2,
    )
    car = sv.Model(sv.example_vehicle())
    boxed = car.add("roof_box").with_values({"roof_box.gain": 2.0})
    log = sv.drive(boxed, sv.manoeuvres.lap(15.0), seed=2, rate_hz=25.0)
    for _ in range(2):
        fleet = sv.improve_many(
            car, {"monday": log}, out="out", workers=2, candidates=["roof_box", "mass"], starts=1
        )
        for row in fleet.rows:
            print(row.failure, [e.id for e in row.effects], row.seconds)


if __name__ == "__main__":
    main()
"""


def test_a_spawned_process_knows_the_effects_of_the_session(tmp_path: Path) -> None:
    """The second run finds the study: the same effect is the same question."""
    (tmp_path / "session.py").write_text(SESSION)
    path = os.pathsep.join([str(PACKAGE), os.environ.get("PYTHONPATH", "")])
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "session.py"],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert ran.returncode == 0, ran.stderr
    first, second = ran.stdout.splitlines()
    assert first.startswith(" ['roof_box']")
    assert second == first
