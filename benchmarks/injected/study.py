"""Is a fault of the steering or of the vehicle file named by the diagnosis of a measured drive?

    python benchmarks/injected/study.py DATA [SET ...] [--fetched FOLDER] [--validation]
        [--only WORD] [--json JSON]

The half minutes of `check.py`, sensors put right. The effects for which a diagnosis has most
evidence become part of the model, at most three, until nothing more is missing: what is wrong
before must not be told with the injection. Then each injection (`falsify.py`) is fitted and
diagnosed once. Named: the effect that undoes it is the one that may be called missing, or one of
its group; an effect that the model has already has moved by more than it can be wrong. Size: the
difference between fits with the effect, with and without the injection, lies in the 95 % interval.
Wrong name: something else may be called missing. Not testable: the verdict on the effect says so,
or its interval is wider than the injection.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "real_driving"))

from cars import NAMES, vehicle
from check import arguments, line, piece, summary
from falsify import DYNAMIC, Falsified, falsified

import sysid_vehicle as sv

_SIDES = 1.959964
_ROUNDS = 3
_STARTS = 4


def size(dx: sv.Diagnosis, parameter: str) -> tuple[float, float]:
    """Value and standard error of a parameter, with its effect in the model."""
    fit, effect = dx.fit, parameter.split(".")[0]
    if effect not in fit.model.effects:
        refit = next((c.fit for c in dx.ranking if c.id == effect and c.finished), None)
        fit = refit or sv.identify(fit.model.add(effect), fit.driving, starts=1)
    found = fit[parameter]
    own = fit.offsets.values()
    value = float(np.mean([of[parameter] for of in own])) if effect in fit.model.nuisances else None
    return found.value if value is None else value, found.std


def put_right(fit: sv.Fit, settled: Sequence[str]) -> sv.Diagnosis:
    """The diagnosis of the model with the effects for which there is most evidence."""
    dx = diagnosed(fit, settled)
    for _ in range(_ROUNDS):
        best = next((c for c in dx.significant if c.fit is not None), None)
        if best is None or best.fit is None or best.statistic <= 0.0:
            break
        dx = diagnosed(sv.identify(best.fit.model, fit.driving, starts=1), settled)
    return dx


def named(dx: sv.Diagnosis) -> set[str]:
    """What may be called missing, with what the driving cannot tell from it."""
    return set() if dx.named is None else {dx.named.id, *dx.named.indistinguishable_from}


def diagnosed(fit: sv.Fit, settled: Sequence[str]) -> sv.Diagnosis:
    lacked = [e.id for e in fit.model.candidates if e.id not in settled]
    return sv.diagnose(fit, candidates=lacked)


def judged(
    injection: Falsified, log: sv.Log, before: sv.Diagnosis, settled: Sequence[str]
) -> dict[str, object]:
    effect, model = injection.effect.split(".")[0], before.fit.model
    act, change = injection.act, injection.car
    log = log if act is None else falsified(log, act)
    model = model if change is None else changed(model, change(model.vehicle))
    dx = diagnosed(sv.identify(model, log, starts=1), settled)
    was, _ = size(before, injection.effect)
    now, std = size(dx, injection.effect)
    group, difference = named(dx), now - was
    if effect in model.effects:
        finding, found = "in the model", abs(difference) > _SIDES * std > 0.0
    else:
        finding, found = sv.verdicts(dx)[effect].finding, effect in group
    shown = _SIDES * std < abs(injection.size) and finding != "not testable"
    new = group - named(before)
    return {
        "difference": difference,
        "wanted": injection.size,
        "std": std,
        "testable": bool(found or shown),
        "named": bool(found),
        "inside": bool(abs(difference - injection.size) < _SIDES * std),
        "wrong": [] if effect in group else sorted(new),
        "finding": finding,
        "ranking": [(c.id, c.statistic, c.p_value, c.size) for c in dx.ranking[:4]],
        "reservation": dx.reservation,
    }


def changed(model: sv.Model, car: sv.Vehicle) -> sv.Model:
    """The model of another vehicle file, begun where the model stands."""
    return sv.Model(car, effects=model.effects, parts=model.parts, settings=model.settings,
                    values=model.values)  # fmt: skip


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--only", default="", metavar="WORD", help="injections with this word")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    rows: dict[str, dict[str, dict[str, object]]] = {}
    for name in args.sets or NAMES:
        began = time.perf_counter()
        log = piece(name, args.data, args.fetched, args.validation)
        check = sv.check(log, vehicle(name, args.data))
        log, settled = check.apply(log), check.settles
        first = sv.Model(vehicle(name, args.data)).with_nuisances()
        before = put_right(sv.identify(first, log, starts=_STARTS), settled)
        rows[name] = {}
        missing = [e for e in before.fit.model.effects if e not in first.effects]
        print(f"== {log.name}: {', '.join(missing) or 'nothing'} added", flush=True)
        for injection in (f for f in DYNAMIC if args.only in f.what):
            row = judged(injection, log, before, settled)
            rows[name][injection.what] = row
            print(line(injection, row), flush=True)
        print(f"  {time.perf_counter() - began:.0f} s", flush=True)
        if args.json is not None:
            args.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(summary(rows))


if __name__ == "__main__":
    main()
