"""What to do after a study, in the order in which it helps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..._common.text import few
from ...rules import LACKING
from ..judge.matters import USUAL_SIZES
from ..limit import TOGETHER
from .sentences import disturbance, extrapolates, in_training, only_elsewhere, slow

if TYPE_CHECKING:
    from ..study import Study
    from .added import AddedEffect

SHORT_S = 20.0  # of usable driving: every manoeuvre of the library takes longer
_SHOWN = 4
_ASKED = 2  # effects that a next drive is to show
_RATIO = "steer_ratio.ratio_error"
_PLACES = ("ins_lever_arm.forward_m", "imu_lever_arm.forward_m")
_MEND = (
    "first correct the channels that contradict each other: `sysid-vehicle check` finds delays, "
    "scales and positions of sensors"
)


def next_steps(study: Study) -> tuple[str, ...]:
    """Sentences that say what to mend, record or look at; none where the model may be used.

    Parameters
    ----------
    study : Study
    """
    if study.train[-1].unrelated:
        return (_MEND,)
    if study.verdict == "adequate":
        # Too small to matter as a rule, and told even so.
        return (
            (f"where that matters to you, {_drive_alike(study)}",) if only_elsewhere(study) else ()
        )
    found = [*_of_rear_wheels(study), *_of_names(study)]
    if study.verdict in LACKING:
        found += _of_what_is_left(study)
    if study.verdict == "not_testable":
        found.append("record corners, steps and sweeps of the steering, and study them")
    return tuple(found)


def _of_rear_wheels(study: Study) -> list[str]:
    """Ask whether the rear wheels steer where a steering ratio and a place together say so.

    Rear wheels at a share of the angle of the front ones leave the difference to turn the car, and
    move the point that follows the path ahead: by the wheelbase, times the share over the rest.
    """
    told = {e.name: e for e in study.estimates}
    place = next((p for p in _PLACES if p in told), "")
    if not place or _RATIO not in told:
        return []
    ratio, ahead, sure = told[_RATIO], told[place], study.rules.sure
    share = -ratio.value
    slope = study.fit.model.vehicle.wheelbase_m / (1.0 - share)
    expected, std = slope * share, slope / (1.0 - share) * ratio.std
    if abs(share) < sure * ratio.std or abs(ahead.value) < sure * ahead.std:
        return []
    if not abs(ahead.value - expected) < sure * math.hypot(ahead.std, std):
        return []
    place = place.split(".")[0]
    way = "the same way" if share > 0.0 else "the other way"
    by = f"{100.0 * abs(share):.2g} % of the angle of the front ones, {way}"
    text = (
        f"find out whether the rear wheels steer: steer_ratio and {place} together do what rear "
        f"wheels do that steer by {by} (forward_m would be {expected:.2g} m then); "
        f"docs/howto/own_effect.md has effects that steer them"
    )
    return [text]


def open_groups(study: Study) -> tuple[tuple[str, ...], ...]:
    """Effects that a further drive is to tell apart, in each group the one that was added first."""
    found: dict[frozenset[str], tuple[str, ...]] = {}
    for a in study.added:
        # Which of two it is that only stands in for something else is no question.
        if a.confounded_with and a.grade != "alias":
            group = (a.id, *a.confounded_with)
            found.setdefault(frozenset(group), group)
    return tuple(found.values())


def _of_names(study: Study) -> list[str]:
    found = []
    for group in open_groups(study):
        first, *others = group
        beside = [e for e in study.model.effects if e not in group]
        also = f" --effects {','.join(beside)}" if beside else ""
        found.append(
            f"separate {first} from {few(others)}: `sysid-vehicle next-drive --between "
            f"{','.join(group)}{also}` or `sv.next_drive(study)` says what to drive, or state what "
            "is known of them in the vehicle file"
        )
    aliases = [a for a in study.added if a.stands_in]
    if aliases:
        found.append(
            f"do not take the size of {', '.join(a.id for a in aliases)} as a property of the "
            "car: another effect may be missing instead"
        )
    taken = study.explained
    if study.verdict == "unknown" and study.added and taken is not None and taken.low > 0.0:
        found.append(
            "for prediction use the final model, as a whole and in similar driving: it is better "
            "than the baseline"
        )
    seconds = study.validation.usable_s
    if aliases and seconds < SHORT_S:
        found.append(
            f"validate with longer driving, {SHORT_S:.0f} s or more: {seconds:.2g} s hardly show "
            "how far an effect reduces the errors 1 to 5 s ahead"
        )
    shown_by = {e.id: e.excited_by for e in study.model.parts}
    for a in _worth_a_drive(aliases):
        found.append(
            f"to find out whether the car has {a.id}, record driving that excites it "
            f"({shown_by[a.id]}), or state what is known of it in the vehicle file"
        )
    return found


def _worth_a_drive(aliases: Sequence[AddedEffect]) -> list[AddedEffect]:
    """Those that are not shown to be none, the one with the largest own share first."""
    open_ = [a for a in aliases if a.grade != "alias" and a.own.known and a.own.value > 0.0]
    return sorted(open_, key=lambda a: -a.own.value)[:_ASKED]


def _of_what_is_left(study: Study) -> list[str]:
    told = _of_what_was_told(study)
    return [
        *told,
        *_of_the_search(study),
        *_of_sensors(study),
        *_of_driving(study),
        *_of_use(study),
    ]


def _of_what_was_told(study: Study) -> list[str]:
    """Priors and bounds of the user that the data contradict: they look like a missing effect."""
    fit, found = study.fit, []
    wrong = [a.name for a in fit.against_priors]
    if wrong:
        found.append(f"correct the prior of {few(wrong)}, or widen it: the data contradict it")
    given = {n for n, told in fit.model.settings.items() if told.bounds is not None}
    held = [e.name for e in fit.estimates if e.note == "at bound" and e.name in given]
    if held:
        found.append(f"correct the bounds of {few(held)}, or widen them: the fit ends at them")
    return found


def _of_the_search(study: Study) -> list[str]:
    found = []
    if study.stopped:
        was = "was" if len(study.stopped) == 1 else "were"
        found.append(f"raise the time limit: {few(study.stopped)} {was} not tried")
    elif TOGETHER in study.late_facts:
        found.append("raise the time limit: effects that hold only together were not all tried")
    if study.sufficient is not None:
        as_fitted = study.sufficient is study.fits[0]
        how = "as it is" if as_fitted else "fitted to predictions (`study.sufficient`)"
        usual = ", ".join(f"{name} {size}" for name, size in USUAL_SIZES.items())
        found.append(
            f"if errors 0.5 to 5 s ahead of less than {usual} do not matter to you, use the "
            f"baseline {how}: with `matters`, or `--matters`, the verdict counts only larger ones"
        )
    if slow(study):
        found.append(
            f"find the cause of the {' and the '.join(study.slow)}: repeat the drive in both "
            "directions; bank and slope of the road repeat at the same place, wind with the same "
            "heading, an effect of the car with the same manoeuvre"
        )
    if only_elsewhere(study):
        found.append(_drive_alike(study))
    return found


def _drive_alike(study: Study) -> str:
    what = "the remaining error" if study.added else "what is missing"
    return (
        "add driving like the validation data to the training data, and validate with other "
        f"driving of that kind: {what} {in_training(study)}, and no effect can be named that "
        "they do not excite"
    )


def _of_sensors(study: Study) -> list[str]:
    found = []
    if not study.sensors and not study.checked:
        found.append(
            "check the sensors, and give the result to the study: `sv.check`, or "
            "`sysid-vehicle check`; scales, biases and positions of sensors act like "
            "effects of the car"
        )
    if not study.fit.model.nuisances:
        found.append(
            "give the model the offsets that every measured log has (biases, a turned speed "
            "sensor, crossfall): `model.with_nuisances()`, or `--nuisances`"
        )
    return found


def _of_driving(study: Study) -> list[str]:
    found = []
    by_log = "; ".join(study.between_logs[:_SHOWN])
    if by_log:
        found.append(
            "find out what differs between the training logs (tyres, load, road, sensors): "
            f"{by_log}; `sv.changed` compares two of them"
        )
    apart = "; ".join(str(d) for d in study.disagreements[:_SHOWN])
    if apart:
        found.append(
            f"find out what differs between the drives (speed, load, tyres, road, sensors): {apart}"
        )
    if extrapolates(study):
        found.append(
            "add driving with slip angles as large as those of the validation data to the training "
            "data: beyond those that were fitted shares of the error are not counted"
        )
    open_ = [
        e.name for e in study.fit.estimates if e.note == "not determined" and "." not in e.name
    ]
    if open_:
        found.append(
            f"drive nearer the limit of the tyres: {few(open_)} not determined, and undetermined "
            "tyre parameters hide what is missing"
        )
    if not study.fit.driving.force_known:
        found.append(
            "log the wheel force `fx_n` if possible: without it drag, slopes and the split of "
            "forces cannot be determined"
        )
    return found


def _of_use(study: Study) -> list[str]:
    found = []
    if study.predicting is not None and study.predicting.helps:
        which = "final" if study.predicting.explains else "baseline"
        found.append(
            f"where errors some seconds ahead matter, use `study.predicting.{which}`: its "
            "parameters are fitted to them"
        )
    where = " and ".join(
        dict.fromkeys(
            o.strongest
            for o in (study.omnibus, study.omnibus_together)
            if o is not None and o.rejects and not disturbance(study)
        )
    )
    if where:
        found.append(
            f"look at the shape of the remaining {where} (`study.unknown`), and define an effect "
            "that has it: `sv.define_effect`"
        )
    return found
