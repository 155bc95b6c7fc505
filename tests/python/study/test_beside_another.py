"""Two effects of which neither holds alone."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.search.search import Search, Trail
from sysid_vehicle.study.search.steps import likeliest


@pytest.mark.parametrize(("target", "found"), [("F_y", True), ("a_x", False)])
def test_lateral_errors_say_nothing_of_two_effects_along_the_car(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch, target: str, found: bool
) -> None:
    """A lag of the wheel force and rolling resistance held only together, and tyres were missing:

    nothing was added, and the study of a bus ended as unknown.
    """
    car = truth.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.6})
    baseline = identify(start, drive(car, manoeuvres.lap(20.0), seed=61, rate_hz=50.0), starts=1)
    dx = diagnose(baseline, candidates=["aero_drag", "head_wind"])
    first = likeliest(dx)
    assert first is not None
    assert first.fit is not None
    other = next(c for c in dx.ranking if c.id != first.id)
    both = replace(first.fit, model=first.fit.model.add(other.effect))
    p_values = dict.fromkeys(("F_x", "F_y", "a_x"), 0.5) | {target: 1e-60}
    looking = Search(
        baseline.driving,
        candidates=list(dx.family),
        most_effects=2,
        ends=np.inf,
        rules=USUAL,
        seed=0,
        progress=False,
        say=lambda _: None,
    )
    for name, stands_in in (
        ("first_that_holds", lambda *_: (other, both)),
        ("omnibus", lambda *_: Omnibus(450.0, 50, 1e-60, target, alone=p_values)),
    ):
        monkeypatch.setattr(f"sysid_vehicle.study.search.search.{name}", stands_in)
    monkeypatch.setattr(Search, "_diagnosis", lambda *_: dx)
    step = looking._beside_another(dx, Trail([baseline]))
    assert step == ((first, both) if found else None)
