"""The benchmark of changes draws what it says that it draws, and counts as it says."""

from types import SimpleNamespace

import numpy as np
import pytest

BENCHMARK = ("changed", "pairs", "counts")


def test_a_pair_is_drawn_again(program: SimpleNamespace) -> None:
    one, again = (program.pairs.drawn(3, 5, "friction") for _ in range(2))
    np.testing.assert_array_equal(one.after[0]["ay_mps2"], again.after[0]["ay_mps2"])
    (truth,) = one.truths
    assert truth.effects == ("friction_both_axles",)
    assert -0.4 <= truth.size <= -0.15
    other = program.pairs.drawn(3, 6, "friction")
    assert other.baseline.vehicle.mass_kg != one.baseline.vehicle.mass_kg
    assert other.before[0].n == one.before[0].n


@pytest.mark.parametrize("kind", ["nothing", "two", "downforce", "relaxation"])
def test_what_changed_is_what_is_told(program: SimpleNamespace, kind: str) -> None:
    pair = program.pairs.drawn(11, 2, kind)
    assert pair.kind == kind
    least = {"nothing": 0, "two": 2}.get(kind, 1)
    assert least <= len(pair.truths) <= (4 if kind == "two" else least)
    assert not np.array_equal(pair.before[0]["vy_mps"], pair.after[0]["vy_mps"])


@pytest.mark.parametrize("driving", ["step", "road", "hills"])
def test_the_driving_is_the_one_that_is_asked_for(program: SimpleNamespace, driving: str) -> None:
    pair = program.pairs.drawn(3, 5, "friction", driving, with_vy=False)
    assert driving in pair.driving
    assert "vy_mps" not in pair.before[0].channels
    assert pair.before[0].duration_s > 20.0
    assert len(pair.before) == len(pair.after) == (1 if driving == "step" else 3)
    if driving in program.pairs.ROADS:
        assert not np.array_equal(pair.before[0]["steer_rad"], pair.after[0]["steer_rad"])
        other = program.pairs.drawn(3, 5, "friction", "hills" if driving == "road" else "road")
        assert not np.array_equal(pair.before[0]["ax_mps2"], other.before[0]["ax_mps2"])


def row(truths: int, named: bool, wrong: int) -> dict[str, object]:
    told = {"first": named, "group": named, "least": named, "inside": named}
    told |= {"weak": not named, "imitated": False}
    return {
        "kind": "mass" if truths else "nothing",
        "truths": [told] * truths,
        "wrong": ["rear_toe"] * wrong,
        "named": ["mass"] * named + ["rear_toe"] * wrong,
        "unknown": [],
        "headline": "",
    }


def test_what_is_said_is_counted(program: SimpleNamespace) -> None:
    rows = [row(1, True, 0), row(1, False, 0), row(1, True, 1), row(0, False, 0), row(0, False, 1)]
    text = program.counts.table(rows)
    mass = next(line for line in text.splitlines() if line.split()[0] == "mass")
    assert mass.split()[1:] == ["3", "2", "2", "2", "2", "2/3", "1"]
    assert "not named 1, told that one of usual size is too weak to see 1, that it is" in text
    assert "nothing changed: 2, claims 1," in text
    assert "pairs with a change 3, with a wrong name 1" in text
