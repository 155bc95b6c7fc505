"""The command line: `sysid-vehicle`."""

from .main import main

__all__ = ["main"]
