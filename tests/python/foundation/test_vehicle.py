"""Vehicle files: what is read is what was written, and every mistake is named with its remedy."""

import dataclasses
import warnings
from pathlib import Path

import pytest

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.tyre import Tyre
from sysid_vehicle.vehicle import Vehicle

CAR = """
name = "test car"
mass_kg = 1500
yaw_inertia_kgm2 = 2500.0
lf_m = 1.2
lr_m = 1.5
cg_height_m = 0.5
track_front_m = 1.5
track_rear_m = 1.52
drag_area_m2 = 0.7
brake_front_share = 0.65
drive_front_share = 0.0
[tyre.front]
B = 10.0
C = 1.4
D = 1.0
E = 0.0
[tyre.rear]
B = 12.0
C = 1.3
D = 1.1
E = -0.5
"""


@pytest.fixture
def car_file(tmp_path: Path) -> Path:
    path = tmp_path / "car.vehicle.toml"
    path.write_text(CAR)
    return path


def changed(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert text.count(old) >= 1
    path.write_text(text.replace(old, new, 1))
    return path


def test_reads_every_key(car_file: Path) -> None:
    car = Vehicle.from_toml(car_file)
    assert car == Vehicle(
        name="test car",
        mass_kg=1500.0,
        yaw_inertia_kgm2=2500.0,
        lf_m=1.2,
        lr_m=1.5,
        cg_height_m=0.5,
        track_front_m=1.5,
        track_rear_m=1.52,
        drag_area_m2=0.7,
        brake_front_share=0.65,
        drive_front_share=0.0,
        tyre_front=Tyre(10.0, 1.4, 1.0, 0.0),
        tyre_rear=Tyre(12.0, 1.3, 1.1, -0.5),
    )
    assert car.air_density_kgpm3 == 1.225
    assert car.wheelbase_m == pytest.approx(2.7)
    assert isinstance(car.mass_kg, float)
    assert car.tyre_rear.cornering_stiffness_per_load == pytest.approx(12.0 * 1.3 * 1.1)


@pytest.mark.parametrize("name", ["car", 'the "blue" car \\ 2', "tabbed\tname\nand line"])
def test_toml_round_trip_is_exact(car_file: Path, name: str) -> None:
    car = Vehicle.from_toml(car_file).replace(name=name, mass_kg=1500.1 / 3, yaw_inertia_kgm2=1e3)
    car.to_toml(car_file)
    assert Vehicle.from_toml(car_file) == car
    assert [path.name for path in car_file.parent.iterdir()] == [car_file.name]


def test_name_defaults_to_the_file(car_file: Path) -> None:
    assert Vehicle.from_toml(changed(car_file, 'name = "test car"', "")).name == "car"


def test_missing_inertia_is_left_to_identify(car_file: Path) -> None:
    changed(car_file, "yaw_inertia_kgm2 = 2500.0", "")
    with pytest.warns(SysidWarning, match="yaw_inertia_kgm2 is absent.*identify") as caught:
        car = Vehicle.from_toml(car_file)
    assert caught[0].filename == __file__
    assert car.yaw_inertia_kgm2 is None
    assert "to identify" in str(car)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        car.to_toml(car_file)
        assert Vehicle.from_toml(car_file) == car


def test_all_missing_keys_are_named_at_once(car_file: Path) -> None:
    for line in ("mass_kg = 1500\n", "lr_m = 1.5\n", "D = 1.1\n"):
        changed(car_file, line, "")
    with pytest.raises(InvalidInput, match=r"missing keys: mass_kg, lr_m, tyre\.rear\.D;"):
        Vehicle.from_toml(car_file)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "mass_kg = 1500",
            "mass = 1500",
            ["unknown key 'mass'", "did you mean 'mass_kg'", "the file lacks mass_kg"],
        ),
        ("[tyre.front]", "[tyre.fornt]", ["[tyre]", "'fornt'", "did you mean 'front'"]),
        ("E = 0.0", "E = 0.0\nF = 1.0", ["[tyre.front]", "'F'", "remove it"]),
        ("mass_kg = 1500", "mass_kg = 0.5", ["mass_kg = 0.5", "kilograms"]),
        ("mass_kg = 1500", "mass_kg = nan", ["mass_kg = nan", "kilograms"]),
        ("mass_kg = 1500", 'mass_kg = "1500"', ["mass_kg = '1500'", "plain number"]),
        ("mass_kg = 1500", "mass_kg = true", ["mass_kg = True", "plain number"]),
        ("lf_m = 1.2", "lf_m = -1.2", ["lf_m = -1.2", ">= 0.001", "metres"]),
        ("lr_m = 1.5", "lr_m = 1500", ["lr_m = 1500", "metres"]),
        ("brake_front_share = 0.65", "brake_front_share = 65", ["brake_front_share", "0 to 1"]),
        ("yaw_inertia_kgm2 = 2500.0", "yaw_inertia_kgm2 = 2.5", ["yaw_inertia_kgm2", "2700"]),
        (
            "mass_kg = 1500",
            "mass_kg = 1.5",
            ["mass_kg = 1.5 fits neither yaw_inertia_kgm2 = 2500", "tonnes: multiply it by 1000"],
        ),
        ("B = 12.0", "B = 0.0", ["[tyre.rear]", "B = 0", "> 0"]),
        ("E = -0.5", "E = 1.5", ["[tyre.rear]", "E = 1.5", "<= 1"]),
        (
            "lf_m = 1.2",
            "lf_m = 1.2\nsteering_ratio = 15",
            ["steering_ratio", "channel map", "steer_rad"],
        ),
        ('name = "test car"', "name = 3", ["name = 3", "quotes"]),
        ("lf_m = 1.2", "lf_m 1.2", ["not a TOML file", "line 5"]),
    ],
)
def test_mistakes_are_named(car_file: Path, old: str, new: str, words: list[str]) -> None:
    changed(car_file, old, new)
    with pytest.raises(InvalidInput) as caught:
        Vehicle.from_toml(car_file)
    for word in ["car.vehicle.toml", *words]:
        assert word in str(caught.value)


