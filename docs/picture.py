"""The README's example: run it as it is typed, print what it prints, show the report it writes.

python docs/picture.py            docs/images/report.png anew (by Chromium), output to the terminal
python docs/picture.py --store    the printed output into the README, too
"""

import contextlib
import io
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

REPO = Path(__file__).resolve().parents[1]
README = REPO / "README.md"
PICTURE = REPO / "docs/images/report.png"
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


def photograph(study: Any, path: Path) -> None:
    """The first screen of a study's report, as a browser of 1400 x 900 pixels shows it."""
    with tempfile.TemporaryDirectory() as folder:
        page, picture = Path(folder) / "report.html", Path(folder) / "report.png"
        study.report(page)
        subprocess.run(
            [
                *("chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"),
                *(f"--user-data-dir={folder}/profile", "--window-size=1400,900"),
                *("--blink-settings=preferredColorScheme=1", f"--screenshot={picture}"),
                page.as_uri(),
            ],
            check=True,
            capture_output=True,
        )
        shown = Image.open(picture).convert("RGB")
    path.parent.mkdir(exist_ok=True)
    shown.quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    """Run, print, show."""
    text = README.read_text("utf-8")
    names, printed = run(text)
    print(printed)
    photograph(names["study"], PICTURE)
    if "--store" in sys.argv[1:]:
        README.write_text(PRINTED.sub(lambda _: printed, text, count=1), "utf-8")


if __name__ == "__main__":
    main()
