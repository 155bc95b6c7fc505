"""The subcommands of `sysid-vehicle lab` that read logs: `em`, `identify` and `validate`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from .._common.style import new_figure
from ..errors import InvalidInput, warn
from ..identify import METHODS
from ..lab import (
    EMResult,
    GreyBoxVehicle,
    IdentifiedCar,
    NoiseStructure,
    Observer,
    ObserverCar,
    ObserverNoise,
    ObserverRecord,
    Setup,
    StateEstimate,
    TyreLog,
    identify_tyres,
    learn_observer_noise,
    validate_tyres,
)
from ..lab.observer.observed import READINGS
from ..log import Log, check_car
from ..vehicle import AXLES, Vehicle
from .log_arguments import LOG_HELP, add_reading, read_logs
from .outputs import add_json, add_output, write_figures, write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def em_arguments(parser: argparse.ArgumentParser) -> None:
    """Say what may be typed of `lab em`."""
    _log_arguments(parser)
    _vehicle_argument(parser)
    parser.add_argument(
        "--stiffness",
        nargs=2,
        type=float,
        metavar=("FRONT", "REAR"),
        help="nominal cornering stiffness per load in 1/rad (default: the vehicle's tyres)",
    )
    parser.add_argument(
        "--drag", type=float, default=0.0, metavar="C", help="drag per speed in N s/m (default: 0)"
    )
    parser.add_argument(
        "--correlated",
        action="store_true",
        help="let the noise of the yaw rate and of the lateral acceleration be correlated",
    )
    parser.add_argument(
        "--iterations",
        type=int,
        default=300,
        metavar="N",
        help="at most so many (default: %(default)s)",
    )
    add_output(parser, "--plot", kind="SVG", help="log-likelihood, noise, and forces of each log")
    add_json(parser)


def em(args: argparse.Namespace, heard: list[str]) -> None:
    """Learn, print, and write what was asked for; `heard` are the warnings so far."""
    vehicle = vehicle_of(args)
    car = ObserverCar.of(vehicle, drag_nspm=args.drag)
    tyres = (vehicle.tyre_front, vehicle.tyre_rear)
    front, rear = args.stiffness or [tyre.cornering_stiffness_per_load for tyre in tyres]
    if not min(front, rear) > 0.0:
        raise InvalidInput(
            f"--stiffness {front:g} {rear:g}: give two numbers above 0, the cornering stiffness of "
            "either axle per load in 1/rad; cars have 8 to 30"
        )
    logs = _logs_of(args, vehicle)
    records = [ObserverRecord.from_log(log, car, (front, rear)) for log in logs]
    pair = (("yaw_rate_radps", "ay_mps2"),) if args.correlated else ()
    result = learn_observer_noise(
        Observer(car, ObserverNoise.first_guess(records[0], car)),
        records,
        sensors=NoiseStructure(correlated=pair),
        most_iterations=args.iterations,
    )
    observer = Observer(car, result.noise)
    estimates = [
        observer.smoothed(replace(record, inputs_held=held))
        for record, held in zip(records, result.inputs_held, strict=True)
    ]
    print(result)
    for estimate in estimates:
        print()
        print(estimate)
    if args.plot is not None:
        write_picture(args.plot, _figure(result, estimates))
    write_figures(args.json, result.to_dict(), heard)


def _figure(result: EMResult, estimates: list[StateEstimate]) -> Figure:
    rows = 1 + len(estimates)
    figure = new_figure(10.0, 3.2 * rows)
    grid = figure.add_gridspec(rows, 2)
    result.plot(ax=figure.add_subplot(grid[0, 0]))
    result.plot_noise(ax=figure.add_subplot(grid[0, 1]))
    for row, estimate in enumerate(estimates, start=1):
        ax = estimate.plot_forces(ax=figure.add_subplot(grid[row, :]))
        ax.set_title(estimate.name)
    return figure


def identify_arguments(parser: argparse.ArgumentParser) -> None:
    """Say what may be typed of `lab identify`."""
    _log_arguments(parser)
    _vehicle_argument(parser)
    parser.add_argument(
        "--no-sideslip", action="store_true", help="do without the v_y that the logs have"
    )
    parser.add_argument(
        "--mass-tolerance",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="how well the mass is known, as a relative standard deviation (default: exactly)",
    )
    parser.add_argument(
        "--residual-terms", action="store_true", help="also fit P1, P2 and P3 of a_y"
    )
    parser.add_argument(
        "--combined-slip",
        choices=("yes", "no"),
        help="whether drive and brake force cost side force (default: what is likelier)",
    )
    parser.add_argument(
        "--starts", type=int, default=16, metavar="N", help="searches (default: %(default)s)"
    )
    parser.add_argument(
        "--method", choices=tuple(METHODS), default="gauss-newton", help="local optimiser"
    )
    parser.add_argument(
        "--fast", action="store_true", help="intervals from the information matrix alone"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the start points")
    add_output(parser, "--plot", kind="SVG", help="tyre curves to write")
    add_json(parser)


def identify(args: argparse.Namespace, heard: list[str]) -> None:
    """Identify, print, and write what was asked for."""
    vehicle = vehicle_of(args)
    car = GreyBoxVehicle.of(vehicle, mass_tolerance=args.mass_tolerance)
    logs = [part for log in _logs_of(args, vehicle) for part in TyreLog.from_log(log, car)]
    if args.no_sideslip:
        logs = [log.without_sideslip() for log in logs]
    fit = identify_tyres(
        car,
        logs,
        residual_terms=args.residual_terms,
        combined_slip=None if args.combined_slip is None else args.combined_slip == "yes",
        starts=args.starts,
        method=args.method,
        profiles=not args.fast,
        seed=args.seed,
    )
    print(fit)
    if args.plot is not None:
        figure = new_figure(9.0, 3.8)  # two axes: curves that agree would cover each other
        axes = figure.subplots(1, 2, sharey=True)
        for ax, axle in zip(axes, AXLES, strict=True):
            fit.plot(ax, [axle]).label_outer()
        write_picture(args.plot, figure)
    write_figures(args.json, fit.to_dict(), heard)


def validate_arguments(parser: argparse.ArgumentParser) -> None:
    """Say what may be typed of `lab validate`."""
    _log_arguments(parser)
    parser.add_argument(
        "--tyres",
        type=Path,
        required=True,
        metavar="JSON",
        help="what `lab identify --json` wrote, from other logs",
    )
    parser.add_argument(
        "--horizon",
        type=float,
        default=1.0,
        metavar="S",
        help="how far to look ahead, beside one sample and the whole drive (default: %(default)g)",
    )
    add_output(parser, "--plot", kind="SVG", help="picture of the first log")
    add_json(parser)


def validate(args: argparse.Namespace, heard: list[str]) -> None:
    """Predict, print, and write what was asked for."""
    car = IdentifiedCar.from_json(args.tyres)
    read = read_logs(args.logs, args, None)
    of, base = car.vehicle, car.vehicle.lf_m + car.vehicle.lr_m
    for log in () if args.unchecked else read:
        check_car(log, mass_kg=of.mass_kg, wheelbase_m=base, lf_m=of.lf_m)
    logs = [part for log in read for part in TyreLog.from_log(log, car.vehicle)]
    found = validate_tyres(car, logs, horizon_s=args.horizon)
    print("\n\n".join(map(str, found)))
    if args.plot is not None:
        figure = new_figure(7.0, 2.2 * len(READINGS))
        for axes, reading in zip(figure.subplots(len(READINGS)), READINGS, strict=True):
            found[0].plot(axes, reading=reading)
        write_picture(args.plot, figure)
    write_figures(args.json, {"drives": [v.to_dict() for v in found]}, heard)


def _logs_of(args: argparse.Namespace, vehicle: Vehicle) -> list[Log]:
    """Logs of this car: with another mass or wheelbase a search is long, and finds nothing."""
    logs = read_logs(args.logs, args, vehicle)
    for log in () if args.unchecked else logs:
        check_car(log, mass_kg=vehicle.mass_kg, wheelbase_m=vehicle.wheelbase_m, lf_m=vehicle.lf_m)
    return logs


def _log_arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for logs and how to read them."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help=LOG_HELP)
    add_reading(parser)
    parser.add_argument(
        "--unchecked",
        action="store_true",
        help="take the logs as they are: a car beyond its peak looks like wrong units or signs",
    )


def _vehicle_argument(parser: argparse.ArgumentParser) -> None:
    """Ask for the car."""
    parser.add_argument(
        "--vehicle", type=Path, metavar="TOML", help="the car (default: the published one)"
    )


def vehicle_of(args: argparse.Namespace) -> Vehicle:
    """Read the car, or take the one that the laboratory drives."""
    if args.vehicle is None:
        warn("no --vehicle was given: mass, inertia and geometry are those of the published car")
        return Setup.default().plant.vehicle
    return Vehicle.from_toml(args.vehicle)
