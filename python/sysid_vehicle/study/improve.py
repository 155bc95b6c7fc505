"""The whole loop: fit, see where it fails, find what is missing, add it, see the error fall."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

from .._common.memo import forget
from .._common.progress import teller
from .._common.threads import before
from .._common.typed import typed
from ..diagnose import beside_what_they_refine, refining
from ..estimate import Driving
from ..identify import explaining
from ..identify.identify import maximised
from ..log import Log, several_logs
from ..model import Model
from ..rules import USUAL, Rules
from ..sensors import Kinematics, SensorCheck, made_ready
from .asked import asked
from .judge.judge import Judge
from .limit import Judging, Schedule
from .search.clock import in_time
from .search.search import Search
from .search.trail import Trail, kept
from .study import Study
from .validation import set_aside

# What a time limit may leave unknown, in words.
_CHANNELS = "whether all channels have the same clock, and white noise"
_BASELINE = "the likeliest parameters of the baseline"
_CLOCK = "the results with the delay of the wheel force corrected"

_SLOPES = ("road_bank", "road_grade")  # effects that level ground has not


@typed
@explaining
def improve(
    model: Model,
    train: Log | Sequence[Log],
    test: Log | Sequence[Log] | None = None,
    *,
    most_effects: int = 6,
    alpha: float | None = None,
    rules: Rules = USUAL,
    candidates: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    sensors: SensorCheck | Literal[False] | None = None,
    level: bool = False,
    time_limit_s: float | None = None,
    matters: Mapping[str, float | str] | None = None,
    starts: int = 8,
    seed: int = 0,
    workers: int | None = None,
    progress: bool | None = None,
    tell: Callable[[str], None] | None = None,
) -> Study:
    """Improve a model step by step until nothing more is missing that the driving can show.

    Each step scores all effects, refits the best few with their exact dynamics, and adds the best
    one that also predicts the validation data better. An effect that is no longer significant is
    dropped again.

    Parameters
    ----------
    model : Model
        The baseline.
    train, test : Log or sequence of Log
        What to fit to, and validation data. Without `test` the last log, or
        the last 30 % of the only one, are validation data.
    most_effects : int
        Stop after so many, beside those of the model, or where the training data are too short for
        more (`Rules.lasts`).
    alpha : float
        Rate of false claims accepted, over all effects together, per step; by default that of the
        rules.
    rules : Rules
        Limits that decide what is claimed.
    candidates : sequence of str, optional
        Effects to consider; by default all that the model lacks.
    exclude : sequence of str, optional
        Effects not to consider.
    sensors : SensorCheck or False, optional
        Check of the sensors: all logs are put right by it, what kinematics settled is not
        considered, and no effect is larger than kinematics leaves it. Without one only what the
        likelihood cannot hold is taken out: delays of one channel against another, low-passes of
        sensors, vibration, and another clock of the wheel force; with False not even that.
    level : bool
        Whether the ground is level, as a test track: slopes of the road are not considered, and
        the readings are taken as `check` takes them there.
    time_limit_s : float, optional
        After so many seconds the study ends, wherever it is, but for some passes over the data:
        about as long as `compare` and one scoring of all effects take. The check of the sensors,
        the baseline, the search and the judging have a share each, and what one leaves goes to the
        next. Sensors that were not checked in time stay as they are; the baseline is the likeliest
        that was seen; of what was refitted the best is added if validation data confirm it; what
        was not asked for in judging counts against the names (`AddedEffect`). Warnings tell what
        was left out.
    matters : mapping, optional
        Errors that matter, such as ``{"yaw_rate": "0.5deg/s"}`` (`sizes_that_matter`); those not
        given have usual sizes. A baseline whose errors 0.5 to 5 s ahead on validation data are all
        smaller, as the likelihood fits it or as predictions do, is adequate where no name stands,
        whatever is left. By default the noise of the sensors counts, at most the usual sizes, in
        the mean square, and slow forces count whatever their size.
    starts : int
        Starts of the search for the baseline, as in `identify`.
    seed : int
        Of these starts, and of what p-values are drawn by.
    workers : int, optional
        Threads; by default as many as there are cores. The result is the same for any number.
    progress : bool, optional
        Show progress; by default in a terminal or a notebook.
    tell : callable, optional
        Called with a sentence about each step, in place of printing it to the error stream.

    Returns
    -------
    Study

    Raises
    ------
    InvalidInput
        An argument cannot be used; one that does not depend on the logs is refused before any work.
    Interrupted
        After Ctrl-C, with the models so far; a `KeyboardInterrupt`.
    """
    began = time.perf_counter()
    wants = asked(
        model,
        most_effects=most_effects,
        alpha=alpha,
        rules=rules,
        candidates=candidates,
        exclude=exclude,
        time_limit_s=time_limit_s,
        matters=matters,
        starts=starts,
        seed=seed,
    )
    rules = wants.rules
    schedule = Schedule.of(began, wants.limit_s)
    judging = Judging(schedule.judging)
    forget()  # what is remembered of earlier studies: that of many would fill the memory
    train, test, kinematics, checked = _ready(
        train, test, sensors, level=level, ends=schedule.sensors
    )
    if not checked:
        judging.left_out.append(_CHANNELS)
    left_out = {*wants.excluded, *kinematics.settles, *(_SLOPES if level else ())}
    wanted = tuple(e for e in wants.wanted if e.id not in left_out)
    others = {*left_out, *(e.id for e in wanted)}
    finer = tuple(e for e in refining() if e.id not in others) if candidates is None else ()
    if sensors:
        wanted, finer = (sensors.narrowed(some, rules) for some in (wanted, finer))
    say = tell if tell is not None else teller(progress)
    train_driving, test_driving = set_aside(train, test)

    def searched(schedule: Schedule) -> Trail:
        baseline = maximised(
            model,
            train_driving,
            starts=starts,
            seed=seed,
            progress=progress,
            ends=schedule.baseline,
        )
        room = _room(train_driving, rules)
        found = Trail([baseline], short=room <= wants.most_effects)
        with kept(found):
            say(f"Fitted the baseline to {train_driving}.")
            search = Search(
                test_driving,
                candidates=wanted,
                finer=finer,
                most_effects=len(model.effects) + min(wants.most_effects, room),
                ends=schedule.search,
                judged_by=schedule.step,
                rules=rules,
                seed=seed,
                progress=progress,
                say=say,
            )
            search.follow(found)
            found.without_harm(test_driving, rules)
            search.take_out_harmful(found)
            search.give_back(found)
        return found

    begun = time.perf_counter()
    found = searched(schedule)
    with kept(found):
        clocked = None
        if sensors is not False:
            last = found.diagnoses[-1]
            clocked = before(schedule.search, lambda: in_time(last, test_driving), None)
    again = schedule.again(time.perf_counter() - begun)
    if clocked is not None and again is not None:
        train_driving, test_driving = clocked
        say("The wheel force has a delay of its own: it is corrected, and the study starts again.")
        found = searched(again)
    elif clocked is not None:
        judging.left_out.append(_CLOCK)
    if not found.fits[0].converged and time.perf_counter() > schedule.baseline:
        judging.left_out.append(_BASELINE)
    judge = Judge(
        found,
        test_driving,
        asks=judging,
        rules=rules,
        lacked=[e.id for e in (*wanted, *beside_what_they_refine(finer, found.fit.model))],
        sizes=wants.sizes,
        seed=seed,
        kinematics=kinematics,
    )
    with kept(found):
        return judge.study(began, checked=bool(sensors))


def _room(driving: Driving, rules: Rules) -> int:
    """How many effects the driving is long enough for, one at least."""
    return max(int(driving.usable_s / rules.lasts), 1)


def _ready(
    train: Log | Sequence[Log],
    test: Log | Sequence[Log] | None,
    sensors: SensorCheck | Literal[False] | None,
    *,
    level: bool,
    ends: float,
) -> tuple[Sequence[Log], Log | Sequence[Log] | None, Kinematics, bool]:
    """The logs with what their sensors do wrong taken out, and what is known of the sensors.

    Last comes whether there was time for it until `ends`.
    """
    logs, others = several_logs(train), () if test is None else several_logs(test)
    if sensors is False:
        return logs, test, Kinematics(), True
    if sensors is not None:
        own, rest = ([sensors.apply(log) for log in some] for some in (logs, others))
        return own, None if test is None else rest, Kinematics(sensors.settles), True
    ready = before(ends, lambda: made_ready(logs, others, level=level), None)
    if ready is None:
        return logs, test, Kinematics(), False
    own, rest, kinematics = ready
    return own, None if test is None else rest, kinematics, True
