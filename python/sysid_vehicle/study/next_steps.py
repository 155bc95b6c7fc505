"""What to do after a study, in the order in which it helps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .._common.text import few
from ..rules import LACKING
from .matters import USUAL_SIZES
from .said import disturbance, in_training, only_elsewhere, slow

if TYPE_CHECKING:
    from .added import AddedEffect
    from .study import Study

SHORT_S = 20.0  # of usable driving: every manoeuvre of the library takes longer
_SHOWN = 4
_ASKED = 2  # effects that a next drive is to show
_MEND = (
    "mend the channels that contradict each other, before anything else: `sysid-vehicle check` "
    "tells delays, scales and places of sensors"
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
        return ()
    found = [*_of_names(study)]
    if study.verdict in LACKING:
        found += _of_what_is_left(study)
    if study.verdict == "not_testable":
        found.append("record corners, steps and sweeps of the steering, and study them")
    return tuple(found)


def _of_names(study: Study) -> list[str]:
    found = []
    for a in study.added:
        # Which of two it is that only stands in for something else is no question.
        if a.confounded_with and a.grade != "alias":
            some = few(a.confounded_with)
            found.append(
                f"tell {a.id} from {some}: `sysid-vehicle next-drive` designs a drive that "
                "does, or give what is known of them to the vehicle file"
            )
    aliases = [a for a in study.added if a.stands_in]
    if aliases:
        found.append(
            f"do not take the size of {', '.join(a.id for a in aliases)} for a property of the "
            "car: what is missing may be something else"
        )
    taken = study.explained
    if study.verdict == "unknown" and taken is not None and taken.low > 0.0:
        found.append(
            "to predict, the final model serves better than the baseline, as a whole and in "
            "driving like this"
        )
    seconds = study.validation.usable_s
    if aliases and seconds < SHORT_S:
        found.append(
            f"validate with longer driving, {SHORT_S:.0f} s or more: {seconds:.2g} s hardly show "
            "what an effect takes of errors 1 to 5 s ahead"
        )
    shown_by = {e.id: e.excited_by for e in study.model.parts}
    for a in _worth_a_drive(aliases):
        found.append(
            f"to find out whether {a.id} is in the car, drive what shows it ({shown_by[a.id]}), or "
            "give what is known of it to the vehicle file"
        )
    return found


def _worth_a_drive(aliases: Sequence[AddedEffect]) -> list[AddedEffect]:
    """Those that are not shown to be none, the one with the largest own share first."""
    open_ = [a for a in aliases if a.grade != "alias" and a.own.known and a.own.value > 0.0]
    return sorted(open_, key=lambda a: -a.own.value)[:_ASKED]


def _of_what_is_left(study: Study) -> list[str]:
    found = []
    if study.stopped:
        was = "was" if len(study.stopped) == 1 else "were"
        found.append(f"give the search more time: {few(study.stopped)} {was} still to be tried")
    if study.verdict == "unknown" and study.small:
        usual = ", ".join(f"{name} {size}" for name, size in USUAL_SIZES.items())
        found.append(
            f"if errors 0.5 to 5 s ahead of less than {usual} do not matter to you, use the "
            "baseline as it is: with `matters`, or `--matters`, the verdict counts larger ones "
            "alone"
        )
    if slow(study):
        found.append(
            f"find what brings about the {' and the '.join(study.slow)}: drive the same way again, "
            "and in the other direction; bank and slope of the road stay with the place, wind with "
            "the course, what belongs to the car with the driving"
        )
    if only_elsewhere(study):
        what = "what is left" if study.added else "what is missing"
        found.append(
            "give the fit driving like the validation data too, and validate with other driving "
            f"of that kind: {what} {in_training(study)}, and no effect can be named that they do "
            "not excite"
        )
    if not study.sensors and not study.checked:
        found.append(
            "check the sensors, and give the result to the study: `sv.check`, or "
            "`sysid-vehicle check`; scales, biases and places of sensors act like "
            "effects of the car"
        )
    if not study.fit.model.nuisances:
        found.append(
            "give the model the offsets that every measured log has (biases, a turned speed "
            "sensor, crossfall): `model.with_nuisances()`, or `--nuisances`"
        )
    apart = "; ".join(str(d) for d in study.disagreements[:_SHOWN])
    if apart:
        found.append(
            f"find out what differs between the drives (speed, load, tyres, road, sensors): {apart}"
        )
    open_ = [
        e.name for e in study.fit.estimates if e.note == "not determined" and "." not in e.name
    ]
    if open_:
        found.append(
            f"drive nearer the limit of the tyres: not determined: {few(open_)}; tyres that are "
            "open hide what is missing"
        )
    if not study.fit.driving.force_known:
        found.append(
            "log the wheel force `fx_n`, if it can be had: without it drag, slopes and the "
            "split of forces cannot be told"
        )
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
            f"look at the shape of what is left of {where} (`study.unknown`), and define an effect "
            "that has it: `sv.define_effect`"
        )
    return found