def test_a_tyre_of_which_nothing_is_known_may_be_left_out(car_file: Path) -> None:
    head, tyres = CAR.split("[tyre.front]")
    car_file.write_text(head + "[tyre.rear]" + tyres.split("[tyre.rear]")[1])
    with pytest.warns(SysidWarning, match=r"\[tyre\.front\] absent, .* B = 10, C = 1\.4") as heard:
        car = Vehicle.from_toml(car_file)
    assert (car.tyre_front, car.tyre_rear) == (Tyre(), Tyre(12.0, 1.3, 1.1, -0.5))
    assert len(heard) == 1
    car_file.write_text(head)
    with pytest.warns(SysidWarning, match=r"\[tyre\.front\] and \[tyre\.rear\] absent"):
        assert Vehicle.from_toml(car_file).tyre_rear == Tyre()


@pytest.mark.parametrize(
    ("tail", "word"), [("tyre = 3", "two tables"), ("[tyre]\nfront = 3", "a table [tyre.front]")]
)
def test_tyres_must_be_tables(car_file: Path, tail: str, word: str) -> None:
    car_file.write_text(CAR.partition("[tyre.front]")[0] + tail)
    with pytest.raises(InvalidInput) as caught:
        Vehicle.from_toml(car_file)
    assert word in str(caught.value)


def test_several_bad_values_are_one_message(car_file: Path) -> None:
    with pytest.raises(InvalidInput, match=r"lf_m = 0 .*drive_front_share = 2 "):
        Vehicle.from_toml(car_file).replace(lf_m=0.0, drive_front_share=2)


def test_model_cars_are_allowed(car_file: Path) -> None:
    model = Vehicle.from_toml(car_file).replace(
        mass_kg=3.2, yaw_inertia_kgm2=0.05, lf_m=0.16, lr_m=0.17, cg_height_m=0.03
    )
    assert model.wheelbase_m == pytest.approx(0.33)


def test_replace_refuses_unknown_fields(car_file: Path) -> None:
    car = Vehicle.from_toml(car_file)
    with pytest.raises(InvalidInput, match="did you mean 'mass_kg'"):
        car.replace(mass_kgs=1.0)
    with pytest.raises(InvalidInput, match="unknown key 'G'"):
        car.tyre_front.replace(G=1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        car.mass_kg = 1.0  # type: ignore[misc]
    assert car.tyre_front.replace(D=0.9).D == 0.9


def test_files_that_are_not_there(tmp_path: Path, car_file: Path) -> None:
    with pytest.raises(InvalidInput, match=r"none\.toml: cannot be read .*check the path"):
        Vehicle.from_toml(tmp_path / "none.toml")
    with pytest.raises(InvalidInput, match=r"cannot be written .*folder that exists"):
        Vehicle.from_toml(car_file).to_toml(tmp_path / "no" / "car.toml")


def test_prints_text_and_html(car_file: Path) -> None:
    car = Vehicle.from_toml(car_file).replace(name="a <b>")
    assert "mass_kg" in str(car)
    assert "1500" in str(car)
    assert "a &lt;b&gt;" in car._repr_html_()
    assert "B 12, C 1.3, D 1.1, E -0.5" in car._repr_html_()


@pytest.mark.parametrize("car", ["revs_250lm", "carsim_like_handling", "tum_devbot_sim"])
def test_shipped_vehicle_files_are_read_without_a_word(repo: Path, car: str) -> None:
    folder = repo / "benchmarks" / "real_driving"
    assert Vehicle.from_toml(folder / f"{car}.vehicle.toml").yaw_inertia_kgm2 is not None
