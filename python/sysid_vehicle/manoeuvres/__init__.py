"""Manoeuvres: what a driver is asked to do, for simulated drives."""

from __future__ import annotations

from ._courses import handling_course, lap
from ._curves import Curvature, Curve, Knots, Pulse, Pulses, Sweep
from ._manoeuvre import Manoeuvre
from ._on_path import (
    brake_in_turn,
    constant_radius,
    double_lane_change,
    slalom,
    straight_acceleration,
)
from ._open_loop import ramp_steer, sine_sweep, sine_with_dwell, step_steer
from ._recognise import Recognised, recognise
from ._steady import peak_lateral_mps2, steady_steer, understeer_gradient

__all__ = [
    "Curvature",
    "Curve",
    "Knots",
    "Manoeuvre",
    "Pulse",
    "Pulses",
    "Recognised",
    "Sweep",
    "all",
    "brake_in_turn",
    "constant_radius",
    "double_lane_change",
    "handling_course",
    "lap",
    "peak_lateral_mps2",
    "ramp_steer",
    "recognise",
    "sine_sweep",
    "sine_with_dwell",
    "slalom",
    "steady_steer",
    "step_steer",
    "straight_acceleration",
    "understeer_gradient",
]


def all() -> dict[str, Manoeuvre]:
    """Make every manoeuvre of the package with its default parameters, by name."""
    made = (
        lap(),
        handling_course(),
        step_steer(),
        ramp_steer(),
        sine_sweep(),
        sine_with_dwell(),
        slalom(),
        double_lane_change(),
        constant_radius(),
        brake_in_turn(),
        straight_acceleration(),
    )
    return {m.name: m for m in made}
