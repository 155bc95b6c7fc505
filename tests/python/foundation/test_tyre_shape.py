"""What the Magic Formula's coefficients mean together."""

import math

import numpy as np
import pytest

from sysid_vehicle import Tyre
from sysid_vehicle.identify.search.tyre_shape import (
    friction,
    look_alike,
    of_usual_shape,
    peak_slip,
    stiffness,
    top,
)


@pytest.mark.parametrize("slip", [-0.3, -0.02, 0.0, 0.004, 0.1, 0.6])
def test_the_curve_is_the_formula(slip: float) -> None:
    """Pacejka, Tire and Vehicle Dynamics (3rd ed.), eq. (4.6)."""
    b, c, d, e = 9.0, 1.3, 0.9, -0.7
    bent = b * slip - e * (b * slip - math.atan(b * slip))
    expected = d * math.sin(c * math.atan(bent))
    assert float(friction(np.array(slip), np.array([b, c, d, e]))) == pytest.approx(expected)
    assert float(Tyre(b, c, d, e).friction(slip)) == pytest.approx(expected)


@pytest.mark.parametrize("c", [0.6, 0.95, 1.0, 1.3, 1.9])
def test_the_top_is_what_the_curve_reaches(c: float) -> None:
    """Without a peak, where C is 1 or less, it is reached far out."""
    bcde = np.array([12.0, c, 1.1, 0.4])
    reached = friction(np.geomspace(1e-3, 1e6, 200_001), bcde)
    assert top(bcde) == pytest.approx(float(reached.max()), rel=1e-5)
    assert top(bcde) == pytest.approx(1.1 if c >= 1.0 else 1.1 * math.sin(0.5 * math.pi * c))
    if c > 1.0:
        assert float(friction(np.array(peak_slip(bcde)), bcde)) == pytest.approx(top(bcde))
    else:
        assert math.isinf(peak_slip(bcde))


def test_a_tyre_of_usual_shape_has_the_same_stiffness() -> None:
    bcde = np.array([22.0, 0.9, 1.6, 0.2])
    usual = of_usual_shape(bcde)
    assert stiffness(usual) == pytest.approx(stiffness(bcde)) == pytest.approx(22.0 * 0.9 * 1.6)
    assert usual[1:].tolist() == [Tyre().C, Tyre().D, Tyre().E]


@pytest.mark.parametrize(
    ("above_one", "below_one"),
    [
        (2.1553677205687904e-05, 0.0017728327609849437),
        (0.3778593058072932, 2.5712555699941575e-05),
        (0.28013108512641627, 0.0007653798495174113),
        (0.4041916471582798, 5.74977722767045e-07),
        (0.8, 0.2),
        (0.8, 40.0),
    ],
)
def test_the_peak_is_found_where_the_curvature_factor_is_near_one(
    above_one: float, below_one: float
) -> None:
    """The slip of a curve that hardly bends back is large, and what it depends on small."""
    c, e = 1.0 + above_one, 1.0 - below_one
    x = 10.0 * peak_slip(np.array([10.0, c, 1.0, e]))
    assert c * np.arctan((1.0 - e) * x + e * np.arctan(x)) == pytest.approx(0.5 * np.pi, rel=1e-9)


def test_look_alike_keeps_stiffness_and_peak() -> None:
    tyre = np.array([22.0, 1.8, 1.6, 0.8])
    other = look_alike(tyre, 0.1)
    assert other[3] == 0.1
    assert stiffness(other) == pytest.approx(stiffness(tyre))
    assert peak_slip(other) == pytest.approx(peak_slip(tyre), rel=1e-6)
    # No tyre of C <= 3 has its peak so late: B and C stay.
    assert look_alike(np.array([22.0, 0.9, 1.6, 0.0]), 0.5)[:2] == pytest.approx([22.0, 0.9])
