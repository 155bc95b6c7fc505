"""What tyre identification returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Part, Printed, Table
from ..._common.style import AFTER, BEFORE, axes_or_new, tidy
from ..._common.text import HALF_95, number, within
from ..._common.typed import typed
from ...identify.intervals.estimates import Estimate, Estimated
from ...identify.intervals.profile import Profile
from ...identify.intervals.quantities import Quantity, parameter, std_of, tyre_quantity
from ...identify.search.starts import Starts
from ...identify.search.tyre_shape import COMBINATIONS, friction, peak_slip, slope_of
from ...vehicle import AXLES
from .data import GreyBoxVehicle, TyreLog

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ELLIPSE = "combined_slip.ellipse"
"""Side force goes with sqrt(1 - ellipse (F_x / (D F_z))^2): 0 without combined slip, 1 a circle."""

PARAMETERS = (
    *(f"{letter}_{axle}" for axle in AXLES for letter in "BCDE"),
    "P1",
    "P2",
    "P3",
    "mass_factor",
    "yaw_inertia_factor",
    "drag_area_m2",
    ELLIPSE,
)
"""All parameters of the grey-box car, in the core's order."""

UNITS = dict.fromkeys(PARAMETERS, "1") | {
    "B_front": "1/rad",
    "B_rear": "1/rad",
    "P1": "1/m",
    "P2": "1/s",
    "P3": "m/s",
    "drag_area_m2": "m2",
}
NOISES = (
    "v_x [m/s]",
    "v_y [m/s]",
    "yaw rate [rad/s]",
    "a_y [m/s2]",
    "disturbed v_x [m/s per root second]",
    "disturbed v_y [m/s per root second]",
    "disturbed yaw rate [rad/s per root second]",
)
"""Standard deviations that are learned, in the core's order."""

TAKE_PROFILES = "take them from the profile likelihood (profiles=True, without --fast)"

_ONE_FORCE = (
    "The ellipse has one force and one load for both wheels of an axle; where an open differential "
    "drives an inner wheel that corners unload, that is no part of the intervals: of simulated "
    "two-track cars with up to 0.35 of their weight as drive force D was 10 to 18 % off"
)

_CHI_SQUARE = 3.84  # 95 % quantile, one degree of freedom
_KNOWN_WELL = 0.05  # relative standard error
_POSITIVE = (0.0, float("inf"))


@dataclass(frozen=True, eq=False)
class TyreBand:
    """Friction of one axle over its slip angle, with its standard error.

    Attributes
    ----------
    axle : str
    slip_rad, friction, std : array, shape (n,)
        Lateral force over load.
    driven_rad : float
        Slip angle that one sample in 200 exceeds; beyond, the curve is extrapolated.
    """

    axle: str
    slip_rad: FloatArray
    friction: FloatArray
    std: FloatArray
    driven_rad: float


@dataclass(frozen=True, eq=False)
class Rival:
    """Another optimum, or another part of the same valley, that the data cannot rule out.

    Attributes
    ----------
    parameters : array, shape (15,)
    lost : float
        By how much it is less likely than the best, in nats.
    covariance : array, shape (free, free)
        Around it.
    """

    parameters: FloatArray
    lost: float
    covariance: FloatArray

    def interval(self, what: Quantity, columns: list[int]) -> tuple[float, float]:
        """What of the 95 % interval of a quantity lies around this optimum."""
        std = std_of(what, self.parameters, columns, self.covariance)
        reach = float(np.sqrt(max(_CHI_SQUARE - 2.0 * self.lost, 0.0))) * std
        centre = what.of(self.parameters)
        return centre - reach, centre + reach


def quantities(names: Sequence[str]) -> dict[str, Quantity]:
    """Parameters of these names, and the combinations of both axles."""
    found = [parameter(n, PARAMETERS.index(n)) for n in names]
    for axle in AXLES:
        columns = [PARAMETERS.index(f"{letter}_{axle}") for letter in "BCDE"]
        for name, (function, _) in COMBINATIONS.items():
            found.append(tyre_quantity(f"{name}_{axle}", columns, function))
    return {what.name: what for what in found}


