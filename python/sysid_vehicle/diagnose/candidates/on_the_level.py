"""What candidates score where the slope of the road does not vary.

Noise that has learned a road whose slope varies takes up whatever makes speeds and accelerometers
disagree: a body that leans, a scale of the accelerometer or the gyro. Scores under it tell what is
left, and a refit that begins there stays there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ...estimate import Driving
from ...identify import Fit
from ...rules import Rules
from ..evidence.evidence import Evidence
from .candidate import Candidate
from .score import score_board_of

_MOST = 0.5  # of what a level road shows, or of the road of a fit: the greater part
_NEAR = 0.3  # of the best score on a level road


def shown_on_the_level(
    fit: Fit, driving: Driving, ranked: Sequence[Candidate], rules: Rules
) -> list[Candidate]:
    """Candidates of whose score a varying road takes the greater part, as a level one shows them.

    The best and those near it, the best first.

    Parameters
    ----------
    fit : Fit
        With noise that has such a road.
    driving : Driving
    ranked : sequence of Candidate
        With their scores under that noise.
    rules : Rules
    """
    level = replace(fit, noise=replace(fit.noise, road=(0.0, 0.0)))
    asked = tuple(c.effect for c in ranked)
    board = score_board_of(Evidence(level, driving), asked, rules)
    known = {c.id: c for c in ranked}
    shown = [
        replace(known[s.effect.id], value=s.value, std=s.std)
        for s in sorted(board.scores, key=lambda s: -s.statistic)
        if s.p_value < rules.alpha / len(ranked)
        and s.statistic > _NEAR * max(o.statistic for o in board.scores)
    ]
    levels = {s.effect.id: s.statistic for s in board.scores}
    return [c for c in shown if c.statistic < _MOST * levels[c.id]]


def needs_road(fit: Fit, before: Fit) -> bool:
    """Whether a fit keeps the greater part of the road that another one has."""
    return math.hypot(*fit.noise.road) > _MOST * math.hypot(*before.noise.road)


def may_be_the_drivers(c: Candidate, before: Fit) -> bool:
    """Whether the late speeds of a refitted candidate may be what the driver knows of slopes.

    Whoever holds a speed knows it better than its sensor does, and answers slopes with the pull:
    the pull then tells of the speed what no reading has told yet, as if the readings came late. A
    delay that is there takes the place of slopes that are not; beside slopes that stay, nothing but
    a lateral speed tells whether the speeds come late.
    """
    if c.fit is None or c.effect.breaks != "readings late" or "vy_mps" in c.fit.driving.present:
        return False
    return c.fit.noise.road[0] > _MOST * before.noise.road[0]
