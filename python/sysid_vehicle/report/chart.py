"""Charts as SVG text: they need no drawing library, and the page's script can follow them.

Colours are classes of the page's style sheet, so that light, dark and print choose them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import FloatArray

Range = tuple[float, float]
Tick = tuple[float, str]

# Anchors of Matplotlib's maps of these names; their lightness runs one way, or both ways from the
# middle of the third.
CIVIDIS = ("#00224e", "#2a3f6d", "#575d6d", "#7d7c78", "#a59c74", "#d2c060", "#fee838")
VIRIDIS = ("#440154", "#443983", "#31688e", "#21918c", "#35b779", "#90d743", "#fde725")
DIVERGING = ("#053061", "#2f79b5", "#8ac0db", "#f7f7f7", "#f5a886", "#c13639", "#67001f")

_SHADES = 16
_LETTER = 6.6  # width of a figure [px]; page.js has the same


def ticks(low: float, high: float, most: int = 6) -> list[Tick]:
    """Round numbers between two, at most so many, with what to print."""
    raw = (high - low) / max(most, 1)
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(s * power for s in (1.0, 2.0, 5.0, 10.0) if s * power >= raw * (1.0 - 1e-9))
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return [
        (i * step, f"{i * step + 0.0:.{digits}f}".replace("-", "\u2212"))
        for i in range(first, last + 1)
    ]


def colours(values: ArrayLike, limits: Range, anchors: Sequence[str]) -> list[str]:
    """The colour of each value, as `#rrggbb`."""
    known = np.array([[int(a[i : i + 2], 16) for i in (1, 3, 5)] for a in anchors], dtype=float)
    at = np.clip((np.asarray(values) - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)
    places = np.linspace(0.0, 1.0, len(anchors))
    rgb = np.column_stack([np.interp(at.ravel(), places, known[:, k]) for k in range(3)])
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in np.round(rgb).astype(int)]


class Chart:
    """One pair of axes to draw onto, in the order of the calls.

    Parameters
    ----------
    width, height : float
        Of the picture [px]; on a narrow screen it shrinks.
    x, y : (float, float)
        Ranges of the axes.
    xlabel, ylabel, title : str
    xticks, yticks : sequence of (float, str), optional
        By default round numbers; none for an axis that a chart below labels.
    left, bottom : float
        Margins [px].
    equal : bool
        One unit is as long along as across; the larger range is kept.
    link : str
        What the page's script takes for the axes: `t` (time, shows what is selected), `zoom`
        (time, from the first selected sample to the last), or two columns of the samples, `x,y`.
    """

    def __init__(
        self,
        width: float,
        height: float,
        x: Range,
        y: Range,
        *,
        xlabel: str = "",
        ylabel: str = "",
        title: str = "",
        xticks: Sequence[Tick] | None = None,
        yticks: Sequence[Tick] | None = None,
        left: float = 46.0,
        bottom: float = 32.0,
        equal: bool = False,
        link: str = "",
    ) -> None:
        top = 18.0 if title else 6.0
        self._size = width, height
        self._frame = left, top, width - left - 8.0, height - top - bottom
        self._x, self._y = _opened(x), _opened(y)
        if equal:
            self._make_equal()
        self._text = xlabel, ylabel, title
        self._ticks = xticks, yticks
        self._link = link
        self._field = "field"
        self._parts: list[str] = []

    def _make_equal(self) -> None:
        _, _, width, height = self._frame
        (x0, x1), (y0, y1) = self._x, self._y
        unit = max((x1 - x0) / width, (y1 - y0) / height)
        grow_x, grow_y = (0.5 * (unit * s - d) for s, d in ((width, x1 - x0), (height, y1 - y0)))
        self._x, self._y = (x0 - grow_x, x1 + grow_x), (y0 - grow_y, y1 + grow_y)

    def _at(self, x: ArrayLike, y: ArrayLike) -> tuple[FloatArray, FloatArray]:
        left, top, width, height = self._frame
        (x0, x1), (y0, y1) = self._x, self._y
        across = left + width * (np.asarray(x, dtype=float) - x0) / (x1 - x0)
        down = top + height * (y1 - np.asarray(y, dtype=float)) / (y1 - y0)
        return np.atleast_1d(across), np.atleast_1d(down)

    def line(self, x: ArrayLike, y: ArrayLike, kind: str, column: str = "", name: str = "") -> None:
        """Draw a line of the style class `kind`, broken where a value is no number.

        `column` is that of the samples which the script draws anew, `name` what it calls it.
        """
        mark = f' data-c="{escape(column)}" data-n="{escape(name)}"' if column else ""
        self._parts.append(f'<path class="line {kind}"{mark} d="{_path(*self._at(x, y))}"/>')

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, kind: str) -> None:
        """Fill between two lines."""
        (a, upper), (_, lower) = self._at(x, high), self._at(x, low)
        both = np.concatenate([a, a[::-1]]), np.concatenate([upper, lower[::-1]])
        self._parts.append(f'<path class="band {kind}" d="{_path(*both)}Z"/>')

    def dots(self, x: ArrayLike, y: ArrayLike, kind: str = "") -> None:
        """Draw points of one style class."""
        self._parts.append(f'<path class="dots {kind}" d="{_dots(*self._at(x, y))}"/>')

    def shaded(
        self, x: ArrayLike, y: ArrayLike, values: FloatArray, limits: Range, anchors: Sequence[str]
    ) -> None:
        """Draw points in the colour of their values, the largest last."""
        across, down = self._at(x, y)
        share = np.clip((values - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0 - 1e-9)
        shade = np.floor(_SHADES * np.nan_to_num(share)).astype(int)
        inks = colours((np.arange(_SHADES) + 0.5) / _SHADES, (0.0, 1.0), anchors)
        for k in np.unique(shade):
            own = shade == k
            path = _dots(across[own], down[own])
            self._parts.append(f'<path class="dots" style="stroke: {inks[k]}" d="{path}"/>')

    def selected(self, x: ArrayLike, y: ArrayLike) -> None:
        """Ring points, below what is drawn next; the script moves these rings."""
        self._parts.append(f'<path class="dots selected" d="{_dots(*self._at(x, y))}"/>')

    def bars(self, x: ArrayLike, y: ArrayLike, half: ArrayLike, kind: str = "ink") -> None:
        """Draw points with intervals up and down."""
        y, half = np.asarray(y, dtype=float), np.asarray(half, dtype=float)
        (a, low), (_, high) = self._at(x, y - half), self._at(x, y + half)
        there = np.isfinite(low) & np.isfinite(high)
        path = "".join(
            f"M{p:.1f} {q:.1f}V{r:.1f}"
            for p, q, r in zip(a[there], low[there], high[there], strict=True)
        )
        self._parts.append(f'<path class="line {kind}" d="{path}"/>')
        self.dots(x, y, kind)

    def along(self, low: float, high: float, y: float, kind: str) -> None:
        """Draw a level piece of a line."""
        self.line([low, high], [y, y], kind)

    def cells(
        self,
        x: FloatArray,
        y: FloatArray,
        inside: FloatArray,
        limits: Range,
        anchors: Sequence[str],
    ) -> None:
        """Fill the cells of a grid, shape (rows of y, columns of x); grey where NaN."""
        self._field = "field grey"
        across, _ = self._at(x, np.zeros_like(x))
        _, down = self._at(np.zeros_like(y), y)
        inks = colours(np.nan_to_num(inside), limits, anchors)
        for k, ink in enumerate(inks):
            i, j = divmod(k, inside.shape[1])
            if np.isfinite(inside[i, j]):
                self._parts.append(
                    f'<rect x="{across[j]:.1f}" y="{down[i + 1]:.1f}" '
                    f'width="{across[j + 1] - across[j] + 0.4:.1f}" '
                    f'height="{down[i] - down[i + 1] + 0.4:.1f}" fill="{ink}"/>'
                )

    def level(self, y: float, kind: str = "zero") -> None:
        """Draw a line across the whole chart."""
        self.line(self._x, (y, y), kind)

    def moment(self, x: float, text: str = "", kind: str = "alarm") -> None:
        """Draw a line from bottom to top, and a word beside it."""
        self.line((x, x), self._y, kind)
        across, down = self._at(x, self._y[1])
        at = f'x="{across[0] + 3:.1f}" y="{down[0] + 11:.1f}"'
        self._parts.append(f'<text class="{kind}" {at}>{escape(text)}</text>')

    def hatch(self, low: float, high: float) -> None:
        """Grey a range of x."""
        (a, b), (top, bottom) = self._at([low, high], self._y[::-1])
        self._parts.append(
            f'<rect class="unseen" x="{a:.1f}" y="{top:.1f}" width="{b - a:.1f}" '
            f'height="{bottom - top:.1f}"/>'
        )

    def _inside(self, x: float, word: str) -> float:
        """Where the middle of a word stands that is not cut off at the chart's edge."""
        half = 0.5 * _LETTER * len(word)
        return float(np.clip(x, half, self._size[0] - half))

    def svg(self, told: str = "") -> str:
        """The element; `told`, or else its labels, stand for it where it is not seen."""
        left, top, width, height = self._frame
        (x0, x1), (y0, y1) = self._x, self._y
        xlabel, ylabel, title = self._text
        xt = ticks(x0, x1, max(int(width / 50), 2)) if self._ticks[0] is None else self._ticks[0]
        yt = ticks(y0, y1, max(int(height / 20), 2)) if self._ticks[1] is None else self._ticks[1]
        link = ""
        if self._link:
            frame = " ".join(f"{v:.1f}" for v in self._frame)
            view = " ".join(f"{v:.6g}" for v in (x0, x1, y0, y1))
            link = (
                f' data-link="{self._link}" data-frame="{frame}" data-view="{view}" tabindex="0"'
                f' data-bare="{"x" if self._ticks[0] is not None else ""}"'
            )
        marks = "".join(
            f'<path d="M{a:.1f} {top:.1f}v{height:.1f}"/><text x="{self._inside(a, word):.1f}" '
            f'y="{top + height + 13:.1f}" text-anchor="middle">{word}</text>'
            for value, word in xt
            for a in self._at(value, y0)[0]
        )
        rungs = "".join(
            f'<path d="M{left:.1f} {b:.1f}h{width:.1f}"/><text x="{left - 4:.1f}" '
            f'y="{b + 4:.1f}" text-anchor="end">{escape(word)}</text>'
            for value, word in yt
            for b in self._at(x0, value)[1]
        )
        words = ""
        if title:
            words += f'<text x="{left:.1f}" y="12" class="title">{escape(title)}</text>'
        if xlabel:
            words += (
                f'<text x="{left + width / 2:.1f}" y="{self._size[1] - 4:.1f}" '
                f'text-anchor="middle">{escape(xlabel)}</text>'
            )
        if ylabel:
            words += (
                f'<text transform="translate(11 {top + height / 2:.1f}) rotate(-90)" '
                f'text-anchor="middle">{escape(ylabel)}</text>'
            )
        wide, high = self._size
        label = told or ", ".join(filter(None, (title, ylabel, xlabel)))
        return (
            f'<svg role="img" aria-label="{escape(label, quote=True)}" '
            f'viewBox="0 0 {wide:g} {high:g}" width="{wide:g}" height="{high:g}"{link}>'
            f'<rect class="{self._field}" x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" '
            f'height="{height:.1f}"/><g class="grid xt">{marks}</g><g class="grid yt">{rungs}</g>'
            f'<svg class="data" x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" '
            f'height="{height:.1f}" viewBox="{left:.1f} {top:.1f} {width:.1f} {height:.1f}">'
            f"{''.join(self._parts)}</svg>{words}</svg>"
        )


