"""The study that tests of the report share: a hidden effect, found on short drives."""

import warnings
from dataclasses import replace
from functools import cache

import sysid_vehicle as sv

TRUTH = (
    sv.Model(sv.example_vehicle())
    .add("tyre_load_sensitivity")
    .with_values({"tyre_load_sensitivity.sensitivity": 0.25})
)


@cache
def reported_study() -> sv.Study:
    """The study, made once."""
    train = sv.drive(TRUTH, sv.manoeuvres.lap(30.0), seed=1, rate_hz=50.0, name="lap & <30 s>")
    test = sv.drive(TRUTH, sv.manoeuvres.handling_course(25.0), seed=2, rate_hz=50.0, name="other")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        return sv.improve(
            sv.Model(TRUTH.vehicle),
            train,
            test,
            candidates=["tyre_load_sensitivity", "steer_lag"],
            starts=2,
        )


def ended_at_once(study: sv.Study) -> sv.Study:
    """The same as if the search had found nothing."""
    return replace(
        study,
        verdict="unknown",
        fits=study.fits[:1],
        diagnoses=study.diagnoses[:1],
        train=study.train[:1],
        test=study.test[:1],
        added=(),
    )
