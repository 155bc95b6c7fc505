"""The rules by which effects are claimed: all limits, and what follows from measured numbers.

1. All effects are scored at once. There is evidence for an effect whose p-value, corrected for
   testing all of them, is below `alpha`. One that the fit copies (`retained`) is not testable.
2. The best are refitted, and lags whatever they score where the best one leaves something
   (`strict`). A refit counts if it gains `price` BIC penalties, or ln n in nats.
3. It is accepted if the validation data confirm it (`accept`): two of three measures speak for it
   (`lean`, `interval`), or its likelihood alone (`sure`); no error 1 to 5 s ahead grows by what it
   does (`worse`).
4. Effects whose likelihoods differ by less than `apart` are confounded; validation data choose. An
   accepted effect gives way to others of its kind (`near`) that lead by `apart`, or are simpler.
5. An effect within `insignificant` standard errors of nothing is dropped unless BIC needs it.
   So is one with which errors ahead grow beside all others of an incomplete model (`harmful`).
6. When nothing is added any more, the final model is tested for anything left: at `level` on the
   training data, for one effect more, and at `strict` for anything unknown on all data together.
   Where the driving predicts no more than `explainable` of what is left on any data, only evidence
   below `strict` counts. A share alone is no evidence: who steers against disturbances makes the
   driving tell of them. What a baseline errs on validation data beyond what training data foretell
   is left too, at `strict` and by more than `explainable` (`unforeseen`), and a disturbance of it
   that lasts as long as any may: slow forces have a cause.
7. Nothing left: what was added explains it. An added effect is not named if its value is physically
   implausible, or differs between pieces of the driving by a size that matters, or if something
   unknown does all that it does and more: by a part worth a name (`explainable`), where it is so
   flexible that it contains the effect.
8. Something left, or taken up by what only stands in for it: a name stands by its own share, what
   comes back of the error 1 to 5 s ahead, of the motion that it moves, where the final model lacks
   it and all else is fitted anew. Where slip angles of validation data are larger than those that
   were fitted, errors are those of extrapolated tyres, and do not count. It is above `taken` and
   shown not to be chance, on training and on validation data; where less than `most` of that error
   is gone, the whole interval of the mean of both is above `taken`. Of effects that act alike, and
   have no such share beside each other, or are not shown to be off nothing (`insignificant`), the
   share of all of them counts, and they are named as a group, but for one without which errors are
   shown to be smaller, all else fitted anew. Nothing that has no share of either kind takes more,
   and moves a channel that it moves. All that was added together is shown to take a share, of that
   error or of what could be explained of it. Nothing else speaks against it: a value, not only an
   end of its interval, that no car has or that does not matter; an interval that holds no effect
   where it includes what is missing (`insignificant`); errors ahead of its motion that grow with
   all that was added, as the models are fitted; validation data that by themselves tell another
   one, so that both do not show it to be off nothing (`insignificant`); an effect like it that is
   likelier in its place (`apart`).
   Where the final model errs by less than the noise of the sensors (`buried`), no share can be
   shown: an effect without rivals, and without a stand-in beside it, keeps its name if the
   likelihood of validation data needs it (`interval`), unless training data show more (`strict`).
9. The verdict follows from what is left and which names stand (`verdict`).
10. `Rules` holds every limit with unit, meaning, and the benchmark that chose or judges it.

Nothing here sees a fit or a log: others measure, this decides.
"""

from .accept import ErrorChange, Gain, Measures, accept, bic, harmful, worse
from .facts import LACKING, Added, Decision, Facts, Tested, Verdict, Withdrawn
from .limits import USUAL, Rules
from .share import (
    NONE_GONE,
    UNKNOWN,
    Share,
    low_of_mean,
    share_between,
    share_explained,
    share_of,
)
from .verdict import (
    Grade,
    excess,
    grade,
    incomplete,
    little,
    something_left,
    standing,
    unforeseen,
    verdict,
)

__all__ = [
    "LACKING",
    "NONE_GONE",
    "UNKNOWN",
    "USUAL",
    "Added",
    "Decision",
    "ErrorChange",
    "Facts",
    "Gain",
    "Grade",
    "Measures",
    "Rules",
    "Share",
    "Tested",
    "Verdict",
    "Withdrawn",
    "accept",
    "bic",
    "excess",
    "grade",
    "harmful",
    "incomplete",
    "little",
    "low_of_mean",
    "share_between",
    "share_explained",
    "share_of",
    "something_left",
    "standing",
    "unforeseen",
    "verdict",
    "worse",
]
