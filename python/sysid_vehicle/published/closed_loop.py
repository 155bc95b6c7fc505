"""The published closed-loop experiment with its car at half load, its loop and its observer.

The laboratory has a switch for each deviation from the corrected form; their published values
stand here.
"""

from __future__ import annotations

from dataclasses import replace

from ..lab import (
    Actuator,
    Controller,
    Nominal,
    Observer,
    ObserverCar,
    ObserverForm,
    ObserverNoise,
    Online,
    Sensor,
    Sensors,
    Setup,
    Simulator,
)

_FIRST_SPEED_MPS = 5.0
_GRAVITY_MPS2 = 9.81
_PROCESS = (4.9439e-4, 5.8044e-4, 5.55501e-6, 17.535, 1321.6, 28.569)
_SENSORS = (0.0093, 5.8534e-5, 6.1532e-6, 0.0026)

OBSERVER_FORM = ObserverForm(
    feed_through=False,
    input_before=False,
    exact_sampling=False,
    coupling=False,
    speed_predicted=False,
)
"""The observer's equations as published, with their defects."""

OBSERVER_NOISE = ObserverNoise.from_variances(_PROCESS, _SENSORS)
"""The noise that the publication ships."""


def observer(car: ObserverCar) -> Observer:
    """Observer of a car in the published form, with its noise and its certain start."""
    return Observer(car, OBSERVER_NOISE, OBSERVER_FORM, _FIRST_SPEED_MPS)


def setup() -> Setup:
    """The published experiment: half load, one-sample delays, exact knowledge."""
    plant = Setup.default().plant
    return Setup(
        plant,
        replace(Nominal.of(plant.vehicle, 63.0), gravity_mps2=_GRAVITY_MPS2),
        # Heading, place and loads are free of noise.
        Sensors(heading_rad=Sensor(), x_m=Sensor(), y_m=Sensor(), ay_repeats_yaw_noise=True),
        Actuator(-4000.0, 2000.0),
        Actuator(-0.262, 0.262),
        _controller(),
        Online(_PROCESS, _SENSORS, OBSERVER_FORM, certain_start=True),
        _simulator(),
        _FIRST_SPEED_MPS,
        rate_hz=100.0,
        name="published",
        pose_gain=1.0,
    )


def _controller() -> Controller:
    unlimited = float("inf")
    return Controller(
        speed_gain_ps=4.0,
        yaw_rate_gain_ps=30.0,
        heading_gain_ps=12.0,
        yaw_rate_limit_radps=0.3,
        yaw_acceleration_limit_radps2=1.0,
        lateral_limit_mps2=unlimited,
        slip_limit_rad=unlimited,
        rear_slip_limit_rad=unlimited,
        rear_slip_gain_ps=10.0,
        brakes_from_mps2=1.0,
        feed_forward=False,
        coupling=False,
        lowest_speed_mps=1e-6,
        added_speed_mps=1e-6,
    )


def _simulator() -> Simulator:
    return Simulator(
        load_share=0.5,
        late_loads=True,
        air_speed_of_both=True,
        steps=1,
        gravity_mps2=_GRAVITY_MPS2,
        late_feedback=True,
        first_late_load_n=5.0,
        load_sensors=True,
    )
