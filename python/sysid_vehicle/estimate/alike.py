"""What logs that are used together share: what drives the model, channels of known noise."""

from __future__ import annotations

from collections.abc import Sequence

from .._common.text import few
from ..errors import InvalidInput, warn
from ..log import MEASURED, Log


def alike_in_force(logs: Sequence[Log]) -> tuple[Log, ...]:
    """Logs of which all have the wheel force, or none.

    A model is driven by the force or by the measured acceleration, and its noise is another in
    either case: one likelihood has one of the two.

    Raises
    ------
    InvalidInput
        A log has no force, and another one no acceleration to take its place.

    Warns
    -----
    SysidWarning
        The force of some logs is not used, as others lack it.
    """
    having = [log for log in logs if log.has("fx_n")]
    if not having or len(having) == len(logs):
        return tuple(logs)
    lacking = few([log.name for log in logs if not log.has("fx_n")])
    used = without_force(having, f"{lacking} has no fx_n")
    warn(
        f"{lacking} has no fx_n: the wheel force of {few([log.name for log in having])} is not "
        "used either, and ax_mps2 takes its place in all of them, so that errors of drag and drive "
        "force are not seen, and of mass hardly; record or map fx_n for all logs, or leave out "
        "those without it"
    )
    by_name = dict(zip(map(id, having), used, strict=True))
    return tuple(by_name.get(id(log), log) for log in logs)


def without_force(logs: Sequence[Log], why: str) -> tuple[Log, ...]:
    """The logs without their wheel force, where the measured acceleration takes its place.

    Raises
    ------
    InvalidInput
        A log has no acceleration; `why` says what the force cannot be used for.
    """
    blind = [log.name for log in logs if log.has("fx_n") and not log.has("ax_mps2")]
    if blind:
        raise InvalidInput(
            f"{few(blind)} has no ax_mps2, and {why}: logs that are used together need one of "
            "the two in all of them; record or map it, or leave one sort of log out"
        )
    return tuple(log.without("fx_n") if log.has("fx_n") else log for log in logs)


def without_unlearned(logs: Sequence[Log], learned: Sequence[Log]) -> Sequence[Log]:
    """The logs without readings that no log has of which the noise was learned.

    Measured by a noise that nobody knows they would be the largest errors, or none.

    Parameters
    ----------
    logs : sequence of Log
    learned : sequence of Log
        Driven by the same as the others.

    Returns
    -------
    sequence of Log
        `logs` itself where nothing is left out.

    Warns
    -----
    SysidWarning
        A channel is left out.
    """
    known = {c for log in learned for c in MEASURED if log.has(c)}
    if not all(log.has("fx_n") for log in logs):
        known.add("ax_mps2")  # it drives the model
    lost = [c for c in MEASURED if c not in known and any(log.has(c) for log in logs)]
    if not lost:
        return logs
    warn(
        f"{', '.join(lost)} of {few([log.name for log in logs])} is not used: "
        f"{few([log.name for log in learned])} does not have it, so that its noise was not "
        "learned; have it in what is fitted, too"
    )
    return [log.without(*(c for c in lost if log.has(c))) for log in logs]
