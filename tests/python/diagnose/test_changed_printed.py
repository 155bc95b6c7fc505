"""What is named, printed and kept of what changed: sizes, and what would have been seen."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_drives import OFFSET, inside, later
from contradictions import contradictions_of_changes

from sysid_vehicle import (
    Change,
    Fit,
    Log,
    Model,
    RoadDisturbance,
    changed,
    drive,
    identify,
    load,
    manoeuvres,
)
from sysid_vehicle._common.text import number
from sysid_vehicle.diagnose.candidates.causes import CredibleSet
from sysid_vehicle.diagnose.change.changes_compete import Competition
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.change.search import Search
from sysid_vehicle.diagnose.changed import _later
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL

MOVED = ("steer_ratio", "force_split", "aero_downforce")


@pytest.fixture(scope="module")
def none(fit: Fit, course: Log) -> Change:
    """Where nothing changed, though all of the catalogue may have."""
    return changed(fit, course)


@pytest.fixture(scope="module")
def sweep(truth: Model) -> Change:
    """Two gentle sweeps at one speed, between which nothing changed, on a rough road."""
    rough = RoadDisturbance(fx_n=120.0, fy_n=150.0, mz_nm=150.0, correlation_time_s=0.3)
    logs = [
        drive(
            truth,
            manoeuvres.sine_sweep(20.0, lateral_mps2=4.0),
            seed=seed,
            rate_hz=50.0,
            disturbance=rough,
        )
        for seed in (51, 52)
    ]
    return changed(identify(truth, logs[0], starts=1), logs[1], candidates=MOVED)


def test_nothing_is_named_where_nothing_changed(none: Change) -> None:
    assert none.named == ()
    assert none.unknown == ()
    assert str(none).startswith("no change is shown")
    assert none["steer_offset"].said == "unchanged"


def test_a_log_that_is_compared_with_itself_is_told(fit: Fit) -> None:
    (log,) = fit.driving.logs
    with pytest.warns(SysidWarning, match=f"{log.name} is of the reference and of the later"):
        found = changed(fit, log, candidates=["steer_offset"])
    assert found.named == ()


def test_what_changed_is_named_with_its_size(offset: Change) -> None:
    assert [e.id for e in offset.named] == ["steer_offset"]
    assert not offset.unknown
    assert inside(offset, "steer_offset", 0.006)
    assert offset["steer_offset"].std[0] < 3e-4
    assert offset["steer_ratio"].said == "unchanged"
    assert offset.after.model.value(OFFSET) == pytest.approx(0.006, abs=5e-4)
    assert offset.before.model.effects == ()


def test_what_would_be_named_is_named(truth: Model, before: Fit, offset: Change) -> None:
    """A change just as large as the drive is said to name; one that matters little is not."""
    (ratio,) = offset["steer_ratio"].least
    assert 3.0 * offset["steer_ratio"].std[0] < ratio < 0.03
    few = ("steer_offset", "steer_ratio")
    change = changed(before, later(truth, steer_ratio__ratio_error=ratio), candidates=few)
    assert [e.id for e in change.named] == ["steer_ratio"]
    matters = before.model.with_nuisances().parameters["steer_offset.offset_rad"].matters
    assert matters < offset["steer_offset"].least[0] < 2.0 * matters


def test_what_is_beyond_doubt_is_99_percent_sure(offset: Change) -> None:
    """Not all that may have changed is known to the catalogue."""
    for probability, told in ((1.0, "99 % sure"), (0.5059, "50 % sure")):
        assert replace(offset.effects[0], probability=probability).sure == told


def test_what_is_likely_and_not_shown_is_no_calm(offset: Change) -> None:
    """Two changes that act alike may both be likelier than not, and neither be shown."""
    few = (replace(e, said="not testable", probability=None) for e in offset.effects[1:])
    likely = replace(offset.effects[0], said="likely", probability=0.8)
    text = str(replace(offset, effects=(likely, *few)))
    assert "something changed, likeliest steer_offset (80 % sure)" in text
    assert "likely, but not shown: offset_rad below 0.00" in text
    assert contradictions_of_changes(text) == []
    far = replace(offset.effects[0], said="implausible", probability=0.99)
    change = replace(offset, effects=(far, *offset.effects[1:]))
    assert str(change).startswith("something changed, and what explains it is not shown: steer_off")
    assert not change.calm
    assert contradictions_of_changes(str(change)) == []
    calm = replace(likely, said="not testable", probability=None)
    text = str(replace(offset, effects=(calm,), nothing=0.7))
    assert text.startswith("no change is shown\n")
    withheld = str(replace(offset, effects=(calm,), nothing=1e-9))
    assert withheld.startswith("something changed, and no effect is sure enough to be named: that")
    small = replace(likely, said="negligible")
    assert str(replace(offset, effects=(small,))).startswith("no change is shown\n")
    assert contradictions_of_changes(text) == []


def test_what_no_effect_explains_is_printed_as_a_group(offset: Change) -> None:
    """Forces and accelerations that these drives do not tell apart."""
    along = CredibleSet(("unknown F_x", "unknown dv_x/dt"), (0.6, 0.4))
    several = offset.causes.only([*offset.causes.sets, along], {})
    first = str(replace(offset, causes=several)).split("\n", maxsplit=1)[0]
    assert first.endswith("something changed that no effect explains, in F_x or dv_x/dt")


def test_what_is_not_testable_has_no_probability(none: Change, offset: Change) -> None:
    """Nor has what is shown to be unchanged; and each says what it would take to see it."""
    for change in (offset, none):
        assert contradictions_of_changes(str(change)) == []
        for e in change.effects:
            told = e.said in ("not testable", "unchanged")
            assert (e.probability is None) is (e.sure == "") is told
            assert (e.power in e.sentence) is told
            assert change.to_dict()["effects"][e.id]["probability"] == e.probability


def test_what_is_large_and_not_named_is_not_said_to_be_too_small(offset: Change) -> None:
    """A delay of 0.055 s, `seen from 0.02 s on`: a lag explains it as well."""
    large = replace(offset.effects[0], said="not testable", probability=None)
    assert abs(large.value[0]) > large.least[0]
    assert "it is larger, and not shown beside what else may have changed" in large.sentence
    small = replace(large, value=(0.5 * large.least[0],))
    assert "larger" not in small.sentence
    assert "larger" not in offset.effects[0].power


def test_contradictions_of_a_text_are_found(offset: Change) -> None:
    rival = replace(offset.effects[1], said="not testable", probability=0.64)
    text = str(replace(offset, effects=(offset.effects[0], rival)))
    (found,) = contradictions_of_changes(text)
    assert found == f"{rival.id}: 64 % sure, and not testable"
    calm = text.replace("changed: steer_offset: ", "no change is shown: ", 1)
    assert "nothing is shown, and a row says changed" in contradictions_of_changes(calm)


def test_a_stiffness_that_would_be_seen_is_seen(truth: Model, before: Fit, offset: Change) -> None:
    """Of tyres as well; it is printed, and far below that nothing is named."""
    least = offset["tyre_front"].least_stiffness
    assert least is not None
    assert 0.002 < least < 0.1
    told = f"cornering stiffness of the front axle below {number(100.0 * least, 2)} %"
    assert told in str(offset)
    assert offset.to_dict()["effects"]["tyre_front"]["least_stiffness"] == least
    for share, named in ((least, True), (0.1 * least, False)):
        softer = later(truth, B_front=(1.0 - share) * truth.value("B_front"))
        change = changed(before, softer, candidates=("steer_ratio",))
        assert ("tyre_front" in {e.id for e in change.named}) is named


def test_of_tyres_what_is_known_is_printed(offset: Change) -> None:
    """Coefficients with errors of many times their size told nothing, in half of each row."""
    value, std, bound = (1.25, -0.2, -0.18, 0.0), (3.5, 0.7, 0.02, 9.0), (8.2, 1.6, 0.22, 17.6)
    tyre = replace(offset["tyre_front"], value=value, std=std, bound=bound)
    tyre = replace(tyre, stiffness=(-0.217, 0.0018))
    assert tyre.size == "cornering stiffness -21.7 +- 0.18 %, D_front -0.18 +- 0.02"
    assert replace(tyre, bound=(8.2, 1.6, 0.42, 17.6)).size == "cornering stiffness -21.7 +- 0.18 %"
    assert set(tyre.to_dict()["change"]) == {"B_front", "C_front", "D_front", "E_front"}


def test_more_than_all_of_a_stiffness_is_printed_as_a_number(offset: Change) -> None:
    """It was 1.5e+02 %."""
    tyre = replace(offset["tyre_front"], least_stiffness=1.517, said="not testable")
    text = str(replace(offset, effects=(offset.effects[0], tyre)))
    assert "cornering stiffness of the front axle below 152 %" in text
    assert "its cornering stiffness is seen to change from 152 % on" in text


def test_an_error_beyond_all_that_a_parameter_may_be_is_told_in_words(
    truth: Model, before: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a direction that the driving does not show it was 1e+135."""
    log = later(truth)
    search = Search(before, _later(before, Driving.of(log), None), ("steer_ratio",), USUAL)
    said = Saying(search)
    causes, (sizes, _) = said.change().causes, said._told_sizes([], said.state)
    monkeypatch.setattr(Competition, "std_along", lambda *_: 1e135)
    found = {}
    for std in (1e-3, 1e135):
        of = {n: std for m in search.may for n in m.names}
        found[std] = {
            m.id: said._of(m, causes, sizes, of, said.told, calm=True) for m in search.may
        }
    for effect in ("steer_ratio", "tyre_front"):
        known, untold = found[1e-3][effect], found[1e135][effect]
        assert np.isfinite(known.std).all()
        assert set(untold.std) == {np.inf}
        assert "not shown by this driving" in untold.size
        assert "e+" not in f"{untold.size}{untold.sentence}{untold.to_dict()}"
    assert "not shown" not in found[1e-3]["steer_ratio"].size
    json.dumps(found[1e135]["tyre_front"].to_dict(), allow_nan=False)


