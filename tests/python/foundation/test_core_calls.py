"""Whatever arrays, numbers and places the compiled core is given, it refuses them or answers.

The package checks what users hand over; here the border itself is attacked, behind those checks.
Under the sanitizers the same finds accesses out of bounds and casts of what no integer holds.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from core_calls import Call, laboratory, main_job, online, twin
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sysid_vehicle import _core, example_vehicle
from sysid_vehicle.errors import NumericalError

EXAMPLES = 4000 if "SYSID_ATTACK" in os.environ else 200
REFUSALS = (TypeError, ValueError, IndexError, OverflowError, MemoryError, NumericalError)
# Work grows with these as it should.
BUDGETS = {"most_iterations", "max_iterations", "max_rounds", "iterations", "ahead"}

Spoil = Callable[[np.ndarray, np.random.Generator], Any]


def put(value: float) -> Spoil:
    def spoil(a: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        a = a.astype(np.float64)  # places of rows are whole numbers
        a.flat[rng.integers(0, max(a.size, 1), 3) % max(a.size, 1)] = value
        return a

    return spoil


ARRAYS: dict[str, Spoil] = {
    "shorter": lambda a, rng: a[:-1],
    "longer": lambda a, rng: np.concatenate([a, a]),
    "one row": lambda a, rng: a[:1],
    "empty": lambda a, rng: a[:0],
    "no columns": lambda a, rng: a[..., :0],
    "column less": lambda a, rng: a[..., :-1],
    "flat": lambda a, rng: a.ravel(),
    "deeper": lambda a, rng: a[None],
    "number": lambda a, rng: np.float64(1.0),
    "transposed": lambda a, rng: a.T,
    "NaN": put(np.nan),
    "infinite": put(-np.inf),
    "huge": put(1e308),
    "tiny": put(5e-324),
    "negative": lambda a, rng: -a,
    "zero": lambda a, rng: 0.0 * a,
    "text": lambda a, rng: a.astype(str),
    "complex": lambda a, rng: a + 1j,
    "nothing": lambda a, rng: None,
    "objects": lambda a, rng: a.astype(object),
}
# These hold the same numbers.
SAME: dict[str, Spoil] = {
    "strided": lambda a, rng: np.repeat(a, 2, axis=0)[::2],
    "backwards": lambda a, rng: a[::-1].copy()[::-1],
    "by column": lambda a, rng: np.asfortranarray(a),
    "big-endian": lambda a, rng: a.astype(">f8"),
    "nested lists": lambda a, rng: a.tolist(),
}
NUMBERS = (0.0, -1.0, 0.5, np.nan, np.inf, 1e300, 1e-300, -(2.0**63))
WHOLE = (-1, 0, 1, 7, 10**6, 2**31 - 1, 2**31, 2**62, 2**63, 2**64 - 1, -(2**63))


@pytest.fixture(scope="module")
def calls() -> dict[str, Call]:
    car = example_vehicle()
    return {name: call for part in (main_job, laboratory, online, twin) for name, call in part(car)}


def test_what_is_right_is_accepted(calls: dict[str, Call]) -> None:
    for function, arguments in calls.values():
        function(**arguments)


def spoilt(value: Any, name: str, number: int) -> Any:
    """Something else in place of an argument."""
    rng = np.random.default_rng(number)
    if isinstance(value, np.ndarray):
        fault = sorted(ARRAYS)[number % len(ARRAYS)]
        return ARRAYS[fault](value.copy(), rng)
    if isinstance(value, bool):
        return (not value, 2, None)[number % 3]
    if isinstance(value, int):
        return (WHOLE[:4] if name in BUDGETS else WHOLE)[number % (4 if name in BUDGETS else 11)]
    if isinstance(value, float):
        return NUMBERS[number % len(NUMBERS)]
    if isinstance(value, dict):
        some = dict(value)
        some[sorted(some)[number % len(some)]] = NUMBERS[rng.integers(len(NUMBERS))]
        return some
    if isinstance(value, list | tuple):
        kinds = ([], [*value, *value], value[:-1], None, [None], *4 * [list(value)])
        other = kinds[number % len(kinds)]
        if other and other == list(value):
            at = int(rng.integers(len(other)))
            other[at] = spoilt(other[at], name, int(rng.integers(2**31)))
        return other
    return value if number % 2 else None


@pytest.mark.filterwarnings("ignore:.*ComplexWarning:Warning")
def test_what_is_wrong_is_refused_or_answered(calls: dict[str, Call]) -> None:
    names = sorted(calls)

    @settings(max_examples=EXAMPLES, suppress_health_check=[HealthCheck.too_slow], deadline=None)
    @given(
        st.sampled_from(names),
        st.lists(st.tuples(st.integers(0, 99), st.integers(0, 10**6)), min_size=1, max_size=2),
    )
    def attack(name: str, faults: list[tuple[int, int]]) -> None:
        function, right = calls[name]
        arguments = dict(right)
        for which, number in faults:
            key = sorted(arguments)[which % len(arguments)]
            arguments[key] = spoilt(right[key], key, number)
        with suppress(*REFUSALS):
            function(**arguments)

    attack()


@pytest.mark.parametrize("form", SAME)
def test_the_same_numbers_in_another_form(calls: dict[str, Call], form: str) -> None:
    rng = np.random.default_rng(0)
    for name, (function, right) in calls.items():
        if "restored" in name or name == "LabLoop":
            continue
        other = {
            key: SAME[form](value.copy(), rng) if isinstance(value, np.ndarray) else value
            for key, value in right.items()
        }
        kept = {key: value.copy() for key, value in right.items() if isinstance(value, np.ndarray)}
        np.testing.assert_equal(flat(function(**other)), flat(function(**right)), err_msg=name)
        for key, value in kept.items():
            np.testing.assert_array_equal(right[key], value, err_msg=f"{name}, {key}")


def flat(found: Any) -> list[Any]:
    """The numbers of a result."""
    if isinstance(found, dict):
        return [flat(value) for value in found.values()]
    if isinstance(found, list | tuple):
        return [flat(value) for value in found]
    return [np.asarray(found)] if isinstance(found, int | float | np.ndarray) else []


def test_places_beyond_the_arrays_are_refused() -> None:
    law = _core.ParameterLaw()
    with pytest.raises(ValueError, match="channel 18446744073709551615 is none of readings"):
        _core.ParameterLaws([law], 1e-3, 2**64 - 1, 20.0, [1.0, 1.0, 0.1])
    law.channel = 2**64 - 1
    with pytest.raises(ValueError, match="laws: channel"):
        _core.ParameterLaws([law], 1e-3, 0, 20.0, [1.0, 1.0, 0.1])


@pytest.mark.parametrize("size", [2**63, 2**64 - 1])
def test_a_band_of_more_entries_than_can_be_counted_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match="size: expected columns that fit into memory"):
        _core.banded_gram([0, 2], [0, 1], [1.0, 1.0], size)


def test_settings_of_a_loop_that_mean_nothing_are_refused() -> None:
    loop = _core.LabLoop()
    for steps in (-1, 1001, 2**31 - 1):  # the last would take hours
        with pytest.raises(ValueError, match="steps: expected 0 to 1000"):
            loop.set_plant(1.0, False, False, steps, 0.0, 9.81)
    for way in (-1, 3):
        with pytest.raises(ValueError, match="steer_by: there is no such way to steer"):
            loop.steer_by = way


def test_a_log_that_is_none_is_refused(calls: dict[str, Call]) -> None:
    learn, arguments = calls["learn_observer_noise"]
    with pytest.raises(ValueError, match="logs: expected no None"):
        learn(**{**arguments, "logs": [*arguments["logs"], None]})


@pytest.mark.parametrize("value", [np.nan, 1e300, -1.0])
def test_a_stored_state_holds_whole_numbers_where_it_counts(value: float) -> None:
    rls = _core.CorneringRls(1250.0, 1800.0, 1.2, 1.4, 0.999, 5e4, 0.1, 0.1, 0.1, 1e-3, 8e4, 8e4)
    state = rls.__getstate__()
    state[-1] = value
    with pytest.raises(ValueError, match="in place of a whole number"):
        _core.CorneringRls.__new__(_core.CorneringRls).__setstate__(state)
