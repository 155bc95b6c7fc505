"""What is said of where a model fails, beside what the study says in short."""

from dataclasses import replace

import pytest

from sysid_vehicle import Model, Study, drive, improve, manoeuvres
from sysid_vehicle.diagnose.unexplained.ceiling import Explainable
from sysid_vehicle.study.judge.structure import Structure


@pytest.fixture(scope="module")
def adequate(start: Model, truth: Model) -> Study:
    train, test = (drive(truth, manoeuvres.lap(20.0), seed=s, rate_hz=25.0) for s in (61, 62))
    few = ["mass", "steer_lag"]
    return improve(start, train, test, candidates=few, starts=1, sensors=False)


def test_where_a_model_fails_says_no_more_than_the_summary(adequate: Study) -> None:
    """That nothing is left stood below a summary that told how much of it is explainable."""
    left = {"F_y": Explainable("F_y", 0.3, 0.2, 0.4, 50.0)}
    apart = replace(
        adequate,
        verdict="unknown",
        omnibus=replace(adequate.omnibus, p_value=0.02),
        omnibus_together=replace(adequate.omnibus, p_value=1e-9),
        structure=Structure(left, left),
    )
    apart.__dict__.update(disagreements=(), where=adequate.where, late={})
    ((_, lines),) = apart.where_lines
    assert "the test for unknown forces is not significant (p = 0.02)" in str(apart)
    assert lines[0] == "the test for unknown forces is not significant (p = 0.02)"
    ((_, lines),) = adequate.where_lines
    assert lines[0] == str(adequate.omnibus)
