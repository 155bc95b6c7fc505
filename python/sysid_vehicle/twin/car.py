"""The twin's car: fourteen degrees of freedom, its load, and loads made of point masses.

Equations: `cpp/include/sysid/twin/vehicle14.hpp` and `load.hpp`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .. import _core
from .._common.arrays import FloatArray
from .._common.text import html_text
from .._common.typed import typed_fields
from ..errors import InvalidInput, near_names


@dataclass(frozen=True)
class PointMass:
    """A mass at a place: x ahead of the front axle, y to the left, z above the ground."""

    mass_kg: float
    x_m: float
    y_m: float
    z_m: float


LOAD_NAMES = (
    *("mass_kg", "jxx_kgm2", "jyy_kgm2", "jzz_kgm2", "cg_x_m", "cg_y_m", "cg_z_m"),
    *("jxy_kgm2", "jxz_kgm2", "jyz_kgm2"),
)
"""Names of the numbers of a load, in their order."""


@dataclass(frozen=True)
class Load:
    """Mass, moments of inertia and centre of mass of a car with what it carries.

    Parameters
    ----------
    mass_kg : float
        Total mass.
    jxx_kgm2, jyy_kgm2, jzz_kgm2 : float
        Moments of inertia about the centre of mass.
    cg_x_m, cg_y_m, cg_z_m : float
        Centre of mass ahead of the front axle (negative inside the wheelbase), to the left, and
        above the ground.
    jxy_kgm2, jxz_kgm2, jyz_kgm2 : float
        Products of inertia, the sums of mass times both distances from the centre of mass; the
        inertia tensor has their negatives.

    Raises
    ------
    InvalidInput
        If a mass or a moment of inertia is not positive, a number is not finite, or the products
        are too large for the moments.
    """

    mass_kg: float
    jxx_kgm2: float
    jyy_kgm2: float
    jzz_kgm2: float
    cg_x_m: float
    cg_y_m: float
    cg_z_m: float
    jxy_kgm2: float = 0.0
    jxz_kgm2: float = 0.0
    jyz_kgm2: float = 0.0

    @typed_fields
    def __post_init__(self) -> None:
        for name in LOAD_NAMES:
            if not np.isfinite(getattr(self, name)):
                raise InvalidInput(f"load: {name} = {getattr(self, name)!r}; give a finite number")
        for name in ("mass_kg", "jxx_kgm2", "jyy_kgm2", "jzz_kgm2", "cg_z_m"):
            if not getattr(self, name) > 0.0:
                raise InvalidInput(
                    f"load: {name} = {getattr(self, name)!r}; give a positive number"
                )
        if not np.linalg.eigvalsh(self.inertia())[0] > 0.0:
            raise InvalidInput(
                "load: no body has such products of inertia; jxy, jxz and jyz must be small beside "
                "the moments"
            )

    def inertia(self) -> FloatArray:
        """The inertia tensor about the centre of mass [kg m2], shape (3, 3)."""
        xy, xz, yz = self.jxy_kgm2, self.jxz_kgm2, self.jyz_kgm2
        return np.array(
            [
                [self.jxx_kgm2, -xy, -xz],
                [-xy, self.jyy_kgm2, -yz],
                [-xz, -yz, self.jzz_kgm2],
            ]
        )

    def vector(self) -> list[float]:
        """The ten numbers in the order of the fields."""
        return [float(v) for v in dataclasses.astuple(self)]

    def replace(self, **changes: float) -> Load:
        """Return a copy with some numbers changed."""
        return dataclasses.replace(self, **changes)

    def with_masses(self, masses: Sequence[PointMass]) -> Load:
        """Add point masses: Dettu et al. (2023), eqs. (6) to (8), corrected.

        Equation (6) lacks the division by the total mass, and (8) subtracts the chassis' parallel-
        axis term where the theorem of Huygens and Steiner adds it.
        """
        points = [[m.mass_kg, m.x_m, m.y_m, m.z_m] for m in masses]
        return Load(*_core.loaded(self.vector(), points))


NOMINAL_SUV = Load(*_core.TwinCar().design)
"""Table 1 of the paper: a sport utility vehicle with its driver."""

# Table 3 cannot come out of table 2 by any positions (J_xx + J_yy - J_zz falls, which no added mass
# can do), so it is taken as given. It has no products of inertia: these are table 1's and those of
# the added mass at the one place that takes the centre from table 1's to table 3's.
LOADED_SUV = Load(
    2480.8, 901.9, 4394.4, 4760.0, -1.316, 0.016, 0.684,
    jxy_kgm2=-15.58, jxz_kgm2=-39.12, jyz_kgm2=13.38,
)  # fmt: skip
"""Table 3 of the paper: the same car with five people's luggage and weight in it."""


SPORTS_CAR_LOAD = Load(1391.29, 328.281, 1698.21, 1864.95, -1.5714, 0.0, 0.4622)
"""Table 7 of the paper: the car of its experiments."""


