"""What channels of cars are called, by loggers, tools and people."""

from __future__ import annotations

import re

from .units import FACTORS, plain, states_nothing

# Of the car, and not of a tyre.
_SIDESLIP = (
    r"^(?!.*\b(fl|fr|rl|rr|front|rear|axle|tyres?|tires?|wheels?|ratio|rate|dot)\b)"
    r".*(\bslip ?ang\w*|\bside ?slip|\bschwimmwinkel|^beta\b)"
)

# By channel: patterns of a name in plain words, the surest first.
_PATTERNS: dict[str, tuple[str, ...]] = {
    "time_s": (
        r"^time( s)?$",
        r"^(t|zeit|(time ?)?stamps?( s| sec\w*)?|times?|tout|utc time)$",
        r"\btime\b|^(header )?stamp\b|^(sec(ond)?s|elapsed|epoch)\b",
    ),
    "vx_mps": (
        r"^v ?x( mps)?$",
        r"twist linear x$|(long\w*|forward) (speed|vel\w*)|(speed|vel\w*) (x|long\w*)$",
        r"(vehicle|ground|corr\w*|gps|car|veh) (speed|vel\w*)|^v (veh|car|ego)|v fzg",
        r"^(speed|velocity|vel|geschwindigkeit|v)( kmh| kph| mps| mph)?$",
        r"\b(speed|velocity|geschwindigkeit)\b",
    ),
    "vy_mps": (
        r"^v ?y( mps)?$",
        r"twist linear y$|lat\w* (speed|vel\w*)|(speed|vel\w*) (y|lat\w*)$|quergeschw\w*",
        _SIDESLIP,
    ),
    "yaw_rate_radps": (
        r"yaw ?rate|yaw ?vel\w*|gier ?(rate|geschw\w*)",
        r"angular velocity z$|gyro\w* (z|yaw)|twist angular z$|psi ?(p|dot|rate)$",
        r"^(w|omega|rate|gyro|ang vel) ?z$|\byaw\b.*\b(dps|radps|degps)\b",
    ),
    "ax_mps2": (
        r"^a ?x( mps2)?$|acc ?x$|x acc\w*$",
        r"long\w* (acc\w*|g\b)|acc\w* (x|long\w*)|g (force )?(long|x)\w*",
        r"inline acc\w*|laengsbeschl\w*",
    ),
    "ay_mps2": (
        r"^a ?y( mps2)?$|acc ?y$|y acc\w*$",
        r"lat\w* (acc\w*|g\b)|acc\w* (y|lat\w*)|g (force )?(lat|y)\w*|querbeschl\w*",
    ),
    "steer_rad": (
        r"road ?wheel angle|^steer rad$|front wheel angle",
        r"steer\w* ?(wheel )?ang\w*|lenk(rad)?winkel|\bswa\b|str\w* ?whl ?ang\w*|hand ?wheel",
        r"\b(steer|steering|steered|delta)\b",
    ),
    "fx_n": (
        r"^f ?x( n)?$",
        r"(wheel|drive|traction|long\w*|total) force( total| x)?$|force x$|antriebskraft",
    ),
}
_REFUSED: dict[str, str] = {
    "time_s": r"\b(lap|run|delta|remaining|sector)\b",
    "vx_mps": r"\b(wheel|whl|engine|rpm|fl|fr|rl|rr|lat\w*|vert\w*|wind|angular|steer\w*|y|z)\b",
    "vy_mps": r"\b(angular|wind|acc\w*)\b",
    "yaw_rate_radps": r"\b(acc\w*|target|ref\w*|covariance)\b",
    "ax_mps2": r"\b(yaw|lat\w*|vert\w*|angular|covariance|target)\b",
    "ay_mps2": r"\b(yaw|long\w*|vert\w*|angular|covariance|target)\b",
    "steer_rad": r"\b(torque|rate|speed|vel\w*|moment|target|force|motor|current|rear)\b",
    "fx_n": r"\b(fl|fr|rl|rr|brake|steer\w*)\b",
}
_SI = {
    "time_s": "s",
    "vx_mps": "m/s",
    "vy_mps": "m/s",
    "yaw_rate_radps": "rad/s",
    "ax_mps2": "m/s2",
    "ay_mps2": "m/s2",
    "steer_rad": "rad",
    "fx_n": "N",
}


def words(name: str) -> str:
    """Return a name in plain words: ``ESP_YawRate.z`` as ``esp yaw rate z``."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name)
    return " ".join(re.sub(r"[^A-Za-z0-9]+", " ", apart).lower().split())


def rank(name: str, unit: str, channel: str) -> float:
    """Return how well a name and its unit suit a channel: 0 not at all, 1 and more well."""
    text = words(name)
    if name == channel:
        return 10.0
    if re.search(_REFUSED[channel], text):
        return 0.0
    patterns = _PATTERNS[channel]
    score = next(
        (1.0 + len(patterns) - k for k, p in enumerate(patterns) if re.search(p, text)), 0.0
    )
    if score == 0.0 or not unit or states_nothing(unit):
        return score
    fits = plain(unit) in FACTORS[si_unit(channel, name)]
    known = any(plain(unit) in factors for factors in FACTORS.values())
    return score + 2.0 if fits else 0.0 if known else score


def si_unit(channel: str, name: str) -> str:
    """Return the SI unit of what a column of this name measures, if it is that channel's."""
    return "rad" if channel == "vy_mps" and is_sideslip(name) else _SI[channel]


def is_sideslip(name: str) -> bool:
    """Tell whether a name is that of the sideslip angle."""
    return re.search(_SIDESLIP, words(name)) is not None
