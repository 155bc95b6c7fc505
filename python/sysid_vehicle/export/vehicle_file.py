"""The vehicle that a model has found: what a vehicle file has a place for."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..errors import InvalidInput
from ..model import Model
from ..vehicle import AXLES, Vehicle

_Changes = Callable[[Vehicle, Mapping[str, float]], dict[str, float]]

# Effects that change nothing but numbers of the vehicle file, by their equations.
_IN_FILE: dict[str, _Changes] = {
    "mass": lambda car, p: {"mass_kg": car.mass_kg * (1.0 + p["relative_error"])},
    "yaw_inertia": lambda car, p: {
        "yaw_inertia_kgm2": (car.yaw_inertia_kgm2 or 0.0) * (1.0 + p["relative_error"])
    },
    "cg_position": lambda car, p: {
        "lf_m": car.lf_m + p["shift_rearward_m"],
        "lr_m": car.lr_m - p["shift_rearward_m"],
    },
    "longitudinal_load_transfer": lambda car, p: {
        "cg_height_m": car.cg_height_m + p["height_error_m"]
    },
    "aero_drag": lambda car, p: {"drag_area_m2": car.drag_area_m2 + p["drag_area_m2"]},
    "force_split": lambda car, p: {
        "brake_front_share": car.brake_front_share + p["brake_front_error"],
        "drive_front_share": car.drive_front_share + p["drive_front_error"],
    },
}


def vehicle_and_rest(model: Model) -> tuple[Vehicle, Model]:
    """Return the vehicle as the model has it, and the model of it with what no file can hold.

    Both models predict the same. A centre of gravity that was found elsewhere leaves the sensors
    where they are, away from it: `ins_lever_arm` in the second one, which counts from the file.

    Parameters
    ----------
    model : Model
    """
    car = model.vehicle.replace(
        **{f"tyre_{axle}": model.tyre(axle) for axle in AXLES},
        yaw_inertia_kgm2=model.value("yaw_inertia_kgm2"),
    )
    held = []
    for name in model.effects:
        if name not in _IN_FILE:
            continue
        values = {n.split(".")[1]: model.value(n) for n in model.effect(name).named}
        try:
            car = car.replace(**_IN_FILE[name](car, values))
        except InvalidInput:  # beyond what a file may say
            continue
        held.append(name)
    own = {p: model.value(p) for e in model.effects for p in model.effect(e).named}
    rest = Model(car).add(*(part for part in model.parts if part.id not in held))
    rest = rest.with_values({p: v for p, v in own.items() if p.split(".")[0] not in held})
    if "cg_position" in held:
        if "ins_lever_arm" not in rest.effects:
            rest = rest.add("ins_lever_arm")
        ahead = "ins_lever_arm.forward_m"
        moved = own["cg_position.shift_rearward_m"]
        rest = rest.with_values({ahead: rest.value(ahead) + moved})
    return car, rest