_POSITIVE = frozenset(
    {
        *("wheelbase_m", "track_m", "unsprung_kg", "tyre_npm", "radius_m", "wheel_inertia_kgm2"),
        *("nominal_load_n", "load_at_peak_stiffness", "friction_x", "friction_y", "shape"),
    }
)


@dataclass(frozen=True)
class TwinCar:
    """A fourteen-degree-of-freedom car without its load.

    Parameters
    ----------
    design : Load
        The load for which the springs are set; it fixes their free lengths once.
    values : mapping of str to float
        Numbers that differ from the built-in sport utility vehicle: ``wheelbase_m``,
        ``drag_area_m2``, ``air_density_kgpm3``, and those of an axle or of its tyre such as
        ``front.spring_npm`` or ``rear.tyre.friction_y``. A name that begins with ``both.`` sets
        both axles.
    name : str
        Name for titles.

    Raises
    ------
    InvalidInput
        If a name is unknown; near names are given.
    """

    design: Load = NOMINAL_SUV
    values: Mapping[str, float] = field(default_factory=dict)
    name: str = "sport utility vehicle"

    @typed_fields
    def __post_init__(self) -> None:
        known = self._numbers()
        for name in self._spelt_out():
            if name not in known:
                raise InvalidInput(
                    f"{self.name}: there is no '{name}'{near_names(name, known)}; names are those "
                    f"of TwinCar().numbers()"
                )
        for name, value in self._spelt_out().items():
            last = name.rsplit(".", 1)[-1]
            if not np.isfinite(value) or (last in _POSITIVE and not value > 0.0):
                needed = "a positive" if last in _POSITIVE else "a finite"
                raise InvalidInput(f"{self.name}: {name} = {value!r}; give {needed} number")

    def _spelt_out(self) -> dict[str, float]:
        out: dict[str, float] = {}
        for name, value in self.values.items():
            if name.startswith("both."):
                out["front." + name[5:]] = float(value)
                out["rear." + name[5:]] = float(value)
            else:
                out[name] = float(value)
        return out

    @staticmethod
    def _numbers() -> dict[str, float]:
        out: dict[str, float] = {}

        def collect(item: object, prefix: str) -> None:
            for name in dir(item):
                if name.startswith("_") or name == "design":
                    continue
                value = getattr(item, name)
                if isinstance(value, float):
                    out[prefix + name] = value
                else:
                    collect(value, f"{prefix}{name}.")

        collect(_core.TwinCar(), "")
        return out

    def numbers(self) -> dict[str, float]:
        """All numbers of the car by name."""
        return {**self._numbers(), **self._spelt_out()}

    def replace(self, values: Mapping[str, float]) -> TwinCar:
        """Return a copy with some numbers changed."""
        return dataclasses.replace(self, values={**self._spelt_out(), **values})

    def core(self, load: Load | None = None) -> _core.Vehicle14:
        """The compiled car with a load, the design's if left out."""
        car = _core.TwinCar()
        car.design = self.design.vector()
        for name, value in self._spelt_out().items():
            *path, last = name.split(".")
            item: object = car
            for part in path:
                item = getattr(item, part)
            setattr(item, last, value)
        try:
            return _core.Vehicle14(car, (load or self.design).vector())
        except ValueError as error:
            raise InvalidInput(f"{self.name}: {error}; take another load") from error

    def __str__(self) -> str:
        lines = [f"{self.name}: 14 degrees of freedom, {self.design.mass_kg:g} kg as designed"]
        changed = self._spelt_out()
        for name, value in self.numbers().items():
            note = "  (changed)" if name in changed else ""
            lines.append(f"  {name:34s} {value:12.6g}{note}")
        return "\n".join(lines)

    _repr_html_ = html_text


# Mass, inertia and centre of mass as published; the rest, which is not, as two-seaters have it.
SPORTS_CAR = TwinCar(
    SPORTS_CAR_LOAD,
    {
        "wheelbase_m": 2.7,
        "drag_area_m2": 0.75,
        "front.lift_area_m2": -0.3,
        "rear.lift_area_m2": -0.4,
        "both.spring_npm": 45000.0,
        "rear.spring_npm": 60000.0,
        "both.bump_damping_nspm": 3200.0,
        "both.rebound_damping_nspm": 4200.0,
        "front.anti_roll_npm": 25000.0,
        "rear.anti_roll_npm": 12000.0,
        "both.roll_centre_m": 0.05,
        "both.unsprung_kg": 38.0,
        "both.radius_m": 0.34,
        "both.tyre.nominal_load_n": 3600.0,
        "both.tyre.friction_x": 1.5,
        "both.tyre.friction_y": 1.45,
        "both.tyre.slip_stiffness": 25.0,
        "front.tyre.cornering_stiffness": 24.0,
        "rear.tyre.cornering_stiffness": 28.0,
        "both.tyre.load_at_peak_stiffness": 2.0,
    },
    "sports car",
)
"""The car of the paper's experiments, as far as it is published."""
