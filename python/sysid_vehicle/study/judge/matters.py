"""Sizes of errors that matter to the user: what is smaller needs no explanation."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..._common.arguments import real
from ..._common.arrays import mean_of_known
from ...errors import InvalidInput, near_names
from ...estimate import UNITS, Driving, NoiseModel
from ...identify import Fit
from ...read.units import factor_to
from ..ahead.horizons import AHEAD, PREDICTED, Horizons, horizons, squares_ahead
from ..validation import fitted_ahead

_NAMES = {
    "vx": "vx_mps",
    "vy": "vy_mps",
    "yaw_rate": "yaw_rate_radps",
    "ax": "ax_mps2",
    "ay": "ay_mps2",
}
USUAL_SIZES: dict[str, float | str] = {
    "vx": "0.2m/s",
    "vy": "0.1m/s",
    "yaw_rate": "0.5deg/s",
    "ax": "0.2m/s2",
    "ay": "0.2m/s2",
}


def sizes_that_matter(wanted: Mapping[str, float | str]) -> dict[str, float]:
    """Sizes by channel in SI units; those not given are `USUAL_SIZES`.

    Parameters
    ----------
    wanted : mapping
        By `vx`, `vy`, `yaw_rate`, `ax`, `ay`, or the name of the channel: a number in SI units, or
        a text such as ``0.5deg/s``.

    Raises
    ------
    InvalidInput
        A channel is none of these, a unit is not known, or a size is not above zero.
    """
    sizes: dict[str, float] = {}
    for name, size in {**USUAL_SIZES, **wanted}.items():
        channel = _NAMES.get(name, name)
        if channel not in PREDICTED:
            raise InvalidInput(
                f"matters: '{name}' is no channel{near_names(name, _NAMES)}; give "
                f"{', '.join(_NAMES)}"
            )
        value = _size(size, UNITS[channel]) if isinstance(size, str) else real(size)
        if value is None or not 0.0 < value < np.inf:
            raise InvalidInput(
                f"matters: {name} = {size!r}: give a number above 0, with {UNITS[channel]} or "
                "another unit of that kind"
            )
        sizes[channel] = value
    return sizes


def _size(text: str, unit: str) -> float | None:
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\S*)\s*", text)
    if found is None:
        return None
    factor = factor_to(unit, found[2]) if found[2] else 1.0
    try:
        return None if factor is None else float(found[1]) * factor
    except ValueError:
        return None


def within(errors: Horizons, sizes: Mapping[str, float]) -> bool:
    """Whether no median error, beyond the noise of the sensors, is as large as matters."""
    most = np.array([sizes[c] for c in errors.channels])
    beyond = errors.error[-1] ** 2 - errors.noise**2
    known = ~np.isnan(beyond)
    return bool(known.any() and np.all((beyond < most**2)[known]))


def sufficient(fit: Fit, test: Driving, sizes: Mapping[str, float]) -> Fit | None:
    """The fit whose errors 0.5 to 5 s ahead on validation data are all smaller than matters.

    The one given, or the same model fitted to predictions of the training data; None where neither
    will do.
    """
    for found in (fit, fitted_ahead(fit)):
        if found is not None and within(horizons([found], [""], test), sizes):
            return found
    return None


def buried(fit: Fit, test: Driving, noise: NoiseModel) -> bool:
    """Whether errors 0.5 to 5 s ahead are smaller than the noise of the sensors, beyond it.

    In the mean square: a corner in which the model fails counts, where a median would not see it.
    What a model lacks may be taken for noise: none counts for more than the usual sizes.

    Parameters
    ----------
    fit : Fit
    test : Driving
        Validation data.
    noise : NoiseModel
        Of the best model there is.
    """
    squares, sensor, seen = squares_ahead((replace(fit, noise=noise),), test, AHEAD)
    if not seen.any():
        return False
    usual = sizes_that_matter({})
    most = np.minimum(sensor, [usual[c] for c in PREDICTED])
    beyond = mean_of_known(squares[0], axis=0) - sensor**2
    return bool(np.all((beyond < most**2)[seen]))


def negligible(fit: Fit, best: Fit, test: Driving, noise: NoiseModel) -> bool:
    """Whether what a model lacks shows in no error on validation data.

    Its errors are `buried` with the parameters that serve these data best, so that no tyre which
    the training data left open is taken for an effect. The model that its user gets must do all the
    same: one that loses the car there is not adequate.

    Parameters
    ----------
    fit, best : Fit
        As it was fitted to the training data, and with those parameters.
    test, noise
        As for `buried`.
    """
    return buried(best, test, noise) and sufficient(fit, test, sizes_that_matter({})) is not None
