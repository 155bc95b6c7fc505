"""The command `next-drive`: the manoeuvre that tells effects apart with the least to drive."""

from __future__ import annotations

import argparse

from ..diagnose import DriveLimits, suggest_manoeuvre
from ..errors import InvalidInput
from ..identify import identify
from ..model import Model
from ..vehicle import Vehicle
from .log_arguments import add_driving, add_effects, names, read_logs
from .outputs import add_json, add_output, write_figures, write_picture

_USUAL = DriveLimits()


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "next-drive", help="the manoeuvre that tells effects apart, as something to drive"
    )
    add_driving(parser)
    parser.add_argument(
        "--between",
        required=True,
        type=names,
        metavar="A,B[,...]",
        help="the likeliest effect, then those that it is to be told from",
    )
    add_effects(parser)
    parser.add_argument(
        "--nuisances", action="store_true", help="fit offsets that every measured log has"
    )
    limits = {
        "--top-speed": (
            _USUAL.speed_mps,
            "M/S",
            "highest speed",
            ", less for a small car or a lorry",
        ),
        "--lateral": (
            _USUAL.lateral_mps2,
            "M/S2",
            "highest lateral acceleration",
            ", less for a high car",
        ),
        "--duration": (_USUAL.duration_s, "S", "longest drive", ""),
    }
    for name, (usual, unit, what, less) in limits.items():
        told = f"{what} (default: {usual:g}{less})"
        parser.add_argument(name, type=float, metavar=unit, help=told)
    parser.add_argument(
        "--area", nargs=2, type=float, metavar=("LENGTH", "WIDTH"), help="ground there is [m]"
    )
    add_output(parser, "--csv", kind="CSV", help="steering and speed over time")
    add_output(parser, "--picture", kind="SVG", help="picture of track and steering")
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Fit, suggest, print, write."""
    if len(args.between) < 2:
        told = ",".join(args.between)
        raise InvalidInput(f"--between {told}: give two effects or more, as in steer_lag,mass")
    model = Model(Vehicle.from_toml(args.vehicle))
    if args.nuisances:
        model = model.with_nuisances()
    model = model.add(*args.effects)
    logs = read_logs(args.logs, args, model.vehicle)
    area = None if args.area is None else (args.area[0], args.area[1])
    known = {
        "speed_mps": args.top_speed,
        "lateral_mps2": args.lateral,
        "area_m": area,
        "duration_s": args.duration,
    }
    given = {name: value for name, value in known.items() if value is not None}
    limits = DriveLimits.usual(model.vehicle, **given)
    fit = identify(model, logs)
    found = suggest_manoeuvre(fit, *args.between, limits=limits)
    print(found)
    write_figures(args.json, found.to_dict(), heard)
    if args.csv is not None:
        found.best.to_csv(args.csv)
        print(f"Steering and speed: {args.csv}")
    if args.picture is not None:
        write_picture(args.picture, found.best.picture())
