"""The vehicle that a model has found: what a vehicle file has a place for."""

from __future__ import annotations

from ..errors import InvalidInput
from ..model import Model
from ..vehicle import AXLES, Vehicle


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
    own = {p: model.value(p) for e in model.effects for p in model.effect(e).named}
    held = []
    for name in model.effects:
        if not model.effect(name).changes_car:
            continue
        try:
            car = model.effect(name).car_with(car, own)
        except InvalidInput:  # beyond what a file may say
            continue
        held.append(name)
    rest = Model(car).add(*(part for part in model.parts if part.id not in held))
    rest = rest.with_values({p: v for p, v in own.items() if p.split(".")[0] not in held})
    if "cg_position" in held:
        if "ins_lever_arm" not in rest.effects:
            rest = rest.add("ins_lever_arm")
        ahead = "ins_lever_arm.forward_m"
        moved = own["cg_position.shift_rearward_m"]
        rest = rest.with_values({ahead: rest.value(ahead) + moved})
    return car, rest
