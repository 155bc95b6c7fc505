"""The page of a check of the sensors."""

from __future__ import annotations

from collections.abc import Sequence

from .._common.style import framed
from ..sensors import SensorCheck
from .page import bullets, heading, page, picture


def check_page(found: SensorCheck, warnings: Sequence[str] = ()) -> str:
    """Make the document: what was found, and a picture of every channel."""
    parts = [found._repr_html_()]
    if warnings:
        parts += [heading("Warnings"), bullets(warnings, "warning")]
    parts.append(heading("What each channel read, and what it should have read"))
    for readings in found.readings:
        figure = framed(9.0, 2.4)
        found.plot(readings.channel, figure.add_subplot())
        std = found.noise[readings.channel][0].std
        caption = f"{readings.channel}; what is left has a standard deviation of {std:.3g}"
        parts.append(picture(figure, caption))
    return page("Check of the sensors", parts)
