"""What an observer is given, checked before anything runs: shapes, numbers, plausible sizes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from .._common.arguments import whole
from .._common.arrays import FloatArray, as_float64
from ..errors import InvalidInput, near_names

_LONGEST_STEP_S = 0.1
_USUAL_STRIDE = 10
# The most that a name of this beginning or ending can mean, in the units of the name.
_MOST = (
    ("steer_", 2.0),
    ("drive_", 1e5),
    ("brake_", 1e5),
    ("road_rate_", 1e3),
    ("road_", 1e2),
    ("force_", 1e7),
    ("moment_", 1e7),
    ("wheel_speed_", 2e3),
    ("_acceleration_radps2", 1e5),
    ("_rate_radps", 1e2),
    ("_mps2", 1e3),
    ("_mps", 3e2),
    ("sideslip_", 4.0),
)


def checked_rows(
    values: npt.ArrayLike,
    names: Sequence[str],
    what: str,
    dt_s: float,
    *,
    missing: bool = False,
    any_size: bool = False,
) -> FloatArray:
    """Rows of numbers with one column per name, none of them absurd.

    Parameters
    ----------
    values : array_like, shape (n, len(names))
        At least one row.
    names : sequence of str
        Of the columns.
    what : str
        What the rows are, for messages.
    dt_s : float
        Step, for messages.
    missing : bool
        Whether NaN stands for what was not read; without it NaN is refused.
    any_size : bool
        Whether numbers may be of any size: names of other simulators do not tell units.

    Raises
    ------
    InvalidInput
        If the shape is another, or a number is not finite or beyond what its unit can mean; the
        message names column, sample, time and remedy.
    """
    try:
        rows = as_float64(values)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{what} are no table of real numbers: {error}") from error
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise InvalidInput(
            f"{what} have shape {rows.shape}; give (n, {len(names)}), columns {names[0]} to "
            f"{names[-1]}"
        )
    if len(rows) == 0:
        raise InvalidInput(f"{what} have no row; give at least one sample")
    # Extremes of columns first: they show what is wrong without a table of the size of the rows.
    largest, smallest = (np.fmax, np.fmin) if missing else (np.maximum, np.minimum)
    high, low = largest.reduce(rows, axis=0), smallest.reduce(rows, axis=0)
    most = np.array([np.finfo(float).max if any_size else _most(name) for name in names])
    if np.all((np.isnan(high) & missing) | ((high <= most) & (low >= -most))):
        return rows
    bad = np.isinf(rows) if missing else ~np.isfinite(rows)
    if bad.any():
        sample, column = map(int, np.argwhere(bad)[0])
        remedy = "put NaN where nothing was read" if missing else "fill gaps before"
        raise InvalidInput(
            f"{what}: {names[column]} is {rows[sample, column]} at sample {sample}, "
            f"t = {sample * dt_s:.6g} s; {remedy}"
        )
    sample, column = map(int, np.argwhere(np.abs(rows) > most)[0])
    raise InvalidInput(
        f"{what}: {names[column]} is {rows[sample, column]:g} at sample {sample}, "
        f"t = {sample * dt_s:.6g} s, beyond {most[column]:g}; check its unit"
    )


def checked_step(dt_s: float) -> float:
    """A step that a car can be integrated with.

    Raises
    ------
    InvalidInput
        If it is not between zero and a tenth of a second.
    """
    if not 0.0 < dt_s <= _LONGEST_STEP_S:
        raise InvalidInput(
            f"dt_s = {dt_s!r}; give seconds, more than zero and at most {_LONGEST_STEP_S:g}"
        )
    return float(dt_s)


def checked_stride(stride: object, samples: int) -> int:
    """A stride that leaves more than the start.

    Raises
    ------
    InvalidInput
        If it is no whole number, or beyond the samples.
    """
    every = whole(stride, "stride", 1)
    if every > max(samples, _USUAL_STRIDE):
        raise InvalidInput(
            f"stride = {every}: of {samples} samples the first alone would be recorded; give less"
        )
    return every


def check_apart(what: str, names: Sequence[str]) -> None:
    """Refuse no names, and names that come twice.

    Raises
    ------
    InvalidInput
        As it says.
    """
    if not names:
        raise InvalidInput(f"{what}: none are given; give one or more")
    for name in names:
        if names.count(name) > 1:
            raise InvalidInput(f"{what}: '{name}' comes twice; give it once")


def check_heard(compared: Iterable[str], measured: Collection[str]) -> None:
    """Refuse to compare what is not measured: it would teach nothing, silently.

    Raises
    ------
    InvalidInput
        If a compared channel is not among those that hold a reading; the message names it.
    """
    for name in compared:
        if name not in measured:
            raise InvalidInput(
                f"the observer compares '{name}', which is not measured{near_names(name, measured)}"
                f"; there are {', '.join(measured) or 'no readings'}"
            )


def _most(name: str) -> float:
    for part, most in _MOST:
        if name.startswith(part) or name.endswith(part):
            return most
    raise InvalidInput(f"there is no plausible size for '{name}'; name it as this package does")