@dataclass(frozen=True, eq=False)
class TyreFit(Estimated, Printed):
    """Tyre coefficients identified from driving.

    Attributes
    ----------
    vehicle : GreyBoxVehicle
    logs : tuple of TyreLog
    parameters : array, shape (15,)
        All of `PARAMETERS`, free and fixed.
    estimates : tuple of Estimate
        The free ones.
    covariance : array, shape (free, free)
    noise : array, shape (7,)
        In the order of `NOISES`.
    log_likelihood : float
    starts : Starts
        On the thinned data that decide between starts.
    driven_rad : tuple of 2 floats
        Slip angles, front and rear, that one sample in 200 exceeds.
    profiles : tuple of Profile
        Profile likelihoods of estimates and combinations; empty where none were asked for.
    rivals : tuple of Rival
        Other optima within the 95 % region, most often tyres of another curvature.
    bent : tuple of str
        What has an interval of the information matrix that is not to be trusted: the likelihood
        does not fall as that says.
    """

    vehicle: GreyBoxVehicle
    logs: tuple[TyreLog, ...]
    parameters: FloatArray
    estimates: tuple[Estimate, ...]
    covariance: FloatArray
    noise: FloatArray
    log_likelihood: float
    starts: Starts
    driven_rad: tuple[float, float]
    profiles: tuple[Profile, ...] = ()
    rivals: tuple[Rival, ...] = ()
    bent: tuple[str, ...] = ()

    @typed
    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval: of the profile likelihood, or of the information matrix without one.

        It reaches over all `rivals`.
        """
        what = self.quantities[name]
        low, high = self[name].interval
        for found in (f for f in self.profiles if f.name == name):
            low, high = found.interval
            if what.column is None:  # nothing bounds what follows from the coefficients
                low = -np.inf if found.open_below else low
                high = np.inf if found.open_above else high
        for rival in self.rivals:
            there = rival.interval(what, self.columns)
            low, high = min(low, there[0]), max(high, there[1])
        low, high = within((low, high), self[name].bounds)
        return (low if np.isfinite(low) else -np.inf), (high if np.isfinite(high) else np.inf)

    @property
    def columns(self) -> list[int]:
        """Places of the estimates among all parameters."""
        return [PARAMETERS.index(e.name) for e in self.estimates]

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Estimates and combinations as functions of all parameters."""
        return quantities([e.name for e in self.estimates])

    @typed
    def tyre(self, axle: str) -> FloatArray:
        """B, C, D, E of an axle, `front` or `rear`."""
        first = 4 * AXLES.index(axle)
        return as_float64(self.parameters[first : first + 4])

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the estimates, shape (free, free)."""
        std = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        return as_float64(self.covariance / np.outer(std, std))

    @property
    def derived(self) -> tuple[Estimate, ...]:
        """Cornering stiffness B C D over load, highest friction, and slip angle of the peak."""
        known = self.quantities
        found = []
        for i, axle in enumerate(AXLES):
            peak = peak_slip(self.tyre(axle))
            for name, (_, unit) in COMBINATIONS.items():
                what = known[f"{name}_{axle}"]
                std = std_of(what, self.parameters, self.columns, self.covariance)
                # Nobody has seen a peak that was not driven to.
                beyond = name != "BCD" and self.driven_rad[i] < peak
                note = "beyond the driven slip" if beyond else ""
                value = what.of(self.parameters)
                found.append(Estimate(what.name, value, std, unit, note, bounds=_POSITIVE))
        return tuple(found)

    @property
    def determined(self) -> tuple[str, ...]:
        """Coefficients and combinations known to 5 % or better."""
        return tuple(
            e.name
            for e in (*self.estimates, *self.derived)
            if not e.note
            and e.name not in self.bent
            and self._half_width(e.name) < 2.0 * _KNOWN_WELL * abs(e.value)
        )

    def _half_width(self, name: str) -> float:
        low, high = self.interval(name)
        return max(high - self[name].value, self[name].value - low)

    @property
    def inputs_held(self) -> bool:
        """Whether inputs are held from sample to sample, as told or as the likelihood prefers."""
        return all(log.inputs_held is not False for log in self.logs)

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "logs": [str(log) for log in self.logs],
            "inputs_held": self.inputs_held,
            "vehicle": asdict(self.vehicle),
            "parameters": dict(zip(PARAMETERS, map(float, self.parameters), strict=True)),
            "log_likelihood": self.log_likelihood,
            "estimates": {
                e.name: {**e.to_dict(), "interval": list(self.interval(e.name)), "note": e.note}
                for e in (*self.estimates, *self.derived)
            },
            "noise": dict(zip(NOISES, map(float, self.noise), strict=True)),
            "undetermined": list(self.undetermined),
            "bent": list(self.bent),
            "correlation": {
                "names": [e.name for e in self.estimates],
                "matrix": self.correlation.tolist(),
            },
            "starts": [
                {"begin": b, "end": e, "log_likelihood": float(v)}
                for b, e, v in zip(
                    self.starts.begin.tolist(),
                    self.starts.end.tolist(),
                    self.starts.log_likelihood,
                    strict=True,
                )
            ],
            "rivals": [{"parameters": r.parameters.tolist(), "lost": r.lost} for r in self.rivals],
        }

    @typed
    def curve(self, axle: str, slip_rad: FloatArray | None = None) -> TyreBand:
        """Tyre curve of an axle with its standard error, by the delta method."""
        i = AXLES.index(axle)
        bcde = self.tyre(axle)
        if slip_rad is None:
            slip_rad = np.linspace(0.0, max(1.5 * self.driven_rad[i], 0.02), 81)
        names = [e.name for e in self.estimates]
        where = [names.index(f"{letter}_{axle}") for letter in "BCDE"]
        slopes = slope_of(partial(friction, slip_rad), bcde)
        variance = np.einsum("nj,jk,nk->n", slopes, self.covariance[np.ix_(where, where)], slopes)
        std = np.sqrt(np.maximum(variance, 0.0))
        return TyreBand(axle, slip_rad, friction(slip_rad, bcde), std, self.driven_rad[i])

    @typed
    def plot(self, ax: Axes | None = None, axles: Sequence[str] = AXLES) -> Axes:
        """Draw tyre curves with 95 % bands; dotted beyond the driven slip.

        Parameters
        ----------
        ax : matplotlib Axes, optional
        axles : sequence of str
            ``front``, ``rear``, or both.
        """
        ax = axes_or_new(ax, 6.0, 3.8)
        for axle in axles:
            band, colour = self.curve(axle), (AFTER, BEFORE)[AXLES.index(axle)]
            seen = band.slip_rad <= band.driven_rad
            ax.plot(band.slip_rad[seen], band.friction[seen], color=colour, label=axle)
            ax.plot(band.slip_rad[~seen], band.friction[~seen], ":", color=colour)
            low, high = band.friction - HALF_95 * band.std, band.friction + HALF_95 * band.std
            ax.fill_between(band.slip_rad, low, high, color=colour, alpha=0.2, linewidth=0)
        ax.set_ylim(0.0, 1.3 * max(float(self.curve(a).friction.max()) for a in AXLES))
        ax.legend()
        return tidy(ax, xlabel="slip angle [rad]", ylabel="lateral force / load")

    @property
    def _head(self) -> tuple[str, ...]:
        kind = "profile" if self.profiles else "information"
        return ("parameter", "value", "std", f"95 % interval ({kind})", "unit", "note")

    def _rows(self) -> list[list[str]]:
        rows = []
        for e in (*self.estimates, *self.derived):
            interval = self._interval_text(e)
            rows.append([e.name, number(e.value, 5), number(e.std, 2), interval, e.unit, e.note])
        return rows

    def _interval_text(self, e: Estimate) -> str:
        low, high = (number(x, 5) if np.isfinite(x) else "?" for x in self.interval(e.name))
        for found in self.profiles:
            if found.name == e.name:
                low, high = ("?" if found.open_below else low), ("?" if found.open_above else high)
        return f"{low} .. {high}"

    def _headline(self) -> str:
        inputs = "held until the next" if self.inputs_held else "straight to the next"
        return (
            f"Tyres from {'; '.join(map(str, self.logs))}\n"
            # The starts have the likelihood of the thinned data that decided between them.
            f"log-likelihood {self.log_likelihood:.1f}; {self.starts.agreement}; steering and "
            f"forces of each sample {inputs}"
        )

    def _closing(self) -> str:
        noise = ", ".join(
            f"{name} {number(s, 3)}" for name, s in zip(NOISES, self.noise, strict=True)
        )
        lines = [f"Noise learned: {noise}"]
        for rival in self.rivals:
            values = ", ".join(
                f"{e.name} {number(rival.parameters[PARAMETERS.index(e.name)], 5)}"
                for e in self.estimates[:8]
            )
            lines.append(f"As likely to {number(rival.lost, 2)} nats: {values}")
        if ELLIPSE in [e.name for e in self.estimates]:
            lines.append(_ONE_FORCE)
        if self.bent:
            lines.append(f"Intervals not to be trusted: {', '.join(self.bent)}; {TAKE_PROFILES}")
        if self.undetermined:
            lines.append(
                f"Not determined by this driving: {', '.join(self.undetermined)}; known to "
                f"{100 * _KNOWN_WELL:g} % or better: {', '.join(self.determined) or 'none'}"
            )
        return "\n".join(lines)

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._head, self._rows()), self._closing()]
