"""A search whose first step leads where derivatives are beyond all numbers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from sysid_vehicle.identify.search.search import Box, Outcome, minimise

FAR = 10.0


@dataclasses.dataclass
class Cubic:
    """Errors x^3 - 1, whose derivatives overflow beyond `FAR` though they themselves do not."""

    samples: int = 1

    def half_sum_of_squares(self, p: np.ndarray, gains: Any = None) -> float:
        return 0.5 * float((p[0] ** 3 - 1.0) ** 2)

    def normal_equations(
        self, p: np.ndarray, gains: Any, columns: list[int]
    ) -> tuple[float, np.ndarray, np.ndarray]:
        slope = 3.0 * p[0] ** 2
        squares = np.inf if abs(p[0]) > FAR else slope**2
        descent = np.array([-slope * (p[0] ** 3 - 1.0)])
        return self.half_sum_of_squares(p), descent, np.array([[squares]])


def searched(begin: float) -> Outcome:
    problem: Any = Cubic()
    box = Box([0], np.array([-200.0]), np.array([200.0]))
    return minimise(problem, np.array([begin]), None, box, rounds=40, tolerance=1e-8)


def test_a_step_to_where_derivatives_overflow_is_made_shorter() -> None:
    found = searched(0.05)  # its first step leads to 133
    assert found.settled
    assert found.x[0] == pytest.approx(1.0, abs=1e-3)


def test_no_search_begins_where_derivatives_overflow() -> None:
    found = searched(50.0)
    assert not found.settled
    assert found.cost == np.inf
