"""What a study leaves unexplained, in words that agree with its verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..._common.text import few, number, unit_after
from ...estimate import UNITS
from ...estimate.driving import WORDS
from ...rules import LACKING, NONE_GONE, share_of
from ..ahead.horizons import LATERAL
from ..judge.matters import sizes_that_matter, sufficient
from ..validation import AHEAD_S
from .as_fitted import as_fitted
from .widened import times_wider

if TYPE_CHECKING:
    from ...effects import Parameter
    from ...identify import Estimate, Fit
    from ..study import Study


def left_out(study: Study) -> tuple[str, ...]:
    """What `Study.in_time` had no time for, in one sentence; none where it had."""
    some = "; ".join(study.left_out.values())
    return (f"no time was left to find out {some}",) if some else ()


def ahead(study: Study) -> str:
    """Lateral errors some seconds ahead on validation data; empty where that is too short."""
    errors = study.horizons
    i = errors.horizons_s.index(AHEAD_S)
    told = []
    for j, c in enumerate(errors.channels):
        first, last = (float(errors.error[k, i, j]) for k in (0, -1))
        if c in LATERAL and not np.isnan(last):
            both = (first, last) if len(study.fits) > 1 else (last,)
            figures = " -> ".join(number(x, 2) if np.isfinite(x) else "lost" for x in both)
            told.append(f"{WORDS[c]} {figures} {UNITS[c]}")
    if not told:
        return ""
    where = "where the car turns, on validation data"
    if study.fit.noise.sloping:
        # One model alone knows no crossfall to come: what it errs sideways looks like one.
        where += f", the {'slope' if len(study.fits) > 1 else 'grade'} of the road known"
    return f"Median error {AHEAD_S:g} s ahead {where}: {', '.join(told)}."


def events(study: Study) -> list[str]:
    """Moments that hold most of the final model's error, of training and of validation data."""
    told = ((study.train[-1], "training data"), (study.test[-1], "validation data"))
    return [c.event.of(data) for c, data in told if c.event is not None]


def sufficient_baseline(study: Study) -> Fit | None:
    """The baseline whose errors 0.5 to 5 s ahead are within the usual sizes, if it is unknown why.

    As it was fitted, or with its parameters fitted to predictions; None where neither is.
    """
    if study.verdict != "unknown":
        return None
    return sufficient(study.fits[0], study.validation, sizes_that_matter({}))


def nuisances(study: Study) -> list[str]:
    """Those that are clearly there and of a size that matters, in words; none is a finding.

    Of several logs each has its own, whose mean may be nothing.
    """
    model, found = study.fit.model, []
    known = {e.name: e for e in study.estimates}
    by_log = study.fit.offsets if study.fit.driving.offsets else {}
    for part in model.parts:
        if part.id not in model.nuisances:
            continue
        own = [(p, known[f"{part.id}.{p.name}"]) for p in part.parameters]
        logs = {log: of for log, of in by_log.items() if own[0][1].name in of}
        off = [
            (abs(value - p.null_value), e.std * len(logs or [1]) ** 0.5, p.matters)
            for p, e in own
            for value in ([of[e.name] for of in logs.values()] or [e.value])
        ]
        sure = study.rules.interval_of(len(logs or [1]))
        if any(by >= matters and by > sure * std for by, std, matters in off):
            sizes = ", ".join(_sizes(p, e, logs) for p, e in own)
            found.append(f"Nuisance {part.id} ({part.title}): {sizes}")
    return found


def _sizes(p: Parameter, e: Estimate, logs: Mapping[str, Mapping[str, float]]) -> str:
    unit = unit_after(p.unit)
    if not logs:
        return f"{p.name} {e.size}{unit}"
    each = few([f"{number(of[e.name], 3)} in {log}" for log, of in logs.items()])
    return f"{p.name}{unit and f' [{p.unit}]'} {each}"


