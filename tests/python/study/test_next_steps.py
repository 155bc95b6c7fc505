"""What a study says, and what is to be done next."""

import random
import re
from dataclasses import replace

import numpy as np
import pytest
from contradictions import contradictions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sysid_vehicle import Model, Study, drive, identify, improve, manoeuvres
from sysid_vehicle.diagnose import Omnibus
from sysid_vehicle.diagnose.unexplained.ceiling import Explainable
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import (
    UNKNOWN,
    Added,
    ErrorChange,
    Facts,
    Share,
    grade,
    share_of,
    verdict,
)
from sysid_vehicle.study import AddedEffect
from sysid_vehicle.study.ahead.beyond import Beyond
from sysid_vehicle.study.judge.disagree import disagreements
from sysid_vehicle.study.judge.foretold import Foretold
from sysid_vehicle.study.judge.structure import Structure
from sysid_vehicle.study.limit import TOGETHER
from sysid_vehicle.study.results.next_steps import next_steps
from sysid_vehicle.study.results.sentences import ahead, in_the_end


@pytest.fixture(scope="module")
def adequate(start: Model, truth: Model) -> Study:
    train, test = (drive(truth, manoeuvres.lap(20.0), seed=s, rate_hz=50.0) for s in (61, 62))
    few = ["mass", "steer_lag"]
    return improve(start, train, test, candidates=few, starts=1, sensors=False)


@pytest.fixture(scope="module")
def unknown(start: Model, truth: Model) -> Study:
    """Nothing in the catalogue that may be tried turns the yaw rate by a constant."""
    biased = truth.add("gyro_bias").with_values({"gyro_bias.bias_radps": 0.02})
    train, test = (drive(biased, manoeuvres.lap(20.0), seed=s, rate_hz=50.0) for s in (63, 64))
    few = ["mass", "aero_drag"]
    return improve(start, train, test, candidates=few, starts=1, sensors=False)


def test_a_model_that_may_be_used_asks_for_nothing(adequate: Study) -> None:
    assert adequate.verdict == "adequate"
    assert adequate.next_steps == ()
    assert "Next:" not in str(adequate)


def test_what_shares_leave_out_is_said(unknown: Study) -> None:
    """Beyond the slip angles that were fitted, tyres are extrapolated."""
    for share, within, said in ((0.4, 0.7, True), (-0.1, 0.7, True), (0.4, 1.0, False)):
        found = Beyond((1.0, 1.0 - share), share, share - 0.05, share + 0.05, within)
        study = replace(unknown, explained=found)
        assert ("no larger than fitted, 70 % of the validation data" in in_the_end(study)) == said
        assert any("slip angles as large as" in text for text in next_steps(study)) == said
        assert study.to_dict()["explained"]["within_fitted_range"] == within


def test_what_no_effect_explains_is_to_be_looked_at(unknown: Study) -> None:
    assert unknown.verdict == "unknown"
    said = " ".join(unknown.next_steps)
    assert "define an effect" in said
    assert "sysid-vehicle check" in said
    assert "fx_n" not in said  # it is logged
    assert "--nuisances" in said
    offsets = replace(unknown.fit, model=unknown.model.with_nuisances())
    assert not any("--nuisances" in t for t in next_steps(replace(unknown, fits=(offsets,))))
    assert str(unknown).count("Next: ") == len(unknown.next_steps)
    assert unknown.to_dict()["next_steps"] == list(unknown.next_steps)
    assert "<li>Next: " in unknown._repr_html_()


def test_intervals_count_what_is_missing(adequate: Study, unknown: Study) -> None:
    both = zip(unknown.estimates, (*unknown.fit.estimates, *unknown.fit.derived), strict=True)
    ratios = [wide.std / e.std for wide, e in both if not e.note]
    assert min(ratios) >= 1.0
    assert max(ratios) > 1.2
    shown = unknown.to_dict()["parameters"]
    assert {n: e["std"] for n, e in shown.items()} == {e.name: e.std for e in unknown.estimates}
    told = "Intervals of parameters"
    assert str(unknown).count(told) == 1
    late = replace(unknown, widened=None)
    assert "too short" in late.in_the_end
    assert late.estimates == (*unknown.fit.estimates, *unknown.fit.derived)
    assert adequate.widened is None
    assert told not in str(adequate)


