"""How often `diagnose` names an effect on a corrupted log that was read with ``check=False``.

    python benchmarks/reading/named.py [--count 300] [--first 1000] [--all]

Each log is a drive of a car that the model describes completely, with one corruption of
`corruptions.py`, so that every name is wrong. Manoeuvre, car, noise and corruption are drawn from
the number of the log. Where the log contradicts itself by the laws of motion no effect is named
whatever else is found; only the others are diagnosed, or all with `--all`.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter

import numpy as np
from corruptions import CORRUPTIONS, VEHICLES, coloured, matters, vehicle

import sysid_vehicle as sv

RATE_HZ = 25.0
_KINDS = [(kind, channel) for kind, channels in CORRUPTIONS.items() for channel in channels]


def draw(number: int) -> tuple[str, sv.Model, sv.Log]:
    """Drive and corrupt; what moves the channels by less than their noise is drawn again."""
    rng = np.random.default_rng([number, 61])
    while True:
        model = sv.Model(vehicle(VEHICLES[int(rng.integers(2))]))
        name, manoeuvre = list(sv.manoeuvres.all().items())[rng.integers(len(sv.manoeuvres.all()))]
        log = sv.drive(model, manoeuvre, seed=rng, rate_hz=RATE_HZ)
        data = {c: np.array(log[c]) for c in log.channels}
        if rng.random() < 0.3:
            coloured(data, rng, RATE_HZ)
        kind, channel = _KINDS[rng.integers(len(_KINDS))]
        spoilt = CORRUPTIONS[kind][channel](data, rng)
        if matters(data, spoilt):
            return f"{kind}, {channel}, {name}", model, sv.Log.from_arrays(spoilt, check=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300, help="logs")
    parser.add_argument("--first", type=int, default=1000, help="number of the first one")
    parser.add_argument("--all", action="store_true", help="diagnose those that are refused, too")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    told: Counter[str] = Counter()
    for number in range(args.first, args.first + args.count):
        what, model, log = draw(number)
        if not args.all and log.contradictions:
            told["contradictory"] += 1
            continue
        try:
            dx = sv.diagnose(sv.identify(model, log, starts=1, workers=1), workers=1)
        except (sv.InvalidInput, sv.NumericalError) as error:
            told["refused"] += 1
            print(f"{number}: {what}: refused: {error}", flush=True)
            continue
        told["named" if dx.named else "not named"] += 1
        if dx.named or not args.all:
            print(f"{number}: {what}: {dx.named.id if dx.named else 'none named'}", flush=True)
    print(f"{args.count} logs: {', '.join(f'{n} {what}' for what, n in told.most_common())}")


if __name__ == "__main__":
    main()
