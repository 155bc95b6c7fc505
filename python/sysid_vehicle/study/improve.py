"""The whole loop: fit, see where it fails, find what is missing, add it, see the error fall."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal
from warnings import catch_warnings, simplefilter

from .._common.arguments import duration, whole
from .._common.progress import teller
from .._common.threads import before, in_parallel
from ..compare import compare
from ..diagnose import Instead, considered, instead, judge, omnibus
from ..effects import effect
from ..errors import SysidWarning, warn
from ..estimate import Driving
from ..identify import Fit, driving_of, explaining
from ..identify.identify import maximised
from ..log import Log, check_excitation, several_logs
from ..model import Model
from ..rules import USUAL, Rules, incomplete, verdict
from ..sensors import SensorCheck, made_ready, put_right
from .added import added_by
from .clock import in_time
from .foretold import foretold
from .limit import Judging, Schedule
from .matters import sizes_that_matter, sufficient
from .own import own_shares, shown_together
from .search import Search, Trail, kept
from .slow import slow_forces
from .steps import way
from .structure import structure
from .study import Study
from .validation import beyond_noise_ahead, serving, set_aside
from .verdict import facts_of, in_the_light_of

_SHORT_S = 20.0  # of usable driving: every manoeuvre of the library takes longer

# What a time limit may leave unknown, in words.
_CHANNELS = "whether the channels were read at the same moments, with noise that is white"
_BASELINE = "the likeliest parameters of the baseline"
_CLOCK = "what follows with the wheel force at the time at which the car feels it"
_RIVALS = "whether something unknown would do in the place of what was added"
_UNSHOWN = "whether training and validation data together show anything that is left"
_FORETOLD = "whether validation data err by more than training data foretell"
_TOGETHER = "the share of the error 1 to 5 s ahead that the effects take together"
_ALONE = "the share of the error 1 to 5 s ahead that is due to {} alone"
_STRUCTURE = "how much of what is left depends on the driving"
_SMALL = "whether the errors of the baseline are as large as matters"


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
        Check of the sensors: all logs are put right by it, and what kinematics settled is not
        considered. Without one only what the likelihood cannot hold is taken out: delays of one
        channel against another, low-passes of sensors, vibration, and another clock of the wheel
        force; with False not even that.
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
        whatever is left. By default whatever is shown to be left counts.
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
    Interrupted
        After Ctrl-C, with the models so far; a `KeyboardInterrupt`.
    """
    most_effects = whole(most_effects, "most_effects")
    rules = rules.at(alpha)
    began = time.perf_counter()
    schedule = Schedule.of(began, duration(time_limit_s, "time_limit_s"))
    judging = Judging(schedule.judging)
    sizes = None if matters is None else sizes_that_matter(matters)
    train, test, settled, checked = _ready(train, test, sensors, schedule.sensors)
    if not checked:
        judging.left_out.append(_CHANNELS)
    exclude = (*exclude, *settled)
    if exclude:
        left_out = {effect(e).id for e in exclude}
        candidates = [e.id for e in considered(model, candidates) if e.id not in left_out]
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
        found = Trail([baseline])
        with kept(found):
            say(f"Fitted the baseline to {train_driving}.")
            search = Search(
                test_driving,
                candidates=candidates,
                most_effects=len(model.effects) + min(most_effects, _room(train_driving, rules)),
                ends=schedule.search,
                judged_by=schedule.step,
                rules=rules,
                seed=seed,
                progress=progress,
                say=say,
            )
            search.follow(found)
            found.without_harm(test_driving, rules)
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
        say("The wheel force has a clock of its own: with it put right everything is done again.")
        found = searched(again)
    elif clocked is not None:
        judging.left_out.append(_CLOCK)
    if not found.fits[0].converged and time.perf_counter() > schedule.baseline:
        judging.left_out.append(_BASELINE)
    with kept(found):
        fit, diagnoses = found.fit, found.diagnoses
        fits = way(found.fits, schedule.judging)
        floor = fit.noise
        on_train = in_parallel(lambda f: compare(f, f.driving, noise=floor), fits)
        on_test = in_parallel(lambda f: compare(f, test_driving, noise=floor), fits)
        last = diagnoses[-1]
        fitted = last.omnibus if last.fit is fit else omnibus(fit, fit.driving, rules)
        explained = None
        beside = _RIVALS if len(fits) > 1 else _UNSHOWN
        rivals = judging.asked(beside, lambda: _rivals(fit, fits, test_driving, rules))
        expected = judging.asked(_FORETOLD, lambda: foretold(fit, test_driving, rules))
        slow = slow_forces(fit, rules)
        if len(fits) > 1:
            explained = judging.asked(_TOGETHER, lambda: beyond_noise_ahead(fits, test_driving))
        told = judge(
            fit,
            scored=(last.scores, last.family) if last.fit is fit else None,
            lacked={e.id for e in considered(model, candidates)},
            groups={e: g for e, g in found.rivals.items() if e in fit.model.effects},
            acted={c.id for dx in diagnoses for c in dx.significant},
            rules=rules,
            seed=seed,
            refitted=found.sizes,
            settled=True,
            untried=found.stopped,
            away={} if rivals is None else rivals.away,
        )
        pattern = judging.asked(_STRUCTURE, lambda: structure(fit, test_driving))
        small = sizes is not None and judging.asked(
            _SMALL, lambda: sufficient(fits[0], test_driving, sizes) is not None
        )
        facts = facts_of(
            fits,
            told,
            on_train[-1],
            explained,
            fitted=fitted,
            together=None if rivals is None else rivals.omnibus,
            candidate=min((c.p_value for c in last.ranking), default=1.0),
            excited=_excited(train_driving),
            structure=(1.0, 0.0) if pattern is None else (pattern.anywhere, pattern.everywhere),
            small=bool(small),
            unopposed=len(fits) > 1 and rivals is None,
            unforeseen=expected is not None and expected.unforeseen,
            slow=slow,
        )
        if len(fits) > 1 and incomplete(facts, rules):
            named = {a.id for a in facts.added if a.named}
            shares = own_shares(fit, _new(fits), named, test_driving, schedule.judging)
            unknown = [e for e in _new(fits) if e not in shares]
            facts = facts.with_own(shares, unknown)
            judging.note(unknown, _ALONE)
            if explained is not None:
                low = judging.asked(
                    _TOGETHER, lambda: shown_together(explained, fits, test_driving)
                )
                facts = replace(facts, taken_low=0.0 if low is None else low)
        decision = verdict(facts, rules)
        alone, told = told, in_the_light_of(decision, told)
        late = tuple(judging.left_out)
        return Study(
            verdict=decision.verdict,
            fits=tuple(fits),
            diagnoses=tuple(diagnoses),
            train=tuple(on_train),
            test=tuple(on_test),
            validation=test_driving,
            added=added_by(found, fits, on_test, told, alone, decision),
            omnibus=fitted,
            omnibus_together=None if rivals is None else rivals.omnibus,
            verdicts=told,
            warnings=_warnings(fit, train_driving, found, late),
            seconds=time.perf_counter() - began,
            rules=rules,
            explained=explained,
            structure=pattern,
            foretold=expected,
            slow=slow,
            stopped=found.stopped,
            late_facts=late,
            checked=bool(sensors),
        )


