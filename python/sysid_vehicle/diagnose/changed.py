"""What changed between a reference and later driving of the same car.

Everything that the reference left stays where it was: effects of the model and of the catalogue,
tyres, unknown forces, shifted clocks compete for what is new (`change/beside_reference.py`), as a
sum of single effects (`change/changes_compete.py`). A large change bends every line that is drawn
from the reference: so the leading ones are fitted exactly, the scores taken anew from there, and
the exact likelihoods decide between what was fitted.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from .._common.arguments import duration
from .._common.text import few
from .._common.typed import typed
from ..effects import Effect
from ..errors import InvalidInput, warn
from ..estimate import Driving
from ..identify import Fit, explaining, identify
from ..identify.offsets import centred
from ..log import Log, copies
from ..model import Model
from ..rules import USUAL, Rules
from ..vehicle import Vehicle
from .change.beside_unknown import acts_on, noise_beside
from .change.change import Change
from .change.in_time import InTime
from .change.may_change import YAW_INERTIA
from .change.saying import Saying
from .change.search import Search
from .diagnose import diagnose

_ASKED = 0.3  # of the time that is left, for what the reference lacks
_LACKS = 2  # effects that are put into the model of a reference, at most
_ROUNDS = 3  # times that noise is learned beside what no effect explains


@typed
@explaining
def changed(
    before: Fit,
    after: Log | Sequence[Log] | Driving | Fit,
    *,
    vehicle: Vehicle | None = None,
    candidates: Sequence[str | Effect] | None = None,
    rules: Rules = USUAL,
    time_limit_s: float | None = None,
) -> Change:
    """Tell what of a car changed since a reference: yesterday's log fits the model, today's not.

    What the reference left unexplained counts only as far as the later driving leaves more. Where
    the reference alone shows what is missing in its model (`diagnose`; in other driving only if
    something seems to have changed), or an effect that is in both the same explains more than the
    change, the reference lacks it: it is put into its model, and the drivings are compared again
    (`Change.lacks`). Both are taken as independent; noise is that of the reference, but for
    disturbances that take up what no effect explains (`Change.unknown`). What a model lacks acts
    otherwise at other speeds or lateral accelerations: as far as the later driving is there
    (`Change.alike`), standard errors hold what estimates differ by between pieces of the reference.

    Parameters
    ----------
    before : Fit
        The reference: a model fitted to earlier driving.
    after : Log, sequence of Log, Driving, or Fit
        Later driving; of a fit, its driving and vehicle.
    vehicle : Vehicle, optional
        The vehicle file of the later driving, where it is another one.
    candidates : sequence of str, optional
        Effects beside those of the model that may have changed; by default all of the catalogue.
        Those with a moment of their own, as a drop of grip, belong to one driving and are left out.
    rules : Rules
        By which changes are claimed.
    time_limit_s : float, optional
        After so many seconds the comparison ends, wherever it is, but for some passes over the
        data: about as long as `compare` and a few scorings of all effects take. What was not
        fitted by then is not named, nor called unchanged, and where it was to be tried in the place
        of what is named, it stands in the group of that. A warning and `Change.late_facts` tell
        what was left out.

    Returns
    -------
    Change

    Raises
    ------
    InvalidInput
        The wheel force is known in one of the drivings only, or the fit is one to predictions.
    NumericalError
        The model of the reference cannot be evaluated on the later driving.

    Warns
    -----
    SysidWarning
        A log is of the reference and of the later driving, with one vehicle file; a time limit
        ended the fit of the reference; or this one left something out.
    """
    ends = time.perf_counter() + duration(time_limit_s, "time_limit_s")
    if before.horizon_s:
        raise InvalidInput(
            f"the reference is a fit to predictions {before.horizon_s:g} s ahead, and evidence is "
            "of the likelihood; identify without horizon_s"
        )
    if isinstance(after, Fit):
        vehicle = after.model.vehicle if vehicle is None else vehicle
        after = replace(after.driving, offsets=())
    driving = Driving.of(after)
    if driving.force_known != before.driving.force_known:
        raise InvalidInput(
            "the wheel force fx_n is known in one of the drivings only; log it in both, or leave "
            "it out of both"
        )
    another = vehicle is not None and vehicle != before.model.vehicle
    if (both := copies(driving.logs, before.driving.logs)) and not another:
        told = "of the reference and of the later driving, and with itself nothing has changed"
        warn(f"{few(both)} {'is' if len(both) == 1 else 'are'} {told}")
    if before.broken_off:
        warn("a time limit ended the fit of the reference: what it lacks may look like a change")
    lacks: list[str] = []
    while True:
        in_time = InTime(ends)
        search = Search(before, _later(before, driving, vehicle), candidates, rules, in_time)
        found = _compared(search, candidates, may_lack=len(lacks) < _LACKS)
        if not isinstance(found, Change):
            work = partial(identify, before.model.add(found), before.driving, starts=1)
            own = in_time.of(work, None)
            if own is not None:
                lacks.append(found.id)
                before = own
                continue
            in_time.reference = True
            found = Saying(search).change()
        if found.late_facts:
            warn(f"the time limit ended the comparison: {'; '.join(found.late_facts)}")
        return replace(found, lacks=tuple(lacks))


def _compared(
    search: Search, candidates: Sequence[str | Effect] | None, *, may_lack: bool
) -> Change | Effect:
    """What changed, or what has to be put into the model of the reference first.

    What the reference shows alone is asked for first: lines from where it is wrong hide a change
    of what it lacks, and lead far astray beside others. In other driving what stands in for a lack
    acts otherwise, which pieces of the reference tell as long as it is left out: there it is asked
    for as soon as a single change is shown.
    """
    like = search.alike.beyond <= search.rules.taken
    first = like or search.nothing(search.singles) <= 1.0 - search.rules.credible
    if may_lack and first:
        lack = _named_in(search, candidates)
        if lack is not None:
            return lack
    said = Saying(search)
    change = said.change()
    lack = said.lack() if may_lack and not change.calm else None
    if may_lack and not (change.calm or first or lack):
        lack = _named_in(search, candidates)
        if search.in_time.reference:
            change = said.change()
    if lack is not None:
        return lack
    return _beside_unknown(said, candidates).change() if change.unknown else change


def _beside_unknown(said: Saying, candidates: Sequence[str | Effect] | None) -> Saying:
    """What changed beside what no effect explains, which other changes stood in for.

    Disturbances of the later driving take that up. If nothing unknown is left beside what was found
    then, the first search had ended elsewhere, and goes on there.
    """
    first, here = said.search, said
    own = InTime(first.in_time.ends)
    for _ in range(_ROUNDS):
        put, search = frozenset(here.priced[1].put), here.search
        parts = [s for key, s in search.visited.items() if key <= put]
        work = partial(noise_beside, parts, here.unknown, first.before.noise)
        found = own.of(work, None)
        if found is None:
            break
        start, before = replace(first.start, noise=found.noise), here
        here = Saying(Search(first.before, start, candidates, first.rules, own))
        if own.over:
            break
        if not here.unknown:
            first.again(here.priced[1])
            return Saying(first)
        same = frozenset(here.priced[1].put) == frozenset(found.put)
        if same and acts_on(here.unknown) == acts_on(before.unknown):
            break
    if own.over:
        first.in_time.unknown = True
        return said
    return here


def _named_in(search: Search, candidates: Sequence[str | Effect] | None) -> Effect | None:
    """The one effect that the reference alone shows to be missing: it bends what is beside it.

    A delay of the steering beside a compliance that the model lacks is likelier a lag.
    """
    part = search.in_time.part(_ASKED)
    ask = partial(diagnose, search.before, candidates=candidates, rules=search.rules)
    found = part.of(partial(ask, time_limit_s=part.left_s), None)
    if found is None or part.over:
        search.in_time.reference = True
        return None
    if found.named is None:
        return None
    group = found.causes.of(found.named.id)
    # One of a group may be the wrong one: what it does not explain would be called a change.
    return found.named.effect if group is not None and len(group.effects) == 1 else None


def _later(before: Fit, driving: Driving, vehicle: Vehicle | None) -> Fit:
    """The reference as it is, on the later driving."""
    start = replace(
        before,
        model=before.model if vehicle is None else _of_vehicle(before.model, vehicle),
        driving=driving,
        estimates=(),
        covariance=np.zeros((0, 0)),
        pushed=np.zeros((0, 0)),
        profiles=(),
    )
    if len(driving.logs) > 1 and start.model.offset_names:
        return replace(start, driving=centred(start)[1])
    return start


def _of_vehicle(model: Model, vehicle: Vehicle) -> Model:
    """The same model of another vehicle file; its tyres stay."""
    stays = (n for n in model.names if n != YAW_INERTIA or n in model.values)
    values = {n: model.value(n) for n in stays}
    return replace(model, vehicle=vehicle, values=values)