def test_what_predicts_better_some_seconds_ahead_is_to_be_used(unknown: Study) -> None:
    found = replace(unknown)
    assert unknown.predicting is not None
    falls, same = (ErrorChange("vy_mps", 2.0, log_ratio, 0.05) for log_ratio in (-0.5, 0.0))
    for needed, use in (((falls,), "final"), ((same,), "baseline")):
        found.__dict__["predicting"] = replace(unknown.predicting, better=(falls,), needed=needed)
        assert any(f"use `study.predicting.{use}`" in text for text in next_steps(found))


def test_errors_are_told_in_units_and_small_ones_as_such(adequate: Study, unknown: Study) -> None:
    assert "Median error 2 s ahead where the car turns, on validation data: v_y 0.0" in str(
        adequate
    )
    assert "rad/s, a_y 0.0" in adequate._repr_html_()
    # With two models both are told, and a car that is lost is called so.
    errors = unknown.horizons
    lost = errors.error.repeat(2, axis=0)
    lost[1, 2, errors.channels.index("vy_mps")] = np.inf
    two = replace(unknown, fits=unknown.fits * 2)
    two.__dict__["horizons"] = replace(errors, error=lost, steps=("baseline", "final"))
    assert "-> lost m/s, yaw rate 0.0" in ahead(two)
    # What is left may be too small for its user to look for.
    assert any("--matters" in text for text in next_steps(replace(adequate, verdict="unknown")))
    assert unknown.sufficient is None
    assert not any("--matters" in text for text in unknown.next_steps)
    # That of the baseline: no name stands, whatever the final model does.
    good, poor = adequate.fit, unknown.fit
    small = replace(adequate, verdict="unknown", fits=(good, poor))
    assert small.sufficient is good
    assert any("use the baseline as it is: with" in text for text in next_steps(small))
    small.__dict__["sufficient"] = poor
    (said,) = (text for text in next_steps(small) if "--matters" in text)
    assert "use the baseline fitted to predictions (`study.sufficient`): with" in said
    assert replace(unknown, fits=(poor, good)).sufficient is None


def test_a_search_that_was_cut_short_is_to_go_on(unknown: Study) -> None:
    cut = replace(unknown, stopped=("mass", "steer_lag"), checked=True)
    said = next_steps(cut)
    assert said[0] == "raise the time limit: mass, steer_lag were not tried"
    one = next_steps(replace(cut, stopped=("mass",)))
    assert one[0] == "raise the time limit: mass was not tried"
    assert not any("check the sensors" in text for text in said)
    pairs = replace(cut, stopped=(), added=(), late_facts=(TOGETHER,))
    assert next_steps(pairs)[0].startswith("raise the time limit: effects that hold only together")
    assert "no single effect of the catalogue explains it, and the time limit" in pairs.meaning


def test_only_what_the_driving_leaves_open_asks_for_harder_driving(unknown: Study) -> None:
    first, second, *others = unknown.fit.estimates
    notes = (replace(first, note="not determined"), replace(second, note="at bound"))
    rest = tuple(replace(e, note="") for e in others)
    fit = replace(unknown.fit, estimates=(*notes, *rest))
    (said,) = (t for t in next_steps(replace(unknown, fits=(fit,))) if "limit of the tyres" in t)
    assert first.name in said
    assert second.name not in said


