"""The cars, the driving, and what is hidden: effects of the catalogue, and some outside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from design import ROADS, Trial

import sysid_vehicle as sv
from sysid_vehicle.simulate import Drive, drive_truth

RATE_HZ = 50.0
_G = 9.81
# A car that spins tells nothing: the driver tries again with less.
_EASIER = (1.0, 0.85, 0.7, 0.55)
_SLOPE_RAD = {"hills": 0.015}  # standard deviation of grade and of crossfall
_ROAD_S = 50.0
# Validation data asks no more of the tyres than the fit has seen: no model knows what comes then.
_COURSE_MPS2 = {"ramp": 8.0, "sweep": 3.0, "step": 5.5, "lap": 8.0, "all": 8.0}

Array = npt.NDArray[np.float64]
Push = Callable[[Drive, float], Array]


def vehicle(name: str) -> sv.Vehicle:
    """The car that is driven."""
    if name == "saloon":
        return sv.example_vehicle()
    return sv.Vehicle(
        name="hatchback",
        mass_kg=1080.0,
        yaw_inertia_kgm2=1480.0,
        lf_m=1.0,
        lr_m=1.5,
        cg_height_m=0.53,
        track_front_m=1.48,
        track_rear_m=1.47,
        drag_area_m2=0.68,
        brake_front_share=0.72,
        drive_front_share=1.0,
        tyre_front=sv.Tyre(B=9.0, C=1.35, D=1.02, E=0.0),
        tyre_rear=sv.Tyre(B=11.0, C=1.35, D=1.05, E=-0.1),
    )


def baseline(name: str) -> sv.Model:
    """The same car of which the tyres are not known."""
    other = {
        "tyre_front": sv.Tyre(B=9.0, C=1.3, D=0.9, E=0.0),
        "tyre_rear": sv.Tyre(B=11.0, C=1.5, D=1.1, E=-0.2),
    }
    return sv.Model(vehicle(name).replace(**other))


def manoeuvres(trial: Trial, ease: float) -> tuple[sv.manoeuvres.Manoeuvre, ...]:
    """The drives of one set, 25 to 50 s each, and the course to validate on, as the last.

    `ease` scales the lateral acceleration where the tyres come near to their limits.
    """
    m = sv.manoeuvres
    if trial.driving in ROADS:
        rng = np.random.default_rng(trial.seed)
        kinds: tuple[sv.manoeuvres.RoadKind, ...] = ("motorway", "country", "town", "country")
        return tuple(m.usual_road(kind, _ROAD_S, rng) for kind in kinds)
    course = max(_COURSE_MPS2[trial.driving], trial.course_mps2) * ease
    made = {
        "ramp": lambda: m.ramp_steer((18.0, 27.0), 8.6 * ease, 4.0),
        "sweep": lambda: m.sine_sweep(25.0, 25.0, 3.5 * ease),
        "step": lambda: m.step_steer((17.0, 27.0), (3.0 * ease, 6.0 * ease)),
        "lap": lambda: m.lap(40.0, 8.6 * ease),
    }
    names = made if trial.driving == "all" else (trial.driving,)
    return (*(made[name]() for name in names), m.handling_course(30.0, course))


def hidden(trial: Trial) -> sv.Model:
    """The true car, as far as the catalogue can tell it."""
    car = sv.Model(vehicle(trial.vehicle))
    if trial.kind == "outside":
        return car
    if trial.kind == "rivals":
        first = trial.truth[0]
        return car.add(first).with_values(
            {
                f"{first}.{p.name}": p.null_value + size
                for p, size in zip(sv.effect(first).parameters, rival_size(trial), strict=True)
            }
        )
    values = {}
    for name in trial.truth:
        for p in sv.effect(name).parameters:
            size = p.null_value + trial.severity * (p.typical - p.null_value)
            if p.scan == "time":
                size = 14.0  # about the middle of each drive
            values[f"{name}.{p.name}"] = float(np.clip(size, p.lower, p.upper))
    return car.add(*trial.truth).with_values(values)


def rival_size(trial: Trial) -> tuple[float, ...]:
    """How far the first of two rivals is from null: little, as predictions are linear."""
    first = sv.effect(trial.truth[0])
    return tuple(0.15 * trial.severity * (p.typical - p.null_value) for p in first.parameters)


def sample(trial: Trial) -> tuple[list[sv.Log], sv.Log, float]:
    """Drive the training manoeuvres and a validation course: logs, and how easily it went.

    Raises
    ------
    sysid_vehicle.NumericalError
        The car spins however easily it is driven.
    """
    for ease in _EASIER:
        rng = np.random.default_rng(trial.seed)
        try:
            logs = [drive_one(trial, m, rng) for m in manoeuvres(trial, ease)]
        except sv.NumericalError:
            if ease == _EASIER[-1]:
                raise
            continue
        return logs[:-1], logs[-1], ease
    raise AssertionError("unreachable")


def drive_one(trial: Trial, manoeuvre: sv.manoeuvres.Manoeuvre, rng: np.random.Generator) -> sv.Log:
    """Drive one manoeuvre with what is hidden and the noise of the trial."""
    road = sv.RoadDisturbance(slope_rad=_SLOPE_RAD.get(trial.driving, 0.0))
    if trial.noise == "coloured force":
        road = replace(road, fx_n=120.0, fy_n=150.0, mz_nm=150.0, correlation_time_s=0.3)
    sensors = sv.SensorNoise().scaled(2.5 if trial.noise == "high" else 1.0)
    seed = int(rng.integers(2**31))
    truth = hidden(trial)
    if trial.kind == "outside":
        push = OUTSIDE_FORCES[trial.truth[0]]
        log = pushed(truth, manoeuvre, push, trial.severity, seed, sensors, road)
    else:
        log = sv.drive(
            truth, manoeuvre, seed=seed, noise=sensors, disturbance=road, rate_hz=RATE_HZ
        )
    columns = {c: np.asarray(log[c]) for c in log.channels}
    if trial.noise == "coloured sensor":
        for channel, std in (("ay_mps2", 0.12), ("yaw_rate_radps", 0.003)):
            wander = sv.RoadDisturbance(fx_n=std, correlation_time_s=0.05)
            columns[channel] = columns[channel] + wander.sample(log.n, RATE_HZ, rng)[:, 0]
    if not trial.with_vy:
        del columns["vy_mps"]
    return sv.Log.from_arrays(columns, name=log.name, check=False)


class _Pushed(sv.RoadDisturbance):
    """A road that also pushes as it is told; the driving is made to agree with it."""

    told: Array | None = None

    def sample(self, n: int, rate_hz: float, rng: np.random.Generator) -> Array:
        road = super().sample(n, rate_hz, rng)
        if self.told is not None:
            road[:, : self.told.shape[1]] += self.told  # slopes stand in columns behind the forces
        return road


def pushed(
    truth: sv.Model,
    manoeuvre: sv.manoeuvres.Manoeuvre,
    push: Push,
    severity: float,
    seed: int,
    noise: sv.SensorNoise,
    road: sv.RoadDisturbance,
) -> sv.Log:
    """Drive with forces that depend on the motion, found by repetition until both agree.

    A force that follows from the motion of the same drive is a fixed point, and as it acts only on
    what comes later, repetition converges.
    """
    told: Array | None = None
    for i in range(40):
        disturbance = _Pushed(**{k: getattr(road, k) for k in road.__dataclass_fields__})
        object.__setattr__(disturbance, "told", told)
        done = drive_truth(
            truth, manoeuvre, seed=seed, noise=noise, disturbance=disturbance, rate_hz=RATE_HZ
        )
        wanted = np.ascontiguousarray(push(done, severity))
        if told is not None and np.max(np.abs(wanted - told)) < 1.0:
            return done.log
        # Halves where it swings about the end.
        told = wanted if told is None or i < 10 else 0.5 * (told + wanted)
    raise sv.NumericalError(f"{manoeuvre.name}: force and motion do not come to agree")


def _signals(done: Drive) -> tuple[Array, Array, Array, Array]:
    """Speed, lateral acceleration, rear slip angle, wheel force."""
    vx, vy, r = done.states.T
    rear = -np.arctan2(vy - done.model.vehicle.lr_m * r, vx)
    return vx, vx * r, rear, done.inputs[:, 1]


def _rear_tyre_bump(done: Drive, s: float) -> Array:
    """A rear tyre that is stronger at one slip angle than any Magic Formula."""
    _, _, slip, _ = _signals(done)
    # Without a jump where the car goes straight, across which force and motion never agree.
    side = np.tanh(slip / 0.005)
    bump = 250.0 * s * side * np.exp(-(((np.abs(slip) - 0.035) / 0.02) ** 2))
    return np.column_stack([0.0 * bump, bump, -done.model.vehicle.lr_m * bump])


def _torque_vectoring(done: Drive, s: float) -> Array:
    """A moment that helps to turn in fast corners, until it has reached what it can."""
    vx, ay, _, _ = _signals(done)
    moment = 350.0 * s * np.tanh(ay / 5.0) * np.clip((vx - 15.0) / 10.0, 0.0, 1.0)
    return np.column_stack([0.0 * moment, 0.0 * moment, moment])


def _wing_that_opens(done: Drive, s: float) -> Array:
    """Drag, and the side force of a rear axle, that are lost above one speed."""
    vx, ay, _, _ = _signals(done)
    opened = 1.0 / (1.0 + np.exp(-(vx - 24.0) / 0.5))
    side = -0.03 * s * done.model.vehicle.mass_kg * ay * opened
    return np.column_stack([250.0 * s * opened, side, -done.model.vehicle.lr_m * side])


def _crowned_road(done: Drive, s: float) -> Array:
    """A road whose bank comes and goes with the distance."""
    way = np.cumsum(done.states[:, 0]) / RATE_HZ
    side = 0.03 * s * done.model.vehicle.mass_kg * _G * np.sin(2.0 * np.pi * way / 160.0)
    return np.column_stack([0.0 * side, side, 0.0 * side])


def _braking_moment(done: Drive, s: float) -> Array:
    """A moment out of the corner that comes with hard braking only."""
    _, ay, _, force = _signals(done)
    braking = np.clip((-force - 800.0) / 2000.0, 0.0, 1.0)
    moment = -500.0 * s * braking * np.tanh(ay / 5.0)
    return np.column_stack([0.0 * moment, 0.0 * moment, moment])


def _cornering_drag(done: Drive, s: float) -> Array:
    """Drag that grows with the work tyres did in the last seconds."""
    vx, ay, slip, _ = _signals(done)
    keep = np.exp(-1.0 / (4.0 * RATE_HZ))
    work = np.abs(ay * slip * vx)
    warm = np.zeros_like(work)
    for k in range(1, len(work)):
        warm[k] = keep * warm[k - 1] + (1.0 - keep) * work[k]
    drag = -60.0 * s * warm
    return np.column_stack([drag, 0.0 * drag, 0.0 * drag])


OUTSIDE_FORCES: dict[str, Push] = {
    "rear tyre bump": _rear_tyre_bump,
    "torque vectoring": _torque_vectoring,
    "wing that opens": _wing_that_opens,
    "crowned road": _crowned_road,
    "braking moment": _braking_moment,
    "cornering drag by temperature": _cornering_drag,
}


def true_values(trial: Trial) -> dict[str, float]:
    """Hidden parameters by full name, without those that mean nothing to an interval."""
    model = hidden(trial)
    return {n: model.value(n) for n, p in model.parameters.items() if "." in n and not p.scan}
