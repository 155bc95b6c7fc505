"""What changed since a reference: named with its size, and nothing where nothing did."""

import json
from collections.abc import Iterator
from dataclasses import replace

import changed_drives
import numpy as np
import pytest
from changed_drives import FEW, LATE, inside

from sysid_vehicle import (
    Fit,
    InvalidInput,
    Log,
    Model,
    Vehicle,
    changed,
    drive,
    identify,
    manoeuvres,
)
from sysid_vehicle._common.arrays import FloatArray
from sysid_vehicle.diagnose.change.beside_reference import Differences, Shared, Side
from sysid_vehicle.diagnose.change.both_drivings import BothDrivings
from sysid_vehicle.diagnose.change.may_change import change as change_of
from sysid_vehicle.diagnose.change.may_change import of_effect
from sysid_vehicle.diagnose.change.pieces import Pieces
from sysid_vehicle.diagnose.change.reference import Reference
from sysid_vehicle.diagnose.evidence import evidence
from sysid_vehicle.estimate import Driving

RATE_HZ = 25.0  # of drives of which no delay and nothing small is asked: it takes half as long


@pytest.fixture(scope="module")
def before(start: Model, truth: Model) -> Fit:
    return identify(start, drive(truth, manoeuvres.lap(20.0), seed=1, rate_hz=RATE_HZ), starts=1)


def later(truth: Model, **values: float) -> Log:
    return changed_drives.later(truth, RATE_HZ, **values)


def test_changes_are_judged_at_the_maximum_as_nothing_is(truth: Model, before: Fit) -> None:
    """A search that holds gains ends below what is a part of its model."""
    effect = next(e for e in before.model.candidates if e.id == "yaw_inertia")
    driving = Driving.of(later(truth, D_front=0.9 * truth.value("D_front")))
    start = replace(before, driving=driving, estimates=(), covariance=np.zeros((0, 0)))
    reference = Reference(before, [of_effect(effect)], [effect])
    nothing = reference.fitted(start, (), {}, {})
    name = "yaw_inertia.relative_error"
    state = reference.fitted(start, ("yaw_inertia",), {name: 0.0}, {name: 0.25})
    top = reference.climbed(start, state)
    assert (nothing.climbed, state.climbed, top.climbed) == (True, False, True)
    assert top.log_likelihood > state.log_likelihood + 1.0
    assert top.log_likelihood > nothing.log_likelihood
    assert reference.climbed(start, top) is top


def test_what_the_reference_left_is_no_change(truth: Model, start: Model) -> None:
    """The model lacks a relaxation in both drives; the steering is offset in the second alone."""
    lagging = truth.add("tyre_relaxation").with_values({"tyre_relaxation.relaxation_length_m": 0.4})
    before = identify(
        start, drive(lagging, manoeuvres.lap(20.0), seed=7, rate_hz=RATE_HZ), starts=1
    )
    same = changed(before, later(lagging), candidates=("steer_lag", "tyre_relaxation"))
    assert same.named == ()
    few = ("steer_offset", "tyre_relaxation")
    moved = changed_drives.later(lagging, steer_offset__offset_rad=0.002)
    other = changed(before, moved, candidates=few)
    assert [e.id for e in other.named] == ["steer_offset"]
    assert inside(other, "steer_offset", 0.002)


def slow_and_fast(car: Model, **values: float) -> tuple[Log, Log]:
    slow = drive(car, manoeuvres.slalom(20.0, speed_mps=14.0), seed=7, rate_hz=50.0)
    changed_car = car.with_values({n.replace("__", "."): v for n, v in values.items()})
    course = manoeuvres.handling_course(20.0, lateral_mps2=7.5)
    return slow, drive(changed_car, course, seed=8, rate_hz=50.0)


def test_what_a_model_lacks_elsewhere_is_not_called_a_change(truth: Model, start: Model) -> None:
    """A biased yaw rate in both, which is an offset of the steering that moves with the speed."""
    biased = truth.add("gyro_bias").with_values({"gyro_bias.bias_radps": 0.02})
    slow, fast = slow_and_fast(biased)
    change = changed(identify(start, slow, starts=1), fast, candidates=FEW)
    assert change.alike.beyond > 0.9
    assert change.alike.unlike > 0.3
    assert change.named == change.unknown == ()
    assert change.nothing > 0.5  # and the likelihoods of it count as little as the intervals say
    text = str(change)
    assert text.startswith("no change is shown")
    assert "of the later driving is at speeds or lateral accelerations" in text


