"""From columns of numbers to the checked, uniformly sampled channels of a log."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from .._common.arrays import FloatArray
from ..errors import InvalidInput, warn
from ..vehicle import Vehicle
from . import checks
from .channels import CHANNELS, COMMANDS
from .columns import Columns, collect
from .frozen import blank_frozen
from .grid import at, check_time, own_period, to_grid
from .held import blank_held
from .laws.plausibility import check_coherence
from .laws.ranges import dropouts
from .signals import fill_short_gaps, spikes
from .stamps import counted_on
from .standing import blank_standing

LEAST_STRETCH_S = 1.0
"""Driving without a break that is used at least [s]."""
LEAST_USABLE_S = 5.0
"""Driving that something can be learned from, in all logs together [s]."""
_CLOCK_S = 1e6  # a time that begins later is that of a clock, counted from a date
_FILL_S = 0.1
_STANDS = (
    ", or, where it is a command that stands until the next one, put held = true for it in the "
    "channel map"
)
_FILL_SLOW_S = 0.25  # an input that is sampled more slowly is not interpolated


@dataclass(frozen=True)
class Built:
    """Channels on their grid, and whether the source had been uniform."""

    channels: dict[str, FloatArray]
    rate_hz: float
    uniform: bool


def build(
    data: Columns,
    name: str,
    despike: Iterable[str] = (),
    check: bool = False,
    vehicle: Vehicle | None = None,
    *,
    told: bool = False,
    worded: Callable[[str], str] = str,
) -> Built:
    """Make the channels of a log; every error and warning begins with the log's `name`.

    What was `told` when the log was read is no warning again. `worded` gives errors and warnings
    what only the reader of the file knows.
    """
    notes: list[str] = []
    try:
        built = _build(data, tuple(despike), check, vehicle, notes)
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {worded(str(error))}") from error
    for note in () if told else notes:
        warn(f"{name}: {worded(note)}")
    return built


def _build(
    data: Columns,
    despike: tuple[str, ...],
    check: bool,
    vehicle: Vehicle | None,
    notes: list[str],
) -> Built:
    columns = collect(data, notes)
    time_s = columns.pop("time_s")
    if time_s.size < 2:
        raise InvalidInput(f"time_s: only {time_s.size} sample(s); give a log of at least two")
    time_s = counted_on(time_s)
    check_time(time_s)
    if abs(time_s[0]) > _CLOCK_S:
        time_s = time_s - time_s[0]
    if check:
        columns = blank_held(columns, 1.0 / float(np.median(np.diff(time_s))), notes)
        columns = blank_standing(columns, time_s, notes)
    notes += checks.nan_block_notes(time_s, columns)
    if check:
        columns = blank_frozen(columns, time_s, notes)
    for channel in despike:
        if channel not in columns:
            raise InvalidInput(f"{channel}: is to be despiked but is absent; remove the request")
    removed = _handle_spikes(time_s, columns, despike, notes)

    quiet = removed | {key for key, values in columns.items() if not np.isnan(values).any()}
    grid, columns, note = to_grid(time_s, columns)
    notes += [note] if note else []
    rate_hz = (grid.size - 1) / float(grid[-1] - grid[0])
    _fill_inputs(grid, columns, rate_hz, quiet, notes)

    channels = {"time_s": grid}
    channels.update((key, columns.pop(key)) for key in CHANNELS if key in columns)
    channels.update(columns)
    if check:
        _check(channels, rate_hz, vehicle, notes)
    for values in channels.values():
        values.flags.writeable = False
    return Built(channels, rate_hz, uniform=not note)


def _handle_spikes(
    time_s: FloatArray, columns: dict[str, FloatArray], despike: tuple[str, ...], notes: list[str]
) -> set[str]:
    """Blank spikes and dropouts in the channels of `despike`.

    Elsewhere only tell of spikes in the steering.
    """
    removed = set()
    for name in dict.fromkeys((*despike, "steer_rad")):
        lost = dropouts(name, columns[name])
        if name in despike and lost.size:
            notes.append(
                f"{name}: removed {lost.size} value(s) that no car reaches, the first "
                f"{columns[name][lost[0]]:.4g} at {at(int(lost[0]), time_s)}; check the sensor"
            )
            columns[name][lost] = np.nan
            removed.add(name)
        found = np.setdiff1d(spikes(columns[name]), lost)
        if found.size == 0:
            continue
        place = f"{found.size} one-sample spike(s), first at {at(int(found[0]), time_s)}"
        times = checks.listing(time_s[found])
        if name in despike:
            columns[name][found] = np.nan
            removed.add(name)
            notes.append(f"{name}: removed {place}; t = {times}; check that they are no movement")
        else:
            notes.append(
                f"{name}: {place}; t = {times}; the model would follow them: put "
                f"despike = true for {name} in the channel map"
            )
    return removed


def _fill_inputs(
    time_s: FloatArray,
    columns: dict[str, FloatArray],
    rate_hz: float,
    quiet: set[str],
    notes: list[str],
) -> None:
    """Interpolate short holes in what drives the model.

    Holes of the channels in `quiet` come from removed spikes or gaps in time, which have their own
    note.
    """
    drive = "fx_n" if "fx_n" in columns else "ax_mps2"
    for name in ("steer_rad", drive):
        period = own_period(time_s, columns[name])
        stands = _STANDS if name in COMMANDS else ""
        longest = max(_FILL_S, period if period <= _FILL_SLOW_S else 0.0)
        columns[name], gaps = fill_short_gaps(columns[name], max(1, round(longest * rate_hz)))
        if gaps and period * rate_hz > 1.5:
            notes.append(
                f"{name}: holds a value only every {period:.3g} s and was interpolated in between, "
                f"because the model needs this input at every sample; record it at "
                f"{rate_hz:.4g} Hz{stands}"
            )
        elif gaps and name not in quiet:
            count = sum(b - a for a, b in gaps)
            notes.append(
                f"{name}: {count} missing sample(s) in {len(gaps)} short hole(s), first at "
                f"{at(gaps[0][0], time_s)}, were interpolated, because the model needs this input "
                f"at every sample; check the recording if there are many"
            )


def _check(
    channels: dict[str, FloatArray], rate_hz: float, vehicle: Vehicle | None, notes: list[str]
) -> None:
    time_s = channels["time_s"]
    usable = checks.usable_seconds(channels, rate_hz)
    if usable < LEAST_STRETCH_S or usable < LEAST_USABLE_S <= time_s[-1] - time_s[0]:
        said = (
            f"vx_mps and steer_rad: only {usable:.3g} s of the log can be used (samples 0 to "
            f"{time_s.size - 1}, t = {time_s[0]:.6g} to {time_s[-1]:.6g} s, car moving, steering "
            f"known); at least {LEAST_STRETCH_S:g} s of each log and {LEAST_USABLE_S:g} s of all "
            "that are used together are needed, 30 s with corners are good"
        )
        if usable < LEAST_STRETCH_S:
            raise InvalidInput(said)
        notes.append(said)
    with np.errstate(over="ignore"):
        base = None if vehicle is None else vehicle.wheelbase_m
        found = check_coherence(channels, rate_hz, wheelbase_m=base)
    # What is doubted for cars of usual size is compared with the car itself where it is fitted.
    notes += [doubtful.text for doubtful in found if vehicle is None or not doubtful.by_the_car]
    dull = checks.excitation_note(channels, rate_hz)
    notes += checks.low_rate_note(rate_hz)
    notes += checks.placeholder_notes(channels, excited=not dull)
    notes += checks.constant_notes(channels, excited=not dull)
    notes += checks.repeated_notes(channels, rate_hz)
    # Of single manoeuvres it is asked where they are used, of all together (`check_excitation`).
    notes += [dull] if dull and usable >= LEAST_USABLE_S else []
