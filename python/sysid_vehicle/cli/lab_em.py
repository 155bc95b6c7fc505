"""`sysid-vehicle lab em`: learn the observer's noise from logs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .._style import new_figure
from ..lab import (
    EMResult,
    NoiseStructure,
    Observer,
    ObserverCar,
    ObserverNoise,
    ObserverRecord,
    StateEstimate,
    learn_observer_noise,
)
from .lab_inputs import add_log_arguments, add_vehicle_argument, vehicle_of
from .log_arguments import read_logs
from .outputs import add_json, add_output, write_figures, write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Say what may be typed."""
    add_log_arguments(parser)
    add_vehicle_argument(parser)
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


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Learn, print, and write what was asked for; `heard` are the warnings so far."""
    vehicle = vehicle_of(args)
    car = ObserverCar.of(vehicle, drag_nspm=args.drag)
    tyres = (vehicle.tyre_front, vehicle.tyre_rear)
    front, rear = args.stiffness or [tyre.cornering_stiffness_per_load for tyre in tyres]
    records = [
        ObserverRecord.from_log(log, car, (front, rear)) for log in read_logs(args.logs, args)
    ]
    pair = (("yaw_rate_radps", "ay_mps2"),) if args.correlated else ()
    result = learn_observer_noise(
        Observer(car, ObserverNoise.first_guess(records[0], car)),
        records,
        sensors=NoiseStructure(correlated=pair),
        most_iterations=args.iterations,
    )
    observer = Observer(car, result.noise)
    estimates = [observer.smoothed(record) for record in records]
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
