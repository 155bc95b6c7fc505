"""Effects that installed packages define, found by their entry points.

A package names them in its metadata, `[project.entry-points."sysid_vehicle.effects"]`, each by the
id of the effect. Looking for them reads metadata only. The code of a package runs when one of its
effects is asked for, and a warning says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from ..errors import InvalidInput, warn

GROUP = "sysid_vehicle.effects"


@dataclass(frozen=True)
class Plugin:
    """An effect that an installed package defines; none of its code has run.

    Attributes
    ----------
    id : str
        Of the effect.
    package, version : str
        What defines it.
    """

    id: str
    package: str
    version: str

    def __str__(self) -> str:
        return f"{self.id}: defined by the package {self.package} {self.version}"


def installed_effects() -> tuple[Plugin, ...]:
    """Effects of installed packages, by their metadata alone.

    Returns
    -------
    tuple of Plugin
        Sorted by id.
    """
    return tuple(sorted((_told(e) for e in entry_points(group=GROUP)), key=lambda p: p.id))


def _told(entry: EntryPoint) -> Plugin:
    of = entry.dist
    return Plugin(entry.name, of.name if of else "unknown", of.version if of else "unknown")


def run(id_: str) -> bool:
    """Run the code of the package that defines an effect, and say so; False if there is none.

    Raises
    ------
    InvalidInput
        Several packages define it, or its code fails.
    """
    found = list(entry_points(group=GROUP, name=id_))
    if not found:
        return False
    told = [_told(e) for e in found]
    if len({(p.package, p.version) for p in told}) > 1:
        raise InvalidInput(
            f"effect '{id_}': several packages define it, "
            f"{', '.join(f'{p.package} {p.version}' for p in told)}; uninstall all but one"
        )
    warn(
        f"effect '{id_}': running code of the package {told[0].package} {told[0].version}, "
        f"{found[0].value}, which can do whatever you can"
    )
    try:
        made = found[0].load()
        if callable(made):
            made()
    except InvalidInput as e:
        raise InvalidInput(f"{told[0].package} {told[0].version}: {e}") from e
    except Exception as e:
        raise InvalidInput(
            f"{told[0].package} {told[0].version}: {type(e).__name__}: {e}; effect '{id_}' is "
            "not defined"
        ) from e
    return True
