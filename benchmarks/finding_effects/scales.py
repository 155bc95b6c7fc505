"""Are effects named in cars of other sizes, which move as the example car does?

    python benchmarks/finding_effects/scales.py [SCALE ...] [--effects EFFECT ...] [--seed N]

Of each scale a car that is alike in shape, at speeds as the root of its length, on a lap and a
course that take as much of its own time; each effect of typical size for that car, by units alone
(`DIMENSIONS`), so that the benchmark does not take over the sizes that it judges. Sensors are as
good as those of the example car. Printed: the verdict, what was added with its size, and what the
verdict on the effect is.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace

import sysid_vehicle as sv

# Powers of length, mass and time.
DIMENSIONS = {
    "1": (0.0, 0.0, 0.0),
    "m": (1.0, 0.0, 0.0),
    "m2": (2.0, 0.0, 0.0),
    "s": (0.0, 0.0, 1.0),
    "s/m": (-1.0, 0.0, 1.0),
    "N": (1.0, 1.0, -2.0),
    "N m": (2.0, 1.0, -2.0),
    "rad/N": (-1.0, -1.0, 2.0),
}
EFFECTS = (
    *("tyre_relaxation", "steer_lag", "cg_position", "imu_lever_arm", "aero_downforce"),
    *("longitudinal_load_transfer", "side_wind", "yaw_inertia", "aero_drag"),
    *("rolling_resistance", "aligning_moment", "steer_compliance"),
)


class Scale:
    """A car that is so many times as long as the example car, and its drives."""

    def __init__(self, length: float) -> None:
        self.length, self.mass, self.time = length, length**3, length**0.5
        self.speed = self.length / self.time

    def of(self, unit: str) -> float:
        """How many times as large a size with this unit is."""
        length, mass, time = DIMENSIONS[unit]
        return self.length**length * self.mass**mass * self.time**time

    @property
    def car(self) -> sv.Vehicle:
        whole = sv.example_vehicle()
        assert whole.yaw_inertia_kgm2 is not None
        lengths = ("lf_m", "lr_m", "cg_height_m", "track_front_m", "track_rear_m")
        return replace(
            whole,
            mass_kg=whole.mass_kg * self.mass,
            yaw_inertia_kgm2=whole.yaw_inertia_kgm2 * self.mass * self.length**2,
            drag_area_m2=whole.drag_area_m2 * self.length**2,
            **{name: getattr(whole, name) * self.length for name in lengths},
        )

    def drives(self, truth: sv.Model, seed: int) -> list[sv.Log]:
        usual = sv.SensorNoise()
        noise = replace(
            usual,
            vx_mps=usual.vx_mps * self.speed,
            vy_mps=usual.vy_mps * self.speed,
            yaw_rate_radps=usual.yaw_rate_radps / self.time,
        )
        seconds, rate_hz = 60.0 * self.time, round(100.0 / self.time)
        manoeuvres = (
            sv.manoeuvres.lap(seconds, 8.2, 34.0 * self.speed),
            sv.manoeuvres.handling_course(seconds, 8.0, 34.5 * self.speed),
        )
        return [
            sv.drive(truth, m, seed=seed + i, noise=noise, rate_hz=rate_hz)
            for i, m in enumerate(manoeuvres)
        ]


def line_of(scale: Scale, hidden: str, seed: int) -> str:
    """One study, and what it says of what is hidden; nothing where `hidden` is empty."""
    start = truth = sv.Model(scale.car)
    if hidden:
        values = {
            name: p.null_value + (p.typical - p.null_value) * scale.of(p.unit)
            for name, p in sv.effect(hidden).named.items()
        }
        truth = start.add(hidden).with_values(values)
    try:
        study = sv.improve(start, *scale.drives(truth, seed))
    except sv.SysidError as error:
        return f"{hidden or 'nothing':27s} {type(error).__name__}: {error}"
    told = [
        str(study.fit[n])
        for n in study.fit.model.free_names
        if n.split(".")[0] in {a.id for a in study.added}
    ]
    finding = study.verdicts[hidden].finding if hidden else ""
    return f"{hidden or 'nothing':27s} {study.verdict:17s} {finding:15s} {', '.join(told)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scales", nargs="*", type=float, default=[0.12, 0.4, 1.0], metavar="SCALE")
    parser.add_argument("--effects", nargs="*", choices=EFFECTS, default=EFFECTS)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    for length in args.scales:
        scale = Scale(length)
        print(f"{length:g} times as long: {scale.car.mass_kg:.3g} kg", flush=True)
        for hidden in ("", *args.effects):
            print(f"  {line_of(scale, hidden, args.seed)}", flush=True)


if __name__ == "__main__":
    main()
