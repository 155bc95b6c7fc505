"""The wheel force at the time at which the car feels it.

No sensor of the motion tells when the wheels push, so the check of the sensors leaves the clock of
that channel alone. The posterior of what is missing has it as a rival of the effects
(`sysid_vehicle.diagnose.candidates.clocks`). Where it stands alone in a credible set the logs are
put right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from ..._common.arrays import FloatArray, filled
from ...diagnose import Diagnosis
from ...diagnose.candidates.clocks import CLOCKS, Clock
from ...diagnose.evidence.evidence import Evidence
from ...diagnose.unexplained.delay import delayed
from ...errors import NumericalError
from ...estimate import Driving
from ...identify import Fit, predict, refine
from ...log import Log


def in_time(dx: Diagnosis, test: Driving) -> tuple[Driving, Driving] | None:
    """Training and validation data with inputs on the clock of the motion; None where they are.

    The refit has to gain its price, and to predict the validation data better.

    Parameters
    ----------
    dx : Diagnosis
        Of a model that lacks no effect any more: what is missing looks like another clock.
    test : Driving
        Validation data.
    """
    # Refits narrow the proposed sets and take some away: a clock that is in none stays in none.
    if not any(c.name in s.effects for c in CLOCKS for s in dx.proposed.sets):
        return None
    shown = [c for c in CLOCKS if any(s.effects == (c.name,) for s in dx.causes.sets)]
    if not shown:
        return None
    evidence = Evidence(dx.fit, dx.driving)
    late = {c.channel: _refined(evidence, c, dx.causes.sizes[c.name][0][0]) for c in shown}
    train, other = (_shifted(driving, late) for driving in (dx.driving, test))
    try:
        fit = refine(dx.fit.model, train, dx.fit.noise)
        gain = _predicted(fit, other) - _predicted(dx.fit, test)
    except (NumericalError, np.linalg.LinAlgError):
        return None
    statistic = 2.0 * (fit.log_likelihood - dx.fit.log_likelihood)
    price = dx.rules.price * len(late) * float(np.log(train.samples))
    return (train, other) if statistic > price and gain > 0.0 else None


def _refined(evidence: Evidence, clock: Clock, guess_s: float) -> float:
    """The shift that leaves least beside the fitted parameters.

    The posterior knows it from one step of a typical size, which may be several times as large.
    """
    p = evidence.fit.model.vector()

    def left(by_s: float) -> float:
        residual = clock.late(evidence, by_s).residuals(p, evidence.frozen).reshape(-1, 1)
        return float(np.sum(evidence.project(residual) ** 2))

    limits = sorted((0.0, 2.0 * guess_s))
    return float(scipy.optimize.minimize_scalar(left, bounds=limits, method="bounded").x)


def _predicted(fit: Fit, test: Driving) -> float:
    noise = fit.noise.elsewhere(fit.model.vehicle)
    return float(predict(fit, test, noise).log_density.sum())


def _shifted(driving: Driving, late: dict[str, float]) -> Driving:
    return replace(driving, logs=tuple(_log_shifted(log, late) for log in driving.logs))


def _log_shifted(log: Log, late: dict[str, float]) -> Log:
    now = {c: _later(log[c], log.rate_hz, by_s) for c, by_s in late.items()}
    what = [
        f"{c}: the car feels it {1000.0 * abs(by_s):.2g} ms "
        f"{'later' if by_s > 0.0 else 'sooner'} than the log says; corrected"
        for c, by_s in late.items()
    ]
    return log.corrected(now, what)


def _later(values: FloatArray, rate_hz: float, by_s: float) -> FloatArray:
    """A channel that comes later; where it was not recorded it stays so."""
    return np.where(np.isfinite(values), delayed(filled(values), rate_hz, by_s), np.nan)