def test_other_driving_of_a_model_that_lacks_nothing_is_compared(
    truth: Model, start: Model
) -> None:
    slow, fast = slow_and_fast(truth.add("steer_offset"), steer_offset__offset_rad=0.006)
    change = changed(identify(start, slow, starts=1), fast, candidates=FEW)
    assert change.alike.beyond > 0.9
    assert [e.id for e in change.named] == ["steer_offset"]
    assert inside(change, "steer_offset", 0.006)
    assert str(change).startswith("changed: steer_offset")


def test_driving_is_as_unlike_as_its_kinds_differ(truth: Model, before: Fit) -> None:
    """The same driving is not unlike; a spike makes no driving like it; seconds count."""
    lap = before.driving
    pieces = Pieces(lap)
    assert pieces.alike(lap).unlike == pytest.approx(0.0, abs=1e-9)
    fast = drive(truth, manoeuvres.handling_course(15.0, lateral_mps2=7.5), seed=3, rate_hz=50.0)
    other = pieces.alike(Driving.of(fast))
    assert other.unlike > 0.1
    (log,) = lap.logs
    columns = {c: np.array(log[c]) for c in log.channels}
    columns["vx_mps"][[100, 101]] += 30.0
    spiked = Pieces(Driving.of(Log.from_arrays(columns, check=False))).alike(Driving.of(fast))
    assert spiked.beyond == pytest.approx(other.beyond, abs=0.02)
    fine = drive(truth, manoeuvres.handling_course(15.0, lateral_mps2=7.5), seed=3, rate_hz=200.0)
    often, seldom = Driving.of([log, fine]), Driving.of([log, fast])
    assert pieces.alike(often).unlike == pytest.approx(pieces.alike(seldom).unlike, rel=0.05)
    assert pieces.alike(often).beyond == pytest.approx(pieces.alike(seldom).beyond, abs=0.02)


def test_variance_between_pieces_is_found(before: Fit, rng: np.random.Generator) -> None:
    """That of estimates which differ from piece to piece, and none of white noise."""
    pieces = Pieces(before.driving)
    count, many = int(pieces.cuts[0].max()) + 1, 4000
    information = rng.uniform(50.0, 200.0, size=(count, many))
    noise = np.sqrt(information) * rng.normal(size=(count, many))
    off = 0.5 * rng.normal(size=(count, many))
    few = pieces.variance(0, noise, information)
    more = pieces.variance(0, information * off + noise, information)
    # What white noise feigns goes down with the information; what differs does not.
    assert few.mean() < 0.05 * more.mean()
    scale = pieces.variance(0, information * 2.0 * off, information).mean()
    assert scale == pytest.approx(4.0 * more.mean(), rel=0.1)


def test_what_both_share_need_not_be_nothing(truth: Model, start: Model) -> None:
    """The steering is late in the first drive and early in the second: nothing is between them."""
    delay = "steer_delay.delay_s"
    late = truth.add("steer_delay").with_values({delay: 0.03})
    before = identify(start, drive(late, manoeuvres.lap(20.0), seed=7, rate_hz=50.0), starts=1)
    early = changed_drives.later(truth, 50.0, steer_delay__delay_s=-0.01)
    change = changed(before, early, candidates=LATE)
    assert [e.id for e in change.named] == ["steer_delay"]
    assert inside(change, "steer_delay", -0.04)
    assert change.after.model.effects == ("steer_delay",)


def test_a_relative_error_of_what_was_multiplies() -> None:
    assert change_of("yaw_inertia.relative_error", -0.2, 0.8 / 0.75 - 1.0) == pytest.approx(1 / 3)
    assert change_of("steer_delay.delay_s", -0.02, 0.03) == pytest.approx(0.05)


