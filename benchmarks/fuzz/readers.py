"""Attack one of the readers with atheris, which looks for input that reaches new code.

    pip install atheris
    python benchmarks/fuzz/readers.py log.csv|car.toml|map.toml|tyre.csv FOLDER [libFuzzer options]

FOLDER keeps what was found to reach new code; give `-max_total_time=600` for ten minutes. What ends
in a foreign error or warning is written as `crash-...` into the current folder.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import atheris

PACKAGE = ["sysid_vehicle.read", "sysid_vehicle.log", "sysid_vehicle.vehicle"]

with atheris.instrument_imports(include=PACKAGE):
    from sysid_vehicle import SysidError, SysidWarning

import files  # noqa: E402


def main(argv: Sequence[str]) -> None:
    """Run until the time is over or something is found."""
    if len(argv) < 3 or argv[1] not in files.READERS:
        raise SystemExit(__doc__)
    text, reader = files.READERS[argv[1]]
    seeds = Path(argv[2])
    seeds.mkdir(parents=True, exist_ok=True)
    (seeds / "right").write_bytes(text)
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", SysidWarning)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / argv[1]

        def attack(data: bytes) -> None:
            path.write_bytes(data)
            with contextlib.suppress(SysidError):
                reader(path)

        atheris.Setup([argv[0], str(seeds), *argv[3:]], attack)
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv)
