"""How much faster is it to score all effects at once than to refit the model with each of them?

    python benchmarks/finding_effects/scoring_speed.py [EFFECT ...] [--repeats N]

60 s of driving at 100 Hz, one core, processor time. Both begin from the same fitted baseline; a
refit has the effect's exact dynamics, begins at what the score predicts and keeps the noise.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from recovery import OTHER_TYRES, SENSORS

import sysid_vehicle as sv
from sysid_vehicle.diagnose.candidates.score import score_board
from sysid_vehicle.identify import refit


def seconds(work: Callable[[], Any]) -> float:
    """Processor time of one call."""
    began = time.process_time()
    work()
    return time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("effects", nargs="*", metavar="EFFECT", help="to refit; all if left out")
    parser.add_argument("--repeats", type=int, default=5, help="of the scoring")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    truth = sv.Model(sv.example_vehicle()).add("yaw_inertia")
    truth = truth.with_values({"yaw_inertia.relative_error": 0.1})
    log = sv.drive(truth, sv.manoeuvres.lap(60.0), seed=1, noise=SENSORS)
    model = sv.Model(truth.vehicle.replace(**OTHER_TYRES))
    fit = sv.identify(model, log, starts=1, workers=1)
    driving, candidates = fit.driving, fit.model.candidates
    board = score_board(fit, driving, candidates)
    scored = {s.effect.id: s for s in board.scores}

    def score_all() -> None:
        score_board(fit, driving, candidates).family_p_values()

    scoring = float(np.median([seconds(score_all) for _ in range(args.repeats)]))
    print(
        f"scoring {len(candidates)} effects on {driving.samples} samples: {scoring:.3f} s, "
        f"{driving.samples * len(candidates) / scoring:.3g} samples x effects per second, "
        f"{driving.samples / scoring:.3g} samples per second"
    )
    each: dict[str, float] = {}
    for effect in candidates:
        if effect.id not in (args.effects or scored):
            continue
        values = {
            f"{effect.id}.{p.name}": float(np.clip(v, p.lower, p.upper))
            for p, v in zip(effect.parameters, scored[effect.id].value, strict=True)
        }
        richer = fit.model.add(effect).with_values(values)

        def one(richer: sv.Model = richer) -> None:
            # The time of one that fails counts all the same.
            with suppress(sv.NumericalError, np.linalg.LinAlgError):
                refit(richer, driving, fit.noise)

        each[effect.id] = seconds(one)
        print(f"  {effect.id:<26} {each[effect.id]:7.2f} s", flush=True)
    whole = sum(each.values()) * len(candidates) / len(each)
    middle = float(np.median(list(each.values()))) * len(candidates)
    print(
        f"refitting {len(each)} of them: {sum(each.values()):.1f} s; scoring all is "
        f"{whole / scoring:.0f} times as fast as refitting all "
        f"({middle / scoring:.0f} times were each as quick as the median)"
    )


if __name__ == "__main__":
    main()
