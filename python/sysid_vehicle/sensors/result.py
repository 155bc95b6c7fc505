"""What a check of the sensors found, and a log put right by it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._common.arrays import FloatArray
from .._common.text import html_list, html_paragraph, html_table, number, text_table
from ..effects import Effect
from ..errors import InvalidInput, near_names
from ..log import Log
from ..rules import USUAL, Rules
from ..saved import save
from ..vehicle import Vehicle
from .apply import LATE, corrected, retimed
from .condition import Conditioning
from .faults import SensorFault, leaning, to_put_right
from .kinematics.colour import Colour
from .kinematics.equations import Readings, lean
from .kinematics.estimate import Estimate
from .kinematics.motion import Stretch
from .moments import Moment, left_out
from .picture import drawn
from .settled import narrowed, settled
from .signals import MOVING, Signal
from .texts import ON_CORRECTION, gradient, map_line, slips, swings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SURE = 3.0  # standard errors of a mean offset
_HEAD = ("fault", "channel", "value", "95 % interval", "verdict")
_SIGNAL_HEAD = ("channel", "rate", "held", "quantum", "missing", "noise", "colour")
_GAINS = {"ax_mps2": "gain_ax", "ay_mps2": "gain_ay", "yaw_rate_radps": "gain_yaw_rate"}
_LEANING = {"ax_mps2": "gain_ax", "ay_mps2": "gain_ay"}
_BIASES = {"yaw_rate_radps": "bias_yaw_rate_radps", "vy_mps": "bias_vy_mps"}


@dataclass(frozen=True, eq=False, repr=False)
class SensorCheck:
    """What the channels of a log say of each other; made by :func:`sysid_vehicle.check`.

    Attributes
    ----------
    logs : tuple of Log
        What was checked.
    faults : tuple of SensorFault
        Every fault with its interval, or why it cannot be told.
    signals : tuple of Signal
        Rate, hold and quantum of every channel of every log.
    estimate : Estimate
        The estimate behind it: faults, motion, road.
    noise : dict of (Colour, ndarray)
        Noise of each channel at its own rate, and what the channel should have read.
    readings : tuple of Readings
        The samples that were used.
    stretches : tuple of Stretch
        The driving that was used.
    vehicle : Vehicle or None
        The car.
    conditioning : Conditioning or None
        Low-passes of the sensors, and what takes them and vibration out; None where the logs had
        been freed of these.
    moments : tuple of Moment
        In which one channel contradicts the others; all else is told without its readings there.
    """

    logs: tuple[Log, ...]
    faults: tuple[SensorFault, ...]
    signals: tuple[Signal, ...]
    estimate: Estimate
    noise: dict[str, tuple[Colour, FloatArray]]
    readings: tuple[Readings, ...]
    stretches: tuple[Stretch, ...]
    vehicle: Vehicle | None = None
    conditioning: Conditioning | None = None
    moments: tuple[Moment, ...] = ()

    def save(self, path: str | Path) -> None:
        """Write the check, with the logs; :func:`sysid_vehicle.load` reads it.

        Raises
        ------
        InvalidInput
            If the file cannot be written.
        """
        save(self, path)

    @property
    def found(self) -> tuple[SensorFault, ...]:
        """Faults that are there."""
        return tuple(fault for fault in self.faults if fault.found)

    @property
    def not_told(self) -> tuple[SensorFault, ...]:
        """Faults that this log cannot show."""
        return tuple(fault for fault in self.faults if not fault.told)

    @property
    def low_passes(self) -> dict[str, dict[str, float]]:
        """The low-pass of the second order that each channel's noise shows: `apply` undoes it.

        `corner_hz`, `damping`, `delay_s` of slow motion, and the standard error `delay_std_s`.
        """
        return {} if self.conditioning is None else self.conditioning.figures

    __iter__ = None  # numbers are no names

    def __getitem__(self, name: str) -> SensorFault:
        """Return a fault by its name.

        Raises
        ------
        InvalidInput
            If there is none of this name; near names are given.
        """
        known = {fault.name: fault for fault in self.faults}
        if name in known:
            return known[name]
        raise InvalidInput(f"there is no sensor fault '{name}'{near_names(name, tuple(known))}")

    @cached_property
    def settles(self) -> tuple[str, ...]:
        """Effects of the catalogue that :meth:`apply` has dealt with, or that are not there."""
        return settled(self.faults)

    def narrowed(self, effects: Iterable[Effect], rules: Rules = USUAL) -> tuple[Effect, ...]:
        """Effects with no more room than kinematics leaves them beside :meth:`apply`."""
        return narrowed(effects, self.faults, rules)

    @property
    def offsets(self) -> dict[str, tuple[float, float]]:
        """Mean of what `ax_mps2` and `ay_mps2` read beyond the motion, and its deviation [m/s2].

        Bias of the sensor and mean slope of the road are one.
        """
        o = self.estimate.offsets
        return {"ax_mps2": o["grade"], "ay_mps2": o["bank"]}

    @property
    def map_lines(self) -> tuple[str, ...]:
        """Lines for the table ``[channels]`` of a channel map that put right what was found."""
        values, lines = self._taken_out, []
        for channel in MOVING:
            gain, bias = (values.get(table.get(channel, ""), 0.0) for table in (_GAINS, _BIASES))
            delay = sum(values.get(name, 0.0) for name in LATE.get(channel, ()))
            if delay or gain or bias:
                lines.append(map_line(channel, delay, gain, bias))
        return tuple(lines)

    @cached_property
    def _taken_out(self) -> dict[str, float]:
        """What a log is freed of: with gravity by roll and pitch goes what it makes late.

        Delay and leaning are told together. Where they are not off nothing both stay.
        """
        values = to_put_right(self.faults)
        for channel, gain in _LEANING.items():
            if gain in values:
                axis = channel[:2]
                values.pop(f"delay_{axis}_s", None)
                values[f"lean_{axis}_s"] = leaning(self.estimate, self.faults, axis)
        return values | self.estimate.slips

    def apply(self, log: Log) -> Log:
        """Return the log with what was found put right, and with what was done recorded.

        Low-passes of the sensors and vibration are taken out, and time offsets, biases and scales
        (gravity by roll and pitch is one), and slip of wheels whose speed is logged; accelerations
        are those of the speed sensor's place, in its direction. Moments in which a channel
        contradicts the others are left out of it. Where the delay of one speed was
        found, a like one of the other is put right too. Faults that were not found are left alone;
        so is the steering angle. Where no wheel force is logged the measured a_x is what drives the
        car, and its mean beyond the motion is taken out: bias of the sensor and slope of the road
        are one there. That of a_y is left to the tyres, which can tell them.
        """
        spared, said = left_out(log, self.logs, self.moments)
        log = log.corrected(spared, said) if spared else log
        if self.conditioning is not None:
            log = self.conditioning.apply(log)
        channels, what = corrected(log, self._taken_out)
        bias, std = self.offsets["ax_mps2"]
        if log.has("ax_mps2") and not log.has("fx_n") and abs(bias) > _SURE * std:
            channels["ax_mps2"] = channels.get("ax_mps2", log["ax_mps2"]) - bias
            what.append(f"ax_mps2: {bias:.3g} m/s2 on average beyond the motion taken out")
        return log.corrected(channels, what, retimed(log, self._taken_out, self.faults))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What follows from the faults and the noise, in sentences."""
        said = [] if self.conditioning is None else self.conditioning.remarks(self.logs)
        said += map(str, self.moments)
        for axis, channel, name in (
            ("roll", "ay_mps2", "gain_ay"),
            ("pitch", "ax_mps2", "gain_ax"),
        ):
            fault = self[name]
            if fault.found and fault.value < 0.0:
                said.append(f"{channel}: reads too little, where gravity by {axis} only adds")
            elif fault.found:
                low, high = (gradient(x) for x in fault.interval)
                said.append(
                    f"{channel}: the scale is that of an accelerometer on a body with a {axis} "
                    f"gradient of {gradient(fault.value):.3g} deg/g ({low:.3g} to {high:.3g}); "
                    f"kinematics cannot tell it from a scale error{self._leaning(channel)}"
                )
        said += slips(self.estimate.faults) + swings(self.estimate.faults)
        for signal in self.signals:
            if signal.held_rows:
                said.append(
                    f"{signal.log}: {signal.channel} repeats each value for "
                    f"{signal.held_rows:.3g} rows; its first one counts"
                )
        arm = self["imu_forward_m"]
        if self.vehicle is not None and arm.found and abs(arm.value) > self.vehicle.wheelbase_m:
            said.append(
                f"the IMU is not {arm.value:.3g} m from the speed sensor in a car with a wheelbase "
                f"of {self.vehicle.wheelbase_m:.3g} m: look for a delay or for a wrong channel"
            )
        if not self.estimate.settled:
            said.append(
                "the estimate had not settled after the last round: sensors disagree in a way that "
                "none of these faults describes; take the intervals with care"
            )
        return tuple(said)

    def _leaning(self, channel: str) -> str:
        share, late_s = lean(channel, self.estimate.faults)
        if not share:
            return ""
        about = 1000.0 * share * late_s
        shown = self._taken_out.get(f"lean_{channel[:2]}_s", 0.0)
        left = "" if shown else ", which this log does not show"
        return f"; delays stand beside the {about:.2g} ms by which such a body makes it late{left}"

    def _rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = []
        taken = to_put_right(self.faults)
        for fault in self.faults:
            span, value = "", ""
            if fault.measured:
                low, high = fault.interval
                span = f"{number(low, 3)} to {number(high, 3)} {fault.unit}".rstrip()
                value = number(fault.value, 3)
            verdict = "found" if fault.found else "not there" if fault.told else "cannot be told"
            if fault.name in taken and not fault.found:
                verdict = "like the other speed"
            rows.append((fault.title, fault.channel, value, span, verdict))
        return rows

    @property
    def _signal_head(self) -> tuple[str, ...]:
        return ("log", *_SIGNAL_HEAD) if len(self.logs) > 1 else _SIGNAL_HEAD

    def _signal_rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = []
        for s in self.signals:
            colour = self.noise[s.channel][0] if s.channel in self.noise else None
            rows.append(
                (
                    *((s.log,) if len(self.logs) > 1 else ()),
                    s.channel,
                    f"{s.rate_hz:.4g} Hz",
                    f"{s.held_rows:.3g}" if s.held_rows else "",
                    f"{s.quantum:.3g}" if s.quantum else "",
                    f"{100.0 * s.missing:.3g} %" if s.missing > 5e-4 else "",
                    f"{colour.std:.3g}" if colour else "",
                    colour.words(s.rate_hz) if colour else "",
                )
            )
        return rows

    def _said(self) -> list[str]:
        told = (f"{f.title} ({f.channel}), {f.why_not}" for f in self.not_told)
        return [f"cannot be told: {text}" for text in (*told, *ON_CORRECTION)]

    def _offset_lines(self) -> list[str]:
        return [
            f"{channel}: {value:.3g} +- {std:.2g} m/s2 on average beyond the motion: bias or slope "
            f"of the road"
            for channel, (value, std) in self.offsets.items()
            if any(r.channel == channel for r in self.readings)
        ]

    @property
    def headline(self) -> str:
        """One sentence."""
        names = ", ".join(log.name for log in self.logs)
        filtered = " Sensors have a low-pass." if self.low_passes else ""
        if self.moments:
            jumped = list(dict.fromkeys(m.channel for m in self.moments))
            contradict = "contradicts" if len(jumped) == 1 else "contradict"
            filtered += f" For a moment {' and '.join(jumped)} {contradict} the others."
        if self.found:
            several = len(self.found) > 1
            told = f"{len(self.found)} sensor faults were" if several else "1 sensor fault was"
            return f"{names}: {told} found.{filtered}"
        either = {n: self[n] for f in self.faults if f.or_another for n in (f.name, f.or_another)}
        if either:
            which = " or ".join(f"{f.title} ({f.channel})" for f in either.values())
            return f"{names}: the sensors do not agree: {which}.{filtered}"
        if not self.estimate.settled:
            return f"{names}: no fault was found, but the sensors do not agree.{filtered}"
        if self.moments:
            return f"{names}: no fault that lasts was found.{filtered}"
        return f"{names}: the sensors agree; no fault was found.{filtered}"

    def __str__(self) -> str:
        lines = [self.headline, text_table(_HEAD, self._rows()), ""]
        lines += [text_table(self._signal_head, self._signal_rows()), ""]
        lines += [*self._offset_lines(), *self.remarks, *self._said()]
        if self.map_lines:
            lines += ["", "For the channel map (multiply factors with those that stand there):"]
            lines += [f"  {line}" for line in self.map_lines]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<SensorCheck {self.headline}>"

    def _repr_html_(self) -> str:
        lines = "\n".join(self.map_lines)
        return "".join(
            (
                html_paragraph(self.headline),
                html_table(_HEAD, self._rows()),
                html_table(self._signal_head, self._signal_rows()),
                html_list([*self._offset_lines(), *self.remarks, *self._said()]),
                f"<pre>{escape(lines)}</pre>" if lines else "",
            )
        )

    def residuals(self, channel: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Time, reading and what the motion makes of it, each of shape (n,).

        Raises
        ------
        InvalidInput
            If the channel was not checked.
        """
        for r in self.readings:
            if r.channel == channel:
                return r.time_s, r.values, self.noise[channel][1]
        raise InvalidInput(
            f"{channel} was not checked; checked were {', '.join(r.channel for r in self.readings)}"
        )

    def plot(self, channel: str = "ay_mps2", ax: Axes | None = None) -> Axes:
        """Draw what a channel read, and what it should have read of the common motion.

        Several logs stand side by side; what was left out is shaded.

        Parameters
        ----------
        channel : str
            Which.
        ax : matplotlib Axes, optional
            Where to draw; a new figure is made without it.

        Returns
        -------
        matplotlib Axes
        """
        expected = self.residuals(channel)[2]
        (own,) = (r for r in self.readings if r.channel == channel)
        return drawn(own, expected, self.stretches, self.logs, self.moments, ax)

    def to_dict(self) -> dict[str, Any]:
        """Every figure, for JSON."""
        return {
            "logs": [log.name for log in self.logs],
            "faults": {
                f.name: {
                    "channel": f.channel,
                    "value": f.value if f.measured else None,
                    "std": f.std if f.measured else None,
                    "unit": f.unit,
                    "found": f.found,
                    "told": f.told,
                    "why_not": f.why_not,
                    "or_another": f.or_another,
                }
                for f in self.faults
            },
            "offsets_mps2": {k: list(v) for k, v in self.offsets.items()},
            "noise": {
                c: {"std": k.std, "white_std": k.white_std, "phi": k.phi.tolist()}
                for c, (k, _) in self.noise.items()
            },
            "low_passes": self.low_passes,
            "signals": [vars(s) for s in self.signals],
            "moments": [asdict(m) for m in self.moments],
            "settles": list(self.settles),
            "channel_map": list(self.map_lines),
            "remarks": list(self.remarks),
        }
