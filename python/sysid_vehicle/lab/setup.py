"""The laboratory's car and all that drives it, before anything is driven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, field

import numpy as np

from .. import _core
from .._common.text import html_text
from .._common.typed import typed, typed_fields
from ..effects.scale import ORDINARY_MASS_KG
from ..errors import InvalidInput
from ..model import Model
from ..tyre import Tyre
from ..vehicle import Vehicle
from .parts import Actuator, Controller, Nominal, Online, Sensors, Simulator

_FORCE = Actuator(-8000.0, 6000.0, 60e3)
_STEER = Actuator(-0.35, 0.35, 2.0)
_GUESSED = 50.0  # stiffness per load of the published car's tyres, which have 63 1/rad
_DRIVES_MPS2, _BRAKES_MPS2 = 2.5, 4.0  # what a car can at least, be it a lorry


def _example_plant() -> Model:
    tyre = Tyre(B=22.0, C=1.8, D=1.6, E=0.8)
    vehicle = Vehicle(
        name="published single track",
        mass_kg=780.0,
        yaw_inertia_kgm2=1000.0,
        lf_m=1.4,
        lr_m=1.6,
        cg_height_m=0.35,
        track_front_m=1.4,
        track_rear_m=1.4,
        drag_area_m2=0.6,
        air_density_kgpm3=101325.0 / (287.058 * 273.0),
        brake_front_share=0.0,
        drive_front_share=0.0,
        tyre_front=tyre,
        tyre_rear=tyre,
    )
    # Lift 0.2 m2 at the centre of gravity, and the drag's moment about the road.
    drag, up, v = vehicle.drag_area_m2 * vehicle.cg_height_m, 0.2, vehicle
    values = {
        "aero_downforce.cl_a_front_m2": -(drag + v.lr_m * up) / v.wheelbase_m,
        "aero_downforce.cl_a_rear_m2": (drag - v.lf_m * up) / v.wheelbase_m,
    }
    return Model(vehicle, ("aero_downforce",), values)


@dataclass(frozen=True)
class Setup:
    """A laboratory: the car that is driven, and all that drives it.

    Parameters
    ----------
    plant : Model
        The true car, with any effects of the catalogue. Only sensors know of it.
    nominal : Nominal
        What observer and controller believe of the car.
    sensors, controller, observer, simulator
        See there.
    force, steer : Actuator
        Total wheel force [N] and road-wheel angle [rad].
    first_speed_mps : float or None
        Speed at the start; None: the first one that is wanted, 5 m/s at least.
    rate_hz : float
        Samples per second of everything.
    name : str
        Name for titles.
    pose_gain : float
        Part of a heading or place reading's difference that corrects the reckoning, 0 to 1.
    """

    plant: Model
    nominal: Nominal
    sensors: Sensors = field(default_factory=Sensors)
    force: Actuator = _FORCE
    steer: Actuator = _STEER
    controller: Controller = field(default_factory=Controller)
    observer: Online = field(default_factory=Online)
    simulator: Simulator = field(default_factory=Simulator)
    first_speed_mps: float | None = None
    rate_hz: float = 100.0
    name: str = "laboratory"
    pose_gain: float = 0.1

    @typed_fields
    def __post_init__(self) -> None:
        speed = 5.0 if self.first_speed_mps is None else self.first_speed_mps
        if not (0.3 < speed < 150.0 and 20.0 <= self.rate_hz <= 2000.0):
            raise InvalidInput(
                f"Setup: first_speed_mps = {self.first_speed_mps!r}, rate_hz = {self.rate_hz!r}; "
                f"give a speed from 0.3 to 150 m/s and a rate from 20 to 2000 Hz"
            )
        if not 0.0 <= self.pose_gain <= 1.0:
            raise InvalidInput(f"Setup: pose_gain = {self.pose_gain!r}; give a share from 0 to 1")

    @classmethod
    @typed
    def of(cls, plant: Model, stiffness: float | None = None) -> Setup:
        """Drive any model, with mass and geometry known and the tyres guessed.

        Wheel forces are those of an ordinary car, and larger where these would not accelerate a
        heavy one by 2.5 and brake it by 4 m/s2. Those of a car below 700 kg are smaller in
        proportion to its mass. What the observer takes for unknown forces is larger, or smaller,
        by as much.

        Parameters
        ----------
        plant : Model
            The car.
        stiffness : float
            Guess of both axles' cornering stiffness per load [1/rad]; that of the vehicle's own
            tyres if left out. A guess that is far too stiff loses the car near its limit.
        """
        mass_kg = plant.vehicle.mass_kg
        more = max(
            1.0, mass_kg * _DRIVES_MPS2 / _FORCE.most, -mass_kg * _BRAKES_MPS2 / _FORCE.least
        )
        more *= min(mass_kg / ORDINARY_MASS_KG[0], 1.0)
        force = Actuator(more * _FORCE.least, more * _FORCE.most, more * _FORCE.rate_limit)
        process = tuple(v * (more**2 if i > 2 else 1.0) for i, v in enumerate(Online.process))
        return cls(
            plant,
            Nominal.of(plant.vehicle, stiffness),
            force=force,
            observer=Online(process=process),
        )

    @classmethod
    def default(cls) -> Setup:
        """Return the published car at its full load, with the corrected loop."""
        return cls.of(_example_plant(), _GUESSED)

    @typed
    def core(
        self, steer_by: str, speed_mps: float, start: Sequence[float] = (0.0, 0.0)
    ) -> _core.LabLoop:
        """Make the compiled settings for a drive that begins at a speed and a place."""
        loop = _core.LabLoop()
        for name, value in vars(self.nominal).items():
            setattr(loop.car, name, value)
        for name, value in vars(self.controller).items():
            setattr(loop.controller, name, value)
        loop.set_force(list(astuple(self.force)))
        loop.set_steer(list(astuple(self.steer)))
        loop.set_sensors(self.sensors.table())
        o, s = self.observer, self.simulator
        loop.set_noise(np.diag(o.process).astype(float), np.diag(o.sensors).astype(float))
        loop.set_observer_form(astuple(o.form))
        loop.set_ways(
            self.pose_gain,
            s.load_sensors,
            s.late_feedback,
            s.first_late_load_n,
            o.certain_start,
            s.inputs_linear,
        )
        loop.set_plant(
            s.load_share, s.late_loads, s.air_speed_of_both, s.steps, s.tolerance, s.gravity_mps2
        )
        loop.set_start(speed_mps, float(start[0]), float(start[1]))
        loop.steer_by = ("heading", "track", "angle").index(steer_by)
        loop.dt = 1.0 / self.rate_hz
        return loop

    def __str__(self) -> str:
        n, s = self.nominal, self.simulator
        return (
            f"{self.name}: {self.plant.vehicle.name} at {self.rate_hz:g} Hz, "
            f"effects {', '.join(self.plant.effects) or 'none'}\n"
            f"  believed stiffness per load {n.stiffness_front:g} and {n.stiffness_rear:g} 1/rad, "
            f"mass {n.mass_kg:g} kg\n"
            f"  force {self.force.least:g} to {self.force.most:g} N, steering "
            f"{self.steer.least:g} to {self.steer.most:g} rad\n"
            f"  load share {s.load_share:g}, loads {'late' if s.late_loads else 'at once'}, "
            f"feedback {'late' if s.late_feedback else 'predicted'}"
        )

    _repr_html_ = html_text
