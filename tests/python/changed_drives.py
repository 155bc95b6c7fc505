"""Drives of a car in which something changed since its reference."""

from sysid_vehicle import Change, Log, Model, drive, manoeuvres

OFFSET = "steer_offset.offset_rad"
LATE = ("steer_delay", "steer_lag")
FEW = ("steer_offset", "steer_ratio", "steer_delay")


def later(truth: Model, rate_hz: float = 25.0, **values: float) -> Log:
    """A quarter of a minute of other driving of the car, with parameters of effects."""
    told = {name.replace("__", "."): value for name, value in values.items()}
    more = [n.split(".")[0] for n in told if "." in n and n.split(".")[0] not in truth.effects]
    car = truth.add(*dict.fromkeys(more)).with_values(told)
    return drive(car, manoeuvres.handling_course(15.0, lateral_mps2=7.5), seed=42, rate_hz=rate_hz)


def inside(change: Change, effect: str, value: float) -> bool:
    """Whether the size of a change is what it should be."""
    found = change[effect]
    return abs(found.value[0] - value) < 3.0 * found.std[0]
