"""`sysid-vehicle twin`: observers around a vehicle simulator, and the experiments on them."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from .._common.arguments import real
from .._common.files import read_json
from .._common.kinds import GAINS
from .._common.style import new_figure
from .._common.text import few
from ..errors import InvalidInput
from ..published import (
    LoadExperiment,
    estimate_mass,
    estimate_pitch,
    estimate_roll_yaw,
    mass_and_sideslip,
    run_schedule,
)
from ..published.figures import joint_figure, load_figure, schedule_figure
from ..published.joint import (
    BENCHMARK_BOX,
    BENCHMARK_GAINS,
    TWIN_BOX,
    benchmark_cost,
    twin_cost,
)
from ..twin import calibrate
from .outputs import add_json, add_output, write_figures, write_picture

_NO_NOISE = float("inf")
_RATIOS = (5.0, 7.5, 10.0, 15.0, 20.0)
_ROAD = (0.0, 0.05, 0.1, 0.2, 0.3)
_LAWS: dict[str, Any] = {
    "side-by-side": "side_by_side",
    "published": "published",
    "gradient": "gradient",
}
_BENCHMARK = "double-track"


@dataclass(frozen=True)
class _Load:
    """An experiment on the load: what estimates, what varies, what the paper tabulates."""

    estimate: Callable[..., LoadExperiment]
    driven: str
    starts: Sequence[Sequence[float]]
    rows: Mapping[str, dict[str, Any]]
    road: bool = False


_WRONG = {"mass": "wrong", "wrong_cg": True}
_BUMPY = {"road_noise": 0.1}
_EXPERIMENTS = {
    "mass": _Load(
        estimate_mass,
        "vx_mps",
        ([-1.0], [0.0], [1.0]),
        {
            "noiseless": {"snr": _NO_NOISE},
            "snr 10": {},
            "snr 10, wrong centre of mass": {"wrong_cg": True},
        },
    ),
    "inertia-roll-yaw": _Load(
        estimate_roll_yaw,
        "steer_rad",
        ([-1.0, -1.0], [0.0, 0.0], [1.0, 0.5]),
        {
            "noiseless": {"snr": _NO_NOISE},
            "noiseless, mass of stage 1": {"snr": _NO_NOISE, "mass": "stage_1"},
            "snr 10": {},
            "snr 10, mass of stage 1": {"mass": "stage_1"},
            "snr 10, wrong mass and centre": _WRONG,
        },
    ),
    "inertia-pitch": _Load(
        estimate_pitch,
        "road_fl_m",
        ([-1.0], [0.0], [0.5]),
        {
            "noiseless": {"snr": _NO_NOISE},
            "road noise": {"snr": _NO_NOISE, **_BUMPY},
            "snr 10": {},
            "snr 10, road noise": _BUMPY,
            "snr 10, road noise, wrong mass": {**_BUMPY, "mass": "wrong"},
            "snr 10, road noise, wrong centre": {**_BUMPY, "wrong_cg": True},
            "snr 10, road noise, both wrong": {**_BUMPY, **_WRONG},
        },
        road=True,
    ),
}


def add_parser(commands: Any) -> None:
    """Add `twin` and its subcommands to the `commands` of the parser."""
    twin = commands.add_parser(
        "twin",
        help="state, mass and inertia by a simulator beside the car",
        epilog="These commands drive the built-in simulator. An FMU, from Python, runs native "
        "code: load none that you do not trust.",
    )
    inner = twin.add_subparsers(dest="twin_command", required=True, metavar="SUBCOMMAND")
    helps = {
        "mass": "the mass, in town",
        "inertia-roll-yaw": "roll and yaw inertia, in a swept steer",
        "inertia-pitch": "the pitch inertia, on a rough road",
    }
    for name, text in helps.items():
        parser = inner.add_parser(name, help=text)
        parser.add_argument(
            "--snr", type=float, default=10.0, metavar="X", help="amplitude of signal to noise; inf"
        )
        parser.add_argument(
            "--wrong-cg", action="store_true", help="the twin has the unloaded centre of mass"
        )
        if name != "mass":
            parser.add_argument(
                "--mass",
                choices=("known", "stage-1", "wrong"),
                default="known",
                help="what the twin has (default: %(default)s)",
            )
        if name == "inertia-pitch":
            parser.add_argument(
                "--road-noise", type=float, default=0.0, metavar="X", help="relative noise"
            )
        _common(parser, tuple(_LAWS))
        parser.add_argument("--table", action="store_true", help="every row of the paper's table")
    stages = inner.add_parser("schedule", help="mass, then roll and yaw, then pitch inertia")
    stages.add_argument(
        "--snr", type=float, default=10.0, metavar="X", help="amplitude of signal to noise; inf"
    )
    stages.add_argument(
        "--road-noise", type=float, default=0.0, metavar="X", help="relative noise of the road"
    )
    _common(stages, tuple(_LAWS))
    tune = inner.add_parser("calibrate", help="gains by Bayesian optimisation, on a lap")
    _common(tune, ("side-by-side", "published", _BENCHMARK))
    tune.add_argument("--trials", type=int, default=60, metavar="N", help="default: %(default)s")
    tune.add_argument(
        "--fresh", type=int, default=5, metavar="N", help="seeds to judge by (default: %(default)s)"
    )
    check = inner.add_parser("validate", help="mass and sideslip on a lap and in lane changes")
    _common(check, ("side-by-side", "published"))
    check.add_argument("--gains", type=Path, metavar="JSON", help="what `calibrate --json` wrote")


def _common(parser: argparse.ArgumentParser, laws: Sequence[str]) -> None:
    parser.add_argument(
        "--law", choices=laws, default=laws[0], help="what corrects (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the noise")
    add_output(parser, "--plot", kind="SVG", help="file for the figures")
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Do the subcommand that was asked for."""
    if args.seed < 0:
        raise InvalidInput(f"--seed {args.seed}: give a whole number from zero up")
    todo = {"calibrate": _calibrate, "validate": _validate, "schedule": _schedule}
    write_figures(args.json, todo.get(args.twin_command, _load)(args), heard)


