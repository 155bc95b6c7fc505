"""The car's own numbers (mass, geometry, starting tyres) and their TOML file."""

from __future__ import annotations

import dataclasses
import html
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._common.arrays import FloatArray
from ._common.files import as_path, read_toml, refuse_unknown, write_text
from ._common.kinds import VEHICLE
from ._common.typed import typed, typed_fields
from .errors import InvalidInput, warn
from .tyre import TYRE_RANGES, USUAL_TYRE, Range, Tyre, check_ranges

GRAVITY_MPS2: float = _core.GRAVITY_MPS2
"""Standard gravity, the same in the core."""

AXLES = ("front", "rear")


_VEHICLE_RANGES = {
    "mass_kg": Range(1.0, 50000.0, "total mass in kilograms, driver and fuel included"),
    "yaw_inertia_kgm2": Range(0.0, 1e7, "yaw inertia in kg m^2", above=True),
    "lf_m": Range(0.001, 20.0, "distance CG to front axle in metres"),
    "lr_m": Range(0.001, 20.0, "distance CG to rear axle in metres"),
    "cg_height_m": Range(0.0, 5.0, "height of the CG above the road in metres"),
    "track_front_m": Range(0.0, 5.0, "front track width in metres", above=True),
    "track_rear_m": Range(0.0, 5.0, "rear track width in metres", above=True),
    "drag_area_m2": Range(0.0, 50.0, "drag coefficient times frontal area in m^2"),
    "air_density_kgpm3": Range(0.0, 2.0, "air density in kg/m^3, 1.225 at sea level", above=True),
    "brake_front_share": Range(0.0, 1.0, "front axle's share of the brake force, 0 to 1"),
    "drive_front_share": Range(0.0, 1.0, "front axle's share of the drive force, 0 to 1"),
}

_GEARS = ("steering_ratio", "steer_ratio")
# Mass over wheelbase cubed: from 16 kg/m3 of a formula car to 730 of a loaded tractor, with model
# cars and karts between.
_USUAL_KGPM3, _LEAST_KGPM3, _MOST_KGPM3 = 60.0, 2.0, 6000.0
_OPTIONAL = ("yaw_inertia_kgm2", "air_density_kgpm3")


