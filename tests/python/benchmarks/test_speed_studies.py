"""The trials that the benchmark of studies draws can be driven."""

from types import SimpleNamespace

import sysid_vehicle as sv

BENCHMARK = ("speed", "studies")


def test_what_is_drawn_are_single_manoeuvres_of_a_minute(program: SimpleNamespace) -> None:
    trials = program.studies.drawn(("effect=3", "null=2"), 5)
    assert len(trials) == 5
    for trial in trials:
        drive, course = program.studies._manoeuvres(trial, 1.0)
        assert 50.0 < drive.duration_s < 66.0
        assert isinstance(course, sv.manoeuvres.Manoeuvre)
        assert course.duration_s == 30.0
