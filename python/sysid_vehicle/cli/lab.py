"""`sysid-vehicle lab`: the closed-loop laboratory from the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import published
from ..effects import effect
from ..errors import InvalidInput, near_names
from ..lab import (
    ClosedLoop,
    Preview,
    Setup,
    design_excitation,
    excitation,
    overview,
    preview,
    run_closed_loop,
)
from ..model import Model
from ..vehicle import Vehicle
from . import lab_logs
from .outputs import add_json, add_output, write_figures, write_picture

_DESIGNED = "designed"
_PRESETS = {"default": Setup.default, "published": published.setup}


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `lab` and its subcommands to the program's commands."""
    lab = commands.add_parser("lab", help="drive a simulated car in closed loop to learn its tyres")
    inner = lab.add_subparsers(dest="lab_command", required=True, metavar="SUBCOMMAND")
    for name, (text, arguments, _) in _SUBCOMMANDS.items():
        arguments(inner.add_parser(name, help=text))


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Do the subcommand that was asked for."""
    _SUBCOMMANDS[args.lab_command][2](args, heard)


def _run_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--excitation",
        default="identification",
        metavar="NAME",
        help=f"what is driven: '{_DESIGNED}' to have one designed for this car, or one of "
        f"{', '.join(_excitations())} (default: %(default)s)",
    )
    parser.add_argument(
        "--preset",
        choices=tuple(_PRESETS),
        default="default",
        help="laboratory: that of this package, or the published one with its defects "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--vehicle", type=Path, metavar="TOML", help="the car (default: the published one)"
    )
    parser.add_argument(
        "--effects",
        default="",
        metavar="A,B",
        help="effects that the car has too, each at its typical size",
    )
    parser.add_argument(
        "--duration",
        type=float,
        metavar="S",
        help="length, where the excitation has a choice (default: its own; 60 if designed)",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the sensors' noise")
    parser.add_argument("--preview", action="store_true", help="also say what it will teach")
    add_output(parser, "--log", kind="CSV", help="log to write")
    add_output(parser, "--plot", kind="SVG", help="picture to write")
    add_json(parser)


def _run(args: argparse.Namespace, heard: list[str]) -> None:
    if args.seed < 0:
        raise InvalidInput(f"--seed {args.seed}: give a whole number from zero up")
    setup = _setup(args)
    seen: Preview | None = None
    if args.excitation == _DESIGNED:
        length = {} if args.duration is None else {"duration_s": args.duration}
        design = design_excitation(setup, seed=args.seed, **length)
        print(design, end="\n\n")
        driven: excitation.Excitation = design.excitation
        setup, seen = design.setup, design.preview
    else:
        driven = _excitation(args)
        if args.preview:
            seen = preview(driven, setup, seed=args.seed)
            print(seen, end="\n\n")
    drive = run_closed_loop(driven, setup, seed=args.seed)
    print(drive)
    if args.log is not None:
        drive.to_log().to_csv(args.log)
        print(f"Log: {args.log}")
    if args.plot is not None:
        write_picture(args.plot, overview(drive))
    write_figures(args.json, _figures(drive, seen), heard)


def _setup(args: argparse.Namespace) -> Setup:
    setup = _PRESETS[args.preset]()
    if args.vehicle is not None:
        if args.preset != "default":
            raise InvalidInput(f"--preset {args.preset} has a car of its own; leave --vehicle out")
        setup = Setup.of(Model(Vehicle.from_toml(args.vehicle)))
    for name in (part.strip() for part in args.effects.split(",")):
        if not name:
            continue
        plant = setup.plant if name in setup.plant.effects else setup.plant.add(name)
        typical = {n: p.null_value + p.typical for n, p in effect(name).named.items()}
        setup = replace(setup, plant=plant.with_values(typical))
    return setup


def _excitations() -> dict[str, excitation.Excitation]:
    return {**published.excitations(), **excitation.all()}


def _excitation(args: argparse.Namespace) -> excitation.Excitation:
    known = _excitations()
    if args.excitation not in known:
        raise InvalidInput(
            f"--excitation: nothing is called '{args.excitation}'"
            f"{near_names(args.excitation, known)}; there are {_DESIGNED}, {', '.join(known)}"
        )
    chosen = known[args.excitation]
    if args.duration is None:
        return chosen
    if not isinstance(chosen, published.Identification | published.Oval | excitation.Weaving):
        raise InvalidInput(f"--duration: {chosen.name} has a length of its own; leave it out")
    return replace(chosen, duration_s=args.duration)


def _figures(drive: ClosedLoop, seen: Preview | None) -> dict[str, Any]:
    figures: dict[str, Any] = {
        "excitation": drive.excitation.name,
        "setup": drive.setup.name,
        "duration_s": float(drive.time_s[-1]),
        "lost_s": drive.lost_s,
        "too_hard": drive.too_hard,
        "tracking_rms": drive.tracking,
        "observer_rms": drive.observer_error,
        "limits": {
            s.what: {"share": s.share, "first_s": s.first_s, "longest_s": s.longest_s}
            for s in drive.saturation
        },
    }
    if seen is not None:
        figures["expected"] = {
            e.name: {"value": e.value, "std": e.std, "relative": e.relative} for e in seen.expected
        }
        figures["slip_over_peak"] = {c.axle: c.reached for c in seen.coverage}
    return figures


_Subcommand = tuple[
    str,
    Callable[[argparse.ArgumentParser], None],
    Callable[[argparse.Namespace, list[str]], None],
]
# By name: the line of help, what may be typed, what it does.
_SUBCOMMANDS: dict[str, _Subcommand] = {
    "run": ("drive an excitation, write its log", _run_arguments, _run),
    "em": (
        "learn the noise of sensors and disturbances, estimate the unexplained forces",
        lab_logs.em_arguments,
        lab_logs.em,
    ),
    "identify": (
        "identify the tyres of both axles from logs",
        lab_logs.identify_arguments,
        lab_logs.identify,
    ),
    "validate": (
        "predict validation data with the tyres identified",
        lab_logs.validate_arguments,
        lab_logs.validate,
    ),
}
