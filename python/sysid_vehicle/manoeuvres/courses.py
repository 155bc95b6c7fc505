"""Courses like laps: corners one after the other, braked into and powered out of."""

from __future__ import annotations

from .._common.arguments import check_positive
from .._common.typed import typed
from .curves import Knots
from .manoeuvre import Manoeuvre

# Rows: time [s], speed [m/s], lateral acceleration as a share of the highest one. Each course ends
# as it begins, so that it can go round again.
_Rows = tuple[tuple[float, float, float], ...]

_LAP: _Rows = (
    (0.0, 22.0, 0.0),
    (3.0, 29.0, 0.0),
    (5.0, 33.0, 0.0),
    (7.0, 28.5, 0.40),  # braking on while turning in, left
    (8.4, 23.3, 0.58),
    (9.7, 19.6, 0.95),
    (11.6, 19.0, 1.0),
    (13.4, 21.5, 0.60),
    (15.0, 25.0, 0.0),
    (16.5, 27.5, -0.45),  # fast right
    (18.0, 29.0, -0.85),
    (20.0, 29.0, -0.85),
    (21.4, 31.0, -0.35),
    (22.5, 33.0, 0.0),
    (23.5, 34.0, 0.0),
    (25.0, 28.8, 0.05),  # hairpin left
    (26.4, 23.2, 0.40),
    (27.8, 17.7, 0.56),
    (29.2, 13.4, 0.88),
    (30.9, 12.6, 0.95),
    (32.2, 14.5, 0.65),
    (33.6, 18.0, 0.25),
    (34.9, 20.5, -0.55),  # right and left
    (36.1, 21.0, -0.90),
    (37.1, 21.0, -0.50),
    (38.1, 21.3, 0.50),
    (39.2, 22.0, 0.92),
    (40.3, 23.2, 0.65),
    (41.7, 26.5, 0.0),
    (43.7, 31.5, 0.0),
    (44.7, 32.0, -0.10),  # braking on while turning in, right
    (45.9, 28.8, -0.48),
    (47.3, 23.7, -0.60),
    (48.5, 20.2, -0.92),
    (50.3, 19.2, -1.0),
    (51.9, 21.0, -0.62),
    (53.1, 23.5, -0.15),
    (54.5, 25.5, 0.60),  # left, under power
    (56.0, 27.0, 0.78),
    (57.5, 27.0, 0.50),
    (60.0, 22.0, 0.0),
)

_HANDLING_COURSE: _Rows = (
    (0.0, 17.0, 0.0),
    (1.4, 19.5, -0.50),  # slow right that opens
    (2.8, 20.0, -0.95),
    (4.6, 21.5, -0.80),
    (6.4, 25.0, -0.40),
    (7.8, 28.0, 0.0),
    (10.3, 33.5, 0.0),
    (11.7, 34.5, 0.50),  # long fast left that tightens
    (13.3, 34.0, 0.75),
    (15.2, 31.0, 0.78),
    (17.0, 26.5, 0.74),
    (18.6, 24.5, 0.95),
    (20.2, 25.5, 0.50),
    (21.2, 27.0, -0.10),
    (22.4, 25.5, -0.62),  # esses
    (23.6, 24.0, -0.90),
    (24.8, 23.7, 0.0),
    (26.0, 23.4, 0.92),
    (27.2, 23.0, 0.0),
    (28.4, 22.4, -0.88),
    (29.8, 23.5, -0.40),
    (31.2, 27.0, 0.0),
    (33.6, 32.0, 0.0),
    (35.2, 27.0, -0.25),  # braking on while turning in, right
    (36.6, 21.8, -0.55),
    (37.8, 18.0, -0.80),
    (39.3, 16.2, -1.0),
    (41.0, 17.0, -0.85),
    (42.5, 20.0, -0.30),
    (43.8, 22.5, 0.30),
    (45.3, 24.5, 0.82),  # two lefts
    (46.7, 24.0, 0.50),
    (48.0, 20.0, 0.70),
    (49.4, 17.3, 0.98),
    (51.2, 18.0, 0.70),
    (52.8, 21.5, 0.0),
    (54.6, 24.5, -0.30),
    (56.4, 21.0, -0.60),
    (58.0, 17.5, 0.40),
    (60.0, 17.0, 0.0),
)


def _course(
    name: str,
    purpose: str,
    rows: _Rows,
    duration_s: float,
    lateral_mps2: float,
    top_speed_mps: float,
) -> Manoeuvre:
    sizes = {"lateral_mps2": lateral_mps2, "top_speed_mps": top_speed_mps}
    check_positive(name, duration_s=duration_s, **sizes)
    round_s = rows[-1][0]
    rounds = int(duration_s // round_s) + 1
    # One round before and one after: the curve shall not begin or end at the start line.
    every = [(k * round_s + t, v, a) for k in range(-1, rounds + 1) for t, v, a in rows[1:]]
    time_s, speed, lateral = zip(*every, strict=True)
    scale = top_speed_mps / max(speed)
    return Manoeuvre(
        name=name,
        purpose=purpose,
        duration_s=duration_s,
        speed_mps=Knots(time_s, tuple(v * scale for v in speed), smooth=True),
        lateral_mps2=Knots(time_s, tuple(a * lateral_mps2 for a in lateral), smooth=True),
    )


@typed
def lap(
    duration_s: float = 60.0, lateral_mps2: float = 9.2, top_speed_mps: float = 34.0
) -> Manoeuvre:
    """Corners to both sides, some braked into, some powered out of; 60 s a round.

    Parameters
    ----------
    duration_s : float
        Length; the round begins again after 60 s.
    lateral_mps2 : float
        Highest lateral acceleration.
    top_speed_mps : float
        Highest speed; the others keep their proportion to it.
    """
    return _course(
        "lap",
        "corners to both sides with braking into and power out of them",
        _LAP,
        duration_s,
        lateral_mps2,
        top_speed_mps,
    )


@typed
def handling_course(
    duration_s: float = 60.0, lateral_mps2: float = 8.5, top_speed_mps: float = 34.5
) -> Manoeuvre:
    """Other corners than :func:`lap` in another order, to validate on; parameters as there."""
    return _course(
        "handling_course",
        "other corners than the lap, to validate on",
        _HANDLING_COURSE,
        duration_s,
        lateral_mps2,
        top_speed_mps,
    )