def disturbance(study: Study) -> bool:
    """Whether lesser evidence that something is left counts for nothing (`rules.something_left`).

    No function of the driving predicts what is left.
    """
    found = study.structure
    strict, candidates = study.rules.strict, study.diagnoses[-1].ranking
    return (
        found is not None
        and found.anywhere <= study.rules.explainable
        and study.omnibus.p_value > strict
        and not elsewhere(study)
        and not slow(study)
        and all(c.p_value > strict for c in candidates)
    )


def in_the_end(study: Study) -> str:
    """What is explained, what is left, how sure parameters are, what a fit to predictions gains.

    Parameters
    ----------
    study : Study
    """
    ahead = "" if study.verdict == "not_testable" else str(study.predicting or "")
    return " ".join(text for text in (_left(study), intervals(study), ahead) if text)


def intervals(study: Study) -> str:
    """What intervals count where something is missing, in words; empty where nothing is."""
    if study.verdict not in LACKING or not study.fit.estimates:
        return ""
    if study.widened is None:
        return (
            "Intervals of parameters are those of a complete model; as something is missing, they "
            "are too short."
        )
    wider = times_wider(study.estimates, study.fit)
    return (
        "Intervals of parameters include what is missing, as unknown forces of the size that is "
        f"seen: in the median they are {number(wider, 2)} times as wide. They do not include what "
        "parameters can reproduce, such as a factor on the steering angle, a mass or an "
        "accelerometer."
    )


def _left(study: Study) -> str:
    left = on_train(study)
    if study.structure is not None and structured(study):
        left += f" A function of the driving still predicts {study.structure.strongest}."
    said = " ".join([*_explained(study), f"Final model: {left}", *_on_all(study)])
    if study.train[-1].unrelated:
        wrong = "; ".join(study.train[-1].unrelated.values())
        return f"{said} Something else is wrong: {wrong}."
    seen = study.omnibus.rejects and not disturbance(study)
    told = seen or structured(study) or elsewhere(study) or slow(study)
    if study.verdict not in LACKING or told:
        return said
    # Nothing is left, yet something is missing: what took it up is not what is missing.
    stand_ins = [a.id for a in study.added if a.stands_in]
    if stand_ins:
        said += f" Other effects have absorbed what is missing: {', '.join(stand_ins)}."
    elif study.diagnoses[-1].significant:
        some = [c.id for c in study.diagnoses[-1].significant[:3]]
        they = "it does" if len(some) == 1 else "they do"
        said += (
            f" There is evidence for {', '.join(some)}; {they} not improve the prediction of "
            "validation data."
        )
    return said


def _explained(study: Study) -> list[str]:
    """The share of the errors ahead, and of what any function of the driving could explain."""
    if study.explained is None:
        return []
    if not study.explained.share > 0.0:
        return [f"{NONE_GONE.capitalize()}: the effects added do not reduce it{_within(study)}."]
    said = [
        f"The effects added remove {study.explained} of the error 1 to 5 s ahead{_within(study)}."
    ]
    said += as_fitted(study)
    whole = study.shares.whole
    if whole.low > 0.0:
        # The share is that of all effects added: of the names only where all of these stand.
        named = study.verdict in ("explained", "partly_explained") and not any(
            a.stands_in for a in study.added
        )
        who = "The effects named explain" if named else "The effects added explain"
        said.append(f"{who} {whole} of what any function of the driving could explain of it.")
    return said


def extrapolates(study: Study) -> bool:
    """Whether shares leave out driving at slip angles beyond those that were fitted."""
    return study.explained is not None and study.explained.within < 1.0


def _within(study: Study) -> str:
    if study.explained is None or not extrapolates(study):
        return ""
    return (
        f" where slip angles are no larger than fitted, {100 * study.explained.within:.0f} % of "
        "the validation data"
    )