def test_drives_that_tell_another_car_are_said_to(unknown: Study, truth: Model) -> None:
    gripping = truth.with_values({"B_front": 1.4 * truth.value("B_front")})
    other = Driving.of(drive(gripping, manoeuvres.lap(20.0), seed=65, rate_hz=50.0))
    found = replace(unknown, validation=other)
    first = found.disagreements[0]
    assert first.train.name == "cornering stiffness front"
    assert 1.2 < first.validation.value / first.train.value < 1.6
    (said,) = (t for t in found.next_steps if "differs between the drives" in t)
    assert str(first) in said
    assert found.to_dict()["disagreements"][0]["standard_errors_apart"] > found.rules.sure
    assert replace(found, verdict="adequate").disagreements == ()


def test_drives_of_one_car_agree(adequate: Study, truth: Model) -> None:
    for seed in (66, 67, 68):
        other = Driving.of(drive(truth, manoeuvres.handling_course(20.0), seed=seed, rate_hz=50.0))
        assert disagreements(adequate.fit, other) == ()


def test_offsets_that_differ_from_log_to_log_are_no_disagreement(truth: Model) -> None:
    name, biased = "accelerometer_bias.ay_mps2", truth.add("accelerometer_bias")
    cars = (biased.with_values({name: bias}) for bias in (0.25, -0.25))
    logs = [drive(car, manoeuvres.lap(20.0), seed=69, rate_hz=50.0) for car in cars]
    fit = identify(truth.with_nuisances(), logs[0], starts=1)
    assert fit[name].value > 0.2
    assert disagreements(fit, Driving.of(logs[1])) == ()


def test_which_of_two_stand_ins_it_is_is_no_question(unknown: Study) -> None:
    alike = AddedEffect("aero_drag", (), 2.0, 1.0, 1e-9, ("head_wind",), "not with one value")
    unsure = next_steps(replace(unknown, added=(replace(alike, grade="plausible"),)))
    sure = next_steps(replace(unknown, added=(replace(alike, grade="alias"),)))
    assert any("separate aero_drag from head_wind" in step for step in unsure)
    assert not any("separate aero_drag from head_wind" in step for step in sure)


def test_what_is_confounded_is_to_be_told_apart(unknown: Study) -> None:
    drag = AddedEffect("aero_drag", (), 2.0, 1.0, 1e-9, confounded_with=("head_wind",))
    proxy = AddedEffect("mass", (), 2.0, 1.0, 1e-9, stands_in="it is not constant")
    first, second, *_ = next_steps(replace(unknown, added=(drag, proxy)))
    asked = "`sysid-vehicle next-drive --between aero_drag,head_wind`"
    assert first.startswith(f"separate aero_drag from head_wind: {asked}")
    assert "sv.next_drive(study)" in first
    assert second.startswith("do not take the size of mass as a property of the car")


def test_what_no_name_stands_for_is_told_with_shares_and_a_drive(unknown: Study) -> None:
    """Together they take most of the error; which of them are in the car nobody knows."""
    shares = Share(0.3, -0.1, 0.5), Share(0.4, 0.2, 0.6)
    lag, wind, ratio = (
        AddedEffect(e, (), 2.0, 1.0, 1e-9, (), "it has no share", grade, own=own)
        for e, grade, own in (
            ("steer_lag", "plausible", shares[0]),
            ("side_wind", "alias", shares[1]),
            ("steer_ratio", "plausible", UNKNOWN),
        )
    )
    richer = replace(unknown.fit, model=unknown.model.add("steer_lag", "side_wind", "steer_ratio"))
    found = replace(
        unknown,
        added=(lag, wind, ratio),
        fits=(unknown.fit, richer),
        explained=Beyond((1.0, 0.2), 0.8, 0.6, 0.9),
    )
    names = "steer_lag and side_wind and steer_ratio"
    assert f"{names} together explain 80 % (60 to 90) of the error 1 to 5 s" in found.meaning
    assert "steer_lag explains 80 %" in replace(found, added=(lag,)).meaning
    assert "ahead, where it changes predictions: 30 % (-10 to 50) on validation" in str(lag)
    assert "own share" not in str(ratio)
    assert lag.to_dict()["own_share"]["low"] == -0.1
    said = next_steps(found)
    assert any("for prediction use the final model" in text for text in said)
    # What is no stand-in for sure is to be shown by driving, if it may take a share.
    (drive_it,) = (text for text in said if "to find out whether" in text)
    assert "the car has steer_lag, record driving that excites it (fast sweeps" in drive_it
    assert not any("validate with longer driving" in text for text in said)
    short = replace(found, validation=Driving.of(unknown.validation.logs[0].between(0.0, 4.0)))
    assert any("20 s or more: 4 s hardly show" in text for text in next_steps(short))
    seen, unseen = (Omnibus(t, 9, p, "M_z") for t, p in ((900.0, 1e-60), (9.0, 0.4)))
    elsewhere = next_steps(replace(found, omnibus=unseen, omnibus_together=seen))
    assert any(
        "the remaining error hardly shows in the training data" in text for text in elsewhere
    )
    nothing = next_steps(replace(found, explained=Beyond((1.0, 0.9), 0.1, -0.1, 0.3)))
    assert not any("for prediction use" in text for text in nothing)


