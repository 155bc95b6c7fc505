"""The closed loop: a car driven by sensors, observer and controller, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Part, Printed, Table
from ..._common.style import AFTER, BEFORE, TRUTH, axes_or_new, tidy
from ..._common.text import number
from ..._common.typed import typed
from ...errors import InvalidInput
from ...log import Log
from ...simulate import RoadDisturbance
from ..excitation import Excitation
from ..parts import Sensors
from ..setup import Setup
from .saturation import Saturation, saturation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TRUTH_CHANNELS = (
    "vx_mps",
    "vy_mps",
    "yaw_rate_radps",
    "x_m",
    "y_m",
    "heading_rad",
    "ax_mps2",
    "ay_mps2",
    "yaw_acc_radps2",
    "slip_front_rad",
    "slip_rear_rad",
    "fy_front_n",
    "fy_rear_n",
    "fz_front_n",
    "fz_rear_n",
)
ESTIMATES = ("vx_mps", "vy_mps", "yaw_rate_radps", "xi_x_n", "xi_y_n", "xi_psi_nm")
_REFERENCES = ("vx_mps", "heading_rad", "yaw_rate_radps", "left_of_track_m")
_INPUTS = ("fx_n", "steer_rad", "fx_command_n", "steer_command_rad")


@dataclass(frozen=True, eq=False)
class ClosedLoop(Printed):
    """A finished drive of the closed loop.

    Attributes
    ----------
    setup : Setup
    excitation : Excitation
    time_s : ndarray, shape (n,)
    sensed : dict of ndarray
        Readings of every sensor, NaN where there was none; names as in :class:`Sensors`.
    estimate : dict of ndarray
        The observer's motion, unknown forces ``xi_x_n``, ``xi_y_n`` and moment ``xi_psi_nm``.
    reference : dict of ndarray
        Wanted speed, heading and yaw rate, and the distance left of the track.
    inputs : dict of ndarray
        Wheel force and steering angle as they acted, and as commanded.
    truth : dict of ndarray
        What only the simulator knows; names in `TRUTH_CHANNELS`.
    limits : ndarray of uint32, shape (n,)
        Which limits were met at each sample, one bit each in the order of `saturation`.
    lost_s : float or None
        When the car spun or stopped, if it did; the drive ends there.
    """

    setup: Setup
    excitation: Excitation
    time_s: FloatArray
    sensed: dict[str, FloatArray]
    estimate: dict[str, FloatArray]
    reference: dict[str, FloatArray]
    inputs: dict[str, FloatArray]
    truth: dict[str, FloatArray]
    limits: npt.NDArray[np.uint32]
    lost_s: float | None

    @property
    def saturation(self) -> tuple[Saturation, ...]:
        """Every limit that was met."""
        return saturation(self.limits, self.setup.rate_hz)

    @property
    def too_hard(self) -> bool:
        """Whether the car was lost, or limits kept it from what was wanted."""
        return self.lost_s is not None or any(s.too_hard for s in self.saturation)

    @property
    def tracking(self) -> dict[str, float]:
        """Root mean square of the speed error [m/s] and of the heading or track error."""
        errors = {"vx_mps": self.reference["vx_mps"] - self.truth["vx_mps"]}
        if self.excitation.steer_by == "track":
            errors["left_of_track_m"] = self.reference["left_of_track_m"]
        elif self.excitation.steer_by == "heading":
            turn = self.reference["heading_rad"] - self.truth["heading_rad"]
            errors["heading_rad"] = np.remainder(turn + np.pi, 2.0 * np.pi) - np.pi
        return {name: float(np.sqrt(np.mean(e**2))) for name, e in errors.items()}

    @property
    def observer_error(self) -> dict[str, float]:
        """Root mean square error of the observer's v_x [m/s], v_y [m/s] and yaw rate [rad/s]."""
        return {
            name: float(np.sqrt(np.mean((self.estimate[name] - self.truth[name]) ** 2)))
            for name in ESTIMATES[:3]
        }

    @typed
    def to_log(self, name: str | None = None) -> Log:
        """Return what the sensors wrote, as a log to estimate and identify from.

        Parameters
        ----------
        name : str, optional
            Name of the log; the excitation's if left out.

        Returns
        -------
        Log
            The canonical channels, and as further columns the sensed ``heading_rad``, ``x_m``,
            ``y_m``, ``fz_front_n`` and ``fz_rear_n``. No truth. Wheel force and steering angle are
            held from one sample to the next, unless `Simulator.inputs_linear` is on; the rest of
            the package takes them as linear in between.
        """
        return Log.from_arrays(
            {"time_s": self.time_s, **self.sensed}, name=name or self.excitation.name, check=False
        )

    def _rows(self) -> list[tuple[str, str]]:
        t = self.truth
        rows = [
            ("speed [m/s]", f"{t['vx_mps'].min():.1f} to {t['vx_mps'].max():.1f}"),
            ("lateral acceleration [m/s2]", f"up to {np.abs(t['ay_mps2']).max():.2f}"),
            ("front slip angle [rad]", f"up to {np.abs(t['slip_front_rad']).max():.4f}"),
            ("rear slip angle [rad]", f"up to {np.abs(t['slip_rear_rad']).max():.4f}"),
        ]
        rows += [(f"rms error of {n} followed", number(e, 3)) for n, e in self.tracking.items()]
        rows += [
            (f"rms error of {n} observed", number(e, 3)) for n, e in self.observer_error.items()
        ]
        rows += [(s.what, f"{100.0 * s.share:.3g} % of the time") for s in self.saturation]
        return rows

    def _title(self) -> str:
        return (
            f"{self.excitation.name} in '{self.setup.name}': {self.time_s[-1]:.6g} s at "
            f"{self.setup.rate_hz:g} Hz"
        )

    def _verdict(self) -> str:
        if self.lost_s is not None:
            return (
                f"The car was lost at {self.lost_s:.6g} s and the drive ends there; ask for less "
                f"speed or less steering."
            )
        hard = [str(s) for s in self.saturation if s.too_hard]
        if hard:
            return "The reference was too hard for the car: " + "; ".join(hard) + "."
        return "The reference was within the car's means."

    def _parts(self) -> list[Part]:
        return [self._title(), Table(("what", "value"), self._rows()), self._verdict()]

    @typed
    def plot(self, ax: Axes | None = None, what: str = "yaw_rate_radps") -> Axes:
        """Draw a quantity as wanted, as driven and as observed.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; a new figure is made without it.
        what : str
            A name of `reference`, `truth`, `estimate` or `inputs`; every group that has it is
            drawn.

        Raises
        ------
        InvalidInput
            If none has it.
        """
        groups = (
            ("wanted", self.reference, BEFORE),
            ("driven", self.truth, TRUTH),
            ("observed", self.estimate, AFTER),
            ("input", self.inputs, AFTER),
        )
        found = [(label, g[what], colour) for label, g, colour in groups if what in g]
        if not found:
            known = sorted({name for _, g, _ in groups for name in g})
            raise InvalidInput(f"plot: nothing is called '{what}'; there are {', '.join(known)}")
        ax = axes_or_new(ax, 8.0, 3.0)
        for label, values, colour in found:
            ax.plot(self.time_s, values, color=colour, linewidth=0.9, label=label)
        ax.legend(frameon=False)
        return tidy(ax, xlabel="time_s", ylabel=what, title=self.excitation.name)


