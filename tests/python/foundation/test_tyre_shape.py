"""What the Magic Formula's coefficients mean together."""

import numpy as np
import pytest

from sysid_vehicle.identify.search.tyre_shape import look_alike, peak_slip, stiffness


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