def test_a_fall_that_other_parameters_of_the_baseline_take_is_told_so(unknown: Study) -> None:
    """Printed errors are those of models as fitted, shares those of parameters that fit best."""
    bent = unknown.model.with_values({"B_front": 0.5 * unknown.model.value("B_front")})
    lag = AddedEffect("steer_lag", (), 2.0, 1.0, 1e-9)
    two = replace(unknown, added=(lag,), fits=(replace(unknown.fit, model=bent), unknown.fit))
    little = in_the_end(replace(two, explained=Beyond((1.0, 0.9), 0.1, -0.1, 0.3)))
    assert re.search(r"squared lateral errors fall by \d\d %", little)
    assert "as the two were fitted" not in in_the_end(
        replace(two, explained=Beyond((1.0, 0.1), 0.9, 0.8, 1.0))
    )


def test_the_share_of_a_stand_in_is_not_that_of_the_names(unknown: Study) -> None:
    lag = AddedEffect("steer_lag", (), 2.0, 1.0, 1e-9)
    wind = AddedEffect("side_wind", (), 2.0, 1.0, 1e-9, stands_in="it is not constant")
    richer = replace(unknown.fit, model=unknown.model.add("steer_lag", "side_wind"))
    found = replace(
        unknown,
        verdict="partly_explained",
        fits=(unknown.fit, richer),
        explained=Beyond((1.0, 0.2), 0.8, 0.6, 0.9),
    )
    whole = replace(unknown.shares, whole=Share(0.9, 0.8, 1.0), named=("steer_lag",))

    def said(*added: AddedEffect) -> str:
        study = replace(found, added=added)
        study.__dict__["shares"] = whole
        return in_the_end(study)

    assert "The effects named explain 90 % (80 to 100) of what any function" in said(lag)
    assert "The effects added explain 90 % (80 to 100) of what any function" in said(lag, wind)


P = (1e-60, 1e-7, 5e-5, 5e-4, 0.004, 0.02, 0.07, 0.6)
SQUARES = (0.0, 0.05, 0.5, 1.0, 3.0)
EFFECTS = ("tyre_load_sensitivity", "steer_lag")
FINDINGS = ("missing", "one of a group", "negligible", "proxy")


def drawn_test(rng: random.Random) -> Omnibus:
    return Omnibus(rng.choice((9.0, 30.0, 900.0)), 9, rng.choice(P), "M_z")


def own_share(rng: random.Random) -> Share:
    """Shown to be large or not, of nothing, or not asked for."""
    value = rng.choice((-0.4, 0.02, 0.2, 0.8, float("nan")))
    by = rng.choice((0.01, 0.15, 0.5))
    return Share(value, value - by, value + by)


