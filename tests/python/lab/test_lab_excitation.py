"""What the closed loop is asked to do."""

from collections.abc import Callable
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, published
from sysid_vehicle.lab import Setup, excitation, run_closed_loop
from sysid_vehicle.lab.excitation import Excitation, MultiSine
from sysid_vehicle.manoeuvres import Knots

ALL = {**published.excitations(), **excitation.all()}


def test_all_gives_each_excitation_under_its_name() -> None:
    for name in (
        *("identification", "oval", "speed_ramp", "multi_sine", "step_steer", "ramp_steer"),
        *("sine_with_dwell", "sine_sweep", "slalom", "double_lane_change", "constant_radius"),
        *("lap", "brake_in_turn"),
    ):
        assert ALL[name].name == name


@pytest.mark.parametrize("name", ALL)
def test_each_is_driven_and_told_and_drawn(name: str) -> None:
    e = ALL[name]
    drive = run_closed_loop(e, seed=1)
    assert drive.lost_s is None
    assert not drive.too_hard
    assert drive.time_s[-1] == pytest.approx(e.duration_s, abs=0.01)
    assert drive.tracking["vx_mps"] < 1.0
    assert name in str(e)
    assert name in e._repr_html_()
    assert e.plot().get_title() == name
    with pytest.raises(FrozenInstanceError):
        e.duration_s = 1.0  # type: ignore[misc]


@pytest.mark.parametrize("name", ALL)
def test_the_wanted_derivatives_are_those_of_the_wanted_curves(name: str) -> None:
    wanted = ALL[name].wanted(Setup.default().plant.vehicle, 100.0)
    assert np.isfinite(wanted).all()
    for value, rate in ((0, 1), (2, 3)):
        middle = 0.5 * (wanted[1:, rate] + wanted[:-1, rate])
        rebuilt = wanted[0, value] + np.concatenate([[0.0], np.cumsum(middle) / 100.0])
        size = max(np.ptp(wanted[:, value]), 1e-9)
        assert np.abs(rebuilt - wanted[:, value]).max() < 0.06 * size


def test_the_identification_trajectory_has_the_published_numbers() -> None:
    e = published.Identification()
    time_s = np.array([0.0, 50.0, 100.0])
    np.testing.assert_allclose(e.speed_mps(time_s), [10.0, 80.0, 10.0])
    t = np.linspace(0.0, 145.0, 1000)
    rise = (0.8 - 0.001) / 150.0
    turns = 0.001 * t + 0.5 * rise * t**2 * 0.2
    expected = 0.35 * 10.0 / e.speed_mps(t) * np.sin(2.0 * np.pi * turns)
    np.testing.assert_allclose(e.heading_rad(t), expected, atol=1e-12)


def test_the_oval_is_closed_clockwise_and_as_long_as_it_says() -> None:
    oval = published.Oval()
    points = oval.track()
    steps = np.linalg.norm(np.diff(np.vstack([points, points[:1]]), axis=0), axis=1)
    assert steps.max() < 1.5
    length = 2.0 * (oval.length_m + oval.width_m) + 2.0 * np.pi * oval.radius_m
    assert steps.sum() == pytest.approx(length, rel=1e-4)
    x, y = points.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    assert area < 0.0
    speed = oval.speed_mps(np.array([0.0, 5.0, 30.0, 90.0, 200.0, 300.0, 400.0]))
    np.testing.assert_allclose(speed, [1.0, 7.5, 15.0, 25.0, 45.0, 55.0, 60.0])


def test_the_speed_ramp_rises_from_15_to_80() -> None:
    ramp = excitation.speed_ramp()
    speed = ramp.speed_mps(np.linspace(0.0, ramp.duration_s, 100))
    assert speed[0] == 15.0
    assert speed[-1] == 80.0
    assert np.all(np.diff(speed) > 0.0)


@pytest.mark.parametrize("lines", [8, 30, 100])
def test_the_multi_sine_keeps_its_peak_low_and_its_lines_equal(lines: int) -> None:
    wave = MultiSine(2.0, 20.0, 0.1, 0.1 + (lines - 1) / 20.0)
    time_s = np.arange(0.0, 20.0, 0.001)
    value = wave(time_s)
    assert np.abs(value).max() == pytest.approx(2.0, rel=2e-3)
    assert wave.crest_factor < 1.62  # random phases: about 3
    assert np.abs(value).max() / value.std() == pytest.approx(wave.crest_factor, rel=3e-3)
    size = np.abs(np.fft.rfft(value))[: 2 + lines + 5]
    inside = size[2 : 2 + lines]
    np.testing.assert_allclose(inside, inside[0], rtol=1e-6)
    assert size[:2].max() < 1e-6 * inside[0]
    assert size[2 + lines :].max() < 1e-6 * inside[0]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: MultiSine(1.0, 1.0, 0.2, 0.4), "no line"),
        (lambda: MultiSine(1.0, -1.0, 0.2, 0.4), "period_s"),
        (lambda: published.Identification(duration_s=0.0), "duration_s"),
        (lambda: published.Oval(radius_m=-5.0), "radius_m"),
        (lambda: excitation.speed_ramp(0.0), "from_mps"),
        (lambda: excitation.multi_sine(speed_mps=-3.0), "speed_mps"),
        (
            lambda: excitation.Driven(
                "slow", 5.0, Knots((0.0, 5.0), (5.0, 0.0)), Knots((0.0, 5.0), (0.0, 0.0))
            ).wanted(Setup.default().plant.vehicle, 100.0),
            "speed_mps is",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(make: Callable[[], Excitation], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        make()
