"""Outputs stored in the notebooks: made anew, or compared with those of a run.

    python notebooks/outputs.py refresh [NOTEBOOK...]       execute, store outputs in small
    python notebooks/outputs.py execute FOLDER NOTEBOOK...  execute, write into a folder
    python notebooks/outputs.py check [--strict] FOLDER     stored outputs against executed ones

What is compared is text: printed lines, tables and values. The words have to be the same. Numbers
that differ by more than 5 % and two of their last printed digit are listed, and fail a strict check
only: what the data hardly determine differs more between processors and versions of NumPy. Pictures
are compared by number and kind, cell by cell; they are drawn from the same values.
"""

import argparse
import base64
import html
import io
import json
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
TEMPORARY = re.compile(re.escape(tempfile.gettempdir()) + r"/tmp\w+/")
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
RELATIVE = 0.05
LAST_DIGITS = 2.0
DPI = 72

Notebook = dict[str, Any]


def notebooks(names: list[str]) -> list[Path]:
    """Those named, or all."""
    return [Path(name) for name in names] or sorted(HERE.glob("*.ipynb"))


def small_png(data: str) -> str:
    """Base64 of a picture without transparency, compressed as far as it goes."""
    from PIL import Image

    picture = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
    out = io.BytesIO()
    picture.save(out, "PNG", optimize=True)
    return base64.b64encode(out.getvalue()).decode()


def execute(path: Path) -> Notebook:
    """The notebook with the outputs of a run."""
    import nbformat
    from nbclient import NotebookClient

    book = nbformat.read(path, as_version=4)
    first = f"%config InlineBackend.rc = {{'figure.dpi': {DPI}}}"
    book.cells.insert(0, nbformat.v4.new_code_cell(first))
    NotebookClient(book, timeout=300, kernel_name="python3").execute()
    del book.cells[0]
    stored: Notebook = json.loads(nbformat.writes(book))
    return stored


def tidied(book: Notebook) -> Notebook:
    """Without what changes from run to run and tells nothing."""
    count = 0
    for cell in book["cells"]:
        cell["metadata"] = {}
        if cell["cell_type"] != "code":
            continue
        count += 1
        cell["execution_count"] = count
        kept = [o for o in cell["outputs"] if o.get("name") != "stderr"]
        for output in kept:
            if output["output_type"] == "stream":
                output["text"] = [TEMPORARY.sub("", line) for line in output["text"]]
            if "execution_count" in output:
                output["execution_count"] = count
            output.pop("transient", None)
            data = output.get("data", {})
            if "image/png" in data:
                data["image/png"] = small_png(data["image/png"])
            if any(kind != "text/plain" for kind in data):
                data.pop("text/plain", None)  # nobody sees it
        cell["outputs"] = kept
    book["metadata"] = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return book


def refresh(paths: list[Path]) -> int:
    """Execute notebooks and store their outputs."""
    for path in paths:
        book = tidied(execute(path))
        text = json.dumps(book, indent=1, ensure_ascii=False) + "\n"
        path.write_text(text, encoding="utf-8")
        print(f"{path.name}: {len(text) / 1024:.0f} kB", flush=True)
    return 0


def written(paths: list[Path], folder: Path) -> int:
    """Execute notebooks, and write them with what comes out."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in paths:
        (folder / path.name).write_text(json.dumps(execute(path)), encoding="utf-8")
    return 0


def outputs(cell: Notebook) -> tuple[str, list[str]]:
    """Text of a cell's outputs, and the kinds of its pictures."""
    text, pictures = [], []
    for output in cell.get("outputs", []):
        if output["output_type"] == "stream":
            if output["name"] == "stdout":
                text.append(TEMPORARY.sub("", "".join(output["text"])))
            continue
        data = output.get("data", {})
        images = [kind for kind in sorted(data) if kind.startswith("image/")]
        pictures += images
        if not images:
            page = re.sub(r"<[^>]*>", " ", "".join(data.get("text/html", [])))
            text.append(html.unescape(page) or "".join(data.get("text/plain", [])))
    return "\n".join(text), pictures


def near(stored: str, found: str) -> bool:
    """Whether two printed numbers tell the same."""
    a, b = (float(value.replace("−", "-")) for value in (stored, found))
    digits = stored.lower().split("e")[0].partition(".")[2]
    exponent = int(stored.lower().partition("e")[2] or 0)
    return abs(a - b) <= max(RELATIVE * abs(a), LAST_DIGITS * 10.0 ** (exponent - len(digits)))


def differences(stored: str, found: str) -> tuple[list[str], list[str]]:
    """What differs between two texts: words, and numbers beyond the digits that may."""
    words = [
        " ".join(re.sub(r"[-─]{3,}", "---", NUMBER.sub("0", text)).split())
        for text in (stored, found)
    ]
    if words[0] != words[1]:
        return [f"stored text: {stored.strip()!r}\n    now: {found.strip()!r}"], []
    pairs = zip(NUMBER.findall(stored), NUMBER.findall(found), strict=True)
    return [], [f"stored {a}, now {b}" for a, b in pairs if not near(a, b)]


def compare(stored: Notebook, found: Notebook) -> tuple[list[str], list[str]]:
    """Differences of the outputs of two notebooks, by cell: in words and pictures, in numbers."""
    told: list[str] = []
    numbers: list[str] = []
    cells = [[c for c in b["cells"] if c["cell_type"] == "code"] for b in (stored, found)]
    for index, (a, b) in enumerate(zip(*cells, strict=True), start=1):
        (text, pictures), (text_now, pictures_now) = outputs(a), outputs(b)
        if pictures != pictures_now:
            told.append(f"code cell {index}: stored pictures {pictures}, now {pictures_now}")
        for all_of_kind, kind in zip((told, numbers), differences(text, text_now), strict=True):
            all_of_kind += [f"code cell {index}: {d}" for d in kind]
        if not a["outputs"] and b["outputs"]:
            told.append(f"code cell {index}: no output is stored; refresh the notebook")
    return told, numbers


def check(folder: Path, strict: bool) -> int:
    """Compare the stored notebooks with executed ones of the same names."""
    bad = 0
    for path in notebooks([]):
        stored, found = (json.loads((f / path.name).read_text("utf-8")) for f in (HERE, folder))
        told, numbers = compare(stored, found)
        bad += bool(told or (strict and numbers))
        word = "differs" if told else "differs in numbers" if numbers else "reproduced"
        print(f"{path.name}: {word}", *told, *numbers, sep="\n  ")
    return 1 if bad else 0


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Outputs stored in the notebooks.")
    commands = parser.add_subparsers(dest="command", required=True)
    again = commands.add_parser("refresh", help="execute notebooks and store their outputs")
    again.add_argument("notebooks", nargs="*")
    beside = commands.add_parser("execute", help="execute notebooks and write them into a folder")
    beside.add_argument("folder", type=Path)
    beside.add_argument("notebooks", nargs="+")
    against = commands.add_parser("check", help="compare stored outputs with executed notebooks")
    against.add_argument("folder", type=Path)
    against.add_argument("--strict", action="store_true", help="numbers count too")
    told = parser.parse_args()
    if told.command == "refresh":
        return refresh(notebooks(told.notebooks))
    if told.command == "execute":
        return written(notebooks(told.notebooks), told.folder)
    return check(told.folder, told.strict)


if __name__ == "__main__":
    sys.exit(main())
