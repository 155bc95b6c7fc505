"""Manoeuvres: what a driver is asked to do, for simulated drives."""

from __future__ import annotations

from .courses import handling_course, lap
from .curves import Curvature, Curve, Knots, Pulse, Pulses, Sweep
from .manoeuvre import Manoeuvre
from .on_path import (
    brake_in_turn,
    constant_radius,
    double_lane_change,
    slalom,
    straight_acceleration,
)
from .open_loop import STEP_S, ramp_steer, sine_sweep, sine_with_dwell, step_steer
from .recognise import Recognised, recognise
from .roads import RoadKind, usual_road
from .steady import peak_lateral_mps2, steady_steer, understeer_gradient

__all__ = [
    "STEP_S",
    "Curvature",
    "Curve",
    "Knots",
    "Manoeuvre",
    "Pulse",
    "Pulses",
    "Recognised",
    "RoadKind",
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
    "usual_road",
]


def all() -> dict[str, Manoeuvre]:
    """Make every manoeuvre with its default parameters, by name; roads are drawn, and none."""
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
