"""The summary of a fleet as one page."""

from __future__ import annotations

from .._common.style import AFTER, framed, tidy
from ..report.page import bullets, heading, page, paragraph, picture, table
from ..rules import Share
from .results import Fleet, Row

_SHOWN = 15


def fleet_page(fleet: Fleet) -> str:
    """Make the document: causes by share of cars and gain, then every study."""
    parts = [paragraph(f"{fleet.title}.", "lead")]
    if fleet.causes:
        parts += _causes(fleet)
    elif fleet.done:
        parts.append(paragraph("No effect was added to any of them."))
    if fleet.failed:
        parts += [
            heading("Failed"),
            bullets((f"{r.name}: {r.failure}" for r in fleet.failed), "warning"),
        ]
    parts += [heading("Studies"), table(_HEAD, [_line(r) for r in fleet.done], "text")]
    if any(not e.named for r in fleet.done for e in r.effects):
        parts.append(paragraph("In brackets: added, but not named."))
    return page("Studies of a fleet", parts)


def _causes(fleet: Fleet) -> list[str]:
    shown = [c for c in fleet.causes if c.cars][:_SHOWN]
    parts = [heading("Causes")]
    if shown:
        figure = framed(8.0, 0.9 + 0.3 * len(shown), left=2.4, wspace=0.2)
        left, right = figure.subplots(1, 2, sharey=True)
        places = range(len(shown))[::-1]
        left.barh(places, [100.0 * c.share for c in shown], color=AFTER, height=0.6)
        left.set_yticks(places, [c.id for c in shown])
        right.barh(places, [c.gain for c in shown], color=AFTER, height=0.6)
        left.set_xlim(0.0, 100.0)
        tidy(left, xlabel="share of cars [%]")
        tidy(right, xlabel="fall of the error / noise floor")
        parts.append(
            picture(
                figure,
                "Effects that studies name, by the share of cars, and the median fall of the "
                "one-step-ahead error on validation data that each brings.",
            )
        )
    return [
        *parts,
        table(Fleet.HEAD, fleet.table(), "ranking"),
        paragraph(
            "Share: of the cars that were studied. Gain: median fall of the one-step-ahead error "
            "on validation data, in units of the noise floor. Sizes: median over the studies that "
            "name the effect, and first to last decile where several do."
        ),
    ]


_HEAD = (
    "study",
    "verdict",
    "effects",
    "error before",
    "after",
    "error 1 to 5 s ahead that is gone",
)


def _line(r: Row) -> list[str]:
    effects = ", ".join(e.id if e.named else f"({e.id})" for e in r.effects)
    told = r.explained
    gone = "-" if told is None else str(Share(*told))
    errors = ["-" if e is None else f"{e:.3f}" for e in (r.error_before, r.error_after)]
    return [r.name, r.verdict.replace("_", " "), effects or "-", *errors, gone]