def test_both_drivings_are_one_problem(fit: Fit, course: Log) -> None:
    """What the later one has of its own moves nothing in the reference."""
    model, noise = fit.model.add("steer_offset"), fit.noise.vector()
    problems = [d.problem(model) for d in (Driving.of(course), fit.driving)]
    names = ("D_front", "steer_offset.offset_rad")
    shared, apart = (model.parameters[n].column for n in names)
    both = BothDrivings(*problems, model.vector(), [shared], noise)
    p = model.vector()
    p[[shared, apart]] += [0.01, 0.003]
    kept = p.copy()
    kept[apart] = 0.0
    one, other = (q.freeze(x, noise) for q, x in zip(problems, (p, kept), strict=True))
    gains = both.freeze(p, noise)
    assert gains.log_likelihood == pytest.approx(one.log_likelihood + other.log_likelihood)
    assert both.log_likelihoods(p[None], noise)[0] == pytest.approx(gains.log_likelihood)
    e, G = both.residuals(p, gains), both.sensitivities(p, gains, [shared, apart])
    cost, descent, information = both.normal_equations(p, gains, [shared, apart])
    assert cost == pytest.approx(0.5 * e @ e) == both.half_sum_of_squares(p, gains)
    assert descent == pytest.approx(G.T @ e, rel=1e-6)
    assert information == pytest.approx(G.T @ G, rel=1e-6)
    step = np.zeros_like(p)
    step[apart] = 1e-5
    slope = (both.residuals(p - step, gains) - both.residuals(p + step, gains)) / 2e-5
    assert np.abs(G[:, 1] - slope).max() < 1e-3 * np.abs(slope).max()
    assert not G[len(problems[0].residuals(p, one).ravel()) :, 1].any()


def test_another_vehicle_file_is_what_changed(car: Vehicle, start: Model, before: Fit) -> None:
    """The same driving, and a file with a yaw inertia that is too low."""
    inertia = car.yaw_inertia_kgm2 or car.usual_inertia_kgm2
    known = start.vehicle.replace(yaw_inertia_kgm2=inertia)
    (lap,) = before.driving.logs
    before = identify(Model(known), lap, starts=1)
    low = known.replace(yaw_inertia_kgm2=0.75 * inertia)
    change = changed(before, lap, vehicle=low, candidates=("steer_delay", "yaw_inertia"))
    assert [e.id for e in change.named] == ["yaw_inertia"]
    assert inside(change, "yaw_inertia", 1.0 / 3.0)


def test_tyres_of_an_axle_may_change(truth: Model, before: Fit) -> None:
    """Fitted beside those of the other axle they go far along a valley that no line tells."""
    worn = later(truth, D_front=0.9 * truth.value("D_front"))
    change = changed(before, worn, candidates=("steer_ratio",))
    assert [e.id for e in change.named] == ["tyre_front"]
    front = change["tyre_front"]
    assert front.names == ("B_front", "C_front", "D_front", "E_front")
    assert front.stiffness is not None
    share, std = front.stiffness
    assert abs(share + 0.1) < 3.0 * std
    assert std < 0.04  # driving tells it before B, C and D one by one
    assert front.size.startswith("cornering stiffness -")
    rear = change["tyre_rear"]
    assert rear.stiffness is not None
    for name, value, bound in zip(rear.names, rear.value, rear.bound, strict=True):
        p, reference = before.model.parameters[name], before.model.value(name)
        assert p.lower <= reference + value <= p.upper
        assert bound <= max(p.upper - reference, reference - p.lower)
    assert change["steer_ratio"].stiffness is None


def test_drives_with_and_without_wheel_force_do_not_compare(fit: Fit, course: Log) -> None:
    columns = {c: course[c] for c in course.channels if c != "fx_n"}
    with pytest.raises(InvalidInput, match="fx_n is known in one of the drivings only"):
        changed(fit, Log.from_arrays(columns))


@pytest.mark.parametrize(
    ("channel", "name", "untold"),
    [("vy_mps", "speed_sensor_lever_arm", 0), ("ax_mps2", "body_attitude", 0)],
)
def test_of_what_is_not_measured_any_more_no_change_is_told(
    channel: str, name: str, untold: int, truth: Model, before: Fit
) -> None:
    """Its size was 0 +- 0, and divided what would be seen."""
    change = changed(before, later(truth).without(channel), candidates=[name, "steer_offset"])
    found = change[name]
    assert found.std[untold] == found.least[untold] == np.inf
    assert np.isfinite(found.std[1 - untold])
    assert found.said == "not testable"
    json.dumps(change.to_dict(), allow_nan=False)
    assert "not shown by this driving" in str(found)