def test_which_driving_would_show_a_change_is_told(sweep: Change) -> None:
    """At one speed a downforce is a stiffness of both axles; who does not brake tells no split."""
    split, wing = sweep["force_split"], sweep["aero_downforce"]
    assert split.weak
    assert split.imitated_by == ()
    assert split.sentence.endswith("excited by braking and full throttle in corners")
    assert "of a usual size force_split" in str(sweep)
    assert not wing.weak
    assert wing.imitated_by[0] == "stiffness_both_axles"
    assert sweep.to_dict()["effects"]["aero_downforce"]["imitated_by"] == [*wing.imitated_by]
    text = replace(wing, said="not testable").sentence
    assert "a usual change is confounded with stiffness_both_axles" in text
    assert text.endswith("excited by the same lateral acceleration at three or more speeds")
    assert "excited by" not in replace(wing, said="unchanged").sentence
    assert not sweep["steer_ratio"].weak
    assert "excited by" not in replace(sweep["steer_ratio"], said="not testable").sentence


def test_a_change_prints_and_is_kept(offset: Change, tmp_path: Path) -> None:
    text = str(offset)
    assert text.startswith("changed: steer_offset: offset_rad +0.00")
    assert "<table>" in offset._repr_html_()
    told = offset.to_dict()["effects"]["steer_offset"]
    assert told["said"] == "changed"
    assert told["change"]["offset_rad"]["value"] == offset["steer_offset"].value[0]
    assert told["change"]["offset_rad"]["least"] == offset["steer_offset"].least[0]
    frame = offset.to_pandas()
    assert frame.loc[OFFSET, "said"] == "changed"
    offset.before.save(tmp_path / "before.npz")
    again = load(tmp_path / "before.npz")
    assert again.log_likelihood == offset.before.log_likelihood
    with pytest.raises(KeyError, match="there are steer_offset"):
        offset["no_effect"]


