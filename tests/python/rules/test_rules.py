"""The rules by which effects are claimed see numbers only, and are all in one place."""

import ast
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, Rules
from sysid_vehicle.rules import (
    USUAL,
    ErrorChange,
    Gain,
    Measures,
    accept,
    bic,
    worse,
)

PACKAGE = Path(__file__).resolve().parents[3] / "python" / "sysid_vehicle"

# Constants of numerical methods and of effort: how finely, how long, how often. They decide no
# claim. Those of the last group shape how what no name fits is described; no effect is claimed.
NUMERICAL = {
    "diagnose/change/beside_unknown.py": {  # where noise begins to be learned, and for how long
        "_MOST", "_ROUNDS", "_TINY", "_TIME_S", "_ROAD", "_COLOUR",
    },
    "diagnose/change/beside_reference.py": {"_RIDGE"},
    "diagnose/changed.py": {"_LACKS", "_ASKED", "_ROUNDS"},  # rounds, and a share of time
    "diagnose/change/changes_compete.py": {"_SINGULAR", "_MOST"},
    "diagnose/change/both_axles.py": {"_USUAL"},  # prior sizes of changes
    "diagnose/change/may_change.py": {"_INERTIA", "_LARGEST_SLIP_RAD", "_PARTS"},
    "diagnose/change/maximum.py": {
        *("_ENOUGH", "_HOPELESS", "_REFREEZES", "_ROUGH", "_STEPS", "_WALKS"),
    },
    "diagnose/change/pieces.py": {"_OUTERMOST", "_PIECES", "_POINTS"},
    "diagnose/change/reference.py": {"_FOLLOWED", "_LOOSE", "_VAGUE"},
    "diagnose/change/search.py": {"_BESIDE", "_CLOSE", "_ROUNDS", "_TRIED"},
    "diagnose/change/together.py": {"_FAR", "_SHARES"},
    "diagnose/candidates/constancy.py": {"_PIECE_S", "_MOST_PIECES"},
    "diagnose/evidence/coordinates.py": {"BLOCK_S", "_MOVED"},
    "diagnose/diagnose.py": {"REFITS"},
    "diagnose/candidates/on_the_level.py": {"_MOST", "_NEAR"},  # what is refitted
    "diagnose/candidates/refitting.py": {
        "_HOPELESS", "_HOPELESS_WITH_STATES", "_NEAR", "_RIVALS",
    },
    "diagnose/evidence/directions.py": {"_ROWS"},
    "diagnose/evidence/evidence.py": {"HELD", "_AT_ONCE"},
    "diagnose/experiment/information.py": {"COPIED"},
    "diagnose/candidates/instead.py": {"_MEMORIES_S", "_SHAPES_REMEMBERED"},
    "diagnose/candidates/possible.py": {"_AT_BOUND"},
    "diagnose/candidates/posterior.py": {"_KEPT", "_LEAST"},
    "diagnose/candidates/widened.py": {"_FELT", "_ROUNDS", "_SETTLED"},
    "diagnose/unexplained/omnibus.py": {
        "LEAST_LEFT", "_FEW_SHAPES", "_FORCE_SHAPES", "_FORESEEN_S",
    },
    "diagnose/evidence/projection.py": {"COPIED", "_SINGULAR", "_LAGS", "_ROWS", "_TERMS"},
    "diagnose/experiment/replay.py": {
        "_RATE_HZ", "_WINDOW_S", "_LOOKS", "_ROUNDS", "_BENDS", "_AS_GOOD",
    },
    "diagnose/candidates/refits.py": {"_BEYOND"},
    "diagnose/candidates/score.py": {"_BLOCK_S", "_DRAWN", "_FEWEST_BLOCKS"},
    "diagnose/evidence/sensitivity.py": {"_AT_ONCE", "_BOUNDED", "_SHARES"},
    "diagnose/candidates/single_effects.py": {"_ROUNDS", "_SETTLED", "_EXTENDED"},
    "study/validation.py": {"AHEAD", "AHEAD_S", "_SHARE", "_PIECE_S", "_FEWEST_PIECES", "_TRIMMED"},
    "study/ahead/horizons.py": {"AHEAD", "_FEWEST", "_APART", "LOST"},
    "study/ahead/beyond.py": {"_DRAWS"},
    "study/judge/foretold.py": {"_BLOCK_S", "_FEWEST_BLOCKS"},
    "study/limit.py": {"_BASELINE", "_SEARCHED", "_SENSORS", "_STEP"},
    "study/results/hidden.py": {"_MOST", "_SAMPLES"},
    "study/results/next_steps.py": {"SHORT_S", "_SHOWN", "_ASKED"},
    "study/ahead/shares.py": {
        "AHEAD", "_LEAST_APART_S", "_APART", "_DRAWS", "_LONG_S", "_FEW",
        "_VISIBLE", "_LOST", "_LEAST", "_QUANTILES",
    },
    "study/judge/slow.py": {"_AT_LONGEST"},
    "study/search/search.py": {"_UNSEEN"},
    "study/search/steps.py": {"ALTERNATIVES"},
    "study/judge/structure.py": {"_AHEAD_S", "_APART", "_FEW"},
    "study/search/together.py": {"_LEAST", "_SUBSETS"},
    # Descriptions of the unknown, of biases, and of the next drive.
    "diagnose/unexplained/ceiling.py": {
        "_RATE_HZ", "_LAGS_S", "_FOLDS", "_DRAWS", "_UNDERSTEER_MPS", "_REACH",
    },
    "study/results/predicting.py": {"_WORTH"},
    "diagnose/unexplained/change_directions.py": {"_BLEND_S", "_SMALL"},
    "diagnose/unexplained/change_points.py": {
        "_STEP_S", "_MOST_STEPS", "_LEAST_S", "_INTERVAL", "_NEAR_S", "_FINE", "_MOST",
        "_TOGETHER_S", "_FEWER", "_HOPELESS",
    },
    "diagnose/unexplained/coherence.py": {"_WINDOW_S", "_LEVEL"},
    "diagnose/candidates/confirm.py": {"_HOPELESS"},
    "diagnose/unexplained/delay.py": {
        "HIGHEST_HZ", "_BANDS", "_LOWEST_HZ", "_SMALL", "_ROUNDS", "_LONGER", "_DRAWS",
        "_NOTABLE", "_TINY_RAD",
    },
    "diagnose/unexplained/force_map.py": {
        "_CELLS", "_CELLS_ALONE", "_FEWEST", "_FOLDS", "_LONGEST_S",
    },
    "diagnose/experiment/hiding.py": {"_WORTH_TELLING", "_NEAR", "_SHARE"},
    "diagnose/experiment/limits.py": {  # what is proposed to a driver
        "_EASIER", "_SLOWER", "_LORRY_KG", "_LORRY_MPS", "_BELOW_TIPPING",
    },
    "diagnose/experiment/next_drive.py": {"_ENOUGH", "_OFTEN"},
    "diagnose/unexplained/proposals.py": {"_MOST", "_TRIED", "_ALIKE", "_RETAINED", "_VISIBLE"},
    "diagnose/unexplained/shape.py": {
        "_KNOTS", "_KNOTS_OF_PAIR", "_SIZES", "_SIZES_OF_PAIR", "_SMOOTH", "_FINE", "_DRAWS",
        "_LEVEL", "_FEWEST",
    },
    "diagnose/experiment/suggestion.py": {"_BAND", "_SLOWEST_HZ"},
    "diagnose/unexplained/where.py": {"_TELLS"},
}  # fmt: skip
_NO_LIMIT = (0, 1, -1, 2, 0.5)  # of which halves, squares and signs are made


