"""Driving logs: canonical channels on a uniform grid, checked before they are used."""

from .against_car import check_car, check_steering_of, times_wheelbase
from .build import LEAST_STRETCH_S, LEAST_USABLE_S
from .channels import CHANNELS, COMMANDS, MEASURED, Channel
from .columns import Columns, as_floats, listed, named_columns
from .grid import own_period
from .held import held_rows
from .interpolate import interpolated
from .laws.laws import Contradiction
from .log import Log, Retimed
from .signals import standing
from .stamps import as_seconds, counted_on, seconds_of_stamps
from .together import check_excitation, copies, several_logs, unexcited

__all__ = [
    "CHANNELS",
    "COMMANDS",
    "LEAST_STRETCH_S",
    "LEAST_USABLE_S",
    "MEASURED",
    "Channel",
    "Columns",
    "Contradiction",
    "Log",
    "Retimed",
    "as_floats",
    "as_seconds",
    "check_car",
    "check_excitation",
    "check_steering_of",
    "copies",
    "counted_on",
    "held_rows",
    "interpolated",
    "listed",
    "named_columns",
    "own_period",
    "seconds_of_stamps",
    "several_logs",
    "standing",
    "times_wheelbase",
    "unexcited",
]