def slip_angles(
    lf_m: float,
    lr_m: float,
    steer_rad: FloatArray,
    v_x: npt.ArrayLike,
    v_y: FloatArray,
    yaw_rate: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Slip angles of the front and the rear axle [rad], as the core has them."""
    front = steer_rad - np.arctan2(v_y + lf_m * yaw_rate, v_x)
    return front, -np.arctan2(v_y - lr_m * yaw_rate, v_x)


def static_loads(mass_kg: float, lf_m: float, lr_m: float) -> tuple[float, float]:
    """Axle loads at rest, front and rear [N]."""
    per_metre = mass_kg * GRAVITY_MPS2 / (lf_m + lr_m)
    return per_metre * lr_m, per_metre * lf_m


@dataclass(frozen=True)
class Vehicle:
    """Parameters of the car that are known before any identification (ISO 8855, SI).

    Parameters
    ----------
    mass_kg : float
        Total mass as driven.
    lf_m, lr_m : float
        Distance from the CG to the front and the rear axle.
    cg_height_m : float
        Height of the CG above the road.
    track_front_m, track_rear_m : float
        Track widths.
    drag_area_m2 : float
        Drag coefficient times frontal area.
    brake_front_share, drive_front_share : float
        Share of the brake and of the drive force that the front axle transmits, 0 to 1.
    tyre_front, tyre_rear : Tyre
        Starting tyres of the axles.
    yaw_inertia_kgm2 : float or None
        Yaw inertia; None makes it a parameter to identify.
    air_density_kgpm3 : float
        Density of the air.
    name : str
        Name for titles and reports.

    Raises
    ------
    InvalidInput
        If values are out of range; the message names every such key and what it should hold.
    """

    mass_kg: float
    lf_m: float
    lr_m: float
    cg_height_m: float
    track_front_m: float
    track_rear_m: float
    drag_area_m2: float
    brake_front_share: float
    drive_front_share: float
    tyre_front: Tyre = USUAL_TYRE
    tyre_rear: Tyre = USUAL_TYRE
    yaw_inertia_kgm2: float | None = None
    air_density_kgpm3: float = 1.225
    name: str = "vehicle"

    @typed_fields
    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InvalidInput(f"vehicle: name = {self.name!r} is not a text")
        for key in ("tyre_front", "tyre_rear"):
            if not isinstance(getattr(self, key), Tyre):
                raise InvalidInput(
                    f"vehicle '{self.name}': {key} = {getattr(self, key)!r} is no tyre; "
                    "give a sysid_vehicle.Tyre"
                )
        numbers = {key: getattr(self, key) for key in _VEHICLE_RANGES}
        if self.yaw_inertia_kgm2 is None:
            del numbers["yaw_inertia_kgm2"]
        check_ranges(_VEHICLE_RANGES, numbers, f"vehicle '{self.name}'")
        for key, value in numbers.items():
            object.__setattr__(self, key, float(value))
        if self.yaw_inertia_kgm2 is not None:
            typical = self.usual_inertia_kgm2
            if not 0.1 <= self.yaw_inertia_kgm2 / typical <= 10.0:
                raise InvalidInput(f"vehicle '{self.name}': {_inertia_or_mass(self)}")

    @property
    def wheelbase_m(self) -> float:
        """Distance between the axles, ``lf_m + lr_m``."""
        return self.lf_m + self.lr_m

    @property
    def static_loads_n(self) -> tuple[float, float]:
        """Axle loads at rest, front and rear."""
        return static_loads(self.mass_kg, self.lf_m, self.lr_m)

    @property
    def usual_inertia_kgm2(self) -> float:
        """Yaw inertia that cars of this mass and these axles have, ``mass_kg * lf_m * lr_m``.

        The usual first guess: Milliken & Milliken, *Race Car Vehicle Dynamics*, ch. 5.
        """
        return self.mass_kg * self.lf_m * self.lr_m

    def replace(self, **changes: Any) -> Vehicle:
        """Return a copy with some fields changed.

        Raises
        ------
        InvalidInput
            If a field is unknown (near names are given) or a value is out of range.
        """
        fields = [field.name for field in dataclasses.fields(self)]
        refuse_unknown(changes, fields, f"vehicle '{self.name}'")
        return dataclasses.replace(self, **changes)

    @classmethod
    @typed
    def from_toml(cls, path: str | Path) -> Vehicle:
        """Read a vehicle file.

        Parameters
        ----------
        path : str or Path
            TOML file with the fields of this class as keys and the tables ``[tyre.front]`` and
            ``[tyre.rear]`` with B, C, D, E. ``air_density_kgpm3``, ``yaw_inertia_kgm2``, ``name``
            and the table of a tyre of which nothing is known may be left out.

        Raises
        ------
        InvalidInput
            If the file cannot be read, a key is unknown, keys are missing (all are named) or a
            value is out of range.

        Warns
        -----
        SysidWarning
            If ``yaw_inertia_kgm2`` is absent, because it then has to be identified, or the table
            of a tyre, because the search then begins at that of `Tyre`.
        """
        content = read_toml(path, VEHICLE)
        where = str(path)
        name = content.pop("name", as_path(path).name.split(".")[0])
        if not isinstance(name, str):
            raise InvalidInput(f"{where}: name = {name!r} is not a text; put it in quotes")
        tyre_tables = content.pop("tyre", {})
        given = _checked_keys(content, tyre_tables, where)
        try:
            vehicle = cls(
                **given,
                tyre_front=Tyre(**tyre_tables.get("front", {})),
                tyre_rear=Tyre(**tyre_tables.get("rear", {})),
                name=name,
            )
        except InvalidInput as error:
            raise InvalidInput(f"{where}: {error}") from error
        if vehicle.yaw_inertia_kgm2 is None:
            warn(
                f"{where}: yaw_inertia_kgm2 is absent, so it becomes a parameter to identify; "
                f"add it if it was measured"
            )
        absent = [f"[tyre.{axle}]" for axle in AXLES if axle not in tyre_tables]
        if absent:
            usual = ", ".join(f"{k} = {v:g}" for k, v in dataclasses.asdict(USUAL_TYRE).items())
            warn(
                f"{where}: {' and '.join(absent)} absent, so usual values are taken, {usual}, from "
                f"which fits begin; add what is known of the tyres"
            )
        return vehicle

    def to_toml(self, path: str | Path) -> None:
        """Write the vehicle file that :meth:`from_toml` reads; complete or not at all."""
        # The escapes of a JSON string are also those of a TOML string.
        lines = [f"name = {json.dumps(self.name, ensure_ascii=False)}"]
        for key in _VEHICLE_RANGES:
            value = getattr(self, key)
            if value is not None:
                lines.append(f"{key} = {value!r}")
        for axle, tyre in zip(AXLES, (self.tyre_front, self.tyre_rear), strict=True):
            lines += ["", f"[tyre.{axle}]"]
            lines += [f"{key} = {getattr(tyre, key)!r}" for key in TYRE_RANGES]
        write_text(path, "\n".join(lines) + "\n")

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for key in _VEHICLE_RANGES:
            value = getattr(self, key)
            rows.append((key, "to identify" if value is None else f"{value:.6g}"))
        for axle, tyre in zip(AXLES, (self.tyre_front, self.tyre_rear), strict=True):
            numbers = ", ".join(f"{key} {getattr(tyre, key):.6g}" for key in TYRE_RANGES)
            rows.append((f"tyre {axle}", numbers))
        return rows

    def __str__(self) -> str:
        rows = self._rows()
        width = max(len(key) for key, _ in rows)
        return "\n".join([self.name, *(f"  {key:<{width}}  {text}" for key, text in rows)])

    def _repr_html_(self) -> str:
        cells = "".join(
            f"<tr><th>{html.escape(key)}</th><td>{html.escape(text)}</td></tr>"
            for key, text in self._rows()
        )
        return f"<table><caption>{html.escape(self.name)}</caption>{cells}</table>"


def _inertia_or_mass(vehicle: Vehicle) -> str:
    """Which of mass and yaw inertia is wrong, where they do not fit: the wheelbase tells."""
    inertia, typical, mass = vehicle.yaw_inertia_kgm2, vehicle.usual_inertia_kgm2, vehicle.mass_kg
    cube = vehicle.wheelbase_m**3
    if not _LEAST_KGPM3 <= mass / cube <= _MOST_KGPM3:
        tonnes = _LEAST_KGPM3 <= 1e3 * mass / cube <= _MOST_KGPM3
        return (
            f"mass_kg = {mass:g} fits neither yaw_inertia_kgm2 = {inertia:g} nor the wheelbase of "
            f"{vehicle.wheelbase_m:g} m (lf_m + lr_m), with which cars have about "
            f"{_USUAL_KGPM3 * cube:.2g} kg; "
            f"{'it seems to be in tonnes: multiply it by 1000' if tonnes else 'correct the unit'}"
        )
    return (
        f"yaw_inertia_kgm2 = {inertia:g} does not fit the mass and the wheelbase of "
        f"{vehicle.wheelbase_m:g} m: cars lie near mass_kg * lf_m * lr_m = {typical:.4g} kg m^2; "
        f"correct the unit of the one that is wrong, or leave the yaw inertia out to identify it"
    )


def _checked_keys(content: Mapping[str, Any], tyres: Any, where: str) -> dict[str, Any]:
    """Refuse keys of a vehicle file that are unknown, missing or out of range; those that it has.

    Parameters
    ----------
    content : mapping
        Without name and tyres.
    tyres : mapping
        The table of each tyre that is there.
    where : str
        The file, for messages.
    """
    if not isinstance(tyres, dict):
        raise InvalidInput(f"{where}: 'tyre' must be two tables, [tyre.front] and [tyre.rear]")
    given = {key: content[key] for key in _VEHICLE_RANGES if content.get(key) is not None}
    missing = [key for key in _VEHICLE_RANGES if key not in given and key not in _OPTIONAL]
    for key in set(content).intersection(_GEARS):
        raise InvalidInput(
            f"{where}: {key} is no property of the model, whose steering angle is that of the "
            f'road wheels; put it into the channel map: steer_rad = {{ column = "...", factor '
            f"= ... }}, with 1 / {key} in the factor, and remove it here"
        )
    refuse_unknown(content, _VEHICLE_RANGES, where, likely=missing)
    refuse_unknown(tyres, AXLES, f"{where}, [tyre]")
    for axle, table in tyres.items():
        if not isinstance(table, dict):
            raise InvalidInput(f"{where}: 'tyre.{axle}' must be a table [tyre.{axle}]")
        refuse_unknown(table, TYRE_RANGES, f"{where}, [tyre.{axle}]")
        missing += [f"tyre.{axle}.{key}" for key in TYRE_RANGES if key not in table]
    if missing:
        raise InvalidInput(f"{where}: missing keys: {', '.join(missing)}; add them to the file")
    for axle, table in tyres.items():
        check_ranges(TYRE_RANGES, table, f"{where}, [tyre.{axle}]")
    check_ranges(_VEHICLE_RANGES, given, where)
    return given


def vehicle_data(vehicle: Vehicle) -> _core.VehicleData:
    """What the compiled core knows of the car."""
    data = _core.VehicleData()
    for name in (
        "mass_kg",
        "lf_m",
        "lr_m",
        "cg_height_m",
        "track_front_m",
        "track_rear_m",
        "drag_area_m2",
        "air_density_kgpm3",
        "brake_front_share",
        "drive_front_share",
    ):
        setattr(data, name, getattr(vehicle, name))
    return data
