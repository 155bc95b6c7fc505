"""`python -m sysid_vehicle` is `sysid-vehicle`."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