def _load(args: argparse.Namespace) -> dict[str, Any]:
    experiment = _EXPERIMENTS[args.twin_command]
    if not args.snr > 0.0:
        raise InvalidInput(f"--snr {args.snr}: give a positive number, inf for no noise")
    options: dict[str, Any] = {
        "snr": args.snr,
        "wrong_cg": args.wrong_cg,
        "law": _LAWS[args.law],
        "seed": args.seed,
    }
    if args.twin_command != "mass":
        options["mass"] = args.mass.replace("-", "_")
    if experiment.road:
        if not 0.0 <= args.road_noise < 1.0:
            raise InvalidInput(f"--road-noise {args.road_noise}: give a number from 0 to 1")
        options["road_noise"] = args.road_noise
    done = experiment.estimate(**options)
    print(done)
    figures = done.to_dict()
    if args.table:
        law = {"law": options["law"], "seed": args.seed}
        rows = {
            name: _errors(experiment.estimate(**row, **law))
            for name, row in experiment.rows.items()
        }
        print("\n" + _table(rows, done.names))
        figures["table"] = {
            name: dict(zip(done.names, row, strict=True)) for name, row in rows.items()
        }
    if args.plot is not None:
        others = [experiment.estimate(**options, first_error=e) for e in experiment.starts[1:]]
        sweeps = {
            "signal to noise": {
                ratio: _errors(experiment.estimate(**{**options, "snr": ratio}))
                for ratio in _RATIOS
            }
        }
        if experiment.road:
            sweeps["relative noise of the road"] = {
                noise: _errors(experiment.estimate(**{**options, "road_noise": noise}))
                for noise in _ROAD
            }
        figure = load_figure([done, *others], sweeps, driven=experiment.driven)
        write_picture(args.plot, figure)
    return figures


def _errors(done: LoadExperiment) -> list[float]:
    return [done.error_percent(name) for name in done.names]


