"""Logs of CAN frames, written by python-can, with the database of the car."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from log_formats import DBC, FAST, MAP, SLOW, check_values, measured, read_told

from sysid_vehicle import example_vehicle
from sysid_vehicle.cli import lab_logs, main
from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.lab import TyreLog
from sysid_vehicle.read import read_log

pytestmark = pytest.mark.filterwarnings(
    # What the libraries say of themselves and of each other.
    "ignore::DeprecationWarning",
    "ignore::FutureWarning",
    "ignore::PendingDeprecationWarning",
    "ignore::ResourceWarning",
)

OWN_DBC = f"""{DBC}BO_ 2566914048 Wheels: 2 ECU
 SG_ Speed : 0|16@1+ (0.01,0) [0|300] "km/h" ECU
BO_ 768 Never: 1 ECU
 SG_ Nothing : 0|8@1+ (1,0) [0|1] "" ECU
"""


class TestCan:
    def write(self, folder: Path, suffix: str) -> tuple[Path, Path]:
        can, cantools = pytest.importorskip("can"), pytest.importorskip("cantools")
        dbc, path = folder / "car.dbc", folder / f"run.{suffix}"
        dbc.write_text(OWN_DBC)
        database = cantools.database.load_file(dbc)
        frames = []
        for name, times in (("Motion", FAST), ("Wheels", SLOW)):
            message = database.get_message_by_name(name)
            for t in times:
                values = {s.name: float(measured(t)[s.name]) for s in message.signals}
                frames.append(
                    can.Message(
                        timestamp=1.7e9 + float(t),
                        arbitration_id=message.frame_id,
                        is_extended_id=message.is_extended_frame,
                        data=message.encode(values),
                    )
                )
        with can.Logger(str(path)) as logger:
            for frame in sorted(frames, key=lambda f: f.timestamp):
                logger.on_message_received(frame)
        return path, dbc

    @pytest.mark.parametrize("suffix", ["blf", "asc", "log", "csv", "trc"])
    def test_logs(self, tmp_path: Path, suffix: str) -> None:
        path, dbc = self.write(tmp_path, suffix)
        log = read_told(path, dbc=dbc)
        check_values(log, atol=0.01)
        full = {**MAP, "vx_mps": "Wheels.Speed"}
        check_values(read_told(path, full, dbc=str(dbc)), atol=0.01)

    def test_mdf_of_frames(self, tmp_path: Path) -> None:
        pytest.importorskip("asammdf")
        path, dbc = self.write(tmp_path, "mf4")
        check_values(read_told(path, dbc=dbc), atol=0.01)

    def test_no_database_and_one_of_another_car(self, tmp_path: Path) -> None:
        path, _ = self.write(tmp_path, "blf")
        with pytest.raises(InvalidInput, match=r"run\.blf: is a CAN log.*--dbc car\.dbc"):
            read_log(path, MAP)
        other = tmp_path / "other.dbc"
        other.write_text(
            OWN_DBC.replace("256 Motion", "257 Motion").replace("2566914048", "2566914049")
        )
        with pytest.raises(InvalidInput, match=r"none of its 2 kinds of frames \(0x100, "):
            read_log(path, MAP, dbc=other)


def test_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fitted(_: object, logs: Sequence[TyreLog], **__: object) -> None:
        raise InvalidInput(f"fitted: {sum(len(log.inputs) * log.step_s for log in logs):.1f} s")

    monkeypatch.setattr(lab_logs, "identify_tyres", fitted)
    path, dbc = TestCan().write(tmp_path, "blf")
    (tmp_path / "map.toml").write_text(
        "[channels]\n" + "".join(f'{c} = "{s}"\n' for c, s in MAP.items())
    )
    example_vehicle().to_toml(tmp_path / "car.toml")
    known = ["--vehicle", str(tmp_path / "car.toml"), "--channels", str(tmp_path / "map.toml")]
    # It was decoded: the four seconds of it are too short to fit a car to.
    for command, said in (
        (["compare"], (2, "run: 4.0 s usable in 1 stretch(es): at least 5 s are needed")),
        (["check"], (0, "sensor fault")),  # how many tells nothing, as no car drove it
        (["lab", "identify"], (2, "fitted: 4.0 s")),
    ):
        assert main([*command, str(path), *known, "--dbc", str(dbc)]) == said[0]
        assert said[1] in "".join(capsys.readouterr())
