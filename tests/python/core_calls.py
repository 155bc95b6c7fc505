"""Every function of the compiled core that takes arrays, with arguments that it accepts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from sysid_vehicle import Model, Vehicle, _core
from sysid_vehicle.lab import GreyBoxVehicle, Setup
from sysid_vehicle.twin import INPUTS, NOMINAL_SUV, READINGS, TwinCar
from sysid_vehicle.vehicle import vehicle_data

Arguments = dict[str, Any]
Call = tuple[Callable[..., Any], Arguments]

N = 40
TYRE = [10.0, 1.4, 1.0, 0.0]


def rows(width: int, *first: float) -> np.ndarray:
    """Rows of small waves about the `first` values."""
    wave = 0.01 * np.sin(np.arange(N * width).reshape(N, width))
    wave[:, : len(first)] += first
    return wave


def main_job(vehicle: Vehicle) -> Iterator[tuple[str, Call]]:
    model = Model(vehicle)
    p, noise = model.vector(), NOISE.copy()

    def problem() -> _core.Problem:
        found = _core.Problem(model.core())
        found.add_run(0.02, rows(2), rows(_core.CHANNELS, 20.0))
        return found

    def add_run(**given: Any) -> _core.Problem:
        found = problem()
        found.add_run(**given)
        found.freeze(p, noise)
        return found

    run = {"dt": 0.02, "inputs": rows(2), "measurements": rows(_core.CHANNELS, 20.0), "start": 0.0}
    yield "add_run", (add_run, run)

    def add_run_with_loads(**given: Any) -> _core.Problem:
        found = _core.Problem(
            _core.SingleTrack(vehicle_data(vehicle), 0, True, loads_known=True, inputs_held=True)
        )
        found.add_run(**given)
        found.freeze(p, noise)
        return found

    yield "add_run with loads", (add_run_with_loads, {**run, "inputs": rows(4, 15.0)})
    known = problem()
    state = {"parameters": p, "noise": noise}
    yield "freeze", (known.freeze, state)
    yield "noise_score", (known.noise_score, state)
    sets = {"parameters": np.tile(p, (5, 1)), "noise": noise}
    yield "log_likelihoods", (known.log_likelihoods, sets)
    yield "trace", (known.trace, {**state, "smoothed": True})
    yield "smoothed_means", (known.smoothed_means, state)
    yield "look_ahead", (known.look_ahead, {**state, "horizons": [(3, 2), (5, 1)]})
    yield "free_run", (known.free_run, {"parameters": p})
    frozen = known.freeze(p, noise)
    at = {"parameters": p, "filter": frozen}
    yield "filtered_noise_score", (known.filtered_noise_score, at)
    yield "filtered_smoothed_means", (known.filtered_smoothed_means, at)
    yield "filtered_trace", (known.filtered_trace, at)
    yield "residuals", (known.residuals, at)
    yield "half_sum_of_squares", (known.half_sum_of_squares, at)
    yield "sensitivities", (known.sensitivities, {**at, "columns": [0, 3]})
    yield "normal_equations", (known.normal_equations, {**at, "columns": [0, 3]})
    signals = {**at, "signals": rows(2), "targets": [0, 4]}
    yield "signal_sensitivities", (known.signal_sensitivities, signals)
    motion = {"parameters": p, "motion": rows(3, 20.0)[0], "steer": 0.01, "longitudinal": 100.0}
    yield "evaluate", (model.core().evaluate, motion)
    written = {"model": model.add("steer_lag").core(), "parameters": p, "v_x": 20.0}
    yield "write_model", (_core.write_model, written)
    user = [(0, [], [(0, [(0, (0, 0, 0), 1.0)])], [])]
    yield (
        "SingleTrack",
        (_core.SingleTrack, {"car": vehicle_data(vehicle), "effects": 3, "force_known": True}),
    )
    yield (
        "SingleTrack of user",
        (
            _core.SingleTrack,
            {"car": vehicle_data(vehicle), "effects": 0, "force_known": True, "user": user},
        ),
    )
    yield (
        "simulate",
        (
            _core.simulate,
            {
                "model": model.core(),
                "parameters": p,
                "dt": 0.02,
                "references": rows(3, 20.0),
                "driver": _core.Driver(),
                "disturbance": rows(3),
                "initial_speed": 20.0,
                "initial_vy": 0.0,
                "initial_yaw_rate": 0.0,
                "initial_steer": 0.0,
                "start": 0.0,
            },
        ),
    )

    def driven(reaction_s: float, dt: float) -> Any:
        driver = _core.Driver()
        driver.reaction_s = reaction_s
        return _core.simulate(model.core(), p, dt, rows(3, 20.0), driver, rows(3), 20.0)

    yield "Driver", (driven, {"reaction_s": 0.1, "dt": 0.02})

    def other_car(**given: Any) -> Any:
        data = vehicle_data(vehicle)
        for name, value in given.items():
            setattr(data, name, value)
        car = _core.SingleTrack(data, 0, True)
        other = known.with_model(car)
        return other.residuals(p, other.freeze(p, noise)), car.evaluate(p, rows(3, 20.0)[0], 0.1, 0)

    names = ("mass_kg", "lf_m", "lr_m", "cg_height_m", "track_front_m", "brake_front_share")
    yield "with_model", (other_car, {n: getattr(vehicle_data(vehicle), n) for n in names})
    around = {"steer_before": [0.01] * 9, "steer_after": [0.02] * 9, "shift": [0.0] * len(p)}
    yield "add_run of a longer log", (add_run, {**run, **around, "name": "log"})
    pushed = {"references": rows(3, 20.0), "disturbance": rows(_core.EXTERNALS)}
    read = [(0, [0], [(0, [(22, (0, 0, 0), 0.0)])], [])]

    def simulate(user: Any, **given: Any) -> Any:
        car = _core.SingleTrack(vehicle_data(vehicle), 0, True, user)
        return _core.simulate(car, p, 0.02, driver=_core.Driver(), initial_speed=20.0, **given)

    asked = {**pushed, "user": read, "channels": rows(2), "farthest_m": 5.0}
    yield "simulate with channels", (simulate, asked)
    places = {"pointers": np.arange(0, 2 * N, 2), "columns": np.arange(2 * N - 2) % N}
    band = {**places, "values": rows(2)[1:].ravel()}
    yield "banded_gram", (_core.banded_gram, {**band, "size": N})
    yield "banded_squares", (_core.banded_squares, {**band, "factor": rows(3, 1.0)})


NOISE = np.concatenate([np.full(_core.NOISE_PARAMETERS - 1, 0.1), [1.0]])


def laboratory(vehicle: Vehicle) -> Iterator[tuple[str, Call]]:
    model = Model(vehicle)

    def loop(**given: Any) -> Any:
        found = Setup.default().core("heading", 15.0)
        for name in ("set_force", "set_steer", "set_sensors"):
            getattr(found, name)(given[name])
        found.set_noise(given["process"], given["sensors"])
        found.set_track(given["points"], 1.0, 1.0)
        for name in ("set_start", "set_ways", "set_plant"):
            getattr(found, name)(*given[name])
        found.set_observer_form(given["set_observer_form"])
        found.dt, found.steer_by = given["dt"], given["steer_by"]
        names = ("wanted", "normal", "push")
        return found.run(model.core(), model.vector(), *(given[name] for name in names))

    yield (
        "LabLoop",
        (
            loop,
            {
                "set_force": [-5e3, 5e3, 1e5, 0.05],
                "set_steer": [-0.5, 0.5, 2.0, 0.05],
                "set_sensors": Setup.default().sensors.table(),
                "process": np.eye(6),
                "sensors": 0.01 * np.eye(4),
                "points": rows(2, 5.0),
                "set_start": [15.0, 0.0, 0.0],
                "set_ways": [0.0, True, False, 0.0, True, True],
                "set_plant": [1.0, False, False, 0, 0.0, 9.81],
                "set_observer_form": [True] * 5,
                "dt": 0.01,
                "steer_by": 0,
                "wanted": rows(5, 15.0),
                "normal": rows(Setup.default().sensors.table().shape[0]),
                "push": rows(3),
            },
        ),
    )
    car = np.array([780.0, 1000.0, 1.4, 1.6, 0.3])
    q, r = np.diag([1e-4, 1e-4, 1e-5, 1e4, 1e4, 1e4]), np.diag([1e-3, 1e-3, 1e-5, 1e-2])
    begin = {
        "car": car,
        "form": [True] * 5,
        "dt": 0.01,
        "mean": np.array([15.0, 0, 0, 0, 0, 0]),
        "covariance": np.eye(6),
        "one_before": False,
    }
    inputs = np.tile([100.0, 0.01, 5e4, 5e4], (N, 1))
    record = {**begin, "inputs": inputs, "readings": rows(4, 15.0), "inputs_held": False}
    noise = {"process": q, "sensors": r}

    def log(**given: Any) -> Any:
        found = _core.ObserverLog(**given)
        return found.log_likelihood(q, r), found.trace(q, r, True)

    yield "ObserverLog", (log, record)
    known = _core.ObserverLog(**record)
    yield "log_likelihood", (known.log_likelihood, noise)
    yield "observer trace", (known.trace, {**noise, "smoothed": True})

    def step(input: Any, reading: Any, **given: Any) -> Any:
        observer = _core.Observer(**given)
        observer.step(input, reading)
        return observer.step(input, reading), observer.covariance

    yield "Observer", (step, {**begin, **noise, "input": inputs[0], "reading": rows(4, 15.0)[0]})
    first = {"car": car, "reading": rows(4, 15.0)[0], "sensors": r}
    yield "observer_start", (_core.observer_start, first)
    learned = {
        "logs": [known],
        **noise,
        "process_scale": list(range(6)),
        "process_block": list(range(6)),
        "process_floor": np.full(6, 1e-12),
        "sensor_scale": list(range(4)),
        "sensor_block": list(range(4)),
        "sensor_floor": np.full(4, 1e-12),
        "most_iterations": 3,
        "tolerance": 1e-6,
        "never_fall": True,
        "accelerate": True,
    }
    yield "learn_observer_noise", (_core.learn_observer_noise, learned)

    grey = GreyBoxVehicle(780.0, 1000.0, 1.4, 1.6).core()
    tyre = np.array([10.0, 1.4, 1.0, 0.0, 10.0, 1.4, 1.0, 0.0, *[0.1] * 7])

    def loss(motion: Any, targets: Any, weights: Any, parameters: Any, columns: Any) -> Any:
        found = _core.TyreLoss(grey, 1000.0, True, motion, targets, weights)
        return found.residuals(parameters, None), found.normal_equations(parameters, None, columns)

    flat = {"motion": rows(6, 15.0), "targets": rows(2), "weights": np.ones((N, 2))}
    yield "TyreLoss", (loss, {**flat, "parameters": tyre, "columns": [0, 5]})


def online(vehicle: Vehicle) -> Iterator[tuple[str, Call]]:
    slip, mu = np.linspace(0.0, 0.1, N), np.linspace(0.0, 0.9, N)
    for curve, kept in (
        (_core.TwoParameterCurve, _core.TwoParameterFilter),
        (_core.MagicFormulaCurve, _core.MagicFormulaFilter),
    ):
        low, high = np.asarray(curve.LOWER), np.asarray(curve.UPPER)
        x, name = 0.5 * (low + high), curve.__name__
        start = {"mean": x, "covariance": np.diag((0.1 * (high - low)) ** 2)}
        read = {"slip": slip, "mu": mu}
        how = {"noise_std": 0.05, "pseudo_noise": True, "drift_std": 1e-3 * x}
        if name == "MagicFormulaCurve":
            tyre = {"parameters": x}
            yield "magic_formula_coefficients", (_core.magic_formula_coefficients, tyre)
        yield f"{name} points", (curve.points, {"slip": slip, "parameters": x})
        yield f"{name} filter", (curve.filter, {**read, **start, **how, "iterations": 2})
        yield f"{name} smooth", (curve.smooth, {**read, **start, **how, "max_rounds": 3})
        box = {"start": x, "lower": low, "upper": high, "max_iterations": 5}
        yield f"{name} fit", (curve.fit, {**read, **box})
        stored = kept(**start, **how, iterations=1).__getstate__()
        yield f"{kept.__name__} restored", (restored(kept, "update", 0.05, 0.5), {"state": stored})

    def car(front: Any, rear: Any, yaw_inertia_kgm2: float) -> _core.ObservedCar:
        return _core.ObservedCar(vehicle_data(vehicle), yaw_inertia_kgm2, front, rear)

    def dual(dt_s: Any, sensors: Any, settings: Any, **of_car: Any) -> Any:
        return _core.SideslipDual(car(**of_car), settings).run(dt_s, sensors)

    of_car = {"front": TYRE, "rear": TYRE, "yaw_inertia_kgm2": 1800.0}
    read = {"dt_s": np.full(N, 0.01), "sensors": rows(5, 0.0, 15.0)}
    yield "SideslipDual", (dual, {**of_car, **read, "settings": _core.sideslip_defaults()})
    linear = _core.SideslipUkf(car(**of_car), {}, True)
    published = _core.PublishedDual(car(**of_car), 8e4, 8e4)
    yield "SideslipUkf", (lambda **given: linear.copy().run(**given), read)
    yield "PublishedDual", (lambda **given: published.copy().run(**given), read)
    made = _core.SideslipDual(car(**of_car), {})
    others = [_core.SideslipEkf(car(**of_car), {}, False)]
    others.append(_core.SideslipSquareRootUkf(car(**of_car), {}, False))
    for kept in others:
        yield type(kept).__name__, (lambda kept=kept, **given: kept.copy().run(**given), read)
    for observer in (made, linear, published, *others):
        kind = type(observer)
        again = restored(kind, "step", 0.01, 0.01, 15.0, 0.01, 0.0, 0.1)
        yield f"{kind.__name__} restored", (again, {"state": observer.__getstate__()})

    def cornering(readings: Any, numbers: Any) -> Any:
        return _core.CorneringRls(*numbers).run(readings)

    numbers = [1250.0, 1800.0, 1.2, 1.4, 0.999, 5e4, 0.1, 0.1, 0.1, 1e-3, 8e4, 8e4]
    yield "CorneringRls", (cornering, {"readings": rows(4), "numbers": numbers})
    again = restored(_core.CorneringRls, "step", 0.01, 0.01, 1.0, 0.0)
    state = _core.CorneringRls(*numbers).__getstate__()
    yield "CorneringRls restored", (again, {"state": state})


def restored(kind: type, name: str, *step: float) -> Callable[[Any], Any]:
    def use(state: Any) -> Any:
        found = kind.__new__(kind)
        found.__setstate__(state)
        return getattr(found, name)(*step), found.__getstate__()

    return use


def twin(vehicle: Vehicle) -> Iterator[tuple[str, Call]]:
    car = TwinCar().core(NOMINAL_SUV)
    rest, calm = car.rest(15.0), np.zeros((N, len(INPUTS)))
    at = {"state": rest, "input": calm[:1]}
    yield "Vehicle14 evaluate", (car.evaluate, at)
    yield "Vehicle14 step", (car.step, {**at, "dt": 1e-3})
    yield "Vehicle14 energy", (car.energy, at)
    yield "Vehicle14 simulate", (car.simulate, {"start": rest, "inputs": calm, "dt": 1e-3})

    def drive(reaction_s: float, **given: Any) -> Any:
        driver = _core.Driver()
        driver.reaction_s = reaction_s
        return car.drive(driver, **given)

    wanted = {"pedals": [1.0, 1.0], "references": rows(3, 15.0), "base": calm, "dt": 1e-3}
    yield "Vehicle14 drive", (drive, {**wanted, "reaction_s": 0.1})
    masses = [[70.0, 0.1, 0.4, 0.8]]
    yield "loaded", (lambda **given: _core.loaded(*given.values()), {"load": car.load, "p": masses})
    measured = np.zeros((N, len(READINGS)))
    parameters = [[0.0, 10.0, 100.0, 1.0, 500.0, 5000.0, 0.0]]
    seen = {
        "start": rest,
        "inputs": calm,
        "measured": measured,
        "dt": 1e-3,
        "gains": [[0.0, 0.0, 1.0, 0.0]],
        "stride": 5,
        "scaled": [2, 3],
        "starts": [[1.0, 6.0, 0.1]],
        "law_parameter": 0,
        "law_channel": 1,
        "yaw_rate_channel": 2,
        "schedule": [1.0, 1.0, 0.1],
        "parameters": parameters,
        "channels": [[3.0, 0.1, 0.0]],
        "settings": [0.999, 0.1, 1.0, 4.0, 0.1],
    }

    def observe(**given: Any) -> Any:
        law = _core.ParameterLaw()
        law.parameter, law.channel = given.pop("law_parameter"), given.pop("law_channel")
        dt = given["dt"]
        laws = _core.ParameterLaws(
            [law], dt, given.pop("yaw_rate_channel"), 20.0, given.pop("schedule")
        )
        settings = given.pop("settings")
        batch = _core.BatchEstimator(given.pop("parameters"), given.pop("channels"), dt, settings)
        laws.update(measured[0], measured[0], [*car.load, 1.0])
        batch.of_twin(1, [*car.load, 1.0])
        batch.update(measured[0], np.zeros((2, len(READINGS))), [*car.load, 1.0])
        return _core.observe14(car, laws=laws, batch=batch, **given)

    yield "observe14", (observe, seen)
    double = {
        "car": [2000.0, 3000.0, 1.3, 1.5, 1.6, 0.6, 0.3, 0.7, 1.2, 0.5],
        "front": [*TYRE, *TYRE],
        "rear": [*TYRE, *TYRE],
        "gains": [1.0] * 7,
        "start": [15.0, 0.0, 0.0, 0.0],
        "inputs": calm,
        "measured": measured,
        "dt": 1e-3,
        "published_sign": False,
    }
    yield "observe_double_track", (_core.observe_double_track, double)
