"""Where the share and the errors as fitted tell different stories, both are told, and truly."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid_vehicle.rules import Share
from sysid_vehicle.study.results.as_fitted import as_fitted

CHANNELS = ("vy_mps", "yaw_rate_radps", "ay_mps2")


def study(first: float, last: float, alone: float, share: tuple[float, float, float]) -> Any:
    errors = np.array([first, last])[:, None, None] * np.ones((2, 3, len(CHANNELS)))
    baseline = np.full((3, 4, 4), alone)
    return SimpleNamespace(
        explained=Share(*share),
        horizons=SimpleNamespace(horizons_s=(0.5, 1.0, 2.0), channels=CHANNELS, error=errors),
        shares=SimpleNamespace(
            horizons_s=(0.0, 0.5, 1.0, 2.0), channels=(*CHANNELS, "path_m"), baseline=baseline
        ),
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((1.0, 0.1, 0.1, (0.99, 0.98, 1.0)), ""),
        ((1.0, 0.5, 0.5, (0.95, 0.9, 1.0)), ""),
        ((1.0, 0.1, 0.5, (0.5, 0.3, 0.7)), "fall by 99 %; other parameters alone lower those of "),
        ((1.0, 0.1, 1.2, (0.5, 0.3, 0.7)), "the squared lateral errors fall by 99 %."),
        ((1.0, 1.1, 0.5, (0.5, 0.3, 0.7)), "the squared lateral errors grow by 21 %."),
    ],
)
def test_the_fall_as_fitted(given: tuple[Any, ...], said: str) -> None:
    told = " ".join(as_fitted(cast(Any, study(*given))))
    assert said in told
    assert bool(told) == bool(said)
    if "other parameters" in said:
        assert told.endswith("lower those of the baseline by 75 %.")
