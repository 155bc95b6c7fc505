"""What of a finished study takes long to tell: worked out in time, or left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.threads import before, in_parallel
from ...diagnose import Causes, where
from ...rules import UNKNOWN
from ..ahead.shares import Shares

if TYPE_CHECKING:
    from ..study import Study


@dataclass(frozen=True)
class _Part:
    """An attribute of a study that takes long.

    Attributes
    ----------
    words : str
        What it tells.
    otherwise : callable
        What stands for it where it is left out, from the study.
    """

    words: str
    otherwise: Callable[[Study], Any]


def _nothing(study: Study) -> Shares:
    none = np.empty((3, 0, 0))
    return Shares((), (), none, none, none, np.empty(0), (), UNKNOWN, ())


def _without_causes(study: Study) -> Any:
    """Maps and coherence alone, which take a pass or two."""
    name = study.name_of(study.fit)
    return where(study.fit, causes=False, name=name, omnibus=study.omnibus)


_PARTS = {
    "shares": _Part("how much of the errors ahead could be explained", _nothing),
    "predicting": _Part("what a fit to predictions gains", lambda _: None),
    "disagreements": _Part("which parameters validation data give differently", lambda _: ()),
    "between_logs": _Part("which parameters training logs give differently", lambda _: []),
    "sufficient": _Part("whether the errors of the baseline matter", lambda _: None),
    "where": _Part("moments at which the car changed, and delays", _without_causes),
    "unknown": _Part("the shape of what is missing", lambda _: None),
    "late": _Part("the delay of the car without the lags of the model", lambda _: {}),
}
"""In the order in which they are asked for."""
_REPORTED = {
    "causes": _Part(
        "which causes exact refits confirm",
        lambda study: tuple(Causes({}, (), {}) for _ in study.diagnoses),
    ),
    "errors_with": _Part(
        "the errors with each effect alone", lambda study: tuple({} for _ in study.diagnoses)
    ),
    "hidden": _Part("which effects the identified parameters would hide", lambda _: None),
}
"""What reports and files tell besides."""


def told(study: Study, *, whole: bool = False) -> dict[str, Any]:
    """What of a study takes long to tell and has been told, by attribute.

    Parameters
    ----------
    study : Study
    whole : bool
        Without what stands for parts that were left out.
    """
    found = {name: study.__dict__[name] for name in _slow(study) if name in study.__dict__}
    left_out = {*study.left_out, "left_out"} if whole else set()
    return {name: of for name, of in found.items() if name not in left_out}


def take_over(study: Study, found: Mapping[str, Any]) -> Study:
    """The same study, which need not work out what another one has `told`."""
    known = _slow(study)
    study.__dict__.update({name: of for name, of in found.items() if name in known})
    return study


def with_told(study: Study) -> Study:
    """The same study for a file, which holds what has been told too."""
    own = replace(study)
    object.__setattr__(own, "worked_out", told(study, whole=True))
    return own


def _slow(study: Study) -> tuple[str, ...]:
    return tuple(n for n, of in vars(type(study)).items() if isinstance(of, cached_property))


def in_time(study: Study, ends: float, *, reported: bool = True) -> Study:
    """Work out side by side what takes long, and leave out what is not done in time.

    Parameters
    ----------
    study : Study
    ends : float
        By `time.perf_counter`. What stands for the parts left out takes a pass or two more.
    reported : bool
        Whether also what only reports and files tell.

    Returns
    -------
    Study
        The same study, whose `left_out` says what is missing.
    """
    parts = _PARTS | _REPORTED if reported else _PARTS
    own = study.with_warnings(study.warnings)
    for name in study.left_out:
        del own.__dict__[name]  # it may be told now

    def asked(name: str) -> bool:
        return before(ends, lambda: (getattr(own, name),), None) is not None

    done = in_parallel(asked, parts)
    late = {name: parts[name] for name, there in zip(parts, done, strict=True) if not there}
    for name, part in late.items():
        own.__dict__[name] = part.otherwise(own)
    own.__dict__["left_out"] = {name: part.words for name, part in late.items()}
    return own
