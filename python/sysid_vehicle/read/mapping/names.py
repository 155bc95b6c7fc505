"""What channels of cars are called, by loggers, tools and people."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence

from ..units import FACTORS, plain, states_nothing, unit_at_end, without_unit
from .ground import PARTS

# Of the car, and not of a tyre.
_SIDESLIP = (
    r"^(?!.*\b(fl|fr|rl|rr|front|rear|axle|tyres?|tires?|wheels?|ratio|rate|dot)\b)"
    r".*(\bslip ?ang\w*|\bside ?slip|\bschwimmwinkel|^beta\b)"
)

# By channel: patterns of a name in plain words, the surest first.
_PATTERNS: dict[str, tuple[str, ...]] = {
    "time_s": (
        r"^time( s)?$",
        r"^(t|ts|zeit|(time ?)?stamps?( s| sec\w*)?|times?|tout|utc time)$",
        r"^(temps|tempo|tiempo|tijd|tid|時間|時刻|时间)$",
        r"\btime\b|^(header )?stamp\b|^(sec(ond)?s|elapsed|epoch)\b",
        r"\bi? ?tow\b|\bsow\b|\bseconds? of (the )?(week|day)\b",
    ),
    "vx_mps": (
        r"^[uv] ?x( mps)?$",
        r"twist linear x$|(long\w*|forward) (speed|vel\w*)|(speed|vel\w*) (x|long\w*)$",
        r"(vehicle|ground|corr\w*|gps|car|veh) (speed|vel\w*)|^v (veh|car|ego)|v (fzg|signal)",
        r"^(fzg|fahr(zeug)?) ?geschw\w*|^veh v\b",
        r"(speed|vel\w*) forward$|\bvel\w* (body|hor) x$|^wheel based vehicle speed",
        r"^(speed|velocity|vel|geschwindigkeit|v)$",
        r"\b(speed|velocity|geschwindigkeit)\b",
        r"^(vitesse|velocita|velocidade?|snelheid|hastighet)\b|車速|车速|\bsog\b",
    ),
    "vy_mps": (
        r"^[uv] ?y( mps)?$",
        r"twist linear y$|lat\w* (speed|vel\w*)|(speed|vel\w*) (y|lat\w*)$|quergeschw\w*",
        r"\bvel\w* (body|hor) y$|(vitesse|velocita|velocidade?) (lat\w*|trans\w*)",
        _SIDESLIP,
    ),
    "yaw_rate_radps": (
        r"yaw ?rate|yaw ?vel\w*|gier ?(rate|geschw\w*)",
        r"angular velocity z$|gyro\w* (z|yaw)|twist angular z$|psi ?(p|dot|rate)$",
        r"^(w|omega|rate|gyro|ang vel) ?z$|\bgyro z\b|\byaw\b.*\b(dps|radps|degps)\b",
        r"\bz (rate of rotation|rotation rate)$",
        r"\b(ang\w*|rotation) rate (z|down)$|\brate (body|hor) z$|\bheading rate$|^r$|^d ?psi$",
        r"^(imu|ins|body) (g|w|omega|gyr|rate) ?z$|^gyr ?z$",
        r"\b(lacet|imbardata|guinada)\b|^gier|girhastighet|ヨーレート|横摆角速度",
    ),
    "ax_mps2": (
        r"^a ?x( cg)?( mps2)?$|acc ?x$|x acc\w*$",
        r"long\w* (acc\w*|g\b)|acc\w* (x|long\w*)|g (force )?(long|x)\w*",
        r"inline acc\w*|laengs ?beschl\w*|langsversnelling|\blon(g|gi)?acc?\b",
        r"^ace?l\w* lon\w*|^acc?el\w* lon\w*|前後(加速度|g)|纵向加速度",
        r"^(imu|ins|body) a ?x$",
        r"\bacc\w* (body|hor) x$|acc\w* forward$|^lon acc\w*$|\bacc lon$|^a ?(lon|long|laengs)$",
        r"\bspecific force (x|long\w*)$",
    ),
    "ay_mps2": (
        r"^a ?y( cg)?( mps2)?$|acc ?y$|y acc\w*$",
        r"lat\w* (acc\w*|g\b)|acc\w* (y|lat\w*)|g (force )?(lat|y)\w*|quer ?beschl\w*",
        r"\blatacc?\b",
        r"^ace?l\w* (lat|trans)\w*|^acc?el\w* trans\w*|dwarsversnelling",
        r"^(imu|ins|body) a ?y$",
        r"\bacc\w* (body|hor) y$|^a ?(lat|quer)$|横(加速度|g)|(侧|横)向加速度",
        r"\bspecific force (y|lat\w*)$",
    ),
    "steer_rad": (
        r"road ?wheel( angle)?$|^steer rad$|front wheel angle",
        r"ste*r\w* ?((road )?wheel |t[iy]re )?ang\w*|lenk ?(rad ?)?winkel|\bswa\b|hand ?wheel",
        r"\b(steer|steering|steered|delta( ?wheel)?)\b|\b(sas|lws|lwi) (ang\w*|winkel)$",
        r"\b(volant|volante|sterzo|braquage)\b|stuurhoek|rattvinkel|操舵角|ハンドル角|舵角|方向盘转角",
        r"\bservo (cmd |command )?(angle|rad|deg)\b|^servo (cmd|command)$",
    ),
    "fx_n": (
        r"^f ?x( n)?$",
        r"(wheel|drive|traction|long\w*|total) force( total| x)?$|force x$|antriebskraft",
    ),
    # Of navigation, which gives the speeds of the body as velocity over ground and heading.
    "east": (r"^v ?e$|(speed|vel\w*) ?e(ast\w*)?$|^east\w* (speed|vel\w*)$", r"^v(el)? east$"),
    "north": (
        r"^v ?n$|(speed|vel\w*) ?n(orth\w*)?$|^north\w* (speed|vel\w*)$",
        r"^v(el)? north$",
    ),
    "heading": (
        r"^true head(ing)?$|^(ins )?heading$|\bheading (true|angle)$",
        r"^(azimuth|yaw|psi|yaw angle|gierwinkel|kurswinkel)$|\bheading$",
        r"\b(ins|imu|quaternion) yaw$",
    ),
    "course": (r"\bcourse\b|\bcog\b|ground ?track|track (angle|over ground|made good)|^track$",),
}
_REFUSED: dict[str, str] = {
    "time_s": r"\b(lap|run|delta|remaining|sector)\b",
    "vx_mps": r"\bheading rate\b|\b(north|east|up|down)\w* (speed|vel\w*)"
    r"|\b(wheel(?! based)|eng|engine|rpm|fl|fr|rl|rr|lat\w*|vert\w*|wind"
    r"|angular|steer\w*|y|z|trans\w*|lacet|imbardata|guinada|moteur|motore?|roues?|ruot[ae]|rueda"
    r"|roda|vento?|viento)\b",
    "vy_mps": r"\b(angular|wind|acc\w*)\b",
    "yaw_rate_radps": r"\b(acc\w*|target|ref\w*|covariance)\b",
    "ax_mps2": r"\b(yaw|lat\w*|vert\w*|angular|covariance|target)\b",
    "ay_mps2": r"\b(yaw|long\w*|vert\w*|angular|covariance|target)\b",
    "steer_rad": r"\b(torque|rate|speed|vel\w*|moment|target|force|motor|current|rear)\b",
    "fx_n": r"\b(fl|fr|rl|rr|brake|steer\w*|specific)\b",
    **dict.fromkeys(
        ("east", "north", "heading", "course"),
        r"\b(std\w*|accuracy|cov\w*|error|sigma|rate|acc\w*|target|ref\w*|wind)\b",
    ),
}
# The last part of the name of what a sensor or a message tells of itself.
_STATE = r"\b(counter|cnt|crc|checksum|valid|status|enabled?|override|fault|timeout)\b"
# What a controller or a driver asks for, which stands behind what is measured.
_COMMAND = r"\b(cmd|command(ed)?|desired|requested|setpoint)\b"
_WANTED = rf"{_COMMAND}|\bmanual\b"
# Names that are those of a channel in its unit alone: a yaw in deg is an angle.
_IN_ITS_UNIT = {"yaw_rate_radps": r"^(yaw|gyro|psi)$"}
_SI = {
    "time_s": "s",
    "vx_mps": "m/s",
    "vy_mps": "m/s",
    "yaw_rate_radps": "rad/s",
    "ax_mps2": "m/s2",
    "ay_mps2": "m/s2",
    "steer_rad": "rad",
    "fx_n": "N",
    **PARTS,
}


_COLUMN = re.compile(r"(.+)(?:\(:,(\d+)\)|\[(\d+)\])")
"""Of a matrix, as MATLAB counts them, or of an array."""

_SIGN = {"vz", "vorzeichen", "sign", "sgn"}
"""Words in names of what is not 0 where another signal is negative."""

_FAST = frozenset(("speed", "rpm", "omega", "geschw", "drehz", "drehzahl", "raddrehzahl"))
"""Words in names of speeds of wheels."""

_WHEELS = {  # in English and German
    **dict.fromkeys(("fl", "lf", "vl"), ("front", "left")),
    **dict.fromkeys(("fr", "rf", "vr"), ("front", "right")),
    **dict.fromkeys(("rl", "lr", "hl"), ("rear", "left")),
    **dict.fromkeys(("rr", "hr"), ("rear", "right")),
}

# As the databases of cars shorten words, whose names may have 32 letters.
_SHORT = {"spd": "speed", "whl": "wheel", "lgt": "long", "lng": "long"}
_UMLAUTS = {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss"}


def words(name: str) -> str:
    """Return a name in plain words, without accents: ``ESP_VehSpd.x`` as ``esp veh speed x``."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name)
    for letter, plainly in _UMLAUTS.items():
        apart = apart.replace(letter, plainly)
    marks = unicodedata.normalize("NFKD", apart)
    bare = "".join(c for c in marks if not "\u0300" <= c <= "\u036f")
    bare = unicodedata.normalize("NFC", bare)
    there = re.sub(r"[\W_]+", " ", bare).lower().split()
    return " ".join(_SHORT.get(word, word) for word in there)


