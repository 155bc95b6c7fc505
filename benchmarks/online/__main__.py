"""All online estimators in one table: sideslip, cornering stiffness, and the mu-slip curve.

Run: python benchmarks/online DATA [--quick]. DATA holds carsim_like_handling and revs_250lm. Ends
with status 1 if a row fails.
"""

import argparse
import sys
from pathlib import Path

import mu_slip
import sideslip
from table import Table


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, metavar="DATA", help="folder with the logs")
    parser.add_argument("--quick", action="store_true", help="few seeds, shorter search")
    args = parser.parse_args()
    table = Table()
    sideslip.rows(table, args.data, quick=args.quick)
    mu_slip.rows(table, mu_slip.QUICK if args.quick else mu_slip.WANTED)
    return 1 if table.failed else 0


if __name__ == "__main__":
    sys.exit(main())
