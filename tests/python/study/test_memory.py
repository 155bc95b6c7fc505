"""What a study remembers of its fits is let go of when the next one begins."""

import gc
import weakref

from sysid_vehicle import Model, Study, drive, improve, manoeuvres


def studied(truth: Model, start: Model, seed: int) -> Study:
    train = drive(truth, manoeuvres.lap(25.0), seed=seed, rate_hz=25.0)
    test = drive(truth, manoeuvres.handling_course(22.0), seed=seed + 1, rate_hz=25.0)
    return improve(start, train, test, candidates=("aero_drag",), sensors=False, starts=1)


def test_many_studies_one_after_the_other_keep_no_fits(truth: Model, start: Model) -> None:
    first = studied(truth, start, 1)
    fit = weakref.ref(first.fit)
    del first
    second = studied(truth, start, 3)
    gc.collect()
    assert fit() is None
    assert second.verdict == "adequate"
