"""Effects that most driving shows to act alike say so of each other."""

from itertools import combinations

import numpy as np

from sysid_vehicle import Model, catalogue, drive, effect, identify, manoeuvres
from sysid_vehicle.diagnose.candidates.score import ScoreBoard, score_board
from sysid_vehicle.diagnose.evidence.projection import pseudo_inverse

DRIVES = (
    manoeuvres.ramp_steer((18.0, 27.0), 8.6, 4.0),
    manoeuvres.sine_sweep(25.0, 25.0, 3.5),
    manoeuvres.step_steer((17.0, 27.0), (3.0, 6.0)),
    manoeuvres.lap(30.0, 8.6),
    manoeuvres.handling_course(30.0, 8.0),
)
ALIKE = 0.9  # correlation, in half of the drives


def likeness(board: ScoreBoard, one: str, other: str) -> float:
    """Correlation of what one does at its typical size with the best that the other can do.

    Beside all that tyres may do; of the two the larger.
    """
    seen = []
    for a, b in ((one, other), (other, one)):
        own, their = board.places[a], board.places[b]
        size = np.array([p.typical - p.null_value for p in effect(a).parameters if not p.scan])
        if len(size) != own.stop - own.start:
            continue
        information = board.information
        common = size @ information[own, their]
        copied = common @ pseudo_inverse(information[their, their])[0] @ common
        seen.append(np.sqrt(copied / (size @ information[own, own] @ size)))
    return float(max(seen, default=0.0))


def test_effects_that_act_alike_in_most_driving_say_so(start: Model, truth: Model) -> None:
    boards = []
    for seed, manoeuvre in enumerate(DRIVES):
        log = drive(truth, manoeuvre, seed=seed, rate_hz=50.0)
        fit = identify(start, log, starts=1)
        boards.append(score_board(fit, fit.driving, catalogue()))
    silent = []
    for one, other in combinations(catalogue(), 2):
        shown = [b for b in boards if {one.id, other.id} <= b.places.keys()]
        # What moves other channels is told by these, however the tyres make up for it.
        if not shown or one.is_like(other) or not one.moved & other.moved:
            continue
        if np.median([likeness(b, one.id, other.id) for b in shown]) > ALIKE:
            silent.append((one.id, other.id))
    assert silent == []


def test_a_split_of_the_drive_force_and_its_yaw_moment_name_each_other() -> None:
    """A driven front axle that is steered turns the car by the drive force."""
    assert effect("force_split").is_like(effect("drive_yaw_moment"))
    for other in ("steer_lag", "steer_delay"):
        assert effect("yaw_inertia").is_like(effect(other))
