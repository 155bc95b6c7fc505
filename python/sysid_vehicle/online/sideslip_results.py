"""What a sideslip observer found over a log."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import _core
from .._common.arrays import FloatArray
from .._common.printed import Told
from .._common.style import AFTER, MEASURED, TRUTH, axes_or_new, new_figure, tidy
from .._common.text import number, text_table
from .._common.typed import typed
from ..errors import warn
from ..vehicle import Vehicle
from .sideslip_error import SideslipError
from .sideslip_settings import SideslipSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BAND_MPS2 = 2.0
_BY_CHANCE = 0.05  # what a band of 2 standard deviations leaves outside
_RARELY = 0.01  # of the samples, which noise alone makes large
# Up to half of its peak a tyre curve is nearly straight, and tells little of the peak.
_STRAIGHT = 0.5
_UNUSED = (
    "friction of which less than half was used is mostly that of the vehicle file: on ice or snow "
    "it reads too high"
)
_LEARNED = 0.5  # of its relative standard deviation at the beginning: the log tells three quarters
_UNTOLD = (
    "this driving tells little of the cornering stiffness: it is mostly that of the vehicle file"
)


@dataclass(frozen=True, repr=False)
class SideslipRun(Told):
    """Estimates over a log of `n` samples; arrays have shape (n,), NaN where nothing is known.

    Attributes
    ----------
    kind, vehicle, log_name, settings :
        What was run on what.
    time_s, ay_mps2 : ndarray
        Of the log.
    true_beta_rad : ndarray or None
        Sideslip from the log's own ``vy_mps``, which the observer did not see.
    true_beta_std_rad : ndarray or None
        The white noise of that.
    beta_rad, beta_std_rad : ndarray
        Sideslip and its standard deviation.
    exact_std_rad, refuted : ndarray or None
        Of kinds with fixed tyres that the dual observer has judged: the standard deviation that
        they have if the tyres of the vehicle file are exact; whether the dual observer's sideslip
        is further away than both bands allow.
    vx_mps, yaw_rate_radps, fyf_n, fyr_n, fx_n : ndarray
        Speed, yaw rate, lateral axle forces, longitudinal force without drag.
    cf_npr, cr_npr, cf_std_npr, cr_std_npr, mu_f, mu_r, mu_f_std, mu_r_std : ndarray
        Cornering stiffness at the static load [N/rad], peak friction, and standard deviations.
    nis, observed, log_likelihood : ndarray
        Squared whitened innovation, readings it is made of, log density of the readings.
    mode : ndarray
        0 running, 1 holding (too slow), 2 coasting (a sensor is missing or refused; not where a
        slower one has no reading yet).
    """

    kind: str
    vehicle: Vehicle
    log_name: str
    settings: SideslipSettings
    time_s: FloatArray
    ay_mps2: FloatArray
    true_beta_rad: FloatArray | None
    true_beta_std_rad: FloatArray | None
    beta_rad: FloatArray
    beta_std_rad: FloatArray
    vx_mps: FloatArray
    yaw_rate_radps: FloatArray
    fyf_n: FloatArray
    fyr_n: FloatArray
    fx_n: FloatArray
    cf_npr: FloatArray
    cr_npr: FloatArray
    cf_std_npr: FloatArray
    cr_std_npr: FloatArray
    mu_f: FloatArray
    mu_r: FloatArray
    nis: FloatArray
    observed: FloatArray
    log_likelihood: FloatArray
    mode: FloatArray
    mu_f_std: FloatArray
    mu_r_std: FloatArray
    exact_std_rad: FloatArray | None = None
    refuted: npt.NDArray[np.bool_] | None = None

    @property
    def too_slow(self) -> bool:
        """Whether nothing was estimated, as the car never was fast enough."""
        return bool((self.mode == 1).all())

    @property
    def used_friction(self) -> FloatArray:
        """Side force of the front and the rear axle over the load on it, as far as it went.

        One in a hundred samples, which may be noise, is larger. The loads move with the
        longitudinal force, as those of the observer do.
        """
        moved = self.fx_n * (self.vehicle.cg_height_m / self.vehicle.wheelbase_m)
        loads = np.reshape(self.vehicle.static_loads_n, (2, 1)) + np.stack([-moved, moved])
        used = np.abs(np.stack([self.fyf_n, self.fyr_n]) / loads)[:, self.mode == 0]
        if not np.isfinite(used).any(axis=1).all():
            return np.zeros(2)
        return np.asarray(np.nanquantile(used, 1.0 - _RARELY, axis=1))

    @property
    def vy_mps(self) -> FloatArray:
        """Lateral speed at the centre of gravity."""
        return self.vx_mps * np.tan(self.beta_rad)

    @typed
    def error(self, true_beta_rad: FloatArray | None = None) -> SideslipError | None:
        """Compare with the truth while the car runs; with that of the log, or None, if none is.

        What is measured has noise, which the band of an estimate does not hold; a truth that is
        given is taken as exact.
        """
        white = self.true_beta_std_rad if true_beta_rad is None else None
        truth = true_beta_rad if true_beta_rad is not None else self.true_beta_rad
        if truth is None:
            return None
        known = np.isfinite(truth) & (self.mode != 1)
        if not known.any():
            return None
        noise = np.zeros(np.count_nonzero(known)) if white is None else white[known]
        off = (self.beta_rad - truth)[known]
        degrees, size = np.degrees(off), np.abs(self.ay_mps2[known])
        bands = []
        floors = _BAND_MPS2 * np.floor(size / _BAND_MPS2)
        for low in np.unique(floors[np.isfinite(floors)]).tolist():
            inside = floors == low
            rms = float(np.sqrt(np.mean(degrees[inside] ** 2)))
            bands.append((low, low + _BAND_MPS2, rms, int(inside.sum())))
        return SideslipError(
            float(np.sqrt(np.mean(degrees**2))),
            float(np.abs(degrees).max()),
            float(np.mean(np.abs(off) <= 2.0 * np.hypot(self.beta_std_rad[known], noise))),
            tuple(bands),
            float(np.degrees(np.sqrt(np.mean(noise**2)))),
        )

    def __str__(self) -> str:
        beta = np.degrees(self.beta_rad)
        lines = [
            f"{self.log_name}: sideslip by the {self.kind} observer, {len(beta)} samples",
            (
                f"  sideslip {beta.min():.2f} .. {beta.max():.2f} deg, standard deviation "
                f"{np.degrees(np.nanmean(self.beta_std_rad)):.3f} deg on average"
            ),
            *self._tyres_said(),
        ]
        running = np.flatnonzero(self.mode != 1)
        if running.size:
            k, at_most = running[-1], self.used_friction
            rows = [
                [
                    axle,
                    number(float(c[k]) / 1e3, 3),
                    number(float(s[k]) / 1e3, 2),
                    *([f"{x[k]:.2f}" for x in mu] if np.isfinite(mu[0][k]) else ["-", "-"]),
                    f"{used:.2f}",
                ]
                for axle, c, s, mu, used in (
                    ("front", self.cf_npr, self.cf_std_npr, (self.mu_f, self.mu_f_std), at_most[0]),
                    ("rear", self.cr_npr, self.cr_std_npr, (self.mu_r, self.mu_r_std), at_most[1]),
                )
            ]
            head = ["axle", "stiffness [kN/rad]", "std", "friction", "std", "used"]
            lines.append(text_table(head, rows))
            if (at_most < _STRAIGHT * np.array([self.mu_f[k], self.mu_r[k]])).any():
                lines.append(f"  {_UNUSED}")
            if self.kind == "dual" and self._untold(k):
                lines.append(f"  {_UNTOLD}")
        for mode, meaning in ((1, "too slow to tell"), (2, "with a sensor missing or refused")):
            share = float(np.mean(self.mode == mode))
            if share > 0.0:
                lines.append(f"  {100.0 * share:.3g} % of samples {meaning}")
        found = self.error()
        return "\n".join([*lines, *([str(found)] if found is not None else [])])

    def _untold(self, k: np.intp) -> bool:
        """Whether the cornering stiffness of an axle is known hardly better than at first."""
        share = [s / c for s, c in ((self.cf_std_npr, self.cf_npr), (self.cr_std_npr, self.cr_npr))]
        return any(x[k] > _LEARNED * x[0] for x in share)

    def _tyres_said(self) -> list[str]:
        if self.kind == "dual":
            return []
        if self.kind == "published":
            return ["  the band is the published filter's own, without errors of the model"]
        if self.exact_std_rad is None or self.refuted is None:
            return ["  the band takes the tyres of the vehicle file as exact"]
        exact = np.degrees(np.nanmean(self.exact_std_rad))
        share = 100.0 * float(np.mean(self.refuted))
        return [
            f"  the band is judged by the dual observer; were the tyres exact, {exact:.3f} deg",
            f"  refuted by the dual observer in {share:.3g} % of samples",
        ]

    def to_dict(self) -> dict[str, Any]:
        """All figures and series as plain numbers."""
        series = (
            "time_s",
            "beta_rad",
            "beta_std_rad",
            "cf_npr",
            "cr_npr",
            "mu_f",
            "mu_r",
            "mode",
            "mu_f_std",
            "mu_r_std",
        )
        found = self.error()
        return {
            "log": self.log_name,
            "kind": self.kind,
            "settings": dict(self.settings),
            "error": None
            if found is None
            else {
                "rms_deg": found.rms_deg,
                "noise_deg": found.noise_deg,
                "max_deg": found.max_deg,
                "inside_two_sigma": found.covered,
                "by_ay_mps2": [
                    {"low": a, "high": b, "rms_deg": rms, "samples": n}
                    for a, b, rms, n in found.bands
                ],
            },
            "series": {
                name: values.tolist()
                for name in (*series, "exact_std_rad", "refuted")
                if (values := getattr(self, name)) is not None
            },
        }

    @typed
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw sideslip with its 2-sigma band, and the truth where the log has it, onto `ax`."""
        ax = axes_or_new(ax, 9.0, 3.5)
        beta, std = np.degrees(self.beta_rad), np.degrees(self.beta_std_rad)
        ax.fill_between(
            self.time_s, beta - 2 * std, beta + 2 * std, color=AFTER, alpha=0.25, linewidth=0,
            label="2 sigma",
        )  # fmt: skip
        ax.plot(self.time_s, beta, color=AFTER, linewidth=1.0, label="estimated")
        if self.true_beta_rad is not None:
            truth = np.degrees(self.true_beta_rad)
            ax.plot(self.time_s, truth, color=TRUTH, linewidth=0.8, label="measured")
        ax.legend(frameon=False, ncols=3)
        return tidy(ax, xlabel="time [s]", ylabel="sideslip [deg]", title=self.log_name)

    @typed
    def plot_stiffness(self, ax: Axes | None = None) -> Axes:
        """Draw both cornering stiffnesses with their 2-sigma bands onto `ax`."""
        ax = axes_or_new(ax, 9.0, 3.5)
        for name, c, s, color in (
            ("front", self.cf_npr, self.cf_std_npr, AFTER),
            ("rear", self.cr_npr, self.cr_std_npr, MEASURED),
        ):
            ax.fill_between(
                self.time_s, (c - 2 * s) / 1e3, (c + 2 * s) / 1e3, color=color, alpha=0.2,
                linewidth=0,
            )  # fmt: skip
            ax.plot(self.time_s, c / 1e3, color=color, linewidth=1.0, label=name)
        both = np.stack([self.cf_npr, self.cr_npr])
        known = both[:, np.isfinite(both).all(axis=0)]  # not where the car stands
        if known.size:
            ax.set_ylim(0.0, 2.0 * float(known[:, -1].max()) / 1e3)
        ax.legend(frameon=False)
        return tidy(ax, xlabel="time [s]", ylabel="cornering stiffness [kN/rad]")


