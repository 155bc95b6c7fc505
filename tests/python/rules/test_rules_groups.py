"""Names that stand by what effects which act alike take together."""

from dataclasses import replace

import pytest

from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.rules import Added, Facts, Share, standing, verdict

SMALLER_WITHOUT = Share(-0.14, -0.20, -0.06)
NONE_OF_IT = Share(0.01, -0.04, 0.06)
MOST = Share(0.77, 0.66, 0.81)
LATERAL = frozenset({"yaw_rate_radps"})


def facts(own: Share, own_in_training: Share) -> Facts:
    """A late steering that something else is likelier than, and what acts like it."""
    late = Added(
        *("steer_delay", "missing", (), LATERAL, NONE_OF_IT, NONE_OF_IT),
        against="steer_lag in its place would fit training and validation data better",
    )
    inertia = Added("yaw_inertia", "missing", (), LATERAL, own, own_in_training)
    found = Facts(
        Omnibus(200.0, 30, 1e-18, "M_z"),
        missing=(8.0, 3.0),
        taken_low=0.6,
        structure=0.44,
        added=(late, inertia),
    )
    return found.with_groups({("steer_delay", "yaw_inertia"): (MOST, MOST)})


def stand(found: Facts) -> frozenset[str]:
    return standing(found, verdict(found))


@pytest.mark.parametrize("own", [(NONE_OF_IT, SMALLER_WITHOUT), (SMALLER_WITHOUT, NONE_OF_IT)])
def test_what_errors_are_smaller_without_has_no_part_in_a_group(own: tuple[Share, Share]) -> None:
    assert stand(facts(*own)) == frozenset()
    assert verdict(facts(*own)).verdict == "unknown"


def test_a_copy_has_its_part_in_a_group() -> None:
    """Beside each other neither takes anything, as the other does it in its place."""
    assert stand(facts(NONE_OF_IT, NONE_OF_IT)) == {"yaw_inertia"}
    found = facts(NONE_OF_IT, NONE_OF_IT)
    both = tuple(replace(a, against="") for a in found.added)
    assert stand(replace(found, added=both)) == {"steer_delay", "yaw_inertia"}