def figure(charts: Sequence[Chart], caption: str, above: str = "", kind: str = "stack") -> str:
    """Put charts above or, of the kind `row`, beside each other, with a legend and a caption."""
    drawn = "".join(c.svg("" if i else caption) for i, c in enumerate(charts))
    return (
        f'<figure class="{kind}">{above}<div>{drawn}</div>'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def legend(entries: Iterable[tuple[str, str]]) -> str:
    """Name styles: class and name of each."""
    shown = "".join(
        '<span><svg aria-hidden="true" width="26" height="9">'
        f'<path class="line {kind}" d="M1 5H25"/></svg>{escape(name)}</span>'
        for kind, name in entries
    )
    return f'<p class="legend">{shown}</p>'


def scale(limits: Range, anchors: Sequence[str], name: str) -> str:
    """Tell what colours mean."""
    low, high = (f"{v:.3g}".replace("-", "\u2212") for v in limits)
    return (
        f'<p class="legend"><span>{low}<i style="background: linear-gradient(90deg, '
        f'{", ".join(anchors)})"></i>{high} {escape(name)}</span></p>'
    )


def _opened(limits: Range) -> Range:
    low, high = map(float, limits)
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0.0, 1.0
    if high <= low:
        middle = max(abs(low), 1e-9)
        return low - 0.5 * middle, low + 0.5 * middle
    return low, high


def _path(x: FloatArray, y: FloatArray) -> str:
    there = np.isfinite(x) & np.isfinite(y)
    begins = there & ~np.concatenate([[False], there[:-1]])
    return "".join(
        f"{'M' if b else 'L'}{p:.1f} {q:.1f}"
        for p, q, b in zip(x[there], y[there], begins[there], strict=True)
    )


def _dots(x: FloatArray, y: FloatArray) -> str:
    """Lines of no length, whose round ends are the points."""
    there = np.isfinite(x) & np.isfinite(y)
    return "".join(f"M{p:.1f} {q:.1f}h0" for p, q in zip(x[there], y[there], strict=True))
