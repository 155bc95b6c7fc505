"""What a study says of the same car as its road and sensors become more real.

    python benchmarks/ladder [--seeds 2] [--first 3000] [--truth relaxation] [--pairs] [RUNG ...]
    python benchmarks/ladder --low-pass [--seeds 2] [--first 3000] [RUNG ...]
    python benchmarks/ladder --right-model [--seeds 2] [--first 3000] [--truth sensitivity]

Laps are fitted, handling courses judge. One imperfection at a time, or each pair (`--pairs`):
forces of the road over 0.3 s (`pushes`) and over 0.03 s (`bumps`), a road that leans by 1.5 deg rms
over 5 s (`road`), a causal low-pass of 15 Hz in every sensor (`filtered`), speeds 20 ms and
everything else 10 ms late (`late`), quanta of a bus with every value held for two samples
(`coarse`), vibration at 12 Hz, and all of them. Printed for each drive: what was claimed with its
interval, whether that is the truth (`right`: it alone, inside its 95 % interval, beside what the
rung itself brings about: the wheel force is on time where all else is late; `group`: another effect
of which the study says that this driving cannot tell it from the truth, inside its 95 % interval
too), the verdict, and the median errors of v_y and yaw rate 2 and 5 s ahead on validation data,
before and after.
`--low-pass` asks, in seconds, only for the delay of the sensors' low-pass that their noise tells,
beside the true one. `--right-model` asks only how errors of what is hidden compare with their
standard errors, where the right model is fitted to the laps as they are.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Mapping

import numpy as np
from rungs import PAIRS, RUNGS, TRUTHS, low_pass_s, present, ride

import sysid_vehicle as sv
from sysid_vehicle.identify import Estimate, refit
from sysid_vehicle.sensors import Conditioning

_NEAR = 0.2  # of the size of what the rung brings about: a lag is not quite a delay
_HEAD = (
    "rung               seed  right   claimed; verdict; error of v_y, yaw rate ahead, m/s, rad/s"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "rungs", nargs="*", metavar="RUNG", help=f"of {', '.join(RUNGS)}; several as late+coarse"
    )
    parser.add_argument("--pairs", action="store_true", help="each pair of rungs")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=3000)
    parser.add_argument("--truth", choices=list(TRUTHS), default="relaxation")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each drive")
    parser.add_argument("--raw", action="store_true", help="take the logs as they are")
    parser.add_argument("--low-pass", action="store_true", help="ask for the sensors' delay only")
    parser.add_argument("--right-model", action="store_true", help="ask for intervals only")
    args = parser.parse_args()
    if args.low_pass or args.right_model:
        (_low_passes if args.low_pass else _intervals)(args)
        return
    print(_HEAD)
    outcomes = []
    for rung in _rungs(args):
        for seed in range(args.first, args.first + args.seeds):
            outcome, line = _trial(rung, seed, args)
            outcomes.append(outcome)
            print(line, flush=True)
    print(
        f"right in {outcomes.count('yes')} of {len(outcomes)}, in the group in "
        f"{outcomes.count('group')}"
    )


def _rungs(args: argparse.Namespace) -> tuple[str, ...]:
    return (*args.rungs, *(PAIRS if args.pairs else ())) or RUNGS


def _drives(rung: str, seed: int, args: argparse.Namespace) -> list[sv.Log]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        return [
            ride(rung, args.truth, manoeuvre, seed).between(0.0, args.seconds)
            for manoeuvre in ("lap", "handling_course")
        ]


def _low_passes(args: argparse.Namespace) -> None:
    print("rung                 told  largest error of the delay [ms]  inside its 95 % interval")
    for rung in _rungs(args):
        off, inside = [], 0
        for seed in range(args.first, args.first + args.seeds):
            told = Conditioning.of(_drives(rung, seed, args)).low_passes
            true_s = low_pass_s(rung)
            errors = [(response.delay_s - true_s, std_s) for response, std_s in told.values()]
            if errors:
                off.append(max(abs(error) for error, _ in errors))
                inside += all(abs(error) < 1.96 * std_s for error, std_s in errors)
        largest = f"{1000.0 * max(off):.2f}" if off else ""
        print(f"{rung:18s}  {len(off):2d} of {args.seeds:2d}  {largest:>8s}  {inside}", flush=True)


def _intervals(args: argparse.Namespace) -> None:
    print(
        "rung                noise held: inside 95 %, errors in standard errors; counted: the same"
    )
    effect, values = TRUTHS[args.truth]
    if not values:
        raise SystemExit("--right-model: nothing is hidden, and nothing has an interval")
    model = sv.Model(sv.example_vehicle()).add(effect)
    for rung in _rungs(args):
        off: list[list[float]] = [[], []]
        for seed in range(args.first, args.first + args.seeds):
            log = ride(rung, args.truth, "lap", seed).between(0.0, args.seconds)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sv.SysidWarning)
                fit = sv.identify(model, log, starts=2)
                held = refit(fit.model, fit.driving, fit.noise)
            for z, of in zip(off, (held, fit), strict=True):
                z += [(fit[name].value - true) / of[name].std for name, true in values.items()]
        told = []
        for z in map(np.array, off):
            inside = np.count_nonzero(np.abs(z) < 1.96)
            told.append(f"{inside:3d} of {z.size:3d}  {np.sqrt(np.mean(z**2)):.2f}")
        print(f"{rung:18s} {'; '.join(told)}", flush=True)


def _trial(rung: str, seed: int, args: argparse.Namespace) -> tuple[str, str]:
    train, test = _drives(rung, seed, args)
    began = time.process_time()
    head = f"{rung:18s} {seed:4d}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        try:
            study = sv.improve(
                sv.Model(sv.example_vehicle()),
                train,
                test,
                starts=3,
                sensors=False if args.raw else None,
            )
        except sv.SysidError as error:
            return "no", f"{head}  no     {type(error).__name__}: {error}"
        ahead = study.horizons
    effect, values = TRUTHS[args.truth]
    found = [a.id for a in study.added]
    brought = {
        name.split(".")[0]
        for name, size in present(rung).items()
        if name in study.fit.model.free_names and _is(study.fit[name], size)
    }
    outcome = _outcome(study, [e for e in found if e not in brought], effect, values)
    said = ", ".join(
        str(study.fit[n]) for n in study.fit.model.free_names if n.split(".")[0] in found
    )
    rivals = {r for a in study.added for r in a.confounded_with}
    said += f" or {', '.join(sorted(rivals))}" if rivals else ""
    errors = "; ".join(
        f"{h:g} s: "
        + ", ".join(
            f"{ahead.error[0, ahead.horizons_s.index(h), ahead.channels.index(c)]:.3g} -> "
            f"{ahead.error[-1, ahead.horizons_s.index(h), ahead.channels.index(c)]:.3g}"
            for c in ("vy_mps", "yaw_rate_radps")
        )
        for h in (2.0, 5.0)
    )
    took = time.process_time() - began
    return outcome, (
        f"{head}  {outcome:5s}  {said or 'nothing'}; {study.verdict}; {errors}; {took:.0f} s"
    )


def _outcome(study: sv.Study, hidden: list[str], effect: str, values: Mapping[str, float]) -> str:
    """Whether the truth is claimed: `yes`, as one of a `group`, or `no`.

    `hidden` is what is claimed beside what the rung itself brings about.
    """
    if not effect:
        return "no" if hidden else "yes"
    sizes = _sizes(study, effect)
    inside = len(sizes) == len(values) and all(
        abs(value - true) <= 1.96 * std
        for true, (value, std) in zip(values.values(), sizes, strict=True)
    )
    if not inside or len(hidden) != 1:
        return "no"
    if hidden == [effect]:
        return "yes"
    (claimed,) = (a for a in study.added if a.id == hidden[0])
    return "group" if not claimed.stands_in and effect in claimed.confounded_with else "no"


def _sizes(study: sv.Study, effect: str) -> list[tuple[float, float]]:
    """Values of an effect and their errors: in the model, or as a verdict gives them."""
    names = [n for n in study.fit.model.free_names if n.split(".")[0] == effect]
    if names:
        return [(study.fit[n].value, study.fit[n].std) for n in names]
    verdict = study.verdicts[effect]
    return list(zip(verdict.value, verdict.std, strict=True))


def _is(found: Estimate, size: float) -> bool:
    """Whether it is of a size, as closely as it is known."""
    return abs(found.value - size) < max(_NEAR * size, 1.96 * found.std)


if __name__ == "__main__":
    main()
