"""The file of a Functional Mock-up Unit: what it says of itself, and what it can be run as."""

from __future__ import annotations

from typing import Any, Literal

from ..errors import InvalidInput

Kind = Literal["model_exchange", "co_simulation"]


def read_description(path: str) -> Any:
    """The model description, whatever a file that is no FMU makes FMPy raise."""
    fmpy = fmpy_module()
    try:
        return fmpy.read_model_description(path)
    except Exception as error:
        raise InvalidInput(
            f"{path}: is no FMU that can be read ({type(error).__name__}: {error}); export the "
            f"model anew, by FMI 2 or 3"
        ) from error


def fmpy_module() -> Any:
    """FMPy, which is not installed with the package."""
    try:
        import fmpy
    except ImportError as error:
        raise InvalidInput(
            "a twin from an FMU needs FMPy: pip install 'sysid-vehicle[fmu]'"
        ) from error
    return fmpy


def kind_of(description: Any, wanted: Kind | None, path: str) -> Kind:
    """What the FMU is run as: as wanted, else by model exchange where it offers that."""
    offered: list[Kind] = []
    if description.modelExchange is not None:
        offered.append("model_exchange")
    if description.coSimulation is not None:
        offered.append("co_simulation")
    if wanted is None and offered:
        return offered[0]
    if wanted is None or wanted not in offered:
        raise InvalidInput(
            f"{path} does not offer {wanted or 'anything that can be run'}; it offers "
            f"{', '.join(offered) or 'nothing'}"
        )
    return wanted
