"""Files that commands write: looked at before the work begins, not after it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._common.files import check_outputs, write_json, write_text
from .._common.style import svg
from ..errors import InvalidInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SUFFIXES = {"SVG": (".svg",), "GIF": (".gif",), "HTML": (".html", ".htm", "")}


def add_output(
    parser: argparse.ArgumentParser,
    *names: str,
    kind: str,
    help: str,
    also: Sequence[str] = (),
    **more: Any,
) -> None:
    """Ask for a file to write, of a kind such as ``SVG``, or with an ending of another kind."""
    action = parser.add_argument(*names, type=Path, metavar=kind, help=help, **more)
    known = parser.get_default("outputs") or {}
    suffixes = (*_SUFFIXES[kind][:1], *also, *_SUFFIXES[kind][1:]) if kind in _SUFFIXES else None
    parser.set_defaults(outputs={**known, action.dest: suffixes})


def add_json(parser: argparse.ArgumentParser) -> None:
    """Ask for a file for all figures."""
    add_output(parser, "--json", kind="JSON", help="file for all figures")


def refuse_outputs(args: argparse.Namespace) -> None:
    """Refuse outputs that could not be written, or would replace an input or each other.

    Raises
    ------
    InvalidInput
        Also if a name promises another kind of file than is written.
    """
    suffixes: Mapping[str, Sequence[str] | None] = getattr(args, "outputs", {})
    outputs = {name: getattr(args, name) for name in suffixes}
    if not outputs:
        return
    for name, path in outputs.items():
        some = suffixes[name]
        if path is not None and some is not None and path.suffix.lower() not in some:
            told = " or ".join(suffix for suffix in some if suffix)
            raise InvalidInput(f"{path}: the file will be {told}; end the name in {told}")
    given = [value for name, value in vars(args).items() if name not in outputs]
    several = [value if isinstance(value, Sequence) else [value] for value in given]
    check_outputs(
        list(outputs.values()),
        [path for values in several for path in values if isinstance(path, Path)],
    )


def write_figures(path: Path | None, told: Mapping[str, Any], heard: Sequence[str]) -> None:
    """Write all figures and the warnings, if a file is asked for."""
    if path is not None:
        write_json(path, {**told, "warnings": list(heard)})


def write_picture(path: Path, figure: Figure) -> None:
    """Write a figure, and say where."""
    write_text(path, svg(figure).decode())
    print(f"Picture: {path}")