def judged(
    beta: npt.ArrayLike, own_std: npt.ArrayLike, dual: npt.ArrayLike, dual_std: npt.ArrayLike
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """The band of an estimate by what the dual observer knows [rad], and where that refutes it.

    By what it knows the error has the mean square of its variance and the squared distance.
    Refuted is an estimate that is further away than both bands of two standard deviations allow.
    """
    apart = np.subtract(beta, dual)
    return np.hypot(apart, dual_std), np.abs(apart) > 2.0 * np.hypot(own_std, dual_std)


def judged_by(run: SideslipRun, dual: SideslipRun) -> SideslipRun:
    """The run with a band by what another one knows, which has learned the tyres.

    Parameters
    ----------
    run, dual : SideslipRun
        Over the same log; the second by the dual observer.

    Warns
    -----
    SysidWarning
        If the two are further apart than both bands allow for longer than chance explains.
    """
    std, refuted = judged(run.beta_rad, run.beta_std_rad, dual.beta_rad, dual.beta_std_rad)
    share = float(np.mean(refuted))
    if share > _BY_CHANCE:
        first = run.time_s[int(np.argmax(refuted))]
        warn(
            f"{run.log_name}: the tyres of '{run.vehicle.name}' do not fit this drive: in "
            f"{100.0 * share:.3g} % of samples, first at t = {first:.5g} s, the sideslip of the "
            f"{run.kind} observer is further from that of the dual one than both bands allow; take "
            f"kind 'dual', or tyres of this car on this surface (fitted_vehicle)"
        )
    return dataclasses.replace(
        run,
        beta_std_rad=std,
        exact_std_rad=run.beta_std_rad,
        refuted=refuted,
    )


def doubted(run: SideslipRun, told_npr: tuple[float, float]) -> None:
    """Warn where the dual observer has learnt far softer tyres than it was told.

    On ice and snow stiffness and friction are a share of those on a dry road, and a curve that
    bends early is explained by the stiffness alone. Tyres that are stiffer than told do no harm.

    Parameters
    ----------
    run : SideslipRun
        By the dual observer.
    told_npr : (front, rear)
        Cornering stiffness of the vehicle file [N/rad].

    Warns
    -----
    SysidWarning
        If a stiffness is less than two standard deviations of what is expected at first allow.
    """
    running = np.flatnonzero(run.mode != 1)
    if not running.size:
        return
    learnt = np.array([run.cf_npr[running[-1]], run.cr_npr[running[-1]]])
    ratio = learnt / told_npr
    expected = _core.sideslip_defaults()["stiffness_prior"]
    if np.log(ratio).min() >= -2.0 * expected:
        return
    warn(
        f"{run.log_name}: the cornering stiffness is {ratio[0]:.2g} (front) and {ratio[1]:.2g} "
        f"(rear) times that of '{run.vehicle.name}', far from what was told: other tyres, ice or "
        "snow. The band of the sideslip may be far too narrow then, and the friction too high; "
        "give tyres of this car on this surface (fitted_vehicle)"
    )


@typed
def sideslip_overview(run: SideslipRun) -> Figure:
    """Sideslip, cornering stiffness and axle forces over time in one figure."""
    figure = new_figure(9.0, 9.0)
    above, middle, below = figure.subplots(3, 1, sharex=True)
    run.plot(above)
    run.plot_stiffness(middle)
    below.plot(run.time_s, run.fyf_n / 1e3, color=AFTER, linewidth=0.8, label="front")
    below.plot(run.time_s, run.fyr_n / 1e3, color=MEASURED, linewidth=0.8, label="rear")
    below.legend(frameon=False)
    tidy(below, xlabel="time [s]", ylabel="lateral axle force [kN]")
    return figure