def _table(rows: Mapping[str, Sequence[float]], names: Sequence[str]) -> str:
    width = max(map(len, rows))
    head = " " * width + "".join(f"{name:>12s}" for name in names) + "  [% of the change]"
    lines = [
        f"{name:{width}s}" + "".join(f"{value:12.2f}" for value in row)
        for name, row in rows.items()
    ]
    return "\n".join([head, *lines])


def _calibrate(args: argparse.Namespace) -> dict[str, Any]:
    def tell(trial: int, best: float) -> None:
        if sys.stderr.isatty():
            print(f"\r{trial + 1} of {args.trials}: {best:.4g}", end="", file=sys.stderr)

    law = _LAWS.get(args.law)

    def cost(gains: dict[str, float], seed: int = args.seed) -> float:
        if law is None:
            return benchmark_cost(gains, seed=seed)
        return twin_cost(gains, law=law, seed=seed)

    box = BENCHMARK_BOX if law is None else TWIN_BOX[law]
    if args.fresh < 0:
        raise InvalidInput(f"--fresh {args.fresh}: give a whole number from zero up")
    fresh = [partial(cost, seed=args.seed + 1 + k) for k in range(args.fresh)]
    found = calibrate(cost, box, trials=args.trials, seed=args.seed, tell=tell, fresh=fresh)
    print(found)
    if args.plot is not None:
        figure = new_figure(6.0, 3.0)
        found.plot(ax=figure.add_subplot())
        write_picture(args.plot, figure)
    return {
        "law": args.law,
        "gains": found.gains,
        "cost": found.cost,
        "lost": found.lost,
        "candidates": {c.how: c.to_dict() for c in found.candidates},
    }


def _schedule(args: argparse.Namespace) -> dict[str, Any]:
    done = run_schedule(
        snr=args.snr, law=_LAWS[args.law], road_noise=args.road_noise, seed=args.seed
    )
    print(done)
    if args.plot is not None:
        write_picture(args.plot, schedule_figure(done))
    return {"law": args.law, **done.to_dict()}


def _validate(args: argparse.Namespace) -> dict[str, Any]:
    gains, benchmark = None, BENCHMARK_GAINS
    if args.gains is not None:
        law, found = _gains(args.gains)
        if law == _BENCHMARK:
            benchmark = found
        elif law == args.law:
            gains = found
        else:
            raise InvalidInput(f"{args.gains}: gains of --law {law}, but --law is {args.law}")
    done = [
        mass_and_sideslip(
            course,
            law=_LAWS[args.law],
            gains=gains,
            benchmark_gains=benchmark,
            seed=args.seed,
        )
        for course in ("lap", "double_lane_change")
    ]
    print("\n".join(map(str, done)))
    if args.plot is not None:
        write_picture(args.plot, joint_figure(done))
    return {"courses": [experiment.to_dict() for experiment in done]}


def _gains(path: Path) -> tuple[str, dict[str, float]]:
    """Law and gains out of what `calibrate --json` wrote."""
    content = read_json(path, GAINS)
    law, given = content["law"], content["gains"]
    known = {name: TWIN_BOX[of] for name, of in _LAWS.items() if of in TWIN_BOX}
    known[_BENCHMARK] = BENCHMARK_BOX
    if not isinstance(law, str) or law not in known:
        told = few(list(known))
        raise InvalidInput(f"{path}: law = {law!r}; calibrated are {told}: calibrate again")
    if not isinstance(given, dict) or set(given) != set(known[law].ranges):
        told = ", ".join(known[law].ranges)
        raise InvalidInput(f"{path}: --law {law} has the gains {told}; calibrate again")
    found = {name: real(value) for name, value in given.items()}
    for name, value in found.items():
        if value is None or not 0.0 < value < math.inf:
            raise InvalidInput(
                f"{path}: gains.{name} = {given[name]!r}; give a number above 0, or calibrate again"
            )
    return law, {name: value for name, value in found.items() if value is not None}