def _together(train: Driving, test: Driving) -> Driving:
    """All driving; the training data where one of the two lacks the wheel force."""
    same = train.force_known == test.force_known
    return Driving.joined((train, test)) if same else train


def _new(fits: Sequence[Fit]) -> tuple[str, ...]:
    """Effects that the last model has and the baseline lacks."""
    return tuple(e for e in fits[-1].model.effects if e not in fits[0].model.effects)


def _room(driving: Driving, rules: Rules) -> int:
    """How many effects the driving is long enough for, one at least."""
    return max(int(driving.usable_s / rules.lasts), 1)


def _excited(driving: Driving) -> bool:
    with catch_warnings():
        simplefilter("ignore", SysidWarning)  # reading the logs has warned of it
        return check_excitation(driving.logs)


def _rivals(fit: Fit, fits: Sequence[Fit], test: Driving, rules: Rules) -> Instead:
    both = serving(fit, test)
    return instead(both, _together(fit.driving, driving_of(both, test)), _new(fits), rules)


def _ready(
    train: Log | Sequence[Log],
    test: Log | Sequence[Log] | None,
    sensors: SensorCheck | Literal[False] | None,
    ends: float,
) -> tuple[Sequence[Log], Log | Sequence[Log] | None, tuple[str, ...], bool]:
    """The logs with what their sensors do wrong taken out, and the effects that this settles.

    Last comes whether there was time for it until `ends`.
    """
    logs, others = several_logs(train), () if test is None else several_logs(test)
    if sensors is False:
        return logs, test, (), True
    if sensors is not None:
        put = [sensors.apply(log) for log in logs], put_right(sensors, test)
        return *put, sensors.settles, True
    ready = before(ends, lambda: made_ready(logs, others), None)
    if ready is None:
        return logs, test, (), False
    own, rest, delayed = ready
    return own, None if test is None else rest, ("sensor_delay",) if delayed else (), True


def _warnings(fit: Fit, driving: Driving, trail: Trail, late: tuple[str, ...]) -> tuple[str, ...]:
    found = []
    if trail.stopped:
        found.append(
            f"the time limit ended the search with {', '.join(trail.stopped)} still to be tried"
        )
        warn(found[-1])
    for fact in late:
        unsure = "without it neither the verdict nor a name is sure"
        found.append(f"the time limit left unknown {fact}; {unsure}")
        warn(found[-1])
    if trail.taken_back:
        found.append(
            f"{' and '.join(trail.taken_back)} gained with parameters that predict best; as the "
            "likelihood fits the model, errors 1 to 5 s ahead grow with it: taken back"
        )
    if driving.usable_s < _SHORT_S:
        found.append(
            f"{driving}: too short to tell many effects apart; record {_SHORT_S:.0f} s or more, "
            "with steps, sweeps and corners near the limit"
        )
        warn(found[-1])
    for log in driving.logs:
        found += [f"{log.name}: {text}" for text in log.missing().values()]
    found += [f"{e.name}: {e.note} with this driving" for e in fit.estimates if e.note]
    if not fit.converged:
        found.append("the final fit did not converge; its intervals may be too short")
        warn(found[-1])
    return tuple(dict.fromkeys(found))