def test_a_fit_to_predictions_is_no_reference(before: Fit, course: Log) -> None:
    with pytest.raises(InvalidInput, match="identify without horizon_s"):
        changed(replace(before, horizon_s=1.0), course)


def test_long_driving_is_worked_on_piece_by_piece(
    truth: Model, before: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    few, log = ("steer_offset", "steer_ratio"), later(truth)
    whole = changed(before, log, candidates=few)
    monkeypatch.setattr(evidence, "HELD", 500)
    pieces = changed(before, log, candidates=few)
    for effect in few:
        assert pieces[effect].value == pytest.approx(whole[effect].value, rel=1e-3, abs=1e-7)
        assert pieces[effect].std == pytest.approx(whole[effect].std, rel=1e-3)


class Drawn(Side):
    """A side whose sensitivities and residuals are given."""

    def __init__(self, G: FloatArray, e: FloatArray, driving: object) -> None:
        self._G, self._e, self._driven = G, e, driving
        self.information, self.score = G.T @ G, G.T @ e

    @property
    def driving(self) -> object:  # type: ignore[override]
        return self._driven

    def rows(self) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        yield slice(0, self._driven.samples), self._G, self._e  # type: ignore[attr-defined]


def test_differences_are_those_of_all_unknowns_together(fit: Fit, rng: np.random.Generator) -> None:
    """Information and score of changes: the Schur complement of least squares over everything."""
    n, rows = 4, 5 * fit.driving.samples
    G_before, G_after = rng.normal(size=(2, rows, n))
    G_after = 0.3 * G_after + G_before
    e_before, e_after = rng.normal(size=(2, rows))
    precision, centre = np.array([0.0, 5.0, 50.0, 0.0]), np.array([0.0, 0.2, 0.0, 0.0])
    shift = np.array([0.0, 0.1, 0.0, -0.2])
    before, after = Drawn(G_before, e_before, fit.driving), Drawn(G_after, e_after, fit.driving)
    pieces = (Pieces(fit.driving),) * 2
    found = Differences(before, after, shift, Shared(precision, centre), pieces, 0.0)
    # Unknowns: what both share, then what changed; residuals of the later one begin at the shift.
    zero = np.zeros((rows, n))
    whole = np.vstack(
        [
            np.hstack([G_before, zero]),
            np.hstack([G_after, G_after]),
            np.hstack([np.diag(np.sqrt(precision)), np.zeros((n, n))]),
        ]
    )
    right = np.concatenate([e_before, e_after + G_after @ shift, np.sqrt(precision) * centre])
    best = np.linalg.lstsq(whole, right, rcond=None)[0][n:]
    assert np.linalg.solve(found.information, found.score) == pytest.approx(best, rel=1e-6)
    covariance = np.linalg.inv(whole.T @ whole)[n:, n:]
    assert np.linalg.inv(found.information) == pytest.approx(covariance, rel=1e-6)
    one, none = np.eye(n), np.zeros((n, n))
    ratios, _ = found.ratios(one, none, one)
    assert np.all((ratios >= 1.0) & (ratios < 2.5))  # the noise is white
    # Driving of another kind: an estimate may be off by what pieces of the reference differ by.
    G_before[: rows // 2] *= 3.0
    moved = Drawn(G_before, e_before + 0.2 * G_before[:, 0] * np.sign(np.arange(rows) - rows / 2),
                  fit.driving)  # fmt: skip
    same, other = (
        Differences(moved, after, shift, Shared(precision, centre), pieces, unlike)
        for unlike in (0.0, 1.0)
    )
    assert other.ratios(one, none, one)[0][0] > 10.0 * same.ratios(one, none, one)[0][0]
    # So it may be by what pieces of the later driving do, or its kinds: a change is there always.
    G_after[::2] *= 3.0
    off = 0.2 * np.sign(fit.driving.channel("yaw_rate_radps"))
    turned = Drawn(G_after, e_after + G_after[:, 0] * np.repeat(off, 5), fit.driving)
    same, other = (
        Differences(before, turned, shift, Shared(precision, centre), pieces, unlike)
        for unlike in (0.0, 1.0)
    )
    assert other.ratios(one, none, one)[1][0] > 10.0 * same.ratios(one, none, one)[1][0]