def test_a_load_is_told_where_mass_and_centre_of_gravity_changed(none: Change) -> None:
    """150 kg at 1.2 m behind the centre of gravity of a car that weighs more than its file says."""
    model = none.before.model.add("mass").with_values({"mass.relative_error": 0.1})
    before = model.vehicle.mass_kg * 1.1
    after = before + 150.0
    sizes = {"mass": (150.0 / before, 0.001), "cg_position": (150.0 * 1.2 / after, 0.002)}
    named = [
        replace(none[e], value=(size,), std=(std,), said="changed")
        for e, (size, std) in sizes.items()
    ]
    others = (e for e in none.effects if e.id not in sizes)
    change = replace(none, before=replace(none.before, model=model), effects=(*named, *others))
    assert change.load is not None
    assert change.load.mass_kg == pytest.approx(150.0)
    assert change.load.mass_std_kg == pytest.approx(0.001 * before)
    assert change.load.rearward_m == pytest.approx(1.2)
    more, back = sizes["mass"][0], sizes["cg_position"][0]
    # place = back (1 + more) / more, by its derivatives
    spread = np.hypot(0.002 * (1.0 + more) / more, 0.001 * back / more**2)
    assert change.load.rearward_std_m == pytest.approx(spread)
    assert "as a load of 150 +-" in str(change)
    assert "m behind the centre of gravity, would change them" in str(change)
    less = replace(change, effects=(replace(named[0], value=(-0.1,)), *change.effects[1:]))
    assert "as taking out" in str(less)
    assert "ahead of" in str(less)
    assert replace(change, effects=change.effects[1:]).load is None
