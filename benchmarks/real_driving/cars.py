"""The measured drives: which logs teach a model, and which judge it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import sysid_vehicle as sv

HERE = Path(__file__).resolve().parent
WHOLE = (0.0, 1e9)
LARGEST_RAD = 0.5
# Logs and their parts [s] for training, and for validation.
PARTS: dict[str, tuple[tuple[tuple[str, float, float], ...], ...]] = {
    "revs_250lm": (
        (("revs_250lm_20140222_run1.csv", 200.0, 300.0),),
        (("revs_250lm_20140222_run1.csv", 400.0, 500.0),),
    ),
    "carsim_like_handling": (
        (("handling_course.csv", 0.0, 75.0),),
        (("handling_course.csv", 75.0, 1e9),),
    ),
    "tum_devbot_sim": (
        (("data_to_train_2.csv", 0.0, 100.0),),
        (("data_to_train_2.csv", 100.0, 1e9),),
    ),
    "v40": (
        (("Slalom_35kph.csv", *WHOLE), ("Step_Steer_left_80kph.csv", *WHOLE)),
        (("SWD_80kph.csv", *WHOLE),),
    ),
    "gti": ((("High_Speed.csv", *WHOLE),), (("Low_Speed.csv", *WHOLE),)),
}
LEVEL = ("v40",)  # manoeuvres of standards, on a test ground that is level
FETCHED = ("v40", "gti")  # logs without a licence, in a folder of their own
SHORT = "bmw_m8_roadview"  # one lane change: too short to name anything
NAMES = (*PARTS, SHORT)


def vehicle(name: str, data: Path) -> sv.Vehicle:
    """The vehicle file that a user would write."""
    return sv.Vehicle.from_toml(_beside(name, data) / f"{name}.vehicle.toml")


def logs(name: str, data: Path, fetched: Path | None) -> tuple[list[sv.Log], list[sv.Log]]:
    """Training and validation logs; commanded wheel force is left out, it is late."""
    if name == SHORT:
        log = lane_change(data / name)
        return [log.between(5.0, 13.1)], [log.between(13.1, 16.5)]
    channels = sv.ChannelMap.from_toml(_beside(name, data) / f"{name}.channels.toml")
    if name in FETCHED and fetched is None:
        raise SystemExit(f"{name}: give --fetched FOLDER, with the logs in {name}/*.csv")
    folder = fetched / name if name in FETCHED and fetched is not None else data / name
    train, validation = (
        [
            without_force(read(folder / file, channels)).between(begin, end)
            for file, begin, end in parts
        ]
        for parts in PARTS[name]
    )
    return train, validation


def read(path: Path, channels: sv.ChannelMap) -> sv.Log:
    """A log; angles that no road wheel has are made missing: the V40's bus writes 600 deg."""
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars="", comments="#")
    columns = {name: np.array(table[name]) for name in table.dtype.names}
    source = channels.sources["steer_rad"]
    steer = columns[source.column]
    steer[np.abs(source.factor * steer) > LARGEST_RAD] = np.nan
    return sv.read_log(columns, channels, name=path.stem)


def without_force(log: sv.Log) -> sv.Log:
    """The log without wheel force, so that the measured a_x is the input."""
    if not log.has("fx_n"):
        return log
    columns = {c: np.array(log[c]) for c in log.channels if c != "fx_n" and log.has(c)}
    return sv.Log.from_arrays(columns, name=log.name, check=False)


def lane_change(folder: Path) -> sv.Log:
    """The double lane change as a log."""
    return sv.Log.from_arrays(lane_change_columns(folder), name="double lane change")


def lane_change_columns(folder: Path) -> dict[str, np.ndarray]:
    """Its columns: motion and steering are in two files, at two rates, of one clock."""
    car, inputs = (
        np.genfromtxt(folder / f"m8_double_lane_change_{part}.csv", delimiter=",", names=True)
        for part in ("car_100Hz", "inputs_1kHz")
    )
    time = car["car_time"]
    # Normalised steering; the authors divide 20 rad by the ratio of the steering gear.
    steer = np.interp(time, inputs["time"], inputs["steering"]) * 20.0 / 14.3
    return {
        "time_s": time,
        "vx_mps": car["Velocity_X"],
        "vy_mps": car["Velocity_Y"],
        "yaw_rate_radps": car["Yaw_Velocity"],
        "ax_mps2": car["Acceleration_X"],
        "ay_mps2": car["Acceleration_Y"],
        "steer_rad": steer,
    }


def _beside(name: str, data: Path) -> Path:
    """Vehicle files and channel maps: beside this file, or beside the data that are fetched."""
    return data / "fetched" if name in FETCHED else HERE
