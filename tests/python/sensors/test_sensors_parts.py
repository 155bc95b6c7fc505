"""A fault of a sensor is the same in all parts of the driving; what imitates one is not."""

import numpy as np
import pytest
from scipy import sparse

import sysid_vehicle as sv
from sysid_vehicle.sensors.kinematics.motion import Stretch
from sysid_vehicle.sensors.kinematics.parts import Scatter, cut, scatter
from sysid_vehicle.sensors.kinematics.system import Band


def test_parts_are_of_one_length_and_hold_all_the_driving() -> None:
    parts = cut([Stretch(0, 10.0, 110.0), Stretch(1, 0.0, 50.0), Stretch(1, 60.0, 120.0)])
    lengths = [sum(s.last_s - s.first_s for s in part) for part in parts]
    assert len(parts) == 3
    assert sum(lengths) == pytest.approx(210.0)
    assert max(lengths) < 1.2 * min(lengths)
    assert [s.log for part in parts for s in part] == [0, 0, 1, 1, 1]
    assert cut([Stretch(0, 0.0, 110.0)]) == []


def test_scatter_beyond_the_noise_widens(rng: np.random.Generator) -> None:
    same = scatter([0.01, 0.012, 0.009], [0.002] * 3)
    assert same is not None
    assert same.more == 0.0
    assert same.std == pytest.approx(0.002 / np.sqrt(3.0))
    apart = scatter([0.0, 0.03, 0.06], [0.002] * 3)
    assert apart is not None
    # Three values 0.03 apart: their mean is known to 0.017, by Student's distribution 2.2 times.
    assert apart.more == pytest.approx(0.0173 * 2.195, rel=0.02)
    assert scatter([0.01], [0.002]) is None


def test_a_whole_that_none_of_its_parts_supports_is_not_sure() -> None:
    parts = Scatter(0.0, 0.001, 0.0)
    assert parts.widened(-0.048, 0.009) == pytest.approx(0.048)
    assert parts.widened(-0.02, 0.009) == pytest.approx(0.009)


def test_a_scale_that_changes_is_no_fault_of_the_sensor() -> None:
    log = sv.drive(sv.Model(sv.example_vehicle()), sv.manoeuvres.lap(130.0), seed=3)
    late = log["time_s"] > 65.0

    def found(gain: np.ndarray | float) -> sv.SensorCheck:
        columns = {c: np.array(log[c]) for c in log.channels if log.has(c) and c != "ax_mps2"}
        columns["ay_mps2"] *= 1.0 + gain
        return sv.check(sv.Log.from_arrays(columns))

    assert found(0.08)["gain_ay"].found
    assert not found(np.where(late, 0.16, 0.0))["gain_ay"].found


def test_variances_are_those_of_the_inverse(rng: np.random.Generator) -> None:
    n, width = 130, 6
    lower = sparse.diags(
        [rng.standard_normal(n - k) * 0.3**k + 2.0 * (k == 0) for k in range(width)],
        [-k for k in range(width)],
    )
    h = lower @ lower.T
    rows = sparse.random(70, n, density=0.03, random_state=4, format="csr")
    rows = sparse.csr_matrix(rows[rows.getnnz(axis=1) > 0])
    expected = np.diag(rows @ np.linalg.inv(h.toarray()) @ rows.T.toarray())
    np.testing.assert_allclose(
        Band(sparse.csr_matrix(lower.T)).variances(rows), expected, rtol=1e-9
    )


@pytest.mark.parametrize("told", [1e-5, 1e-2])
def test_variances_reach_as_far_as_the_motion_remembers(told: float) -> None:
    """A walk that is hardly read: what is known of a place dies away over many steps."""
    n = 600
    changes = sparse.diags([-1.0, 1.0], [0, 1], shape=(n - 1, n), format="csr")
    rows = sparse.vstack([np.sqrt(told) * sparse.eye(n), changes], format="csr")
    inverse, band = np.linalg.inv((rows.T @ rows).toarray()), Band(rows)
    for place in (5, 300):
        row = sparse.csr_matrix(([1.0], ([0], [place])), shape=(1, n))
        assert band.variances(row) == pytest.approx(inverse[place, place], rel=1e-9)
