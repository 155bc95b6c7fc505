"""A pool of processes ends at once when its work is interrupted, whatever they do."""

import time
from pathlib import Path

import pytest

from sysid_vehicle.fleet.pool import process_pool


def test_processes_that_are_being_loaded_are_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text("import time\ntime.sleep(120)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    def interrupted() -> None:
        with process_pool(2) as pool:
            pool.submit(time.sleep, 0.0)
            time.sleep(0.3)
            raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - began < 30.0
