"""Names that users choose do no harm in a notebook or a report."""

import ast
import dataclasses
import importlib
import inspect
import json
import pkgutil
import re
import textwrap
import warnings
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest

import sysid_vehicle as sv

EVIL = "<script>alert('1')</script><img src=x onerror=\"alert(2)\"> & $x^{ $"
PACKAGE = Path(sv.__file__).parent
ESCAPING = {"escape", "html_list", "html_paragraph", "html_table", "html_text", "_repr_html_"}


class Tags(HTMLParser):
    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def harm(page: str) -> list[str]:
    """What a page would run or load."""
    found = []
    for tag, attributes in Tags(page).found:
        if tag == "script" or any(a.startswith("on") for a in attributes):
            found.append(tag)
        if tag == "img" and not (attributes.get("src") or "").startswith("data:"):
            found.append(tag)
    return found


def test_harm_is_seen() -> None:
    assert harm(EVIL) == ["script", "img", "img"]
    assert harm('<p title="x" onclick="f()">') == ["p"]


@pytest.fixture(scope="module")
def study() -> Iterator[sv.Study]:
    """Of a log, a car and an effect with names that would do harm."""
    car = sv.example_vehicle().replace(name=EVIL)
    effect = sv.define_effect(
        "evil",
        title=EVIL,
        parameters=[sv.parameter("gain", EVIL, typical=500.0, lower=-5e3, upper=5e3)],
        force_y=lambda d, p: p.gain * d.steer,
        source=EVIL,
        equation=EVIL,
        excited_by=EVIL,
    )
    truth = sv.Model(car).add(effect).with_values({"evil.gain": 4000.0})
    train = sv.drive(truth, sv.manoeuvres.lap(30.0), seed=1, rate_hz=50.0, name=EVIL)
    test = sv.drive(truth, sv.manoeuvres.handling_course(25.0), seed=2, rate_hz=50.0, name=EVIL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        yield sv.improve(
            sv.Model(car),
            train,
            test,
            candidates=["evil", "mass", "steer_lag"],
            starts=1,
            sensors=False,
        )
    sv.forget_effect("evil")


def reachable(root: object) -> list[object]:
    """Every object of the package that hangs on a result, in fields and public properties."""
    seen: dict[int, object] = {}
    todo = [root]
    while todo:
        x = todo.pop()
        if id(x) in seen or isinstance(x, str | bytes | int | float | type(None)):
            continue
        seen[id(x)] = x
        if isinstance(x, dict):
            todo += [*x.keys(), *x.values()]
        elif isinstance(x, list | tuple | set | frozenset):
            todo += x
        elif type(x).__module__.startswith("sysid_vehicle"):
            if dataclasses.is_dataclass(x):
                todo += [getattr(x, f.name) for f in dataclasses.fields(x)]
            else:
                todo += vars(x).values() if hasattr(x, "__dict__") else []
    return [x for x in seen.values() if hasattr(x, "_repr_html_")]


def test_no_object_of_a_study_shows_markup_of_others(study: sv.Study) -> None:
    fit = study.fit
    found = reachable(study)
    found += reachable(sv.where(fit))
    found += reachable(sv.verdicts(study.diagnoses[0]))
    found += reachable(sv.bias_report(study.fits[0], [sv.effect("mass")]))
    found += reachable(sv.unknown(study.fits[0], study.fit.driving))
    found += reachable(sv.compare(fit, fit.driving))
    found += reachable(sv.simulate.drive_truth(fit.model, sv.manoeuvres.step_steer(), seed=0))
    shown = {type(x).__name__ for x in found}
    assert {"Study", "Fit", "Comparison", "Model", "Vehicle", "Log", "Diagnosis"} <= shown
    assert {"Effect", "NoiseModel", "Where", "Unknown", "BiasReport", "Drive", "Verdicts"} <= shown
    for x in found:
        assert harm(x._repr_html_()) == [], type(x)  # type: ignore[attr-defined]
    assert any("&lt;script&gt;" in x._repr_html_() for x in found)  # type: ignore[attr-defined]


def test_a_report_runs_nothing(study: sv.Study, tmp_path: Path) -> None:
    study.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    own, found = Path(PACKAGE / "report/page.js").read_text("utf-8"), harm(page)
    assert found == ["script", "script"], "the page's data and its own script"
    assert page.count(f"<script>{own}</script>") == 1
    data = re.search(r'<script type="application/json" id="samples">(.*?)</script>', page)
    assert data is not None
    assert "<" not in data[1]
    assert set(json.loads(data[1])) > {"t", "v", "selected"}
    assert "&lt;script&gt;" in page


def classes() -> Iterator[type]:
    """Every class of the package that shows itself in a notebook."""
    for module in pkgutil.walk_packages(sv.__path__, "sysid_vehicle."):
        if module.name.endswith("__main__"):
            continue
        for _, found in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if found.__module__ == module.name and "_repr_html_" in vars(found):
                yield found


def unescaped(source: str) -> list[str]:
    """Expressions that a method puts into markup as they are."""
    tree = ast.parse(textwrap.dedent(source))
    looped = {
        name.id
        for node in ast.walk(tree)
        if isinstance(node, ast.comprehension)
        for name in ast.walk(node.target)
        if isinstance(name, ast.Name)
    }
    own = {f.name for f in ast.walk(tree) if isinstance(f, ast.FunctionDef)}
    found = []
    todo: list[ast.AST] = [tree]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.Call):
            called = node.func
            name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
            if name in ESCAPING | own:
                continue
        if isinstance(node, ast.FormattedValue) and not isinstance(node.value, ast.Call):
            made_here = isinstance(node.value, ast.Name) and node.value.id not in looped | {"self"}
            if not made_here:
                found.append(ast.unparse(node.value))
        elif isinstance(node, ast.FormattedValue) and unescaped_call(node.value, own):
            found.append(ast.unparse(node.value))
        todo += ast.iter_child_nodes(node)
    return found


def unescaped_call(value: ast.expr, own: set[str]) -> bool:
    called = value.func if isinstance(value, ast.Call) else value
    name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
    return name not in ESCAPING | own


def test_unescaped_values_are_seen() -> None:
    assert unescaped('def f(self): return f"<p>{self}</p>"') == ["self"]
    assert unescaped('def f(self): return f"<p>{self.name}{escape(self.x)}</p>"') == ["self.name"]
    assert unescaped('def f(self): return "".join(f"<p>{r}</p>" for r in self.rows)') == ["r"]
    assert unescaped('def f(self): return f"<p>{self.head()}</p>"') == ["self.head()"]


@pytest.mark.parametrize("shown", [*classes()], ids=lambda c: c.__name__)
def test_markup_is_made_of_escaped_text(shown: type) -> None:
    assert unescaped(inspect.getsource(vars(shown)["_repr_html_"])) == []
