"""The shared strategies give what their users rely on."""

import warnings

import numpy as np
import strategies
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid_vehicle import Log, Vehicle


@settings(max_examples=25)
@given(strategies.clean_logs(lengths=st.integers(400, 2000), rates=st.floats(20.0, 100.0)))
def test_a_clean_log_is_one_that_can_be_used(columns: strategies.Columns) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        log = Log.from_arrays(columns, check=False)
    assert log.n == columns["time_s"].size
    # The channels agree with each other, which is what makes them a car's.
    if log.has("vy_mps") and log["ay_mps2"].std() > 0.5 and log.n > 5 * log.rate_hz:
        turn = log["vx_mps"] * log["yaw_rate_radps"]
        assert np.corrcoef(turn, log["ay_mps2"])[0, 1] > 0.5


@settings(max_examples=50)
@given(strategies.logs())
def test_a_spoilt_log_still_has_columns(columns: strategies.Columns) -> None:
    assert set(columns) <= set(strategies.CHANNELS)
    assert {"time_s", "vx_mps", "yaw_rate_radps", "ay_mps2", "steer_rad"} <= set(columns)
    assert len({values.size for values in columns.values()}) == 1


@settings(max_examples=50)
@given(strategies.vehicles())
def test_a_vehicle_is_accepted(vehicle: Vehicle) -> None:
    assert vehicle.wheelbase_m > 0.0
