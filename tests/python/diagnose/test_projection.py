"""Linear algebra of directions: spans, inverses without copies, and the colour of scores."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid_vehicle.diagnose.evidence.projection import (
    LongRun,
    long_run_ratio,
    long_run_ratios,
    orthonormal_basis,
    pseudo_inverse,
    score_terms,
    variance_ratio,
)

CHANNELS = 5


def test_a_copy_adds_nothing_to_a_basis(rng: np.random.Generator) -> None:
    columns = rng.standard_normal((50, 3))
    basis = orthonormal_basis(np.column_stack([columns, 1e6 * columns[:, 0]]))
    assert basis.shape == (50, 3)
    assert basis.T @ basis == pytest.approx(np.eye(3))
    assert basis @ (basis.T @ columns) == pytest.approx(columns)


@pytest.mark.parametrize("width", [1, 3])
def test_the_inverse_of_an_information_matrix(width: int, rng: np.random.Generator) -> None:
    columns = rng.standard_normal((50, width)) * 10.0 ** np.arange(width)
    information = columns.T @ columns
    inverse, rank = pseudo_inverse(information)
    assert rank == width
    assert inverse @ information == pytest.approx(np.eye(width), abs=1e-9)
    twice = np.column_stack([columns, columns[:, 0]])
    assert pseudo_inverse(twice.T @ twice)[1] == width


def test_white_scores_have_ratio_one_and_coloured_ones_more(rng: np.random.Generator) -> None:
    samples = 4000
    white = rng.standard_normal(samples * CHANNELS)
    direction = np.ones(samples * CHANNELS)
    assert variance_ratio(direction, white) == pytest.approx(1.0, abs=0.4)
    # Ten samples of five channels that are all alike: fifty times the variance, less what an
    # estimate from a hundred lags cannot tell from 1.
    slow = np.repeat(rng.standard_normal(samples // 10), 10 * CHANNELS)
    alone = long_run_ratio(direction[:, None], slow)
    assert alone == pytest.approx(10.0 * CHANNELS / (1.0 + 2.0 * 0.18), rel=0.3)


def test_many_ratios_at_once_are_those_one_by_one(rng: np.random.Generator) -> None:
    directions = rng.standard_normal((700 * CHANNELS, 4))
    e = rng.standard_normal(700 * CHANNELS)
    sizes = 0.3 * rng.standard_normal((4, 4))
    squares = np.einsum("ij,ij->j", directions, directions)
    one_by_one = [
        long_run_ratio(directions[:, [j]], e - directions @ sizes[:, j]) for j in range(4)
    ]
    assert long_run_ratios(score_terms(directions, e, sizes), squares) == pytest.approx(one_by_one)


def test_long_runs_do_not_feel_where_terms_are_cut(rng: np.random.Generator) -> None:
    terms, naive = lfilter([1.0], [1.0, -0.9], rng.standard_normal((900, 3)), axis=0), np.ones(3)
    found = LongRun(*terms.shape)
    for few in np.array_split(terms - terms.mean(axis=0), [1, 5, 40, 300]):
        found.add(few)
    assert found.ratios(naive) == pytest.approx(long_run_ratios(terms, naive), rel=1e-12)
    # The definition: sums over all windows, those that reach beyond the ends as well.
    centred = terms - terms.mean(axis=0)
    most = []
    for lags in (10, 30, 90):
        sums = np.array([np.convolve(c, np.ones(lags + 1)) for c in centred.T])
        most.append((sums**2).sum(axis=1) / (lags + 1) / (1 + 2 * np.sqrt(4 * lags / 2700)))
    assert long_run_ratios(terms, naive) == pytest.approx(np.max(most, axis=0), rel=1e-12)


def test_where_no_direction_is_left_there_are_no_terms(rng: np.random.Generator) -> None:
    e = rng.standard_normal(5 * 40)
    terms = score_terms(np.empty((len(e), 0)), e, np.empty((0, 0)))
    assert terms.shape == (40, 0)


@pytest.mark.parametrize(("seconds", "least"), [(0.05, 0.73), (0.4, 0.45)])
def test_colour_is_seen_whatever_its_correlation_time(
    rng: np.random.Generator, seconds: float, least: float
) -> None:
    n, columns = 3000, 40
    keep = np.exp(-0.02 / seconds)
    white = rng.standard_normal((n, columns))
    wander = lfilter(
        [np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal((n, columns)), axis=0
    )
    variance = 1.0 + 0.6**2
    true = (1.0 + 0.6**2 * (1.0 + keep) / (1.0 - keep)) / variance
    found = long_run_ratios(white + 0.6 * wander, np.full(columns, n * variance))
    # Less what it may be by chance, which is more the more lags it takes to see it.
    assert least * true < np.median(found) < true
    none = long_run_ratios(white, np.full(columns, float(n)))
    assert np.mean(none > 1.0) < 0.2