@typed
def run_closed_loop(
    excitation: Excitation,
    setup: Setup | None = None,
    *,
    seed: int | np.random.Generator,
    disturbance: RoadDisturbance | None = None,
    normal: FloatArray | None = None,
) -> ClosedLoop:
    """Drive an excitation in the closed loop.

    Parameters
    ----------
    excitation : Excitation
        What is wanted.
    setup : Setup, optional
        The laboratory; `Setup.default()` if left out.
    seed : int or numpy.random.Generator
        Source of the randomness of sensors and road.
    disturbance : RoadDisturbance, optional
        Random forces on the car; none if left out.
    normal : ndarray, shape (n, 12), optional
        Standard normal numbers of the sensors, to repeat a drive with known noise.

    Returns
    -------
    ClosedLoop
        Also where the car was lost: `lost_s` says when.

    Raises
    ------
    InvalidInput
        If the excitation or the noise does not fit.

    Notes
    -----
    At each sample the command rests on the observer's prediction for that sample, acts, the
    sensors are read with it acting, and the observer takes their readings. Controller and observer
    see readings only.
    """
    setup = setup if setup is not None else Setup.default()
    rng = generator(seed)
    model = setup.plant
    model.refuse_channels("the laboratory")
    wanted = excitation.wanted(model.vehicle, setup.rate_hz)
    n = len(wanted)
    if normal is None:
        normal = setup.sensors.normal(n, rng)
    external = (disturbance or RoadDisturbance()).sample(n, setup.rate_hz, rng)
    first = setup.first_speed_mps
    speed = first if first is not None else max(float(wanted[0, 0]), 5.0)
    core = setup.core(excitation.steer_by, speed, excitation.start)
    track = excitation.track()
    if track is not None:
        core.set_track(as_float64(track), *excitation.look_ahead)
    if normal.shape != (n, len(Sensors.names())):
        raise InvalidInput(
            f"normal: has shape {normal.shape}; give {n} samples of {len(Sensors.names())} sensors"
        )
    out = core.run(model.core(), model.vector(), wanted, as_float64(normal), external)
    lost = int(out["lost_at"])
    kept = lost if lost < n else n
    if kept < 2:
        raise InvalidInput(
            f"{excitation.name}: the car is lost at once, from {speed:g} m/s; begin faster or ask "
            f"for less"
        )

    def named(columns: FloatArray, names: tuple[str, ...]) -> dict[str, FloatArray]:
        return {name: columns[:kept, i].copy() for i, name in enumerate(names)}

    return ClosedLoop(
        setup,
        excitation,
        np.arange(kept) / setup.rate_hz,
        named(out["sensed"], Sensors.names()),
        named(out["estimate"], ESTIMATES),
        named(out["reference"], _REFERENCES),
        named(out["inputs"], _INPUTS),
        named(out["truth"], TRUTH_CHANNELS),
        out["limits"][:kept],
        lost / setup.rate_hz if lost < n else None,
    )
