"""Files of random bytes: the readers of logs, channel maps, vehicles and tyre data."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sysid_vehicle import Vehicle, read_log
from sysid_vehicle.online import MuSlipData
from sysid_vehicle.read import ChannelMap

Case = dict[str, Any]

_CSV = b"time_s,vx_mps,yaw_rate_radps,ax_mps2,ay_mps2,steer_rad\n" + b"".join(
    f"{0.05 * k:.2f},20.0,{0.1 * np.sin(0.25 * k):.5f},0.01,{2 * np.sin(0.25 * k):.4f},"
    f"{0.01 * np.sin(0.25 * k):.6f}\n".encode()
    for k in range(120)
)
_VEHICLE = b"""mass_kg = 1500.0
lf_m = 1.2
lr_m = 1.5
cg_height_m = 0.5
track_front_m = 1.5
track_rear_m = 1.5
drag_area_m2 = 0.7
brake_front_share = 0.6
drive_front_share = 0.0

[tyre.front]
B = 10.0
C = 1.4
D = 1.0
E = 0.0

[tyre.rear]
B = 11.0
C = 1.4
D = 1.0
E = 0.0
"""
_MAP = b"""[channels]
time_s = "t"
yaw_rate_radps = { column = "gyro_z_degps", factor = 0.017453292519943295 }
steer_rad = { column = "hand_wheel_deg", factor = 0.00109, offset = 0.1, despike = true }
"""
_MU_SLIP = b"slip,mu\n" + b"".join(
    f"{0.01 * k:.2f},{np.tanh(0.3 * k):.4f}\n".encode() for k in range(20)
)
READERS: dict[str, tuple[bytes, Callable[[Path], object]]] = {
    "log.csv": (_CSV, read_log),
    "car.toml": (_VEHICLE, Vehicle.from_toml),
    "map.toml": (_MAP, ChannelMap.from_toml),
    "tyre.csv": (_MU_SLIP, MuSlipData.from_csv),
}
_WORDS = (
    b"nan", b"inf", b"-inf", b"1e999", b"1e-999", b"1e308", b"0x10", b"--1", b"", b"\x00", b"\xff",
    b"\xef\xbb\xbf", b"\r", b"\r\n", b";", b",", b",,,,", b'"', b"'", b"[", b"]]", b"{", b"=", b"#",
    b"true", b"1979-05-27", b"[" * 500, b"1" * 5000, b"1j", b"\xe2\x88\x9212", b"1,5", b"time_s",
)  # fmt: skip
_DIGITS = [bytes([byte]) for byte in b"0123456789"] + [b"-1", b".", b"e9", b"e-9", b"e300", b"nan"]


def draw(number: int) -> Case:
    """Give the case of this number: a file somebody spoilt in a few places."""
    rng = np.random.default_rng([number, 21])
    reader = str(rng.choice(sorted(READERS)))
    text = bytearray(READERS[reader][0])
    if rng.random() < 0.5:  # other numbers, so that what comes after the syntax is reached too
        digits = [k for k, byte in enumerate(text) if byte in b"0123456789"]
        for at in rng.choice(digits, rng.integers(0, 6)):
            text[at : at + 1] = _DIGITS[rng.integers(len(_DIGITS))]
        return {"reader": reader, "bytes": base64.b64encode(bytes(text)).decode()}
    for _ in range(rng.integers(1, 8)):
        at = int(rng.integers(0, len(text) + 1))
        end = at + int(rng.geometric(0.1))
        kind = rng.integers(0, 5)
        if kind == 0:
            text[at:end] = rng.bytes(end - at)
        elif kind == 1:
            del text[at:end]
        elif kind == 2:
            text[at:at] = _WORDS[rng.integers(len(_WORDS))]
        elif kind == 3:
            text[at:end] = _WORDS[rng.integers(len(_WORDS))]
        else:
            other = int(rng.integers(0, len(text) + 1))
            text[at:at] = text[other : other + int(rng.geometric(0.02))]
    return {"reader": reader, "bytes": base64.b64encode(bytes(text)).decode()}


def read(case: Case) -> object:
    """Read the file of a case."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / case["reader"]
        path.write_bytes(base64.b64decode(case["bytes"]))
        READERS[case["reader"]][1](path)
    return None
