"""What a car weighs, and how that is spread."""

import numpy as np
import pytest

from sysid_vehicle.twin import LOADED_SUV, NOMINAL_SUV, Load, PointMass


def test_loads_bring_their_products_of_inertia() -> None:
    people = [PointMass(75.0, -1.3, -0.4, 0.9), PointMass(80.0, -2.2, 0.4, 0.9)]
    load = NOMINAL_SUV.with_masses(people)
    # Of each part about the common centre, the car's own kept.
    parts = [
        PointMass(NOMINAL_SUV.mass_kg, NOMINAL_SUV.cg_x_m, NOMINAL_SUV.cg_y_m, NOMINAL_SUV.cg_z_m)
    ]
    centre = np.array([load.cg_x_m, load.cg_y_m, load.cg_z_m])
    expected = {"jxy_kgm2": NOMINAL_SUV.jxy_kgm2, "jxz_kgm2": NOMINAL_SUV.jxz_kgm2}
    expected["jyz_kgm2"] = NOMINAL_SUV.jyz_kgm2
    for m in (*parts, *people):
        x, y, z = np.array([m.x_m, m.y_m, m.z_m]) - centre
        for name, product in (("jxy_kgm2", x * y), ("jxz_kgm2", x * z), ("jyz_kgm2", y * z)):
            expected[name] += m.mass_kg * product
    for name, value in expected.items():
        assert getattr(load, name) == pytest.approx(value)
    # As a tensor, whose products have the other sign.
    tensor = NOMINAL_SUV.inertia()
    for m in (*parts, *people):
        off = np.array([m.x_m, m.y_m, m.z_m]) - centre
        tensor = tensor + m.mass_kg * (off @ off * np.eye(3) - np.outer(off, off))
    np.testing.assert_allclose(load.inertia(), tensor, rtol=1e-9)
    assert tensor[0, 2] == pytest.approx(-load.jxz_kgm2)
    # The loaded car of table 3: as if all that was added sat at one place.
    added = LOADED_SUV.mass_kg - NOMINAL_SUV.mass_kg
    place = [
        (
            LOADED_SUV.mass_kg * getattr(LOADED_SUV, n)
            - NOMINAL_SUV.mass_kg * getattr(NOMINAL_SUV, n)
        )
        / added
        for n in ("cg_x_m", "cg_y_m", "cg_z_m")
    ]
    one = NOMINAL_SUV.with_masses([PointMass(added, *place)])
    for name in ("jxy_kgm2", "jxz_kgm2", "jyz_kgm2"):
        assert getattr(one, name) == pytest.approx(getattr(LOADED_SUV, name), abs=0.05)
    assert isinstance(load, Load)
