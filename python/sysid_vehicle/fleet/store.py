"""The folder of results: every file complete or not there, so that a killed run can go on."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .._common.files import as_path, write_bytes, write_json, write_text
from ..errors import InvalidInput
from ..study import PREDICTED
from .results import AHEAD_S, Effect, Row, study_file
from .work import Outcome


class Store:
    """Writes outcomes to a folder, and finds those of an earlier run.

    Parameters
    ----------
    folder : str or Path
        It is made if it is not there.

    Raises
    ------
    InvalidInput
        The folder cannot be made.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = as_path(folder).absolute()
        self._make(self.folder / "studies")

    def _make(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInput(
                f"{folder}: cannot be made ({error.strerror}); choose another folder"
            ) from error

    def earlier(self, name: str, digest: str) -> Row | None:
        """The row of a study of the same job that is there complete; None where there is none."""
        try:
            told = json.loads(study_file(self.folder, name, ".json").read_text("utf-8"))
            if told["digest"] != digest:
                return None
            row = Row.from_dict(told["row"])
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            return None
        whole = row.failure or study_file(self.folder, name).is_file()
        return row if whole and row.name == name else None

    def keep(self, outcome: Outcome, digest: str) -> None:
        """Write an outcome; the row comes last and says that the study is there."""
        row = outcome.row
        at, study = (study_file(self.folder, row.name, s) for s in (".json", ".npz"))
        self._make(at.parent)
        at.unlink(missing_ok=True)
        if outcome.study is None:
            study.unlink(missing_ok=True)
        else:
            write_bytes(study, outcome.study)
        write_json(at, {"digest": digest, "row": row.to_dict()})

    def summarise(self, rows: Sequence[Row]) -> None:
        """Write the tables of all studies so far."""
        self._table("summary", _SUMMARY, [_study(r) for r in rows])
        found = [line for r in rows for e in r.effects for line in _lines(r, e)]
        self._table("causes", _CAUSES, found)

    def _table(self, name: str, head: dict[str, str], rows: list[dict[str, Any]]) -> None:
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            text = io.StringIO()
            writer = csv.DictWriter(text, list(head))
            writer.writeheader()
            writer.writerows(rows)
            write_text(self.folder / f"{name}.csv", text.getvalue())
            return
        schema = pyarrow.schema([(c, getattr(pyarrow, kind)()) for c, kind in head.items()])
        stream = pyarrow.BufferOutputStream()
        parquet.write_table(pyarrow.Table.from_pylist(rows, schema=schema), stream)
        write_bytes(self.folder / f"{name}.parquet", stream.getvalue().to_pybytes())


_TEXT, _NUMBER = "string", "float64"
_SUMMARY = {
    **dict.fromkeys(("study", "car", "verdict", "effects", "aliases"), _TEXT),
    **dict.fromkeys(("error_before", "error_after"), _NUMBER),
    **dict.fromkeys(("explained", "explained_low", "explained_high"), _NUMBER),
    **dict.fromkeys(("usable_s", "validation_s", "seconds"), _NUMBER),
    **dict.fromkeys(("warnings", "failure"), _TEXT),
}
_GAINS = {c: f"gain_{AHEAD_S:g}s_{c}" for c in PREDICTED}
_CAUSES = {
    **dict.fromkeys(("study", "car", "effect", "grade", "confounded_with", "stands_in"), _TEXT),
    **dict.fromkeys(("error_before", "error_after", *_GAINS.values()), _NUMBER),
    "parameter": _TEXT,
    "value": _NUMBER,
    "std": _NUMBER,
    "unit": _TEXT,
}


def _study(r: Row) -> dict[str, Any]:
    told = r.explained or (None, None, None)
    return {
        "study": r.name,
        "car": r.car,
        "verdict": r.verdict,
        "effects": ", ".join(e.id for e in r.effects if e.named),
        "aliases": ", ".join(e.id for e in r.effects if not e.named),
        "error_before": r.error_before,
        "error_after": r.error_after,
        **dict(zip(("explained", "explained_low", "explained_high"), told, strict=True)),
        "usable_s": r.usable_s,
        "validation_s": r.validation_s,
        "seconds": r.seconds,
        "warnings": "; ".join(r.warnings),
        "failure": r.failure,
    }


def _lines(r: Row, e: Effect) -> list[dict[str, Any]]:
    """A line for each parameter of an effect."""
    shared = {
        "study": r.name,
        "car": r.car,
        "effect": e.id,
        "grade": e.grade,
        "confounded_with": ", ".join(e.confounded_with),
        "stands_in": e.stands_in,
        "error_before": e.error_before,
        "error_after": e.error_after,
        **{column: e.gains.get(c) for c, column in _GAINS.items()},
    }
    return [
        {**shared, "parameter": name, "value": value, "std": std, "unit": unit}
        for name, (value, std, unit) in e.parameters.items()
    ]