def structured(study: Study) -> bool:
    """Whether a function of the driving is shown to predict a part of what is left.

    Beside other evidence that something is left: alone it may be a driver who steers against
    disturbances (`rules.something_left`).
    """
    found, level = study.structure, study.rules.level
    left = study.omnibus.rejects or any(c.p_value < level for c in study.diagnoses[-1].ranking)
    return (
        found is not None and found.everywhere > study.rules.explainable and (left or _more(study))
    )


def on_train(study: Study) -> str:
    """What the training data say of what the final model leaves."""
    test = study.omnibus
    if test.rejects and disturbance(study):
        return (
            f"the test for a remaining error gives p = {test.p_value:.2g}, but no function of the "
            "driving predicts that error: it is disturbance."
        )
    if not test.rejects and structured(study):
        return f"the test for unknown forces is not significant (p = {test.p_value:.2g})."
    if only_elsewhere(study):
        none = "no error that depends on the driving"
        return f"the training data alone show {none} (p = {test.p_value:.2g})."
    return f"{test}."


def _on_all(study: Study) -> list[str]:
    beyond, said = study.omnibus_together, []
    # A baseline alone is told of what it leaves once.
    told = beyond is not None and (beyond.rejects or (study.added and not structured(study)))
    if beyond is not None and told:
        found = str(beyond)
        if not _more(study):
            found = f"no more than a disturbance can cause (p = {beyond.p_value:.2g})"
        said.append(f"On all data together: {found if beyond.rejects else beyond}.")
    none = not (elsewhere(study) or study.omnibus.rejects)
    if none and study.verdict not in ("adequate", "not_testable") and undetermined(study):
        said.append(f"{undetermined(study).capitalize()}.")
    if _unforeseen(study):
        said.append(f"{str(study.foretold).capitalize()}.")
    if slow(study):
        some = " and a ".join(study.slow)
        said.append(f"Too slow for a disturbance, so it has a cause: a {some}.")
    return said


def undetermined(study: Study) -> str:
    """Say that validation data err by parameters that training data leave open; else empty.

    What tests them asks whether any parameters serve both.
    """
    error, most = study.test[-1].error, study.rules.explainable
    if study.foretold is None or not share_beyond_noise(error) > most:
        return ""
    serving = study.foretold.error
    if not math.isfinite(serving):
        return ""
    if share_beyond_noise(serving) > most and not share_of(error**2, serving**2) > most:
        return ""
    what = "the parameters" if study.added else "the tyres"
    return (
        f"the validation error is {error:.3g} noise floors, and {serving:.3g} with parameters that "
        f"serve validation data too: the training data do not determine {what} where these drive"
    )


def elsewhere(study: Study) -> bool:
    """Whether more is left on all data than the training data show or foretell."""
    return _more(study) or _unforeseen(study)


def only_elsewhere(study: Study) -> bool:
    """Whether what is left shows with validation data alone."""
    return elsewhere(study) and not study.omnibus.rejects


def slow(study: Study) -> bool:
    """Whether a baseline takes slow forces for disturbances."""
    return bool(study.slow) and not study.added


def _unforeseen(study: Study) -> bool:
    return not study.added and study.foretold is not None and study.foretold.unforeseen


def in_training(study: Study) -> str:
    """What training data show of that which shows with validation data alone, in words.

    Where most of their error is disturbance, what is missing may be a part of it.
    """
    error = study.train[-1].error
    if share_beyond_noise(error) > study.rules.most:
        floors = f"{number(error, 2)} noise floors"
        return f"cannot be separated from disturbance in the training data (error {floors})"
    return "hardly shows in the training data"


def share_beyond_noise(error: float) -> float:
    """Share of the square of an error one step ahead that is no noise of the sensors."""
    return share_of(error**2, 1.0)


def _more(study: Study) -> bool:
    """Whether more is left on all data together than a disturbance may leave."""
    beyond = study.omnibus_together
    return beyond is not None and beyond.p_value < study.rules.strict
