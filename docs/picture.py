"""The README's example: run it as it is typed, print what it prints, draw its picture.

python docs/picture.py            docs/images/error_falls.png anew, output to the terminal
python docs/picture.py --store    the printed output into the README, too
"""

import contextlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from PIL import Image

from sysid_vehicle.report import failure_maps, overlay
from sysid_vehicle.report.excerpt import worst_excerpt

REPO = Path(__file__).resolve().parents[1]
README = REPO / "README.md"
PICTURE = REPO / "docs/images/error_falls.png"
PRINTED = re.compile(r"(?<=```text\n).*?(?=```)", re.DOTALL)


def blocks(text: str) -> list[str]:
    """Python blocks of a Markdown text."""
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def run(text: str) -> tuple[dict[str, Any], str]:
    """Names and printed output after all blocks, in a folder of their own."""
    names: dict[str, Any] = {}
    out, before = io.StringIO(), Path.cwd()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(out):
        os.chdir(folder)
        try:
            for block in blocks(text):
                exec(block, names)
        finally:
            os.chdir(before)
    return names, out.getvalue()


def draw(study: Any, path: Path) -> None:
    """Measured, baseline and final model over the worst seconds; the failure maps of both."""
    excerpt = worst_excerpt(study)
    assert excerpt is not None
    figure = plt.figure(figsize=(11, 5.2), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1.7, 1))
    axes = left.subplots(4, 1, sharex=True, height_ratios=(2, 1, 2, 1))
    overlay(excerpt, axes)
    failure_maps(study, right.subplots(2, 1, sharex=True, sharey=True))
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=85)
    picture = Image.open(buffer).convert("RGB")
    path.parent.mkdir(exist_ok=True)
    picture.quantize(96, dither=Image.Dither.NONE).save(path, optimize=True)
    plt.close(figure)


def main() -> None:
    """Run, print, draw."""
    text = README.read_text("utf-8")
    names, printed = run(text)
    print(printed)
    draw(names["study"], PICTURE)
    if "--store" in sys.argv[1:]:
        README.write_text(PRINTED.sub(lambda _: printed, text, count=1), "utf-8")


if __name__ == "__main__":
    main()
