"""What tyre coefficients mean together: stiffness at the load of the car, and peaks."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from sysid_vehicle import Fit, Model, Vehicle, drive, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import refine


def test_a_peak_that_the_driving_did_not_reach_is_extrapolated(
    fit: Fit, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By noise alone a curve seems to be known as far as its formula goes."""
    gentle = drive(truth, manoeuvres.lap(30.0, 3.0), seed=11, rate_hz=50.0)
    below = refine(fit.model, Driving.of(gentle), fit.noise)
    sure = replace(below, covariance=1e-6 * below.covariance)
    for axle in ("front", "rear"):
        for what in ("peak friction", "slip at the peak"):
            assert sure[f"{what} {axle}"].note == "extrapolated"
            assert sure[f"{what} {axle}"].value == below[f"{what} {axle}"].value
        assert sure[f"cornering stiffness {axle}"].note == ""
    # Where an axle goes beyond its peak that is told without a note.
    module = import_module("sysid_vehicle.identify.fit")
    monkeypatch.setattr(module, "reached", lambda *_: (0.5, 0.001))
    sure = replace(sure)  # one that has not been asked yet
    assert sure["slip at the peak front"].note == sure["peak friction front"].note == ""
    assert sure["slip at the peak rear"].note == sure["peak friction rear"].note == "extrapolated"


def test_cornering_stiffness_is_that_at_the_load_of_the_car_that_was_found(
    fit: Fit, car: Vehicle
) -> None:
    """Mass and place of the centre of gravity change the loads by which the stiffness counts."""
    error, back = 0.11, 0.09
    given = {"mass.relative_error": error, "cg_position.shift_rearward_m": back}
    model = fit.model.add(*(name.split(".")[0] for name in given)).with_values(given)
    heavier = car.replace(
        mass_kg=(1.0 + error) * car.mass_kg, lf_m=car.lf_m + back, lr_m=car.lr_m - back
    )
    told, wanted = fit.values_of(model), fit.values_of(Model(heavier).with_values(_tyres(fit)))
    assert told == pytest.approx(wanted)
    assert told["cornering stiffness rear"] > 1.15 * fit["cornering stiffness rear"].value
    found = refine(model, fit.driving, fit.noise)
    p, columns = found.model.vector(), found.columns
    for axle in ("front", "rear"):
        what = found.quantities[f"cornering stiffness {axle}"]
        slope = np.array([(what.of(p + d) - what.of(p - d)) / 2e-6 for d in 1e-6 * np.eye(p.size)])
        std = np.sqrt(slope[columns] @ found.covariance @ slope[columns])
        assert found[what.name].std == pytest.approx(std, rel=1e-3)


def _tyres(fit: Fit) -> dict[str, float]:
    names = [f"{letter}_{axle}" for letter in "BCDE" for axle in ("front", "rear")]
    return {name: fit.model.value(name) for name in names}
