"""Driving logs: canonical channels on a uniform grid, checked before they are used."""

from ._channels import CHANNELS, Channel
from ._log import Log, check_excitation

__all__ = ["CHANNELS", "Channel", "Log", "check_excitation"]
