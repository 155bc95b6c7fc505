"""Physical effects: the catalogue of the compiled core, and those that users define."""

from .catalogue import (
    Effect,
    base_parameters,
    catalogue,
    channels_in_use,
    effect,
)
from .parts import OwnState, Parameter
from .plugins import Plugin, installed_effects
from .scale import in_car, length_beyond, matters_in
from .user import define_effect, forget_effect, load_effects, parameter, state

__all__ = [
    "Effect",
    "OwnState",
    "Parameter",
    "Plugin",
    "base_parameters",
    "catalogue",
    "channels_in_use",
    "define_effect",
    "effect",
    "forget_effect",
    "in_car",
    "installed_effects",
    "length_beyond",
    "load_effects",
    "matters_in",
    "parameter",
    "state",
]
