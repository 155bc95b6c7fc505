"""One study for each log of a fleet, on all cores or on a cluster."""

from .improve_many import improve_many
from .manifest import manifest_jobs
from .results import Cause, Effect, Fleet, Row

__all__ = ["Cause", "Effect", "Fleet", "Row", "improve_many", "manifest_jobs"]