def constants(text: str) -> Iterator[str]:
    """Names that a module binds to plain numbers."""
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign):
            continue
        for target in node.targets:
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            values = [n for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
            numbers = values and all(type(v.value) in (int, float) for v in values)
            called = any(isinstance(n, ast.Call | ast.Subscript) for n in ast.walk(node.value))
            if numbers and not called:
                yield from (n.id for n in names if isinstance(n, ast.Name) and n.id.isupper())


def compared_numbers(text: str) -> Iterator[tuple[int, float]]:
    """Line and number wherever something is compared with a number that is no trivial one."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Compare):
            for part in (node.left, *node.comparators):
                for n in ast.walk(part):
                    if (
                        isinstance(n, ast.Constant)
                        and type(n.value) in (int, float)
                        and n.value not in _NO_LIMIT
                    ):
                        yield node.lineno, float(n.value)


def test_no_limit_that_decides_a_claim_stands_elsewhere() -> None:
    found = {
        str(path.relative_to(PACKAGE)): set(constants(path.read_text("utf-8")))
        for folder in ("study", "diagnose")
        for path in (PACKAGE / folder).rglob("*.py")
    }
    new = {path: names - NUMERICAL.get(path, set()) for path, names in found.items()}
    assert {p: n for p, n in new.items() if n} == {}, "a limit belongs into rules/limits.py"
    gone = {path: names - found.get(path, set()) for path, names in NUMERICAL.items()}
    assert {p: n for p, n in gone.items() if n} == {}, "no longer there"


def test_deciding_files_compare_with_no_number_of_their_own() -> None:
    deciding = [f"study/search/{n}.py" for n in ("steps", "together", "search")]
    deciding += ["study/judge/verdict.py", "study/judge/judge.py"]
    deciding += [
        f"diagnose/candidates/{n}.py" for n in ("reservation", "verdicts", "constancy", "possible")
    ]
    deciding += ["rules/accept.py", "rules/standing.py", "rules/verdict.py"]
    found = {p: list(compared_numbers((PACKAGE / p).read_text("utf-8"))) for p in deciding}
    assert {p: n for p, n in found.items() if n} == {}


def test_the_checks_see_constants_and_comparisons() -> None:
    text = "_A = 0.3\n_B, _C = 1.0, 2\n_D = 'x'\n_E = {1: 'y'}\nF = 3.0\n_G = f(3.0)\nx = y > 0.7"
    assert set(constants(text)) == {"_A", "_B", "_C", "F"}
    assert list(compared_numbers(text)) == [(7, 0.7)]


def test_every_limit_says_what_it_is_and_what_chose_it() -> None:
    told = USUAL.to_dict()
    assert set(told) == {f.name for f in fields(Rules)}
    for t in told.values():
        assert t["unit"]
        assert t["meaning"]
        assert t["chosen_by"].startswith(("benchmarks/", "convention", "numerical"))
    assert all(name in str(USUAL) for name in told)
    assert USUAL.at(None) is USUAL
    assert USUAL.at(0.01).alpha == 0.01


def test_few_limits_are_tuned() -> None:
    tuned = [n for n, t in USUAL.to_dict().items() if t["chosen_by"].startswith("benchmarks/")]
    assert len(tuned) < 8, tuned


@pytest.mark.parametrize(
    ("limit", "value", "words"),
    [
        ("alpha", 0.0, "alpha = 0.0: give a number between 0 and 1"),
        ("most", 1.5, "most = 1.5: give a number between 0 and 1"),
        ("sure", float("nan"), "sure = nan: give a number above 0, finite"),
        ("lean", float("inf"), "lean = inf: give a number above 0, finite"),
        ("price", "2", "price = '2': give a number above 0, finite"),
    ],
)
def test_limits_that_mean_nothing_are_refused(limit: str, value: float, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        replace(USUAL, **{limit: value})  # type: ignore[arg-type]


def test_bic() -> None:
    assert bic(-100.0, 3, 1000) == pytest.approx(-100.0 - 1.5 * np.log(1000.0))


def gain(value: float, error: float = 30.0) -> Gain:
    return Gain(value, error, value, error)


@pytest.mark.parametrize(
    ("same", "own", "fall", "holds"),
    [
        ((90.0, 30.0), (90.0, 30.0), (9.0, 30.0), True),
        # The error by the noise floor may not be shown to fall where the likelihood is sure,
        ((90.0, 30.0), (90.0, 30.0), (-9.0, 30.0), True),
        # and weighs the channels as no rough road would: alone it refuses nothing,
        ((90.0, 30.0), (90.0, 30.0), (-90.0, 30.0), True),
        # and both noises have to be sure.
        ((40.0, 30.0), (90.0, 30.0), (-9.0, 30.0), False),
        ((90.0, 30.0), (40.0, 30.0), (-9.0, 30.0), False),
        # Noise of its own may be too sure, which the others know better,
        ((90.0, 30.0), (-9.0, 30.0), (90.0, 30.0), True),
        ((40.0, 30.0), (-9.0, 30.0), (40.0, 30.0), True),
        # even where it speaks against it.
        ((90.0, 30.0), (-90.0, 30.0), (90.0, 30.0), True),
        # Large noise of the poorer model hides the gain: where the error falls the others do,
        ((9.0, 30.0), (40.0, 30.0), (40.0, 30.0), True),
        ((-9.0, 30.0), (40.0, 30.0), (40.0, 30.0), True),
        ((-90.0, 30.0), (40.0, 30.0), (40.0, 30.0), True),
        # One alone does not.
        ((9.0, 30.0), (90.0, 30.0), (9.0, 30.0), False),
        ((90.0, 30.0), (9.0, 30.0), (9.0, 30.0), False),
        ((9.0, 30.0), (9.0, 30.0), (90.0, 30.0), False),
    ],
)
def test_what_validation_data_confirm(
    same: tuple[float, float], own: tuple[float, float], fall: tuple[float, float], *, holds: bool
) -> None:
    found = Measures(gain(*same), gain(*own), gain(*fall), plausible=True, as_sure=False)
    assert accept(found) is holds
    # Predictions some seconds ahead have a veto.
    assert not accept(replace(found, changes=(ErrorChange("vy_mps", 2.0, 0.2, 0.05),)))
    # What only acts like something is worth having where the error falls.
    assert accept(replace(found, plausible=False)) is (holds and fall[0] > 0.0)


def test_where_errors_ahead_lean_to_growing_measures_must_show_more() -> None:
    """They are unsure in few blocks, and no veto; the error of a step alone is no excuse then."""
    faint = Measures(gain(40.0), gain(40.0), gain(40.0), plausible=True, as_sure=False)
    unsure = [ErrorChange("yaw_rate_radps", h, g, 0.2) for h, g in ((1.0, 0.18), (2.0, 0.1))]
    assert worse(unsure) == ()
    for little in (-0.1, 0.04):
        assert accept(replace(faint, changes=tuple(replace(c, log_ratio=little) for c in unsure)))
    assert not accept(replace(faint, changes=tuple(unsure)))
    assert accept(replace(faint, changes=tuple(unsure), gain=gain(90.0), fall=gain(90.0)))
    # What one channel loses another may gain.
    falls = (ErrorChange("vy_mps", 1.0, -0.4, 0.2), ErrorChange("vy_mps", 2.0, -0.3, 0.2))
    assert accept(replace(faint, changes=(*unsure, *falls)))


def test_the_likelihood_has_the_last_word_where_noise_did_not_grow() -> None:
    found = Measures(gain(-90.0), gain(150.0), gain(-90.0), plausible=True, as_sure=True)
    assert accept(found)
    assert not accept(replace(found, changes=(ErrorChange("ay_mps2", 5.0, 0.2, 0.05),)))
    assert not accept(replace(found, own_gain=gain(90.0)))
    assert accept(replace(found, own_gain=gain(90.0)), replace(USUAL, sure=2.0))
    assert not accept(replace(found, plausible=False))
    assert not accept(replace(found, as_sure=False))


def test_one_spin_neither_confirms_nor_refuses() -> None:
    """In one piece of the driving the sums are a million times those of the others."""
    spin = Gain(-77e6, 77e6, 150.0, 30.0)
    found = Measures(spin, spin, spin, plausible=True, as_sure=False)
    assert accept(found)
    assert not accept(replace(found, plausible=False))  # the error itself is not shown to fall
    nothing = replace(spin, typical=-20.0)
    assert not accept(replace(found, gain=nothing, own_gain=nothing))


def test_what_grows_clearly_and_by_more_than_matters() -> None:
    grown = ErrorChange("vy_mps", 2.0, 0.10, 0.02)
    assert worse((grown,)) == (grown,)
    assert worse((replace(grown, error=0.11),)) == ()
    # Errors of v_y 2 s ahead that grow by 15 %, by two standard errors: none that is kept.
    assert worse((ErrorChange("vy_mps", 2.0, float(np.log(1.15)), 0.068),))
    assert worse((replace(grown, log_ratio=0.03, error=0.001),)) == ()
    assert worse((replace(grown, log_ratio=-0.5),)) == ()
    assert worse((grown,), replace(USUAL, worse=0.2)) == ()


def test_of_several_channels_one_grows_by_chance() -> None:
    channels = ("vx_mps", "ax_mps2", "vy_mps", "yaw_rate_radps", "ay_mps2")
    found = [ErrorChange(c, h, -0.03, 0.04) for h in (5.0, 1.0, 2.0) for c in channels]
    found[2] = replace(found[2], log_ratio=2.4 * found[2].error)
    assert worse([c for c in found if c.channel == "vy_mps"]) == (found[2],)
    assert worse(found) == ()
    found[2] = replace(found[2], log_ratio=2.7 * found[2].error)
    assert worse(found) == (found[2],)


def test_what_a_channel_leans_to_at_all_its_horizons_has_grown() -> None:
    leaning = [
        ErrorChange("vy_mps", h, g, 0.08) for h, g in ((1.0, 0.10), (2.0, 0.13), (5.0, 0.04))
    ]
    assert worse(leaning) == tuple(leaning[:2])
    # One horizon of a channel whose errors do not grow on the whole is chance.
    assert worse([*leaning[:1], replace(leaning[1], log_ratio=-0.1), leaning[2]]) == ()
    elsewhere = [replace(c, channel="yaw_rate_radps", log_ratio=-0.5) for c in leaning]
    assert worse([*leaning, *elsewhere]) == tuple(leaning[:2])


def test_what_follows_from_a_limit_is_none_of_its_own() -> None:
    assert USUAL.interval == pytest.approx(1.96, abs=1e-3)
    assert USUAL.bound == pytest.approx(1.645, abs=1e-3)
    assert replace(USUAL, credible=0.99).interval == pytest.approx(2.576, abs=1e-3)
    with pytest.raises(InvalidInput, match=r"credible = 1\.0"):
        replace(USUAL, credible=1.0)
    # Two-sided quantiles of the normal distribution, and half the square of a one-sided one.
    assert USUAL.insignificant == pytest.approx(2.575829)
    assert replace(USUAL, level=0.05).insignificant == pytest.approx(1.959964)
    assert USUAL.apart == pytest.approx(0.5 * 3.090232**2)
    assert replace(USUAL, strict=0.0227501319).apart == pytest.approx(2.0)
    assert USUAL.explainable == USUAL.taken == pytest.approx(1.0 - USUAL.most)
    assert len(fields(Rules)) == len(USUAL.to_dict()) == 15