def by_axes(names: Sequence[str]) -> dict[str, str]:
    """Return what the columns of matrices are called by axes: ``imu.gyro(:,3)`` ``imu.gyro z``.

    Of three columns these are x, y and z, of two x and y; others are wheels, quaternions or
    covariances.
    """
    matrices: dict[str, dict[int, str]] = {}
    for name in names:
        if found := _COLUMN.fullmatch(name):
            number = int(found[3]) if found[2] is None else int(found[2]) - 1
            matrices.setdefault(found[1], {})[number] = name
    return {
        name: f"{of} {'xyz'[number]}"
        for of, columns in matrices.items()
        if {*columns} in ({0, 1}, {0, 1, 2})
        for number, name in columns.items()
    }


def rank(name: str, unit: str, channel: str) -> float:
    """Return how well a name and its unit suit a channel: 0 not at all, 1 and more well.

    Channels are the canonical ones and the parts of what navigation knows, as ``heading``.
    """
    text = words(name)
    if name == channel:
        return 10.0
    last = next(iter(_last_parts(name)[::-1]), text)
    if re.search(_REFUSED[channel], text) or _SIGN & {*text.split()} or re.search(_STATE, last):
        return 0.0
    patterns = _PATTERNS[channel]
    # As it is, and without a unit at its end: vx_kmh is one of vx.
    own = si_unit(channel, name)
    bare = without_unit(name, own)
    forms = (text, words(unit_at_end(name, own)[0]), words(bare))
    score = max(
        (
            1.0 + len(patterns) - k
            for k, p in enumerate(patterns)
            for form in forms
            if re.search(p, form)
        ),
        default=0.0,
    )
    if score == 0.0:  # of a struct, a message or a sensor: after all others
        score = 0.5 * any(re.search(p, part) for part in _last_parts(name) for p in patterns)
    elif re.search(_WANTED, text):
        score -= 0.5
    fits = plain(unit) in FACTORS[si_unit(channel, name)]
    if score == 0.0 and fits and channel in _IN_ITS_UNIT:
        score = float(re.search(_IN_ITS_UNIT[channel], forms[2]) is not None)
    if score == 0.0 or not unit or states_nothing(unit):
        return score
    known = any(plain(unit) in factors for factors in FACTORS.values())
    return score + 2.0 if fits else 0.0 if known else score


