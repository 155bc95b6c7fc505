"""Two rivals: is the drive that was suggested worth what was promised?"""

from __future__ import annotations

from typing import Any

import numpy as np
import truths
from design import Trial

import sysid_vehicle as sv
from sysid_vehicle.diagnose.candidates.score import score_board

_LIMITS = sv.DriveLimits(speed_mps=30.0, lateral_mps2=7.0, duration_s=45.0)


def separate(trial: Trial, train: list[sv.Log]) -> dict[str, Any]:
    """Ask for a drive, follow, and measure by how many standard errors the rivals are apart.

    What is measured is the gain in the score statistic of the first beside the second, less what
    noise alone would give.
    """
    first, second = map(sv.effect, trial.truth)
    fit = sv.identify(truths.baseline(trial.vehicle), train, starts=1, workers=1)
    size = truths.rival_size(trial)
    asked = sv.suggest_manoeuvre(fit, first, second, size=size, limits=_LIMITS)
    rng = np.random.default_rng((trial.seed, 1))
    there = truths.drive_one(trial, asked.best.manoeuvre, rng)
    again = sv.identify(fit.model, [*train, there], starts=1, workers=1)
    board = score_board(again, again.driving, (first, second))
    both = board.joint_statistic(first.id, second.id)
    gain = both - board.joint_statistic(second.id) - len(first.parameters)
    return {
        "manoeuvre": asked.best.manoeuvre.name,
        "before": asked.now,
        "promised": asked.best.sigmas,
        "achieved": float(np.sqrt(max(gain, 0.0))),
    }
