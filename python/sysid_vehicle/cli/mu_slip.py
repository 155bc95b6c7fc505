"""`sysid-vehicle mu-slip DATA`: the friction curve behind readings of friction over slip."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from .._common.style import new_figure
from ..online import (
    MAGIC_FORMULA,
    TWO_PARAMETER,
    MuSlipComparison,
    MuSlipData,
    animate_mu_slip,
    compare_mu_slip,
    draw_mu_slip_lissajous,
    mu_slip_ekf,
    mu_slip_over_noise,
    mu_slip_overview,
    save_animation,
)
from .outputs import add_json, add_output, write_figures, write_picture

_CURVES = {curve.name: curve for curve in (TWO_PARAMETER, MAGIC_FORMULA)}
_CONTRACT = """\
DATA is a CSV file whose first line names the columns; these two are read, others are ignored:
  slip  braking slip (v - v_wheel) / v, a ratio: 0 rolling, 1 locked
  mu    braking force over vertical load; an empty cell is a missing reading
Rows stand in the order in which the readings were taken."""


def add_parser(commands: Any) -> None:
    """Add the command to the `commands` of the parser."""
    parser = commands.add_parser(
        "mu-slip",
        help="peak friction and its slip from readings of friction over slip",
        description=_CONTRACT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("data", type=Path, metavar="DATA", help="CSV file: columns slip and mu")
    parser.add_argument(
        "--curve", choices=sorted(_CURVES), default=TWO_PARAMETER.name, help="default: %(default)s"
    )
    parser.add_argument(
        "--noise-std",
        type=float,
        metavar="X",
        help="standard deviation of a mu reading (default: learnt from the readings)",
    )
    add_output(parser, "--plot", kind="SVG", help="file for the figures")
    add_output(parser, "--animation", kind="GIF", help="file for the convergence")
    add_output(
        parser,
        "--lissajous",
        kind="SVG",
        help="file for friction against slip over time, measured and filtered",
    )
    add_output(
        parser,
        "--over-noise",
        kind="SVG",
        help="simulate the recommended curve at the slips of DATA with several levels of noise; "
        "print the errors of every estimator, and draw them into this file",
    )
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Estimate with every method, print them, and write what was asked for."""
    curve = _CURVES[args.curve]
    comparison = compare_mu_slip(MuSlipData.from_csv(args.data, args.noise_std), curve=curve)
    print(comparison)
    print()
    print(f"Recommended: {comparison.best}")
    filtered = mu_slip_ekf(comparison.data, curve=curve)
    if args.plot is not None:
        write_picture(args.plot, mu_slip_overview(filtered))
    if args.lissajous is not None:
        figure = new_figure(6.5, 4.5)
        draw_mu_slip_lissajous(filtered, figure.subplots())
        write_picture(args.lissajous, figure)
    if args.over_noise is not None:
        _over_noise(comparison, args.over_noise)
    if args.animation is not None:
        save_animation(animate_mu_slip(filtered), args.animation)
    write_figures(args.json, _plain(comparison), heard)


def _over_noise(comparison: MuSlipComparison, path: Path) -> None:
    """Judge the estimators on data like these, from a quarter of their noise to four times it."""
    data, best = comparison.data, comparison.best
    assert data.noise_std is not None  # a comparison has learnt it
    levels = data.noise_std * np.array([0.25, 0.5, 1.0, 2.0, 4.0])
    slip = data.slip[np.isfinite(data.mu)]
    study = mu_slip_over_noise(best.values, curve=best.curve, noise_std=levels, slip=slip)
    print()
    print(study)
    figure = new_figure(12.0, 5.0)
    for ax, name in zip(figure.subplots(1, 2), best.curve.parameters[:2], strict=True):
        study.plot(ax, name)
    write_picture(path, figure)


def _plain(comparison: MuSlipComparison) -> dict[str, Any]:
    return {
        "curve": comparison.best.curve.name,
        "noise_std": comparison.data.noise_std,
        "recommended": comparison.best.method,
        "notes": list(comparison.notes),
        "estimates": [
            {
                "method": e.method,
                "parameters": {
                    name: {"value": float(x), "std": float(s)}
                    for name, x, s in zip(e.curve.parameters, e.values, e.std, strict=True)
                },
                "notes": list(e.notes),
            }
            for e in comparison.estimates
        ],
    }
