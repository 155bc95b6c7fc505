"""Finds statements in what a study prints that contradict each other."""

import re

_NONE = "no remaining error that depends on the driving"
_SOME = "an error that depends on the driving remains"
_STILL = "A function of the driving still predicts"
_DISTURBANCE = "no function of the driving predicts"
_SLOW = "Too slow for a disturbance, so it has a cause"
_SMALL = ("below the errors that", "below the noise of the sensors")
_WHERE = "Next: where that matters to you"
_MORE = "times the one that the training data predict"
_OPEN = "with parameters that serve validation data too"
_ROUNDED = 0.006  # of three digits
_WHY = (
    "Other effects have absorbed what is missing",
    "There is evidence for",
    "Something else is wrong",
    _SOME,
    _STILL,
    _MORE,
    _SLOW,
)


def contradictions(text: str) -> list[str]:
    """Say which statements cannot both be true; empty where all can."""
    found = []
    small = any(words in text for words in _SMALL)
    verdict = text.partition("Verdict: ")[2].partition(" ")[0]
    for word, before, after in re.findall(r"(fell|rose) from ([0-9.]+) to ([0-9.]+)", text):
        if (float(after) < float(before)) != (word == "fell"):
            found.append(f"error {word} from {before} to {after}")
    gone = re.search(r"effects added remove (-?\d+) % \([^)]*\) of the error 1 to 5 s", text)
    share = int(gone[1]) if gone else None
    for told in re.findall(r"effects added explain (\d+) % \([^)]*\) of the error 1 to 5 s", text):
        if share is not None and int(told) != max(share, 0):
            found.append(f"explains {told} % of an error of which {share} % is removed")
    if share is not None and share >= 50 and "no effect of the catalogue explains it" in text:
        found.append(f"no effect explains it, and {share} % of it is gone")
    if verdict in ("adequate", "explained") and _SOME in text and not small:
        found.append(f"{verdict}, and something is left")
    if verdict in ("unknown", "partly_explained") and not any(why in text for why in _WHY):
        found.append(f"{verdict}, and no word of what is left")
    if verdict in ("adequate", "explained") and _STILL in text and not small:
        found.append(f"{verdict}, and a function of the driving predicts what is left")
    if verdict == "adequate" and _MORE in text and not small:
        found.append("adequate, and validation data err more than is foretold")
    if _SLOW in text and (_DISTURBANCE in text or (verdict == "adequate" and not small)):
        found.append("a slow force is left, and what is left is disturbance or nothing")
    if _MORE in text and (_NONE in text or _DISTURBANCE in text):
        found.append("validation data err more than is foretold, and nothing is left")
    if _STILL in text and (_NONE in text or _DISTURBANCE in text):
        found.append("a function of the driving predicts what is left, and none does")
    floors = re.search(r"validation error is ([0-9.]+) noise floors", text)
    last = re.search(r"([0-9.]+)\n  noise floor  ", text)
    if floors and last and abs(float(floors[1]) - float(last[1])) > _ROUNDED * float(last[1]):
        found.append(f"a validation error of {floors[1]}, and of {last[1]} in the table")
    if _OPEN in text and (_SOME in text or _MORE in text):
        found.append("parameters explain what validation data err more, and something else does")
    if _DISTURBANCE in text and _SOME in text:
        found.append("what is left is disturbance, and depends on the driving")
    if re.search(r"explains? (-|nan)", text) or re.search(r"remove (-|nan)", text):
        found.append("a share below nothing is explained")
    if "the effects added do not reduce it" in text:
        if "the effects added explain part of it" in text:
            found.append("what was added explains a part, and does not reduce it")
        if re.search(r"effects added (remove|explain) [1-9]", text):
            found.append("what was added takes a part off the error, and nothing")
        ahead = re.search(r"s ahead on validation data: ([^;]*?)\. [A-Z]", text)
        pairs = re.findall(r"([0-9.]+) -> ([0-9.]+)", ahead[1] if ahead else "")
        fell = bool(pairs) and all(float(b) < 0.8 * float(a) for a, b in pairs)
        if fell and "the baseline has no larger error" not in text:
            found.append("what was added takes nothing off errors that fell with it")
    if "no effect of the catalogue explains it" in text and "raise the time limit" in text:
        found.append("no effect explains it, and some were not tried")
    if verdict == "explained" and (
        "compensates for" in text or "may compensate" in text or "; alias" in text
    ):
        found.append("explained by what only stands in for something else")
    if "The effects named explain" in text and ("compensate" in text or "; alias" in text):
        found.append("a share of all that was added is that of the names alone")
    if "The effects named explain" in text and verdict not in ("explained", "partly_explained"):
        found.append(f"{verdict}, and named physics explains a share")
    if verdict == "adequate" and "Next: " in text and not (small and _WHERE in text):
        found.append("adequate, and something is to be done")
    if verdict == "unknown" and "; confirmed" in text:
        found.append("unknown, and an effect is confirmed")
    if _NONE in text and "a function of steering, speed and acceleration history explains" in text:
        found.append("nothing depends on the driving, and a function of it explains a part")
    return found


def contradictions_of_changes(text: str) -> list[str]:
    """The same of what `changed` prints."""
    head, _, table = text.partition("  ---")
    first = head.partition("\n")[0]
    found, rows = [], {}
    for row in table.splitlines()[1:]:
        cells = [c for c in re.split(r"\s{2,}", row.strip()) if c]
        if len(cells) == 4:
            rows[cells[0]] = (cells[2], cells[3])
    for effect, (sure, sentence) in rows.items():
        said = re.split("[:;]", sentence)[0]
        silent = said in ("not testable", "unchanged")
        if silent != (sure == "-"):
            found.append(f"{effect}: {sure} sure, and {said}")
        if silent and re.search(rf"(changed|likeliest)[^;]*\\b{effect} ?[:(]", first):
            found.append(f"{effect} is told as changed, and its row says {said}")
        if said == "changed" and first.startswith("no change is shown"):
            found.append("nothing is shown, and a row says changed")
    likely = any(sentence.startswith("likely") for _, sentence in rows.values())
    if "something changed, likeliest" in first and not likely:
        found.append("something is likely, and no row says so")
    return found
