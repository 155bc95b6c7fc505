"""What goes wrong in simulators of others: they fail, give no numbers, or keep things hidden."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np

from .._common.arrays import FloatArray
from ..errors import InvalidInput, NumericalError, SysidError

Twin = Any  # as `protocol.Twin` describes it
Limits = tuple[str, float, float]
"""Name of a parameter, its lower and its upper limit."""
_ALIKE = 1e-6  # relative: solvers that begin anew round otherwise
_REMEDY = "take smaller gains, a nearer start or narrower limits, or mend the simulator there"


class AtWork(Protocol):
    """What has a twin at work."""

    @property
    def at_work(self) -> Twin:
        """The last one that was asked for something."""


def all_numbers(twin: Twin, outputs: FloatArray) -> FloatArray:
    """The outputs of a twin.

    Raises
    ------
    NumericalError
        If one of them is no number.
    """
    found = np.asarray(outputs, dtype=np.float64)
    if found.shape != (len(twin.output_names),):
        raise InvalidInput(
            f"the twin reads an array of shape {found.shape}; it has to give "
            f"{len(twin.output_names)} numbers, {', '.join(twin.output_names)}"
        )
    if not np.all(np.isfinite(found)):
        where = twin.output_names[int(np.flatnonzero(~np.isfinite(found))[0])]
        raise NumericalError(f"the twin's {where} is no number")
    return found


@contextmanager
def blamed_on(several: AtWork, k: int, dt: float) -> Iterator[None]:
    """Give what fails in a step the sample, the time, and the parameters of the twin at work.

    Raises
    ------
    NumericalError, InvalidInput
        Anything that a simulator raised, as its cause.
    """
    try:
        yield
    except Exception as error:
        twin = several.at_work
        known = twin.get_parameters() if "parameters" in twin.capabilities else {}
        having = "".join(f", {name} = {value:.6g}" for name, value in known.items())
        said = str(error) if isinstance(error, SysidError) else ""
        said = said or f"the twin failed ({type(error).__name__}: {error})"
        text = f"{said} (sample {k}, t = {k * dt:.6g} s{having})"
        if isinstance(error, InvalidInput):
            raise InvalidInput(text) from error
        raise NumericalError(f"{text}; {_REMEDY}") from error


def check_start(limits: Iterable[Limits], known: Mapping[str, float]) -> None:
    """See whether what is looked for begins within its limits: outside, the first step is a jump.

    Parameters
    ----------
    limits : iterable of (str, float, float)
        Of what is looked for.
    known : mapping of str to float
        First parameters of the twin.

    Raises
    ------
    InvalidInput
        It does not; the message names parameter and limits.
    """
    for name, lower, upper in limits:
        if name in known and not lower <= known[name] <= upper:
            raise InvalidInput(
                f"{name} begins at {known[name]:.6g}, and its limits are {lower:.6g} to "
                f"{upper:.6g}; begin within them, or give limits that hold it"
            )


def check_repeats(twin: Twin, inputs: FloatArray) -> None:
    """See whether a twin does the same again from the same place, as far as it can be put back.

    Noise of its own would pass for what the parameters do, and what it keeps beside its state its
    clones share.

    Raises
    ------
    InvalidInput
        It does not; the message says what differs.
    """
    if "snapshot" not in twin.capabilities:
        return
    try:
        begin = twin.snapshot()
        tries = []
        for _ in range(2):
            now = twin.outputs(inputs)
            twin.step(inputs)
            tries.append((now, twin.outputs(inputs)))
            twin.restore(begin)
    except Exception:
        return  # what fails is told with its sample where the observer runs
    for when, (one, other) in zip(("", " after one step"), zip(*tries, strict=True), strict=True):
        apart = ~np.isclose(one, other, rtol=_ALIKE, atol=_ALIKE, equal_nan=True)
        if np.shape(apart) == (len(twin.output_names),) and apart.any():
            i = int(np.flatnonzero(apart)[0])
            raise InvalidInput(
                f"the twin does not repeat itself: {twin.output_names[i]}{when} is "
                f"{one[i]:.6g}, and {other[i]:.6g} from the same place again; leave out its noise, "
                "and keep all that changes in its state, which its clones take over"
            )