def _last_parts(name: str) -> list[str]:
    """In plain words, what stands behind each point and slash of a name, units left out."""
    bare = re.sub(r"\s*(\[[^\]]*\]|\([^)]*\))$", "", name)
    return [words(bare[found.end() :]) for found in re.finditer(r"[./]", bare)]


def si_unit(channel: str, name: str) -> str:
    """Return the SI unit of what a column of this name measures, if it is that channel's."""
    return "rad" if channel == "vy_mps" and is_sideslip(name) else _SI[channel]


def is_command(name: str) -> bool:
    """Tell whether a name is that of what a controller asks for."""
    return re.search(_COMMAND, words(name)) is not None


def is_sideslip(name: str) -> bool:
    """Tell whether a name is that of the sideslip angle."""
    return re.search(_SIDESLIP, words(name)) is not None


def sign_of(name: str, others: Iterable[str]) -> str:
    """Return the column that holds the sign of another, by its name; empty if there is none.

    ``ESP_VZ_Gierrate`` is that of ``ESP_Gierrate``, ``YawRate_Sign`` that of ``YawRate``. So is
    ``SAS_Sign`` that of ``SAS_Angle``, where nothing else of the message begins with ``SAS``.
    """
    others = list(others)
    own = Counter(words(name).split())
    for other in others:
        there = Counter(words(other).split())
        if {*there} & _SIGN and Counter({w: k for w, k in there.items() if w not in _SIGN}) == own:
            return other
    message, mine = _apart(name)
    within = [(other, {*part}) for other in others for of, part in [_apart(other)] if of == message]
    for other, part in within:
        device = part - _SIGN
        if not device or device == part or not device < {*mine}:
            continue
        if [n for n, p in within if device < p and not p & _SIGN] == [name]:
            return other
    return ""


def _apart(name: str) -> tuple[str, list[str]]:
    """The message or group of a column, and the words of what stands behind it."""
    of, _, last = name.replace("/", ".").rpartition(".")
    return of, words(last).split()


def is_speed(name: str) -> bool:
    """Tell whether a name says that it is one of a speed, along the ground or of turning."""
    return not _FAST.isdisjoint(words(name).split())


def wheel_of(name: str) -> tuple[str, str] | None:
    """Return axle and side of the wheel that a name belongs to; None if it names no wheel."""
    there = words(name).split()
    for word in there:
        if word in _WHEELS:
            return _WHEELS[word]
    axle = next((axle for axle in ("front", "rear") if axle in there), "")
    side = next((side for side in ("left", "right") if side in there), "")
    return (axle, side) if axle and side else None
