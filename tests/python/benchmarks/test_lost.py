"""What the benchmarks of other simulators say of an effect that a study lost."""

from collections.abc import Callable
from types import SimpleNamespace

import pytest

from sysid_vehicle import Fit, Log, Model, drive
from sysid_vehicle.estimate import Driving
from sysid_vehicle.manoeuvres import handling_course

BENCHMARK = ("twin", "lost")


@pytest.fixture
def lost(program: SimpleNamespace) -> SimpleNamespace:
    return program.lost


def study(
    effects: tuple[str, ...] = (),
    finding: str = "absent",
    seen: tuple[tuple[str, ...], ...] = (),
    warnings: tuple[str, ...] = (),
) -> SimpleNamespace:
    """A study with a final model, what its verdicts say of drag, and models on the way."""
    drag = SimpleNamespace(effect=SimpleNamespace(id="aero_drag"), finding=finding, because="so")
    return SimpleNamespace(
        fit=SimpleNamespace(model=SimpleNamespace(effects=effects)),
        verdicts=SimpleNamespace(all=(drag,)),
        diagnoses=[
            SimpleNamespace(fit=SimpleNamespace(model=SimpleNamespace(effects=e)), significant=())
            for e in seen
        ],
        warnings=warnings,
    )


def test_it_says_how_an_effect_was_lost(lost: SimpleNamespace) -> None:
    drag = "aero_drag"
    assert lost.fate(study((drag,), "missing"), drag) == "named"
    assert lost.fate(study((drag,), "proxy"), drag) == "added, proxy: so"
    assert "dropped" in lost.fate(study((), seen=((), (drag,))), drag)
    assert lost.fate(study((), seen=((),)), drag) == "no evidence for it"
    back = "mass and aero_drag removed again: errors 1 to 5 s ahead grow"
    assert "taken back" in lost.fate(study((), seen=((),), warnings=(back,)), drag)


def test_what_is_in_the_car_is_shown_by_driving_that_brings_it_about(
    lost: SimpleNamespace,
    hidden_fit: Callable[[str, float], Fit],
    truth: Model,
    course: Log,
    fit: Fit,
) -> None:
    name = "aero_drag.drag_area_m2"
    with_drag = drive(
        truth.add("aero_drag").with_values({name: 1.0}), handling_course(40.0), seed=3
    )
    there = lost.shown(hidden_fit(name, 1.0), Driving.of(with_drag), "aero_drag")
    absent = lost.shown(fit, Driving.of(course), "aero_drag")
    assert there.value[0] == pytest.approx(1.0, abs=4.0 * there.std[0])
    assert there.validation > lost.LEAST_NATS > absent.validation
    assert lost.testable({"aero_drag": vars(there)})
    assert not lost.testable({"aero_drag": vars(absent), "mass": {"fate": "no evidence for it"}})
