"""Audit of the dependencies, as far as it goes without a network.

Every requirement has a lower bound; where the next major version of a package would break the build
or change numbers, an upper one; and what is installed obeys them. Whether a version has a known
vulnerability is asked of pip-audit, where it is installed and reaches its service.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

# Their major versions change what a linter, a stub or a build finds.
BOUNDED = {"cmeel-eigen", "mypy", "ruff", "clang-format", "clang-tidy"}
OWN = "sysid-vehicle"


def main() -> int:
    """Print what is wrong; 1 where something is."""
    with (Path(__file__).resolve().parents[1] / "pyproject.toml").open("rb") as file:
        table = tomllib.load(file)
    texts = [*table["build-system"]["requires"], *table["project"]["dependencies"]]
    for extra in table["project"]["optional-dependencies"].values():
        texts += extra
    faults = []
    for requirement in map(Requirement, texts):
        if requirement.name == OWN or (requirement.marker and not requirement.marker.evaluate()):
            continue
        operators = {s.operator for s in requirement.specifier}
        if not operators & {">=", "==", "~="}:
            faults.append(f"{requirement}: it has no lower bound")
        if requirement.name in BOUNDED and not operators & {"<", "==", "~="}:
            faults.append(f"{requirement}: it has no upper bound")
        try:
            installed = metadata.version(requirement.name)
        except metadata.PackageNotFoundError:
            continue  # of an extra that is not installed
        if installed not in requirement.specifier:
            faults.append(f"{requirement}: {installed} is installed")
    print("\n".join(faults) or "all requirements are bounded and obeyed")
    _vulnerabilities()
    return 1 if faults else 0


def _vulnerabilities() -> None:
    program = shutil.which("pip-audit")
    if program is None:
        print("known vulnerabilities: not asked, pip-audit is not installed")
        return
    asked = subprocess.run([program, "--progress-spinner=off"], check=False)
    # It ends with 1 both where it found something and where it reached nobody: told, not judged.
    print(f"known vulnerabilities: pip-audit ended with {asked.returncode}")


if __name__ == "__main__":
    sys.exit(main())
