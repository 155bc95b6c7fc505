"""How often is an effect claimed where none is hidden?

    python benchmarks/finding_effects/false_claims.py [MANOEUVRE ...] [--seeds N] [--first-seed N]

Every built-in manoeuvre is driven with a car that the model describes completely, and the whole
search for missing effects runs on it, with a handling course as validation data.
"""

from __future__ import annotations

import argparse
import warnings

from recovery import OTHER_TYRES, SENSORS

import sysid_vehicle as sv


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    every = sv.manoeuvres.all()
    parser.add_argument("manoeuvres", nargs="*", metavar="MANOEUVRE", help=", ".join(every))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    truth = sv.Model(sv.example_vehicle())
    model = sv.Model(truth.vehicle.replace(**OTHER_TYRES))
    print(f"{'manoeuvre':<24} {'runs':>4} {'claimed':>8} {'evidence':>9} {'not adequate':>13}")
    runs = claims = 0
    for name in args.manoeuvres or every:
        claimed, evidence, verdicts = [], 0, 0
        for seed in range(args.first_seed, args.first_seed + args.seeds):
            train = sv.drive(truth, every[name], seed=1000 + seed, noise=SENSORS)
            test = sv.drive(truth, every["handling_course"], seed=2000 + seed, noise=SENSORS)
            study = sv.improve(model, train, test, seed=seed)
            claimed += [a.id for a in study.added[:1]]
            evidence += bool(study.diagnoses[0].significant)
            verdicts += study.verdict not in ("adequate", "not_testable")
        runs += args.seeds
        claims += len(claimed)
        print(
            f"{name:<24} {args.seeds:>4} {len(claimed):>8} {evidence:>9} {verdicts:>13}  "
            + ", ".join(claimed),
            flush=True,
        )
    print(f"an effect is claimed in {claims} of {runs} runs ({100 * claims / runs:.1f} %)")


if __name__ == "__main__":
    main()