def said(base: Study, rng: random.Random) -> str:
    """What a study prints that measured something, and what is decided on it."""
    added = tuple(
        Added(
            e,
            finding := rng.choice(FINDINGS),
            ("mass",) if finding == "one of a group" else (),
            frozenset({rng.choice(("yaw_rate_radps", "ay_mps2", "vx_mps"))}),
            own_share(rng),
            own_share(rng),
            sure=rng.random() < 0.5,
            against=rng.choice(("", "", "it is too small to matter")),
        )
        for e in EFFECTS[: rng.randrange(3)]
    )
    low, high = (rng.choice((-0.5, 0.05, 0.3, 0.9)) for _ in range(2))
    told = [
        {"error of v_y 1 s ahead": Explainable("", x + 0.05, x, x + 0.1, 1.0)} for x in (low, high)
    ]
    structure = Structure(*told)
    validation = drawn_test(rng)
    expected = rng.choice((None, Foretold(1.0, 0.5), Foretold(4.0, 1e-9)))
    slow = rng.choice(((), (), ("force of 113 N sideways", "moment of 90 N m")))
    candidates = rng.choice(P), rng.choice(P)
    missing = (rng.choice(SQUARES), rng.choice(SQUARES)) if added else (0.0, 0.0)
    share = share_of(*missing)
    unrelated = {"ay_mps2": "ay_mps2 is turned round"} if rng.random() < 0.2 else {}
    facts = Facts(
        drawn_test(rng),
        validation,
        min(candidates),
        missing,
        share - 0.1,
        added,
        tuple(unrelated.values()),
        excited=rng.random() < 0.8,
        structure=structure.anywhere,
        small=rng.random() < 0.5,
        buried=rng.random() < 0.3,
        unforeseen=expected is not None and expected.unforeseen,
        slow=slow,
    )
    decision = verdict(facts)
    gone = {e: w.because for w in decision.withdrawn for e in w.effects}
    names = [a.id for a in added]
    fits = [base.fits[0]]
    for name in names:
        fits.append(replace(base.fits[0], model=fits[-1].model.add(name)))
    own = tuple(
        AddedEffect(
            a.id,
            (),
            2.0,
            1.0,
            1e-9,
            a.group,
            because := "it acts alike" if a.finding == "proxy" else gone.get(a.id, ""),
            grade(a.finding, "proxy" if because else a.finding, much_left=decision.much_left),
            own=a.own,
            own_in_training=a.own_in_training,
        )
        for a in added
    )
    last = base.diagnoses[-1]
    ranking = [replace(last.ranking[0], p_value=p, fit=None) for p in candidates]
    study = replace(
        base,
        verdict=decision.verdict,
        fits=tuple(fits),
        train=tuple(replace(base.train[-1], unrelated=unrelated) for _ in fits),
        test=tuple(base.test[-1] for _ in fits),
        diagnoses=(replace(last, ranking=tuple(ranking)),),
        omnibus=facts.fitted,
        omnibus_together=validation,
        added=own,
        explained=Beyond(missing, share, share - 0.1, min(share + 0.1, 1.0)) if added else None,
        structure=structure,
        foretold=expected,
        slow=slow,
        matters=rng.choice((None, {"vy_mps": 0.1})),
        buried=facts.buried,
        stopped=("mass",) if rng.random() < 0.3 and min(candidates) < 0.01 else (),
        late_facts=(TOGETHER,) if rng.random() < 0.2 and min(candidates) < 0.01 else (),
    )
    whole = rng.choice((-0.4, 0.02, 0.95, np.nan))
    study.__dict__.update(disagreements=(), predicting=base.predicting)
    study.__dict__["shares"] = replace(
        base.shares, whole=Share(whole, whole - 0.1, whole + 0.1), named=tuple(names)
    )
    return str(study)


@settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 2**32 - 1))
def test_nothing_that_a_study_says_contradicts_another_statement(
    adequate: Study, seed: int
) -> None:
    text = said(adequate, random.Random(seed))
    assert contradictions(text) == [], text
