"""Effects of users that act only where conditions hold, and names and bounds that mislead."""

from __future__ import annotations

import operator
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.effects.formula import trace

FORCE = sv.parameter("force", "N", typical=80.0, lower=0.0, upper=900.0)

pytestmark = pytest.mark.usefixtures("no_effects_left")


def conditions(d: Any, p: Any) -> Any:
    """Every way to join comparisons, each with a weight of its own."""
    every = (
        (d.v_x >= 20.0) & (d.v_y < 0.1),
        (d.v_x <= 20.0) | (d.v_y > d.r),
        ~(d.v_x > 20.0),
        np.logical_and(d.v_x > 10.0, np.logical_not(d.r > 0.0)),
        np.logical_or(d.v_x < 10.0, np.greater_equal(d.r, 0.2)),
        np.less_equal(d.r, d.v_y),
    )
    return p.force * sum(np.where(c, 2.0**k, 0.0) for k, c in enumerate(every))


def test_joined_comparisons_give_the_numbers_of_numpy() -> None:
    effect = sv.define_effect(
        "joined", title="conditions", parameters=[FORCE], reads={"ay_mps2": conditions}
    )
    car = sv.example_vehicle()
    plain, model = sv.Model(car), sv.Model(car).add(effect).with_values({"joined.force": 1.0})
    none = sv.SensorNoise.none()
    drive = sv.simulate.drive_truth(model, sv.manoeuvres.lap(30.0), seed=1, noise=none)
    v_x, v_y, r = drive.states.T
    # Where a comparison is as good as equal, rounding decides.
    d = SimpleNamespace(v_x=v_x, v_y=v_y, r=r)
    wanted = conditions(d, SimpleNamespace(force=1.0))
    assert len(np.unique(wanted)) > 5
    for k in range(0, len(v_x), 20):
        x, u = drive.states[k], drive.inputs[k]
        without = plain.core().evaluate(plain.vector(), x, u[0], u[1])[0, 4]
        assert drive.outputs[k, 4] - without == pytest.approx(wanted[k], abs=1e-9)


def test_conditions_are_printed_as_they_are_written() -> None:
    def function(d: Any, p: Any) -> Any:
        return p.force * np.where((d.v_x >= 3.0) & ~(d.r > 0.1), d.r, 0.0)

    formula = trace(function, ["force"], "moment_z", "an effect")
    assert formula.text == "force * where((v_x >= 3) & (~(r > 0.1)), r, 0)"


@pytest.mark.parametrize("join", [operator.and_, operator.or_, np.logical_and])
def test_what_is_no_comparison_is_not_joined(join: Callable[[Any, Any], Any]) -> None:
    with pytest.raises(sv.InvalidInput, match=r"'&', '\|' and '~' join comparisons .* not 'v_x'"):
        sv.define_effect(
            "joined",
            title="conditions",
            parameters=[FORCE],
            force_y=lambda d, p: p.force * np.where(join(d.v_x, d.r > 0.0), 1.0, 0.0),
        )


def test_what_acts_at_low_speed_or_light_load_alone_is_an_effect() -> None:
    def scrub(d: Any, p: Any) -> Any:
        return -p.force * d.r * np.where((d.v_x < 3.0) & (d.F_zf < 20.0), 1.0, 0.0)

    effect = sv.define_effect("scrub", title="scrub", parameters=[FORCE], moment_z=scrub)
    assert not effect.scored_at_typical
    assert effect.parameters[0].mirrored == sv.effect("aero_drag").parameters[0].mirrored
    with pytest.raises(
        sv.InvalidInput, match=r"does nothing by itself, at any speed from 0\.5 to 50"
    ):
        sv.define_effect(
            "never",
            title="never",
            parameters=[FORCE],
            force_y=lambda d, p: p.force * np.where(d.v_x < 0.0, 1.0, 0.0),
        )


def test_a_parameter_is_not_called_as_what_the_function_reads() -> None:
    speed = sv.parameter("v_x", "1", typical=1.0, lower=0.0, upper=2.0)
    flap = sv.parameter("flap_rad", "1", typical=1.0, lower=0.0, upper=2.0)
    with pytest.raises(sv.InvalidInput, match="the parameter v_x is called as what"):
        sv.define_effect(
            "own", title="own", parameters=[speed], force_y=lambda d, p: p.v_x * d.v_x * d.r
        )
    with pytest.raises(sv.InvalidInput, match="the parameter flap_rad is called as what"):
        sv.define_effect(
            "own",
            title="own",
            parameters=[flap],
            channels={"flap_rad": (0.0, 0.5)},
            force_y=lambda d, p: p.flap_rad * d.flap_rad,
        )


def test_a_search_has_finite_bounds_and_a_number_a_unit() -> None:
    for low, high in ((-np.inf, np.inf), (0.0, np.inf), (np.nan, 1.0), (2.0, -2.0)):
        with pytest.raises(sv.InvalidInput, match=r"give \(lowest, highest\), finite"):
            sv.parameter("gain", "N", typical=1.0, lower=low, upper=high)
    assert sv.parameter("gain", "", typical=1.0, lower=0.0, upper=2.0).unit == "1"
