"""`sysid-vehicle improve-many`: a study for each log of a fleet."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._common.progress import note
from ..errors import InvalidInput
from ..fleet import manifest_jobs
from ..fleet.improve_many import run as improve_all
from .log_arguments import say_it_runs


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the program's."""
    parser = commands.add_parser(
        "improve-many", help="improve a fleet: a study for each log, causes over all cars"
    )
    parser.add_argument("manifest", type=Path, metavar="TOML", help="cars, logs and options")
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FOLDER",
        help="folder for the results; what it holds already is not done again",
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="processes (default: one for each core)"
    )
    parser.add_argument(
        "--retry", action="store_true", help="try again what failed in an earlier run"
    )


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Do the studies that the folder does not hold yet, and tell the causes."""
    jobs = manifest_jobs(args.manifest)
    for path in dict.fromkeys(p for job in jobs for p in job.define):
        say_it_runs(path)
    fleet = improve_all(
        jobs,
        args.out,
        workers=args.workers,
        retry=args.retry,
        tell=note,
    )
    print(fleet)
    print(f"Report: {args.out / 'report.html'}")
    if fleet.failed:  # said with a status of its own: scripts do not read what was printed
        every = len(fleet.failed) + len(fleet.done)
        raise InvalidInput(
            f"{len(fleet.failed)} of {every} studies failed; mend what is said of each, or "
            "try them again with --retry"
        )
